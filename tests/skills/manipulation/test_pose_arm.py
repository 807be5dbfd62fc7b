import numpy as np
import pytest
from table_robot import MODEL, TableRobot, context_of, failed, outcome

from skills.api import Cause, Succeeded
from skills.manipulation.pose_arm import PoseArm, PoseArmInputs

POSE = (0.1, -1.6, 1.8, 0.0, 0.4, 0.0)


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
