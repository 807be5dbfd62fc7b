"""Whole drives by a Nav2, which the tests script, over both wires."""

import math
import os
from contextlib import closing, contextmanager
from dataclasses import replace
from itertools import count
from pathlib import Path as File
from types import SimpleNamespace

import numpy as np
import pytest
import yaml

pytest.importorskip("zenoh", reason="not installed: pip install eclipse-zenoh")

from ros_client import free_port, soon
from scripted_nav2 import THROUGH, TO_POSE, ScriptedNav2
from wire.test_node import RCLPY

from errand_ros2.nav2 import Nav2Drive, Nav2Follower, failure_of
from errand_ros2.wire.node import Place
from errand_ros2.wire.session import open_session
from executive.testing.bench import SkillBench
from executive.tree.registry import installed_skills
from plant.robots.spot.kind import spot_capabilities
from skills.api import Cause, Failed, Running, Succeeded
from skills.footprint import Footprint
from skills.geometry import compose
from skills.path import Path, densify
from skills.robot import BaseKind, Pose2D
from skills.routine import SkillFailure
from skills.stack import default_stack, stack_of
from skills.testing.clock import VirtualClock
from skills.testing.estimators import BlockCostmap
from skills.testing.robot import ScriptedRobot

PERIOD_S = 0.05
START, GOAL = Pose2D(0.0, 0.0, 0.0), Pose2D(5.0, 0.0, 0.0)
FOOTPRINT = Footprint.of(spot_capabilities())
NUMBERS = count(1)
"""Numbers of the robots: a server of an action lasts as long as its session."""
MEANINGS = yaml.safe_load(File(__file__).with_suffix(".yaml").read_text())


@pytest.fixture(params=["zenoh", pytest.param("rclpy", marks=RCLPY)], scope="module")
def wire(request):
    """A session over each wire, and how a stack file names its place."""
    by_rclpy = request.param == "rclpy"
    place = Place(os.getpid() % 200, by_rclpy=True) if by_rclpy else Place(port=free_port())
    with open_session(place) as session:
        yield session, f"rclpy:{place.domain}" if by_rclpy else f"zenoh:@:{place.port}"


@contextmanager
def scripted(wire, action=TO_POSE, **options):
    """A scripted Nav2, and the controller that leaves drives to it."""
    session, network = wire
    with closing(ScriptedNav2(session, action, f"/robot{next(NUMBERS)}")) as nav2:
        yield nav2, Nav2Drive(action=nav2.name, network=network, **options)


@pytest.fixture
def given(wire):
    with scripted(wire) as made:
        yield made


def straight(goal=GOAL):
    poses = densify(np.array([[0.0, 0.0, 0.0], [goal.x_m, goal.y_m, goal.yaw_rad]]), 0.05)
    return Path(poses, np.full(len(poses), 2.0))


class Drives:
    """A controller on its own, with the pose that the test gives the robot."""

    def __init__(self, options, footprint=FOOTPRINT):
        self.follower, self.pose = options.build(straight(), footprint, max_speed_m_s=0.8), START

    def tick(self, most_m_s=0.8):
        return self.follower.command(self.pose, (0.0, 0.0, 0.0), np.zeros(3), BlockCostmap(), most_m_s)

    def until(self, condition):
        """Ticks until a condition holds; returns the last command."""
        last = [self.tick()]
        assert soon(lambda: condition() or (last.append(self.tick()) and False))
        return last[-1]

    def fails(self, limit_s=20.0):
        """Ticks until the drive fails; returns the failure."""
        with pytest.raises(SkillFailure) as raised:
            soon(lambda: self.tick() and False, limit_s)
        self.follower.halt()
        return raised.value


@pytest.mark.parametrize("row", MEANINGS, ids=lambda row: row["words"])
def test_each_error_code_of_nav2_has_a_cause_and_words(row):
    for code in row["codes"]:
        cause, words = failure_of(SimpleNamespace(error_code=code, error_msg=""))
        assert (cause.name, words) == (row["cause"], f"{row['words']}, error {code}")


def test_nav2s_own_message_is_told_and_humble_has_none():
    assert failure_of(SimpleNamespace(error_code=204, error_msg="goal off grid"))[1] == (
        "the goal is outside of its map, error 204, 'goal off grid'"
    )
    assert failure_of(SimpleNamespace()) == (Cause.EXECUTION, "it does not say why")


# code, message; cause, whether it is final, words
@pytest.mark.parametrize(
    ("code", "says", "cause", "final", "words"),
    [
        (204, "off grid", Cause.PLANNING, False, "the goal is outside of its map, error 204, 'off grid'"),
        (106, "", Cause.EXECUTION, False, "the way is blocked, error 106"),
        (9001, "", Cause.PRECONDITION, True, "it cannot load its behaviour tree, error 9001"),
    ],
)
def test_a_drive_that_nav2_aborts_fails_with_its_cause(given, code, says, cause, final, words):
    nav2, options = given
    nav2.fails, nav2.says = code, says
    drives = Drives(options)
    drives.until(lambda: nav2.drives)
    nav2.step(START)
    failure = drives.fails()
    assert (failure.cause, failure.final, failure.message) == (cause, final, f"Nav2 gave up: {words}.")


def test_nav2_is_told_the_speed_that_zones_and_people_allow_until_the_drive_ends(given):
    nav2, options = given
    drives, told = Drives(options), nav2.limits_m_s
    for most_m_s, limit_m_s in ((0.8, 0.0), (0.3, 0.3), (0.8, 0.0), (0.5, 0.5)):
        assert soon(lambda most=most_m_s, limit=limit_m_s: drives.tick(most) and told[-1:] == [limit])
    drives.follower.halt()
    assert soon(lambda: told[-1] == 0.0)


def test_a_rejected_goal_is_a_failure(given):
    nav2, options = given
    nav2.rejects = True
    failure = Drives(options).fails()
    assert (failure.cause, failure.message) == (Cause.PLANNING, f"Nav2 rejects the goal on {nav2.name}.")


def test_no_server_is_a_final_failure_that_names_action_and_network(wire):
    failure = Drives(Nav2Drive(action="/bob/navigate_to_pose", network=wire[1], limit_s=0.3)).fails()
    assert (failure.cause, failure.final) == (Cause.PRECONDITION, True)
    assert failure.message.startswith("There is no drive by Nav2 on /bob/navigate_to_pose (domain")
    assert failure.message.endswith("the action's server does not answer.")


def test_a_server_that_does_not_answer_a_goal_is_a_failure(given):
    nav2, options = given
    nav2.is_deaf = True
    failure = Drives(replace(options, limit_s=0.5)).fails()
    assert (failure.cause, "the action's server does not answer" in failure.message) == (Cause.PRECONDITION, True)


def test_a_network_that_is_none_is_a_failure():
    failure = Drives(Nav2Drive(network="nowhere")).fails()
    assert (failure.cause, "'nowhere' is no ROS domain" in failure.message) == (Cause.PRECONDITION, True)


def test_a_server_that_is_silent_after_it_accepted_is_given_up_on_the_robots_clock(given):
    nav2, options = given
    nav2.dies = True
    drives = Drives(replace(options, silent_s=2.0))
    drives.until(lambda: drives.follower._trip.sent is not None)
    with pytest.raises(SkillFailure, match="has sent neither feedback nor a result for 2 s") as raised:
        for _ in range(round(2.0 / PERIOD_S) + 2):
            drives.tick()
    assert raised.value.cause is Cause.EXECUTION
    drives.follower.halt()
    assert soon(lambda: nav2.cancelled == 1)


def test_a_goal_that_another_program_cancels_is_a_failure(given):
    nav2, options = given
    drives = Drives(options)
    drives.until(lambda: nav2.drives)
    nav2.cancel()
    failure = drives.fails()
    assert (failure.cause, failure.message) == (Cause.EXECUTION, "Another program has cancelled Nav2's goal.")


def test_a_halt_cancels_the_goal_and_the_next_tick_sends_it_again(given):
    nav2, options = given
    drives = Drives(options)
    drive = drives.until(lambda: nav2.drives)
    drive.halt()
    assert soon(lambda: nav2.cancelled == 1)
    drives.until(lambda: len(nav2.goals) == 2)
    drives.follower.halt()
    assert soon(lambda: nav2.cancelled == 2)


def test_a_goal_that_is_halted_before_it_is_accepted_is_cancelled(given):
    nav2, options = given
    drives = Drives(options)
    drives.tick().halt()
    assert soon(lambda: nav2.cancelled == 1)


def test_at_a_speed_of_zero_nothing_moves_the_robot(given):
    nav2, options = given
    drive = Drives(options).tick(most_m_s=0.0)
    assert (drive.halt, drive.velocity, nav2.goals) == (None, (0.0, 0.0, 0.0), [])


def test_feedback_tells_how_far_it_is(given):
    nav2, options = given
    drives = Drives(options)
    drives.until(lambda: drives.follower._trip.sent is not None)
    nav2.step(Pose2D(2.0, 0.0, 0.0))
    drive = drives.until(lambda: drives.follower._trip.heard)
    assert (drives.tick().remaining_m, drive.off_path_m, drive.blocked_at) == (pytest.approx(3.0), 0.0, None)
    drives.follower.halt()


def test_success_far_from_the_goal_is_a_failed_check(given):
    nav2, options = given
    nav2.lies = True
    drives = Drives(options)
    drives.until(lambda: nav2.drives)
    nav2.step(START)
    failure = drives.fails()
    assert (failure.cause, failure.message) == (
        Cause.POSTCONDITION,
        "Nav2 says it is there, and the robot is 5.00 m off.",
    )


@pytest.mark.parametrize("kind", [BaseKind.OMNIDIRECTIONAL, BaseKind.DIFFERENTIAL])
def test_errand_drives_the_last_part_itself(given, kind):
    nav2, options = given
    nav2.lies = True
    drives = Drives(options, replace(FOOTPRINT, base_kind=kind))
    drives.until(lambda: nav2.drives)
    drives.pose = Pose2D(4.7, 0.1, 0.2)
    nav2.step(drives.pose)
    drives.until(lambda: drives.follower._arrived)
    last = np.zeros(3)
    for _ in range(400):
        last = np.array(drives.follower.command(drives.pose, tuple(last), last, BlockCostmap()).velocity)
        drives.pose = compose(drives.pose, Pose2D(*(PERIOD_S * last)))
    assert (drives.pose.x_m, drives.pose.y_m) == pytest.approx((GOAL.x_m, GOAL.y_m), abs=0.03)
    assert drives.pose.yaw_rad == pytest.approx(0.0, abs=0.05)


def test_nav2_drives_through_poses_of_the_path_on_its_own_map(wire):
    with scripted(wire, THROUGH, through_m=2.0, map_pose=(1.0, 0.0, 0.0), behavior_tree="tree.xml") as (nav2, options):
        drives = Drives(options)
        drives.until(lambda: nav2.drives)
        drives.follower.halt()
        assert soon(lambda: nav2.cancelled == 1)
    assert [pose.x_m for pose in nav2.poses] == pytest.approx([1.0, 3.0, 4.0], abs=0.05)
    assert nav2.goals[0].message.behavior_tree == "tree.xml"


def test_a_short_path_is_errands_own():
    near = Nav2Drive().build(straight(Pose2D(0.3, 0.0, 0.0)), FOOTPRINT, max_speed_m_s=0.8)
    assert not isinstance(near, Nav2Follower)


class Trip:
    """The navigate skill of a scripted robot, which the scripted Nav2 moves while it has a goal."""

    def __init__(self, nav2, options):
        self.clock = VirtualClock()
        self.robot = ScriptedRobot(self.clock, capabilities=spot_capabilities())
        bench = SkillBench(self.robot, self.clock)
        context = replace(bench.context(), stack=replace(default_stack(), controller=options))
        self.skill, self.nav2, self.seen = installed_skills()["navigate"](context), nav2, []
        self.skill.begin(self.skill.Inputs(GOAL))

    def tick(self):
        """Steps the skill, and Nav2, whose messages arrive before the next step."""
        step = self.skill.step()
        trip = getattr(getattr(self.skill, "_follower", None), "_trip", None)
        if trip is not None:
            assert soon(lambda: trip.sent is not None)
        vx, wz = self.nav2.step(self.robot.pose)
        if trip is not None:
            assert soon(lambda: trip.heard == self.nav2.told or trip.sent.ended.is_set() or not self.nav2.drives)
        moved = Pose2D(vx * PERIOD_S, 0.0, wz * PERIOD_S)
        self.robot.pose = compose(self.robot.pose, moved)
        self.robot.odometry_pose = compose(self.robot.odometry_pose, moved)
        self.clock.advance(PERIOD_S)
        return step

    def run(self, until=lambda step: False):
        while isinstance(step := self.tick(), Running) and not until(step) and self.clock.now() < 60.0:
            self.seen.append(step)
        return step


def test_the_navigate_skill_arrives_by_nav2_with_progress(given):
    nav2, options = given
    trip = Trip(nav2, options)
    step = trip.run()
    assert isinstance(step, Succeeded), step
    assert len(nav2.goals) == 1
    assert math.hypot(trip.robot.pose.x_m - GOAL.x_m, trip.robot.pose.y_m - GOAL.y_m) < 0.1
    progress = [each.progress for each in trip.seen if each.progress is not None]
    assert progress == sorted(progress) and progress[-1] > 0.95
    assert any("on the way, 2.5 m to go" in each.message for each in trip.seen)


def test_the_end_of_the_skill_cancels_nav2s_goal_and_stops_the_base(given):
    nav2, options = given
    trip = Trip(nav2, options)
    trip.run(until=lambda step: (step.progress or 0.0) > 0.3)
    trip.robot.calls.clear()
    trip.skill.end()
    assert soon(lambda: nav2.cancelled == 1)
    assert [verb for verb in trip.robot.calls if verb in ("drive", "stop")] == ["drive", "stop"]


def test_the_navigate_skill_fails_with_nav2s_words(given):
    nav2, options = given
    nav2.fails = 208
    step = Trip(nav2, options).run()
    assert isinstance(step, Failed)
    assert (step.cause, step.message) == (Cause.PLANNING, "Nav2 gave up: no path leads to the goal, error 208.")


def test_a_stack_file_chooses_the_drive():
    stack = stack_of({"controller": {"use": "nav2", "action": "/alice/navigate_through_poses", "through_m": 1.5}})
    assert stack.controller == Nav2Drive(action="/alice/navigate_through_poses", through_m=1.5)
