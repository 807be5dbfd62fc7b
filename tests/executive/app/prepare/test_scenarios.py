"""Scenarios: what a file says, what the seed draws, where the doors are, and what is refused with its line."""

import json
import math
import re
from dataclasses import replace

import pytest

from executive.app.prepare.scenarios import doorway, read_scenario, with_events, with_scenario
from executive.app.prepare.worlds import knowledge_of, open_world
from executive.mission.request import Request
from executive.mission.request_fields import command_of
from executive.mission.scenario import Scenario
from executive.words.knowledge import Door, Knowledge, ObjectFacts, Person, Place, Pose, SurfaceFacts
from executive.words.mission import Route
from skills.grid_map import load_grid_map
from skills.inputs.errors import InputError
from tests.tables import yaml_beside

WORLD = open_world("flat")
KNOWLEDGE = knowledge_of(WORLD)
EVENTS = """\
events:
  - {door: [kitchen, living room], closes: 5}
  - {person: Robin, at: 2, to: hall}
  - {object: beer, at: 3, to: kitchen table}
"""


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "scenario.yaml"
    path.write_text(EVENTS, encoding="utf-8")
    return path


def understood(**asked):
    return with_scenario(Request("go", **asked), WORLD, KNOWLEDGE, ["Alice", "Bob"])


def test_random_faults_are_drawn_from_the_seed_and_only_once():
    asked = understood(scenario=Scenario(("arm refuses",), random=2), seed=4)
    again = understood(scenario=Scenario(("arm refuses",), random=2), seed=4)
    other = understood(scenario=Scenario(("arm refuses",), random=2), seed=5)
    assert (asked, len(asked.scenario.faults)) == (again, 3)
    assert asked.scenario.faults != other.scenario.faults
    assert with_scenario(asked, WORLD, KNOWLEDGE, ["Alice"]) == asked


def test_the_line_that_repeats_a_run_names_the_scenario_as_it_was_given(file):
    asked = understood(scenario_files=(file,), scenario=Scenario(("arm refuses",), random=2), seed=4)
    given = f"errand run --say=go --seed=4 '--fault=arm refuses' --random-faults=2 --scenario={file}"
    assert command_of(asked) == command_of(Request.from_json(asked.to_json())) == given
    assert command_of(with_scenario(asked, WORLD, KNOWLEDGE, ["Alice", "Bob"])) == given


def test_a_fault_of_a_camera_that_spot_does_not_have_is_refused():
    with pytest.raises(InputError, match="no camera 'hnad'; did you mean 'hand'"):
        understood(scenario=Scenario(("camera.hnad: dropout",)))


def test_events_happen_in_the_world(file):
    scenario = understood(scenario_files=(file,)).scenario
    world = with_events(WORLD, scenario)
    assert [(door.name, door.closes) for door in world.doors] == [("door between kitchen and living room", 5.0)]
    assert [(move.name, move.to) for move in world.moves] == [("beer", "kitchen table")]
    (robin,) = (rule for rule in world.seed_rules.people if rule.name == "Robin")
    assert (robin.ranges is not None, robin.route.start) == (True, 2.0)


def test_two_scenarios_that_move_the_same_are_refused(file, tmp_path):
    other = tmp_path / "other.yaml"
    other.write_text("events:\n  - {person: Robin, at: 9, to: office}\n", encoding="utf-8")
    with pytest.raises(InputError, match="another scenario has an event of Robin"):
        understood(scenario_files=(file, other))


@pytest.mark.parametrize("door", KNOWLEDGE.doors, ids=lambda door: "-".join(door.between))
def test_a_door_is_as_wide_as_its_opening_and_slides_along_the_wall(door):
    grid, along_y = load_grid_map(WORLD.surveyed.scan_map_path), door.at[0] == 7.45
    x, y = door.at
    found = doorway(grid, (x, y + 0.1) if along_y else (x + 0.1, y))
    assert found["width"] == pytest.approx(door.width, abs=0.07)
    assert found["at"] == pytest.approx(door.at, abs=0.05)
    assert abs((math.cos if along_y else math.sin)(found["yaw"])) < 0.01


def test_a_request_with_a_scenario_is_another_one_than_without():
    assert replace(Request("go"), scenario=Scenario(("arm refuses",))) != Request("go")


SQUARE = ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0))
TWO_ROOMS = Knowledge(
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
        return read_scenario(path, TWO_ROOMS, cameras=("hand",), objects=OBJECTS, people=people)

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


def test_a_fault_may_name_its_robot():
    scenario = understood(scenario=Scenario(("bob: camera freezes at 3 s", "arm refuses"))).scenario
    assert scenario.faults == ("bob: camera freezes at 3 s", "arm refuses")


@pytest.mark.parametrize(
    ("words", "message", "hint"),
    [("alise: camera freezes at 3 s", "there is no robot 'alise'", "did you mean 'Alice'?"),
     ("charles: camera fails", "there is no robot 'charles'", "known are Alice and Bob"),
     ("bob: lidar droput", "there is no fault 'lidar droput'", "did you mean 'lidar dropout'?"),
     ("odometry slips", "there is no fault 'odometry slips'", "did you mean 'odometry jumps 0.5 m'?")],
)  # fmt: skip
def test_a_misspelt_robot_or_fault_is_refused_with_the_likely_one(words, message, hint):
    with pytest.raises(InputError) as error:
        understood(scenario=Scenario((words,)))
    assert (error.value.message, error.value.hint) == (message, hint)


@pytest.mark.parametrize("count", [40, 41, 2000])
def test_more_people_than_can_be_simulated_are_refused_in_one_line(read, count):
    lines = [f"  - {{person: P{n}, from: hall, to: kitchen, at: {n}}}" for n in range(count)]
    if count == 40:
        assert len(read("\n".join(["events:", *lines])).people) == 40
        return
    with pytest.raises(InputError, match="at most 40 people have events") as refused:
        read("\n".join(["events:", *lines]))
    assert (refused.value.line, refused.value.others) == (42, ())
