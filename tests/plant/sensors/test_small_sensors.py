"""IMU, battery, gripper and joint sensors."""

import numpy as np
import pytest
from pydrake.math import RigidTransform, RollPitchYaw

from plant.sensors import proprioception
from plant.sensors.proprioception import BatteryModel, BatterySpec, GripperModel, ImuModel, JointModel, charge_after

ZERO = np.zeros(3)
QUIET_IMU = proprioception.ImuNoise(0.0, 0.0, 0.0, 0.0)


def rng():
    return np.random.default_rng(4)


def test_imu_at_rest_feels_gravity_upwards_in_the_body_frame():
    pitched = RigidTransform(RollPitchYaw(0, 0.3, 0), [0, 0, 0.5])
    force = ImuModel(rng(), QUIET_IMU).update(0.0, pitched, ZERO, ZERO).linear_acceleration_B
    np.testing.assert_allclose(force, [-9.81 * np.sin(0.3), 0, 9.81 * np.cos(0.3)], atol=1e-12)


def test_imu_feels_acceleration_and_turning():
    imu = ImuModel(rng(), QUIET_IMU)
    X_WB = RigidTransform(RollPitchYaw(0, 0, np.pi / 2), [0, 0, 0.5])
    imu.update(0.0, X_WB, ZERO, ZERO)
    reading = imu.update(0.1, X_WB, np.array([0.2, 0, 0.5]), np.array([0, 0.3, 0]))
    np.testing.assert_allclose(reading.linear_acceleration_B, [3.0, 0, 9.81], atol=1e-9)
    np.testing.assert_allclose(reading.angular_velocity_B, [0, -0.2, 0.5], atol=1e-9)


def test_imu_has_bias_and_noise():
    imu = ImuModel(rng())
    rates = np.array([imu.update(0.01 * i, RigidTransform(), ZERO, ZERO).angular_velocity_B for i in range(500)])
    assert np.std(rates, axis=0) == pytest.approx([0.003] * 3, rel=0.2)
    assert np.abs(rates.mean(axis=0)).max() > 5e-4


def test_battery_lasts_its_runtime_at_load_and_longer_at_rest():
    spec = BatterySpec()
    left = [charge_after(*each, spec) for each in ((1.0, 5400.0, 1.0), (1.0, 5400.0, 0.0), (0.1, 1e6, 1.0))]
    assert left == [pytest.approx(0.0), pytest.approx(0.6), 0.0]


def test_battery_reading_falls_with_time_and_stays_in_range():
    battery = BatteryModel(rng(), 0.5)
    assert battery.update(10.0, 1.0).charge == pytest.approx(0.5, abs=0.005)
    assert battery.update(10.0 + 540.0, 1.0).charge == pytest.approx(0.4, abs=0.005)
    assert battery.update(1e6, 1.0).charge <= 0.005


def test_impossible_battery_charge_is_refused():
    with pytest.raises(ValueError, match="from 0 to 1"):
        BatteryModel(rng(), 1.5)


def feel(gripper, opening_rad, force_n, start_s, duration_s=1.0):
    steps = np.arange(start_s, start_s + duration_s, 0.02)
    return [gripper.update(float(t), opening_rad, force_n) for t in steps]


def test_gripper_believes_it_holds_after_pressing_on_something_wide():
    readings = feel(GripperModel(rng()), 0.6, 30.0, 0.0)
    assert not readings[0].holding and readings[-1].holding
    assert np.mean([r.force_n for r in readings]) == pytest.approx(30.0, rel=0.1)
    assert np.std([r.opening for r in readings]) == pytest.approx(0.003, rel=0.4)


def test_gripper_notices_a_lost_object():
    gripper = GripperModel(rng())
    assert feel(gripper, 0.6, 30.0, 0.0)[-1].holding
    assert not feel(gripper, 0.0, 30.0, 1.0)[-1].holding


def test_gripper_pressing_on_itself_holds_nothing():
    assert not feel(GripperModel(rng()), 0.0, 40.0, 0.0)[-1].holding


# opening (rad) and force (N) of what is between the fingertips: the thinnest, in empty jaws, against them
@pytest.mark.parametrize(
    ("opening_rad", "force_n", "holds"), [(0.03, 15.0, True), (0.0, 0.0, False), (0.004, 2.0, False)]
)
def test_gripper_feels_thin_objects_and_not_its_own_fingers(opening_rad, force_n, holds):
    assert feel(GripperModel(rng()), opening_rad, force_n, 0.0)[-1].holding is holds


def test_shut_gripper_takes_a_clients_word_until_it_is_taken_back():
    gripper = GripperModel(rng())
    feel(gripper, 0.0, 0.0, 0.0)
    gripper.tell(True)
    assert feel(gripper, 0.0, 0.0, 1.0)[-1].holding
    gripper.tell(False)
    assert not feel(gripper, 0.0, 0.0, 2.0)[-1].holding


def test_word_of_a_client_does_not_hide_the_loss_of_a_wide_object():
    gripper = GripperModel(rng())
    feel(gripper, 0.6, 30.0, 0.0)
    gripper.tell(True)
    assert not feel(gripper, 0.0, 0.0, 1.0)[-1].holding


def test_gripper_moving_freely_holds_nothing_and_reads_no_negative_force():
    readings = feel(GripperModel(rng()), 1.0, 0.0, 0.0)
    assert not any(r.holding for r in readings) and min(r.force_n for r in readings) >= 0.0


def test_joint_readings_are_close_and_named():
    joints = JointModel(rng(), ["a", "b"]).update(0.3, np.array([0.1, 0.2]), np.array([1.0, 2.0]), np.array([3.0, 4.0]))
    assert joints.position_rad["b"] == pytest.approx(0.2, abs=0.01)
    assert joints.velocity_rad_s["a"] == pytest.approx(1.0, abs=0.1)
    assert joints.effort_nm["b"] == pytest.approx(4.0, abs=2.0) and joints.position_rad["a"] != 0.1


def test_joint_arrays_of_wrong_length_are_refused():
    with pytest.raises(ValueError):
        JointModel(rng(), ["a", "b"]).update(0.0, np.zeros(3), np.zeros(3), np.zeros(3))


def test_sensors_repeat_with_their_seed():
    def readings():
        gripper, joints = GripperModel(rng()), JointModel(rng(), ["a"])
        return gripper.update(0.0, 0.3, 5.0), joints.update(0.0, np.ones(1), np.ones(1), np.ones(1))

    assert readings() == readings()
