"""Writes the plant's state now and then, and brings a plant of the same world back to it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from plant.snapshot.file import Snapshot, SnapshotError, SnapshotFile, encoded

if TYPE_CHECKING:
    from plant.engine import Engine
    from plant.referee.referee import Referee

PERIOD_S: Final = 1.0
_WORLD: Final = "world: "
_POINT_VALUES: Final = 4


class SnapshotWriter:
    """Writes a plant's whole state to a file whenever it is called. `facts` tell which world it is.

    It stands in for a world that stays while the executive is away: the mission itself goes on from its journal.
    """

    def __init__(
        self, path: Path, engine: Engine, referee: Referee, facts: Mapping[str, Any], robots: Sequence[str]
    ) -> None:
        self._file = SnapshotFile(path, width=1 + _POINT_VALUES)
        self._engine, self._referee, self._facts = engine, referee, dict(facts)
        self._robots, self._from = tuple(robots), 0
        self._points = dict.fromkeys(robots, 0)
        self._due_s = 0.0

    @property
    def bytes_written(self) -> int:
        """How many bytes were written so far."""
        return self._file.bytes_written

    def __call__(self) -> None:
        """Write it."""
        self._due_s = self._engine.now() + PERIOD_S
        self._append_points()
        self._file.write(self.content())

    def when_due(self) -> None:
        """Write it when the last time was a while ago."""
        if self._engine.now() >= self._due_s:
            self()

    def content(self) -> bytes:
        """What is written, without the points of the paths."""
        world = {_WORLD + name: (array.shape, array.tobytes()) for name, array in self._engine.world_state().items()}
        paths = {"robots": self._robots, "from": self._from}
        values = {"facts": self._facts, "engine": self._engine.state(), "referee": self._referee.state()}
        return encoded(self._file.next_number, {**values, "paths": paths}, world, self._file.rows)

    def _append_points(self) -> None:
        """Append what the paths have grown by; paths that began again are written as a whole after the old ones."""
        if any(len(self._referee.points(robot)) < count for robot, count in self._points.items()):
            self._from = self._file.rows.count
            self._points = dict.fromkeys(self._robots, 0)
        for number, robot in enumerate(self._robots):
            grown = self._referee.points(robot)[self._points[robot] :]
            if grown:
                points = np.array(grown, dtype=np.float64)
                self._file.append(np.column_stack([np.full(len(points), float(number)), points]))
                self._points[robot] += len(points)


def restore(snapshot: Snapshot, engine: Engine, referee: Referee, facts: Mapping[str, Any]) -> None:
    """Bring a plant to a snapshot's state; all of `facts` must be as they were.

    Raises:
        SnapshotError: the snapshot is one of another world, of other robots or of another version of the plant.
    """
    kept = snapshot.values["facts"]
    differing = ", ".join(key for key in facts if kept.get(key) != facts[key])
    if differing:
        raise SnapshotError(f"the plant's state is that of another simulation ({differing}); run the mission again")
    named = snapshot.arrays.items()
    world = {name.removeprefix(_WORLD): array for name, array in named if name.startswith(_WORLD)}
    try:
        told = snapshot.values["paths"]
        rows = snapshot.rows[told["from"] :]
        paths = {robot: rows[rows[:, 0] == number, 1:] for number, robot in enumerate(told["robots"])}
        engine.go_on(snapshot.values["engine"], world)
        referee.go_on(snapshot.values["referee"], paths)
    except (KeyError, TypeError, ValueError) as error:
        what = f"the plant's state was written by another version ({error!r})"
        raise SnapshotError(f"{what}; run the mission again") from error
