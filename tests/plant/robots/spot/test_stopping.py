"""Stopping the simulated Spot: every part is at rest within a fifth of a second, wherever it is stopped."""

import numpy as np
import pytest

from skills.robot import ArmTrajectory

STILL_S = 0.2


@pytest.fixture
def engine(engine):
    engine.advance(0.2)
    return engine


def body_speed(engine):
    """Planar speed (m/s), turn rate (rad/s), vertical speed (m/s) of the body."""
    model = engine.world.robots["Alice"]
    V_WB = engine.world.plant.EvalBodySpatialVelocityInWorld(engine.context, model.body)
    vx, vy, vz = V_WB.translational()
    return float(np.hypot(vx, vy)), abs(float(V_WB.rotational()[2])), abs(float(vz))


def arm_rate(spot):
    rates = spot.joints().velocity_rad_s
    return max(abs(rates[name]) for name in spot.capabilities().arm.joint_names)


@pytest.mark.parametrize("velocity", [(0.8, 0.0, 0.0), (-0.8, 0.0, 0.0), (0.0, 0.5, 0.0), (0.8, 0.0, 1.0)])
@pytest.mark.parametrize("ticks", [3, 8, 14])
def test_the_body_is_at_rest_in_time_from_every_speed(engine, spot, lease, velocity, ticks):
    for _ in range(ticks):
        spot.drive(*velocity, until_s=engine.now() + 0.3, lease=lease)
        engine.advance(0.05)
    assert body_speed(engine)[0] > 0.15
    spot.stop(lease=lease)
    engine.advance(STILL_S)
    speed, turn_rate, _ = body_speed(engine)
    assert (speed < 0.05, turn_rate < 0.05) == (True, True), (speed, turn_rate)


@pytest.mark.parametrize("part", [0.1, 0.4, 0.7])
def test_the_arm_is_at_rest_in_time(engine, spot, lease, part):
    start = np.array([spot.joints().position_rad[name] for name in spot.capabilities().arm.joint_names])
    goal = start + np.array([0.6, 0.9, -0.9, 0.5, 0.5, 0.5])
    trajectory = ArmTrajectory(np.array([0.0, 0.6]), np.array([start, goal]))
    spot.move_arm(trajectory, until_s=engine.now() + 5.0, lease=lease)
    engine.advance(0.6 * part)
    assert arm_rate(spot) > 0.3
    spot.stop(lease=lease)
    engine.advance(STILL_S)
    assert arm_rate(spot) < 0.1


@pytest.mark.parametrize(("opens_s", "least", "most"), [(0.2, 0.1, 1.0), (0.0, -0.05, 0.05)])
def test_a_stopped_gripper_stays_in_place_or_closed(engine, spot, lease, opens_s, least, most):
    spot.set_gripper(1.4, 20.0, until_s=engine.now() + 5.0, lease=lease)
    engine.advance(opens_s)
    spot.stop(lease=lease)
    engine.advance(STILL_S)
    opening_rad = spot.gripper().opening
    assert least < opening_rad < most
    engine.advance(0.5)
    assert spot.gripper().opening == pytest.approx(opening_rad, abs=0.02)


def test_a_stopped_body_stays_at_its_height(engine, spot, lease):
    spot.stand(0.43, 0.0, until_s=engine.now() + 5.0, lease=lease)
    engine.advance(0.2)
    spot.stop(lease=lease)
    engine.advance(STILL_S)
    height_m = spot.odometry().X_OB.translation()[2]
    assert body_speed(engine)[2] < 0.02
    engine.advance(0.5)
    assert spot.odometry().X_OB.translation()[2] == pytest.approx(height_m, abs=0.005)
    assert height_m > 0.45


def test_lease_holder_returns_the_current_lease(spot, lease):
    assert spot.lease_holder() == lease
    taken = spot.take_lease("tablet")
    assert spot.lease_holder() == taken
    spot.return_lease(taken)
    assert spot.lease_holder() is None
