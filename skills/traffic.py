"""Traffic between the robots of one run: where they believe to be, and where they are going.

Nothing here is the simulator's truth. A robot that reports nothing for some seconds is not listed any more, and is only
an obstacle that others see.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Protocol

from skills.robot import FloatArray

__all__ = ["NO_TRAFFIC", "Neighbour", "Traffic"]


@dataclass(frozen=True)
class Neighbour:
    """Another robot: its name, its believed pose (3,) and the poses (N, 3) still before it, all x, y, yaw in the world.

    `path` is None while it stands. `discs` (x, y, radius) cover its outline in the body frame. `first` while it goes
    before us where the two paths meet; `yields` while it clears a path that is reserved against it, because it goes
    after us or has nothing to do. A robot with neither works where it stands, and the others wait for it.
    """

    name: str
    pose: FloatArray
    path: FloatArray | None
    discs: FloatArray
    stamp_s: float
    first: bool = False
    yields: bool = False


class Traffic(Protocol):
    """One robot's view of the others and of who goes first."""

    def claim(self) -> None:
        """Asks for the right to go; the robot that asked first goes first. Keeps a claim that it has already."""

    def announce(self, path: FloatArray, discs: FloatArray) -> None:
        """Reports the poses (N, 3) that lie ahead, and the outline (discs in the body frame) that will follow them.

        With a claim, they are reserved against all robots that claimed later.
        """

    def release(self) -> None:
        """Gives claim and path back. Idempotent."""

    def others(self) -> Sequence[Neighbour]:
        """Returns the other robots that reported lately, by name."""

    def let_pass(self, name: str) -> None:
        """Changes turns with a robot that we should have made way for and cannot."""


class _Alone:
    """Traffic of a robot that is alone."""

    def claim(self) -> None:
        """Does nothing."""

    def announce(self, path: FloatArray, discs: FloatArray) -> None:
        """Does nothing."""

    def release(self) -> None:
        """Does nothing."""

    def others(self) -> Sequence[Neighbour]:
        """Returns an empty list."""
        return ()

    def let_pass(self, name: str) -> None:
        """Does nothing."""


NO_TRAFFIC: Final[Traffic] = _Alone()
