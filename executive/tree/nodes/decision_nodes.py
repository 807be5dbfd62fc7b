"""Decisions of a running mission: conditions as data, the looks that they need, and the nodes that decide.

A decision is true, false, or unknown (None) until a look that it needs has been taken.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import ClassVar, Final

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from executive.mission.certainty import refuse_certain
from executive.tree.assembly import Assembler, Flow, StepPlans
from executive.tree.behaviour import ExplainedDecorator, MemoryComposite, cause_of, message_of
from executive.tree.context import ANSWER_TOPIC, DAY_S, RunContext
from executive.tree.goals import command_goal, door_goal
from executive.tree.node import NodeSpec
from executive.tree.nodes import guard
from executive.tree.nodes.door_check import door_plan
from executive.tree.nodes.guard import Verdict, Waiting
from executive.tree.nodes.search import find_plan, refuse_several
from executive.tree.plan import Assembled, PlanBuilder, StepPart
from executive.words import leaf_steps as model
from executive.words.condition import (
    READINGS,
    AllOf,
    AnyOf,
    ButtonPressed,
    Condition,
    DoorOpen,
    Look,
    Not,
    ValueIs,
    parts_of,
)
from executive.words.expression import ExpressionError, Kind, Value
from skills.api import Cause, Failed
from skills.inputs.errors import InputError

Keys = Mapping[str, str]
"""Blackboard keys by the names in expressions."""


@dataclass
class View:
    """Data for decisions: run context, time (s) when the tree was built, and how often buttons were pressed then."""

    context: RunContext
    begun_s: float = field(init=False)
    presses: Mapping[str, int] = field(init=False)

    def __post_init__(self) -> None:
        self.begun_s, self.presses = self.context.clock.now(), self.context.presses()

    def reading(self, name: str) -> Value:
        """Returns a reading by its name."""
        context = self.context
        match name:
            case "battery":
                return context.robot.battery().charge
            case "localised":
                return context.localiser.estimate().localised
            case "holding":
                return context.robot.gripper().holding
            case "elapsed":
                return context.clock.now() - self.begun_s
        minutes = int((context.day_began_s + context.clock.now()) % DAY_S // 60)
        return f"{minutes // 60:02d}:{minutes % 60:02d}"

    def forget_presses(self) -> None:
        """Ignores all presses of buttons until now."""
        self.presses = self.context.presses()


@dataclass(frozen=True)
class Values(Mapping[str, Value]):
    """Readings, and values of named blackboard keys, as far as there are any; each is read when it is used."""

    view: View
    named: Keys

    def __getitem__(self, name: str) -> Value:
        if name in READINGS:
            return self.view.reading(name)
        value: Value = self.view.context.board.get(self.named[name])
        return value

    def __contains__(self, name: object) -> bool:
        return name in READINGS or (name in self.named and self.named[str(name)] in self.view.context.board)

    def __iter__(self) -> Iterator[str]:
        return iter((*READINGS, *filter(self.__contains__, self.named)))

    def __len__(self) -> int:
        return sum(1 for _ in self)


@dataclass(frozen=True)
class Decision:
    """Condition with the blackboard keys of the values that it reads, and of the answers to its looks in order."""

    condition: Condition
    keys: Keys = field(default_factory=dict)
    answers: tuple[str, ...] = ()

    @property
    def buttons(self) -> tuple[str, ...]:
        """Operator's buttons in the condition."""
        return tuple(part.button for part in parts_of(self.condition) if isinstance(part, ButtonPressed))

    def holds(self, view: View) -> bool | None:
        """Returns whether it holds; None while a needed look is missing. Raises ExpressionError for missing values."""
        return self._holds(self.condition, view, iter(self.answers))

    def _holds(self, condition: Condition, view: View, answers: Iterator[str]) -> bool | None:
        match condition:
            case ValueIs(expression=expression):
                return bool(expression.value(Values(view, self.keys)))
            case ButtonPressed(button=button):
                return view.context.presses().get(button, 0) > view.presses.get(button, 0)
            case Not(part=part):
                found = self._holds(part, view, answers)
                return None if found is None else not found
            case AllOf(parts=parts) | AnyOf(parts=parts):
                held = [self._holds(part, view, answers) for part in parts]
                decisive = isinstance(condition, AnyOf)
                return decisive if decisive in held else None if None in held else not decisive
        answer: bool | None = view.context.board.get(next(answers), None)
        return answer

    def __str__(self) -> str:
        return str(self.condition)

    @property
    def looks(self) -> tuple[tuple[str, Look | DoorOpen], ...]:
        """Looks that the decision needs, each with the key for its answer."""
        looks = (part for part in parts_of(self.condition) if isinstance(part, Look | DoorOpen))
        return tuple(zip(self.answers, looks, strict=True))


def buttons_of(node: NodeSpec) -> tuple[str, ...]:
    """Returns the buttons by which a node decides."""
    condition = node.options.get("condition")
    decision = condition.decision if isinstance(condition, MustHold) else node.options.get("decision")
    return decision.buttons if isinstance(decision, Decision) else ()


@dataclass
class MustHold(guard.Condition):
    """Guard condition that a decision is true; PRECONDITION if it is false, ERROR if it has no value."""

    decision: Decision
    words: str
    _view: View | None = field(default=None, init=False, repr=False, compare=False)

    def run_begins(self, context: RunContext) -> None:
        """Counts time and presses from now on."""
        self._view = View(context)

    def judge(self, context: RunContext) -> Verdict:
        """Returns a failure when the decision is false."""
        holds = self._holds(context)
        if isinstance(holds, Failed):
            return holds
        if holds is None:
            return Waiting(f"cannot tell yet whether {self.words}")
        return None if holds else Failed(Cause.PRECONDITION, f"it is no longer true that {self.words}")

    def _holds(self, context: RunContext) -> bool | Failed | None:
        view = self._view = self._view or View(context)
        try:
            return self.decision.holds(view)
        except ExpressionError as error:
            return Failed(Cause.ERROR, f"{self.words}: {error.message}")


@dataclass
class MustNotBegin(MustHold):
    """Condition that calls an interrupt when the decision becomes true, and again only after it has been false."""

    _called: bool = field(default=False, init=False, repr=False, compare=False)

    def begin(self, context: RunContext) -> None:
        """Handles the start of the guarded steps: the condition has not called its interrupt."""
        super().begin(context)
        self._called = False

    def note_call(self) -> None:
        """Records that the interrupt has begun."""
        self._called = True
        if self._view is not None:
            self._view.forget_presses()

    def judge(self, context: RunContext) -> Verdict:
        """Returns a failure, which calls the interrupt, when the decision has become true."""
        holds = self._holds(context)
        if isinstance(holds, Failed):
            return holds
        self._called = self._called and holds is True
        return Failed(Cause.PRECONDITION, self.words) if holds and not self._called else None


class Decide(MemoryComposite):
    """Composite that evaluates a decision, and takes the looks (children) in order as the decision needs them.

    | case | status |
    |---|---|
    | decided, no look is running | SUCCESS; the answer stands under `key` |
    | look RUNNING | RUNNING; a look that has begun is taken to its end |
    | look SUCCESS | decides, or ticks the next look in the same tick |
    | look FAILURE | FAILURE with its cause |
    | expression without a value | FAILURE with PRECONDITION |
    | no look left, not decided | FAILURE with ERROR |
    | halted | INVALID with CANCELLED |

    The n-th child is the look for the n-th answer of the decision. Each start clears the answers that are older than
    their `max_age_s`, and those without `max_age_s`.
    """

    kind = "decide"
    output_types: ClassVar = {"key": bool}
    settled = True
    least = 0
    decision: Decision
    words: str
    key: str
    context: RunContext
    _given_s: dict[str, float] = field(default_factory=dict, init=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        self.view = View(self.context)

    def _tick(self) -> Iterator[Behaviour]:
        """Decides, or takes the next look."""
        looks = self.status == Status.RUNNING
        if not looks:
            self._restart()
        while looks or not self._decided():
            if self._index == len(self.children):
                self._end(Cause.ERROR, f"cannot tell whether {self.words}")
                break
            if looks or self.decision.answers[self._index] not in self.context.board:
                child = self.current_child = self.children[self._index]
                yield from child.tick()
                if child.status == Status.RUNNING:
                    self._go_on(message_of(child))
                    break
                if child.status != Status.SUCCESS:
                    self._end(cause_of(child), f"cannot tell whether {self.words}: {message_of(child)}")
                    break
                self._given_s[self.decision.answers[self._index]] = self.context.clock.now()
            looks = False
            self._index += 1
        yield self

    def _restart(self) -> None:
        super()._restart()
        now_s = self.context.clock.now()
        ages_s = {key: now_s - self._given_s.get(key, -math.inf) for key, _ in self.decision.looks}
        looks = self.decision.looks
        self.context.board.forget(k for k, look in looks if look.max_age_s <= 0.0 or ages_s[k] > look.max_age_s)

    def _decided(self) -> bool:
        """Decides if all needed looks are taken; returns whether the node has ended."""
        try:
            holds = self.decision.holds(self.view)
        except ExpressionError as error:
            self._end(Cause.PRECONDITION, f"{self.words}: {error.message}")
            return True
        if holds is None:
            return False
        self.context.board.put(self.key, holds)
        is_denied = isinstance(self.decision.condition, Not) and isinstance(self.decision.condition.part, Look)
        told = [
            message_of(one).split(": ", 1)[-1] for one in self.children if is_denied and one.status == Status.SUCCESS
        ]
        self._end(None, f"{'yes' if holds else 'no'}: {next(iter(told), self.words)}")
        return True


def decide_plan(flow: Flow, condition: Condition, builder: PlanBuilder) -> tuple[NodeSpec, str, tuple[StepPart, ...]]:
    """Plans a decision; returns its node, the key of its answer, and the looks that have goal conditions.

    Raises InputError for an expression that is no truth value, an unknown name, or an object that no look can find.
    """
    decision, key, words = decision_of(flow, condition, builder), builder.key("decided"), str(condition)
    looks = [look_plan(builder.at(f"look-{n}"), look, key) for n, (key, look) in enumerate(decision.looks, start=1)]
    nodes = (node for node, _ in looks)
    node = builder.node("decide", f"{words}?", *nodes, decision=decision, words=words, key=key)
    return node, key, tuple(part for _, part in looks)


def look_plan(
    builder: PlanBuilder, look: Look | DoorOpen, key: str, *, negated: bool = False
) -> tuple[NodeSpec, StepPart]:
    """Plans a look whose answer is that something is so, or not if `negated`; returns its node, and its step."""
    if isinstance(look, DoorOpen):
        plan = door_plan(builder, look.between, key, look.max_age_s, negated=negated)
        check = next(node for node in plan.walk() if node.behaviour.answers)
        return plan, StepPart(check.path_id, goal=door_goal(builder.knowledge, look.between))
    builder = replace(builder, command=look.command)
    refuse_several(builder)
    goal = command_goal(look.command, builder.knowledge)
    return find_plan(builder, key, negated=negated), StepPart(builder.path_id, look.command, goal=goal)


def decision_of(flow: Flow, condition: Condition, builder: PlanBuilder) -> Decision:
    """Builds the decision for a condition whose looks `builder` builds. Raises InputError like `decide_plan`."""
    source, parts = builder.source, list(parts_of(condition))
    expressions = [part.expression for part in parts if isinstance(part, ValueIs)]
    for expression in expressions:
        if flow.kind_of(expression, source) is not Kind.TRUTH:
            hint = "compare it with something, as in 'count > 2'"
            raise InputError.at(source, f"'{expression}' is not true or false", hint=hint)
    try:
        refuse_certain(condition, flow.ranges)
    except ExpressionError as error:
        raise InputError.at(source, error.message, hint=error.hint) from error
    looks = sum(isinstance(part, Look | DoorOpen) for part in parts)
    answers = tuple(builder.at(f"look-{number}").key("answer") for number in range(1, looks + 1))
    return Decision(condition, flow.keys_of(*expressions), answers)


def instant_decision(flow: Flow, condition: Condition, builder: PlanBuilder) -> Decision:
    """Builds the decision for a monitored condition. Raises InputError if it needs a look, or like `decision_of`."""
    look = next((part for part in parts_of(condition) if isinstance(part, Look | DoorOpen)), None)
    if look is not None:
        hint = "look once with 'if', or again and again with 'repeat: {until: ..}'"
        raise InputError.at(builder.source, f"'{look}' takes a look, and cannot be watched meanwhile", hint=hint)
    return decision_of(flow, condition, builder)


class Check(ExplainedDecorator):
    """Decorator that publishes its child's decision under `ANSWER_TOPIC`, as an answer of the mission.

    Has the status of its only child; `key` holds the answer of the child, and afterwards the opposite if `negated`.
    """

    kind = "check"
    answers = True
    key: str
    context: RunContext
    negated: bool = False

    def update(self) -> Status:
        """Returns the child's status; publishes the answer when there is one."""
        status = self.pass_on()
        if status == Status.SUCCESS:
            answer = self.context.board.get(self.key) != self.negated
            self.context.board.put(self.key, answer)
            note = {"question": self.name.removesuffix("?"), "answer": answer, "message": self.message}
            self.context.publish(ANSWER_TOPIC, {"node": self.path_id, **note})
        return status


def _plan(assembler: Assembler, block: model.Check, builder: PlanBuilder) -> Assembled:
    below, condition, name = builder.at("check"), block.condition, block.answer_name
    look = condition.part if (negated := isinstance(condition, Not)) else condition
    if isinstance(look, Look | DoorOpen) and not look.max_age_s:
        key = assembler.give(name, below.at("look-1").key("answer"), bool, builder)
        node, part = look_plan(below.at("look-1"), look, key, negated=negated)
        return Assembled((node,), (part,))
    decide, key, parts = decide_plan(assembler.flow, condition, below)
    key = assembler.give(name, key, bool, builder)
    node = builder.node("check", decide.name, decide.with_options(key=key), key=key)
    return Assembled((node,), parts)


PLANS: Final[StepPlans] = {model.Check: _plan}
