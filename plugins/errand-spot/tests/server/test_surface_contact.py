"""Surface contact: positions are followed, forces are refused."""

import time

import pytest
from bosdyn.api import arm_surface_contact_pb2, arm_surface_contact_service_pb2
from bosdyn.client.arm_surface_contact import ArmSurfaceContactClient
from bosdyn.client.exceptions import RpcError
from bosdyn.client.frame_helpers import get_a_tform_b
from bosdyn.client.math_helpers import Quat, SE3Pose
from bosdyn.client.robot_command import RobotCommandBuilder, block_until_arm_arrives

from errand_spot.server.computer import Pace

PACE, SHARED = Pace.CLIENT, True
Request = arm_surface_contact_pb2.ArmSurfaceContact.Request


def contact(spot, frame="body", **fields):
    """Asks for a path of the hand ahead of the body, with more fields."""
    block_until_arm_arrives(spot.commands, spot.commands.robot_command(RobotCommandBuilder.arm_ready_command()))
    asked = Request(root_frame_name=frame, **fields)
    asked.pose_trajectory_in_task.points.add(pose=SE3Pose(0.75, 0.2, 0.2, Quat()).to_proto())
    client = spot.robot.ensure_client(ArmSurfaceContactClient.default_service_name)
    client.arm_surface_contact_command(arm_surface_contact_service_pb2.ArmSurfaceContactCommand(request=asked))


def test_the_hand_follows_a_path_of_positions(spot):
    contact(spot)
    time.sleep(4.0)
    hand = get_a_tform_b(spot.tree, "body", "hand")
    assert (hand.x, hand.y, hand.z) == pytest.approx((0.75, 0.2, 0.2), abs=0.02)


def test_gripper_and_body_move_with_the_hand(spot):
    claw = RobotCommandBuilder.claw_gripper_open_fraction_command(0.5).synchronized_command.gripper_command
    contact(spot, gripper_command=claw.claw_gripper_command, is_robot_following_hand=True)
    time.sleep(4.0)
    assert spot.served.scripted.opening == pytest.approx(0.785, abs=0.05)


@pytest.mark.parametrize("axis", ["x_axis", "y_axis", "z_axis"])
def test_a_press_along_an_axis_is_refused_by_name(spot, axis):
    with pytest.raises(RpcError) as refused:
        contact(spot, **{axis: Request.AXIS_MODE_FORCE})
    assert f"{axis} is AXIS_MODE_FORCE" in refused.value.error.details()


def test_an_unknown_frame_is_refused_with_the_status_of_a_command(spot):
    with pytest.raises(RpcError) as refused:
        contact(spot, frame="table")
    assert refused.value.error.details() == "STATUS_UNKNOWN_FRAME: frame 'table' is unknown"
