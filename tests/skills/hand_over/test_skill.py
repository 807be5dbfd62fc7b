"""The hand-over skill with a scripted arm and analytic scans."""

import math

import numpy as np
import pytest
from analytic_scan import scan_of
from scripted_robot import MODEL, ScriptedRobot, context_of, failed, outcome

from skills.api import Cause, Succeeded
from skills.hand_over.skill import HandOver, HandOverInputs, facing_poses
from skills.robot import Pose2D, Scan

CARRYING = np.array([0.0, -3.0, 2.85, 0.0, 0.1, 1.57])


class _Scanning(ScriptedRobot):
    """Gives the same scan with a new stamp at every call."""

    def scan(self):
        return None if self.scan_now is None else Scan(**{**self.scan_now.__dict__, "stamp_s": self.now_s})


def _holding(**scripted):
    return _Scanning(q=CARRYING.copy(), holding=True, opening_rad=0.3, **scripted)


def test_an_empty_gripper_is_a_failed_precondition():
    failed(HandOver(context_of(_Scanning())), HandOverInputs("Robin"), Cause.PRECONDITION, "nothing in the gripper")


def test_nobody_in_sight_is_a_failed_precondition():
    robot = _holding(scan_now=scan_of())
    failed(HandOver(context_of(robot)), HandOverInputs("Robin"), Cause.PRECONDITION, "Robin cannot be handed anything")


@pytest.mark.parametrize("y", [-0.4, 0.0, 0.4])
def test_the_thing_is_held_out_near_the_person_but_does_not_touch(y):
    robot = _holding(scan_now=scan_of([(1.4, y, 0.2)]))
    assert isinstance(outcome(HandOver(context_of(robot)), HandOverInputs("Robin")), Succeeded)
    p_BT = MODEL.X_BH(robot.q) @ np.array([0.18, 0.0, 0.0])
    off = math.hypot(p_BT[0] - 1.4, p_BT[1] - y)
    assert 0.35 < off < 0.75
    assert 0.7 < p_BT[2] + 0.52 < 1.1
    assert robot.holding


def test_poses_before_a_person_face_them_and_the_nearest_comes_first():
    here = Pose2D(0.0, 0.0, 0.0)
    poses = facing_poses((3.0, 0.0), here, 1.5)
    assert math.hypot(poses[0].x_m - 1.5, poses[0].y_m) < 0.01
    for pose in poses:
        off = math.atan2(-pose.y_m, 3.0 - pose.x_m) - pose.yaw_rad
        assert math.remainder(off, 2 * math.pi) == pytest.approx(0.0, abs=1e-6)
