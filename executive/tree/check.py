"""Checks a mission before it runs: errors, warnings, and an estimate."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from executive.mission.gripper import InGripper, grasp_objection, objection
from executive.tree.board import Constant
from executive.tree.compiler import CompiledTree
from executive.tree.estimate import Estimate, Estimates, Route, RoutePlanner, estimate_tree
from executive.tree.node import NodeSpec
from executive.tree.plan import StepPart
from executive.words.command import START, Command
from executive.words.knowledge import Knowledge
from executive.words.outlines import area_m2
from skills.api import FreeSpace, Part, PlanningError, Zone, ZoneKind
from skills.footprint import Footprint
from skills.inputs.errors import InputError, SourceLine, listing, suggestion
from skills.path import GlobalPlanner, Path, path_length
from skills.robot import Capabilities, Pose2D
from skills.world_model import zones_sentence

if TYPE_CHECKING:
    from skills.zone_map import ZoneMap


Fault = tuple[str, str]
"""Error in a part of a mission, and a hint."""
_OTHER_KIND: Final = "choose another kind of robot"


@dataclass(frozen=True)
class Abilities:
    """Abilities of the robot and properties of the objects that are known before a run.

    `masses_kg` has the least mass of each class, `lift_kg` is the arm's payload. The detector recognises
    `classes` and `attributes`; a search for several objects fails for any others. `reaches_m` are the heights of the
    lowest and the highest reachable surface. `widths_m` has the least width of each class, `opens_m` is the gripper's
    maximum opening; `gripper` is False without a gripper, `arm` without an arm, `looks` without a camera for objects.
    `capabilities` are the robot's (None: unknown). `takers` are the people who take objects from it (None: unknown).
    `taken_m2` is the covered area of each surface, `apart_m` the clearance around an object.
    """

    masses_kg: Mapping[str, float]
    lift_kg: float
    classes: frozenset[str]
    attributes: frozenset[str]
    reaches_m: tuple[float, float] = (-math.inf, math.inf)
    widths_m: Mapping[str, float] = field(default_factory=dict)
    opens_m: float = math.inf
    gripper: bool = True
    arm: bool = True
    looks: bool = True
    takers: frozenset[str] | None = None
    taken_m2: Mapping[str, float] = field(default_factory=dict)
    apart_m: float = 0.0
    capabilities: Capabilities | None = None


@dataclass(frozen=True)
class Checked:
    """Result of a check: errors, warnings, and the estimate for a mission in which nothing fails."""

    errors: tuple[InputError, ...]
    estimate: Estimate
    warnings: tuple[InputError, ...] = ()


class PlannedRoutes(RoutePlanner):
    """Planner of routes on the map with the global planner of `navigate`; each route is planned once.

    `full_m_s` returns the robot's full speed, for zones that limit the speed to a fraction of it.
    """

    def __init__(
        self,
        costmap: FreeSpace,
        footprint: Footprint,
        planner: GlobalPlanner,
        full_m_s: Callable[[], float] = lambda: math.inf,
    ) -> None:
        self._costmap, self._footprint, self._planner, self._full_m_s = costmap, footprint, planner, full_m_s
        self._routes: dict[tuple[Pose2D, Pose2D, tuple[Zone, ...]], Route | PlanningError] = {}

    def route(self, start: Pose2D, goal: Pose2D, zones: tuple[Zone, ...] = ()) -> Route:
        """Plans the route from start to goal within the zones.

        Raises ValueError with one sentence if there is no route, InputError for an unreadable mask.
        """
        if (start, goal, zones) not in self._routes:
            try:
                self._routes[start, goal, zones] = self._planned(start, goal, zones)
            except PlanningError as error:
                self._routes[start, goal, zones] = error
        route = self._routes[start, goal, zones]
        if isinstance(route, PlanningError):
            raise ValueError(str(route)) from route
        return route

    def _planned(self, start: Pose2D, goal: Pose2D, zones: tuple[Zone, ...]) -> Route:
        """Plans a route. Raises PlanningError with the names of the zones that forbid the goal or every path."""
        if not zones:
            path = self._path(self._costmap, start, goal)
            return Route(path_length(path), float(path.progress_m()[-1]))
        from skills.zone_map import zone_map

        ground, place = zone_map(zones, self._full_m_s()), f"({goal.x_m:.2f}, {goal.y_m:.2f})"
        if names := ground.names_at(ZoneKind.KEEP_OUT, goal, self._footprint):
            raise PlanningError(f"{zones_sentence(names, 'keep-out zone')} The robot does not stand at {place}.")
        costs = {"zones": ground} if ground.has_costs(start) else {}
        try:
            path = self._path(self._space(zones, start), start, goal, **costs)
        except PlanningError:
            names = self._between(zones, start, goal)
            if not names:
                raise
            raise PlanningError(f"{zones_sentence(names, 'keep-out zone')} No path leads to {place}.") from None
        return Route(path_length(path), float(path.progress_m()[-1]), self._limited(ground, path))

    def _path(self, space: FreeSpace, start: Pose2D, goal: Pose2D, **costs: Any) -> Path:
        return self._planner.problem(space, self._footprint, start, goal, max_speed_m_s=math.inf, **costs)()

    def _space(self, zones: tuple[Zone, ...], start: Pose2D) -> FreeSpace:
        from skills.zone_map import KeepOut, zone_map

        return KeepOut(zone_map(zones, self._full_m_s())).space(self._costmap, self._footprint, start)

    def _between(self, zones: tuple[Zone, ...], start: Pose2D, goal: Pose2D) -> tuple[str, ...]:
        """Names of the keep-out zones that cut the goal off: one that suffices, else all; empty if walls do."""
        keep_out = tuple(zone for zone in zones if zone.kind is ZoneKind.KEEP_OUT)

        def leads(without: Sequence[Zone]) -> bool:
            try:
                self._path(self._space(tuple(each for each in keep_out if each not in without), start), start, goal)
            except PlanningError:
                return False
            return True

        if not keep_out or not leads(keep_out):
            return ()
        return next(((zone.name,) for zone in keep_out if leads([zone])), tuple(zone.name for zone in keep_out))

    def _limited(self, ground: ZoneMap, path: Path) -> tuple[tuple[float, float], ...]:
        """Stretches of a path with a speed limit: the progress (m) along each stretch, and the limit (m/s)."""
        parts, now = dict[float, float](), np.zeros(1)
        steps = zip(path.poses[1:], np.diff(path.progress_m()).tolist(), strict=True)
        for pose, step_m in steps:
            limit_m_s = ground.speed_m_s(self._footprint, pose[None], now)
            if math.isfinite(limit_m_s):
                parts[limit_m_s] = parts.get(limit_m_s, 0.0) + step_m
        return tuple((part_m, limit_m_s) for limit_m_s, part_m in parts.items())


def check_tree(
    tree: CompiledTree,
    *,
    knowledge: Knowledge,
    start: Pose2D,
    abilities: Abilities,
    planner: RoutePlanner,
    estimates: Estimates,
) -> Checked:
    """Checks a compiled mission that begins at `start` with an empty gripper.

    It checks that the objects exist and can be lifted, that surfaces and places are in reach, and that before each step
    the gripper holds the required object.
    """
    lines = {node.path_id: node.source for node in tree.root.walk()}

    def errors(found: Iterable[tuple[StepPart, Fault]]) -> tuple[InputError, ...]:
        """Returns errors, each at the line of the step that it concerns."""
        return tuple(InputError.at(lines.get(part.path_id), what, hint=hint) for part, (what, hint) in found)

    commands = ((part, part.command) for part in tree.parts if part.command is not None)
    impossible = errors((part, each) for part, it in commands for each in _impossible(it, knowledge, abilities))
    starts = ((part, None if part.opening else part.held) for part in tree.parts)
    needs = ((part, _objection(part, before, knowledge, abilities)) for part, before in starts)
    grasps = errors((part, each) for part, each in needs if each is not None)
    full = errors(_full_surfaces(tree, knowledge, abilities))
    refused = _refused(tree.root, abilities.capabilities)
    estimate, unreachable, warnings = estimate_tree(
        tree.root, start=start, planner=planner, estimates=estimates, zones=tree.zones
    )
    return Checked((*impossible, *grasps, *refused, *unreachable), estimate, (*full, *warnings))


def _objection(part: StepPart, held: InGripper | None, knowledge: Knowledge, abilities: Abilities) -> Fault | None:
    """Returns the error of a step that cannot run with this object in the gripper, or without a gripper; else None."""
    skill = part.skill
    if part.command is not None or skill is None:
        return None if part.command is None else objection(part.command, held, knowledge)
    if not abilities.gripper and (skill.gripper_before is not None or skill.gripper_after is not None):
        return f"this kind of robot has no gripper, which {skill.name} needs", _OTHER_KIND
    if not abilities.arm and skill.uses == {Part.ARM}:
        return f"this kind of robot has no arm, which {skill.name} needs", _OTHER_KIND
    if not abilities.looks and skill.needs_camera:
        return f"this kind of robot has no camera, which {skill.name} needs", _OTHER_KIND
    if skill.gripper_before is True and held is None:
        return f"{skill.name} needs an object in the gripper, and no step before has grasped one", "grasp one first"
    if skill.gripper_before is False and held is not None and held.sure:
        return grasp_objection(held, "another object")
    return None


def _impossible(command: Command, knowledge: Knowledge, abilities: Abilities) -> Iterator[Fault]:
    """Yields the errors of an impossible command.

    The object may be unknown or impossible to take, the person may take nothing, or the surface may be out of reach.
    """
    handles = command.item is not None or command.takes or command.puts
    if handles and not abilities.gripper:
        what = command.item or command.object
        yield f"this kind of robot has no gripper to take the {what} with", _OTHER_KIND
        return
    if command.looks and not abilities.looks:
        yield f"this kind of robot has no camera to look for the {command.object} with", _OTHER_KIND
        return
    yield from _nobody_takes(command, knowledge, abilities)
    if (command.item is not None or command.takes) and command.goal is not None:
        yield from _out_of_reach(command.goal, knowledge, abilities)
    if not (command.takes or command.looks) or command.object is None:
        return
    item = command.object
    classes = knowledge.classes(item.name)
    masses = [abilities.masses_kg[one] for one in classes if one in abilities.masses_kg]
    light = [one for one in classes if abilities.masses_kg.get(one, math.inf) <= abilities.lift_kg]
    narrowest_m = min((abilities.widths_m.get(one, 0.0) for one in light), default=0.0)
    unseen = [one for one in classes if not {one, item.name} & abilities.classes]
    unseen += [word for word in item.attributes if word not in abilities.attributes]
    if command.takes and not masses:
        known = [one for one in knowledge.things if one in abilities.masses_kg]
        yield f"there is no '{item.name}' that could be picked up", suggestion(item.name, known)
    elif command.takes and min(masses) > abilities.lift_kg:
        message = f"'{item.name}' is too heavy: {min(masses):g} kg, and the arm lifts {abilities.lift_kg:g} kg"
        yield message, "ask for something lighter"
    elif command.takes and narrowest_m > abilities.opens_m:
        message = f"'{item.name}' is too wide: {narrowest_m:g} m, and the gripper takes {abilities.opens_m:g} m"
        yield message, "ask for something narrower"
    elif unseen:
        known = [one for one in knowledge.object_names() if one in abilities.classes]
        message = f"the robot does not know what {listing(unseen)} looks like"
        yield message, f"it knows {listing(known)} by sight"


def _refused(root: NodeSpec, capabilities: Capabilities | None) -> tuple[InputError, ...]:
    """Returns the errors of skills that refuse the robot or their constant inputs."""
    found = dict[tuple[str, SourceLine | None], InputError]()
    if capabilities is None:
        return ()
    for node in root.walk():
        given = node.options.get("inputs", {}).items()
        inputs = {name: each.value for name, each in given if isinstance(each, Constant)}
        refusal = None if node.skill is None else node.skill.refuses(inputs, capabilities)
        if refusal is not None:
            what, hint = refusal
            found[what, node.source] = InputError.at(node.source, what, hint=hint)
    return tuple(found.values())


def _nobody_takes(command: Command, knowledge: Knowledge, abilities: Abilities) -> Iterator[Fault]:
    """Yields the errors for a hand-over to nobody, or to a person who takes nothing."""
    if command.item is None or command.puts or abilities.takers is None:
        return
    person = None if command.goal is None else knowledge.person(command.goal)
    if command.goal == START and not abilities.takers:
        hint = "name a surface to put it on, or add somebody under 'people'"
        yield f"nobody is in this world who could take the {command.item}", hint
    elif person is not None and person not in abilities.takers:
        takers = listing(sorted(abilities.takers), last="or")
        others = f"name {takers}" if abilities.takers else "add them under 'people'"
        message = f"{person} is not in this world, or takes nothing, so nobody takes the {command.item}"
        yield message, f"{others}, or name a surface to put it on"


def _full_surfaces(tree: CompiledTree, knowledge: Knowledge, abilities: Abilities) -> Iterator[tuple[StepPart, Fault]]:
    """Yields the steps that put more objects on a surface than fit there, judged by the known sizes."""
    brought_m2: dict[str, float] = {}
    for part in tree.parts:
        command = part.command
        item = None if command is None else command.carried
        place = None if command is None or command.goal is None else knowledge.place(command.goal)
        if command is None or item is None or place is None or not knowledge.surfaces_in(place):
            continue
        classes = knowledge.classes(item.name)
        width_m = min((abilities.widths_m.get(one, 0.0) for one in classes), default=0.0)
        brought_m2[place] = brought_m2.get(place, 0.0) + max(1, command.item_count) * (width_m + abilities.apart_m) ** 2
        surfaces = knowledge.surfaces_in(place)
        whole_m2 = sum(area_m2(knowledge.surfaces[one].polygon) for one in surfaces)
        taken_m2 = sum(abilities.taken_m2.get(one, 0.0) for one in surfaces)
        if width_m and brought_m2[place] > whole_m2 - taken_m2:
            message = f"the {place} is probably full before the {item} is put there"
            yield part, (message, "name another surface, or clear it first")


def _out_of_reach(goal: str, knowledge: Knowledge, abilities: Abilities) -> Iterator[Fault]:
    """Yields the errors for a surface that is too high or too low for the arm."""
    surface = knowledge.surfaces.get(knowledge.place(goal) or goal)
    low_m, high_m = abilities.reaches_m
    if surface is not None and not low_m <= surface.height <= high_m:
        limit = f"down to {low_m:.2f} m" if surface.height < low_m else f"up to {high_m:.2f} m"
        message = f"the {goal} is {surface.height:g} m high, and the arm reaches {limit}"
        yield message, "name another surface, or another kind of robot"
