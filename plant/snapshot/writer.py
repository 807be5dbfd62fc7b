"""Writes the plant's state now and then, and brings a plant of the same world back to it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from plant.snapshot.file import Snapshot, SnapshotError, SnapshotFile, encoded

if TYPE_CHECKING:
    from plant.referee.referee import Referee
    from plant.simulation import Engine

PERIOD_S: Final = 1.0
_WORLD: Final = "world: "
_PATH: Final = "path: "
_POINT_VALUES: Final = 4
_POINT_BYTES: Final = 8 * _POINT_VALUES


class SnapshotWriter:
    """Writes a plant's whole state to a file whenever it is called. `facts` tell which world it is.

    It stands in for a world that stays while the executive is away: the mission itself goes on from its journal.
    """

    def __init__(
        self, path: Path, engine: Engine, referee: Referee, facts: Mapping[str, Any], robots: Sequence[str]
    ) -> None:
        self._file, self._engine, self._referee, self._facts = SnapshotFile(path), engine, referee, dict(facts)
        self._paths = {robot: bytearray() for robot in robots}
        self._due_s = 0.0

    def __call__(self) -> None:
        """Write it."""
        self._due_s = self._engine.now() + PERIOD_S
        self._file.write(self.content())

    def when_due(self) -> None:
        """Write it when the last time was a while ago."""
        if self._engine.now() >= self._due_s:
            self()

    def content(self) -> bytes:
        """What is written."""
        world = {_WORLD + name: (array.shape, array.tobytes()) for name, array in self._engine.world_state().items()}
        paths = {_PATH + robot: self._grown(robot) for robot in self._paths}
        values = {"facts": self._facts, "engine": self._engine.state(), "referee": self._referee.state()}
        return encoded(self._file.next_number, values, {**world, **paths})

    def _grown(self, robot: str) -> tuple[tuple[int, int], bytearray]:
        """The path so far; only what was added since the last time is taken over."""
        raw, points = self._paths[robot], self._referee.points(robot)
        if len(points) * _POINT_BYTES < len(raw):
            raw.clear()
        for point in points[len(raw) // _POINT_BYTES :]:
            raw.extend(point.tobytes())
        return (len(points), _POINT_VALUES), raw


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
    paths = {name.removeprefix(_PATH): array for name, array in named if name.startswith(_PATH)}
    try:
        engine.restore(snapshot.values["engine"], world)
        referee.restore(snapshot.values["referee"], paths)
    except (KeyError, TypeError, ValueError) as error:
        told = f"the plant's state was written by another version ({error!r})"
        raise SnapshotError(f"{told}; run the mission again") from error
