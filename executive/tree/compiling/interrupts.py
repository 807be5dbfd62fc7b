"""The root of every mission's tree: what is watched, in order of priority, and what is done about it.

stop button > lost lease > battery low > localisation lost > mission
"""

from __future__ import annotations

from typing import Final

from executive.tree.behaviours.board import FromBoard
from executive.tree.behaviours.conditions import BatteryForWork, KnowsPlace, NoStopButton, OwnLease
from executive.tree.behaviours.recovery import Recovery
from executive.tree.compiling.builder import PlanBuilder, after, pose_2d
from executive.tree.node import NodeSpec
from executive.words.knowledge import Pose
from skills.api import Cause
from skills.robot import Pose2D

HANDLING: Final = frozenset({"grasp", "place", "hand_over", "stow"})
"""Skills that an interrupt lets come to their end, since an object is half held meanwhile."""
MOST_CHARGES: Final = 5
MOST_RELOCALISATIONS: Final = 5
LOST_PATIENCE_S: Final = 2.0


def watched(builder: PlanBuilder, mission: NodeSpec) -> NodeSpec:
    """The mission under its watches, the last node below; `builder` is the mission's own.

    Raises InputError: a skill that the watches need is not registered.
    """
    below = builder.at("watch")
    watches = (
        below.node("monitor", "stop button released", part="stop-button", condition=NoStopButton()),
        below.node("monitor", "lease held", part="lease", condition=OwnLease()),
        *([] if builder.knowledge.dock is None else [_battery_plan(below.at("battery"), builder.knowledge.dock)]),
        _lost_plan(below.at("lost")),
    )
    return below.node("interrupts", f"{mission.name}, watched", *watches, mission)


def _battery_plan(builder: PlanBuilder, place: Pose) -> NodeSpec:
    """To the dock, charge, and back to where it was; urgent when half of what it is called for is left."""
    facts, dock = builder.knowledge.battery, pose_2d(place)
    key = builder.key("where")
    work = builder.at("charge").sequence(
        f"charge to {facts.charged:.0%}",
        builder.node("remember", "where it was", part="remember", key=key),
        builder.skill("stow"),
        dock_plan(builder.at("dock"), dock, facts.charged),
        builder.at("back").navigate(FromBoard(key), "where it was"),
    )
    return builder.node(
        "interrupt",
        "battery low: charge",
        _relocalising(builder.at("lost"), work),
        spares=HANDLING,
        uses=MOST_CHARGES,
        condition=BatteryForWork(facts.low, dock),
        urgent=BatteryForWork(0.5 * facts.low, dock),
    )


def dock_plan(builder: PlanBuilder, dock: Pose2D, level: float) -> NodeSpec:
    """Stand on the dock and charge; where it does not charge, back off and dock again."""
    charge = builder.skill("charge", {"level": level})
    attempt = builder.at("attempt").sequence(
        "dock and charge", builder.navigate(dock, "the dock", exactly=True), charge
    )
    again = Recovery((after(Cause.POSTCONDITION, of=charge),), uses=2)
    return builder.recover("charge at the dock", attempt, (builder.at("again").skill("back_off"), again), attempts=3)


def _relocalising(builder: PlanBuilder, work: NodeSpec) -> NodeSpec:
    """Work after which the robot finds out where it is when it did not know, and works on."""
    lost = Recovery((after(Cause.PRECONDITION, Cause.EXECUTION),))
    return builder.recover("know where it is", work, (builder.skill("relocalise"), lost), attempts=2)


def _lost_plan(builder: PlanBuilder) -> NodeSpec:
    settle = builder.pause("settle", "stand still", 0.5)
    find_out = builder.at("find-out").sequence("find out where it is", settle, builder.skill("relocalise"))
    return builder.node(
        "interrupt",
        "localisation lost: find out where it is",
        find_out,
        spares=HANDLING,
        uses=MOST_RELOCALISATIONS,
        condition=KnowsPlace(patience_s=LOST_PATIENCE_S),
    )
