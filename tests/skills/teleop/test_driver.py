"""Teleoperation of a scripted robot: limits, obstacles, and the dead-man's switch."""

import numpy as np
import pytest
from scripted_robot import CAPABILITIES, GRIPPER, MODEL, OpenFloor, ScriptedRobot, context_of

from skills.robot import CommandState, CommandStatus
from skills.teleop.driver import Teleop, TeleopOptions

OPTIONS = TeleopOptions()
OUT = np.array([0.0, -1.6, 1.8, 0.0, 0.4, 0.0])


class DrivenRobot(ScriptedRobot):
    """Robot that records velocities and their expiry."""

    def drive(self, vx, vy, wz, *, until_s, lease):
        self.__dict__.setdefault("driven", []).append(((vx, vy, wz), until_s))
        return self._note(self.__dict__.get("drive_answer", CommandStatus(CommandState.RUNNING)))


class FollowingRobot(DrivenRobot):
    """The arm follows its trajectory in time."""

    def move_arm(self, trajectory, *, until_s, lease):
        self.arm_commands.append(trajectory)
        self.__dict__["under_way"] = (self.now_s, trajectory)
        return self._note(CommandStatus(CommandState.RUNNING))

    def advance(self, dt_s):
        super().advance(dt_s)
        if "under_way" in self.__dict__:
            begun_s, trajectory = self.under_way
            at = self.now_s - begun_s
            self.q = np.array([np.interp(at, trajectory.times_s, angles) for angles in trajectory.positions_rad.T])


class WallAhead(OpenFloor):
    """A costmap with a wall across x = `at_m`."""

    def __init__(self, at_m):
        self.at_m = at_m

    def clearance_m(self, points_W):
        return self.at_m - points_W[:, 0]


@pytest.fixture
def robot():
    return DrivenRobot(q=OUT.copy())


def driven(robot, asked, seconds, costmap=None, keys_s=None):
    """Holds keys for some seconds, for `keys_s` at the longest; returns the teleoperation."""
    hands = Teleop(context_of(robot, costmap=costmap))
    for number in range(round(seconds / OPTIONS.period_s)):
        if keys_s is None or number * OPTIONS.period_s < keys_s:
            hands.ask(asked)
        hands.tick()
        robot.advance(OPTIONS.period_s)
    return hands


def velocities(robot):
    return np.array([velocity for velocity, _ in robot.__dict__.get("driven", [])])


def test_the_body_gains_speed_within_its_limits(robot):
    driven(robot, {"forward": 1.0, "turn": 1.0}, 2.0)
    sent = velocities(robot)
    assert sent[-1] == pytest.approx([OPTIONS.base.max_speed_m_s, 0.0, OPTIONS.base.turn_rad_s])
    steps = np.diff(np.vstack([np.zeros(3), sent]), axis=0) / OPTIONS.period_s
    assert steps[:, 0].max() <= OPTIONS.base.acceleration_m_s2 + 1e-9
    assert steps[:, 2].max() <= OPTIONS.base.turn_acceleration_rad_s2 + 1e-9


def test_a_drive_command_expires_within_the_dead_mans_time(robot):
    driven(robot, {"forward": 1.0}, 0.5)
    assert max(until_s - 0.1 * n for n, (_, until_s) in enumerate(robot.driven)) <= OPTIONS.life_s + 1e-9


def test_the_body_is_stopped_when_keys_stop_coming(robot):
    driven(robot, {"forward": 1.0}, 1.5, keys_s=0.5)
    assert len(robot.driven) <= round((0.5 + OPTIONS.life_s) / OPTIONS.period_s)


def test_the_body_stops_at_once_when_the_key_is_released(robot):
    hands = driven(robot, {"forward": 1.0}, 0.5)
    count = len(robot.driven)
    hands.ask({})
    hands.tick()
    assert len(robot.driven) == count


def test_the_body_does_not_drive_into_a_wall(robot):
    half_m = max(x for x, _ in CAPABILITIES.footprint_m)
    hands = driven(robot, {"forward": 1.0}, 1.0, costmap=WallAhead(half_m + 0.05))
    assert "blocks the body" in hands.note
    assert velocities(robot).size == 0


def test_the_body_may_leave_a_wall_that_it_touches(robot):
    driven(robot, {"forward": -1.0}, 1.0, costmap=WallAhead(0.3))
    assert velocities(robot)[-1, 0] == pytest.approx(-OPTIONS.base.backward_m_s)


def test_a_refused_command_is_reported(robot):
    robot.drive_answer = CommandStatus(CommandState.REFUSED, "the lease is held by 'mission'")
    assert "the lease is held" in driven(robot, {"forward": 1.0}, 0.2).note


def test_the_hand_goes_straight_up_with_its_orientation():
    robot = FollowingRobot(q=OUT.copy())
    before = MODEL.X_BH(OUT)
    hands = driven(robot, {"hand_z": 1.0}, 1.0)
    after = MODEL.X_BH(robot.q)
    moved = after.translation() - before.translation()
    assert hands.note == ""
    assert moved[2] > 0.1
    assert np.abs(moved[:2]).max() < 0.01
    assert np.abs(after.rotation().matrix() - before.rotation().matrix()).max() < 0.02


@pytest.mark.parametrize("asked", [{"joint_1": 1.0}, {"hand_x": 1.0, "yaw": -1.0}, {"roll": 1.0}])
def test_no_joint_is_faster_than_its_limit_and_each_trajectory_ends_at_rest(asked):
    robot = FollowingRobot(q=OUT.copy())
    driven(robot, asked, 1.5)
    assert robot.arm_commands
    for trajectory in robot.arm_commands:
        rates = np.diff(trajectory.positions_rad, axis=0) / np.diff(trajectory.times_s)[:, None]
        assert np.abs(rates).max() <= OPTIONS.arm.joint_rad_s + 1e-6
        assert np.abs(rates[-1]).max() < 0.2 * OPTIONS.arm.joint_rad_s


def test_the_arm_goes_on_from_where_it_was_sent():
    robot = FollowingRobot(q=OUT.copy())
    driven(robot, {"joint_1": 1.0}, 1.0)
    for one, following in zip(robot.arm_commands, robot.arm_commands[1:], strict=False):
        assert following.positions_rad[0] == pytest.approx(one.positions_rad[1], abs=1e-9)


def test_the_arm_is_at_rest_half_a_second_after_the_keys():
    robot = FollowingRobot(q=OUT.copy())
    driven(robot, {"joint_1": 1.0}, 0.6 + 0.5, keys_s=0.55)
    resting = robot.q.copy()
    robot.advance(0.5)
    assert robot.q == pytest.approx(resting, abs=1e-9)


def test_the_arm_stops_before_a_joint_limit():
    robot = FollowingRobot(q=OUT.copy())
    hands = driven(robot, {"joint_6": 1.0}, 8.0)
    assert "limit" in hands.note
    assert robot.q[5] <= MODEL.upper_rad[5] + 1e-9
    assert robot.q[5] > MODEL.upper_rad[5] - 0.15


def test_the_arm_stops_before_it_touches_the_body():
    robot = FollowingRobot(q=OUT.copy())
    hands = driven(robot, {"hand_z": -1.0, "hand_x": -1.0}, 6.0)
    assert hands.note
    assert all(hands._scene.free(q) for trajectory in robot.arm_commands for q in trajectory.positions_rad)


def test_the_gripper_opens_and_closes_step_by_step(robot):
    driven(robot, {"open": 1.0}, 0.5)
    assert robot.opening == pytest.approx(0.5)
    driven(robot, {"open": 1.0}, 5.0)
    assert robot.opening == pytest.approx(GRIPPER.widest)
    driven(robot, {"open": -1.0}, 5.0)
    assert robot.opening == 0.0


def test_the_body_rises_within_its_range(robot):
    driven(robot, {"height": 1.0}, 5.0)
    assert robot.height_m == pytest.approx(CAPABILITIES.height_range_m[1])


def test_no_command_is_sent_without_keys(robot):
    driven(robot, {}, 1.0)
    assert not robot.arm_commands
    assert velocities(robot).size == 0


def test_the_pose_to_be_saved_is_the_present_one(robot):
    pose = Teleop(context_of(robot)).pose()
    assert pose.joints_rad == pytest.approx(OUT)
    assert pose.base.x_m == 0.0
