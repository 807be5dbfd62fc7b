"""Spot's own door command through the adapter: its message, its feedback, and a robot without that service."""

import pytest
from bosdyn.api import basic_command_pb2
from bosdyn.api.spot import door_pb2

from skills.robot import CommandCause, CommandState, DoorHandle

HANDLE = DoorHandle((1.2, -0.35, 0.5), hinge_left=True, pull=False)
PROCESSING = basic_command_pb2.RobotCommandFeedbackStatus.STATUS_PROCESSING
STATUS = door_pb2.DoorCommand.Feedback.Status


class DoorService:
    """Door service that notes the commands, and gives one status as feedback after `after` calls for it."""

    def __init__(self, ends_with, after=3):
        self.commands, self.asked, self.ends_with, self.after = [], 0, ends_with, after

    def OpenDoor(self, request, timeout):
        self.commands.append(request)
        return door_pb2.OpenDoorCommandResponse(status=door_pb2.OpenDoorCommandResponse.STATUS_OK, door_command_id=7)

    def OpenDoorFeedback(self, request, timeout):
        assert request.door_command_id == 7
        self.asked += 1
        status = self.ends_with if self.asked >= self.after else STATUS.Value("STATUS_IN_PROGRESS")
        answer = door_pb2.OpenDoorFeedbackResponse(status=PROCESSING)
        answer.feedback.status = status
        return answer


def opened(powered, service=None):
    """Opens a door by a service, if there is one; returns the last status."""
    if service is not None:
        powered.connection._stubs["door"] = service
    return powered.ends(powered.robot.open_door(HANDLE, **powered.until_in(30.0)))


def test_a_robot_with_arm_and_door_service_opens_doors(powered):
    assert powered.robot.capabilities().opens_doors


def test_the_command_searches_the_handle_before_the_robot_and_pushes(powered):
    service = DoorService(STATUS.Value("STATUS_COMPLETED"))
    assert opened(powered, service).state is CommandState.DONE
    (request,) = service.commands
    grasp = request.door_command.auto_grasp_command
    end = grasp.search_ray_end_in_frame
    assert (grasp.frame_name, request.lease.resource) == ("body", "body")
    assert (end.x, end.y, end.z) == pytest.approx((1.3, -0.35, 0.5))
    assert door_pb2.DoorCommand.HingeSide.Name(grasp.hinge_side) == "HINGE_SIDE_LEFT"
    swings = door_pb2.DoorCommand.SwingDirection.Name(grasp.swing_direction)
    assert swings in ("SWING_DIRECTION_PUSH", "SWING_DIRECTION_OUTSWING")


@pytest.mark.parametrize("status", ["STATUS_STALLED", "STATUS_NOT_DETECTED"])
def test_a_door_that_is_stalled_or_not_seen_stops_the_command(powered, status):
    ended = opened(powered, DoorService(STATUS.Value(status)))
    assert (ended.state, ended.cause) == (CommandState.STOPPED, CommandCause.BLOCKED)


def test_the_door_command_needs_the_lease(powered):
    powered.robot.return_lease(powered.lease)
    assert opened(powered).cause is CommandCause.NO_LEASE


def test_a_server_without_doors_refuses_the_command_plainly(powered):
    refused = opened(powered)
    assert (refused.state, refused.cause) == (CommandState.REFUSED, CommandCause.UNSUPPORTED), refused
