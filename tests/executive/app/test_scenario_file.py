"""Scenario files: what they say, and what is refused with its line."""

import json
import re

import pytest

from executive.app.scenarios import read_scenario
from executive.mission.request import Request
from executive.words.knowledge import Door, Knowledge, ObjectFacts, Person, Place, Pose, SurfaceFacts
from executive.words.mission import Route
from skills.files.errors import InputError
from tests.tables import yaml_beside

SQUARE = ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0))
KNOWLEDGE = Knowledge(
    start=Pose(x=0.0, y=0.0),
    places={name: Place(pose=Pose(x=x, y=2.0), polygon=SQUARE) for name, x in (("kitchen", 1.0), ("hall", 5.0))},
    doors=(Door(between=("kitchen", "hall"), at=(3.0, 2.0), width=0.9),),
    surfaces={"table": SurfaceFacts(place="kitchen", height=0.7, polygon=SQUARE, viewpoints=(Pose(x=0.5, y=2.0),))},
    things={"coke": ObjectFacts(categories=("drink",))},
    people={"Robin": Person(at="hall", aliases=("the boss",))},
)
OBJECTS = {"coke_1": "coke", "coke_2": "coke", "hammer": "hammer"}


@pytest.fixture
def read(tmp_path):
    """The scenario of a file's text."""

    def made(text):
        path = tmp_path / "scenario.yaml"
        path.write_text(text, encoding="utf-8")
        people = {"Robin": False, "Kim": True}
        return read_scenario(path, KNOWLEDGE, cameras=("hand",), objects=OBJECTS, people=people)

    return made


SCENARIOS = yaml_beside(__file__, "scenarios.yaml")


@pytest.mark.parametrize("case", SCENARIOS, ids=lambda case: case["name"])
def test_a_scenario_says_what_its_file_says_and_comes_back_from_the_json_of_its_request(read, case):
    scenario = read(case["input"])
    text = Request(scenario=scenario).to_json()
    assert (json.loads(text).get("scenario"), bool(scenario)) == (case.get("scenario"), "scenario" in case)
    assert list(scenario.lines()) == case["lines"]
    back = Request.from_json(text).scenario
    assert (Request(scenario=back).to_json(), list(back.lines())) == (text, case["lines"])
    for route in scenario.people.values():
        assert Route.model_validate(route).model_dump(mode="json", exclude_unset=True) == json.loads(json.dumps(route))


REFUSED = yaml_beside(__file__, "refused_scenarios.yaml")


@pytest.mark.parametrize("case", REFUSED, ids=lambda case: case["message"])
def test_errors_name_their_line(read, case):
    with pytest.raises(InputError, match=re.escape(case["message"])) as refused:
        read(case["input"])
    assert refused.value.line == case["line"]


def test_all_that_is_wrong_is_said_at_once(read):
    with pytest.raises(InputError) as refused:
        read("faults: [camra freezes]\nevents:\n  - {person: Robin, at: 3, to: hal}\n")
    assert len(refused.value.others) == 1
