"""Scenario files become runs."""

import re

import pytest

from executive.app.evaluate.evaluation_file import is_evaluation, load_evaluation
from skills.inputs.errors import InputError
from tests.tables import yaml_beside


def load(tmp_path, text):
    file = tmp_path / "scenario.yaml"
    file.write_text(text)
    return load_evaluation(file)


def test_the_runs_are_the_product_of_all_lists(tmp_path):
    text = "missions: [go to the hall]\nworlds: [flat, shop]\nseeds: 1-3\n"
    text += "variations: {light: [normal, dim], people: [0, 1]}\n"
    evaluation = load(tmp_path, text)
    # 1 mission x 2 worlds x 2 lights x 2 numbers of people x 3 seeds
    assert (len(evaluation.runs), len({run.id for run in evaluation.runs})) == (24, 24)
    assert evaluation.runs[0].varied == {"light": "normal", "people": "0"}


def test_an_id_is_that_of_the_content_wherever_the_files_lie(tmp_path):
    ids = []
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "go.yaml").write_text("name: go\nsteps: [{to: hall}]\n")
        ids.append(load(tmp_path / name, "missions: [go.yaml]\nseeds: [1]\n").runs[0].id)
    (tmp_path / "b" / "go.yaml").write_text("name: go\nsteps: [{to: kitchen}]\n")
    changed = load(tmp_path / "b", "missions: [go.yaml]\nseeds: [1]\n").runs[0].id
    assert (ids[0] == ids[1], changed == ids[0]) == (True, False)


REFUSED = yaml_beside(__file__, "refused_evaluations.yaml")


@pytest.mark.parametrize("case", REFUSED, ids=lambda case: case["message"])
def test_errors_name_their_line(tmp_path, case):
    where = f"{case['place']}: " if "place" in case else ""
    with pytest.raises(InputError, match=re.escape(where + case["message"])):
        load(tmp_path, case["input"])


def test_a_mission_file_is_no_evaluation_file(tmp_path):
    file = tmp_path / "go.yaml"
    file.write_text("name: go\nsteps: [{to: hall}]\n")
    assert not is_evaluation(file)
