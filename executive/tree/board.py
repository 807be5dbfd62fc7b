"""The blackboard of one run: immutable values under keys that begin with the robot's name."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Protocol

from skills.api import ObjectObservation, Surface
from skills.geometry import compose
from skills.robot import Pose2D


class Board:
    """A blackboard for one robot in one run. Keys read `alice/fetch-drink/start`; values are immutable."""

    def __init__(self, prefix: str) -> None:
        self._prefix = f"{prefix}/"
        self._values: dict[str, Any] = {}
        self._copy: Mapping[str, Any] | None = None

    def put(self, key: str, value: Any) -> None:
        """Stores a value. Raises ValueError for a key with a dot or without the robot's name in front."""
        if "." in key or not key.startswith(self._prefix):
            raise ValueError(f"blackboard key '{key}': must begin with '{self._prefix}' and hold no dot")
        self._values[key] = value
        self._copy = None

    def get(self, key: str) -> Any:
        """The value under `key`. Raises KeyError with a plain sentence when nothing wrote it yet."""
        if key not in self._values:
            raise KeyError(f"nothing was written to the blackboard under '{key}' yet")
        return self._values[key]

    def forget(self, keys: Iterable[str]) -> None:
        """Takes values off the board, so that nothing leaks into another attempt; unknown keys are let pass."""
        for key in keys:
            self._values.pop(key, None)
        self._copy = None

    def __contains__(self, key: str) -> bool:
        return key in self._values

    def values(self) -> Mapping[str, Any]:
        """A copy of all values, the same one until they change."""
        if self._copy is None:
            self._copy = dict(self._values)
        return self._copy


class Binding(Protocol):
    """Where an input port gets its value from."""

    def read(self, board: Board) -> Any:
        """The value now. Raises KeyError when it is not there yet."""


@dataclass(frozen=True)
class Constant:
    """A port bound to a fixed value."""

    value: Any

    def read(self, board: Board) -> Any:
        """The fixed value."""
        return self.value


@dataclass(frozen=True)
class FromBoard:
    """A port bound to a blackboard key. `gives` is the type of what is made of the value; None: it stays as it is."""

    gives: ClassVar[Any] = None
    key: str

    def read(self, board: Board) -> Any:
        """The value under the key. Raises KeyError when nothing wrote it yet."""
        return board.get(self.key)


@dataclass(frozen=True)
class FromBoardOr(FromBoard):
    """A port bound to a blackboard key, with a value for as long as nothing wrote it."""

    default: Any

    def read(self, board: Board) -> Any:
        """The value under the key, else the default."""
        return board.get(self.key) if self.key in board else self.default


@dataclass(frozen=True)
class BesideBoard(FromBoard):
    """A port bound to a pose a little beside the one under a blackboard key, in metres along that pose's axes."""

    gives: ClassVar[Any] = Pose2D
    forward_m: float
    left_m: float

    def read(self, board: Board) -> Pose2D:
        """The shifted pose. Raises KeyError when nothing wrote it yet."""
        return pose_beside(board.get(self.key), self.forward_m, self.left_m)


@dataclass(frozen=True)
class SurfaceOfDetection(FromBoard):
    """A port bound to the surface on which the object under a blackboard key was seen; to all, when that is unknown."""

    gives: ClassVar[Any] = tuple[Surface, ...]
    surfaces: tuple[Surface, ...]

    def read(self, board: Board) -> tuple[Surface, ...]:
        """The surfaces. Raises KeyError when nothing was seen yet."""
        seen: ObjectObservation = board.get(self.key)
        return tuple(surface for surface in self.surfaces if surface.name == seen.surface) or self.surfaces


def pose_beside(pose: Pose2D, forward_m: float, left_m: float) -> Pose2D:
    """The pose shifted along its own axes, turned the same way."""
    return compose(pose, Pose2D(forward_m, left_m, 0.0))
