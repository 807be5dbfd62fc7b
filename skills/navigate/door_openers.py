"""Door openers: the robot's arm, an HTTP call, and the calls of door plug-ins during a run."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Final, Literal

from skills.api import Job, SkillContext
from skills.doorway import DoorOpener, Doorway
from skills.geometry import relative_pose
from skills.inputs.schema import matching
from skills.quantities import Angle, Coordinate, Duration, Height
from skills.robot import DoorHandle, Pose2D

_LATENCY_S: Final = 0.5
Url = Annotated[
    str, matching(r"https?://[^\s/]+\S*", "should be the address of an HTTP call", "write http://HOST/PATH")
]
Method = Literal["GET", "POST", "PUT", "PATCH"]


@dataclass(frozen=True)
class ArmDoor:
    """Door with a handle at (x, y, height) in the world (m); the door swings open in a direction (rad)."""

    handle: tuple[Coordinate, Coordinate, Height]
    swings: Angle

    def open(self, door_name: str, between: tuple[str, str]) -> None:
        """Raises RuntimeError: only the skill open_door may use the robot's arm."""
        raise RuntimeError("the robot opens it with its arm, in the step 'open'")

    def handle_from(self, body: Pose2D, body_m: float, middle_W: tuple[float, float]) -> DoorHandle:
        """The handle in the frame of a body `body_m` above the floor; `middle_W` is the doorway's centre."""
        x, y, height_m = self.handle
        off = relative_pose(body, Pose2D(x, y, 0.0))
        before = (body.x_m - middle_W[0], body.y_m - middle_W[1])
        pull = before[0] * math.cos(self.swings) + before[1] * math.sin(self.swings) > 0.0
        to_right = before[0] * (y - middle_W[1]) - before[1] * (x - middle_W[0]) > 0.0
        return DoorHandle((off.x_m, off.y_m, height_m - body_m), to_right, pull)


@dataclass(frozen=True)
class HttpDoor:
    """Door that opens by one HTTP call; a status from 200 to 299 within `timeout_s` counts as success."""

    url: Url
    method: Method = "POST"
    timeout_s: Duration = 5.0

    def open(self, door_name: str, between: tuple[str, str]) -> None:
        """Calls the address. Raises RuntimeError when there is no response or its status is not 2xx."""
        from urllib.error import HTTPError  # skills load this module, and few of them call anybody
        from urllib.request import Request, urlopen

        request = Request(self.url, b"" if self.method != "GET" else None, method=self.method)
        try:
            with urlopen(request, timeout=self.timeout_s):
                pass
        except HTTPError as error:
            raise RuntimeError(f"{self.url} answered {error.code} {error.reason}") from error
        except TimeoutError as error:
            raise RuntimeError(f"{self.url} did not answer within {self.timeout_s:g} s") from error
        except (OSError, ValueError) as error:
            raise RuntimeError(f"{self.url} cannot be reached: {getattr(error, 'reason', error)}") from error


class DoorCalls:
    """Calls the plug-in of each closed door once; a door may take `opens_s` from the response to open."""

    def __init__(self, context: SkillContext, opens_s: float) -> None:
        self._context, self._opens_s = context, opens_s
        self._calls: dict[Doorway, Job[str | None]] = {}
        self._until_s: dict[Doorway, float] = {}

    def may_open(self, doors: Sequence[Doorway]) -> bool:
        """Calls the plug-in of each of `doors` once; returns whether one of these doors may still open."""
        for door in doors:
            if door.opener is not None and door not in self._calls:
                self._calls[door] = self._call(door, door.opener)
        open_yet = [self._may_open(door) for door in doors if door in self._calls]
        return any(open_yet)

    def reasons(self, doors: Sequence[Doorway]) -> str:
        """Sentences that say why those of `doors` whose plug-in was called stay closed; empty when none was called."""
        return " ".join(self._reason(door, call) for door, call in self._calls.items() if door in doors)

    def _call(self, door: Doorway, opener: DoorOpener) -> Job[str | None]:
        def call() -> str | None:
            try:
                opener.open(_name(door), door.between)
            except Exception as error:
                return str(error) or type(error).__name__
            return None

        return self._context.worker.submit(call, latency_s=_LATENCY_S, name="open a door")

    def _may_open(self, door: Doorway) -> bool:
        call = self._calls[door]
        if not call.done():
            return True
        end_s = self._context.clock.now() + self._opens_s if call.result() is None else -math.inf
        return self._context.clock.now() < self._until_s.setdefault(door, end_s)

    def _reason(self, door: Doorway, call: Job[str | None]) -> str:
        failure = call.result() if call.done() else "there is no answer yet"
        if failure is None:
            return f"The {_name(door)} was called, and did not open within {self._opens_s:g} s."
        return f"The call of the {_name(door)} failed: {failure}."


def _name(door: Doorway) -> str:
    return f"door between {door.between[0]} and {door.between[1]}"
