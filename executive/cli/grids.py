"""Grid maps of worlds, read with the errors that users see."""

from __future__ import annotations

from pathlib import Path

from skills.estimate.grid_map import GridMap, MapError, load_grid_map
from skills.files.errors import InputError

__all__ = ["grid_at"]


def grid_at(path: Path) -> GridMap:
    """The grid map of a file. Raises InputError: it is none, or is not there."""
    try:
        return load_grid_map(path)
    except (MapError, OSError) as error:
        raise InputError(str(error)) from error
