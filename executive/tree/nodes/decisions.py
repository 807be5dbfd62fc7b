"""What a mission decides by while it runs: decisions as plain data, and the nodes that make them.

A decision is true, false, or not known yet (None): a look that it takes has not been taken.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, Final, Protocol

from py_trees.behaviour import Behaviour
from py_trees.common import Status
from py_trees.composites import Composite

from executive.tree.behaviour import ExplainedNode, cause_of, message_of
from executive.tree.context import RunContext
from executive.tree.node import NodeKind, NodeSpec
from executive.tree.nodes.guard import Condition, Verdict, Waiting
from executive.words.condition import READINGS
from executive.words.expression import Expression, ExpressionError, Value
from skills.api import Cause, Failed

DAY_S: Final = 86_400.0
Keys = Mapping[str, str]
"""Blackboard keys by the names that expressions read."""


@dataclass
class View:
    """What decisions look at: the run, when the tree was made (s), and how often each button was pressed by then."""

    context: RunContext
    begun_s: float = field(init=False)
    presses: Mapping[str, int] = field(init=False)

    def __post_init__(self) -> None:
        self.begun_s, self.presses = self.context.clock.now(), self.context.presses()

    def values(self, keys: Keys) -> Mapping[str, Value]:
        """The readings, and the values of names that are kept under blackboard keys; what has none is left out.

        Each is read when it is asked for.
        """
        return _Values(self, keys)

    def reading(self, name: str) -> Value:
        """A reading by its name."""
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

    def pressed(self, button: str) -> bool:
        """Whether a button has been pressed since."""
        return self.context.presses().get(button, 0) > self.presses.get(button, 0)

    def forget_presses(self) -> None:
        """Count presses of buttons from now on."""
        self.presses = self.context.presses()


@dataclass(frozen=True)
class _Values(Mapping[str, Value]):
    """What expressions read."""

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


class Decision(Protocol):
    """Something that is true, false or not known yet."""

    def holds(self, view: View) -> bool | None:
        """Whether it holds now. Raises ExpressionError: an expression has no value."""


@dataclass(frozen=True)
class ValueHolds:
    """An expression of values and readings."""

    expression: Expression
    keys: Keys = field(default_factory=dict)

    def holds(self, view: View) -> bool | None:
        """Its value."""
        return bool(self.expression.value(view.values(self.keys)))


@dataclass(frozen=True)
class AnswerIs:
    """The answer of a look, under a blackboard key; one that is up to `max_age_s` old is not asked for again."""

    key: str
    max_age_s: float = 0.0

    def holds(self, view: View) -> bool | None:
        """The answer; None before the look."""
        return bool(view.context.board.get(self.key)) if self.key in view.context.board else None


@dataclass(frozen=True)
class Pressed:
    """A button has been pressed."""

    button: str

    def holds(self, view: View) -> bool | None:
        """Whether it has."""
        return view.pressed(self.button)


@dataclass(frozen=True)
class AllHold:
    """All of several; false as soon as one is."""

    parts: tuple[Decision, ...]

    def holds(self, view: View) -> bool | None:
        """False when one is, else None when one is not known."""
        found = [part.holds(view) for part in self.parts]
        return False if False in found else None if None in found else True


@dataclass(frozen=True)
class AnyHolds:
    """One of several; true as soon as one is."""

    parts: tuple[Decision, ...]

    def holds(self, view: View) -> bool | None:
        """True when one is, else None when one is not known."""
        found = [part.holds(view) for part in self.parts]
        return True if True in found else None if None in found else False


@dataclass(frozen=True)
class DoesNotHold:
    """The opposite."""

    part: Decision

    def holds(self, view: View) -> bool | None:
        """The opposite, where it is known."""
        found = self.part.holds(view)
        return None if found is None else not found


def buttons_of(node: NodeSpec) -> Iterator[str]:
    """The buttons that a node decides by."""
    condition = node.options.get("condition")
    decision = condition.decision if isinstance(condition, MustHold) else node.options.get("decision")
    yield from (part.button for part in _parts(decision) if isinstance(part, Pressed))


def _parts(decision: Any) -> Iterator[Any]:
    """What a decision is made of, in order."""
    match decision:
        case AllHold(parts) | AnyHolds(parts):
            for part in parts:
                yield from _parts(part)
        case DoesNotHold(part):
            yield from _parts(part)
        case _:
            yield decision


@dataclass
class MustHold(Condition):
    """A decision that must be true while nodes run; PRECONDITION when it is not, ERROR where it has no value."""

    decision: Decision
    words: str
    _view: View | None = field(default=None, init=False, repr=False, compare=False)

    def for_run(self, context: RunContext) -> MustHold:
        """A copy that counts from now."""
        mine = MustHold(self.decision, self.words, stale=self.stale)
        mine._view = View(context)
        return mine

    def judged(self, context: RunContext) -> Verdict:
        """A failure when it does not hold."""
        holds = self._holds(context)
        if isinstance(holds, Failed):
            return holds
        if holds is None:
            return Waiting(f"cannot tell yet whether {self.words}")
        return None if holds else Failed(Cause.PRECONDITION, f"it does not hold any more that {self.words}")

    def _holds(self, context: RunContext) -> bool | Failed | None:
        view = self._view = self._view or View(context)
        try:
            return self.decision.holds(view)
        except ExpressionError as error:
            return Failed(Cause.ERROR, f"{self.words}: {error.message}")


@dataclass
class MustNotBegin(MustHold):
    """Calls an interrupt when the decision becomes true; once it was called, not before it was false in between."""

    _called: bool = field(default=False, init=False, repr=False, compare=False)

    def for_run(self, context: RunContext) -> MustNotBegin:
        """A copy that counts from now."""
        mine = MustNotBegin(self.decision, self.words, stale=self.stale)
        mine._view = View(context)
        return mine

    def begin(self, context: RunContext) -> None:
        """The steps begin: nothing was called yet."""
        super().begin(context)
        self._called = False

    def called(self) -> None:
        """The interrupt has begun."""
        self._called = True
        if self._view is not None:
            self._view.forget_presses()

    def judged(self, context: RunContext) -> Verdict:
        """A failure, which calls the interrupt, when it has become true."""
        holds = self._holds(context)
        if isinstance(holds, Failed):
            return holds
        self._called = self._called and holds is True
        return Failed(Cause.PRECONDITION, self.words) if holds and not self._called else None


@dataclass(kw_only=True, eq=False, repr=False)
class Decide(ExplainedNode, Composite):
    """Decides, and takes the looks (its children) one after the other only as long as the decision needs them.

    A look that has begun is taken to its end. Decided: SUCCESS, the answer under `key`. A look RUNNING: RUNNING. A look
    FAILURE: FAILURE with its cause. An expression without a value: FAILURE with PRECONDITION. Without a look left and
    not decided: FAILURE with ERROR. Each time that it begins it forgets the answers, but those that are no older than
    their `max_age_s`; the n-th child is the look for the n-th answer of the decision.
    """

    decision: Decision
    words: str
    key: str
    context: RunContext
    children: list[Behaviour]
    _next: int = field(default=0, init=False)
    _given_s: dict[str, float] = field(default_factory=dict, init=False)

    def __post_init__(self) -> None:
        Composite.__init__(self, self.name, list(self.children))
        self.view = View(self.context)
        self._answers = [part for part in _parts(self.decision) if isinstance(part, AnswerIs)]

    def tick(self) -> Iterator[Behaviour]:
        """Decide, or take the next look."""
        looks = self.status == Status.RUNNING
        if not looks:
            self._restart()
        while True:
            if not looks and self._decided():
                break
            looked, looks = looks, False
            if self._next == len(self.children):
                self._end(Failed(Cause.ERROR, f"it cannot be told whether {self.words}"))
                break
            child = self.current_child = self.children[self._next]
            if not looked and self._known(self._next):
                self._next += 1
                continue
            yield from child.tick()
            if child.status == Status.RUNNING:
                self.status, self.cause, self.message = Status.RUNNING, None, message_of(child)
                break
            if child.status != Status.SUCCESS:
                self._end(Failed(cause_of(child), f"cannot tell whether {self.words}: {message_of(child)}"))
                break
            self._note(self._next)
            self._next += 1
        yield self

    def stop(self, new_status: Status = Status.INVALID) -> None:
        """Stop the look that is taken."""
        interrupted = new_status == Status.INVALID and self.status == Status.RUNNING
        for child in self.children:
            if new_status == Status.INVALID and (not interrupted or child.status == Status.RUNNING):
                child.stop(Status.INVALID)
        if interrupted:
            self.explain_cancelled()
        elif new_status == Status.INVALID:
            self.clear_explanation()
        self.status = new_status
        self.iterator = self.tick()

    def _restart(self) -> None:
        self._next = 0
        self.clear_explanation()
        self.context.board.forget(answer.key for answer in self._answers if not self._fresh(answer))
        for child in self.children:
            child.stop(Status.INVALID)

    def _fresh(self, answer: AnswerIs) -> bool:
        """Whether an answer of an earlier time need not be asked for again."""
        given_s = self._given_s.get(answer.key)
        old_s = math.inf if given_s is None else self.context.clock.now() - given_s
        return answer.max_age_s > 0.0 and old_s <= answer.max_age_s

    def _known(self, number: int) -> bool:
        """Whether the answer of a look is there."""
        return number < len(self._answers) and self._answers[number].key in self.context.board

    def _note(self, number: int) -> None:
        """Note when a look has given its answer."""
        if number < len(self._answers):
            self._given_s[self._answers[number].key] = self.context.clock.now()

    def _decided(self) -> bool:
        """Whether it has come to an end."""
        try:
            holds = self.decision.holds(self.view)
        except ExpressionError as error:
            self._end(Failed(Cause.PRECONDITION, f"{self.words}: {error.message}"))
            return True
        if holds is None:
            return False
        self.context.board.put(self.key, holds)
        self.cause, self.message = None, f"{'yes' if holds else 'no'}: {self.words}"
        self.stop(Status.SUCCESS)
        return True

    def _end(self, failure: Failed) -> None:
        self.cause, self.message = failure.cause, failure.message
        self.stop(Status.FAILURE)


KINDS: Final[Mapping[str, NodeKind]] = {
    "decide": NodeKind(Decide, ("children", "context"), writes=lambda options: {options["key"]: bool}),
}
