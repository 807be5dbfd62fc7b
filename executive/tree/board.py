"""Blackboard of one run, in which each key begins with the robot's name; tracks the last known places of objects."""

import enum
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Protocol

from executive.tree.node import NodeSpec
from skills.api import ObjectKind, ObjectObservation, Surface
from skills.geometry import compose
from skills.quantities import Coordinate, Height
from skills.robot import Pose2D


class Board:
    """Blackboard of one robot in one run. Keys look like `alice/fetch-drink/start`; values are immutable."""

    def __init__(self, prefix: str) -> None:
        self._prefix = f"{prefix}/"
        self._values: dict[str, Any] = {}
        self._copy: Mapping[str, Any] | None = None

    def put(self, key: str, value: Any) -> None:
        """Stores a value. Raises ValueError for a key that has a dot, or does not begin with the robot's name."""
        if "." in key or not key.startswith(self._prefix):
            raise ValueError(f"blackboard key '{key}': must begin with '{self._prefix}' and hold no dot")
        self._values[key] = value
        self._copy = None

    def get(self, key: str, *default: Any) -> Any:
        """Returns the value under `key`, else the default. Raises KeyError with a sentence when there is neither."""
        if key not in self._values and not default:
            raise KeyError(f"nothing was written to the blackboard under '{key}' yet")
        return self._values.get(key, *default)

    def forget(self, keys: Iterable[str]) -> None:
        """Removes values, so that another attempt begins without them; ignores keys without a value."""
        for key in keys:
            self._values.pop(key, None)
        self._copy = None

    def __contains__(self, key: str) -> bool:
        return key in self._values

    def values(self) -> Mapping[str, Any]:
        """Returns a copy of all values; returns the same copy again until a value changes."""
        if self._copy is None:
            self._copy = dict(self._values)
        return self._copy


class Binding(Protocol):
    """Source from which an input port reads its value."""

    def read(self, board: Board) -> Any:
        """Returns the present value. Raises KeyError when nothing was written yet."""


@dataclass(frozen=True)
class Constant:
    """Binding of a port to a fixed value."""

    value: Any

    def read(self, board: Board) -> Any:
        """Returns the fixed value."""
        return self.value


@dataclass(frozen=True)
class FromBoard:
    """Binding of a port to a blackboard key. `gives` is the type of the value that the port gets (None: as stored)."""

    gives: ClassVar[Any] = None
    key: str

    def read(self, board: Board) -> Any:
        """Returns the value under the key. Raises KeyError when nothing was written there yet."""
        return board.get(self.key)


@dataclass(frozen=True)
class FromBoardOr(FromBoard):
    """Binding of a port to a blackboard key, with a default for as long as nothing is written there."""

    default: Any

    def read(self, board: Board) -> Any:
        """Returns the value under the key, or the default when nothing was written there."""
        return board.get(self.key, self.default)


@dataclass(frozen=True)
class BesideBoard(FromBoard):
    """Binding of a port to a pose beside the pose under a blackboard key, shifted along that pose's axes (m)."""

    gives: ClassVar[Any] = Pose2D
    forward_m: float
    left_m: float

    def read(self, board: Board) -> Pose2D:
        """Returns the shifted pose. Raises KeyError when no pose was written yet."""
        return compose(board.get(self.key), Pose2D(self.forward_m, self.left_m, 0.0))


@dataclass(frozen=True)
class SurfaceOfDetection(FromBoard):
    """Binding of a port to the surface below a detected object; to all surfaces if that surface is unknown."""

    gives: ClassVar[Any] = tuple[Surface, ...]
    surfaces: tuple[Surface, ...]

    def read(self, board: Board) -> tuple[Surface, ...]:
        """Returns the surfaces. Raises KeyError when no object was detected yet."""
        seen: ObjectObservation = board.get(self.key)
        return tuple(surface for surface in self.surfaces if surface.name == seen.surface) or self.surfaces


class Sign(enum.Enum):
    """Event from which the place of an object is known."""

    SEEN = "was seen"
    RELEASED = "was let go"
    DROPPED = "fell"


@dataclass(frozen=True)
class LastKnown:
    """Last known place of an object, in the world frame (m).

    The robot stood at `robot_W` (None: not known). `surface` is the name of the surface on which the object was seen
    (None: not known).
    """

    kind: ObjectKind
    sign: Sign
    position_W: tuple[Coordinate, Coordinate, Height]
    robot_W: Pose2D | None = None
    surface: str | None = None

    def __str__(self) -> str:
        x, y, _ = self.position_W
        where = "" if self.surface is None else f"on the {self.surface} "
        return f"the {self.kind} {self.sign.value} {where}at ({x:.2f}, {y:.2f}) m"


class LastKnownTracker:
    """Tracks on a mission's blackboard which object was seen, released or dropped last, and where (`last`)."""

    def __init__(self, root: NodeSpec) -> None:
        signs = (node.behaviour.signs(node.options) for node in root.walk())
        self._keys: Mapping[str, Sign] = {key: sign for each in signs for key, sign in each.items()}
        self._values: Mapping[str, Any] | None = None
        self._kind: ObjectKind | None = None
        self.last: LastKnown | None = None

    def note(self, board: Mapping[str, Any], pose: Pose2D | None) -> None:
        """Reads the changed values on the blackboard; the values at the first call belong to earlier missions."""
        now = {key: board[key] for key in self._keys if key in board}
        before, self._values = self._values, now
        changed = {} if before is None else {key: each for key, each in now.items() if each is not before.get(key)}
        for key, value in changed.items():
            seen = value if isinstance(value, ObjectObservation) else None
            self._kind = self._kind if seen is None else seen.kind
            guess = self._keys[key] is Sign.DROPPED and self.last is not None and self.last.sign is Sign.RELEASED
            if self._kind is not None and not guess:
                surface = None if seen is None else seen.surface
                self.last = LastKnown(self._kind, self._keys[key], seen.position_W if seen else value, pose, surface)
