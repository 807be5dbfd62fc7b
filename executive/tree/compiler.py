"""Compiles missions to trees by a pure function: the same mission gives the same tree, including path ids."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields, replace
from typing import Any, Final

from py_trees.behaviour import Behaviour

from executive.tree.assembly import Assembler, StepPlans
from executive.tree.board import Binding, Constant, FromBoard, FromBoardOr, LastKnown
from executive.tree.context import RunContext
from executive.tree.node import NodeSpec, node_pages
from executive.tree.nodes.decision_nodes import buttons_of
from executive.tree.nodes.door_check import doorway
from executive.tree.nodes.group import mission_plan, whole_mission
from executive.tree.nodes.interrupts import watch_plan
from executive.tree.plan import PICK_UPS, Registry, StepPart, start_key
from executive.tree.port_values import assignable, conforms, describe_type, field_types, required_fields
from executive.words.command import Command
from executive.words.knowledge import Knowledge
from executive.words.mission import Mission
from executive.words.slug import slug
from executive.words.step import Step
from skills.api import Surface, Tag, Zone
from skills.doorway import Doorway
from skills.inputs.errors import InputError, suggestion, with_article


@dataclass(frozen=True)
class CompiledTree:
    """Tree of a mission for one robot, as data.

    `parts` are the steps with goal conditions, in order, `steps` all compiled steps. `doors`, `tags` (AprilTags),
    `surfaces` and `zones` come from the knowledge file. The root has monitors and interrupts above the mission: see
    `executive.tree.nodes.interrupts`.
    """

    robot_name: str
    mission_name: str
    commands: tuple[Command, ...]
    root: NodeSpec
    parts: tuple[StepPart, ...] = ()
    steps: tuple[Step, ...] = ()
    doors: tuple[Doorway, ...] = ()
    tags: tuple[Tag, ...] = ()
    surfaces: tuple[Surface, ...] = ()
    zones: tuple[Zone, ...] = ()

    @property
    def mission(self) -> NodeSpec:
        """Node of the mission itself, below the monitors and interrupts."""
        return self.root.children[-1] if self.root.behaviour.watches else self.root

    def build(self, context: RunContext) -> Behaviour:
        """Builds the py_trees tree for one run."""
        return build(self.root, context)

    @property
    def buttons(self) -> tuple[str, ...]:
        """Buttons that the mission waits for or uses in decisions."""
        return tuple(dict.fromkeys(button for node in self.root.walk() for button in buttons_of(node)))

    @property
    def all_zones(self) -> tuple[Zone, ...]:
        """Zones of the whole mission, and of groups of steps in it."""
        groups = (node.options["zones"] for node in self.root.walk() if "zones" in node.options)
        return tuple(dict.fromkeys((*self.zones, *(zone for zones in groups for zone in zones))))

    @property
    def path_ids(self) -> tuple[str, ...]:
        """All path ids, parents first."""
        return tuple(node.path_id for node in self.root.walk())


def compile_mission(
    mission: Mission,
    *,
    knowledge: Knowledge,
    registry: Registry,
    last_known: LastKnown | None = None,
    reported: frozenset[str] = frozenset(),
) -> CompiledTree:
    """Compiles a mission to a tree and checks its wiring; each node has the line of the mission file that it is from.

    Args:
        mission: the mission; its robot and name become the first parts of the path ids.
        knowledge: the world's places, surfaces, objects and people.
        registry: the skills by name.
        last_known: where another robot last knew the mission's object; the search begins there.
        reported: the classes of the robot's own detector, which may be categories; empty for the default one.

    Raises InputError when there are no steps, a place, object or skill is unknown, ports are wired wrongly, or a
    command cannot be carried out; with the file and line where known, and all further errors in `others`.
    """
    if not mission.steps:
        raise InputError(f"the mission '{mission.name}' has no commands", hint="add at least one step")
    base, start = f"{slug(mission.robot_name)}/{slug(mission.name)}", start_key(mission.robot_name, mission.name)
    pick_ups = PICK_UPS if mission.pick_ups is None else mission.pick_ups
    options = (pick_ups, mission.move_aside or 0)
    assembler = Assembler(knowledge, registry, PLANS, start, *options, last_known=last_known, reported=reported)
    builder, steps = assembler.builder(base, mission.source), mission_plan(assembler, mission, base)
    root = watch_plan(builder, replace(whole_mission(mission, builder, steps.nodes), step=True))
    check_wiring(root)
    doors = tuple(doorway(knowledge, door) for door in knowledge.doors)
    tags, surfaces = knowledge.known_tags(), tuple(map(builder.surface, knowledge.tops))
    own = (mission.robot_name, mission.name, mission.commands, root, steps.parts, mission.steps)
    zones = knowledge.with_zones(mission.whole_zones).known_zones()
    return CompiledTree(*own, doors, tags, surfaces, zones)


def check_wiring(root: NodeSpec) -> None:
    """Checks all ports of a tree.

    Raises InputError for an input port without a value, an unknown port, a value of a wrong type, a blackboard key that
    no earlier node writes, an output bound to a port that the skill does not have, or a path id used twice.
    """
    written: dict[str, Any] = {}
    seen: set[str] = set()
    for node in root.walk():
        if node.path_id in seen:
            raise _error(node, "two nodes have this path id", "give the steps different names")
        seen.add(node.path_id)
        if node.skill is not None:
            for message, hint in _faults(node, written):
                raise _error(node, message, hint)
        written.update(writes(node))


def _faults(node: NodeSpec, written: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """Yields the errors in one skill's ports, with hints."""
    skill, inputs, outputs = (node.options[key] for key in ("skill", "inputs", "outputs"))
    types = field_types(skill.Inputs)
    for name in required_fields(skill.Inputs):
        if name not in inputs:
            yield f"input port '{name}' has no value", f"give it {with_article(describe_type(types[name]))}"
    for port, binding in inputs.items():
        if port not in types:
            yield f"there is no input port '{port}'", suggestion(port, types, f"known: {', '.join(types)}")
        else:
            for message in _misfit(port, binding, types[port], written):
                yield message, f"give it {with_article(describe_type(types[port]))}"
    for port in outputs:
        if port not in skill.outputs:
            yield f"there is no output port '{port}'", f"known: {', '.join(skill.outputs) or 'none'}"


def _misfit(port: str, binding: Binding, kind: Any, written: Mapping[str, Any]) -> Iterator[str]:
    """Yields the errors in one bound input."""
    if isinstance(binding, Constant) and not conforms(binding.value, kind):
        yield f"input port '{port}' got {binding.value!r}"
    if isinstance(binding, FromBoardOr) and not conforms(binding.default, kind):
        yield f"input port '{port}' has the default {binding.default!r}"
    if not isinstance(binding, FromBoard) or (isinstance(binding, FromBoardOr) and binding.key not in written):
        return
    if binding.key not in written:
        yield f"input port '{port}' reads '{binding.key}', which nothing before it writes"
        return
    given = binding.gives or written[binding.key]
    if not assignable(given, kind):
        yield f"input port '{port}' reads '{binding.key}', {with_article(describe_type(given))}"


def _error(node: NodeSpec, message: str, hint: str) -> InputError:
    return InputError.at(node.source, f"{node.path_id}: {message}", hint=hint)


PLANS: Final[StepPlans] = {model: plan for page in node_pages() for model, plan in getattr(page, "PLANS", {}).items()}


def build(spec: NodeSpec, context: RunContext) -> Behaviour:
    """Builds the py_trees node for a spec in one run, with all nodes below it."""
    if "zones" in spec.options:
        context = replace(context, zones=tuple(dict.fromkeys((*context.zones, *spec.options["zones"]))))
    children = [build(child, context) for child in spec.children]
    known = {**vars(context), "context": context, "children": children, "child": next(iter(children), None)}
    make: Any = spec.behaviour
    used = {each.name: known[each.name] for each in fields(make) if each.init and each.name in known}
    node: Behaviour = make(**{**used, **spec.options, "path_id": spec.path_id, "name": spec.name})
    return node


def writes(spec: NodeSpec) -> Mapping[str, Any]:
    """Returns the blackboard keys that a node writes, and the type of each value."""
    return spec.behaviour.writes(spec.options)
