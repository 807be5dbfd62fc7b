"""Worlds by name, and what is known of them; imports no plant."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

from executive.words.knowledge import Knowledge, load_knowledge
from plant.worlds.world import WORLDS_FOLDER, World, WorldError, known_worlds, load_world
from skills.files.errors import InputError, known_names, suggestion


def open_world(name: str) -> World:
    """A world by its name or folder. Raises InputError."""
    try:
        return load_world(name)
    except (WorldError, OSError) as error:
        raise _world_error(name, error) from error


def _world_error(name: str, error: Exception) -> InputError:
    """Of a world that is not there its name and what there is; else what its files say."""
    if not isinstance(error, OSError) and not str(error).startswith("unknown world"):
        return InputError(str(error))
    known = f"{known_names(name, known_worlds())}, and folders with a world.dmd.yaml"
    return InputError(f"unknown world '{name[:60]}'", hint=suggestion(name, known_worlds(), known))


def refuse_unusable(world: World) -> None:
    """Raises InputError unless the simulation can use the geometry of a world of the user's, and what is imported."""
    is_ours = world.folder.is_relative_to(WORLDS_FOLDER)
    if is_ours and not world.imports:
        return
    models = tuple(each.folder / f"{name}.sdf" for name, each in world.imports.items())
    _try(None if is_ours else world.directives_path, models)


@cache
def _try(directives: Path | None, models: tuple[Path, ...]) -> None:
    """Lets the simulation read files that are good, once in a process."""
    from plant.diagram import try_geometry

    try_geometry(directives, models)


def with_map(world: World, folder: Path) -> World:
    """The world with the robot's map from a folder, as `errand map build` leaves it. Raises InputError: it has none."""
    chosen = replace(world, maps=folder.resolve())
    for path in (chosen.scan_map_path, chosen.keepout_map_path):
        if not path.is_file():
            hint = "make one by `errand map build`, or let it finish"
            raise InputError(f"there is no map: {path.name} is missing", hint=hint, file=folder)
    return chosen


def knowledge_of(world: World) -> Knowledge:
    """What the robot is told of a world. Raises InputError."""
    return load_knowledge(world.knowledge_path)
