"""Teleoperation of a scripted robot: keys, limits, obstacles, and the dead-man's switch."""

import numpy as np
import pytest
from table_robot import CAPABILITIES, GRIPPER, MODEL, TableRobot, context_of

from errand_teleop.driver import AXES, KEYS, Teleop, TeleopOptions, axis_values, read_axis_values
from skills.testing.blocks import Block
from skills.testing.estimators import BlockCostmap
from skills.testing.robot import ScriptedRobot
from tests.tables import table

OPTIONS = TeleopOptions()
OUT = np.array([0.0, -1.6, 1.8, 0.0, 0.4, 0.0])


class FollowingRobot(TableRobot):
    """The arm follows its trajectory in time."""

    _move_arm = ScriptedRobot._move_arm


def wall_at(x_m):
    return BlockCostmap([Block(x_m, -9.0, x_m + 9.0, 9.0)])


@pytest.fixture
def robot():
    return FollowingRobot(OUT)


def driven(robot, asked, seconds, costmap=None, keys_s=None):
    """Holds keys for some seconds, for `keys_s` at the longest; returns the teleoperation."""
    hands = Teleop(context_of(robot, costmap=costmap))
    for number in range(round(seconds / OPTIONS.period_s)):
        if keys_s is None or number * OPTIONS.period_s < keys_s:
            hands.ask(asked)
        hands.tick()
        robot.advance(OPTIONS.period_s)
    return hands


def test_the_body_gains_speed_within_its_limits(robot):
    driven(robot, {"forward": 1.0, "turn": 1.0}, 2.0)
    sent = np.array(robot.commanded("drive"))
    assert sent[-1] == pytest.approx([OPTIONS.base.max_speed_m_s, 0.0, OPTIONS.base.turn_rad_s])
    steps = np.diff(np.vstack([np.zeros(3), sent]), axis=0) / OPTIONS.period_s
    assert steps[:, 0].max() <= OPTIONS.base.acceleration_m_s2 + 1e-9
    assert steps[:, 2].max() <= OPTIONS.base.turn_acceleration_rad_s2 + 1e-9


def test_a_drive_command_expires_within_the_dead_mans_time(robot):
    driven(robot, {"forward": 1.0}, 0.5)
    expiries_s = [until_s for verb, _, until_s in robot.commands if verb == "drive"]
    assert max(until_s - 0.1 * n for n, until_s in enumerate(expiries_s)) <= OPTIONS.life_s + 1e-9


def test_the_body_is_stopped_when_keys_stop_coming(robot):
    driven(robot, {"forward": 1.0}, 1.5, keys_s=0.5)
    assert len(robot.commanded("drive")) <= round((0.5 + OPTIONS.life_s) / OPTIONS.period_s)


def test_the_body_stops_at_once_when_the_key_is_released(robot):
    hands = driven(robot, {"forward": 1.0}, 0.5)
    count = len(robot.commanded("drive"))
    hands.ask({})
    hands.tick()
    assert len(robot.commanded("drive")) == count


def test_the_body_does_not_drive_into_a_wall(robot):
    half_m = max(x for x, _ in CAPABILITIES.footprint_m)
    assert "blocks the body" in driven(robot, {"forward": 1.0}, 1.0, costmap=wall_at(half_m + 0.05)).note
    assert robot.commanded("drive") == []


def test_the_body_may_leave_a_wall_that_it_touches(robot):
    driven(robot, {"forward": -1.0}, 1.0, costmap=wall_at(0.3))
    assert robot.commanded("drive")[-1][0] == pytest.approx(-OPTIONS.base.backward_m_s)


def test_a_refused_command_is_reported(robot):
    robot.refuse_because["drive"] = "the lease is held by 'mission'"
    assert "the lease is held" in driven(robot, {"forward": 1.0}, 0.2).note


def test_the_hand_goes_straight_up_with_its_orientation(robot):
    before = MODEL.X_BH(OUT)
    hands = driven(robot, {"hand_z": 1.0}, 1.0)
    after = MODEL.X_BH(robot.q_rad)
    moved = after.translation() - before.translation()
    assert hands.note == ""
    assert moved[2] > 0.1
    assert np.abs(moved[:2]).max() < 0.01
    assert np.abs(after.rotation().matrix() - before.rotation().matrix()).max() < 0.02


@pytest.mark.parametrize("asked", [{"joint_1": 1.0}, {"hand_x": 1.0, "yaw": -1.0}, {"roll": 1.0}])
def test_no_joint_is_faster_than_its_limit_and_each_trajectory_ends_at_rest(robot, asked):
    driven(robot, asked, 1.5)
    assert robot.arm_commands
    for trajectory in robot.arm_commands:
        rates = np.diff(trajectory.positions_rad, axis=0) / np.diff(trajectory.times_s)[:, None]
        assert np.abs(rates).max() <= OPTIONS.arm.joint_rad_s + 1e-6
        assert np.abs(rates[-1]).max() < 0.2 * OPTIONS.arm.joint_rad_s


def test_the_arm_goes_on_from_where_it_was_sent(robot):
    driven(robot, {"joint_1": 1.0}, 1.0)
    for one, following in zip(robot.arm_commands, robot.arm_commands[1:], strict=False):
        assert following.positions_rad[0] == pytest.approx(one.positions_rad[1], abs=1e-9)


def test_the_arm_is_at_rest_half_a_second_after_the_keys(robot):
    driven(robot, {"joint_1": 1.0}, 0.6 + 0.5, keys_s=0.55)
    resting = robot.q_rad.copy()
    robot.advance(0.5)
    assert robot.q_rad == pytest.approx(resting, abs=1e-9)


def test_the_arm_stops_before_a_joint_limit(robot):
    assert "limit" in driven(robot, {"joint_6": 1.0}, 8.0).note
    assert MODEL.upper_rad[5] - 0.15 < robot.q_rad[5] <= MODEL.upper_rad[5] + 1e-9


def test_the_arm_stops_before_it_touches_the_body(robot):
    hands = driven(robot, {"hand_z": -1.0, "hand_x": -1.0}, 6.0)
    assert hands.note
    assert all(hands._scene.free(q) for trajectory in robot.arm_commands for q in trajectory.positions_rad)


@pytest.mark.parametrize(
    ("holds", "opening"), [([(1.0, 0.5)], 0.5), ([(1.0, 5.5)], GRIPPER.widest), ([(1.0, 5.5), (-1.0, 5.0)], 0.0)]
)
def test_the_gripper_opens_and_closes_step_by_step(robot, holds, opening):
    for sign, seconds in holds:
        driven(robot, {"open": sign}, seconds)
    assert robot.opening == pytest.approx(opening)


def test_the_body_rises_within_its_range(robot):
    driven(robot, {"height": 1.0}, 5.0)
    assert robot.height_m == pytest.approx(CAPABILITIES.height_range_m[1])


def test_the_pose_to_be_saved_is_the_present_one(robot):
    pose = Teleop(context_of(robot)).pose()
    assert pose.joints_rad == pytest.approx(OUT)
    assert pose.base.x_m == 0.0


def test_no_command_is_sent_without_keys(robot):
    driven(robot, {}, 1.0)
    assert robot.commands == []


def test_keys_add_up_and_opposite_ones_cancel():
    assert axis_values(["w", "a"]) == {"forward": 1.0, "turn": 1.0}
    assert axis_values(["w", "s"]) == {}


def test_a_stick_and_a_key_together_stay_within_one():
    assert axis_values(["w"], {"forward": 0.7, "turn": -0.25}) == {"forward": 1.0, "turn": -0.25}


def test_keys_without_a_meaning_have_no_effect():
    assert axis_values([" ", "p", "\x1b"]) == {}


def test_every_axis_has_a_key_for_each_direction():
    assert {axis for axis, _ in KEYS.values()} == AXES
    assert len(KEYS) == 2 * len(AXES)


def test_a_page_asks_by_keys_and_axes():
    assert read_axis_values({"keys": ["w"], "axes": {"hand_z": -0.5}}) == {"forward": 1.0, "hand_z": -0.5}


@pytest.mark.parametrize(*table(__file__, "invalid"))
def test_invalid_axis_values_are_refused(values):
    with pytest.raises(ValueError, match="must be"):
        read_axis_values(values)
