"""The facts of a team stand beside the knowledge file, and a wrong line is named."""

import pytest

from errand_home.facts import FACTS_FILE, facts_of
from executive.app.prepare.worlds import knowledge_of, open_world
from executive.words.knowledge import Knowledge, load_knowledge
from skills.inputs.errors import InputError


@pytest.fixture
def home():
    return knowledge_of(open_world("home"))


def test_home_has_a_team_a_quiz_and_a_weight_for_each_object(home):
    facts = facts_of(home)
    assert facts.team is not None and facts.team.country == "Switzerland"
    assert all(each.question and each.answer for each in facts.quiz)
    assert {*facts.weights} == {*home.things}


def test_each_object_of_home_is_in_one_of_seven_categories(home):
    assert {len(facts.categories) for facts in home.things.values()} == {1}
    assert len(home.categories()) == 7


def test_the_weights_are_those_of_the_models(home):
    masses = {name: each.object.mass_kg for name, each in open_world("home").imports.items()}
    assert facts_of(home).weights == pytest.approx(masses)


def test_a_world_without_facts_has_none():
    flat = knowledge_of(open_world("flat"))
    assert (facts_of(flat).team, facts_of(flat).weights) == (None, {})
    assert facts_of(Knowledge.model_validate({"start": {"x": 0, "y": 0, "yaw": 0}})).quiz == ()


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("weights:\n  coke: 0.3\n  cokee: 0.3\n", "facts.yaml:3: weights.cokee: no class of objects in knowledge.yaml"),
        ("weights: {coke: -1}\n", "facts.yaml:1: weights.coke"),
        ("teams: {}\n", "facts.yaml:1: unknown key 'teams'"),
        ("team: {name: us}\n", "facts.yaml:1: key 'country' is missing in team"),
    ],
)
def test_a_wrong_line_is_named(tmp_path, text, says):
    start = "start: {x: 0.0, y: 0.0, yaw: 0.0}\nthings: {coke: {}}\n"
    (tmp_path / "knowledge.yaml").write_text(start)
    (tmp_path / FACTS_FILE).write_text(text)
    with pytest.raises(InputError) as error:
        facts_of(load_knowledge(tmp_path / "knowledge.yaml"))
    assert says in str(error.value)
