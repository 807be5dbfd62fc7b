"""Builds the node specs of one step's subtree, and says what its parts are to bring about."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any, Final

from executive.mission.gripper import InGripper
from executive.tree.board import Constant, FromBoard
from executive.tree.node import NodeSpec
from executive.tree.nodes.recovery import Recovery, Trigger
from executive.tree.registry import missing
from executive.words.command import Command, Task
from executive.words.goal import GoalCondition
from executive.words.knowledge import ANYTHING, EVERYTHING, Knowledge, Pose
from executive.words.slug import slug
from skills.api import Cause, ObjectKind, Part, Skill, Surface
from skills.files.errors import InputError, SourceLine, suggestion
from skills.perception.class_forms import THING
from skills.robot import Pose2D

Registry = Mapping[str, type[Skill[Any]]]
STOW: Final = "stow"
PICK_UPS: Final = 2
"""How often what falls on the way is picked up again, unless a mission says otherwise."""


def start_key(robot_name: str, mission_name: str) -> str:
    """The blackboard key of the pose at which a mission began."""
    return f"{slug(robot_name)}/{slug(mission_name)}/start-pose"


def pose_2d(pose: Pose) -> Pose2D:
    """A pose of the knowledge file as the skills take it."""
    return Pose2D(pose.x, pose.y, pose.yaw)


def after(*causes: Cause, of: NodeSpec | None = None, own: bool = False) -> Trigger:
    """A trigger: failures with one of the causes of a node (the attempt as a whole when none is named)."""
    return Trigger(frozenset(causes), None if of is None else of.path_id, own)


@dataclass(frozen=True)
class StepPart:
    """A part of a mission with something to show for it: a command, or a skill on its own.

    `path_id` is that of its subtree, `node` that of its outermost node where it is another; `skill` the skill on its
    own, `goal` what it must bring about (None: nothing that a referee can see). `held` is what the gripper holds before
    it; with `opening`, that is what it held when the mission began.
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
    """Nodes in a row, and what they are to bring about, in order; of how many commands (`used`) they are made."""

    nodes: tuple[NodeSpec, ...] = ()
    parts: tuple[StepPart, ...] = ()
    used: int = 1

    def __add__(self, other: Assembled) -> Assembled:
        return Assembled(self.nodes + other.nodes, self.parts + other.parts)

    @property
    def node(self) -> NodeSpec:
        """The only node."""
        (node,) = self.nodes
        return node


@dataclass(frozen=True)
class PlanBuilder:
    """Makes the nodes of one step: `path_id` is the step's, `start_key` holds the pose at the mission's start.

    `anywhere` says whether an object that is not in its place is looked for elsewhere, too, but never on the surfaces
    in `avoided`: what lies there is where it is to go. With `in_gripper` an earlier step has grasped the object;
    `carried` is what an earlier step has grasped, whatever this one is about.
    What falls on the way is picked up again `pick_ups` times at most; of what stands in the way of an object that is to
    be taken, `move_aside` others are moved aside at most. `following` is the command right after this one.
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

    def at(self, *parts: str) -> PlanBuilder:
        """The builder of a subtree below."""
        return replace(self, path_id="/".join((self.path_id, *map(slug, parts))))

    def key(self, name: str) -> str:
        """A blackboard key of this subtree; whoever writes it and whoever reads it are given the same one."""
        return f"{self.path_id}/{name}"

    def node(self, kind: str, name: str, *children: NodeSpec, part: str = "", **options: Any) -> NodeSpec:
        """A node at this path id, or at the `part` below it."""
        path_id = f"{self.path_id}/{part}" if part else self.path_id
        return NodeSpec(kind, path_id, name, MappingProxyType(options), children, self.source)

    def sequence(self, name: str, *steps: NodeSpec, part: str = "") -> NodeSpec:
        """A sequence at this path id, or at the `part` below it."""
        return self.node("sequence", name, *steps, part=part)

    def skill(
        self,
        name: str,
        inputs: Mapping[str, object] | None = None,
        outputs: Mapping[str, str] | None = None,
        *,
        here: bool = False,
    ) -> NodeSpec:
        """A leaf that runs the registered skill `name`, below this path id or `here`; inputs that are no binding are
        constants, `outputs` are blackboard keys.

        Before a skill that moves the base and leaves the arm to others, the arm is brought in where it may be anywhere.
        Raises InputError: no skill of that name is registered.
        """
        if name not in self.registry:
            raise self.error(*missing(name, self.registry))
        skill = self.registry[name]
        bound = {port: v if isinstance(v, Constant | FromBoard) else Constant(v) for port, v in (inputs or {}).items()}
        drives = Part.BASE in skill.uses and Part.ARM not in skill.uses
        first = {"first": self.registry[STOW]} if drives and STOW in self.registry else {}
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
        """An attempt with recoveries, `attempts` at most; the blackboard keys in `forgets` are empty when it starts."""
        nodes, when = tuple(node for node, _ in recoveries), tuple(rule for _, rule in recoveries)
        options = {"recoveries": when, "attempts": attempts, "forgets": forgets}
        return self.node("recover", name, attempt, *nodes, part=part, **options)

    def tidied(self, work: NodeSpec, *, only_after_failure: bool = False) -> NodeSpec:
        """Work after which the arm is stowed, whatever came of it."""
        name = "stow the arm if it fails" if only_after_failure else "stow the arm in the end"
        return self.node("afterwards", name, work, self.skill(STOW), only_after_failure=only_after_failure)

    def pause(self, part: str, name: str, duration_s: float) -> NodeSpec:
        """A leaf that waits on the robot's clock."""
        return self.node("pause", name, part=part, duration_s=duration_s)

    def navigate(
        self,
        pose: Pose2D | FromBoard,
        to: str,
        *,
        exactly: bool = False,
        nearby_m: tuple[tuple[float, float], ...] = (),
    ) -> NodeSpec:
        """Drive to a pose, called `to`; where the path is blocked, see anew what stands there, then back off a little.

        With `exactly`, within 8 cm. Poses at `nearby_m` from it, forward and left, are tried afterwards.
        """
        ports: dict[str, object] = {"goal": pose, **({"position_tolerance_m": 0.08} if exactly else {})}
        if nearby_m and self.has_ports("navigate", ("nearby_m",)):
            ports["nearby_m"] = nearby_m
        drive, below = self.skill("navigate", ports), self.at("way")
        blocked = Recovery((after(Cause.PLANNING, Cause.EXECUTION, of=drive),))
        recoveries = ((below.skill("clear_costmap"), blocked), (below.skill("back_off"), blocked))
        return below.recover(f"go to {to}", drive, *recoveries, attempts=3)

    def has_ports(self, skill: str, inputs: tuple[str, ...] = (), outputs: tuple[str, ...] = ()) -> bool:
        """Returns whether a registered skill has these ports; a skill of others may lack what is not essential."""
        kind = self.registry.get(skill)
        if kind is None:
            return False
        known = {field.name for field in dataclasses.fields(kind.Inputs)}
        return known.issuperset(inputs) and set(kind.outputs).issuperset(outputs)

    def surface(self, name: str) -> Surface:
        """A surface of the knowledge file as the skills take it."""
        facts = self.knowledge.surfaces[name]
        return Surface(name=name, polygon_W=facts.polygon, height_m=facts.height)

    def place(self, name: str) -> str:
        """The known place that `name` means. Raises InputError: it is not known."""
        known = self.knowledge.place(name)
        if known is None:
            raise self.error(f"the place '{name}' is not known", suggestion(name, self.knowledge.place_names()))
        return known

    def classes(self, name: str) -> tuple[str, ...]:
        """The classes that an object's name stands for. Raises InputError: it is not known."""
        classes = self.knowledge.classes(self.knowledge.object_name(name) or name)
        if not classes:
            raise self.error(f"the object '{name}' is not known", suggestion(name, self.knowledge.object_names()))
        return classes

    def known(self, item: ObjectKind | None) -> ObjectKind:
        """The object that the command is about. Raises InputError: it names none, or none that is known."""
        if item is None:
            raise self.error("the command names no object", "say what it is about")
        self.classes(item.name)
        return item

    def sought(self, name: str) -> tuple[str, ...]:
        """What the robot looks for when it is to take an object of that name: its classes, or `THING` for any object.

        A question names what it finds, and so is about the known classes. Raises InputError: the name is not known.
        """
        classes = self.classes(name)
        unnamed = self.knowledge.object_name(name) in (ANYTHING, EVERYTHING)
        return (THING,) if unnamed and self.command.task is not Task.FIND else classes

    def error(self, message: str, hint: str) -> InputError:
        """An error at the step's line."""
        return InputError.at(self.source, f"{message} (in '{self.command}')", hint=hint)
