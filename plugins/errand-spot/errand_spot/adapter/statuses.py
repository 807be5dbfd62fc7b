"""Statuses of the API's responses: for each failure its cause and a hint."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

import grpc

from skills.robot import CommandCause as Cause

GOOD: Final = frozenset(
    {
        *("CODE_UNSPECIFIED", "CODE_OK", "STATUS_OK", "STATUS_SUCCESS", "ESTOP_LEVEL_NONE", "STATUS_UNMANAGED"),
        *("STATUS_IN_PROGRESS", "STATUS_PROCESSING", "STATUS_IS_STANDING", "STATUS_IS_SITTING", "STATUS_COMPLETE"),
        *("STATUS_AT_GOAL", "STATUS_APPLYING_FORCE", "PLANNER_STATUS_UNKNOWN", "PLANNER_STATUS_SUCCESS"),
        *("PLANNER_STATUS_MODIFIED", "STATUS_COMMAND_TIMED_OUT", "STATUS_AT_PREP_POSE", "STATUS_COMPLETED"),
    }
)
"""Names of statuses with which a command goes on, or is done."""
_TAKEN: Final = "another client has the lease; wait until it returns it, or begin with --take"
_REPORT: Final = "restart the robot, and report it if it comes again"
_CAMERA: Final = "the camera gives no picture; look at the robot's faults"
_ESTOP: Final = "an E-stop is pressed or silent; release it and begin again"
_REPLACED: Final = "another program has changed the E-stop; keep to one of them"
MEANINGS: Final[Mapping[str, tuple[Cause, str]]] = {
    "STATUS_UNKNOWN": (Cause.REFUSED, f"the robot does not say what it did; {_REPORT}"),
    "CODE_INTERNAL_SERVER_ERROR": (Cause.FAULT, f"an error within the robot; {_REPORT}"),
    "CODE_INVALID_REQUEST": (Cause.INVALID, "the robot does not allow these values"),
    # leases
    "STATUS_INVALID_LEASE": (Cause.NO_LEASE, "the robot does not know this lease; begin again"),
    "STATUS_OLDER": (Cause.NO_LEASE, _TAKEN),
    "STATUS_REVOKED": (Cause.NO_LEASE, "the lease was taken away; begin again"),
    "STATUS_WRONG_EPOCH": (Cause.NO_LEASE, "the robot has restarted since it gave the lease; begin again"),
    "STATUS_RESOURCE_ALREADY_CLAIMED": (Cause.NO_LEASE, _TAKEN),
    "STATUS_INVALID_RESOURCE": (Cause.UNSUPPORTED, "the robot has no lease of the body; update its software"),
    "STATUS_NOT_AUTHORITATIVE_SERVICE": (Cause.UNSUPPORTED, "another service gives the leases; update its software"),
    "STATUS_NOT_ACTIVE_LEASE": (Cause.NO_LEASE, "the lease was gone already"),
    # commands
    "STATUS_INVALID_REQUEST": (Cause.INVALID, "the robot does not allow these values"),
    "STATUS_UNSUPPORTED": (Cause.UNSUPPORTED, "this robot cannot do it; check its arm and its software"),
    "STATUS_NO_TIMESYNC": (Cause.REFUSED, "the robot does not know this clock; it is synchronised again"),
    "STATUS_EXPIRED": (Cause.LATE, "it came too late; check clocks and network"),
    "STATUS_TOO_DISTANT": (Cause.INVALID, "its end is too far ahead; check the clocks"),
    "STATUS_NOT_POWERED_ON": (Cause.UNPOWERED, "the motors are off; begin again with ?power_on=yes"),
    "STATUS_UNKNOWN_FRAME": (Cause.INVALID, "the robot does not know the frame; update its software"),
    "STATUS_BEHAVIOR_FAULT": (Cause.FAULT, "the robot has fallen or has a fault; clear it on the tablet"),
    "STATUS_DOCKED": (Cause.REFUSED, "the robot stands on its dock; undock it first"),
    "STATUS_ERROR_LEASE": (Cause.NO_LEASE, _TAKEN),
    "STATUS_ERROR_DOCK_NOT_FOUND": (Cause.BLOCKED, "the robot does not see this dock; put it before the dock"),
    "STATUS_ERROR_NOT_DOCKED": (Cause.INVALID, "the robot stands on no dock"),
    "STATUS_ERROR_GRIPPER_HOLDING_ITEM": (Cause.BLOCKED, "the gripper holds something; put it down first"),
    "STATUS_ERROR_NOT_AVAILABLE": (Cause.REFUSED, "the robot cannot dock now; let it stand up first"),
    "STATUS_NOT_DETECTED": (Cause.BLOCKED, "the robot sees no handle there; put it straight before the door"),
    "STATUS_DOOR_PLANE_NOT_DETECTED": (Cause.BLOCKED, "the robot sees no door there; put it straight before the door"),
    "STATUS_ROBOT_COMMAND_ERROR": (Cause.REFUSED, "the robot cannot open doors now; let it stand up first"),
    "STATUS_ERROR_SYSTEM": (Cause.FAULT, f"an error within the robot; {_REPORT}"),
    "STATUS_OLD_DOCKING_COMMAND": (Cause.STOPPED, "replaced by another command"),
    **dict.fromkeys(
        ("STATUS_MISALIGNED", "STATUS_ERROR_DOCK_LOST", "STATUS_ERROR_UNREFINED_PRIOR", "STATUS_ERROR_STUCK"),
        (Cause.BLOCKED, "the robot does not get onto its dock, or off it; look what is in its way"),
    ),
    "STATUS_ERROR_COMMAND_TIMED_OUT": (Cause.LATE, "expired before it was done"),
    "STATUS_ERROR_NO_TIMESYNC": (Cause.REFUSED, "the robot does not know this clock; it is synchronised again"),
    "STATUS_ERROR_TOO_DISTANT": (Cause.INVALID, "its end is too far ahead; check the clocks"),
    "STATUS_COMMAND_OVERRIDDEN": (Cause.STOPPED, "replaced by another command"),
    "STATUS_ROBOT_FROZEN": (Cause.STOPPED, "the robot is frozen; unfreeze it on the tablet"),
    "STATUS_INCOMPATIBLE_HARDWARE": (Cause.UNSUPPORTED, "this robot's hardware cannot do it"),
    "STATUS_STALLED": (Cause.BLOCKED, "the arm or the door is stalled; look what is in its way"),
    "PLANNER_STATUS_FAILED": (Cause.BLOCKED, "the robot cannot follow the arm's path"),
    # power
    "STATUS_SHORE_POWER_CONNECTED": (Cause.UNPOWERED, "the charger is connected; unplug it"),
    "STATUS_BATTERY_MISSING": (Cause.UNPOWERED, "the battery is missing; insert it"),
    "STATUS_COMMAND_IN_PROGRESS": (Cause.UNPOWERED, "the motors are being switched already; wait"),
    "STATUS_ESTOPPED": (Cause.ESTOPPED, _ESTOP),
    "STATUS_FAULTED": (Cause.FAULT, "the robot has a fault; clear it on the tablet"),
    "STATUS_INTERNAL_ERROR": (Cause.FAULT, f"an error within the robot; {_REPORT}"),
    "STATUS_LICENSE_ERROR": (Cause.UNSUPPORTED, "the robot's licence does not allow it; renew it"),
    "INCOMPATIBLE_HARDWARE_ERROR": (Cause.UNSUPPORTED, "this robot's hardware cannot do it"),
    "STATUS_OVERRIDDEN": (Cause.STOPPED, "another program has switched the motors"),
    "STATUS_KEEPALIVE_MOTORS_OFF": (Cause.UNPOWERED, "a keepalive policy keeps the motors off; remove it"),
    # E-stop and keepalive
    "ESTOP_LEVEL_UNKNOWN": (Cause.ESTOPPED, "nobody holds an E-stop; release one, on the tablet for example"),
    "ESTOP_LEVEL_CUT": (Cause.ESTOPPED, _ESTOP),
    "ESTOP_LEVEL_SETTLE_THEN_CUT": (Cause.ESTOPPED, _ESTOP),
    "STATUS_ENDPOINT_UNKNOWN": (Cause.ESTOPPED, _REPLACED),
    "STATUS_ENDPOINT_MISMATCH": (Cause.ESTOPPED, _REPLACED),
    "STATUS_CONFIG_MISMATCH": (Cause.ESTOPPED, _REPLACED),
    "STATUS_INVALID_ID": (Cause.ESTOPPED, _REPLACED),
    "STATUS_INVALID_ENDPOINT": (Cause.ESTOPPED, "the robot does not allow this E-stop; update its software"),
    "STATUS_INCORRECT_CHALLENGE_RESPONSE": (Cause.ESTOPPED, _REPLACED),
    "STATUS_MOTORS_ON": (Cause.REFUSED, "the motors are on; switch them off first"),
    "STATUS_INVALID_POLICY_ID": (Cause.REFUSED, "another program has removed the keepalive policy"),
    # clock
    "STATUS_MORE_SAMPLES_NEEDED": (Cause.REFUSED, "the clocks are not synchronised yet; wait"),
    "STATUS_SERVICE_NOT_READY": (Cause.REFUSED, "the robot's clock is not ready; wait until it has started"),
    # sensors
    "STATUS_UNKNOWN_CAMERA": (Cause.UNSUPPORTED, "the robot has no such camera"),
    "STATUS_SOURCE_DATA_ERROR": (Cause.FAULT, "the sensor does not work; look at the robot's faults"),
    "STATUS_IMAGE_DATA_ERROR": (Cause.FAULT, _CAMERA),
    "STATUS_UNSUPPORTED_IMAGE_FORMAT_REQUESTED": (Cause.UNSUPPORTED, "the camera lacks the format; update the robot"),
    "STATUS_UNSUPPORTED_PIXEL_FORMAT_REQUESTED": (Cause.UNSUPPORTED, "the camera lacks the format; update the robot"),
    "STATUS_UNSUPPORTED_RESIZE_RATIO_REQUESTED": (Cause.UNSUPPORTED, "the camera lacks the size; update the robot"),
    "STATUS_CUSTOM_PARAMS_ERROR": (Cause.UNSUPPORTED, "the camera does not take its parameters; update the robot"),
    "STATUS_POINT_CLOUD_DATA_ERROR": (Cause.FAULT, "the LiDAR gives no points; look at the robot's faults"),
    "STATUS_UNKNOWN_SOURCE": (Cause.UNSUPPORTED, "the robot has no such LiDAR"),
    "STATUS_UNSUPPORTED_CLOUD_TYPE": (Cause.UNSUPPORTED, "the LiDAR gives no points; update the robot"),
}
"""Cause of each other status by its name, and a sentence with the fix."""
_SILENT: Final = (Cause.NO_ANSWER, "the robot does not answer; check the network")
_LOGIN: Final = (Cause.REFUSED, "the login does not count any more; begin again")
_OTHER: Final = (Cause.FAULT, f"an error within the robot; {_REPORT}")
CODES: Final[Mapping[grpc.StatusCode, tuple[Cause, str]]] = {
    **dict.fromkeys((grpc.StatusCode.UNAVAILABLE, grpc.StatusCode.DEADLINE_EXCEEDED), _SILENT),
    **dict.fromkeys((grpc.StatusCode.CANCELLED, grpc.StatusCode.ABORTED, grpc.StatusCode.UNKNOWN), _SILENT),
    grpc.StatusCode.RESOURCE_EXHAUSTED: (Cause.NO_ANSWER, "the robot is overloaded; end other programs"),
    **dict.fromkeys((grpc.StatusCode.UNAUTHENTICATED, grpc.StatusCode.PERMISSION_DENIED), _LOGIN),
    grpc.StatusCode.UNIMPLEMENTED: (Cause.UNSUPPORTED, "the robot does not know this call; update its software"),
    grpc.StatusCode.NOT_FOUND: (Cause.UNSUPPORTED, "the robot does not have this"),
    **dict.fromkeys((grpc.StatusCode.INVALID_ARGUMENT, grpc.StatusCode.OUT_OF_RANGE), MEANINGS["CODE_INVALID_REQUEST"]),
    **dict.fromkeys((grpc.StatusCode.FAILED_PRECONDITION, grpc.StatusCode.ALREADY_EXISTS), _OTHER),
    **dict.fromkeys((grpc.StatusCode.INTERNAL, grpc.StatusCode.DATA_LOSS), _OTHER),
}
"""Cause of each gRPC error code, and a sentence with the fix."""


@dataclass(frozen=True)
class Trouble:
    """Cause of a failed response, a text with the status and the fix, and the lease holder."""

    cause: Cause
    text: str
    holder: str = ""


def trouble(statuses: Any, number: int, said: str = "", holder: str = "") -> Trouble | None:
    """Returns the trouble of a status, with the robot's text `said`; None for a success.

    `statuses` describes the enumeration. An unknown status of a newer robot is a refusal.
    """
    value = statuses.values_by_number.get(number)
    if value is not None and value.name in GOOD:
        return None
    name = f"status {number}" if value is None else value.name
    cause, meaning = MEANINGS.get(name, (Cause.REFUSED, "this status is unknown here; update Errand"))
    if cause is Cause.NO_LEASE and holder:
        meaning = f"the lease is held by {holder}; {meaning}"
    return Trouble(cause, f"{meaning} ({': '.join(filter(None, (name, said)))})", holder)


def response_trouble(answer: Any) -> Trouble | None:
    """Returns the trouble of a response: of its header, of the used lease, or of its status."""
    fields = answer.DESCRIPTOR.fields_by_name
    found = None
    if "header" in fields:
        error = answer.header.error
        found = trouble(type(error).Code.DESCRIPTOR, error.code, error.message)
    if found is None and "lease_use_result" in fields and answer.HasField("lease_use_result"):
        used = answer.lease_use_result
        found = trouble(type(used).Status.DESCRIPTOR, used.status, holder=used.owner.client_name)
    if found is None and "status" in fields and (statuses := fields["status"].enum_type) is not None:
        holder = answer.lease_owner.client_name if "lease_owner" in fields else ""
        found = trouble(statuses, answer.status, answer.message if "message" in fields else "", holder)
    return found


def call_trouble(error: Exception) -> Trouble:
    """Returns the trouble of a call that failed."""
    if not isinstance(error, grpc.RpcError):
        return Trouble(Cause.UNSUPPORTED, f"the robot has no service {error}")
    code = error.code()
    cause, meaning = CODES.get(code, _OTHER)
    return Trouble(cause, f"{meaning} ({code.name}: {error.details()})")
