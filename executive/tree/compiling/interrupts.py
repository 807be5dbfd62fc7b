"""The root of every mission's tree: what is watched, in order of priority, and what is done about it.

stop button > lost lease > battery low > localisation lost > mission
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar, Final

from py_trees.behaviour import Behaviour

from executive.tree.behaviours.board import FromBoard
from executive.tree.behaviours.conditions import Condition, LeaseHeld, StopReleased, battery_reserve, localised
from executive.tree.behaviours.context import RunContext
from executive.tree.behaviours.interrupts import Call, Interrupt, Interrupts, Monitor
from executive.tree.compiling.plans import NodePlan, RememberPosePlan
from executive.tree.compiling.recovery import PausePlan, RecoverPlan, RemedyPlan, after
from executive.tree.compiling.workshop import Workshop, pose_2d
from skills.api import Cause
from skills.robot import Pose2D

HANDLING: Final = frozenset({"grasp", "place", "hand_over", "stow"})
"""Skills that an interrupt lets come to their end, since a thing is half held meanwhile."""
MOST_CHARGES: Final = 5
MOST_RELOCALISATIONS: Final = 5


@dataclass(frozen=True, kw_only=True)
class MonitorPlan(NodePlan):
    """A condition that ends or holds the mission; `condition` makes the object that looks at it in one run."""

    kind: ClassVar[str] = "monitor"
    condition: Callable[[], Condition]

    def build(self, context: RunContext) -> Monitor:
        """A Monitor leaf."""
        return Monitor(path_id=self.path_id, name=self.name, condition=self.condition(), context=context)


@dataclass(frozen=True, kw_only=True)
class InterruptPlan(NodePlan):
    """Work that the mission is interrupted for."""

    kind: ClassVar[str] = "interrupt"
    child: NodePlan
    spares: frozenset[str]
    uses: int

    @property
    def children(self) -> tuple[NodePlan, ...]:
        """The work."""
        return (self.child,)

    def call(self) -> Call:
        """What calls it, for one run."""
        raise NotImplementedError

    def build(self, context: RunContext) -> Interrupt:
        """An Interrupt decorator."""
        return Interrupt(
            path_id=self.path_id,
            name=self.name,
            child=self.child.build(context),
            call=self.call(),
            spares=self.spares,
            uses=self.uses,
            context=context,
        )


@dataclass(frozen=True, kw_only=True)
class BatteryPlan(InterruptPlan):
    """The battery is below `low` (0 to 1), or has too little left for the way to the dock."""

    low: float
    dock: Pose2D

    def call(self) -> Call:
        """Low; urgent at half of it."""
        return Call(battery_reserve(self.low, self.dock), battery_reserve(0.5 * self.low, self.dock))


@dataclass(frozen=True, kw_only=True)
class LostPlan(InterruptPlan):
    """The robot has not known where it is for longer than `patience_s`."""

    patience_s: float

    def call(self) -> Call:
        """Lost."""
        return Call(localised(self.patience_s))


@dataclass(frozen=True, kw_only=True)
class InterruptsPlan(NodePlan):
    """Watches by priority above the mission."""

    kind: ClassVar[str] = "interrupts"
    watches: tuple[MonitorPlan | InterruptPlan, ...]
    mission: NodePlan

    @property
    def children(self) -> tuple[NodePlan, ...]:
        """The watches, then the mission."""
        return (*self.watches, self.mission)

    @property
    def expected(self) -> tuple[NodePlan, ...]:
        """The mission."""
        return (self.mission,)

    def build(self, context: RunContext) -> Behaviour:
        """An Interrupts composite."""
        watches = [watch.build(context) for watch in self.watches]
        mission = self.mission.build(context)
        return Interrupts(path_id=self.path_id, name=self.name, watches=watches, mission=mission)


def watched(shop: Workshop, mission: NodePlan) -> InterruptsPlan:
    """The mission under its watches; `shop` is the mission's own.

    Raises:
        InputError: a skill that the watches need is not registered.
    """
    below = shop.at("watch")
    return InterruptsPlan(
        path_id=below.path_id,
        source=shop.source,
        name=f"{mission.name}, watched",
        watches=(
            _monitor(below.at("stop-button"), "stop button released", StopReleased),
            _monitor(below.at("lease"), "lease held", LeaseHeld),
            _battery_plan(below.at("battery")),
            _lost_plan(below.at("lost")),
        ),
        mission=mission,
    )


def _monitor(shop: Workshop, name: str, condition: Callable[[], Condition]) -> MonitorPlan:
    return MonitorPlan(path_id=shop.path_id, name=name, source=shop.source, condition=condition)


def _battery_plan(shop: Workshop) -> BatteryPlan:
    """To the dock, charge, and back to where it was."""
    facts, dock = shop.knowledge.battery, pose_2d(shop.knowledge.dock)
    key = f"{shop.path_id}/where"
    remember = RememberPosePlan(path_id=f"{shop.path_id}/remember", name="where it was", source=shop.source, key=key)
    work = shop.at("charge").sequence(
        f"charge to {facts.charged:.0%}",
        remember,
        shop.skill("stow"),
        _dock_plan(shop.at("dock"), dock, facts.charged),
        shop.at("back").navigate(FromBoard(key)),
    )
    return BatteryPlan(
        path_id=shop.path_id,
        source=shop.source,
        name="battery low: charge",
        child=relocalising(shop.at("lost"), work),
        spares=HANDLING,
        uses=MOST_CHARGES,
        low=facts.low,
        dock=dock,
    )


def _dock_plan(shop: Workshop, dock: Pose2D, level: float) -> RecoverPlan:
    """Stand on the dock and charge; where it does not charge, back off and dock again."""
    charge = shop.skill("charge", {"level": level})
    attempt = shop.at("attempt").sequence("dock and charge", shop.navigate(dock, exactly=True), charge)
    back_off = shop.at("again").skill("back_off")
    return RecoverPlan(
        path_id=shop.path_id,
        source=shop.source,
        name="charge at the dock",
        attempt=attempt,
        remedies=(RemedyPlan(back_off, (after(Cause.POSTCONDITION, of=charge),), uses=2),),
        attempts=3,
    )


def relocalising(shop: Workshop, work: NodePlan) -> RecoverPlan:
    """Work after which the robot finds out where it is when it did not know, and works on."""
    find_out = shop.skill("relocalise")
    causes = (Cause.PRECONDITION, Cause.EXECUTION)
    return RecoverPlan(
        path_id=shop.path_id,
        source=shop.source,
        name="know where it is",
        attempt=work,
        remedies=(RemedyPlan(find_out, (after(*causes),)),),
        attempts=2,
    )


def _lost_plan(shop: Workshop) -> LostPlan:
    settle = PausePlan(path_id=f"{shop.path_id}/settle", name="stand still", source=shop.source, duration_s=0.5)
    find_out = shop.at("find-out").sequence("find out where it is", settle, shop.skill("relocalise"))
    return LostPlan(
        path_id=shop.path_id,
        source=shop.source,
        name="place lost: find out where it is",
        child=find_out,
        spares=HANDLING,
        uses=MOST_RELOCALISATIONS,
        patience_s=2.0,
    )
