"""Puts a scenario into a request and its world: faults checked and drawn, places and doors found."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any, Final

import numpy as np

from executive.mission.request import Request
from executive.mission.scenario import Scenario
from executive.mission.scenario_file import checked_fault, load_scenario, scenario_of
from executive.words.knowledge import Knowledge
from executive.words.mission import Route
from plant.spot.capabilities import spot_capabilities
from plant.worlds.world import DoorRule, MoveRule, World, WorldError
from skills.estimate.grid_map import GridMap, load_grid_map
from skills.faults.words import random_faults
from skills.files.errors import InputError
from skills.robot import FloatArray

__all__ = ["with_events", "with_scenario"]

DIRECTIONS: Final = 36
_STEP_M: Final = 0.01
_BEYOND_M: Final = 0.5


def with_scenario(request: Request, world: World, knowledge: Knowledge) -> Request:
    """The request with its scenario files read and its random faults drawn.

    Raises InputError: a fault is none, with the line where it has one, or something in a file is not in the world.
    """
    cameras = tuple(camera.source for camera in spot_capabilities().cameras)
    scenario = request.scenario
    for words in scenario.faults:
        checked_fault(words, cameras)
    objects = {rule.name: _class_of(rule.model, world) for rule in world.seed_rules.objects}
    people = {rule.name: rule.route is not None for rule in world.seed_rules.people}
    for path in request.scenario_files:
        file, source = load_scenario(path)
        read = scenario_of(file, source, knowledge, cameras=cameras, objects=objects, people=people)
        twice = read.moving & scenario.moving
        if twice:
            raise InputError(f"another scenario has an event of {min(twice)}", hint="keep one of them", file=path)
        scenario = scenario.and_also(_with_doorways(read, world))
    drawn = random_faults(scenario.random, request.seed, cameras)
    return replace(request, scenario=scenario.with_drawn(drawn), scenario_files=())


def with_events(world: World, scenario: Scenario) -> World:
    """The world in which the scenario's events happen. Raises InputError: it has changed, and they fit no longer."""
    try:
        walking = world.with_walks({name: Route.model_validate(each) for name, each in scenario.people.items()})
    except WorldError as error:
        raise InputError(str(error), hint="change the scenario's events") from error
    doors = [DoorRule.model_validate(door) for door in scenario.doors]
    return walking.with_events(doors, [MoveRule.model_validate(move) for move in scenario.moves])


def _class_of(model: str, world: World) -> str:
    return world.imports[model].object.class_name if model in world.imports else model


def _with_doorways(scenario: Scenario, world: World) -> Scenario:
    """The scenario with the true middle, width and direction of each door. Raises InputError: the map is broken."""
    if not scenario.doors:
        return scenario
    grid = load_grid_map(world.surveyed.scan_map_path)
    return replace(scenario, doors=tuple({**door, **doorway(grid, door["at"])} for door in scenario.doors))


def doorway(grid: GridMap, at_W: tuple[float, float]) -> dict[str, Any]:
    """Middle, clear width and direction of the doorway at a point; the direction is that of the longer wall beside it.

    The passage is narrowest across the doorway: of all lines through its middle, that one is shortest.
    """
    angles = np.arange(DIRECTIONS) * math.pi / DIRECTIONS
    lengths = [[_free_m(grid, at_W, angle), _free_m(grid, at_W, angle + math.pi)] for angle in angles]
    ahead_m, back_m = lengths[best := int(np.argmin(np.sum(lengths, axis=1)))]
    yaw, width_m = float(angles[best]), ahead_m + back_m
    along = np.array([math.cos(yaw), math.sin(yaw)])
    middle = np.array(at_W) + 0.5 * (ahead_m - back_m) * along
    if _wall_m(grid, middle, -along, width_m) > _wall_m(grid, middle, along, width_m):
        yaw += math.pi
    return {"at": (float(middle[0]), float(middle[1])), "yaw": yaw, "width": width_m}


def _free_m(grid: GridMap, at_W: tuple[float, float], yaw: float) -> float:
    """How far it is from a point to the first occupied cell."""
    away_m = np.arange(0.0, 10.0, _STEP_M)
    met = _occupied(grid, np.array(at_W) + away_m[:, None] * [math.cos(yaw), math.sin(yaw)])
    return float(away_m[int(np.argmax(met))]) if met.any() else float(away_m[-1])


def _wall_m(grid: GridMap, middle_W: FloatArray, along: FloatArray, width_m: float) -> float:
    """How much wall, up to a little more than the door's width, is beside the doorway in a direction."""
    away_m = np.arange(0.5 * width_m + _STEP_M, 1.5 * width_m + _BEYOND_M, _STEP_M)
    met = _occupied(grid, middle_W + away_m[:, None] * along)
    return _STEP_M * float(np.count_nonzero(np.logical_and.accumulate(met)))


def _occupied(grid: GridMap, points_W: FloatArray) -> Any:
    """Whether each point (N, 2) is in an occupied cell; off the grid, all is."""
    rows, columns = grid.cells(points_W).T
    inside = (rows >= 0) & (rows < grid.occupied.shape[0]) & (columns >= 0) & (columns < grid.occupied.shape[1])
    return ~inside | grid.occupied[np.where(inside, rows, 0), np.where(inside, columns, 0)]
