"""Worlds by name, and what is known of them; imports no plant."""

from __future__ import annotations

from executive.mission.errors import InputError, known_names, suggestion
from executive.mission.knowledge import Knowledge, load_knowledge
from plant.worlds.world import World, WorldError, known_worlds, load_world


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


def knowledge_of(world: World) -> Knowledge:
    """What the robot is told of a world. Raises InputError."""
    return load_knowledge(world.knowledge_path)
