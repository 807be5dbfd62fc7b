"""What robots of one run tell each other about their paths: where they believe to be, and where they are going.

Nothing here is the simulator's truth. A robot that says nothing for some seconds is not there any more for this, and
only an obstacle that others see.
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

    `path` is None while it goes nowhere. `discs` (x, y, radius) cover its outline in the body frame. `first` while it
    goes before us where the paths of both meet; `yields` while it clears a path that is reserved against it, since it
    drives and goes after us, or has nothing to do. One that is neither works where it stands, and is waited for.
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
        """Asks for the right to go, from now on; whoever asked first goes first. One that is held already is kept."""

    def announce(self, path: FloatArray, discs: FloatArray) -> None:
        """Tells the poses (N, 3) that lie ahead, and the outline (discs in the body frame) for which they are meant.

        With a claim, they are reserved against all who claimed later.
        """

    def release(self) -> None:
        """Gives claim and path back. Idempotent."""

    def others(self) -> Sequence[Neighbour]:
        """The other robots that were heard of lately, by name."""

    def let_pass(self, name: str) -> None:
        """Changes turns with a robot that we should have made way for and cannot."""


class _Alone:
    """A robot that is alone."""

    def claim(self) -> None:
        """Nothing."""

    def announce(self, path: FloatArray, discs: FloatArray) -> None:
        """Nothing."""

    def release(self) -> None:
        """Nothing."""

    def others(self) -> Sequence[Neighbour]:
        """Nobody."""
        return ()

    def let_pass(self, name: str) -> None:
        """Nothing."""


NO_TRAFFIC: Final[Traffic] = _Alone()
