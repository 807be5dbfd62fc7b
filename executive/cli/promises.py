"""What a mission promises, in the referee's words."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import Final

from py_trees.common import Status

from executive.mission.command import START, Command, Task, Thing
from executive.mission.knowledge import Knowledge, Pose
from executive.run.outcome import RobotResult
from executive.run.snapshot import Snapshot
from executive.tree.behaviours.board import Constant
from executive.tree.compiler import CompiledTree, StepPart
from executive.tree.compiling.search import surfaces_to_search
from executive.tree.node import NodeSpec
from plant.referee import Promise, PromiseKind, Region
from skills.robot import Pose2D

BELOW_TOP_M: Final = 0.05
ABOVE_TOP_M: Final = 0.30
NEAR_M: Final = 0.75
POSE_NEAR_M: Final = 0.25
NAVIGATE: Final = "navigate"


def promises(
    commands: Sequence[Command], *, knowledge: Knowledge, robot: str, answers: Sequence[bool | None]
) -> tuple[Promise, ...]:
    """One promise for each command; `answers` are those of its status checks in order, None where none was given."""
    given = iter(answers)
    return tuple(_PROMISE[command.task](command, knowledge, robot, given) for command in commands)


def promises_of(tree: CompiledTree, *, knowledge: Knowledge, result: RobotResult) -> tuple[Promise, ...]:
    """The promises of a tree that has run: of all its parts but those that its own result tells were skipped.

    A count is one promise, however many trips it takes; of skills on their own only a drive to a fixed pose promises
    something.
    """
    promised: list[Promise] = []
    for part in tree.parts:
        if _was_skipped(part, result.states):
            continue
        if part.command is not None:
            given = [answer for path_id, answer in result.answers.items() if _below(path_id, part.path_id)]
            (promise,) = promises((part.command,), knowledge=knowledge, robot=tree.robot_name, answers=given)
            elsewhere = tuple(surface_region(knowledge, name) for name in part.elsewhere)
            promised.append(replace(promise, source=(*promise.source, *elsewhere)))
        elif part.skill is not None:
            promised += _driven(part.skill, tree.robot_name)
    return tuple(promised)


def _was_skipped(part: StepPart, states: Snapshot) -> bool:
    """Whether a node above let its failure pass."""
    statuses = {path_id: state.status for path_id, state in states.items()}
    return any(
        statuses.get(above) is Status.SUCCESS and statuses.get(below) is Status.FAILURE for above, below in part.excused
    )


def _below(path_id: str, base: str) -> bool:
    return path_id == base or path_id.startswith(f"{base}/")


def _driven(skill: NodeSpec, robot: str) -> Iterator[Promise]:
    """The robot where a drive on its own was to lead."""
    goal = skill.options["inputs"].get("goal")
    if skill.name == NAVIGATE and isinstance(goal, Constant) and isinstance(goal.value, Pose2D):
        pose = Pose(x=goal.value.x_m, y=goal.value.y_m, yaw=goal.value.yaw_rad)
        name = f"({pose.x:.2f}, {pose.y:.2f})"
        yield Promise(PromiseKind.WENT, goal=(_square(name, pose, POSE_NEAR_M),), robot=robot)


def surface_region(knowledge: Knowledge, surface: str) -> Region:
    """The space on top of a surface in which the origin of a thing lies that rests there."""
    facts = knowledge.surfaces[surface]
    return Region(surface, facts.polygon, facts.height - BELOW_TOP_M, facts.height + ABOVE_TOP_M)


def _regions(knowledge: Knowledge, thing: Thing, goal: str | None) -> tuple[Region, ...]:
    place = None if goal is None else knowledge.place(goal)
    return tuple(surface_region(knowledge, name) for name in surfaces_to_search(knowledge, thing.name, place))


def _grasped(command: Command, knowledge: Knowledge, robot: str, _: Iterator[bool | None]) -> Promise:
    thing = command.object
    assert thing is not None
    return Promise(
        kind=PromiseKind.GRASPED,
        classes=knowledge.classes(knowledge.thing(thing.name) or thing.name),
        count=command.object_count,
        source=_regions(knowledge, thing, command.goal),
        robot=robot,
    )


def _answered(command: Command, knowledge: Knowledge, robot: str, given: Iterator[bool | None]) -> Promise:
    thing = command.object
    assert thing is not None
    return Promise(
        kind=PromiseKind.ANSWERED,
        classes=knowledge.classes(knowledge.thing(thing.name) or thing.name),
        count=command.object_count,
        source=_regions(knowledge, thing, command.goal),
        answer=next(given, None),
        robot=robot,
    )


def _carried(command: Command, knowledge: Knowledge, robot: str, _: Iterator[bool | None]) -> Promise:
    item, goal = command.item or command.object, command.goal
    assert item is not None and goal is not None
    classes = knowledge.classes(knowledge.thing(item.name) or item.name)
    person = knowledge.person(goal)
    if goal == START or person is not None:
        return Promise(PromiseKind.HANDED_OVER, classes, command.item_count, person=person, robot=robot)
    place = knowledge.place(goal)
    assert place is not None
    goals = tuple(surface_region(knowledge, name) for name in knowledge.surfaces_in(place))
    return Promise(PromiseKind.PLACED, classes, command.item_count, goal=goals, robot=robot)


def _went(command: Command, knowledge: Knowledge, robot: str, given: Iterator[bool | None]) -> Promise:
    if command.item is not None:
        return _carried(command, knowledge, robot, given)
    assert command.goal is not None
    return Promise(PromiseKind.WENT, goal=(_place_region(knowledge, command.goal),), robot=robot)


def _place_region(knowledge: Knowledge, goal: str) -> Region:
    """A room's outline; for a surface or the start a square about where the robot is to stand."""
    person = knowledge.person(goal)
    place = knowledge.people[person].at if person is not None else knowledge.place(goal)
    if place in knowledge.places:
        return Region(place, knowledge.places[place].polygon)
    return _square(goal, knowledge.start if goal == START or place is None else knowledge.place_pose(place))


def _square(name: str, pose: Pose, near_m: float = NEAR_M) -> Region:
    sides = ((-near_m, -near_m), (near_m, -near_m), (near_m, near_m), (-near_m, near_m))
    return Region(name, tuple((pose.x + dx, pose.y + dy) for dx, dy in sides))


_PROMISE: Final[Mapping[Task | None, Callable[[Command, Knowledge, str, Iterator[bool | None]], Promise]]] = (
    MappingProxyType({Task.GRASP: _grasped, Task.FIND: _answered, Task.PLACE: _carried, None: _went})
)
