"""Where the robot goes to look whether a door is open: before it, in the room on one side, or else on the other."""

import math

import pytest

from executive.tree.nodes.door_check import PLANS, BeforeDoor, KnownDoor, door_plan, doorway, view_of
from executive.tree.plan import PlanBuilder
from executive.words import leaf_steps as model
from executive.words.command import Command
from executive.words.knowledge import Door, Knowledge
from skills.doorway import DoorState, Doorway
from skills.inputs.errors import InputError
from skills.navigate.door_openers import HttpDoor
from skills.navigate.skill import Navigate
from skills.robot import Pose2D
from skills.small.back_off import BackOff
from skills.small.clear_costmap import ClearCostmap
from skills.small.doors import CheckDoor, OpenDoor
from tests.executive.tree.scripted import Leaf

SKILLS = {skill.name: skill for skill in (Navigate, CheckDoor, ClearCostmap, BackOff)}
SOUTH, NORTH = [[0, 0], [6, 0], [6, 4], [0, 4]], [[0, 4.1], [6, 4.1], [6, 8], [0, 8]]


def world(south=SOUTH, north=NORTH, at=(3.0, 4.05), **more):
    places = {
        name: {"pose": {"x": outline[0][0] + 1, "y": outline[0][1] + 1}, "polygon": outline}
        for name, outline in (("kitchen", south), ("hall", north))
    }
    door = {"between": ["kitchen", "hall"], "at": at, "width": 0.9}
    return Knowledge.model_validate({"start": {"x": 1, "y": 1}, "places": places, "doors": [door], **more})


def plan(knowledge, between=("kitchen", "hall")):
    builder = PlanBuilder(knowledge, SKILLS, "alice/m/1-check", "start", Command(), None)
    return door_plan(builder, between, "alice/m/1-check/answer")


def leaves(node, name):
    return [leaf for leaf in node.walk() if leaf.kind == "skill" and leaf.name == name]


def port(leaf, name):
    return leaf.options["inputs"][name].value


def test_it_goes_before_the_door_and_looks_and_else_does_so_from_the_other_side():
    check = plan(world())
    (looks,) = check.children
    assert (check.kind, check.path_id, looks.kind) == ("check", "alice/m/1-check", "selector")
    assert [[step.path_id.rpartition("/")[2] for step in side.children] for side in looks.children[1:]] == [
        ["near", "check-door"],
        ["near", "check-door"],
    ]
    goals = [port(leaf, "goal") for leaf in leaves(looks, "navigate")]
    assert goals == [Pose2D(3.0, 2.55, 1.5708), Pose2D(3.0, 5.55, -1.5708)]


def test_the_skill_learns_where_the_door_is_and_answers_under_the_key():
    for leaf in leaves(plan(world()), "check_door"):
        assert (port(leaf, "middle_W"), port(leaf, "width_m")) == ((3.0, 4.05), 0.9)
        assert abs(math.cos(port(leaf, "through_rad"))) < 1e-9
        assert port(leaf, "door") == "door between kitchen and hall"
        assert leaf.options["outputs"] == {"open": "alice/m/1-check/answer"}


def test_a_robot_with_a_barred_path_looks_from_where_it_stands():
    near = plan(world()).children[0].children[1].children[0]
    assert [near.kind, *(child.kind for child in near.children)] == ["selector", "recover", "pause"]


def test_the_side_from_which_there_are_more_ways_comes_first():
    cellar = {"pose": {"x": 9, "y": 6}, "polygon": [[6.1, 4.1], [9, 4.1], [9, 8], [6.1, 8]]}
    told = world().model_dump()
    told["places"]["cellar"] = cellar
    told["doors"] = (*told["doors"], {"between": ["cellar", "hall"], "at": (6.05, 6.0), "width": 0.9})
    (looks,) = plan(Knowledge.model_validate(told)).children
    assert [side.name for side in looks.children[1:]] == ["look from the hall", "look from the kitchen"]


def test_a_door_with_a_plug_in_is_opened_by_it():
    told = world().model_dump()
    told["doors"][0]["opens"] = {"plugin": "http", "url": "http://door/open"}
    knowledge = Knowledge.model_validate(told)
    assert doorway(knowledge, knowledge.doors[0]).opener == HttpDoor("http://door/open")
    builder = PlanBuilder(knowledge, {**SKILLS, "open_door": OpenDoor}, "alice/m/1-open", "start", Command(), None)
    step = model.OpenDoor(door=model.DoorToOpen(door=("kitchen", "hall")))
    (tree,) = PLANS[model.OpenDoor](None, step, builder).nodes
    names = [leaf.name for leaf in tree.walk() if leaf.kind == "skill" and leaf.name not in SKILLS]
    assert names == ["open_door"]


@pytest.mark.parametrize(
    ("opens", "message"),
    [
        ({"plugin": "htp", "url": "http://door"}, "plugin: no plug-in 'htp' opens doors"),
        ({"plugin": "http", "url": "ftp://door"}, "url: should"),
        ({"plugin": "http"}, "url: is missing"),
    ],
)
def test_a_wrong_plug_in_is_refused_with_its_door(opens, message):
    told = world().model_dump()
    told["doors"][0]["opens"] = opens
    knowledge = Knowledge.model_validate(told)
    with pytest.raises(InputError, match=f"'opens' of the door between kitchen and hall .*: {message}"):
        doorway(knowledge, knowledge.doors[0])


def test_path_ids_are_unique():
    ids = [node.path_id for node in plan(world()).walk()]
    assert len(ids) == len(set(ids))


def test_a_door_in_the_corner_of_a_room_is_gone_through_across_its_own_wall():
    (leaf, *_) = leaves(plan(world(at=(0.5, 4.05))), "check_door")
    assert abs(math.cos(port(leaf, "through_rad"))) < 1e-9


def test_in_a_corridor_the_robot_stands_along_the_wall():
    view = view_of(knowledge := world(north=[[0, 4.1], [6, 4.1], [6, 5.7], [0, 5.7]]), knowledge.doors[0], "hall")
    assert view is not None
    assert (view.x_m, view.y_m) == (3.0, 5.25)
    assert abs(math.sin(view.yaw_rad)) < 1e-3


def test_a_robot_looks_from_aside_when_furniture_stands_before_the_door():
    table = {"place": "kitchen", "height": 0.7, "polygon": [[2.6, 0.6], [3.6, 0.6], [3.6, 3.2], [2.6, 3.2]]}
    table["viewpoints"] = [{"x": 1, "y": 1}]
    knowledge = world(surfaces={"table": table})
    view = view_of(knowledge, knowledge.doors[0], "kitchen")
    assert view is not None
    assert view.x_m < 2.6 or view.x_m > 3.6


def test_a_room_too_small_to_stand_in_is_left_out():
    looks = plan(world(south=[[2.5, 3.5], [3.5, 3.5], [3.5, 4], [2.5, 4]]))
    assert [port(leaf, "goal").y_m for leaf in leaves(looks, "navigate")] == [5.55]


def test_a_robot_looks_from_where_it_stands_when_no_place_is_better():
    small = [[2.5, 3.5], [3.5, 3.5], [3.5, 4], [2.5, 4]]
    looks = plan(world(south=small, north=[[2.5, 4.1], [3.5, 4.1], [3.5, 4.6], [2.5, 4.6]]))
    assert [port(leaf, "goal").y_m for leaf in leaves(looks, "navigate")] == [4.5, 5.1]


def test_a_door_that_is_not_known_is_refused():
    with pytest.raises(InputError, match="no door between kitchen and cellar"):
        plan(world(), ("kitchen", "cellar"))


def test_a_door_where_two_rooms_meet_without_a_wall():
    knowledge = world(north=[[2, 4], [3, 4], [3, 8], [2, 8]], at=(2.5, 4.0))
    assert view_of(knowledge, Door(between=("kitchen", "hall"), at=(2.5, 4.0), width=0.9), "hall") == Pose2D(
        2.5, 5.5, -1.5708
    )


DOOR = doorway(world(), world().doors[0])


@pytest.mark.parametrize(("middle_W", "looks"), [((0.0, 1.5), True), ((0.0, 3.5), False), ((1.8, 0.5), False)])
def test_a_robot_before_the_door_looks_from_there(context, middle_W, looks):
    door = Doorway(middle_W, 0.9, math.pi / 2)
    node = BeforeDoor(path_id="a", name="", children=[Leaf("S")], door=door, context=context)
    assert node.applies() is looks


# State and age (s) of what is known -> whether it counts for a condition with `max_age_s: 60`, and as open.
@pytest.mark.parametrize(
    ("state", "age_s", "counts", "is_open"),
    [
        (DoorState.OPEN, 50.0, True, True),
        (DoorState.CLOSED, 50.0, True, False),
        (DoorState.OPEN, 70.0, False, None),
        (DoorState.UNKNOWN, 0.0, False, None),
    ],
)
def test_knowledge_of_a_door_answers_while_it_is_new(context, clock, state, age_s, counts, is_open):
    context.door_memory.note(DOOR, state, clock.now())
    clock.advance(age_s)
    known = KnownDoor(path_id="a", name="", door=DOOR, max_age_s=60.0, key="alice/open", context=context)
    assert known.applies() is counts
    if counts:
        known.tick_once()
        assert context.board.get("alice/open") is is_open


def test_only_a_condition_with_an_age_uses_what_is_known():
    builder = PlanBuilder(world(), SKILLS, "alice/m/1-check", "start", Command(), None)
    kinds = [child.kind for child in door_plan(builder, ("kitchen", "hall"), "k", 60.0).children]
    assert kinds == ["known door", "check"]
    assert all(node.kind != "known door" for node in plan(world()).walk())
