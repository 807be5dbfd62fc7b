"""Scenario files: what they say, and what is refused with its line."""

import pytest

from executive.app.scenarios import read_scenario
from executive.mission.request import Request
from executive.words.knowledge import Door, Knowledge, ObjectFacts, Person, Place, Pose, SurfaceFacts
from executive.words.mission import Distraction, Route
from skills.files.errors import InputError

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


def event(text):
    return f"events:\n  - {text}\n"


def test_an_empty_scenario_is_none(read):
    assert not read("faults: []\n")


def test_faults_and_how_many_the_seed_draws(read):
    scenario = read('faults: ["camera.hand: dropout 5 s at 20 s", drive refuses]\nrandom: 2\n')
    assert (scenario.faults, scenario.random) == (("camera.hand: dropout 5 s at 20 s", "drive refuses"), 2)


@pytest.mark.parametrize("at", ["20", "20.0", "20 s", "20s"])
def test_a_person_walks_to_a_place_at_a_time(read, at):
    scenario = read(event(f"{{person: the boss, at: {at}, to: kitchen}}"))
    route = {
        "start": 20.0,
        "speed": 1.2,
        "loop": False,
        "yields": True,
        "waypoints": [{"at": (1.0, 2.0), "pause": 0.0}],
    }
    assert scenario.people == {"Robin": route}


def test_a_new_person_walks_along_several_places(read):
    scenario = read(event("{person: Sam, at: 2, from: hall, to: [kitchen, {at: [3, 2], pause: 4}], speed: 0.8}"))
    stops = [(stop["at"], stop["pause"]) for stop in scenario.people["Sam"]["waypoints"]]
    assert stops == [((5.0, 2.0), 0.0), ((1.0, 2.0), 0.0), ((3.0, 2.0), 4.0)]


def test_a_new_person_follows_a_robot_and_is_distracted(read):
    scenario = read(event("{person: Sam, from: hall, follows: robot, distractions: [{after: 4, back: 2}], pace: 0.2}"))
    route = scenario.people["Sam"]
    assert [stop["at"] for stop in route["waypoints"]] == [(5.0, 2.0)]
    assert Route.model_validate(route).distractions == (Distraction(after=4.0, back=2.0),)
    assert scenario.lines() == ("Sam is ready to follow at 0 s",)


def test_a_person_of_the_world_wanders_from_where_they_stand(read):
    route = read(event("{person: Robin, wanders: true}")).people["Robin"]
    assert (route["waypoints"], route["wanders"]) == ([], True)


def test_a_crowd_and_the_answers_of_people(read):
    scenario = read("crowd: 4\nanswers: {the boss: {drink: 'yes'}}\n")
    assert (scenario.crowd, scenario.answers) == (4, {"Robin": {"drink": "yes"}})
    assert scenario.lines() == ("a crowd of 4 wanders about",)
    back = Request.from_json(Request(scenario=scenario).to_json()).scenario
    assert (back.crowd, back.answers) == (scenario.crowd, scenario.answers)


def test_a_door_is_named_by_its_rooms_in_any_order(read):
    (door,) = read(event("{door: [hall, kitchen], closes: 10 s, opens: 40 s}")).doors
    wanted = ("door between kitchen and hall", (3.0, 2.0), 0.9, 10.0, 40.0)
    assert tuple(door[key] for key in ("name", "at", "width", "closes", "opens")) == wanted


@pytest.mark.parametrize(
    ("said", "name", "to"), [("coke_2", "coke_2", "table"), ("coke", "coke_1", "table"), ("hammer", "hammer", "table")]
)
def test_an_object_is_named_by_itself_or_its_class(read, said, name, to):
    (move,) = read(event(f"{{object: {said}, at: 15 s, to: {to}}}")).moves
    assert move == {"name": name, "at": 15.0, "to": to}


def test_an_object_is_put_at_a_point(read):
    (move,) = read(event("{object: hammer, at: 15, to: [1.0, 2, 0]}")).moves
    assert move["to"] == (1.0, 2.0, 0.0)


def test_a_scenario_comes_back_from_the_json_of_its_request(read):
    scenario = read(
        "faults: [arm refuses]\nevents:\n  - {person: Robin, at: 1, to: kitchen}\n"
        "  - {door: [hall, kitchen], opens: 4}\n  - {object: coke, at: 1, to: table}\n"
    )
    text = Request(scenario=scenario).to_json()
    back = Request.from_json(text).scenario
    assert Request(scenario=back).to_json() == text
    assert back.lines() == scenario.lines() == (
        "fault: arm refuses",
        "Robin sets off at 1 s",
        "the door between kitchen and hall opens at 4 s",
        "somebody moves the coke_1 to the table at 1 s",
    )  # fmt: skip


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("faults: [camra freezes]\n", ":1: 'camra' is no verb of the robot; did you mean 'camera'"),
        ("faults:\n  - arm refuses\n  - camera freeses at 3 s\n", ":3: .*did you mean 'camera freezes at 3 s'"),
        ("fautls: [arm refuses]\n", "unknown key 'fautls'; did you mean 'faults'|none of its keys is known"),
        ("random: -1\n", ":1: random: should be"),
        (event("{at: 3, to: hall}"), "exactly one of 'person', 'door' and 'object'"),
        (event("{person: Robin, door: [hall, kitchen], at: 3, to: hall}"), "exactly one"),
        (event("{person: Robin, at: 3}"), "a person needs 'at' and 'to'"),
        (event("{person: Sam, wanders: true}"), "there is no Sam in the world; add 'from'"),
        (event("{person: Robin, wanders: true, distractions: 50}"), ":2: events.0.distractions"),
        ("crowd: 11\n", ":1: crowd: should be"),
        ("answers: {Robni: {drink: tea}}\n", ":1: there is no Robni in the world; did you mean 'Robin'"),
        (event("{person: Robin, at: soon, to: hall}"), ":2: events.0.at"),
        (event("{person: Robin, at: 3, to: hal}"), ":2: unknown place 'hal'; did you mean 'hall'"),
        (event("{person: Robni, at: 3, to: hall}"), "there is no Robni in the world; did you mean 'Robin'"),
        (event("{person: Sam, at: 3, to: hall}"), "there is no Sam in the world; add 'from'"),
        (event("{person: Kim, at: 3, to: hall}"), "Kim walks already"),
        (event("{person: Robin, at: 3, to: hall, from: kitchen}"), "Robin stands in the world already"),
        (event("{person: Robin, at: 3, to: [1, 2, 0]}"), "a person walks to a point"),
        (
            event("{person: Robin, at: 3, to: hall}") + "  - {person: Robin, at: 9, to: kitchen}\n",
            ":3: .*event already",
        ),
        (event("{door: [hall, kitchen]}"), "a door needs 'closes' or 'opens'"),
        (event("{door: [hall, kitchen], closes: 1, to: hall}"), "a door has no key 'to'"),
        (event("{door: [hall, garden], closes: 1}"), "no door is known between hall and garden; known are kitchen"),
        (event("{object: coke, at: 3, to: [1, 2]}"), "to a surface, or to a point"),
        (event("{object: coke, at: 3, to: kitchen}"), "'kitchen' is no surface"),
        (event("{object: cook, at: 3, to: table}"), "there is no 'cook' in the world; did you mean 'coke'"),
    ],
)
def test_errors_name_their_line(read, text, says):
    with pytest.raises(InputError, match=says):
        read(text)


def test_all_that_is_wrong_is_said_at_once(read):
    with pytest.raises(InputError) as refused:
        read("faults: [camra freezes]\n" + event("{person: Robin, at: 3, to: hal}"))
    assert len(refused.value.others) == 1
