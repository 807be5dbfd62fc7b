"""Charging at the dock: the plan of the block."""

from __future__ import annotations

from typing import Final

from executive.tree.compiling.flow import Assembler, BlockPlans
from executive.tree.compiling.part import Assembled, StepPart
from executive.tree.goals import command_goal
from executive.tree.nodes.interrupts import dock_plan
from executive.tree.plan import PlanBuilder, pose_2d
from executive.words import leaf_steps as model
from executive.words.command import Command, Task
from skills.files.errors import InputError


def _plan(assembler: Assembler, block: model.Dock, builder: PlanBuilder) -> Assembled:
    facts = builder.knowledge
    if facts.dock is None:
        hint = "add 'dock' to its knowledge"
        raise InputError.at(builder.source, "this world has no dock to charge at", hint=hint)
    level = facts.battery.charged if block.level is None else block.level
    node = dock_plan(builder, pose_2d(facts.dock), level)
    command = Command(task=Task.CHARGE)
    return Assembled((node,), (StepPart(node.path_id, command, goal=command_goal(command, facts)),))


PLANS: Final[BlockPlans] = {model.Dock: _plan}
