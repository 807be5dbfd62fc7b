"""Opens worlds and their knowledge by name; loads nothing of the simulation."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from executive.words.knowledge import Knowledge, load_knowledge, spoken_forms
from plant.worlds.world import WORLDS_FOLDER, UnknownWorldError, World, WorldError, known_worlds, load_world
from skills.inputs.errors import InputError, Problems, known_names, suggestion
from skills.inputs.yaml_source import KeyPath, read_yaml
from skills.robot import FloatArray, Pose2D

if TYPE_CHECKING:
    from skills.grid_map import GridMap


def open_world(name: str) -> World:
    """Opens a world by its name or folder. Raises InputError."""
    try:
        return load_world(name)
    except (UnknownWorldError, OSError) as error:
        known = f"{known_names(name, known_worlds())}, and folders with a world.dmd.yaml"
        raise InputError(f"unknown world '{name[:60]}'", hint=suggestion(name, known_worlds(), known)) from error
    except WorldError as error:
        raise InputError(str(error)) from error


def refuse_unusable(world: World, seed: int = 0) -> None:
    """Raises InputError unless a world, its maps and imported models can be loaded, and each person stands free.

    A world of the project is tried only with models and people that it does not have itself. People who stand before
    the robot's start are not tried with a start that the world does not have.
    """
    is_ours = world.folder.is_relative_to(WORLDS_FOLDER)
    if not is_ours or world.maps is not None:
        from skills.grid_map import load_grid_map

        for path in {*world.scan_map_paths, *([world.scan_map_path] if world.keepout_map_path.is_file() else ())}:
            load_grid_map(path)
    people = [rule for rule in world.seed_rules.people if rule.ranges is None or not is_ours]
    if is_ours and not world.imports and not people:
        return
    models = tuple(each.folder / f"{name}.sdf" for name, each in world.imports.items())
    tried = world.directives_path if people or not is_ours else None
    scenery = _try(tried, models, 0 if tried is None else tried.stat().st_mtime_ns)
    if people:
        _refuse_overlaps(world, seed, scenery)


@cache
def _try(directives: Path | None, models: tuple[Path, ...], _changed_ns: int) -> tuple[tuple[str, FloatArray], ...]:
    """Loads the files in the simulation to test them; files that passed are not tested again in this process."""
    from plant.diagram import try_geometry

    return try_geometry(directives, models)


def _refuse_overlaps(world: World, seed: int, scenery: Sequence[tuple[str, FloatArray]]) -> None:
    """Raises InputError with all people who would stand inside something else."""
    from plant.worlds.seeding import overlaps, place_objects

    own, rules, problems = load_world(world.folder), world.seed_rules, Problems()
    people = tuple(rule for rule in rules.people if rule.ranges is None or world.start == own.start)
    tried = replace(world, seed_rules=rules.model_copy(update={"people": people}))
    for rule, what in overlaps(tried, place_objects(world, seed), scenery):
        if rule in own.seed_rules.people:
            path, source = ("people", own.seed_rules.people.index(rule)), read_yaml(world.folder / "objects.yaml")
            problems.add(source.error(path, what, "say by `pose: {x: .., y: .., yaw: ..}` where the person stands"))
        else:
            problems.add(InputError(what, hint="choose another first waypoint"))
    problems.raise_any()


def with_map(world: World, folder: Path) -> World:
    """Gives the world the map in a folder of `errand map build`. Raises InputError if the folder has no map."""
    chosen = replace(world, maps=folder.resolve())
    for path in (chosen.scan_map_path, chosen.keepout_map_path):
        if not path.is_file():
            hint = "make one by `errand map build`, or let it finish"
            raise InputError(f"there is no map: {path.name} is missing", hint=hint, file=folder)
    return chosen


def knowledge_of(world: World) -> Knowledge:
    """Loads the knowledge of a world and of its imported objects. Raises InputError."""
    knowledge = load_knowledge(world.knowledge_path, tuple(world.own_objects))
    if knowledge.poses:
        ground, error = free_ground(world), read_yaml(world.knowledge_path).error
        refuse_blocked_poses(knowledge, error, lambda at: ground.distance_m(np.array([[at.x_m, at.y_m]]))[0])
    return knowledge


def crossing_rooms(world: World, knowledge: Knowledge) -> tuple[InputError, ...]:
    """Warnings on rooms whose outlines cross themselves, so that it is open what lies inside."""
    from shapely import Polygon

    places = [("places", name, "polygon") for name, corners in knowledge.rooms.items() if not Polygon(corners).is_valid]
    source, hint = read_yaml(world.knowledge_path) if places else None, "give the corners in order around the room"
    return tuple(source.error(at, f"{'.'.join(at)}: the outline crosses itself", hint) for at in places if source)


def unsayable_names(world: World, knowledge: Knowledge) -> tuple[InputError, ...]:
    """Warnings on names of a user's world that no sentence can say, such as "please", or that mean two things."""
    if world.folder.is_relative_to(WORLDS_FOLDER):
        return ()
    from executive.language.parser import load_parser
    from executive.language.understand import understand

    parser, source = load_parser(), read_yaml(world.knowledge_path)
    asked = [
        ((key, name), f"go to {name}") for key in ("places", "surfaces", "people") for name in source.data.get(key, ())
    ]
    asked += [(("things", name), f"find the {next(iter(spoken_forms(name)), name)}") for name in knowledge.things]
    hint = "write a name of words, or give mission files with it instead of sentences"
    found = list[InputError]()
    for path, sentence in asked:
        commands = understand(sentence, parser=parser, knowledge=knowledge, require_wake=False).commands
        if not commands or any(path[1] not in (each.goal, each.object and each.object.name) for each in commands):
            found.append(source.error(path, f"{'.'.join(path)}: no sentence can say this name", hint))
    named = [(key, name) for key in ("places", "surfaces", "things", "people") for name in getattr(knowledge, key)]
    taken = {name.lower(): f"the robot '{name}'" for name in knowledge.robots or (knowledge.robot.name,)}
    for path in named:
        if (other := taken.setdefault(path[1].lower(), ".".join(path))) != ".".join(path):
            found.append(source.error(path, f"{'.'.join(path)}: {other} has the same name", "rename one of them"))
    return tuple(found)


def refuse_blocked_poses(
    knowledge: Knowledge, error: Callable[[KeyPath, str, str], InputError], clearance_m: Callable[[Pose2D], float]
) -> None:
    """Raises InputError for a named pose without clearance (m) on the map; `error` gives it file and line."""
    problems, poses = Problems(), {name: knowledge.place_pose(name) for name in knowledge.poses}
    for name, pose in poses.items():
        with problems:
            if clearance_m(Pose2D(pose.x, pose.y, pose.yaw)) <= 0.0:
                at = f"({pose.x:g}, {pose.y:g}, {pose.yaw:g})"
                what = f"places.{name}: at {at} the robot stands in an obstacle or outside of the map"
                raise error(("places", name), what, "give a free pose; `errand world show` draws the world")
    problems.raise_any()


def free_ground(world: World) -> GridMap:
    """Loads the world's surveyed map, in which unknown cells count as blocked."""
    from skills.grid_map import load_grid_map

    return load_grid_map(world.surveyed.keepout_map_path).with_unknown_blocked()
