"""Forces at the hand from the efforts of the arm's joints."""

import numpy as np
import pytest

from skills.manipulation.arm.forces import PullWatch, levers_m
from skills.manipulation.arm.kinematics import arm_model

POINT_H = np.array([0.15, 0.0, 0.0])
Q_RAD = np.array([0.0, -1.2, 1.6, 0.0, -0.4, 0.0])


@pytest.mark.parametrize("period_s", [0.05, 0.1, 0.2])
def test_a_pull_is_felt_after_the_same_time_however_often_the_arm_is_read(spot, period_s):
    model = arm_model(spot)
    watch = PullWatch(model, POINT_H, 10.0, period_s)
    pulled_nm = -levers_m(model, Q_RAD, POINT_H).T @ np.array([20.0, 0.0, 0.0])
    times_s = np.arange(1, 40) * period_s
    felt_s = [t for t in times_s if watch.feels_pull(t, Q_RAD, pulled_nm * (t > 1.0))]
    assert 0.1 < felt_s[0] - 1.0 < 0.6


def test_levers_are_the_derivative_of_the_point_by_each_joint(spot):
    model, steps = arm_model(spot), 1e-4 * np.eye(len(Q_RAD))
    shifts = [model.X_BH(Q_RAD + step) @ POINT_H - model.X_BH(Q_RAD - step) @ POINT_H for step in steps]
    assert levers_m(model, Q_RAD, POINT_H) == pytest.approx(np.array(shifts).T / 2e-4, abs=1e-6)
