"""Plans charging at the dock, for the command and for the block."""

import math
from dataclasses import replace
from typing import Final

from executive.tree.assembly import Assembler, StepPlans
from executive.tree.board import FromBoard
from executive.tree.goals import command_goal
from executive.tree.node import NodeSpec
from executive.tree.nodes.recovery import Recovery, Trigger
from executive.tree.plan import Assembled, PlanBuilder, StepPart
from executive.words import leaf_steps as model
from executive.words.command import Command
from executive.words.knowledge import DOCK
from executive.words.task import basic
from skills.api import Cause
from skills.inputs.errors import InputError
from skills.robot import Pose2D

_BEFORE_M: Final = 0.7
"""Additional distance from the tag, compared with the docked pose, at which the robot looks for it."""


def dock_plan(builder: PlanBuilder, dock: Pose2D, level: float) -> NodeSpec:
    """Docks and charges; if the robot does not charge, it backs off and docks again."""
    charge = builder.skill("charge", {"level": level})
    attempt = builder.at("attempt").sequence("dock and charge", *_onto_dock(builder, dock), charge)
    again = Recovery((Trigger(frozenset({Cause.POSTCONDITION}), charge.path_id),), uses=2)
    return builder.recover("charge at the dock", attempt, (builder.at("again").skill("back_off"), again), attempts=3)


def _onto_dock(builder: PlanBuilder, dock: Pose2D) -> tuple[NodeSpec, ...]:
    """Drives onto the dock; if the dock has a tag, first to a pose from which the cameras see the tag."""
    tag = next((tag for tag in builder.knowledge.known_tags() if tag.on == DOCK), None)
    if tag is None or "locate_dock" not in builder.registry:
        return (builder.navigate(dock, "the dock", exactly=True),)
    key, below = builder.key("dock-pose"), builder.at("before")
    look = below.skill("locate_dock", {"tag": tag, "dock": dock}, {"dock": key})
    east_m, north_m = _BEFORE_M * math.cos(tag.yaw_rad), _BEFORE_M * math.sin(tag.yaw_rad)
    before = replace(dock, x_m=dock.x_m + east_m, y_m=dock.y_m + north_m)
    drive = below.navigate(before, "the place before the dock")
    return drive, look, builder.navigate(FromBoard(key), "the dock", exactly=True)


def charge_plan(builder: PlanBuilder) -> NodeSpec:
    """Plans charging at the dock. Raises InputError when the command carries an object there."""
    facts = builder.knowledge
    if builder.command.item is not None:
        raise builder.error("the robot charges itself, at its dock", "say 'do: charge' alone")
    if facts.dock is None:
        raise builder.error("this world has no dock to charge at", "add 'dock' to its knowledge")
    return dock_plan(builder, facts.dock.pose_2d(), facts.battery.charged)


def _plan(assembler: Assembler, block: model.Dock, builder: PlanBuilder) -> Assembled:
    facts = builder.knowledge
    if facts.dock is None:
        hint = "add 'dock' to its knowledge"
        raise InputError.at(builder.source, "this world has no dock to charge at", hint=hint)
    level = facts.battery.charged if block.level is None else block.level
    node = dock_plan(builder, facts.dock.pose_2d(), level)
    command = Command(task=basic().charge)
    return Assembled((node,), (StepPart(node.path_id, command, goal=command_goal(command, facts)),))


PLANS: Final[StepPlans] = {model.Dock: _plan}
