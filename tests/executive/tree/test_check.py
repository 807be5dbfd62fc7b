"""What speaks against a mission before it runs, and what it will take."""

import math
from dataclasses import replace

import numpy as np
import pytest

from executive.tree.check import Abilities, PlannedRoutes, check_tree
from executive.tree.compiler import compile_mission
from executive.tree.estimate import Route, load_estimates
from executive.words.command import parse_command
from executive.words.condition import Look
from executive.words.leaf_steps import Awaited, CallSkill, Do, Picture, Subject, Wait
from executive.words.mission import Mission
from executive.words.step import Place, Policy
from executive.words.steps import Group, Loop, Repeat, Together
from executive.words.zone import ZoneFacts
from plant.robots.spot.kind import SPOT
from skills.api import Part
from skills.estimate.costmap import LayeredCostmap
from skills.footprint import Footprint
from skills.grid_map import GridMap
from skills.inputs.yaml_source import YamlSource
from skills.navigate.planner import LatticePlanner
from skills.robot import Pose2D
from skills.world_model import Zone, ZoneKind

START = Pose2D(0.0, 0.0, 0.0)
MASSES = {"coke": 0.35, "beer": 0.55, "hammer": 0.5}
ABLE = Abilities(MASSES, 5.0, frozenset(MASSES), frozenset({"red"}))
GET = "Take [Nothing] to [kitchen] and do [grasp] to [{}]"
TAKE_COKE, BRING = GET.format("coke"), "Take [{}] to [{}] and do [Nothing] to [Nothing]"
GO = "Take [Nothing] to [{}] and do [Nothing] to [Nothing]"
FIND = "Take [Nothing] to [kitchen] and do [find] to [{}]"
BODY = Footprint.rectangle([(-0.3, -0.2), (0.3, -0.2), (0.3, 0.2), (-0.3, 0.2)])
ONLY_COKE = {"classes": frozenset({"coke"})}


class StraightRoutes:
    """Ways as the crow flies, `stretched` so many times; there is none to what lies beyond `far_m` in x."""

    def __init__(self, far_m=99.0, stretched=1.0):
        self.far_m, self.stretched, self.asked = far_m, stretched, []

    def route(self, start, goal, zones=()):
        self.asked.append((start, goal))
        if goal.x_m > self.far_m:
            raise ValueError(f"There is no way to ({goal.x_m:.2f}, {goal.y_m:.2f}).")
        length_m = ((goal.x_m - start.x_m) ** 2 + (goal.y_m - start.y_m) ** 2) ** 0.5 * self.stretched
        return Route(length_m, length_m)


@pytest.fixture
def check(knowledge, registry, tmp_path):
    """Checks commands given as texts, or skill calls, each on a line of its own."""

    def check_it(*steps, routes=None, **abilities):
        made = []
        for line, one in enumerate(steps, start=1):
            place = Place(YamlSource(tmp_path / "m.yaml", None, {}, first_line=line), ())
            step = Do.from_command(parse_command(one)) if isinstance(one, str) else one
            made.append(step.with_place(place) if isinstance(step, Do | CallSkill | Picture) else step)
        mission = Mission(name="m", robot="Alice", steps=tuple(made))
        tree = compile_mission(mission, knowledge=knowledge, registry=registry)
        return check_tree(
            tree,
            knowledge=knowledge,
            start=START,
            abilities=replace(ABLE, **abilities),
            planner=routes or StraightRoutes(),
            estimates=load_estimates(),
        )

    return check_it


def errors_in(checked):
    return [(error.line, error.message) for error in checked.errors]


def test_steps_together_take_as_long_as_those_that_must_be_done(check):
    drive, wait = Do.from_command(parse_command(GO.format("kitchen"))), Wait(awaited=Awaited(seconds=300.0))
    together = [Together(steps=(drive, wait), done_when=needed) for needed in (1, 2)]
    alone, either, both = (check(one).estimate for one in (drive, *together))
    assert alone.duration_s < 60
    assert either.duration_s == pytest.approx(alone.duration_s)
    assert (either.most_s, either.reasons) == (300.0, ("until the first of 2 steps is done",))
    assert (both.duration_s, both.distance_m) == (300.0, pytest.approx(alone.distance_m))


def test_a_good_mission_has_no_errors_and_an_estimate(check, make):
    checked = check(*make.FETCH)
    assert checked.errors == ()
    assert 50 < checked.estimate.duration_s < 120
    assert checked.estimate.distance_m == pytest.approx(2 * 4.6, abs=0.5)
    assert 0.001 < checked.estimate.charge < 0.02


def test_a_step_that_empties_the_battery_is_warned_of_with_its_line(check, registry):
    there, back = GO.format("kitchen"), GO.format("start")
    far = StraightRoutes(far_m=1e9, stretched=300.0)
    one_way = check(there, routes=far).estimate.charge
    assert 0.25 < one_way < 0.5
    trips = [there, back] * 2
    rest = CallSkill(skill="charge", values={"level": 0.8})
    tired, rested = (check(*steps, routes=far) for steps in (trips, [*trips[:2], rest, *trips[2:]]))
    assert [warning.line for warning in tired.warnings] == [1 + int(1.0 / one_way)]
    assert (tired.errors, rested.warnings) == ((), ())


def test_time_and_charge_follow_from_the_route(check):
    near = check(GO.format("kitchen")).estimate
    drive, use = load_estimates().drive, load_estimates().battery
    assert near.distance_m == 4.0
    assert near.duration_s == pytest.approx(drive.overhead_s + 4.0 * drive.per_metre_s)
    assert near.charge == pytest.approx(near.duration_s * use.driving_per_s)


def test_each_route_begins_where_the_last_one_ended(check):
    routes = StraightRoutes()
    check(*map(GO.format, ("kitchen", "bedroom", "start")), routes=routes)
    assert [(round(a.x_m), round(b.x_m)) for a, b in routes.asked] == [(0, 4), (4, -4), (-4, 0)]


def test_a_place_out_of_reach_is_refused_at_its_line(check):
    checked = check(GO.format("bedroom"), GO.format("kitchen"), routes=StraightRoutes(far_m=1.0))
    ((line, message),) = errors_in(checked)
    assert (line, "no way to" in message) == (2, True)
    assert checked.errors[0].hint


def test_a_search_goes_on_when_one_surface_is_out_of_reach(check):
    assert check(TAKE_COKE, routes=StraightRoutes(far_m=4.6)).errors == ()


def test_a_count_goes_to_all_surfaces_that_can_be_reached(check):
    near, every = StraightRoutes(far_m=4.6), StraightRoutes()
    assert check(FIND.format("some coke"), routes=near).errors == ()
    assert check(FIND.format("some coke"), routes=every).errors == check(FIND.format("coke")).errors
    assert len(every.asked) == 3


def test_a_raw_pose_out_of_reach_is_refused(check):
    call = CallSkill(skill="navigate", values={"x": 50.0, "y": 0.0})
    ((line, message),) = errors_in(check(call, routes=StraightRoutes(far_m=9.0)))
    assert (line, "50.00" in message) == (1, True)


@pytest.fixture
def walled():
    """A room of 4 m by 4 m with a wall in the middle that has no door."""
    occupied = [[x in (0, 79, 40) or y in (0, 79) for x in range(80)] for y in range(80)]
    return LayeredCostmap(GridMap(np.array(occupied), 0.05, (-2.0, -2.0)))


def test_routes_are_planned_on_the_map_for_the_whole_body(walled):
    routes = PlannedRoutes(walled, BODY, LatticePlanner())
    here = Pose2D(-1.0, -1.0, 0.0)
    assert routes.route(here, Pose2D(-1.0, 1.0, 0.0)).length_m == pytest.approx(2.0, abs=0.3)
    for _ in range(2):
        with pytest.raises(ValueError, match="no path"):
            routes.route(here, Pose2D(1.0, 1.0, 0.0))
    with pytest.raises(ValueError, match="blocked"):
        routes.route(here, Pose2D(-1.9, 1.0, 0.0))


SOUTH, NORTH = Pose2D(-1.0, -1.2, 1.57), Pose2D(-1.0, 1.2, 1.57)
STRIP = ((-2.0, -0.3), (0.05, -0.3), (0.05, 0.3), (-2.0, 0.3))


def zone(kind, corners=STRIP, **more):
    return Zone("strip", ZoneKind(kind), corners, **more)


@pytest.mark.parametrize(
    ("zones", "goal", "why"),
    [
        ((zone("keep_out"),), NORTH, r"^The strip is a keep-out zone\. No path leads to \(-1\.00, 1\.20\)\."),
        ((zone("keep_out"),), Pose2D(-1.0, 0.4, 0.0), r"^The strip is a keep-out zone\. The robot does not stand at"),
        ((zone("one_way", direction_rad=-1.57),), NORTH, "The strip is a one-way zone"),
        ((zone("keep_out"),), Pose2D(1.0, 1.0, 0.0), "no path"),
    ],
)
def test_a_goal_that_zones_forbid_is_refused_with_their_names(walled, zones, goal, why):
    with pytest.raises(ValueError, match=why):
        PlannedRoutes(walled, BODY, LatticePlanner()).route(SOUTH, goal, zones)


def test_a_robot_that_starts_in_a_keep_out_zone_leaves_it(walled):
    routes = PlannedRoutes(walled, BODY, LatticePlanner())
    assert routes.route(Pose2D(-1.0, 0.0, 1.57), NORTH, (zone("keep_out"),)).length_m == pytest.approx(1.2, abs=0.2)


def test_a_route_has_the_parts_under_a_speed_limit(walled):
    routes = PlannedRoutes(walled, BODY, LatticePlanner(), lambda: 0.8)
    free, slow = (routes.route(SOUTH, NORTH, zones) for zones in ((), (zone("speed_limit", share=0.25),)))
    assert free.limited == ()
    ((part_m, limit_m_s),) = slow.limited
    assert (part_m, limit_m_s) == (pytest.approx(1.3, abs=0.2), pytest.approx(0.2))


class SlowRoutes(StraightRoutes):
    """Routes of which all is under the limit of each zone."""

    def route(self, start, goal, zones=()):
        route = super().route(start, goal)
        return replace(route, limited=tuple((route.length_m, each.speed_m_s) for each in zones))


def test_a_speed_limit_of_a_group_counts_in_the_time_of_its_steps(check):
    drive = load_estimates().drive
    slow = ZoneFacts(kind=ZoneKind.SPEED_LIMIT, place="kitchen", speed=0.1)
    steps = [Do.from_command(parse_command(GO.format(place))) for place in ("kitchen", "hall")]
    whole = (Group(steps=(steps[0],), zones={"kitchen": slow}), steps[1])
    free, limited = (check(*each, routes=SlowRoutes()).estimate for each in (steps, whole))
    assert free.distance_m == limited.distance_m
    first_m = check(steps[0], routes=SlowRoutes()).estimate.distance_m
    slower_s = first_m / 0.1 - drive.per_metre_s * first_m
    assert limited.duration_s - free.duration_s == pytest.approx(slower_s)


DROPPED = CallSkill(skill="place", values={"surface": "counter"})

PUT_COKE, GIVE_COKE = BRING.format("coke", "counter"), BRING.format("coke", "Sam")

# steps -> lines of the errors
IN_GRIPPER = [
    ((TAKE_COKE, PUT_COKE), []),
    ((TAKE_COKE, TAKE_COKE, PUT_COKE), []),
    ((TAKE_COKE, GET.format("beer")), [2]),
    ((PUT_COKE,), [1]),
    ((TAKE_COKE, BRING.format("beer", "counter")), [2]),
    ((TAKE_COKE, PUT_COKE, BRING.format("coke", "shelf")), [3]),
    ((TAKE_COKE, GIVE_COKE, GET.format("beer")), []),
    ((TAKE_COKE, GIVE_COKE, TAKE_COKE), []),
    ((TAKE_COKE, GIVE_COKE, PUT_COKE), [3]),
    ((DROPPED,), [1]),
    ((TAKE_COKE, DROPPED, GET.format("beer")), []),
]


@pytest.mark.parametrize(("steps", "lines"), IN_GRIPPER)
def test_the_held_object_is_followed_step_by_step(check, steps, lines):
    assert [line for line, _ in errors_in(check(*steps))] == lines


DRIVE = CallSkill(skill="navigate", values={"x": 3.0, "y": 0.0})
FROM_SHELF = "Take [Nothing] to [shelf] and do [grasp] to [coke]"
TO_SHELF, TO_ROBIN, TO_START, TO_BEDROOM = (BRING.format("coke", to) for to in ("shelf", "Robin", "start", "bedroom"))
NARROW = {"widths_m": {"coke": 0.05, "beer": 0.1}, "opens_m": 0.09}
NO_ROBIN = "Robin is not in this world, or takes nothing"
NO_EYES = "this kind of robot has no camera"
NO_HANDS, HIGH = "this kind of robot has no gripper", "the shelf is 1 m high, and the arm reaches"


# steps, abilities; line, message and hint of the error
@pytest.mark.parametrize(
    ("steps", "abilities", "line", "message", "hint"),
    [
        ((GET.format("hammer"),), {"masses_kg": {"coke": 0.3}}, 1, "there is no 'hammer' that could be picked up", ""),
        ((GET.format("hammer"),), {"lift_kg": 0.4}, 1, "'hammer' is too heavy: 0.5 kg, and the arm lifts 0.4 kg", ""),
        ((GET.format("drink"),), ONLY_COKE, 1, "the robot does not know what beer looks like", ""),
        ((FIND.format("drink"),), ONLY_COKE, 1, "the robot does not know what beer looks like", ""),
        ((GET.format("blue coke"),), {}, 1, "the robot does not know what blue looks like", ""),
        ((GET.format("beer"),), NARROW, 1, "'beer' is too wide: 0.1 m, and the gripper takes 0.09 m", ""),
        ((TAKE_COKE, TO_SHELF), {"reaches_m": (0.0, 0.6)}, 2, f"{HIGH} up to 0.60 m", ""),
        ((TAKE_COKE, TO_SHELF), {"reaches_m": (1.1, 1.6)}, 2, f"{HIGH} down to 1.10 m", ""),
        ((FROM_SHELF,), {"reaches_m": (0.0, 0.6)}, 1, f"{HIGH} up to 0.60 m", ""),
        ((TAKE_COKE, TO_START), {"takers": set()}, 2, "nobody is in this world who could take the coke", "surface"),
        ((TAKE_COKE, TO_ROBIN), {"takers": {"Anna"}}, 2, f"{NO_ROBIN}, so nobody takes the coke", "name Anna"),
        ((GO.format("kitchen"), TAKE_COKE), {"gripper": False}, 2, f"{NO_HANDS} to take the coke with", ""),
        ((DRIVE, DROPPED), {"gripper": False}, 2, f"{NO_HANDS}, which place needs", ""),
        ((GO.format("kitchen"), FIND.format("coke")), {"looks": False}, 2, f"{NO_EYES} to look for the coke with", ""),
    ],
)
def test_a_step_that_the_robot_or_the_world_does_not_allow_is_refused(check, steps, abilities, line, message, hint):
    checked = check(*steps, **abilities)
    assert errors_in(checked) == [(line, message)]
    assert hint in checked.errors[0].hint


def test_a_skill_that_refuses_its_constant_inputs_is_an_error_at_its_line(check, registry):
    def refuses(cls, inputs, capabilities):
        lacks = inputs["camera"] not in {each.source for each in capabilities.cameras}
        return (f"no camera '{inputs['camera']}'", "name another") if lacks else None

    shots = [Picture(subject=Subject(of="shelf", camera=camera)) for camera in ("hand", "tail")]
    registry["take_picture"] = type("TakePicture", (registry["take_picture"],), {"refuses": classmethod(refuses)})
    assert errors_in(check(*shots, capabilities=SPOT.capabilities())) == [(2, "no camera 'tail'")]
    assert errors_in(check(*shots)) == []  # nothing is known of the robot


@pytest.mark.parametrize(
    ("lacking", "needs", "message"),
    [
        ("arm", {"uses": frozenset({Part.ARM})}, "this kind of robot has no arm, which stow needs"),
        ("looks", {"needs_camera": True}, f"{NO_EYES}, which stow needs"),
    ],
)
def test_a_skill_that_needs_what_the_robot_lacks_is_refused(check, registry, lacking, needs, message):
    registry["stow"] = type("Stow", (registry["stow"],), needs)
    stow = CallSkill(skill="stow", values={})
    assert errors_in(check(DRIVE, stow)) == []
    assert errors_in(check(DRIVE, stow, **{lacking: False})) == [(2, message)]


@pytest.mark.parametrize(
    ("steps", "abilities"),
    [
        ((GET.format("drink"),), {"lift_kg": 0.4}),  # one that is light enough will do
        ((GET.format("drink"),), NARROW),
        ((FIND.format("hammer"),), {"masses_kg": {}}),
        ((GO.format("shelf"),), {"reaches_m": (0.0, 0.6)}),
        ((TAKE_COKE, TO_SHELF), {"reaches_m": (0.0, 1.6)}),
        ((TAKE_COKE, TO_BEDROOM), {"takers": set()}),
        ((TAKE_COKE, TO_ROBIN), {"takers": {"Robin"}}),
    ],
)
def test_a_step_that_needs_no_more_than_there_is_is_taken(check, steps, abilities):
    assert errors_in(check(*steps, **abilities)) == []


def test_a_surface_that_is_full_by_what_surely_lies_there_is_warned_of(check, knowledge):
    (name,) = knowledge.surfaces_in("bedroom")
    sizes = {"widths_m": {"coke": 0.066}, "apart_m": 0.1}
    full, half = (check(TAKE_COKE, TO_BEDROOM, taken_m2={name: taken}, **sizes) for taken in (99.0, 0.01))
    warnings = [(one.line, one.message) for one in full.warnings]
    assert warnings == [(2, "the bedroom is probably full before the coke is put there")]
    assert (full.errors, half.warnings) == ((), ())


def test_rounds_until_something_holds_are_a_range_up_to_the_most_of_them(check):
    go = Do.from_command(parse_command(GO.format("kitchen")))
    look = Look.from_command(parse_command(FIND.format("coke")))
    loops = Loop(times=1), Loop(times=3), Loop(times=3, until=look), Loop(until=look)
    once, fixed, some, endless = (check(Repeat(loop=loop, steps=(go,))).estimate for loop in loops)
    assert once.spare_s == fixed.spare_s == 0.0
    assert some.reasons == ("1 to 3 rounds",)
    assert some.duration_s < some.most_s < math.inf
    assert endless.most_s == math.inf
    assert endless.reasons[0].startswith("until ")


def test_a_wait_for_a_time_of_day_is_a_range_with_that_time_as_its_reason(check):
    waited = check(Wait(awaited=Awaited(until_clock="18:00"))).estimate
    assert (waited.duration_s, waited.most_s, waited.reasons) == (0.0, 86400.0, ("until 18:00",))


def test_a_time_limit_bounds_the_range(check):
    limit = Policy(timeout_s=600.0)
    waited = check(Wait(awaited=Awaited(until_clock="18:00")).with_policy(limit)).estimate
    assert (waited.most_s, waited.reasons[0]) == (600.0, "600 s at most")
