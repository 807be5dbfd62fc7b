"""Faults by name: their effects, their times, and refused words."""

import math

import numpy as np
import pytest

from skills.faults.fault_kinds import STANDARD_FAULTS, InjectedFault
from skills.faults.faulty_robot import inject_faults, parse_fault, random_faults
from skills.robot import CommandState, NoImageError
from skills.testing.blocks import ROOM
from skills.testing.clock import VirtualClock
from skills.testing.robot import ScriptedRobot, Start
from tests.tables import table

CAMERAS = ("hand", "left", "back")


@pytest.fixture
def clock():
    return VirtualClock()


@pytest.fixture
def inner(clock, spot):
    """The robot without its faults."""
    return ScriptedRobot(clock, capabilities=spot, blocks=ROOM)


@pytest.fixture
def faulty(clock, inner):
    """A robot with the given faults, and its lease."""

    def make(*faults):
        robot = inject_faults(inner, clock, faults)
        return robot, robot.acquire_lease("test")

    return make


@pytest.mark.parametrize("kind", STANDARD_FAULTS, ids=lambda kind: kind.example)
def test_every_example_is_a_fault(kind):
    assert parse_fault(kind.example).words == kind.example


def test_times_count_from_when_the_robot_was_wrapped(faulty, clock):
    clock.advance(5.0)
    robot, _ = faulty("gripper reports holding at 1 s")
    assert not robot.gripper().holding
    clock.advance(1.0)
    assert robot.gripper().holding


def test_times_may_count_from_the_beginning_of_the_clock(clock, spot):
    clock.advance(5.0)
    robot = inject_faults(
        ScriptedRobot(clock, capabilities=spot), clock, ["gripper reports holding at 5 s"], since_s=0.0
    )
    assert robot.gripper().holding


def test_a_fault_is_on_from_its_time_and_until_its_end(faulty, clock):
    robot, _ = faulty("gripper reports holding from 1 s to 2 s")
    assert not robot.gripper().holding
    assert polled(robot, clock, 2.0, period_s=1.0) == [True, False]


def test_a_frozen_sensor_keeps_its_last_reading_and_the_others_go_on(faulty, clock):
    robot, _ = faulty("scan is stale from 1 s")
    clock.advance(0.9)
    before = robot.scan().stamp_s
    clock.advance(3.0)
    assert robot.scan().stamp_s == before == 0.9
    assert robot.odometry().stamp_s == pytest.approx(3.9)


def test_each_camera_freezes_on_its_own_picture(faulty, clock):
    robot, _ = faulty("camera freezes at 1 s")
    robot.image("hand")
    clock.advance(2.0)
    assert robot.image("hand").stamp_s == 0.0
    assert robot.image("left").source == "left"


def test_a_frozen_camera_freezes_each_kind_of_picture_that_is_asked_for(clock):
    asked = []

    class Cameras(ScriptedRobot):
        def image(self, source, *, visual=True, depth=True):
            asked.append((visual, depth))
            return super().image(source, visual=visual, depth=depth), visual, depth

    robot = inject_faults(Cameras(clock, blocks=ROOM), clock, ("camera freezes at 1 s",))
    robot.image("frontleft", depth=False)
    clock.advance(2.0)
    for visual, depth in ((True, False), (False, True), (True, True), (False, True)):
        assert robot.image("frontleft", visual=visual, depth=depth)[1:] == (visual, depth)
    assert robot.image("frontleft", depth=False)[0].stamp_s == 0.0
    assert asked == [(True, False), (False, True), (True, True)]


def test_a_verb_raises_from_its_nth_call_on(faulty):
    robot, _ = faulty("joints verb raises after 2 calls")
    robot.joints()
    robot.joints()
    with pytest.raises(InjectedFault, match="joints does not answer"):
        robot.joints()


def test_a_refused_command_says_why_and_nothing_moves(faulty, clock, inner):
    robot, lease = faulty("drive refuses from 1 s")
    fine = robot.drive(0.1, 0.0, 0.0, until_s=0.5, lease=lease)
    clock.advance(1.0)
    refused = robot.command_status(robot.drive(0.5, 0.0, 0.0, until_s=9.0, lease=lease))
    assert (robot.command_status(fine).state, refused.state) == (CommandState.DONE, CommandState.REFUSED)
    assert "out of order" in refused.reason
    assert inner.moving_parts == ()


def test_a_command_that_never_ends_stays_under_way(faulty, clock):
    robot, lease = faulty("stand never ends")
    command = robot.stand(0.55, 0.0, until_s=1.0, lease=lease)
    clock.advance(30.0)
    assert robot.command_status(command).state is CommandState.RUNNING


def test_depth_can_be_nan(faulty):
    robot, _ = faulty("image returns NaN depth")
    assert np.all(np.isnan(robot.image("hand").depth_m))


def test_garbage_spoils_numbers_and_keeps_the_stamp(faulty, clock):
    clock.advance(1.0)
    robot, _ = faulty("joints returns garbage", "odometry returns garbage")
    assert all(math.isnan(angle) for angle in robot.joints().position_rad.values())
    assert all(math.isnan(v) for v in robot.odometry().velocity)
    assert robot.joints().stamp_s == 1.0


def test_the_lease_is_taken_once_and_motion_ends(faulty, clock, inner):
    robot, lease = faulty("lease taken at 1 s")
    robot.drive(0.5, 0.0, 0.0, until_s=9.0, lease=lease)
    clock.advance(1.0)
    robot.odometry()
    clock.advance(0.2)
    assert inner.moving_parts == ()
    assert robot.command_status(robot.drive(0.5, 0.0, 0.0, until_s=9.0, lease=lease)).state is CommandState.REFUSED
    assert robot.lease_holder().holder == "the tablet"


def test_odometry_can_jump(faulty, clock):
    robot, _ = faulty("odometry jumps 0.5 m at 1 s")
    assert robot.odometry().pose.x_m == 0.0
    clock.advance(1.0)
    assert robot.odometry().pose.x_m == pytest.approx(0.5)
    assert robot.scan().X_OB.translation()[0] == pytest.approx(0.5)
    assert robot.image("left").frames.pose("body").translation()[0] == pytest.approx(0.5)


def test_odometry_that_has_jumped_reports_later_motion_as_it_is(faulty, clock):
    robot, lease = faulty("odometry jumps 0.5 m at 1 s")
    clock.advance(1.0)
    robot.odometry()
    robot.drive(0.0, 0.0, 1.0, until_s=9.0, lease=lease)
    clock.advance(1.5)
    pose = robot.odometry().pose
    assert pose.yaw_rad > 1.0
    assert (pose.x_m, pose.y_m) == pytest.approx((0.5, 0.0), abs=1e-6)


def test_battery_and_faults_can_be_set(faulty):
    robot, _ = faulty("battery falls to 5 %", "robot reports motor too hot")
    assert robot.battery().charge == 0.05
    assert robot.faults() == ("motor too hot",)


def test_several_faults_act_together(faulty):
    robot, _ = faulty("gripper reports holding", "gripper raises after 1 call")
    assert robot.gripper().holding
    with pytest.raises(InjectedFault):
        robot.gripper()


@pytest.mark.parametrize(*table(__file__, "times"))
def test_words_say_when_and_of_which_camera(words, from_s, to_s, source):
    fault = parse_fault(words)
    assert (fault.from_s, fault.to_s, fault.source) == (from_s, to_s, source)


def test_a_camera_that_drops_out_gives_no_pictures_for_a_while_and_the_others_go_on(faulty, clock):
    robot, _ = faulty("camera.hand: dropout 2 s at 1 s")
    robot.image("hand")
    clock.advance(1.0)
    with pytest.raises(NoImageError, match="the camera 'hand' gives no picture"):
        robot.image("hand")
    assert robot.image("left").source == "left"
    clock.advance(2.0)
    assert robot.image("hand").stamp_s == 3.0


def test_a_sensor_that_drops_out_gives_no_new_readings(faulty, clock):
    robot, _ = faulty("lidar: dropout 2 s at 1 s")
    clock.advance(0.9)
    before = robot.scan().stamp_s
    clock.advance(1.0)
    assert robot.scan().stamp_s == before
    clock.advance(1.2)
    assert robot.scan().stamp_s == pytest.approx(3.1)


def test_a_robot_reports_its_active_faults(faulty, clock):
    robot, _ = faulty("lidar: dropout 2 s at 1 s", "joints freezes after 1 call")
    assert robot.faults_at_work() == ()
    robot.joints()
    clock.advance(1.0)
    assert robot.faults_at_work() == ("lidar: dropout 2 s at 1 s", "joints freezes after 1 call")
    clock.advance(2.0)
    assert robot.faults_at_work() == ("joints freezes after 1 call",)


@pytest.mark.parametrize(
    ("words", "over"),
    [("lease taken at 4 s", True), ("lease taken at 6 s", False), ("lidar freezes at 4 s", False),
     ("lidar: dropout 1 s at 4 s", True), ("lidar: dropout 2 s at 4 s", False)],
)  # fmt: skip
def test_a_fault_that_is_over_does_not_return_after_a_restart(words, over):
    assert parse_fault(words).over_by(5.0) is over


def test_random_faults_are_the_same_for_a_seed_and_are_faults():
    drawn = random_faults(50, 7, CAMERAS)
    assert drawn == random_faults(50, 7, CAMERAS)
    assert drawn != random_faults(50, 8, CAMERAS)
    assert len(drawn) == 50
    assert len({parse_fault(words, cameras=CAMERAS).effect.verbs for words in drawn}) > 4


def test_a_larger_count_of_random_faults_only_adds_faults():
    assert set(random_faults(2, 7, CAMERAS)) < set(random_faults(5, 7, CAMERAS))


@pytest.mark.parametrize("kind", [kind for kind in STANDARD_FAULTS if kind.random], ids=lambda kind: kind.example)
def test_every_kind_that_is_drawn_parses_as_that_kind(kind):
    (words,) = random_faults(1, 1, CAMERAS, [kind])
    assert parse_fault(words, [kind], cameras=CAMERAS).words == words


@pytest.mark.parametrize(*table(__file__, "refused"))
def test_unknown_words_are_refused_with_a_hint(words, message):
    with pytest.raises(ValueError, match=message):
        parse_fault(words, cameras=("hand", "left"))


@pytest.fixture
def holding(clock, spot):
    """A robot that holds a can and loses it at 1 s, and its lease."""
    inner = ScriptedRobot(clock, capabilities=spot, blocks=ROOM, start=Start(holding=True))
    robot = inject_faults(inner, clock, ["gripper loses it at 1 s"])
    return robot, inner, robot.acquire_lease("test")


def polled(robot, clock, duration_s, period_s=0.05):
    """Returns whether the gripper reported holding at each tick."""
    seen = []
    for _ in range(round(duration_s / period_s)):
        clock.advance(period_s)
        seen.append(robot.gripper().holding)
    return seen


def test_a_gripper_that_loses_it_lets_it_fall_and_closes(holding, clock):
    robot, inner, _ = holding
    assert all(polled(robot, clock, 0.95))
    assert not any(polled(robot, clock, 1.0)[3:])
    assert robot.gripper().opening == pytest.approx(0.0)
    assert any(block.loose and block.z0 == 0.0 for block in inner.blocks)


def test_gripping_again_at_once_does_not_help_but_later_the_gripper_is_as_strong_as_ever(holding, clock):
    robot, inner, lease = holding
    polled(robot, clock, 1.05)
    robot.set_gripper(0.0, 100.0, until_s=9.0, lease=lease)
    clock.advance(0.1)
    assert inner.clamp_force_n < 1.0
    polled(robot, clock, 1.5)
    robot.set_gripper(0.0, 100.0, until_s=9.0, lease=lease)
    clock.advance(0.1)
    assert inner.clamp_force_n == 100.0
