"""Objects and spots with relations in mission files: their texts, and errors with line and hint."""

import pytest

from executive.app.prepare.worlds import knowledge_of, open_world
from executive.mission.load import load_mission
from executive.mission.resolve import mission_from_file
from executive.tree.compiler import compile_mission
from executive.words.leaf_steps import Do
from executive.words.phrase import ObjectPhrase, SpotPhrase
from skills.inputs.errors import InputError
from tests.project import core_skills
from tests.tables import table


@pytest.mark.parametrize(*table(__file__, "objects"))
def test_an_object_has_a_text_from_which_its_mapping_is_written_again(phrase, text):
    assert str(ObjectPhrase.model_validate(phrase)) == text
    assert str(ObjectPhrase.of(text)) == text


@pytest.mark.parametrize(*table(__file__, "spots"))
def test_a_spot_has_a_text_from_which_its_mapping_is_written_again(phrase, text):
    assert str(SpotPhrase.model_validate(phrase)) == text
    assert str(SpotPhrase.of(text)) == text


def test_a_step_is_written_as_a_mapping_again():
    step = Do.model_validate({"do": "grasp", "object": {"name": "coke", "left_of": "beer"}, "to": "kitchen"})
    assert Do.from_command(step.command).model_dump(exclude_none=True, by_alias=True)["object"] == {
        "name": "coke",
        "left_of": "beer",
    }


def mission(tmp_path, step):
    path = tmp_path / "m.yaml"
    path.write_text(f"name: m\nworld: flat\nsteps:\n  - {step}\n")
    return path


@pytest.mark.parametrize(*table(__file__, "refused"))
def test_a_wrong_mapping_is_refused_with_its_line(step, says, hint, tmp_path):
    with pytest.raises(InputError) as refused:
        load_mission(mission(tmp_path, step))
    assert says in refused.value.message
    assert hint in refused.value.hint
    assert refused.value.line == 4


@pytest.mark.parametrize(*table(__file__, "unknown"))
def test_names_that_the_world_lacks_are_refused_with_their_line(step, says, hint, tmp_path):
    knowledge = knowledge_of(open_world("flat"))
    with pytest.raises(InputError) as refused:
        found = mission_from_file(mission(tmp_path, step), parser=None, knowledge=knowledge)
        compile_mission(found, knowledge=knowledge, registry=core_skills())
    assert says in refused.value.message
    assert hint in refused.value.hint
    assert refused.value.line == 4
