"""Repeats steps in rounds: the plan and its node."""

import math
from collections.abc import Iterable, Iterator
from dataclasses import field, replace
from typing import ClassVar, Final, Literal

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from executive.mission.gripper import held_after_either
from executive.tree.assembly import Assembler, StepPlans
from executive.tree.behaviour import MemoryComposite, cause_of, message_of
from executive.tree.board import Board
from executive.tree.context import DAY_S, RunContext, time_ahead_s
from executive.tree.estimate import Estimate, Walk
from executive.tree.node import NodeSpec
from executive.tree.nodes.decision_nodes import Decide, decide_plan
from executive.tree.plan import Assembled, PlanBuilder, StepPart
from executive.words import steps as model
from executive.words.condition import READINGS, Condition, ValueIs, parts_of
from executive.words.leaf_steps import CallSkill, Check, Do, Say, Set
from executive.words.step import Step
from skills.api import Cause
from skills.inputs.errors import InputError, count_text
from skills.quantities import clock_s


class Repeat(MemoryComposite):
    """Composite that repeats its last child, the body; a decision, which writes its answer under `key`, may precede it.

    | decision | body | status |
    |---|---|---|
    | RUNNING | idle | RUNNING |
    | FAILURE | idle | FAILURE with its cause |
    | `while`: false before a round | idle | SUCCESS |
    | `while`: true before a round | ticked in the same tick | as below |
    | - | RUNNING | RUNNING |
    | - | FAILURE | FAILURE with its cause |
    | `until`: true after a round | SUCCESS | SUCCESS |
    | `until`: false after a round, `while` | SUCCESS | RUNNING until the next round |
    | `until`: false after `times` rounds | SUCCESS | FAILURE with POSTCONDITION |
    | `while`: true after `times` rounds | idle | FAILURE with POSTCONDITION |
    | none (mode `times`) | SUCCESS | RUNNING until the next round; SUCCESS after `times` rounds |
    | none, before a round at `until_clock_s` or later | idle | SUCCESS; FAILURE with PRECONDITION before the first |
    | halted | halted | INVALID with CANCELLED |

    A round begins in the tick after the previous round ended, at the earliest `every_s` after the previous round began.
    The number of rounds begun is written under the blackboard key `count`.
    """

    kind = "repeat"
    spoken = True
    output_types: ClassVar = {"count": int}
    mode: Literal["until", "while", "times"]
    words: str
    count: str
    key: str = ""
    times: int | None = None
    every_s: float = 0.0
    until_clock_s: float | None = None
    board: Board
    context: RunContext
    _phase: Literal["start", "before", "body", "after"] = field(default="start", init=False)
    _due_s: float = field(default=0.0, init=False)
    _end_s: float = field(default=math.inf, init=False)

    @classmethod
    def _repeated(cls, node: NodeSpec, walk: Walk, first: bool, begun: Estimate, times: int) -> Estimate:
        """Estimates all rounds; `begun` is the estimate of the first round."""
        if times == 1:
            return begun
        again, more = walk.all_of(node, first), times - 1
        rest = Estimate(more * again.duration_s, more * again.distance_m, more * again.charge, more * again.spare_s)
        rounds = begun + rest
        pauses_s = max(0.0, more * node.options["every_s"] - rounds.duration_s * more / times)
        return rounds + Estimate(pauses_s, 0.0, pauses_s * walk.estimates.battery.standing_per_s)

    @classmethod
    def estimate(cls, node: NodeSpec, walk: Walk, first: bool) -> Estimate:
        """Estimates the known number of rounds, else one round; the second round stands for all later rounds."""
        times, fixed = node.options["times"], node.options["mode"] == "times"
        begun = walk.all_of(node, first)
        if fixed and times:
            return cls._repeated(node, walk, first, begun, times)
        if not times:
            if node.options["until_clock_s"] is not None:
                return begun.up_to(DAY_S, f"until {node.options['words']}")
            endless = "for ever" if fixed else f"{node.options['mode']} {node.options['words']}"
            return begun.up_to(math.inf, endless)
        if times == 1:
            return begun
        here = walk.mark()
        most_s = cls._repeated(node, walk, first, begun, times).most_s
        walk.go_to(here)
        return begun.up_to(most_s, f"1 to {times} rounds")

    @classmethod
    def waiting_s(cls, node: NodeSpec, now_s: float) -> float:
        """Returns the time of all rounds, or until the time of day at which they end."""
        round_s, options = super().waiting_s(node, now_s), node.options
        if options["until_clock_s"] is not None:
            return max(round_s, time_ahead_s(options["until_clock_s"], now_s))
        return round_s + ((options["times"] or 1) - 1) * max(round_s, float(options["every_s"]))

    def _tick(self) -> Iterator[Behaviour]:
        """Begins a round, decides, or ticks the body."""
        if self.status != Status.RUNNING:
            self._restart()
        if self._phase == "start":
            now_s = self.context.clock.now() + 1e-9
            if now_s >= self._end_s:
                past = None if self.rounds else Cause.PRECONDITION
                self._end(past, self._report() if self.rounds else f"no round is made: it is past {self.words}")
            elif now_s < self._due_s:
                last = self._due_s >= self._end_s
                then = f"waits until {self.words}" if last else f"the next in {self._due_s - now_s:.0f} s"
                self._go_on(f"{self._report()}; {then}")
            if now_s >= self._end_s or now_s < self._due_s:
                yield self
                return
            self._reset_children()
            self.board.put(self.count, self.rounds + 1)
            self._enter_round()
        ended = False
        while not ended and self._phase != "start":
            child = self.current_child = self.children[-1 if self._phase == "body" else 0]
            yield from child.tick()
            ended = self._judged(child)
        yield self

    def _restart(self) -> None:
        goes_on = self.resumed and self.count in self.board
        super()._restart()
        if self.until_clock_s is not None:
            now_s = self.context.clock.now()
            self._end_s = now_s + time_ahead_s(self.until_clock_s, self.context.day_began_s + now_s)
        if goes_on:
            self._enter_round()
            return
        self.board.put(self.count, 0)
        self._phase, self._due_s = "start", self.context.clock.now()
        if len(self.children) == 2 and isinstance(self.children[0], Decide):
            self.children[0].view.forget_presses()

    @property
    def rounds(self) -> int:
        """Number of rounds that have begun."""
        return int(self.board.get(self.count))

    def _enter_round(self) -> None:
        self._phase = "before" if self.mode == "while" else "body"
        self._due_s = self.context.clock.now() + self.every_s

    def _judged(self, child: Behaviour) -> bool:
        """Handles the child's status; returns False when another child is ticked in the same tick."""
        if child.status == Status.RUNNING:
            self._go_on(message_of(child))
        elif child.status != Status.SUCCESS:
            number = f" (in round {self.rounds})" if self.rounds > 1 else ""
            self._end(cause_of(child), f"{message_of(child)}{number}")
        elif self._phase == "body":
            if self.mode == "until":
                self._phase = "after"
                return False
            self._round_done()
        elif bool(self.board.get(self.key)) is (self.mode == "until"):
            self._end(None, self._report())
        elif self._phase == "before" and (self.times is None or self.rounds <= self.times):
            self._phase = "body"
            return False
        else:
            self._round_done()
        return True

    def _round_done(self) -> None:
        if self.times is None or self.rounds < self.times or (self.mode == "while" and self.rounds == self.times):
            self._phase = "start"
            self._go_on(self._report())
        elif self.mode == "times":
            self._end(None, self._report())
        else:
            still = "still" if self.mode == "while" else "not yet"
            self._end(Cause.POSTCONDITION, f"after {self.times} rounds it is {still} true that {self.words}")

    def _report(self) -> str:
        done = self.rounds - (1 if self._phase == "before" else 0)
        last = message_of(self.children[-1]) if self.children[-1].status == Status.SUCCESS else ""
        counted = count_text(done, "round")
        return f"{counted}, the last: {last}" if last else counted


def _plan(assembler: Assembler, block: model.Repeat, builder: PlanBuilder) -> Assembled:
    rounds = block.loop
    condition = rounds.until or rounds.while_
    mode = "times" if condition is None else "until" if rounds.until is not None else "while"
    _refuse_endless(block, condition, builder)
    changing = _given(block.steps)
    for name in changing & set(assembler.flow.names):
        assembler.flow.names[name] = replace(assembler.flow.names[name], quantity=None)
    before, nodes, key = assembler.flow.copy(), [], ""
    parts: tuple[StepPart, ...] = ()
    if mode == "while" and condition is not None:
        decide, key, parts = decide_plan(assembler.flow, condition, builder.at("while"))
        nodes = [decide]
    body = assembler.row(block.steps, builder.at("round"), "round")
    flow = assembler.flow
    if flow.held != before.held and rounds.times != 1:
        flow.names = dict(before.names)
        flow.held, flow.opening = held_after_either(before.held, flow.held), False
        body = assembler.row(block.steps, builder.at("round"), "round")
    if mode == "until" and condition is not None:
        decide, key, parts = decide_plan(assembler.flow, condition, builder.at("until"))
        nodes = [decide]
    if mode == "while":
        assembler.flow.join([before, assembler.flow.copy()])
    elif assembler.flow.held != before.held:
        assembler.flow.held = held_after_either(before.held, assembler.flow.held)
    words = rounds.until_clock or ("" if condition is None else str(condition))
    often = f"{rounds.times} times" if rounds.times else "for ever"
    often = f"{'until' if rounds.until_clock else mode} {words}" if words else often
    every = f", every {rounds.every_s:g} s" if rounds.every_s else ""
    node = builder.node(
        "repeat",
        f"{often}{every}",
        *nodes,
        *body.nodes,
        mode=mode,
        words=words,
        count=builder.key("rounds"),
        key=key,
        times=rounds.times,
        every_s=rounds.every_s or 0.0,
        until_clock_s=rounds.until_clock and clock_s(rounds.until_clock),
    )
    return Assembled((node,), (*parts, *body.parts))


def _refuse_endless(block: model.Repeat, condition: Condition | None, builder: PlanBuilder) -> None:
    """Raises InputError for rounds that never end, because no step changes the values that their condition reads."""
    if condition is None or block.loop.times is not None or block.timeout_s is not None:
        return
    read: set[str] = set()
    for part in parts_of(condition):
        if not isinstance(part, ValueIs):
            return
        read |= part.expression.names
    if not read & (set(READINGS) | _given(block.steps)):
        hint = "give 'times' or 'timeout', or 'set' in a round what it reads"
        raise InputError.at(builder.source, f"nothing in a round changes whether {condition}", hint=hint)


def _given(steps: Iterable[Step]) -> set[str]:
    """Returns the names to which the steps may give a value."""
    found: set[str] = set()
    for step in (below for each in steps for below in each.walk()):
        match step:
            case Set(set=values):
                found |= set(values)
            case Do() | Say() | CallSkill() | Check() | model.Ask():
                found |= set((step.gives or {}).values())
    return found


PLANS: Final[StepPlans] = {model.Repeat: _plan}
