"""Values that the API does not allow: field, value and allowed range are named."""

import pytest
from bosdyn.api import (
    arm_command_pb2,
    basic_command_pb2,
    geometry_pb2,
    gripper_command_pb2,
    image_pb2,
    manipulation_api_pb2,
    power_pb2,
    robot_command_pb2,
    world_object_pb2,
)
from bosdyn.api.keepalive import keepalive_pb2
from bosdyn.client.exceptions import InvalidRequestError as RefusedRequestError
from bosdyn.client.image import build_image_request
from bosdyn.client.robot_command import InvalidRequestError as InvalidCommandError

from errand_spot.messages import InvalidRequestError
from errand_spot.server.computer import Pace
from errand_spot.server.refusals import check_values
from tests.tables import table

PACE = Pace.CLIENT
MODULES = {
    "arm_command_pb2": arm_command_pb2,
    "basic_command_pb2": basic_command_pb2,
    "geometry_pb2": geometry_pb2,
    "gripper_command_pb2": gripper_command_pb2,
    "image_pb2": image_pb2,
    "keepalive_pb2": keepalive_pb2,
    "manipulation_api_pb2": manipulation_api_pb2,
    "power_pb2": power_pb2,
    "robot_command_pb2": robot_command_pb2,
    "world_object_pb2": world_object_pb2,
}


def message(kind, given):
    module, *names = kind.split(".")
    found = MODULES[module]
    for name in names:
        found = getattr(found, name)
    edges = given.get("child_to_parent_edge_map", {})  # a map of messages takes no mapping
    made = found(**({} if edges else given))
    for name, edge in edges.items():
        made.child_to_parent_edge_map[name].CopyFrom(geometry_pb2.FrameTreeSnapshot.ParentEdge(**edge))
    return made


@pytest.mark.parametrize(*table(__file__, "values"))
def test_a_value_out_of_its_range_is_named(kind, given, said):
    if said is None:
        check_values(message(kind, given))
        return
    with pytest.raises(InvalidRequestError) as refused:
        check_values(message(kind, given))
    assert said in str(refused.value)


def test_a_command_gets_the_status_of_the_api_and_moves_nothing(spot):
    command = robot_command_pb2.RobotCommand()
    trajectory = command.synchronized_command.arm_command.arm_joint_move_command.trajectory
    trajectory.maximum_velocity.value = -1.0
    trajectory.points.add().position.sh0.value = 0.5
    with pytest.raises(InvalidCommandError) as refused:
        spot.commands.robot_command(command)
    assert "trajectory.maximum_velocity is -1; it must be 0.001" in refused.value.response.message


def test_a_request_of_another_service_is_invalid(spot):
    with pytest.raises(RefusedRequestError, match="quality_percent is 500"):
        spot.robot.ensure_client("image").get_image([build_image_request("hand_color_image", quality_percent=500)])
