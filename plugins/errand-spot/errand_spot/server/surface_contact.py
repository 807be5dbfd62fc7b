"""Surface contact in its simple form: positions along all axes. A press with a set force is not simulated."""

from __future__ import annotations

from typing import Any

from bosdyn.api import arm_surface_contact_service_pb2, robot_command_pb2

from errand_spot.messages import InvalidRequestError
from errand_spot.server.calls import Call, Service
from errand_spot.server.commands import RobotCommandService, Status
from errand_spot.server.identity import DOMAIN

_AXES = ("x_axis", "y_axis", "z_axis")
_PATH = (
    *("root_frame_name", "wrist_tform_tool", "root_tform_task", "pose_trajectory_in_task"),
    *("maximum_acceleration", "max_linear_velocity", "max_angular_velocity"),
    *("max_pos_tracking_error", "max_rot_tracking_error"),
)
"""Fields that a Cartesian command has, too."""


class ArmSurfaceContactService(Service):
    """Moves the hand along a path, as a Cartesian command does. The API's answer has no status."""

    name, type, authority = "arm-surface-contact", "bosdyn.api.ArmSurfaceContactService", f"api.{DOMAIN}"
    aborts = True

    def __init__(self, commands: RobotCommandService) -> None:
        self._commands = commands

    def ArmSurfaceContact(self, request: Any, call: Call) -> Any:
        """Starts to move arm and gripper, and the body with the hand. Raises InvalidRequestError."""
        asked = request.request
        for axis in _AXES:
            if getattr(asked, axis) != asked.AXIS_MODE_POSITION:
                raise InvalidRequestError(f"request.{axis} is AXIS_MODE_FORCE: a press by force is not simulated")
        made = robot_command_pb2.RobotCommandRequest(lease=request.lease)
        parts = made.command.synchronized_command
        path = parts.arm_command.arm_cartesian_command
        path.SetInParent()
        for name in _PATH:
            value = getattr(asked, name)
            if isinstance(value, str):
                setattr(path, name, value)
            elif asked.HasField(name):
                getattr(path, name).CopyFrom(value)
        if asked.HasField("gripper_command"):
            parts.gripper_command.claw_gripper_command.CopyFrom(asked.gripper_command)
        if asked.is_robot_following_hand:
            parts.mobility_command.follow_arm_request.SetInParent()
        answer = self._commands.RobotCommand(made, call)
        if answer.status != Status.STATUS_OK:
            use = answer.lease_use_result
            reason = answer.message or f"lease: {use.Status.Name(use.status)}"
            raise InvalidRequestError(f"{Status.Status.Name(answer.status)}: {reason}")
        return arm_surface_contact_service_pb2.ArmSurfaceContactResponse()
