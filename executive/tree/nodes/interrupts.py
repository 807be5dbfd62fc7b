"""The root of a mission's tree: monitors and interrupts by priority above the mission itself.

    stop button > lost lease > battery low > localisation lost > mission

A monitor that is violated ends the mission. An interrupt that is called suspends all below it, does its work (to the
dock and charge, find out where the robot is), and the mission goes on where it was.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar, Final

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from executive.tree.behaviours.composites import MemoryComposite
from executive.tree.behaviours.conditions import Condition, Waiting
from executive.tree.behaviours.context import RunContext
from executive.tree.behaviours.decorators import ExplainedDecorator
from executive.tree.behaviours.explained import ExplainedLeaf, cause_of, message_of
from executive.tree.behaviours.skill_leaf import SkillLeaf
from executive.tree.behaviours.suspension import suspend
from executive.tree.node import NodeKind
from skills.api import Cause, Failed


@dataclass(kw_only=True, eq=False, repr=False)
class Monitor(ExplainedLeaf):
    """Looks at a condition at every tick.

    Holds: SUCCESS. Waiting: RUNNING, the mission stands still. Violated: FAILURE with the condition's cause.
    """

    waiting: ClassVar[str] = ""
    condition: Condition
    context: RunContext

    def __post_init__(self) -> None:
        super().__post_init__()
        self.condition = self.condition.for_run(self.context)

    def begin(self) -> None:
        """The mission starts."""
        self.condition.begin(self.context)

    def wants_tick(self, mission: Behaviour) -> bool:
        """Always."""
        return True

    def update(self) -> Status:
        """Look."""
        verdict = self.condition.violated(self.context)
        if verdict is None:
            self.cause, self.message = None, "holds"
            return Status.SUCCESS
        self.message = verdict.message
        if isinstance(verdict, Waiting):
            self.cause = None
            return Status.RUNNING
        self.cause = verdict.cause
        return Status.FAILURE


@dataclass(kw_only=True, eq=False, repr=False)
class Interrupt(ExplainedDecorator):
    """Work that is done between two ticks of the mission when it is called for, `uses` times at most.

    It is called when `condition` is violated. Never called: idle. Child RUNNING or SUCCESS: the same. Child FAILURE,
    or called once too often: FAILURE.
    While the mission runs a skill named in `spares` the call waits, unless `urgent` is violated, too.
    """

    condition: Condition
    urgent: Condition | None = None
    spares: frozenset[str]
    uses: int
    context: RunContext
    count: int = field(default=0, init=False)
    waiting: str = field(default="", init=False)
    _why: str = field(default="", init=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        self.condition = self.condition.for_run(self.context)
        self.urgent = None if self.urgent is None else self.urgent.for_run(self.context)

    def begin(self) -> None:
        """The mission starts: count from zero."""
        self.count, self.waiting = 0, ""
        for condition in filter(None, (self.condition, self.urgent)):
            condition.begin(self.context)

    def wants_tick(self, mission: Behaviour) -> bool:
        """Whether it is under way or called; `waiting` says what it waits for before it can tell."""
        self.waiting = ""
        if self.status == Status.RUNNING:
            return True
        verdict = self.condition.violated(self.context)
        if isinstance(verdict, Waiting):
            self.waiting = verdict.message
        if not isinstance(verdict, Failed) or (self._spared(mission) and not self._urgent()):
            return False
        self._why = verdict.message
        return True

    def initialise(self) -> None:
        """It begins."""
        self.count += 1
        self.condition.called()

    def tick(self) -> Iterator[Behaviour]:
        """As the child, unless this is once too often."""
        if self.status == Status.RUNNING or self.count < self.uses:
            yield from super().tick()
            return
        self.stop(self.fail(Failed(Cause.EXECUTION, f"{self._why}, again after {self.count} times {self.name}")))
        yield self

    def update(self) -> Status:
        """As the child, with the reason in front."""
        status = self.pass_on()
        self.message = f"{self._why}: {self.message}"
        return status

    def _urgent(self) -> bool:
        return self.urgent is not None and isinstance(self.urgent.violated(self.context), Failed)

    def _spared(self, mission: Behaviour) -> bool:
        running = (n for n in mission.iterate() if isinstance(n, SkillLeaf) and n.status == Status.RUNNING)
        return any(leaf.skill_name in self.spares for leaf in running)


class Interrupts(MemoryComposite):
    """Monitors and interrupts, the most important first, above the mission, which is the last child.

    At every tick they are looked at in order. Monitor violated: FAILURE with its cause, all below is stopped. Monitor
    or call waiting: all below is suspended, RUNNING. Interrupt called or under way: all below is suspended and it is
    ticked: RUNNING, or FAILURE with its cause when it fails; when it succeeds, the next are looked at in the same tick.
    With nothing to do, the mission is ticked, and its status, cause and sentence are taken over.
    """

    def tick(self) -> Iterator[Behaviour]:
        """Look at the watches in order; tick the first that has to do, else the mission."""
        watches: list[Any] = self.children[:-1]
        mission = self.children[-1]
        if self.status != Status.RUNNING:
            self._restart()
            for watch in watches:
                watch.begin()
        for number, watch in enumerate(watches):
            if watch.wants_tick(mission):
                yield from watch.tick()
            if watch.waiting or watch.status in (Status.RUNNING, Status.FAILURE):
                self._hold(watch, self.children[number + 1 :])
                yield self
                return
        self.current_child = mission
        yield from mission.tick()
        self._take_over(mission)
        yield self

    def _hold(self, watch: Monitor | Interrupt, below: Sequence[Behaviour]) -> None:
        """Let nothing below a watch move; give it up when the watch failed."""
        self.current_child = watch
        if not watch.waiting and watch.status == Status.FAILURE:
            for child in below:
                if child.status == Status.RUNNING:
                    child.stop(Status.INVALID)
            self.cause, self.message = cause_of(watch), message_of(watch)
            self.stop(Status.FAILURE)
            return
        for child in below:
            suspend(child)
        self.status, self.cause, self.message = Status.RUNNING, None, watch.waiting or message_of(watch)


KINDS: Final[Mapping[str, NodeKind]] = {
    "monitor": NodeKind(Monitor, ("context",)),
    "interrupt": NodeKind(Interrupt, ("child", "context")),
    "interrupts": NodeKind(Interrupts, ("children",)),
}
