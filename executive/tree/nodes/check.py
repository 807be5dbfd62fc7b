"""Finding out whether a condition holds: the plan and its node."""

from __future__ import annotations

from typing import Final

from py_trees.common import Status

from executive.tree.assembly import Assembler, StepPlans
from executive.tree.behaviour import ExplainedDecorator
from executive.tree.context import RunContext
from executive.tree.goals import door_goal
from executive.tree.nodes.decisions import decide_plan, look_plan
from executive.tree.nodes.doors import door_plan
from executive.tree.nodes.search import ANSWER_TOPIC
from executive.tree.plan import Assembled, PlanBuilder, StepPart
from executive.words import leaf_steps as model
from executive.words.condition import DoorOpen, Look


class Check(ExplainedDecorator):
    """Makes the decision of its child an answer of the mission: it is published under `ANSWER_TOPIC`.

    As the child; `key` is where the child leaves its answer.
    """

    kind = "check"
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
    below, condition, name = builder.at("check"), block.condition, block.answer_name
    if isinstance(condition, Look) and not condition.max_age_s:
        key = assembler.give(name, below.at("look-1").key("answer"), bool, builder)
        look, part = look_plan(below, 1, condition, key)
        return Assembled((look,), (part,))
    if isinstance(condition, DoorOpen) and not condition.max_age_s:
        key = assembler.give(name, below.key("answer"), bool, builder)
        look = door_plan(below, condition.between, key)
        return Assembled((look,), (StepPart(look.path_id, goal=door_goal(builder.knowledge, condition.between)),))
    decide, key, parts = decide_plan(assembler.flow, condition, below)
    key = assembler.give(name, key, bool, builder)
    question = str(condition)
    node = builder.node("check", f"{question}?", decide.with_options(key=key), question=question, key=key)
    return Assembled((node,), parts)


PLANS: Final[StepPlans] = {model.Check: _plan}
