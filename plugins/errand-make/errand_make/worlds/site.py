"""World in a user's folder, to be changed by additions and zones."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import shapely

from errand_make.worlds.rooms import Grid, grid_of
from executive.app.prepare.worlds import knowledge_of, open_world
from executive.words.knowledge import Knowledge
from plant.worlds.world import World, WorldError
from skills.grid_map import load_grid_map
from skills.inputs.errors import InputError, suggestion
from skills.robot import Pose2D


def contains(polygon: Sequence[tuple[float, float]], point: tuple[float, float]) -> bool:
    """Returns whether (x, y) lies within an outline."""
    return bool(shapely.contains_xy(shapely.Polygon(polygon), *point))


@dataclass(frozen=True)
class Site:
    """World that gets an addition, with its folder."""

    folder: Path
    world: World

    @classmethod
    def open(cls, folder: Path) -> Site:
        """Opens the world of a folder. Raises InputError."""
        if not folder.is_dir():
            raise InputError("there is no such folder", hint="`errand world from-map` makes a world", file=folder)
        return cls(folder, open_world(str(folder)))

    @cached_property
    def facts(self) -> Knowledge:
        """Knowledge of the world."""
        return knowledge_of(self.world)

    @property
    def doors(self) -> list[tuple[float, float]]:
        """Middles of the doors, m."""
        return [door.at for door in self.facts.doors]

    def grid(self, name: str = "keepout") -> Grid:
        """Reads a grid of the robot's map."""
        return grid_of(load_grid_map(self.folder / "map" / f"{name}.yaml"))

    def room(self, said: str | None) -> str:
        """Returns the room of a name; without one, the room of the start. Raises InputError."""
        rooms, start = self.facts.rooms, (self.world.start.x_m, self.world.start.y_m)
        if said is None:
            return self.room_at(start) or next(iter(rooms), "")
        if (found := self.facts.place(said)) in rooms:
            return str(found)
        raise InputError(f"there is no room '{said}'", hint=suggestion(said, rooms), file=self.folder)

    def room_at(self, point: tuple[float, float]) -> str:
        """Returns the room around a point, or an empty name."""
        return next((name for name, outline in self.facts.rooms.items() if contains(outline, point)), "")

    @property
    def room_poses(self) -> dict[str, Pose2D]:
        """Pose of the robot in each room, and the named poses."""
        return {name: place.pose.pose_2d() for name, place in self.facts.places.items()}


@contextmanager
def restored(folder: Path) -> Iterator[None]:
    """Restores the text files of a world if the block raises, or leaves a world that cannot be opened."""
    kept = {file: file.read_bytes() for pattern in ("*.yaml", "map/*") for file in folder.glob(pattern)}
    try:
        yield
        knowledge_of(open_world(str(folder)))
    except BaseException as error:
        for file in {*folder.glob("*.yaml")} - kept.keys():
            file.unlink()
        for file, data in kept.items():
            file.write_bytes(data)
        if isinstance(error, WorldError):
            raise InputError(str(error), hint="see `errand world show`", file=folder) from error
        raise
