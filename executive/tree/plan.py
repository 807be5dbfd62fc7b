"""Builder of the node specs of one step's subtree, with the goal conditions of its parts."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any, Final

from executive.mission.gripper import InGripper
from executive.tree.board import Constant, FromBoard, LastKnown
from executive.tree.node import NodeSpec
from executive.tree.nodes.recovery import Recovery, Trigger
from executive.tree.registry import missing_skill
from executive.words.command import Command, Task
from executive.words.goal import GoalCondition
from executive.words.knowledge import ANYTHING, EVERYTHING, Knowledge, Pose
from executive.words.slug import slug
from skills.api import Cause, ObjectKind, Part, Skill, Surface
from skills.inputs.errors import InputError, SourceLine, suggestion
from skills.perception.class_forms import ANY_OBJECT
from skills.robot import Pose2D

Registry = Mapping[str, type[Skill[Any]]]
STOW: Final = "stow"
BACK_OFF: Final = "back_off"
_BLOCKED: Final = Recovery((Trigger(frozenset({Cause.PLANNING, Cause.EXECUTION}), "navigate"),))
NAVIGATE_RECOVERIES: Final[Mapping[str, Recovery]] = {"clear_costmap": _BLOCKED, BACK_OFF: _BLOCKED}
"""Recoveries of a blocked drive, by their skill before the next attempt."""
PICK_UPS: Final = 2
"""Number of times that a dropped object is picked up again, unless a mission says otherwise."""


def start_key(robot_name: str, mission_name: str) -> str:
    """Blackboard key of the pose at which a mission began."""
    return f"{slug(robot_name)}/{slug(mission_name)}/start-pose"


def pose_2d(pose: Pose) -> Pose2D:
    """Converts a pose of the knowledge file to the pose of the skills."""
    return Pose2D(pose.x, pose.y, pose.yaw)


def failure_trigger(*causes: Cause, of: NodeSpec | None = None, own: bool = False) -> Trigger:
    """Trigger of a recovery: a failure with one of the causes, of a node (None: of the whole attempt)."""
    return Trigger(frozenset(causes), None if of is None else of.path_id, own)


@dataclass(frozen=True)
class StepPart:
    """Part of a mission with a goal condition of its own: a command, or a single skill.

    `path_id` is the path id of its subtree, `node` that of its outermost node if it differs; `skill` is the single
    skill, `goal` the goal condition (None: none that a referee can judge). `held` is the object that the gripper holds
    before it; with `opening`, it is the object that the gripper held when the mission began.
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
    """Nodes in a row and their parts with goal conditions, in order, made of `used` commands."""

    nodes: tuple[NodeSpec, ...] = ()
    parts: tuple[StepPart, ...] = ()
    used: int = 1

    def __add__(self, other: Assembled) -> Assembled:
        return Assembled(self.nodes + other.nodes, self.parts + other.parts)

    @property
    def node(self) -> NodeSpec:
        """Node of an assembly that has exactly one."""
        (node,) = self.nodes
        return node


@dataclass(frozen=True)
class PlanBuilder:
    """Builder of the nodes of one step: `path_id` is the step's, `start_key` holds the pose at the mission's start.

    With `anywhere`, the robot searches for an object outside its place too, but never on the surfaces in `avoided`:
    objects there are at their goal. With `in_gripper`, an earlier step has grasped the object; `carried` is any object
    from an earlier step's grasp. The robot picks a dropped object up at most `pick_ups` times, and moves at most
    `move_aside` blocking objects aside. `following` is the next command. `last_known` is the place of the mission's
    object, as another robot last knew it. An earlier step has met the people in `met`.
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

    def at(self, *parts: str) -> PlanBuilder:
        """Returns the builder of a subtree below."""
        return replace(self, path_id="/".join((self.path_id, *map(slug, parts))))

    def key(self, name: str) -> str:
        """Returns a blackboard key of this subtree, for the node that writes it and the nodes that read it."""
        return f"{self.path_id}/{name}"

    def met_key(self, person: str, of: str = "") -> str:
        """Returns the blackboard key of a person as they were met last, the same in all steps of a mission."""
        return f"{self.start_key.rpartition('/')[0]}/met-{slug(person)}{of}"

    def node(self, kind: str, name: str, *children: NodeSpec, part: str = "", **options: Any) -> NodeSpec:
        """Builds a node at this path id, or at the `part` below it."""
        path_id = f"{self.path_id}/{part}" if part else self.path_id
        return NodeSpec(kind, path_id, name, MappingProxyType(options), children, self.source)

    def sequence(self, name: str, *steps: NodeSpec, part: str = "") -> NodeSpec:
        """Builds a sequence at this path id, or at the `part` below it."""
        return self.node("sequence", name, *steps, part=part)

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
        """Builds at most `attempts` attempts with recoveries; the first clears the blackboard keys in `forgets`.

        recover
        ├── attempt                          again after each successful recovery
        ├── recovery 1, if its rule fits     one after the other, until one succeeds
        └── recovery 2, if its rule fits
        """
        nodes, when = tuple(node for node, _ in recoveries), tuple(rule for _, rule in recoveries)
        options = {"recoveries": when, "attempts": attempts, "forgets": forgets}
        return self.node("recover", name, attempt, *nodes, part=part, **options)

    def stow_after(self, work: NodeSpec, *, only_after_failure: bool = False) -> NodeSpec:
        """Builds work and stows the arm after it, after any result or `only_after_failure`.

        afterwards        the result of the work
        ├── work
        └── stow
        """
        name = "stow the arm if it fails" if only_after_failure else "stow the arm in the end"
        return self.node("afterwards", name, work, self.skill(STOW), only_after_failure=only_after_failure)

    def pause(self, part: str, name: str, duration_s: float) -> NodeSpec:
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
        """Returns whether a registered skill has these ports; a user's skill may lack ports that are not essential."""
        kind = self.registry.get(skill)
        if kind is None:
            return False
        known = {field.name for field in dataclasses.fields(kind.Inputs)}
        return known.issuperset(inputs) and set(kind.outputs).issuperset(outputs)

    def optional_ports(self, skill: str, inputs: Mapping[str, object]) -> dict[str, object]:
        """Returns the inputs with a port of the registered skill; see `has_ports`."""
        return {port: value for port, value in inputs.items() if self.has_ports(skill, (port,))}

    def surface(self, name: str) -> Surface:
        """Converts a surface of the knowledge file to the surface of the skills."""
        facts = self.knowledge.surfaces[name]
        return Surface(name=name, polygon_W=facts.polygon, height_m=facts.height)

    def place(self, name: str) -> str:
        """Returns the known place that `name` means. Raises InputError when there is none."""
        known = self.knowledge.place(name)
        if known is None:
            raise self.error(f"the place '{name}' is not known", suggestion(name, self.knowledge.place_names()))
        return known

    def classes(self, name: str) -> tuple[str, ...]:
        """Returns the classes that an object's name stands for. Raises InputError for an unknown name."""
        classes = self.knowledge.classes(self.knowledge.object_name(name) or name)
        if not classes:
            raise self.error(f"the object '{name}' is not known", suggestion(name, self.knowledge.object_names()))
        return classes

    def last_known_of(self, item: ObjectKind) -> LastKnown | None:
        """Returns where an object was last known to be; None when nobody knows."""
        known = self.last_known
        return known if known is not None and known.kind.name in self.classes(item.name) else None

    def required_object(self, item: ObjectKind | None) -> ObjectKind:
        """Returns an object of the command. Raises InputError when the command names none, or an unknown one."""
        if item is None:
            raise self.error("the command names no object", "say what it is about")
        self.classes(item.name)
        return item

    def search_classes(self, name: str) -> tuple[str, ...]:
        """Returns the classes to search for an object of that name: its own, or `ANY_OBJECT` for any object.

        A question names the found objects, so it searches for known classes. Raises InputError for an unknown name.
        """
        classes = self.classes(name)
        unnamed = self.knowledge.object_name(name) in (ANYTHING, EVERYTHING)
        return (ANY_OBJECT,) if unnamed and self.command.task is not Task.FIND else classes

    def error(self, message: str, hint: str) -> InputError:
        """Builds an error at the step's line."""
        return InputError.at(self.source, f"{message} (in '{self.command}')", hint=hint)
