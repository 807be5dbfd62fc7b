"""Tests of finding the pose again after the robot was carried away."""

import dataclasses
import math

import numpy as np
import pytest
from analytic_scan import scan_of
from planar_robot import TWO_ROOMS, Bench, Box
from tag_pictures import picture_of

from plant.robots.robot_kind import robot_kind
from skills.api import Cause, Failed, Succeeded, Tag
from skills.estimate.monte_carlo import MonteCarloOptions
from skills.estimate.particle_filter import FilterOptions
from skills.robot import FrameTree, Intrinsics, Pose2D
from skills.small.relocalise import FreeSpaceOptions, Relocalise, RelocaliseInputs, can_turn, free_m, obstacles_B
from skills.testing.estimators import KnownPlace
from skills.testing.robot import BASE_ONLY as BODY

START = Pose2D(1.5, 2.0, 0.0)
FAR = Pose2D(8.0, 2.3, 2.0)
CLOSET = (Box(-1, -1, 1, -0.6), Box(-1, 0.6, 1, 1), Box(-1, -0.6, -0.8, 0.6), Box(0.8, -0.6, 1, 0.6))
TWIN_ROOMS = (
    Box(-0.1, -0.1, 10.1, 0.0),
    Box(-0.1, 7.0, 10.1, 7.1),
    Box(-0.1, 0.0, 0.0, 7.0),
    Box(10.0, 0.0, 10.1, 7.0),
    Box(4.95, 0.0, 5.05, 4.0),
    Box(0.0, 4.0, 2.0, 4.1),
    Box(3.0, 4.0, 7.0, 4.1),
    Box(8.0, 4.0, 10.0, 4.1),
    Box(1.0, 6.0, 2.4, 7.0),
)
"""Two rooms alike, turned by nothing, under a corridor that has a cupboard at one end; wide doors."""
OPTIONS = FreeSpaceOptions(side_m=0.15, ahead_m=0.3)


def outcome(bench, context=None, **inputs):
    """Runs the skill to its end; the last step, and what it said on the way."""
    skill, said = Relocalise(context or bench.context()), []
    step = skill.step
    skill.step = lambda: said.append(step()) or said[-1]
    last = bench.run(skill, RelocaliseInputs(**inputs), limit_s=120.0)
    return last, list(dict.fromkeys(each.message for each in said[:-1]))


def lost_bench(to, **options):
    """A robot that was carried off, and whose localiser has noticed."""
    bench = Bench(START, **options)
    bench.tick(10)
    bench.robot.carry_off(to)
    bench.tick(12)
    assert not bench.localiser.estimate().localised
    return bench


def test_it_finds_the_robot_anywhere_standing_still():
    bench = lost_bench(FAR)
    step, said = outcome(bench)
    assert isinstance(step, Succeeded), step
    assert bench.pose_error()[0] < 0.04
    assert bench.robot.travelled_m == 0.0
    assert "searching the whole map" in said
    assert math.isclose(bench.robot.pose.yaw_rad, FAR.yaw_rad)


def strange_bench():
    """A robot in a place that no map knows."""
    spots = np.random.default_rng(5).uniform(20.0, 26.0, (60, 2))
    pillars = [Box(x, y, x + 0.15, y + 0.15) for x, y in spots if math.hypot(x - 23, y - 23) > 1]
    bench = Bench(Pose2D(23.0, 23.0, 0.3), surveyed=TWO_ROOMS, unmapped=pillars, believed_start=START)
    bench.tick(20)
    return bench


def test_when_no_pose_fits_it_turns_slowly_and_gives_up():
    bench = strange_bench()
    step, said = outcome(bench, turns=3, drives=0)
    assert step == Failed(Cause.POSTCONDITION, "no place on the map fits what the robot sees")
    assert "turning slowly to see more" in said
    assert abs(bench.robot.pose.yaw_rad - 0.3 - math.pi / 2) < 0.2
    assert not bench.robot.driving


def never_localised(bench):
    """Bench whose localiser never finds the place."""
    bench.localiser = KnownPlace()
    bench.localiser.localised, bench.localiser.search = False, lambda scan, belief, radius_m: None
    bench.tick(20)
    return bench


def test_after_a_round_of_turns_it_drives_elsewhere_and_keeps_clear():
    bench = never_localised(Bench(START))
    step, said = outcome(bench, turns=2, drives=2)
    assert step.cause is Cause.POSTCONDITION
    assert "driving to see more" in said
    assert bench.robot.travelled_m > 0.3
    assert bench.robot.least_clearance_m > 0.05
    assert bench.robot.images_taken > 0
    assert not bench.robot.driving


def test_without_space_it_neither_turns_nor_drives():
    bench = never_localised(Bench(Pose2D(0.0, 0.0, 0.0), surveyed=CLOSET))
    step, _ = outcome(bench, turns=3, drives=3)
    assert step.cause is Cause.POSTCONDITION
    assert (bench.robot.travelled_m, bench.robot.pose.yaw_rad) == (0.0, 0.0)


def twin_bench(start, seed):
    """A robot with unknown start in one of two equal rooms."""
    component = MonteCarloOptions(particles=FilterOptions(seed=seed))
    bench = Bench(start, surveyed=TWIN_ROOMS, component=component, start_known=False)
    bench.tick()
    return bench


@pytest.mark.parametrize("seed", [pytest.param(0, marks=pytest.mark.nightly), 1])
def test_in_one_of_two_equal_rooms_it_finds_out_which(seed):
    bench = twin_bench(Pose2D(2.0, 1.5, 0.3), seed)
    step, said = outcome(bench)
    assert isinstance(step, Succeeded), step
    assert "turning slowly to see more" in said
    assert bench.pose_error()[0] < 0.05
    assert bench.robot.least_clearance_m > 0.05


def test_a_robot_that_refuses_to_move_is_an_execution_failure():
    bench = strange_bench()
    bench.robot.refuse_because["drive"] = "it sits"
    step, _ = outcome(bench)
    assert step == Failed(Cause.EXECUTION, "The robot refused to drive: it sits.")


def test_a_localiser_that_cannot_search_is_a_failed_precondition():
    bench = Bench(START)
    step, _ = outcome(bench, context=dataclasses.replace(bench.context(), localiser=object()))
    assert step.cause is Cause.PRECONDITION


def test_without_new_scans_it_says_so():
    bench = lost_bench(FAR)
    old = bench.robot.scan()
    bench.robot.scan = lambda: old
    bench.tick(10)
    step, _ = outcome(bench)
    assert step == Failed(Cause.PRECONDITION, "there are no new scans to find the place by")


def test_a_robot_that_knows_its_place_is_left_alone():
    bench = Bench(START)
    bench.tick(10)
    step, said = outcome(bench)
    assert step.message == "the scans agree with the map already"
    assert said == ["seeing whether scans agree"]


def test_searching_changes_nothing_until_it_is_accepted():
    bench = lost_bench(FAR)
    before = bench.localiser.estimate()
    found = bench.localiser.search(bench.robot.scan(), bench.localiser.estimate(), None)
    assert bench.localiser.estimate().X_WO.IsExactlyEqualTo(before.X_WO)
    bench.localiser.accept(found)
    assert bench.localiser.estimate().X_WO.IsNearlyEqualTo(found.X_WO, 1e-9)
    assert bench.localiser.estimate().localised


WALL_TAG = Tag(30, 0.15, p_W=(4.94, 1.5, 0.5), yaw_rad=math.pi)


def tagged(bench, monkeypatch):
    """Context of a robot that knows the tag on a wall of the first of two rooms alike, and whose cameras show it."""
    robot = bench.robot
    cameras = {camera.source: camera for camera in robot_kind("spot").capabilities().body_cameras}
    known = dataclasses.replace(robot.capabilities(), cameras=tuple(cameras.values()))

    def image(source, **_):
        X_OC = robot.odometry().X_OB @ cameras[source].X_FC
        X_CT = (robot.pose.transform(0.5) @ cameras[source].X_FC).inverse() @ WALL_TAG.X_WT()
        shown = [(30, 0.15, X_CT)] if X_CT.translation()[2] > 0.3 and source == "frontright" else []
        lens = Intrinsics(320, 240, 165.0, 165.0, 160.0, 120.0)
        frames = FrameTree({"hand_camera": ("odom", X_OC)})
        return dataclasses.replace(picture_of(shown, lens), source=source, frames=frames)

    monkeypatch.setattr(robot, "capabilities", lambda: known)
    monkeypatch.setattr(robot, "image", image)
    return dataclasses.replace(bench.context(), tags=(WALL_TAG,))


def test_a_tag_on_a_wall_tells_one_room_from_another_alike(monkeypatch):
    bench = twin_bench(Pose2D(3.6, 1.5, 0.0), seed=1)
    step, said = outcome(bench, context=tagged(bench, monkeypatch))
    assert isinstance(step, Succeeded), step
    assert "looking for tags" in said
    assert "searching the whole map" not in said
    assert bench.pose_error()[0] < 0.05
    assert bench.robot.travelled_m == 0.0


def test_ahead_is_free_up_to_the_wall_less_the_body_and_the_margin():
    seen = obstacles_B(scan_of(wall_x=3.0), BODY, OPTIONS)
    assert free_m(seen, 0.0, BODY, OPTIONS) == pytest.approx(3.0 - 0.55 - 0.3, abs=0.02)
    assert free_m(seen, math.pi, BODY, OPTIONS) == 5.0


def test_only_obstacles_ahead_of_the_body_count():
    post = np.array([[2.0, 0.5]])
    assert free_m(post, 0.0, BODY, OPTIONS) == 5.0
    assert free_m(post, math.atan2(0.5, 2.0), BODY, OPTIONS) == pytest.approx(math.hypot(2.0, 0.5) - 0.85)


def test_the_floor_and_the_body_are_no_obstacles():
    assert len(obstacles_B(scan_of(), BODY, OPTIONS)) == 0
    assert len(obstacles_B(scan_of(discs=[(0.3, 0.0, 0.05)]), BODY, OPTIONS)) == 0


@pytest.mark.parametrize(("x", "free"), [(0.7, True), (0.6, False)])
def test_it_can_turn_where_its_corners_are_free(x, free):
    assert can_turn(np.array([[x, 0.0]]), BODY, OPTIONS) is free
