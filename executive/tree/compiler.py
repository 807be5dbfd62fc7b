"""From missions to trees: a pure function; the same mission gives the same tree, path ids included."""

from __future__ import annotations

from dataclasses import dataclass

from py_trees.behaviour import Behaviour

from executive.tree.assembly import StepPart, assemble, step_name
from executive.tree.compiling.wiring import check_wiring
from executive.tree.context import RunContext
from executive.tree.kinds import build
from executive.tree.node import NodeSpec
from executive.tree.nodes.decisions import buttons_of
from executive.tree.nodes.doors import doorway
from executive.tree.nodes.interrupts import watched
from executive.tree.plan import PlanBuilder, Registry, start_key
from executive.words.command import Command
from executive.words.knowledge import Knowledge
from executive.words.mission import Mission
from executive.words.step import Step
from skills.files.errors import InputError
from skills.perception.doorway import Doorway

__all__ = ["CompiledTree", "StepPart", "compile_mission", "step_name"]


@dataclass(frozen=True)
class CompiledTree:
    """A mission's tree for one robot, as data; `parts` are its steps with their goal conditions, in order,
    `steps` what it was compiled from, and `doors` those of the world's knowledge.

    Its root watches over the mission itself: see `executive.tree.nodes.interrupts`.
    """

    robot_name: str
    mission_name: str
    commands: tuple[Command, ...]
    root: NodeSpec
    parts: tuple[StepPart, ...] = ()
    steps: tuple[Step, ...] = ()
    doors: tuple[Doorway, ...] = ()

    @property
    def mission(self) -> NodeSpec:
        """The mission below its watches."""
        return self.root.children[-1] if self.root.kind == "interrupts" else self.root

    def build(self, context: RunContext) -> Behaviour:
        """The py_trees tree for one run."""
        return build(self.root, context)

    @property
    def buttons(self) -> tuple[str, ...]:
        """The operator's buttons that it waits for or decides by."""
        return tuple(dict.fromkeys(button for node in self.root.walk() for button in buttons_of(node)))

    @property
    def path_ids(self) -> tuple[str, ...]:
        """All path ids, parents first."""
        return tuple(node.path_id for node in self.root.walk())


def compile_mission(mission: Mission, *, knowledge: Knowledge, registry: Registry) -> CompiledTree:
    """Compile a mission to a tree and check its wiring; each node keeps the line of the file that it comes from.

    Args:
        mission: what to do; its robot and name become the first parts of the path ids.
        knowledge: the world's places, surfaces, objects and people.
        registry: the skills by name.

    Raises InputError: no steps, an unknown place, object or skill, ports wired wrongly, or a command that cannot be
    carried out; with the file and line where known, and all that was found in `others`.
    """
    if not mission.steps:
        raise InputError(f"the mission '{mission.name}' has no commands", hint="add at least one step")
    body, parts = assemble(mission, knowledge=knowledge, registry=registry)
    start = start_key(mission.robot_name, mission.name)
    root = watched(PlanBuilder(knowledge, registry, body.path_id, start, Command(), mission.source), body)
    check_wiring(root)
    doors = tuple(doorway(knowledge, door) for door in knowledge.doors)
    return CompiledTree(mission.robot_name, mission.name, mission.commands, root, parts, mission.steps, doors)
