"""Parallel steps: the plan and its node."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import field
from typing import Final

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from executive.mission.gripper import held_after_either
from executive.tree.assembly import Assembler, StepPlans
from executive.tree.behaviour import MemoryComposite, cause_of, message_of
from executive.tree.node import NodeSpec
from executive.tree.plan import Assembled, PlanBuilder
from executive.words import steps as model
from skills.api import Cause, Part
from skills.files.errors import InputError


class Together(MemoryComposite):
    """Parallel composite: each child is ticked until it ends.

    | children | status |
    |---|---|
    | `needed` of them SUCCESS | SUCCESS; the others are halted |
    | so many FAILURE that `needed` cannot succeed | FAILURE with the first cause; the others are halted |
    | else | RUNNING |
    | halted | INVALID with CANCELLED |
    """

    kind = "together"
    needed: int
    _failed: list[Behaviour] = field(default_factory=list, init=False)
    _done: list[Behaviour] = field(default_factory=list, init=False)

    def tick(self) -> Iterator[Behaviour]:
        """Ticks the children that have not ended."""
        if self.status != Status.RUNNING:
            self._restart()
            self._failed, self._done = [], []
        for child in self.children:
            if child in self._done or child in self._failed:
                continue
            yield from child.tick()
            if child.status == Status.SUCCESS:
                self._done.append(child)
            elif child.status != Status.RUNNING:
                self._failed.append(child)
            if len(self._done) == self.needed or len(self.children) - len(self._failed) < self.needed:
                break
        self._judge()
        yield self

    def _judge(self) -> None:
        if len(self._done) == self.needed:
            self._finish(None, "; ".join(map(message_of, self._done)))
        elif len(self.children) - len(self._failed) < self.needed:
            self._finish(cause_of(self._failed[0]), "; ".join(map(message_of, self._failed)))
        else:
            self._go_on("; ".join(message_of(child) for child in self.children if child.status == Status.RUNNING))

    def _finish(self, cause: Cause | None, message: str) -> None:
        for child in self.children:
            if child.status == Status.RUNNING:
                child.stop(Status.INVALID)
        self._end(cause, message)


def _plan(assembler: Assembler, block: model.Together, builder: PlanBuilder) -> Assembled:
    flow, made, afters = assembler.flow, [], []
    for number, step in enumerate(block.steps, start=1):
        branch, after = assembler.branch((step,), builder.at(f"branch-{number}"), f"branch {number}", flow)
        made.append(branch)
        afters.append(after)
    _refuse_collisions([each.nodes[0] for each in made], builder)
    everything = block.needed == len(block.steps)
    if everything:
        before = dict(flow.names)
        for after in afters:
            flow.names.update({name: named for name, named in after.names.items() if before.get(name) != named})
    moved = [after.held for after in afters if after.held != flow.held]
    if moved:
        flow.held, flow.opening = (moved[0] if everything else held_after_either(flow.held, *moved)), False
    name = "side by side" if everything else f"side by side, until {block.needed} of {len(block.steps)} are done"
    node = builder.node("together", name, *(each.nodes[0] for each in made), needed=block.needed)
    return Assembled((node,), tuple(part for each in made for part in each.parts))


def _refuse_collisions(branches: Sequence[NodeSpec], builder: PlanBuilder) -> None:
    """Raises InputError for branches that use the same part of the robot."""
    users: dict[Part, int] = {}
    for number, branch in enumerate(branches, start=1):
        skills = (node.options["skill"] for node in branch.walk() if node.kind == "skill")
        for part in sorted({part for skill in skills for part in skill.uses}, key=lambda each: each.value):
            if users.setdefault(part, number) != number:
                what = f"steps {users[part]} and {number} both use the {part.value}"
                hint = "do them one after the other"
                raise InputError.at(branch.source or builder.source, f"{what}, and cannot go together", hint=hint)


PLANS: Final[StepPlans] = {model.Together: _plan}
