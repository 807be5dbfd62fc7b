"""Routes that were planned before, kept in the user's cache: loading the planner takes a second."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterable
from contextlib import suppress
from functools import cached_property
from pathlib import Path
from typing import Final

from executive.tree.estimate import Route, RoutePlanner
from plant.worlds.world import World
from skills.robot import Pose2D
from skills.stack import DEFAULT_FILE

__all__ = ["RouteCache", "route_cache_of"]

_SKILLS: Final = DEFAULT_FILE.parent


class RouteCache(RoutePlanner):
    """Routes kept in a file. It plans those that the file does not have, and adds them for later processes."""

    def __init__(self, file: Path, planned: RoutePlanner) -> None:
        self._file, self._planned = file, planned

    @cached_property
    def _routes(self) -> dict[str, list[float] | str]:
        """By start and goal: length and progress of a route, or why there is none."""
        with suppress(OSError, ValueError):
            routes: dict[str, list[float] | str] = json.loads(self._file.read_text(encoding="utf-8"))
            return routes
        return {}

    def route(self, start: Pose2D, goal: Pose2D) -> Route:
        """The route from start to goal. Raises ValueError with one sentence when there is none."""
        name = f"{start} {goal}"
        if name not in self._routes:
            self._routes[name] = self._new(start, goal)
            with suppress(OSError):
                self._write()
        known = self._routes[name]
        if isinstance(known, str):
            raise ValueError(known)
        return Route(*known)

    def _new(self, start: Pose2D, goal: Pose2D) -> list[float] | str:
        try:
            route = self._planned.route(start, goal)
        except ValueError as error:
            return str(error)
        return [route.length_m, route.progress_m]

    def _write(self) -> None:
        """Write the file; another process sees the old one or the new one."""
        self._file.parent.mkdir(parents=True, exist_ok=True)
        draft = self._file.with_suffix(f".{os.getpid()}")
        draft.write_text(json.dumps(self._routes), encoding="utf-8")
        draft.replace(self._file)


def route_cache_of(world: World, planned: RoutePlanner, *robot_files: Path) -> RouteCache:
    """The routes kept for a world. They are planned again once its maps, the planner or the robot's files change."""
    planner = (DEFAULT_FILE, *_SKILLS.glob("navigate/*.py"), *_SKILLS.glob("estimate/*.py"), *_SKILLS.glob("*.py"))
    digest = _digest((*world.keepout_map_path.parent.glob("*"), *planner, *robot_files))
    home = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    return RouteCache(home / "errand" / "routes" / f"{digest}.json", planned)


def _digest(files: Iterable[Path]) -> str:
    """A digest of files' names and contents."""
    told = hashlib.sha256()
    for file in sorted(path for path in files if path.is_file()):
        told.update(file.name.encode() + hashlib.sha256(file.read_bytes()).digest())
    return told.hexdigest()[:24]
