"""Recovery as plans: which remedy for which failure, and the nodes that carry it out."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from executive.tree.behaviours.composites import MemoryComposite
from executive.tree.behaviours.context import RunContext
from executive.tree.behaviours.leaves import Pause, SurfacesNear
from executive.tree.behaviours.recovery import Afterwards, OnlyIfHolding, OnlyIfKnown, Recover, Remedy, Trigger
from executive.tree.compiling.plans import NodePlan
from skills.api import Cause, Surface


@dataclass(frozen=True)
class RemedyPlan:
    """What to do after which failures, `uses` times at most."""

    node: NodePlan
    triggers: tuple[Trigger, ...]
    uses: int = 1


def after(*causes: Cause, of: NodePlan | str | None = None, own: bool = False) -> Trigger:
    """A trigger: failures with one of the causes of a node (the attempt as a whole when none is named)."""
    return Trigger(frozenset(causes), of.path_id if isinstance(of, NodePlan) else of, own)


@dataclass(frozen=True, kw_only=True)
class RecoverPlan(NodePlan):
    """An attempt with remedies, `attempts` at most; the blackboard keys in `forgets` are empty when it starts."""

    kind: ClassVar[str] = "recover"
    attempt: NodePlan
    remedies: tuple[RemedyPlan, ...]
    attempts: int
    forgets: tuple[str, ...] = ()

    @property
    def children(self) -> tuple[NodePlan, ...]:
        """The attempt, then the remedies."""
        return (self.attempt, *(remedy.node for remedy in self.remedies))

    @property
    def expected(self) -> tuple[NodePlan, ...]:
        """The attempt."""
        return (self.attempt,)

    def build(self, context: RunContext) -> Behaviour:
        """A Recover composite."""
        remedies = [Remedy(each.node.build(context), each.triggers, each.uses) for each in self.remedies]
        return Recover(
            path_id=self.path_id,
            name=self.name,
            attempt=self.attempt.build(context),
            remedies=remedies,
            attempts=self.attempts,
            forgets=self.forgets,
            board=context.board,
        )


@dataclass(frozen=True, kw_only=True)
class AfterwardsPlan(NodePlan):
    """Something, and what tidies up after it: always, or only after a failure."""

    kind: ClassVar[str] = "afterwards"
    first: NodePlan
    then: NodePlan
    only_after_failure: bool = False

    @property
    def children(self) -> tuple[NodePlan, ...]:
        """What is to be done, then what tidies up."""
        return (self.first, self.then)

    @property
    def expected(self) -> tuple[NodePlan, ...]:
        """What is to be done, and what tidies up unless that is only for failures."""
        return (self.first,) if self.only_after_failure else (self.first, self.then)

    def build(self, context: RunContext) -> MemoryComposite:
        """An Afterwards composite."""
        statuses = {Status.FAILURE} if self.only_after_failure else {Status.SUCCESS, Status.FAILURE}
        first, then = (child.build(context) for child in self.children)
        return Afterwards(path_id=self.path_id, name=self.name, first=first, then=then, after=frozenset(statuses))


@dataclass(frozen=True, kw_only=True)
class OnlyIfKnownPlan(NodePlan):
    """One way of a selector that is passed over while a blackboard key, of a value of some type, was not written."""

    kind: ClassVar[str] = "only if known"
    child: NodePlan
    key: str
    holds: type

    def writes(self) -> dict[str, object]:
        """The key: for the nodes below it is there."""
        return {self.key: self.holds}

    @property
    def children(self) -> tuple[NodePlan, ...]:
        """The one node below."""
        return (self.child,)

    def build(self, context: RunContext) -> MemoryComposite:
        """An OnlyIfKnown composite."""
        child = self.child.build(context)
        return OnlyIfKnown(path_id=self.path_id, name=self.name, child=child, key=self.key, board=context.board)


@dataclass(frozen=True, kw_only=True)
class OnlyIfHoldingPlan(NodePlan):
    """One way of a selector that is passed over while the gripper holds nothing."""

    kind: ClassVar[str] = "only if holding"
    child: NodePlan

    @property
    def children(self) -> tuple[NodePlan, ...]:
        """The one node below."""
        return (self.child,)

    @property
    def expected(self) -> tuple[NodePlan, ...]:
        """Nothing."""
        return ()

    def build(self, context: RunContext) -> MemoryComposite:
        """An OnlyIfHolding composite."""
        return OnlyIfHolding(path_id=self.path_id, name=self.name, child=self.child.build(context), robot=context.robot)


@dataclass(frozen=True, kw_only=True)
class PausePlan(NodePlan):
    """Waits on the robot's clock."""

    kind: ClassVar[str] = "pause"
    duration_s: float

    def build(self, context: RunContext) -> Pause:
        """A Pause leaf."""
        return Pause(path_id=self.path_id, name=self.name, duration_s=self.duration_s, clock=context.clock)


@dataclass(frozen=True, kw_only=True)
class SurfacesNearPlan(NodePlan):
    """Finds out which surfaces are near the robot; `otherwise` says what it means when there are none."""

    kind: ClassVar[str] = "surfaces near"
    surfaces: tuple[Surface, ...]
    within_m: float
    key: str
    otherwise: str

    def writes(self) -> dict[str, object]:
        """The surfaces."""
        return {self.key: tuple[Surface, ...]}

    def build(self, context: RunContext) -> SurfacesNear:
        """A SurfacesNear leaf."""
        return SurfacesNear(
            path_id=self.path_id,
            name=self.name,
            surfaces=self.surfaces,
            within_m=self.within_m,
            key=self.key,
            otherwise=self.otherwise,
            context=context,
        )
