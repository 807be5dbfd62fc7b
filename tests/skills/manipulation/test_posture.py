"""Skills of the arm alone: stowed when empty, near the body when holding; saved joint angles."""

from dataclasses import replace

import numpy as np
import pytest
from table_robot import MODEL, TableRobot, context_of, failed, outcome

from skills.api import Cause, Succeeded
from skills.manipulation.posture import PoseArm, PoseArmInputs, Stow, StowInputs
from skills.robot import CommandState, CommandStatus

OUT = np.array([0.4, -1.6, 1.6, 0.0, 0.4, 0.0])
POSE = (0.1, -1.6, 1.8, 0.0, 0.4, 0.0)


def test_a_stowed_arm_is_left_alone():
    robot = TableRobot()
    assert isinstance(outcome(Stow(context_of(robot)), StowInputs()), Succeeded)
    assert robot.arm_commands == []


def test_a_robot_without_an_arm_has_nothing_to_stow():
    robot = TableRobot()
    armless = replace(robot.capabilities(), arm=None, gripper=None)
    robot.capabilities = lambda: armless
    assert isinstance(outcome(Stow(context_of(robot)), StowInputs()), Succeeded)
    assert robot.arm_commands == []


@pytest.mark.parametrize("opening", [0.0, 1.4])
def test_a_stretched_arm_is_stowed_with_its_gripper_closed(opening):
    robot = TableRobot(OUT, opening=opening)
    assert isinstance(outcome(Stow(context_of(robot)), StowInputs()), Succeeded)
    assert np.allclose(robot.q_rad, MODEL.stowed_rad, atol=1e-6)
    assert robot.opening == 0.0


def test_a_held_object_is_drawn_in_and_stays_held():
    robot = TableRobot(OUT, holding=True, opening=0.3)
    assert isinstance(outcome(Stow(context_of(robot)), StowInputs()), Succeeded)
    hand = MODEL.X_BH(robot.q_rad).translation()
    assert hand[0] < 0.52
    assert abs(hand[1]) < 0.2
    assert robot.opening == 0.3


def test_an_arm_that_is_stopped_is_a_failed_execution():
    stopped = dict.fromkeys(range(1, 99), CommandStatus(CommandState.STOPPED, "held fast"))
    failed(Stow(context_of(TableRobot(OUT.copy(), arm_answers=stopped))), StowInputs(), Cause.EXECUTION, "held")


def test_an_arm_that_is_stopped_once_goes_on():
    robot = TableRobot(OUT.copy(), arm_answers={1: CommandStatus(CommandState.STOPPED, "an emergency stop")})
    assert isinstance(outcome(Stow(context_of(robot)), StowInputs()), Succeeded)


class Raised(TableRobot):
    """Notes where the hand is ahead of the body whenever the body is sent to another height."""

    def stand(self, height_m, pitch_rad, *, until_s, lease):
        self.hand_x_m.append(float(MODEL.X_BH(self.q_rad).translation()[0]))
        return super().stand(height_m, pitch_rad, until_s=until_s, lease=lease)


@pytest.mark.parametrize("holding", [True, False])
def test_the_arm_comes_near_before_a_raised_body_is_lowered(holding):
    """Over a table, it would be pressed onto it."""
    robot = Raised(OUT, holding=holding, opening=0.3 if holding else 0.0, height_m=0.62, hand_x_m=[])
    assert isinstance(outcome(Stow(context_of(robot)), StowInputs()), Succeeded)
    assert robot.height_m == pytest.approx(0.52)
    assert len(robot.hand_x_m) == 1
    assert robot.hand_x_m[0] < 0.56 < MODEL.X_BH(OUT).translation()[0]


def wall(x0_m, y0_m, x1_m, y1_m):
    """Columns of 4 cm of a wall between two corners."""
    x, y = (np.arange(round(a / 0.04), round(b / 0.04)) for a, b in ((x0_m, x1_m), (y0_m, y1_m)))
    return np.stack(np.meshgrid(x, y, [50], indexing="ij"), axis=-1).reshape(-1, 3)


BEHIND = np.array([2.9, -0.3, 0.3, 0.0, 0.3, 0.0])
"""An arm that points back: its straight way home sweeps the left side."""


def most_left_m(robot):
    turned = np.vstack([trajectory.positions_rad for trajectory in robot.arm_commands])
    return max(float(MODEL.points_B(q)[:, 1].max()) for q in turned)


def test_the_arm_is_stowed_around_a_wall_of_the_map():
    free, walled = TableRobot(BEHIND.copy()), TableRobot(BEHIND.copy())
    assert isinstance(outcome(Stow(context_of(free)), StowInputs()), Succeeded)
    context = replace(context_of(walled), solid_columns=wall(-0.2, 0.44, 1.2, 0.56))
    assert isinstance(outcome(Stow(context), StowInputs()), Succeeded)
    assert most_left_m(free) > 0.44 > most_left_m(walled)


def test_walls_at_the_arm_by_a_small_error_of_the_pose_do_not_block_it():
    robot = TableRobot(OUT.copy())
    x, y, _ = MODEL.X_BH(OUT).translation()
    context = replace(context_of(robot), solid_columns=wall(x - 0.04, y - 0.6, x + 0.08, y + 0.6))
    assert isinstance(outcome(Stow(context), StowInputs()), Succeeded)
    assert np.allclose(robot.q_rad, MODEL.stowed_rad, atol=1e-6)


def test_the_arm_takes_the_pose_and_the_gripper_opens():
    robot = TableRobot()
    assert isinstance(outcome(PoseArm(context_of(robot)), PoseArmInputs(POSE, 0.5)), Succeeded)
    assert robot.q_rad == pytest.approx(POSE)
    assert robot.opening == pytest.approx(0.5)


def test_an_arm_in_the_pose_is_not_moved():
    robot = TableRobot(np.array(POSE))
    assert isinstance(outcome(PoseArm(context_of(robot)), PoseArmInputs(POSE)), Succeeded)
    assert not robot.arm_commands


def test_a_held_object_stays_held():
    robot = TableRobot(holding=True, opening=0.3)
    outcome(PoseArm(context_of(robot)), PoseArmInputs(POSE, 1.0))
    assert robot.opening == 0.3


def test_a_pose_of_another_arm_is_refused():
    failed(PoseArm(context_of(TableRobot())), PoseArmInputs((0.0, 0.1)), Cause.PRECONDITION, "2 joint angles")


def test_a_pose_beyond_the_joints_limits_is_refused():
    beyond = tuple(MODEL.upper_rad + 0.5)
    failed(PoseArm(context_of(TableRobot())), PoseArmInputs(beyond), Cause.PRECONDITION, "beyond the limits")
