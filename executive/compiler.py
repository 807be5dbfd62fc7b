"""From commands to a tree: a pure function; the same mission gives the same tree, path ids included."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from py_trees.behaviour import Behaviour

from executive.behaviours.context import RunContext
from executive.command import Command, Task
from executive.compiling.plans import NodePlan, RememberPosePlan, SequencePlan, Source
from executive.compiling.steps import needs_start, step_plan
from executive.compiling.wiring import check_wiring
from executive.compiling.workshop import Registry, Workshop, slug
from executive.errors import InputError
from executive.knowledge import Knowledge

if TYPE_CHECKING:  # the module brings the language's parser along, which a tree has no need of
    from executive.mission import Mission


@dataclass(frozen=True)
class Step:
    """A command, and the line of the mission file that it comes from."""

    command: Command
    source: Source | None = None


@dataclass(frozen=True)
class CompiledTree:
    """A mission's tree for one robot, as data."""

    robot_name: str
    mission_name: str
    commands: tuple[Command, ...]
    root: NodePlan

    def build(self, context: RunContext) -> Behaviour:
        """The py_trees tree for one run."""
        return self.root.build(context)

    @property
    def path_ids(self) -> tuple[str, ...]:
        """All path ids, parents first."""
        return tuple(node.path_id for node in self.root.walk())


def compile_mission(mission: Mission, *, knowledge: Knowledge, registry: Registry) -> CompiledTree:
    """Compile a mission; each node keeps the line of the mission file that it comes from.

    Raises:
        InputError: as `compile_commands`.
    """
    steps = [
        Step(command, None if step.source is None else Source(step.source.file, step.source.line))
        for step in mission.steps
        for command in step.commands
    ]
    return compile_commands(mission.name, steps, knowledge=knowledge, registry=registry, robot_name=mission.robot_name)


def compile_commands(
    mission_name: str, steps: Sequence[Step], *, knowledge: Knowledge, registry: Registry, robot_name: str
) -> CompiledTree:
    """Compile commands to a tree and check its wiring.

    Args:
        mission_name: in words; becomes the second part of the path ids.
        steps: the commands in order, each with its source.
        knowledge: the world's places, surfaces, things and people.
        registry: the skills by name.
        robot_name: whose tree it is; becomes the first part of the path ids.

    Raises:
        InputError: no commands, an unknown place, thing or skill, ports wired wrongly, or a command that cannot be
            carried out yet; with the file and line where known.
    """
    if not steps:
        raise InputError(f"the mission '{mission_name}' has no commands", mend="add at least one step")
    base = f"{slug(robot_name)}/{slug(mission_name)}"
    start_key = f"{base}/start-pose"
    shops = [
        Workshop(
            knowledge, registry, f"{base}/{number}-{step_name(step.command)}", start_key, step.command, step.source
        )
        for number, step in enumerate(steps, start=1)
    ]
    for shop in shops:
        _refuse_several(shop)
    root = SequencePlan(
        path_id=base, name=mission_name, steps=(*_remember(base, start_key, shops), *map(step_plan, shops))
    )
    check_wiring(root)
    return CompiledTree(robot_name, mission_name, tuple(step.command for step in steps), root)


def step_name(command: Command) -> str:
    """The step's name in path ids: the goal, else the thing."""
    return slug(command.goal or str(command.object or command.item or "anywhere"))


def _remember(base: str, key: str, shops: Sequence[Workshop]) -> Iterator[NodePlan]:
    """A leaf that notes where the robot stands, when a command comes back to it."""
    if any(map(needs_start, shops)):
        yield RememberPosePlan(path_id=f"{base}/remember-start", name="where it starts", key=key)


def _refuse_several(shop: Workshop) -> None:
    """Refuse what needs several trips; a plural in a question ("are there any hammers") asks for one."""
    command = shop.command
    counts = ((command.item, command.item_count), (command.object, command.object_count))
    for thing, count in counts:
        if count > 1 or (count == 0 and command.task is not Task.FIND):
            said = f"{count} of '{thing}'" if count else f"an open number of '{thing}'"
            raise shop.error(f"{said} cannot be carried in one go", "ask for one at a time")
