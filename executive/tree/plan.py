"""Builder of the node specs of one step's subtree, with the goal conditions of its parts.

The methods of `PlanBuilder` from `sequence` to `navigate` are the shapes of which all plans are made.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import MISSING, dataclass, fields, replace
from types import MappingProxyType
from typing import Any, Final

from executive.mission.gripper import InGripper
from executive.mission.world_names import in_world
from executive.tree.board import Constant, FromBoard, LastKnown
from executive.tree.context import RunContext
from executive.tree.node import NodeSpec, node_classes
from executive.tree.nodes.guard import Condition
from executive.tree.nodes.recovery import Recovery, Trigger
from executive.tree.registry import missing_skill
from executive.words.command import START, Command
from executive.words.expression import Value
from executive.words.goal import GoalCondition
from executive.words.knowledge import ANYTHING, EVERYTHING, Knowledge
from executive.words.slug import slug
from skills.api import Cause, ObjectKind, Part, Skill, Surface
from skills.class_forms import ANY_OBJECT
from skills.inputs.errors import InputError, SourceLine, suggestion
from skills.relations import Relation
from skills.robot import Pose2D

Registry = Mapping[str, type[Skill[Any]]]
STOW: Final = "stow"
BACK_OFF: Final = "back_off"
_BLOCKED: Final = Recovery((Trigger(frozenset({Cause.PLANNING, Cause.EXECUTION}), "navigate"),))
NAVIGATE_RECOVERIES: Final[Mapping[str, Recovery]] = {"clear_costmap": _BLOCKED, BACK_OFF: _BLOCKED}
"""Recoveries of a blocked drive, by their skill before the next attempt."""
MOMENT_S: Final = 0.5
PICK_UPS: Final = 2
"""Number of times that a dropped object is picked up again, unless a mission says otherwise."""


def start_key(robot_name: str, mission_name: str) -> str:
    """Blackboard key for the pose at which a mission began."""
    return f"{slug(robot_name)}/{slug(mission_name)}/start-pose"


@dataclass(frozen=True)
class StepPart:
    """Step of a mission that may have a goal condition: a command, or a single skill.

    `path_id` is the path id of the subtree, `node` that of the outermost node if it differs; `skill` is the single
    skill, `goal` the goal condition (None: a referee cannot judge the step). `held` is the object in the gripper before
    the step; with `opening`, it is the object that the gripper held when the mission began.
    """

    path_id: str
    command: Command | None = None
    skill: type[Skill[Any]] | None = None
    goal: GoalCondition | None = None
    held: InGripper | None = None
    opening: bool = True
    node: str = ""


@dataclass(frozen=True)
class Assembled:
    """Nodes in sequence and their steps with goal conditions, built from the first `used` commands."""

    nodes: tuple[NodeSpec, ...] = ()
    parts: tuple[StepPart, ...] = ()
    used: int = 1

    def __add__(self, other: Assembled) -> Assembled:
        return Assembled(self.nodes + other.nodes, self.parts + other.parts)

    @property
    def node(self) -> NodeSpec:
        """Node of an assembly that has exactly one node."""
        (node,) = self.nodes
        return node


def plan_faults(plan: NodeSpec) -> Iterator[str]:
    """Yields the faults of a plan's nodes by which its tree cannot be built; none behind one of an unknown kind."""
    seen, given = set[str](), {"path_id", "name", "context", *(each.name for each in fields(RunContext))}
    for node in plan.walk():
        behaviour = node_classes().get(node.kind) if isinstance(node, NodeSpec) else None
        if behaviour is None:
            yield f"there is no node of kind '{node.kind}'" if isinstance(node, NodeSpec) else f"{node!r} is no node"
            return
        named, known = f"the {node.kind} '{node.name}'", {each.name: each for each in fields(behaviour) if each.init}
        needed = {name for name, each in known.items() if each.default is MISSING is each.default_factory} - given
        if needed & {"child", "children"} and not node.children:
            yield f"{named} has no steps"
        lacks = sorted(needed - {"child", "children"} - node.options.keys())
        yield from (f"{named} lacks the option '{each}'" for each in lacks)
        yield from (f"{named} has no option '{each}'" for each in node.options if each not in known)
        if node.path_id in seen:
            yield f"two nodes have the path id '{node.path_id}'; build one below another, by builder.at"
        seen.add(node.path_id)


@dataclass(frozen=True)
class PlanBuilder:
    """Builder of one step's nodes: `path_id` is the step's path id, `start_key` the key for the mission's start pose.

    With `anywhere`, the robot also searches outside the named place, but never on the surfaces in `avoided`, where
    objects are at their goal. With `in_gripper`, an earlier step has grasped the command's object; `carried` is any
    object that an earlier step has grasped. The robot picks up a dropped object at most `pick_ups` times, and moves at
    most `move_aside` blocking objects aside. `following` is the next command. `last_known` is where another robot last
    knew the mission's object. An earlier step has met the people in `met`.
    `reported` are the classes of the robot's own detector, which may be categories; empty for the default one.
    """

    knowledge: Knowledge
    registry: Registry
    path_id: str
    start_key: str
    command: Command
    source: SourceLine | None
    anywhere: bool = True
    avoided: frozenset[str] = frozenset()
    in_gripper: bool = False
    carried: ObjectKind | None = None
    pick_ups: int = PICK_UPS
    move_aside: int = 0
    following: Command | None = None
    last_known: LastKnown | None = None
    met: frozenset[str] = frozenset()
    reported: frozenset[str] = frozenset()

    def at(self, *parts: str) -> PlanBuilder:
        """Returns a builder for a subtree below this one."""
        return replace(self, path_id="/".join((self.path_id, *map(slug, parts))))

    def key(self, name: str) -> str:
        """Returns a blackboard key of this subtree, for the node that writes it and the nodes that read it."""
        return f"{self.path_id}/{name}"

    def met_key(self, person: str, of: str = "") -> str:
        """Returns the blackboard key for the last observation of a person; all steps of a mission use the same key."""
        return f"{self.start_key.rpartition('/')[0]}/met-{slug(person)}{of}"

    def node(self, kind: str, name: str, *children: NodeSpec, part: str = "", **options: Any) -> NodeSpec:
        """Builds a node at this path id, or at the `part` below it."""
        path_id = f"{self.path_id}/{part}" if part else self.path_id
        return NodeSpec(kind, path_id, name, MappingProxyType(options), children, self.source)

    def sequence(self, name: str, *steps: NodeSpec, part: str = "") -> NodeSpec:
        """Does one step after the other, until one fails, at this path id or at the `part` below it."""
        return self.node("sequence", name, *steps, part=part)

    def first_of(self, name: str, *candidates: NodeSpec, part: str = "", **options: Any) -> NodeSpec:
        """Tries the next candidate when one fails, until one succeeds.

        selector
        ├── candidate
        └── next candidate, after its failure
        """
        return self.node("selector", name, *candidates, part=part, **options)

    def or_stay(self, name: str, attempt: NodeSpec, stay: str, *, pause: str = "stay", part: str = "") -> NodeSpec:
        """Tries something that need not succeed; `stay` says what follows its failure.

        selector
        ├── attempt
        └── pause, after its failure
        """
        return self.first_of(name, attempt, self.pause(pause, stay), part=part)

    def guarded(self, name: str, work: NodeSpec, condition: Condition, *, part: str = "") -> NodeSpec:
        """Does work while a condition holds.

        guard
        └── work, halted when the condition is violated
        """
        return self.node("guard", name, work, part=part, condition=condition)

    def retried(
        self, name: str, work: NodeSpec, attempts: int, causes: frozenset[Cause], *, part: str = ""
    ) -> NodeSpec:
        """Does work again after a failure with one of the causes.

        retry
        └── work, `attempts` times at most
        """
        return self.node("retry", name, work, part=part, attempts=attempts, causes=causes)

    def if_holding(self, name: str, work: NodeSpec, *, part: str = "", **known: tuple[str, ...]) -> NodeSpec:
        """Does work only with an object in the gripper; a selector passes over it without one.

        only if holding
        └── work
        """
        return self.node("only if holding", name, work, part=part, **known)

    def chosen(
        self, name: str, decides: NodeSpec, branches: Mapping[Value, NodeSpec], key: str, *, part: str = ""
    ) -> NodeSpec:
        """Decides or asks, and goes on by the answer under `key`.

        choose
        ├── decision or question
        └── branch of the answer, if it has one
        """
        numbers = {answer: number for number, answer in enumerate(branches, start=1)}
        options = {"branches": MappingProxyType(numbers), "key": key}
        return self.node("choose", name, decides, *branches.values(), part=part, **options)

    def look_from(self, name: str, pose: Pose2D | FromBoard, to: str, look: NodeSpec) -> NodeSpec:
        """Drives to a viewpoint, called `to`, and looks.

        sequence
        ├── drive
        └── look
        """
        return self.sequence(name, self.navigate(pose, to), look)

    def skill(
        self,
        name: str,
        inputs: Mapping[str, object] | None = None,
        outputs: Mapping[str, str] | None = None,
        *,
        here: bool = False,
    ) -> NodeSpec:
        """Builds a leaf that runs the skill `name`, below this path id or `here`. Inputs that are no bindings are
        constants; `outputs` are blackboard keys.

        Before a skill that moves the base but not the arm, the leaf stows the arm if it may be anywhere; where the arm
        has no free path, the robot backs off before it stows again. Raises InputError when no skill of that name is
        registered.
        """
        if name not in self.registry:
            raise self.error(*missing_skill(name, self.registry))
        skill = self.registry[name]
        bound = {port: v if isinstance(v, Constant | FromBoard) else Constant(v) for port, v in (inputs or {}).items()}
        drives = Part.BASE in skill.uses and Part.ARM not in skill.uses
        stowing = (STOW,) if name == BACK_OFF or BACK_OFF not in self.registry else (STOW, BACK_OFF, STOW)
        first = {"first": tuple(map(self.registry.__getitem__, stowing))} if drives and STOW in self.registry else {}
        ports = {"inputs": MappingProxyType(bound), "outputs": MappingProxyType(dict(outputs or {}))}
        options = {"skill": skill, **ports, "limit_s": skill.default_timeout_s, **first}
        return self.node("skill", name, part="" if here else slug(name), **options)

    def recover(
        self,
        name: str,
        attempt: NodeSpec,
        *recoveries: tuple[NodeSpec, Recovery],
        attempts: int,
        part: str = "",
        forgets: tuple[str, ...] = (),
    ) -> NodeSpec:
        """Makes at most `attempts` attempts with recoveries; the first clears the blackboard keys in `forgets`.

        recover
        ├── attempt
        └── recovery for its failure; then the attempt begins again
        """
        nodes, when = tuple(node for node, _ in recoveries), tuple(rule for _, rule in recoveries)
        options = {"recoveries": when, "attempts": attempts, "forgets": forgets}
        return self.node("recover", name, attempt, *nodes, part=part, **options)

    def tidied(
        self, name: str, work: NodeSpec, tidying: NodeSpec, *, only_after_failure: bool = False, part: str = ""
    ) -> NodeSpec:
        """Does work, and tidies up after any result of it, or `only_after_failure`.

        afterwards
        ├── work
        └── tidying
        """
        return self.node("afterwards", name, work, tidying, part=part, only_after_failure=only_after_failure)

    def stow_after(self, work: NodeSpec, name: str = "", *, only_after_failure: bool = False) -> NodeSpec:
        """Stows the arm after work, like `tidied`; the node has by default the name of the work."""
        return self.tidied(name or work.name, work, self.skill(STOW), only_after_failure=only_after_failure)

    def pause(self, part: str, name: str, duration_s: float = MOMENT_S) -> NodeSpec:
        """Builds a leaf that waits on the robot's clock."""
        return self.node("pause", name, part=part, duration_s=duration_s)

    def navigate(
        self,
        pose: Pose2D | FromBoard,
        to: str,
        *,
        exactly: bool = False,
        nearby_m: tuple[tuple[float, float], ...] = (),
    ) -> NodeSpec:
        """Builds a drive to a pose, called `to`, with `NAVIGATE_RECOVERIES`; with `exactly`, within 8 cm of the pose.

        Poses at `nearby_m` from it, forward and left, are tried afterwards.

            recover, up to 3 attempts
            ├── navigate
            ├── clear_costmap    once, after a failure with PLANNING or EXECUTION
            └── back_off         once, the same
        """
        ports: dict[str, object] = {"goal": pose, **({"position_tolerance_m": 0.08} if exactly else {})}
        ports |= self.optional_ports("navigate", {"nearby_m": nearby_m}) if nearby_m else {}
        drive, below = self.skill("navigate", ports), self.at("way")
        paths = {"navigate": drive.path_id}
        recoveries = [(below.skill(skill), rule.bind(paths)) for skill, rule in NAVIGATE_RECOVERIES.items()]
        return below.recover(f"go to {to}", drive, *recoveries, attempts=3)

    def has_ports(self, skill: str, inputs: tuple[str, ...] = (), outputs: tuple[str, ...] = ()) -> bool:
        """Returns whether a registered skill has these ports; a user's skill may lack inessential ports."""
        kind = self.registry.get(skill)
        if kind is None:
            return False
        known = {field.name for field in fields(kind.Inputs)}
        return known.issuperset(inputs) and set(kind.outputs).issuperset(outputs)

    def optional_ports(self, skill: str, inputs: Mapping[str, object]) -> dict[str, object]:
        """Returns those inputs for which the registered skill has a port; see `has_ports`."""
        return {port: value for port, value in inputs.items() if self.has_ports(skill, (port,))}

    def surface(self, name: str) -> Surface:
        """Converts a surface from the knowledge file to the surface type of the skills."""
        return self.knowledge.surfaces[name].surface(name)

    def relations(self, relations: tuple[Relation, ...]) -> dict[str, object]:
        """Returns the port for the relations of an object or a spot on a surface; none without such relations.

        Raises InputError when a landmark cannot be told.
        """
        try:
            meant = in_world(relations, self.knowledge, self.command.goal)
        except ValueError as error:
            raise self.error(str(error), "name a surface, an object or a person") from error
        return {"relations": meant} if meant else {}

    def place(self, name: str) -> str:
        """Returns the known place that `name` means, or the room of the start. Raises InputError when there is none."""
        known = self.knowledge.room(START) if name == START else self.knowledge.place(name)
        if known is None:
            raise self.error(f"the place '{name}' is not known", suggestion(name, self.knowledge.place_names()))
        return known

    def classes(self, name: str) -> tuple[str, ...]:
        """Returns the classes that an object's name includes. Raises InputError for an unknown name."""
        classes = self.knowledge.classes(name)
        if not classes:
            raise self.error(f"the object '{name}' is not known", suggestion(name, self.knowledge.object_names()))
        return classes

    def last_known_of(self, item: ObjectKind) -> LastKnown | None:
        """Returns where an object was last known to be; None if no robot knows."""
        known = self.last_known
        return known if known is not None and known.kind.name in self.classes(item.name) else None

    def required_object(self, item: ObjectKind | None) -> ObjectKind:
        """Returns the object that the command must name. Raises InputError when the name is missing or unknown."""
        if item is None:
            raise self.error("the command names no object", "say what it is about")
        self.classes(item.name)
        return item

    def search_classes(self, name: str) -> tuple[str, ...]:
        """Returns the classes to search for an object by its name; `ANY_OBJECT` if the name stands for any object.

        A category that the detector reports stands for those of its classes that the detector does not. A question
        searches for known classes, because its answer names the found objects. Raises InputError for an unknown name.
        """
        classes = self.classes(name)
        unnamed = self.knowledge.object_name(name) in (ANYTHING, EVERYTHING)
        if name in self.reported:
            return tuple(dict.fromkeys((*(one for one in classes if one in self.reported), name)))
        return (ANY_OBJECT,) if unnamed and not self.command.looks else classes

    def error(self, message: str, hint: str) -> InputError:
        """Builds an error that names the step's line."""
        return InputError.at(self.source, f"{message} (in '{self.command}')", hint=hint)
