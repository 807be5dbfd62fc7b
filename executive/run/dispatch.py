"""Who gives robots their missions while a run goes on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

from executive.run.outcome import RobotResult, RobotStatus

if TYPE_CHECKING:
    from executive.run.runner import RunEntry


@dataclass(frozen=True)
class MissionEnd:
    """How one robot's mission ended, and how the robot was last seen (None: never).

    `gone` is why nothing more is asked of this robot in the run: it does not answer, or its lease is another's.
    """

    result: RobotResult
    seen: RobotStatus | None
    gone: str | None = None


class Dispatch(Protocol):
    """Gives out missions. A robot that fails ends its own mission, and the run goes on with the others."""

    def begin(self) -> Sequence[RunEntry]:
        """The missions that begin now, each for a robot that has none. The run ends when there is none, and none is
        under way."""

    def ended(self, end: MissionEnd) -> None:
        """A robot's mission has come to an end."""
