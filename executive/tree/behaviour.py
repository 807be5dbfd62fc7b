"""Base classes of nodes, which have a stable path id, a cause and a message: leaves, decorators and composites.

A page of `executive.tree.nodes` defines a kind of node as a class with a `kind`, which registers it. The class's fields
are the options of the node's spec, and objects of the run: `child` or `children`, `context`, any field of the context.

Suspending a tree changes no status and no memory: a composite stays at its child, a retry at its attempt. Only running
`Suspendable` nodes stop, and continue when they are ticked next. The time in between counts against no limit.
"""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any, ClassVar, Protocol, dataclass_transform, runtime_checkable

from py_trees.behaviour import Behaviour
from py_trees.common import Status
from py_trees.composites import Composite
from py_trees.decorators import Decorator

from skills.api import Cause, Failed
from skills.robot import Clock


class Explained:
    """Mixin for behaviours that explain their status.

    `cause` is None unless the node failed or was cancelled; `message` is one sentence, `progress` from 0 to 1 or None.
    A failure is `final` if another attempt would end the same way.
    """

    path_id: str
    cause: Cause | None
    message: str
    status: Status
    progress: float | None = None
    final: bool = False

    def clear_explanation(self) -> None:
        """Clears cause and message."""
        self.cause, self.message, self.final = None, "", False

    def explain_cancelled(self) -> None:
        """Explains a stop from outside, with the node's last message."""
        self.cause = Cause.CANCELLED
        self.message = f"stopped while: {self.message}" if self.message else "stopped"


class Hook:
    """Hook by which a run controls its nodes: a node asks it at each tick, and reports to it when the node stops.

    A node at one of the `breakpoints` waits in the tick that would begin it, once; the next tick lets it pass. After a
    restart, `restored` has the states that nodes take in their first tick, `applied` the first answers of conditions
    (`Conditional`), and `unheld` the decorators whose first run ticks the child whatever would hold it back; `repeated`
    collects the nodes that ended with a result from before the restart, until the run has logged them.
    """

    def __init__(self) -> None:
        self.breakpoints: frozenset[str] = frozenset()
        self.waiting: dict[str, Behaviour] = {}
        self.restored: dict[str, tuple[Status, Cause | None, str]] = {}
        self.applied: dict[str, bool] = {}
        self.unheld: set[str] = set()
        self.repeated: set[str] = set()
        self.touched: set[Behaviour] = set()
        self.stopped: set[Behaviour] = set()

    @property
    def active(self) -> bool:
        """Returns whether the hook may change the tick of any node."""
        return bool(self.breakpoints or self.waiting or self.restored)

    def tick(self, node: Any) -> Iterator[Behaviour]:
        """Makes a node wait, or take the state restored for it; otherwise lets the node tick."""
        if self.waiting.pop(node.path_id, None) is not None and node.status == Status.RUNNING:
            node.status = Status.INVALID
        elif node.status != Status.RUNNING and node.path_id in self.breakpoints:
            self.waiting[node.path_id] = node
            node.say("waits at the breakpoint")
            node.status = Status.RUNNING
            yield node
            return
        restored = self.restored.pop(node.path_id, None)
        if restored is None:
            yield from node._tick()
            return
        node.restore(*restored)
        self.repeated.add(node.path_id)
        yield node

    def note_stop(self, node: Any, new_status: Status) -> None:
        """Records that a node has stopped, by itself or from outside (INVALID)."""
        self.touched.add(node)
        if new_status == Status.INVALID:
            self.stopped.add(node)
        if new_status != Status.INVALID or node.status == Status.RUNNING:
            self.unheld.discard(node.path_id)


@dataclass_transform(kw_only_default=True, eq_default=False, field_specifiers=(field,))
class _TakesKeywords:
    """Base class that turns each subclass into a dataclass with keyword arguments only."""

    def __init_subclass__(cls) -> None:
        dataclass(kw_only=True, eq=False, repr=False)(cls)


class ExplainedNode(_TakesKeywords, Explained):
    """Node that explains its status; `kind` names the kind of node in its spec."""

    kind: ClassVar[str] = ""
    output_types: ClassVar[Mapping[str, Any]] = MappingProxyType({})
    """Types of the written values, by the option with the blackboard key of each."""
    settled: ClassVar[bool] = False
    """After a restart its success stands, and nothing below it is repeated."""
    afresh: ClassVar[bool] = False
    """After a restart nothing of it is restored, since its condition calls it again."""
    runs_skill: ClassVar[bool] = False
    answers: ClassVar[bool] = False
    """It turns what its child found into the answer to a question."""
    skips: ClassVar[bool] = False
    """It succeeds although its child fails, and says why the child is skipped."""
    control: ClassVar[str] = ""
    """Its name among the control nodes of BehaviorTree.CPP."""
    plumbing: ClassVar[bool] = False
    """Displays leave it out while it has no cause."""
    watches: ClassVar[bool] = False
    """It stands above a mission, and displays fold it."""
    container: ClassVar[bool] = False
    """Its name is no policy of the step in it."""
    spoken: ClassVar[bool] = False
    """The row of its step begins with its kind."""
    counts: ClassVar[bool] = False
    """Its message is shown without a cause, too."""
    logged: ClassVar[bool] = False
    """Its end is a line on the screen."""
    usual: ClassVar[slice] = slice(None)
    """The children that run without failures."""
    path_id: str
    name: str
    hook: Hook = field(default_factory=Hook)
    cause: Cause | None = field(default=None, init=False)
    message: str = field(default="", init=False)

    @classmethod
    def writes(cls, options: Mapping[str, Any]) -> Mapping[str, Any]:
        """Returns the blackboard keys that a node with these options writes, and the type of each value."""
        return {options[name]: kind for name, kind in cls.output_types.items() if options.get(name)}

    def tick(self) -> Iterator[Behaviour]:
        """Runs one tick, which the run's hook may replace."""
        return self.hook.tick(self) if self.hook.active else self._tick()

    def _tick(self) -> Iterator[Behaviour]:
        raise NotImplementedError

    @classmethod
    def signs(cls, options: Mapping[str, Any]) -> Mapping[str, Any]:
        """Returns the keys under which the node writes an object's place, each with its `executive.tree.board.Sign`."""
        return {}

    @classmethod
    def usual_children(cls, node: Any) -> Any:
        """Returns those children in a node's spec that run one after another if nothing fails."""
        return node.children[cls.usual]

    @classmethod
    def estimate(cls, node: Any, walk: Any, first: bool) -> Any:
        """Estimates a node from its spec on a `walk` (`executive.tree.estimate`); with `first`, raises its error."""
        return walk.all_of(node, first)

    @classmethod
    def waiting_s(cls, node: Any, now_s: float) -> float:
        """Returns the time (s) that a node waits as its mission says, begun at a time of day (s after midnight)."""
        return float(sum(child.behaviour.waiting_s(child, now_s) for child in cls.usual_children(node)))

    def restore(self, status: Status, cause: Cause | None, message: str) -> None:
        """Restores the status, cause and message that the node had before a restart."""
        self.status, self.cause, self.message = status, cause, message

    @property
    def checkpoint(self) -> Mapping[str, Any]:
        """Checkpoint of the running skill for a restart; empty without one."""
        return {}

    def abandon(self) -> None:
        """Ends a running skill after the run; does nothing without one."""

    def answered(self) -> int | None:
        """Returns the node's answer to a question of the mission; None without one."""
        return None

    def omission(self) -> str | None:
        """Returns the step that the node has skipped, with the reason; None without one."""
        return None

    def waits_for_button(self) -> bool:
        """Returns whether the node may wait for somebody to press a button."""
        return False

    def fail(self, failure: Failed) -> Status:
        """Explains a failure that the node itself caused; returns FAILURE."""
        self.cause, self.message = failure.cause, failure.message
        return Status.FAILURE

    def say(self, message: str, status: Status = Status.SUCCESS) -> Status:
        """Sets a message without a cause; returns the status."""
        self.cause, self.message = None, message
        return status


class ExplainedLeaf(ExplainedNode, Behaviour):
    """Node without children."""

    def __post_init__(self) -> None:
        Behaviour.__init__(self, self.name)

    def stop(self, new_status: Status) -> None:
        """Stops the node."""
        self.hook.note_stop(self, new_status)
        super().stop(new_status)

    def _tick(self) -> Iterator[Behaviour]:
        """Runs one tick, like the method of py_trees, but without its debug texts and type checks."""
        if self.status != Status.RUNNING:
            self.clear_explanation()
            self.initialise()
        status = self.update()
        if status != Status.RUNNING:
            self.stop(status)
        self.status = status
        yield self


class ExplainedDecorator(ExplainedNode, Decorator):
    """Decorator that repeats its child's cause and message unless it has its own."""

    child: Behaviour
    before: Status | None = field(default=None, init=False)
    """Status at its end before a restart, if its child repeats its result from before."""

    def __post_init__(self) -> None:
        Decorator.__init__(self, self.name, self.child)

    def _tick(self) -> Iterator[Behaviour]:
        """Ticks the child unless the decorator prevents it, then updates; like py_trees, but without type checks."""
        if self.status != Status.RUNNING:
            self.initialise()
        status = None if self.path_id in self.hook.unheld else self._held_back()
        if status is None:
            yield from self.decorated.tick()
            status = self.update()
        if status != Status.RUNNING:
            self.stop(status)
        self.status = status
        yield self

    def _held_back(self) -> Status | None:
        """Returns the status for a tick without the child; None if the child must be ticked."""
        return None

    def stop(self, new_status: Status) -> None:
        """Stops the child; explains a stop while running, and clears the explanation at a reset."""
        self.hook.note_stop(self, new_status)
        interrupted = new_status == Status.INVALID and self.status == Status.RUNNING
        super().stop(new_status)
        if interrupted:
            self.explain_cancelled()
        elif new_status == Status.INVALID:
            self.clear_explanation()

    def pass_on(self) -> Status:
        """Copies the child's cause and message; returns the child's status."""
        failed = self.decorated.status == Status.FAILURE
        self.cause, self.message = (cause_of(self.decorated) if failed else None), message_of(self.decorated)
        return self.decorated.status


class MemoryComposite(ExplainedNode, Composite):
    """Composite that ticks its children one after another, in the order of `_following`, and keeps their results."""

    goes_on_after: ClassVar[tuple[Status, ...]] = (Status.SUCCESS,)
    least: ClassVar[int] = 1
    children: list[Behaviour]
    resumed: bool = field(default=False, init=False)
    """Set when the mission continues after a restart: the first tick then clears no blackboard keys."""
    _index: int = field(default=0, init=False)

    def __post_init__(self) -> None:
        if len(self.children) < self.least:
            raise ValueError(f"{self.path_id}: a {type(self).__name__} needs at least one child")
        Composite.__init__(self, self.name, list(self.children))

    def _tick(self) -> Iterator[Behaviour]:
        """Ticks the present child, and in the same tick the children that follow it."""
        if self.status != Status.RUNNING:
            self._restart()
        while True:
            child = self.current_child = self.children[self._index]
            if not self._passes_over(child):
                yield from child.tick()
            following = None if child.status == Status.RUNNING else self._following(child)
            if following is None:
                break
            self._index = following
        self._take_over(child)
        yield self

    def stop(self, new_status: Status = Status.INVALID) -> None:
        """Stops the running children when the node is interrupted, and keeps the results of others; else resets all."""
        self.hook.note_stop(self, new_status)
        if new_status == Status.INVALID:
            interrupted = self.status == Status.RUNNING
            for child in self.children:
                if not interrupted or child.status == Status.RUNNING:
                    child.stop(Status.INVALID)
            if interrupted:
                self.explain_cancelled()
            else:
                self.clear_explanation()
        self.status = new_status
        self.iterator = self.tick()

    def _passes_over(self, child: Behaviour) -> bool:
        return False

    def _following(self, child: Behaviour) -> int | None:
        """Returns the index of the child to tick next, in the same tick, after the present child ended, or None."""
        goes_on = child.status in self.goes_on_after and self._index + 1 < len(self.children)
        return self._index + 1 if goes_on else None

    def _restart(self) -> None:
        resumed, self.resumed, self._index = self.resumed, False, 0
        self.clear_explanation()
        self._reset_children()
        if not resumed:
            self._forget()

    def _forget(self) -> None:
        """Clears the blackboard keys that an earlier run of the node has written."""

    def _reset_children(self) -> None:
        for child in self.children:
            child.stop(Status.INVALID)

    def _take_over(self, child: Behaviour) -> None:
        """Copies the child's status, cause and message."""
        status = child.status if child.status != Status.INVALID else Status.FAILURE
        self.cause, self.message = self._explanation(child) if status == Status.FAILURE else (None, message_of(child))
        if status == Status.RUNNING:
            self.status = status
        else:
            self.stop(status)

    def _explanation(self, child: Behaviour) -> tuple[Cause, str]:
        return cause_of(child), message_of(child)

    def _go_on(self, message: str) -> None:
        """Stays RUNNING, with this message."""
        self.status, self.cause, self.message = Status.RUNNING, None, message

    def _end(self, cause: Cause | None, message: str) -> None:
        """Ends with FAILURE if there is a cause, else with SUCCESS."""
        self.cause, self.message = cause, message
        self.stop(Status.SUCCESS if cause is None else Status.FAILURE)


def cause_of(node: Behaviour) -> Cause:
    """Returns the node's cause; EXECUTION for a node of py_trees without a cause."""
    cause = node.cause if isinstance(node, Explained) else None
    return cause or Cause.EXECUTION


def failed_for_good(node: Behaviour) -> bool:
    """Returns whether the node, or one below it, has a failure that is final."""
    return any(isinstance(one, Explained) and one.status == Status.FAILURE and one.final for one in node.iterate())


def message_of(node: Behaviour) -> str:
    """Returns the node's message without full stop; for a node of py_trees its feedback, else its name and status."""
    message = node.message if isinstance(node, Explained) else node.feedback_message
    ended = "failed" if node.status == Status.FAILURE else "goes on"
    return re.sub(r"(?<!\.)\.$", "", message) or f"{node.name} {ended}"


@runtime_checkable
class Conditional(Protocol):
    """Node that a selector skips, without a failure, when the node's condition does not hold."""

    def applies(self) -> bool:
        """Returns whether the node's condition holds, so that it may be ticked."""


def applies(node: Behaviour) -> bool:
    """Returns whether a node may be ticked now: as answered before a restart, else by its condition."""
    if not isinstance(node, Conditional):
        return True
    before = node.hook.applied.pop(node.path_id, None) if isinstance(node, ExplainedNode) else None
    return node.applies() if before is None else before


@runtime_checkable
class Suspendable(Protocol):
    """Node that must be suspended before its ticks pause."""

    def suspend(self) -> None:
        """Stops the robot and the node's own stopwatch until the next tick. Idempotent; never raises."""


def suspend(root: Behaviour, *, sparing: Behaviour | None = None) -> None:
    """Suspends all running nodes of a tree: their motion stops, and they keep their state. Idempotent.

    The node `sparing` and its descendants continue. The next tick continues the tree: each suspended skill gets
    `resume`, which by default begins it again. To end the work for good, stop the tree instead.
    """
    spared = set() if sparing is None else set(sparing.iterate())
    for node in root.iterate():
        if node not in spared and node.status == Status.RUNNING and isinstance(node, Suspendable):
            node.suspend()


class StoppableTime:
    """Stopwatch on the robot's clock that counts seconds since its creation, except while it is stopped."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._start_s = clock.now()
        self._stopped_s: float | None = None

    @property
    def stopped(self) -> bool:
        """Returns whether the stopwatch has been stopped and not continued."""
        return self._stopped_s is not None

    def elapsed_s(self) -> float:
        """Returns the counted seconds so far."""
        until_s = self._clock.now() if self._stopped_s is None else self._stopped_s
        return until_s - self._start_s

    def stop(self) -> None:
        """Stops counting; idempotent."""
        if self._stopped_s is None:
            self._stopped_s = self._clock.now()

    def go_on(self) -> None:
        """Continues counting; does nothing unless stopped."""
        if self._stopped_s is not None:
            self._start_s += self._clock.now() - self._stopped_s
            self._stopped_s = None
