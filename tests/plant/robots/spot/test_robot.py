"""The Robot protocol as the simulated Spot keeps it."""

from dataclasses import replace

import numpy as np
import pytest
from pydrake.multibody.plant import MultibodyPlantConfig

from plant.diagram import DiagramConfig, build_diagram
from plant.engine import Engine
from plant.robots.robot_kind import PlacedRobot
from skills.robot import ArmTrajectory, CommandCause, CommandState, DoorHandle, LeaseError, Pose2D
from tests.plant.robots.spot.conftest import new_engine


def truth(engine):
    """(x, y, yaw, height, pitch) of the floating base."""
    model = engine.world.robots["Alice"]
    return np.array(model.floating_base.pose(engine.world.plant.GetPositions(engine.context)))


def states(spot, *commands):
    return [spot.command_status(each).state for each in commands]


def arm_to(spot, offset_rad, seconds):
    start = np.array([spot.joints().position_rad[name] for name in spot.capabilities().arm.joint_names])
    start[1] = max(start[1], -3.14)
    return ArmTrajectory(np.array([0.0, seconds]), np.array([start, start + [0.0, offset_rad, 0.0, 0.0, 0.0, 0.0]]))


def test_drive_moves_the_body_at_the_commanded_velocity(engine, spot, lease):
    command = spot.drive(0.6, 0.0, 0.0, until_s=2.0, lease=lease)
    engine.advance(1.5)
    assert spot.command_status(command).state is CommandState.RUNNING
    x0 = truth(engine)[0]
    engine.advance(0.4)
    assert (truth(engine)[0] - x0) / 0.4 == pytest.approx(0.6, abs=0.02)


def test_a_drive_that_expires_stops_the_robot(engine, spot, lease):
    command = spot.drive(0.8, 0.0, 0.0, until_s=0.5, lease=lease)
    engine.advance(1.5)
    assert spot.command_status(command).state is CommandState.DONE
    before = truth(engine)
    engine.advance(1.0)
    np.testing.assert_allclose(truth(engine), before, atol=1e-3)


def test_speed_and_acceleration_are_limited(engine, spot, lease):
    spot.drive(5.0, 0.0, 0.0, until_s=10.0, lease=lease)
    engine.advance(0.2)
    assert truth(engine)[0] - 0.5 < 0.5 * 2.0 * 0.2**2 + 0.01
    engine.advance(2.0)
    x0 = truth(engine)[0]
    engine.advance(0.5)
    assert (truth(engine)[0] - x0) / 0.5 <= 1.6 + 0.01


def test_stop_only_stops_the_command_it_names(engine, spot, lease):
    old, new = (spot.drive(vx, 0.0, 0.0, until_s=5.0, lease=lease) for vx in (0.3, 0.6))
    spot.stop(lease=lease, only=old)
    engine.advance(0.1)
    assert states(spot, old, new) == [CommandState.STOPPED, CommandState.RUNNING]


def test_a_second_holder_is_refused_until_it_takes_the_lease(engine, spot, lease):
    with pytest.raises(LeaseError, match="'test'"):
        spot.acquire_lease("other")
    spot.drive(0.5, 0, 0, until_s=9.0, lease=lease)
    other = spot.take_lease("other")
    engine.advance(1.0)
    refused = spot.command_status(spot.drive(0.5, 0, 0, until_s=9.0, lease=lease))
    assert (refused.state, "other" in refused.reason) == (CommandState.REFUSED, True)
    assert truth(engine)[0] == pytest.approx(0.5, abs=0.01)
    assert spot.command_status(spot.stop(lease=other)).state is CommandState.DONE


def test_a_lease_of_an_earlier_start_does_not_count(engine, spot, lease):
    earlier = replace(lease, epoch="of the last start")
    refused = spot.command_status(spot.drive(0.5, 0, 0, until_s=9.0, lease=earlier))
    assert (refused.state, refused.cause) == (CommandState.REFUSED, CommandCause.NO_LEASE)


# verb, its arguments (for the arm: how far and how fast it turns), when it ends
@pytest.mark.parametrize(
    ("verb", "arguments", "until_s", "cause"),
    [
        ("drive", (np.nan, 0.0, 0.0), 9.0, CommandCause.INVALID),
        ("stand", (2.0, 0.0), 9.0, CommandCause.INVALID),
        ("move_arm", (1.5, 0.1), 9.0, CommandCause.INVALID),
        ("point_head", (0.0, 0.0), 9.0, CommandCause.UNSUPPORTED),
        ("dock", (520,), 9.0, CommandCause.UNSUPPORTED),
        ("undock", (), 9.0, CommandCause.UNSUPPORTED),
        ("open_door", (DoorHandle((1.0, 0.0, 0.5), True, True),), 9.0, CommandCause.UNSUPPORTED),
        ("sit", (), 0.0, CommandCause.LATE),
        ("move_arm", (1.5, 3.0), 0.2, CommandCause.LATE),
        ("drive", (0.1, 0.0, 0.0), 0.2, CommandCause.NONE),
    ],
)
def test_a_command_that_does_not_succeed_has_its_cause(engine, spot, lease, verb, arguments, until_s, cause):
    given = (arm_to(spot, *arguments),) if verb == "move_arm" else arguments
    command = getattr(spot, verb)(*given, until_s=until_s, lease=lease)
    engine.advance(0.4)
    assert spot.command_status(command).cause is cause


def test_a_stopped_command_has_its_cause(engine, spot, lease):
    replaced = spot.drive(0.3, 0.0, 0.0, until_s=5.0, lease=lease)
    seated = spot.drive(0.3, 0.0, 0.0, until_s=5.0, lease=lease)
    spot.sit(until_s=9.0, lease=lease)
    taken = spot.move_arm(arm_to(spot, 1.0, 3.0), until_s=9.0, lease=lease)
    spot.take_lease("other")
    causes = [spot.command_status(each).cause for each in (replaced, seated, taken)]
    assert causes == [CommandCause.STOPPED, CommandCause.STOPPED, CommandCause.NO_LEASE]


def test_a_returned_lease_stops_the_robot_and_frees_it(engine, spot, lease):
    drive = spot.drive(0.5, 0, 0, until_s=9.0, lease=lease)
    spot.return_lease(lease)
    assert spot.command_status(drive).state is CommandState.STOPPED
    assert spot.acquire_lease("next").holder == "next"


def test_move_arm_is_done_when_the_arm_has_arrived(engine, spot, lease):
    trajectory = arm_to(spot, 0.8, 1.5)
    command = spot.move_arm(trajectory, until_s=5.0, lease=lease)
    engine.advance(1.0)
    assert spot.command_status(command).state is CommandState.RUNNING
    engine.advance(1.5)
    assert spot.command_status(command).state is CommandState.DONE
    assert spot.joints().position_rad["arm_sh1"] == pytest.approx(trajectory.positions_rad[-1][1], abs=0.02)


def test_an_expired_arm_command_holds_the_arm_in_place(engine, spot, lease):
    command = spot.move_arm(arm_to(spot, 1.5, 3.0), until_s=1.0, lease=lease)
    engine.advance(1.5)
    assert spot.command_status(command).state is CommandState.STOPPED
    held = spot.joints().position_rad["arm_sh1"]
    engine.advance(1.0)
    assert spot.joints().position_rad["arm_sh1"] == pytest.approx(held, abs=0.02)


@pytest.mark.parametrize(
    ("offset_rad", "seconds", "word"), [(4.0, 10.0, "joint limits"), (1.5, 0.1, "rad/s"), (-1.0, 5.0, "joint limits")]
)
def test_impossible_arm_trajectories_are_refused(spot, lease, offset_rad, seconds, word):
    status = spot.command_status(spot.move_arm(arm_to(spot, offset_rad, seconds), until_s=20.0, lease=lease))
    assert (status.state, word in status.reason) == (CommandState.REFUSED, True), status.reason


def test_gripper_opens_and_closes_and_holds_nothing(engine, spot, lease):
    for opening in (1.0, 0.0):
        command = spot.set_gripper(opening, 30.0, until_s=engine.now() + 7.0, lease=lease)
        engine.advance(3.0)
        assert spot.gripper().opening == pytest.approx(opening, abs=0.05)
    assert (states(spot, command), spot.gripper().holding) == ([CommandState.DONE], False)


def test_stand_changes_height_and_pitch_and_sit_refuses_to_drive(engine, spot, lease):
    stand = spot.stand(0.45, 0.2, until_s=4.0, lease=lease)
    engine.advance(2.0)
    assert spot.command_status(stand).state is CommandState.DONE
    np.testing.assert_allclose(truth(engine)[3:], [0.45, 0.2], atol=0.02)
    sit = spot.sit(until_s=9.0, lease=lease)
    engine.advance(3.0)
    assert spot.command_status(sit).state is CommandState.DONE
    assert "sits" in spot.command_status(spot.drive(0.5, 0.0, 0.0, until_s=9.0, lease=lease)).reason


def test_a_fall_reaches_the_floor_in_half_a_second(engine, spot, lease):
    fall = spot.fall(until_s=9.0, lease=lease)
    heights = [truth(engine)[3]]
    while spot.command_status(fall).state is CommandState.RUNNING and engine.now() < 3.0:
        engine.advance(0.01)
        heights.append(truth(engine)[3])
    lies = next(k for k, height in enumerate(heights) if height < 0.21)
    assert 40 < lies < 60
    assert heights[0] - heights[lies // 2] < 0.35 * (heights[0] - heights[lies])  # it falls ever faster
    assert min(heights) > 0.1
    stand = spot.stand(0.52, 0.0, until_s=9.0, lease=lease)
    engine.advance(2.0)
    assert spot.command_status(stand).state is CommandState.DONE


def test_a_command_that_has_expired_already_is_refused(engine, spot, lease):
    engine.advance(1.0)
    assert "expires" in spot.command_status(spot.drive(0.5, 0.0, 0.0, until_s=0.5, lease=lease)).reason


def test_unknown_command_ids_raise(spot):
    with pytest.raises(KeyError):
        spot.command_status(999)


def test_an_engine_that_was_put_back_runs_like_a_new_one(kept_spot):
    def walked(engine):
        spot = engine.robots["Alice"]
        lease = spot.acquire_lease("test")
        spot.move_arm(arm_to(spot, 0.8, 1.5), until_s=5.0, lease=lease)
        spot.set_gripper(1.0, 30.0, until_s=5.0, lease=lease)
        spot.drive(0.8, 0.0, 0.5, until_s=9.0, lease=lease)
        engine.advance(1.0)
        return truth(engine), [*spot.odometry().X_OB.translation(), *spot.joints().position_rad.values()]

    (new, _), first, second = (walked(begin()) for begin in (new_engine, kept_spot.again, kept_spot.again))
    np.testing.assert_allclose(first[0], new, rtol=0.0, atol=1e-6)
    np.testing.assert_array_equal(np.concatenate(first), np.concatenate(second))


def test_a_stopped_robot_stands_within_a_fifth_of_a_second(engine, spot, lease):
    spot.drive(0.8, 0.0, 0.5, until_s=9.0, lease=lease)
    engine.advance(2.0)
    spot.stop(lease=lease)
    engine.advance(0.2)
    before = truth(engine)
    engine.advance(0.5)
    assert np.abs(truth(engine) - before).max() < 0.01


def test_efforts_of_joints_are_those_that_the_solver_applies(monkeypatch):
    sensed, solved = [], []
    for sampled in (False, True):
        monkeypatch.setattr(
            "plant.diagram.MultibodyPlantConfig",
            lambda sampled=sampled, **given: MultibodyPlantConfig(**{**given, "use_sampled_output_ports": sampled}),
        )
        alice = PlacedRobot("Alice", "spot", Pose2D(0.0, 0.0, 0.0))
        engine = Engine(world := build_diagram(DiagramConfig(robots=[alice], visuals=False, render=False)))
        spot, model = engine.robots["Alice"], world.robots["Alice"]
        spot.drive(0.4, 0.0, 0.3, until_s=2.0, lease=spot.acquire_lease("test"))
        engine.advance(0.7)
        sensed.append([*spot.joints().effort_nm.values()])
        solved.append(world.plant.get_net_actuation_output_port(model.instance).Eval(engine.context))
    assert np.abs(solved[1]).max() > 5.0
    np.testing.assert_allclose(sensed[0], solved[1], atol=2.0)  # noise of 0.3 Nm
    np.testing.assert_allclose(sensed[0], sensed[1])


def test_shut_gripper_holds_what_the_lease_holder_says_until_it_opens(engine, spot, lease):
    spot.set_gripper(0.0, 30.0, until_s=engine.now() + 4.0, lease=lease)
    engine.advance(2.0)
    spot.carry(True, lease=lease)
    engine.advance(0.1)
    told = spot.gripper().holding
    spot.set_gripper(1.0, 30.0, until_s=engine.now() + 4.0, lease=lease)
    engine.advance(2.0)
    assert (told, spot.gripper().holding) == (True, False)
