"""Last known places of a mission's objects: where they were seen, let go or dropped."""

from __future__ import annotations

import enum
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Final

from executive.tree.node import NodeSpec
from skills.api import ObjectKind, ObjectObservation
from skills.quantities import Coordinate, Height
from skills.robot import Pose2D


class Sign(enum.Enum):
    """Event after which an object is known to be somewhere."""

    SEEN = "was seen"
    RELEASED = "was let go"
    DROPPED = "fell"


_PORTS: Final[Mapping[str, Sign]] = {"observation": Sign.SEEN, "released_W": Sign.RELEASED}


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
    """Follows the blackboard of a mission; `last` is the object that was seen, let go or dropped last."""

    def __init__(self, root: NodeSpec) -> None:
        self._keys = dict(_keys(root))
        self._values: Mapping[str, Any] | None = None
        self._kind: ObjectKind | None = None
        self.last: LastKnown | None = None

    def note(self, board: Mapping[str, Any], pose: Pose2D | None) -> None:
        """Takes the values of the blackboard; those of the first call are of earlier missions."""
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


def _keys(root: NodeSpec) -> Iterator[tuple[str, Sign]]:
    """Yields the blackboard keys of a tree that show where an object is."""
    for node in root.walk():
        if node.kind == "fallen":
            yield node.options["spot_key"], Sign.DROPPED
        elif node.kind == "skill" and node.options["skill"].name != "find_people":
            outputs = node.options["outputs"]
            yield from ((outputs[port], sign) for port, sign in _PORTS.items() if port in outputs)
