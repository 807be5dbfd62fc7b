"""The scripted robot implements the Robot protocol."""

import math

import numpy as np
import pytest

from plant.robots.fetch.kind import FETCH
from skills.robot import ArmTrajectory, CommandCause, CommandState, LeaseError, Pose2D
from skills.testing.blocks import ROOM, TABLE_CAN, Block, can_at
from skills.testing.clock import VirtualClock
from skills.testing.robot import ScriptedRobot, Start


@pytest.fixture
def clock():
    return VirtualClock()


@pytest.fixture
def robot(clock):
    return ScriptedRobot(clock)


@pytest.fixture
def lease(robot):
    return robot.acquire_lease("test")


@pytest.fixture
def grasping(clock, spot):
    """Robot with an arm, and a function that moves its gripper for a second."""
    robot = ScriptedRobot(clock, capabilities=spot)
    lease = robot.acquire_lease("test")

    def move(opening, force_n=40.0):
        robot.set_gripper(opening, force_n, until_s=9.0, lease=lease)
        clock.advance(1.0)
        return robot.gripper()

    return robot, move


def state(robot, command):
    return robot.command_status(command).state


def test_time_passes_in_whole_steps(clock):
    steps = []
    clock.attach(steps.append)
    clock.advance(0.05)
    assert clock.now() == 0.05
    assert len(steps) == 5


def test_equal_seeds_give_equal_scans(clock):
    one, two = (ScriptedRobot(clock, blocks=[*ROOM, TABLE_CAN], seed=4) for _ in range(2))
    assert np.array_equal(one.scan().ranges_m, two.scan().ranges_m, equal_nan=True)


def test_a_drive_moves_the_robot_until_it_expires_and_then_it_brakes(clock, robot, lease):
    command = robot.drive(0.5, 0.0, 0.0, until_s=1.0, lease=lease)
    clock.advance(1.0)
    assert robot.pose.x_m == pytest.approx(0.45, abs=0.03)
    assert state(robot, command) is CommandState.RUNNING
    clock.advance(0.2)
    assert state(robot, command) is CommandState.DONE
    assert robot.moving_parts == ()


def test_a_new_drive_replaces_the_old_one(robot, lease):
    first = robot.drive(0.5, 0.0, 0.0, until_s=9.0, lease=lease)
    robot.drive(0.0, 0.0, 0.5, until_s=9.0, lease=lease)
    assert state(robot, first) is CommandState.STOPPED
    assert "replaced" in robot.command_status(first).reason


def test_stop_can_be_for_one_command_only(robot, lease):
    first = robot.drive(0.5, 0.0, 0.0, until_s=9.0, lease=lease)
    second = robot.drive(0.4, 0.0, 0.0, until_s=9.0, lease=lease)
    robot.stop(lease=lease, only=first)
    assert state(robot, second) is CommandState.RUNNING
    robot.stop(lease=lease)
    assert state(robot, second) is CommandState.STOPPED


def test_commands_with_a_lost_lease_are_refused(robot, lease):
    with pytest.raises(LeaseError, match="test"):
        robot.acquire_lease("other")
    command = robot.drive(0.5, 0.0, 0.0, until_s=9.0, lease=lease)
    robot.take_lease("other")
    assert state(robot, command) is CommandState.STOPPED
    assert state(robot, robot.drive(0.5, 0.0, 0.0, until_s=9.0, lease=lease)) is CommandState.REFUSED


def test_invalid_commands_are_refused(robot, lease):
    assert state(robot, robot.drive(math.nan, 0.0, 0.0, until_s=9.0, lease=lease)) is CommandState.REFUSED
    reach = ArmTrajectory(np.array([1.0]), np.zeros((1, 6)))
    refused = robot.command_status(robot.move_arm(reach, until_s=9.0, lease=lease))
    assert (refused.state, refused.reason) == (CommandState.REFUSED, "there is no arm")
    assert refused.cause is CommandCause.UNSUPPORTED


def test_a_command_that_does_not_succeed_has_its_cause(clock, robot, lease):
    late = robot.stand(0.6, 0.0, until_s=0.01, lease=lease)
    clock.advance(0.05)
    clock.advance(0.05)
    replaced = robot.drive(0.5, 0.0, 0.0, until_s=9.0, lease=lease)
    taken = robot.drive(0.4, 0.0, 0.0, until_s=9.0, lease=lease)
    new = robot.take_lease("other")
    refused, invalid = (robot.stand(2.0, 0.0, until_s=9.0, lease=each) for each in (lease, new))
    robot.refuse_because, robot.refusal_cause = {"sit": "it fell"}, CommandCause.FAULT
    causes = {
        late: CommandCause.LATE,
        replaced: CommandCause.STOPPED,
        taken: CommandCause.NO_LEASE,
        refused: CommandCause.NO_LEASE,
        invalid: CommandCause.INVALID,
        robot.sit(until_s=9.0, lease=new): CommandCause.FAULT,
    }
    assert {command: robot.command_status(command).cause for command in causes} == causes


def test_the_body_rises_to_the_commanded_height(clock, robot, lease):
    command = robot.stand(0.58, 0.0, until_s=3.0, lease=lease)
    clock.advance(0.5)
    assert state(robot, command) is CommandState.DONE
    assert robot.odometry().X_OB.translation()[2] == pytest.approx(0.58)


def test_odometry_drifts_as_configured(clock, robot, lease):
    robot.odometry_scale = 1.1
    robot.drive(0.5, 0.0, 0.0, until_s=2.0, lease=lease)
    clock.advance(2.5)
    assert robot.odometry().pose.x_m == pytest.approx(1.1 * robot.pose.x_m)


def test_the_lidar_sees_the_walls_of_the_room(clock):
    points = ScriptedRobot(clock, blocks=ROOM).scan().points_B()
    wall = points[np.abs(points[:, 1]) < 0.1]
    assert wall[:, 0].max() == pytest.approx(4.0, abs=0.05)
    assert wall[:, 0].min() == pytest.approx(-2.0, abs=0.05)


def test_pictures_show_depth_and_colour_of_the_blocks(clock):
    image = ScriptedRobot(clock, blocks=[Block(1.0, -0.5, 1.2, 0.5, 0.0, 1.0, (255, 0, 0))]).image("frontleft")
    lens = image.intrinsics
    middle = image.depth_m[int(lens.cy), int(lens.cx)]
    assert middle == pytest.approx((1.0 - 0.42) / math.cos(math.radians(30)), abs=0.02)
    assert tuple(image.colour[int(lens.cy), int(lens.cx)]) == (255, 0, 0)


def test_an_unknown_camera_is_refused_with_the_known_ones(robot):
    with pytest.raises(ValueError, match="frontleft"):
        robot.image("tail")


def test_a_block_without_extent_is_refused():
    with pytest.raises(ValueError, match="must hold"):
        Block(1.0, 0.0, 1.0, 1.0)


@pytest.mark.parametrize(("between_rad", "held"), [(0.4, (0.4, True)), (None, (pytest.approx(0.0), False))])
def test_the_gripper_closes_as_far_as_the_object_in_it_allows(grasping, between_rad, held):
    robot, move = grasping
    robot.in_gripper_rad = between_rad
    assert not move(1.4, 20.0).holding
    closed = move(0.0, 60.0)
    assert (closed.opening, closed.holding) == held


def test_the_arm_follows_its_trajectory(clock, spot):
    robot = ScriptedRobot(clock, capabilities=spot)
    lease = robot.acquire_lease("test")
    there = robot.q_rad + 0.5
    command = robot.move_arm(ArmTrajectory(np.array([1.0]), there[None, :]), until_s=9.0, lease=lease)
    clock.advance(0.5)
    assert robot.q_rad == pytest.approx(there - 0.25)
    assert robot.moving_parts == ("move_arm",)
    clock.advance(0.6)
    assert robot.q_rad == pytest.approx(there)
    assert robot.command_status(command).state is CommandState.DONE


def test_a_loose_block_between_the_fingers_is_taken_and_put_down(grasping):
    robot, move = grasping
    x, y, z = (float(v) for v in robot._between_fingers_W())
    robot.blocks.append(can_at(x, y, z - 0.05))
    move(1.4)
    assert move(0.0).holding
    assert robot.blocks == []
    assert not move(1.4).holding
    assert robot.blocks[0].z0 == 0.0


def test_a_docked_robot_charges_and_another_does_not(clock):
    docked, walking = (ScriptedRobot(clock, start=Start(charge=0.5, docked=is_docked)) for is_docked in (True, False))
    clock.advance(30.0)
    assert docked.battery().charge == pytest.approx(0.55)
    assert walking.battery().charge < 0.5


def test_the_robot_starts_at_its_start_pose(clock):
    robot = ScriptedRobot(clock, start=Start(pose=Pose2D(1.0, 2.0, 0.5), charge=0.2))
    assert robot.pose == Pose2D(1.0, 2.0, 0.5)
    assert robot.battery().charge == 0.2


def test_a_head_turns_its_camera(clock):
    robot = ScriptedRobot(clock, capabilities=FETCH.capabilities(), blocks=ROOM)
    lease = robot.acquire_lease("test")
    ahead = robot.image("head")
    command = robot.point_head(0.5, 0.3, until_s=2.0, lease=lease)
    clock.advance(0.1)
    assert robot.command_status(command).state is CommandState.DONE
    turned = robot.image("head")
    axes = [each.frames.pose(each.camera_frame).rotation().matrix()[:, 2] for each in (ahead, turned)]
    assert axes[0] == pytest.approx([1.0, 0.0, 0.0], abs=1e-9)
    assert math.atan2(axes[1][1], axes[1][0]) == pytest.approx(0.5)
    assert math.asin(-axes[1][2]) == pytest.approx(0.3)


def test_a_head_command_beyond_the_range_or_without_a_head_is_refused(clock, robot):
    head = ScriptedRobot(clock, capabilities=FETCH.capabilities())
    refused = head.point_head(3.0, 0.0, until_s=2.0, lease=head.acquire_lease("test"))
    assert "pan 3.00 rad must lie in" in head.command_status(refused).reason
    assert head.head_rad == (0.0, 0.0)
    refused = robot.point_head(0.0, 0.0, until_s=2.0, lease=robot.acquire_lease("test"))
    assert robot.command_status(refused).reason == "there is no head"
