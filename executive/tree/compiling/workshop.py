"""What all subtrees of one mission share, and short ways to make their nodes."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from executive.mission.command import Command
from executive.mission.errors import InputError, did_you_mean, listing
from executive.mission.knowledge import Knowledge, Pose
from executive.tree.behaviours.board import Binding, Constant, FromBoard
from executive.tree.compiling.plans import NodePlan, SequencePlan, SkillPlan, Source
from executive.tree.compiling.recovery import RecoverPlan, RemedyPlan, after
from skills.api import Cause, Skill, Surface
from skills.robot import Pose2D

Registry = Mapping[str, type[Skill[Any]]]


def slug(text: str) -> str:
    """Text as one part of a path id: lower case, words joined by hyphens, no dots or slashes."""
    return re.sub(r"[^a-z0-9]+", "-", text.lower()).strip("-") or "unnamed"


def start_key(robot_name: str, mission_name: str) -> str:
    """The blackboard key of the pose at which a mission began."""
    return f"{slug(robot_name)}/{slug(mission_name)}/start-pose"


def pose_2d(pose: Pose) -> Pose2D:
    """A pose of the knowledge file as the skills take it."""
    return Pose2D(pose.x, pose.y, pose.yaw)


@dataclass(frozen=True)
class Workshop:
    """Makes the nodes of one step: `path_id` is the step's, `start_key` holds the pose at the mission's start.

    `anywhere` says whether a thing that is not in its place is looked for elsewhere, too, but never on the surfaces in
    `avoided`: what lies there is where it is to go.
    """

    knowledge: Knowledge
    registry: Registry
    path_id: str
    start_key: str
    command: Command
    source: Source | None
    anywhere: bool = True
    avoided: frozenset[str] = frozenset()

    def at(self, *parts: str) -> Workshop:
        """The same workshop for a subtree below."""
        return replace(self, path_id="/".join((self.path_id, *map(slug, parts))))

    def skill(
        self, name: str, inputs: Mapping[str, object] | None = None, outputs: Mapping[str, str] | None = None
    ) -> SkillPlan:
        """A leaf that runs the registered skill `name`; inputs that are no binding are constants.

        Raises:
            InputError: no skill of that name is registered.
        """
        if name not in self.registry:
            raise self.error(f"there is no skill '{name}'", f"registered are {listing(sorted(self.registry))}")
        skill = self.registry[name]
        return SkillPlan(
            path_id=f"{self.path_id}/{slug(name)}",
            name=name,
            source=self.source,
            skill=skill,
            inputs=tuple((port, _binding(value)) for port, value in (inputs or {}).items()),
            outputs=tuple((outputs or {}).items()),
            limit_s=skill.default_timeout_s,
        )

    def sequence(self, name: str, *steps: NodePlan) -> SequencePlan:
        """A sequence at this workshop's path id."""
        return SequencePlan(path_id=self.path_id, name=name, source=self.source, steps=steps)

    def navigate(self, pose: Pose2D | FromBoard, *, exactly: bool = False) -> NodePlan:
        """Drive to a pose; where the way is blocked, see anew what stands there, then back off a little.

        With `exactly`, within 8 cm.
        """
        ports = {"goal": pose, "position_tolerance_m": 0.08} if exactly else {"goal": pose}
        drive, below = self.skill("navigate", ports), self.at("way")
        return RecoverPlan(
            path_id=below.path_id,
            name="go there",
            source=self.source,
            attempt=drive,
            remedies=(
                RemedyPlan(below.skill("clear_costmap"), (after(Cause.PLANNING, Cause.EXECUTION, of=drive),)),
                RemedyPlan(below.skill("back_off"), (after(Cause.PLANNING, Cause.EXECUTION, of=drive),)),
            ),
            attempts=3,
        )

    def has_ports(self, skill: str, inputs: tuple[str, ...] = (), outputs: tuple[str, ...] = ()) -> bool:
        """Whether a registered skill has these ports; a skill of others may lack what is not essential."""
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
        """The known place that `name` means.

        Raises:
            InputError: it is not known.
        """
        known = self.knowledge.place(name)
        if known is None:
            near = did_you_mean(name, self.knowledge.place_names())
            mend = f"did you mean '{near}'?" if near else f"known are {listing(self.knowledge.place_names())}"
            raise self.error(f"the place '{name}' is not known", mend)
        return known

    def classes(self, name: str) -> tuple[str, ...]:
        """The classes that a thing's name stands for.

        Raises:
            InputError: it is not known.
        """
        classes = self.knowledge.classes(self.knowledge.thing(name) or name)
        if not classes:
            near = did_you_mean(name, self.knowledge.thing_names())
            mend = f"did you mean '{near}'?" if near else f"known are {listing(self.knowledge.thing_names())}"
            raise self.error(f"the thing '{name}' is not known", mend)
        return classes

    def error(self, message: str, mend: str) -> InputError:
        """An error at the step's line."""
        text = f"{message} (in '{self.command}')"
        if self.source is None:
            return InputError(text, mend=mend)
        return InputError(text, mend=mend, file=self.source.file, line=self.source.line)


def _binding(value: object) -> Binding:
    return value if isinstance(value, Constant | FromBoard) else Constant(value)
