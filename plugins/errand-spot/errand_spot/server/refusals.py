"""Refusals of motion commands with the API's statuses, and the checks of times that several commands share."""

from __future__ import annotations

from collections.abc import Container
from itertools import pairwise
from typing import Any, Final

from bosdyn.api import robot_command_pb2

from errand_spot.messages import InvalidRequestError, seconds

LONGEST_S: Final = 600.0
_Answer = robot_command_pb2.RobotCommandResponse


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
    """Times of a trajectory's points from now on (s), 0 for past ones. Raises RefusedError or InvalidRequestError."""
    offset_s = seconds(trajectory.reference_time) - now_s if trajectory.HasField("reference_time") else 0.0
    times_s = [soon(offset_s + seconds(point.time_since_reference), name) for point in trajectory.points]
    if any(later < earlier for earlier, later in pairwise(times_s)):
        raise InvalidRequestError(f"{name}: the times of its points must increase")
    return times_s
