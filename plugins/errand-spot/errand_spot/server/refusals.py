"""Refusals of commands with the API's statuses, and the checks of values and times that all commands share."""

from __future__ import annotations

import math
from collections.abc import Container, Mapping
from typing import Any, Final

from bosdyn.api import robot_command_pb2
from google.protobuf.message import Message

from errand_spot.messages import InvalidRequestError, seconds

LONGEST_S: Final = 86400.0
"""Farthest time ahead that a command may name."""
_Answer = robot_command_pb2.RobotCommandResponse
_MOST, _LEAST, _YEARS_S, _SLACK = 1e7, 1e-3, 3.15576e11, 1e-6
"""Largest value of a number, least value of a limit, longest duration of a message, and tolerance of ranges."""
RANGES: Final[Mapping[str, tuple[float, float]]] = {
    "ImageRequest.quality_percent": (0.0, 100.0),
    "FanPowerCommandRequest.percent_power": (0.0, 100.0),
    "CylindricalCoordinate.r": (-1.0, 1.0),
    "CylindricalCoordinate.theta": (-1.0, 1.0),
    "CylindricalCoordinate.z": (-1.0, 1.0),
    "CylindricalVelocity.max_linear_velocity": (0.0, _MOST),
    "ObstacleParams.obstacle_avoidance_padding": (0.0, 10.0),
    "RotationWithTolerance.threshold_radians": (0.0, math.pi),
    "VectorAlignmentWithTolerance.threshold_radians": (0.0, math.pi),
    "WalkToObjectInImage.offset_distance": (0.6, 10.0),
    "WalkToObjectRayInWorld.offset_distance": (0.6, 10.0),
    "Stance.accuracy": (0.02, 0.1),
}
"""Ranges of fields by message and name. A limit (`max...`) is positive, and each other number at most 1e7."""


class RefusedError(Exception):
    """Error of a refused command, with a status of the API and the reason."""

    def __init__(self, status: int, message: str) -> None:
        self.status = status
        super().__init__(message)


def unsupported(command: str) -> RefusedError:
    """Returns the error of a command that the simulated robot cannot do."""
    return RefusedError(_Answer.STATUS_UNSUPPORTED, f"{command} is not simulated")


def known_frame(name: str, frames: Container[str]) -> str:
    """Returns a frame's name. Raises RefusedError for one that the robot does not know, or does not allow here."""
    if name not in frames:
        raise RefusedError(_Answer.STATUS_UNKNOWN_FRAME, f"frame {name!r} is unknown")
    return name


def end_of(message: Any, now_s: float, name: str) -> float:
    """Returns a command's end time (robot time). Raises RefusedError or InvalidRequestError."""
    if not message.HasField("end_time"):
        raise InvalidRequestError(f"{name}: end_time is missing")
    end_s = seconds(message.end_time)
    if end_s <= now_s:
        raise RefusedError(_Answer.STATUS_EXPIRED, f"{name}: end_time was {now_s - end_s:.2f} s ago")
    return now_s + soon(end_s - now_s, f"{name}: end_time")


def soon(ahead_s: float, name: str) -> float:
    """Returns the duration until a time (s), 0 for a past one. Raises RefusedError for one too far ahead."""
    if ahead_s > LONGEST_S:
        said = f"{name} is {ahead_s:.0f} s ahead; at most {LONGEST_S:.0f} s are allowed"
        raise RefusedError(_Answer.STATUS_TOO_DISTANT, said)
    return max(0.0, ahead_s)


def times_of(trajectory: Any, now_s: float, name: str) -> list[float]:
    """Times of a trajectory's points from now on (s), 0 for past ones. Raises RefusedError."""
    offset_s = seconds(trajectory.reference_time) - now_s if trajectory.HasField("reference_time") else 0.0
    return [soon(offset_s + seconds(point.time_since_reference), name) for point in trajectory.points]


def check_values(message: Message, field: str = "request") -> None:
    """Raises InvalidRequestError for a value that the API does not allow, in any part of a message.

    That is a number out of its range, a rotation of zeros, an option that the API lacks, or a path against time.
    """
    given = message.ListFields()
    if message.DESCRIPTOR.name == "Quaternion" and not given:
        raise InvalidRequestError(f"{field} is zero; a rotation has at least one value that is not")
    for described, value in given:
        name = f"{field}.{described.name}"
        if isinstance(value, Message | str | bytes | int | float):
            _check(described, value, name)
            continue
        for key, each in value.items() if isinstance(value, Mapping) else enumerate(value):
            _check(described, each, f"{name}[{key}]")
        if described.name == "points" and hasattr(value[0], "time_since_reference"):
            least_s = -math.inf if message.HasField("reference_time") else 0.0  # before that time a point may be past
            for k, at_s in enumerate(seconds(each.time_since_reference) for each in value):
                if at_s < least_s:
                    said = f"{name}[{k}].time_since_reference is {at_s:g} s; it must be at least {least_s:g} s"
                    raise InvalidRequestError(said)
                least_s = at_s


def _check(described: Any, value: Any, name: str) -> None:
    """Checks one value of a field: a message, an option or a number."""
    kind = described.message_type.full_name if described.message_type is not None else ""
    low, high = _LEAST if described.name.startswith("max") else -_MOST, _MOST
    if kind == "google.protobuf.Duration":
        value, low, high = seconds(value), 0.0 if described.name != "time_since_reference" else -_YEARS_S, _YEARS_S
    elif kind.startswith("google.protobuf.") and hasattr(value, "value"):
        value = value.value
    elif isinstance(value, Message):
        check_values(value, name)
    elif described.enum_type is not None and value not in described.enum_type.values_by_number:
        raise InvalidRequestError(f"{name}: the API has no option {value}")
    key = f"{described.containing_type.name}.{described.name}"
    low, high = RANGES.get(key, (low, high))
    if (isinstance(value, float) or key in RANGES) and not low - _SLACK <= value <= high + _SLACK:
        raise InvalidRequestError(f"{name} is {value:g}; it must be {low:g} to {high:g}")
