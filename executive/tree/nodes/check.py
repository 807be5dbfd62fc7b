"""Finding out whether a condition holds: the plan and its node."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from py_trees.common import Status

from executive.tree.behaviours.answer import ANSWER_TOPIC
from executive.tree.behaviours.decorators import ExplainedDecorator
from executive.tree.compiling.decisions import (
    decide_plan,
    decision_of,
)
from executive.tree.compiling.flow import Assembler, BlockPlans, answering, checks_of, give_key
from executive.tree.compiling.part import Assembled, StepPart
from executive.tree.context import RunContext
from executive.tree.goals import door_goal
from executive.tree.node import NodeKind
from executive.tree.nodes.decisions import AnswerIs
from executive.tree.nodes.doors import door_plan
from executive.tree.plan import PlanBuilder
from executive.words import leaf_steps as model
from executive.words.condition import DoorOpen, Look


@dataclass(kw_only=True, eq=False, repr=False)
class Check(ExplainedDecorator):
    """Makes the decision of its child an answer of the mission: it is published under `ANSWER_TOPIC`.

    As the child; `key` is where the child leaves its answer.
    """

    question: str
    key: str
    context: RunContext

    def update(self) -> Status:
        """The child's status, and the answer when it is there."""
        status = self.pass_on()
        if status == Status.SUCCESS:
            answer = self.context.board.get(self.key)
            note = {"node": self.path_id, "question": self.question, "answer": answer, "message": self.message}
            self.context.publish(ANSWER_TOPIC, note)
        return status


def _plan(assembler: Assembler, block: model.Check, builder: PlanBuilder) -> Assembled:
    below = builder.at("check")
    decided = decision_of(block.condition, below, assembler.flow.names)
    if isinstance(block.condition, Look) and isinstance(decided.decision, AnswerIs) and not decided.decision.max_age_s:
        key = give_key(assembler, block.answer_name, decided.decision.key, bool, builder)
        return Assembled((answering(decided.looks[0], {"key": key}),), checks_of(decided, builder))
    if isinstance(block.condition, DoorOpen) and not block.condition.max_age_s:
        key = give_key(assembler, block.answer_name, below.key("answer"), bool, builder)
        look = door_plan(below, block.condition.between, key)
        goal = door_goal(builder.knowledge, block.condition.between)
        return Assembled((look,), (StepPart(look.path_id, goal=goal),))
    key = give_key(assembler, block.answer_name, below.key("decided"), bool, builder)
    decide = decide_plan(block.condition, decided, below, key)
    question = str(block.condition)
    node = builder.node("check", f"{question}?", decide, question=question, key=key)
    return Assembled((node,), checks_of(decided, builder))


KINDS: Final[Mapping[str, NodeKind]] = {"check": NodeKind(Check, ("child", "context"))}
PLANS: Final[BlockPlans] = {model.Check: _plan}
