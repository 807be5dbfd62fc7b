"""Checks whether a mission can be done: routes on the map, and the abilities of the robot."""

import hashlib
import json
import math
import os
from contextlib import suppress
from dataclasses import replace
from functools import cache, cached_property
from pathlib import Path
from typing import Any, Final

from executive.app.prepare.placed_robots import DEFAULT_KIND, reported_classes, robot_stack
from executive.app.prepare.prepared import Prepared
from executive.app.prepare.worlds import refuse_unusable
from executive.tree.check import Abilities, Checked, PlannedRoutes, check_tree
from executive.tree.compiler import CompiledTree
from executive.tree.estimate import Route, RoutePlanner, load_estimates
from plant.robots.robot_kind import PlacedRobot, robot_kind
from plant.worlds.world import World
from skills.api import Zone
from skills.class_forms import class_forms, known_attributes, shipped_forms
from skills.inputs.errors import Problems
from skills.path import ControllerComponent
from skills.robot import Capabilities, Pose2D
from skills.stack import DEFAULT_FILE, default_component


class _RoutesOnMap(RoutePlanner):
    """Planner of routes for a robot's footprint, on the map that the robot has of the world.

    The planner reads the map when the first route is planned. From the robot's stack it loads only costmap and planner,
    and in a world with zones the controller.
    """

    def __init__(self, world: World, robot: PlacedRobot) -> None:
        self._world, self._robot = world, robot
        self._stack = None if robot.stack_file is None else robot_stack(robot)

    @cached_property
    def _routes(self) -> PlannedRoutes:
        from skills.footprint import Footprint
        from skills.grid_map import load_grid_map

        keepout_map = load_grid_map(self._world.keepout_map_path)
        costmap, planner = self._component("costmap"), self._component("planner")
        footprint = Footprint.of(self._robot.capabilities)
        return PlannedRoutes(costmap.build(keepout_map), footprint, planner, self._full_m_s)

    def _component(self, slot: str) -> Any:
        return default_component(slot) if self._stack is None else getattr(self._stack, slot)

    def _full_m_s(self) -> float:
        """Full speed of the robot with its controller."""
        controller: ControllerComponent = self._component("controller")
        return min(self._robot.capabilities.max_speed_m_s, controller.max_speed_m_s)

    def route(self, start: Pose2D, goal: Pose2D, zones: tuple[Zone, ...] = ()) -> Route:
        """Plans a route. Raises ValueError with one sentence if there is no route, InputError if the map is broken."""
        return self._routes.route(start, goal, zones)


def route_planner_of(world: World, robot: PlacedRobot, *, cached: bool = True) -> RoutePlanner:
    """Returns a planner of routes for a robot, on the map that the robot has of the world.

    With `cached` the routes are stored for later processes. Without a map, the first route raises InputError.

    Raises:
        InputError: its stack file cannot be used; with file and line.
    """
    facts = robot_kind(robot.kind).facts
    files = (facts,) if robot.stack_file is None else (facts, robot.stack_file)
    planned = _RoutesOnMap(world, robot)
    return route_cache_of(world, planned, *files) if cached else planned


def check_prepared(prepared: Prepared, planner: RoutePlanner | None = None) -> Checked:
    """Returns errors, warnings and an estimate of a prepared request. A given `planner` may have routes cached.

    Raises:
        InputError: the world's map or the request's stack file cannot be used.
    """
    world, robot = prepared.world, prepared.robot
    abilities = abilities_in(world, robot.kind)
    abilities = replace(abilities, reaches_m=reached_heights_m(prepared.tree, robot.capabilities))
    tagged = frozenset(tag.on for tag in prepared.tree.tags if tag.on is not None)
    if reported := reported_classes(robot):
        words = {*class_forms(), *prepared.knowledge.categories()}
        abilities = replace(abilities, classes=reported & words | world.own_objects.keys())
    return check_tree(
        prepared.tree,
        knowledge=prepared.knowledge,
        start=world.start,
        abilities=replace(abilities, classes=abilities.classes | tagged),
        planner=planner or route_planner_of(world, robot),
        estimates=load_estimates(),
    )


def refuse_impossible(prepared: Prepared) -> None:
    """Raises InputError with all errors that `errand check` finds."""
    refuse_unusable(prepared.world, prepared.request.seed)
    problems = Problems()
    for error in (error for each in prepared.all for error in check_prepared(each).errors):
        problems.add(error)
    problems.raise_any()


def abilities_in(world: World, kind: str = DEFAULT_KIND) -> Abilities:
    """Returns the abilities of a kind of robot in a world, with the world's objects, recipients and full surfaces."""
    abilities = abilities_of(kind)
    masses, others = dict(abilities.masses_kg), {rule.model for rule in world.seed_rules.objects}
    for name in sorted(world.own_objects.keys() | (others & world.imports.keys())):
        own = world.imports[name].object
        only = own.class_name not in others or own.class_name not in masses
        masses[own.class_name] = own.mass_kg if only else min(own.mass_kg, masses[own.class_name])
        others.add(own.class_name)
    widths = {name: min(each.object.size_m) for name, each in world.own_objects.items()}
    rules = world.seed_rules
    takers = frozenset(person.name for person in rules.people if person.receives)
    taken_m2: dict[str, float] = {}
    for rule in rules.objects:
        if len(rule.surfaces) == 1:
            width_m = abilities.widths_m.get(rule.model, 0.0)
            taken_m2[rule.surfaces[0]] = taken_m2.get(rule.surfaces[0], 0.0) + (width_m + rules.rules.clear_m) ** 2
    return replace(
        abilities,
        masses_kg=masses,
        classes=abilities.classes | widths.keys(),
        widths_m={**abilities.widths_m, **widths},
        takers=takers,
        taken_m2=taken_m2,
        apart_m=rules.rules.clear_m,
    )


@cache
def abilities_of(kind: str) -> Abilities:
    """Returns payload and gripper of a kind of robot, and the least mass and width of each object class."""
    masses = {name: 0.0 if form.mass_kg is None else form.mass_kg[0] for name, form in class_forms().items()}
    capabilities = robot_kind(kind).capabilities()
    return Abilities(
        masses,
        0.0 if capabilities.arm is None else capabilities.arm.max_payload_kg,
        frozenset(shipped_forms()),
        known_attributes(),
        widths_m={name: form.width_m[0] for name, form in class_forms().items()},
        opens_m=math.inf if capabilities.gripper is None else capabilities.gripper.max_grasp_m,
        gripper=capabilities.gripper is not None and capabilities.arm is not None,
        arm=capabilities.arm is not None,
        looks=capabilities.object_camera is not None,
        capabilities=capabilities,
    )


def reached_heights_m(tree: CompiledTree, capabilities: Capabilities) -> tuple[float, float]:
    """Heights (m) of the lowest and the highest surface at which all skills of a tree work."""
    skills = {node.skill for node in tree.root.walk() if node.skill is not None}
    limits_m = [each.reached_heights_m(capabilities) for each in skills]
    return max((low_m for low_m, _ in limits_m), default=-math.inf), min((m for _, m in limits_m), default=math.inf)


_SKILLS: Final = DEFAULT_FILE.parent


class RouteCache(RoutePlanner):
    """Route planner that stores its routes in a file, so that later processes need not plan them again."""

    def __init__(self, file: Path, planned: RoutePlanner) -> None:
        self._file, self._planned = file, planned

    @cached_property
    def _routes(self) -> dict[str, list[float] | str]:
        """Length and progress of each route by start and goal, or the reason why there is no route."""
        with suppress(OSError, ValueError, RecursionError):
            routes: dict[str, list[float] | str] = json.loads(self._file.read_text(encoding="utf-8"))
            return routes
        return {}

    def route(self, start: Pose2D, goal: Pose2D, zones: tuple[Zone, ...] = ()) -> Route:
        """Returns a stored route, or plans the route; worlds with masks always plan, because a mask's file may change.

        Raises ValueError with one sentence if there is no route.
        """
        if any(zone.mask is not None for zone in zones):
            return self._planned.route(start, goal, zones)
        name = f"{start} {goal}{f' {zones}' if zones else ''}"
        if name not in self._routes:
            try:
                route = self._planned.route(start, goal, zones)
                parts = [number for part in route.limited for number in part]
                self._routes[name] = [route.length_m, route.progress_m, *parts]
            except ValueError as error:
                self._routes[name] = str(error)
            with suppress(OSError):
                self._file.parent.mkdir(parents=True, exist_ok=True)
                partial = self._file.with_suffix(f".{os.getpid()}")
                partial.write_text(json.dumps(self._routes), encoding="utf-8")
                partial.replace(self._file)  # another process sees the old file or the new one
        known = self._routes[name]
        if isinstance(known, str):
            raise ValueError(known)
        length_m, progress_m, *parts = known
        return Route(length_m, progress_m, tuple(zip(parts[::2], parts[1::2], strict=True)))


def route_cache_of(world: World, planned: RoutePlanner, *robot_files: Path) -> RouteCache:
    """Returns the route cache of a world; the file name is a hash over the maps, the planner and the robot's files."""
    planner = (DEFAULT_FILE, *_SKILLS.glob("navigate/*.py"), *_SKILLS.glob("estimate/*.py"), *_SKILLS.glob("*.py"))
    files, content = (*world.keepout_map_path.parent.glob("*"), *planner, *robot_files), hashlib.sha256()
    for file in sorted(path for path in files if path.is_file()):
        content.update(file.name.encode() + hashlib.sha256(file.read_bytes()).digest())
    digest = content.hexdigest()[:24]
    home = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    return RouteCache(home / "errand" / "routes" / f"{digest}.json", planned)
