"""The tree as immutable data: one small class for each kind of node, which knows how to build its behaviour.

A plan can be compared, shown and checked without a robot; `build` makes the py_trees node for one robot's run.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from py_trees.behaviour import Behaviour

from executive.tree.behaviours.answer import Answer, Tally
from executive.tree.behaviours.board import Binding
from executive.tree.behaviours.composites import MemoryRound, MemorySelector, MemorySequence
from executive.tree.behaviours.conditions import holding
from executive.tree.behaviours.context import RunContext
from executive.tree.behaviours.decorators import Guard, Retry, Timeout
from executive.tree.behaviours.leaves import RememberPose
from executive.tree.behaviours.skill_leaf import SkillLeaf
from skills.api import Cause, Skill
from skills.robot import Pose2D


@dataclass(frozen=True)
class Source:
    """The line of a mission file (from 1) that a node comes from."""

    file: Path
    line: int


@dataclass(frozen=True, kw_only=True)
class NodePlan:
    """One node: its path id, the name shown, where it comes from."""

    kind: ClassVar[str]
    path_id: str
    name: str
    source: Source | None = None

    @property
    def children(self) -> tuple[NodePlan, ...]:
        """The nodes below."""
        return ()

    @property
    def expected(self) -> tuple[NodePlan, ...]:
        """The nodes below that run, one after the other, when all goes well."""
        return self.children

    def writes(self) -> Mapping[str, Any]:
        """The blackboard keys that it writes, and the type of each value."""
        return {}

    def walk(self) -> Iterator[NodePlan]:
        """Itself and all nodes below, parents first."""
        yield self
        for child in self.children:
            yield from child.walk()

    def build(self, context: RunContext) -> Behaviour:
        """The py_trees node, with all nodes below it."""
        raise NotImplementedError


@dataclass(frozen=True, kw_only=True)
class _Composite(NodePlan):
    steps: tuple[NodePlan, ...]

    @property
    def children(self) -> tuple[NodePlan, ...]:
        """The nodes below, in order."""
        return self.steps

    def built(self, context: RunContext) -> list[Behaviour]:
        """The children's behaviours."""
        return [step.build(context) for step in self.steps]


@dataclass(frozen=True, kw_only=True)
class SequencePlan(_Composite):
    """One after the other, with memory."""

    kind: ClassVar[str] = "sequence"

    def build(self, context: RunContext) -> Behaviour:
        """A MemorySequence."""
        return MemorySequence(path_id=self.path_id, name=self.name, children=self.built(context))


@dataclass(frozen=True, kw_only=True)
class SelectorPlan(_Composite):
    """One way after the other until one works, with memory."""

    kind: ClassVar[str] = "selector"
    exhausted_cause: Cause | None = None
    exhausted_message: str = ""

    def build(self, context: RunContext) -> Behaviour:
        """A MemorySelector."""
        return MemorySelector(
            path_id=self.path_id,
            name=self.name,
            children=self.built(context),
            exhausted_cause=self.exhausted_cause,
            exhausted_message=self.exhausted_message,
        )


@dataclass(frozen=True, kw_only=True)
class RoundPlan(_Composite):
    """All ways, one after the other, whatever becomes of each; one that works is enough."""

    kind: ClassVar[str] = "round"

    def build(self, context: RunContext) -> Behaviour:
        """A MemoryRound."""
        return MemoryRound(path_id=self.path_id, name=self.name, children=self.built(context))


@dataclass(frozen=True, kw_only=True)
class SkillPlan(NodePlan):
    """A skill with its ports bound; `outputs` maps output ports to blackboard keys."""

    kind: ClassVar[str] = "skill"
    skill: type[Skill[Any]]
    inputs: tuple[tuple[str, Binding], ...] = ()
    outputs: tuple[tuple[str, str], ...] = ()
    limit_s: float

    def writes(self) -> Mapping[str, Any]:
        """The keys bound to its output ports."""
        return {key: self.skill.outputs.get(port, Any) for port, key in self.outputs}

    def build(self, context: RunContext) -> Behaviour:
        """A SkillLeaf."""
        return SkillLeaf(
            path_id=self.path_id,
            name=self.name,
            skill=self.skill,
            inputs=dict(self.inputs),
            outputs=dict(self.outputs),
            limit_s=self.limit_s,
            context=context,
        )


@dataclass(frozen=True, kw_only=True)
class RememberPosePlan(NodePlan):
    """Writes the robot's pose to the blackboard; with `keep`, one that stands there already stays."""

    kind: ClassVar[str] = "remember"
    key: str
    keep: bool = False

    def writes(self) -> Mapping[str, Any]:
        """The pose."""
        return {self.key: Pose2D}

    def build(self, context: RunContext) -> Behaviour:
        """A RememberPose leaf."""
        return RememberPose(path_id=self.path_id, name=self.name, key=self.key, context=context, keep=self.keep)


@dataclass(frozen=True, kw_only=True)
class DecoratorPlan(NodePlan):
    """A node with one node below."""

    child: NodePlan

    @property
    def children(self) -> tuple[NodePlan, ...]:
        """The one node below."""
        return (self.child,)


@dataclass(frozen=True, kw_only=True)
class RetryPlan(DecoratorPlan):
    """Up to `attempts` attempts, after failures of the given causes only, and not when the node `final` failed."""

    kind: ClassVar[str] = "retry"
    attempts: int
    causes: frozenset[Cause]
    final: str | None = None

    def build(self, context: RunContext) -> Behaviour:
        """A Retry decorator."""
        return Retry(
            path_id=self.path_id,
            name=self.name,
            child=self.child.build(context),
            attempts=self.attempts,
            causes=self.causes,
            final=self.final,
        )


@dataclass(frozen=True, kw_only=True)
class TimeoutPlan(DecoratorPlan):
    """A limit on the robot's clock."""

    kind: ClassVar[str] = "timeout"
    limit_s: float

    def build(self, context: RunContext) -> Behaviour:
        """A Timeout decorator."""
        child = self.child.build(context)
        return Timeout(path_id=self.path_id, name=self.name, child=child, limit_s=self.limit_s, clock=context.clock)


@dataclass(frozen=True, kw_only=True)
class HoldingPlan(DecoratorPlan):
    """A guard: the gripper holds `thing` as long as the nodes below run."""

    kind: ClassVar[str] = "guard"
    thing: str

    def build(self, context: RunContext) -> Behaviour:
        """A Guard with the condition Holding."""
        child, condition = self.child.build(context), holding(self.thing)
        return Guard(path_id=self.path_id, name=self.name, child=child, condition=condition, context=context)


@dataclass(frozen=True, kw_only=True)
class AnswerPlan(DecoratorPlan):
    """Turns the search below into a yes or no; `looks` names for each surface the leaves that look at it.

    One that `tells` says what was seen, too: where. One with `tallies` counts what each of the leaves saw, which is
    under the key beside it, and says how many; yes is then as many as `needed`.
    """

    kind: ClassVar[str] = "answer"
    question: str
    looks: tuple[tuple[str, tuple[str, ...]], ...]
    key: str
    tells: bool = False
    tallies: tuple[tuple[str, str], ...] = ()
    needed: int = 1

    def writes(self) -> Mapping[str, Any]:
        """The answer."""
        return {self.key: bool}

    def build(self, context: RunContext) -> Behaviour:
        """An Answer decorator."""
        return Answer(
            path_id=self.path_id,
            name=self.name,
            child=self.child.build(context),
            question=self.question,
            looks=dict(self.looks),
            key=self.key,
            board=context.board,
            publish=context.publish,
            tells=self.tells,
            tally=Tally(dict(self.tallies), self.needed) if self.tallies else None,
        )
