"""The root of a mission's tree: monitors and interrupts by priority above the mission itself.

    stop button > lost lease > battery low > localisation lost > mission

A monitor that is violated ends the mission. An interrupt that is called suspends all below it, does its work (to the
dock and charge, find out where the robot is), and the mission goes on where it was.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Final

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from executive.tree.behaviours.composites import MemoryComposite
from executive.tree.behaviours.conditions import Condition, Waiting
from executive.tree.behaviours.context import RunContext
from executive.tree.behaviours.decorators import ExplainedDecorator
from executive.tree.behaviours.explained import Explained, cause_of, message_of
from executive.tree.behaviours.requirements import Requirement
from executive.tree.behaviours.skill_leaf import SkillLeaf
from executive.tree.behaviours.suspension import suspend
from executive.tree.node import NodeKind
from skills.api import Cause, Failed


class Monitor(Explained, Behaviour):
    """Looks at a condition at every tick.

    Holds: SUCCESS. Waiting: RUNNING, the mission stands still. Violated: FAILURE with the condition's cause.
    """

    waiting: Final = ""

    def __init__(self, *, path_id: str, name: str, condition: Condition, context: RunContext) -> None:
        super().__init__(name)
        self.path_id = path_id
        self._condition, self._context = condition, context
        self.clear_explanation()

    def begin(self) -> None:
        """The mission starts."""
        self._condition.begin(self._context)

    def wants_tick(self, mission: Behaviour) -> bool:
        """Always."""
        return True

    def update(self) -> Status:
        """Look."""
        verdict = self._condition.violated(self._context)
        if verdict is None:
            self.cause, self.message = None, "holds"
            return Status.SUCCESS
        self.message = verdict.message
        if isinstance(verdict, Waiting):
            self.cause = None
            return Status.RUNNING
        self.cause = verdict.cause
        return Status.FAILURE


@dataclass(frozen=True)
class Call:
    """What calls an interrupt: `condition` is violated. It must not even wait for the handling of an object to end when
    `urgent` is violated, too."""

    condition: Condition
    urgent: Condition | None = None


class Interrupt(ExplainedDecorator):
    """Work that is done between two ticks of the mission when it is called for, `uses` times at most.

    Never called: idle. Child RUNNING or SUCCESS: the same. Child FAILURE, or called once too often: FAILURE.
    While the mission runs a skill named in `spares` the call waits, unless it is urgent.
    """

    def __init__(
        self,
        *,
        path_id: str,
        name: str,
        child: Behaviour,
        call: Call,
        spares: frozenset[str],
        uses: int,
        context: RunContext,
    ) -> None:
        super().__init__(path_id=path_id, name=name, child=child)
        self._call, self._spares, self._uses, self._context = call, spares, uses, context
        self.count = 0
        self.waiting = ""
        self._why = ""

    def begin(self) -> None:
        """The mission starts: count from zero."""
        self.count, self.waiting = 0, ""
        for condition in filter(None, (self._call.condition, self._call.urgent)):
            condition.begin(self._context)

    def wants_tick(self, mission: Behaviour) -> bool:
        """Whether it is under way or called; `waiting` says what it waits for before it can tell."""
        self.waiting = ""
        if self.status == Status.RUNNING:
            return True
        verdict = self._call.condition.violated(self._context)
        if isinstance(verdict, Waiting):
            self.waiting = verdict.message
        if not isinstance(verdict, Failed) or (self._spared(mission) and not self._urgent()):
            return False
        self._why = verdict.message
        return True

    def initialise(self) -> None:
        """It begins."""
        self.count += 1

    def tick(self) -> Iterator[Behaviour]:
        """As the child, unless this is once too often."""
        if self.status == Status.RUNNING or self.count < self._uses:
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
        urgent = self._call.urgent
        return urgent is not None and isinstance(urgent.violated(self._context), Failed)

    def _spared(self, mission: Behaviour) -> bool:
        running = (n for n in mission.iterate() if isinstance(n, SkillLeaf) and n.status == Status.RUNNING)
        return any(leaf.skill_name in self._spares for leaf in running)


class Interrupts(MemoryComposite):
    """Monitors and interrupts, the most important first, above the mission, the last child.

    At every tick they are looked at in order. Monitor violated: FAILURE with its cause, all below is stopped. Monitor
    or call waiting: all below is suspended, RUNNING. Interrupt called or under way: all below is suspended and it is
    ticked: RUNNING, or FAILURE with its cause when it fails; when it succeeds, the next are looked at in the same tick.
    With nothing to do, the mission is ticked, and its status, cause and sentence are taken over.
    """

    goes_on_after = frozenset({Status.SUCCESS})

    def __init__(self, *, path_id: str, name: str, watches: Sequence[Monitor | Interrupt], mission: Behaviour) -> None:
        super().__init__(path_id=path_id, name=name, children=[*watches, mission])
        self._watches, self._mission = tuple(watches), mission

    def tick(self) -> Iterator[Behaviour]:
        """Look at the watches in order; tick the first that has to do, else the mission."""
        if self.status != Status.RUNNING:
            self._restart()
            for watch in self._watches:
                watch.begin()
        for number, watch in enumerate(self._watches):
            if watch.wants_tick(self._mission):
                yield from watch.tick()
            if watch.waiting or watch.status in (Status.RUNNING, Status.FAILURE):
                self._hold(watch, self.children[number + 1 :])
                yield self
                return
        self.current_child = self._mission
        yield from self._mission.tick()
        self._take_over(self._mission)
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


def _monitor(*, requirement: Requirement, context: RunContext, **node: Any) -> Monitor:
    return Monitor(condition=requirement.condition(context), context=context, **node)


def _interrupt(
    *, requirement: Requirement, context: RunContext, urgent: Requirement | None = None, **node: Any
) -> Interrupt:
    call = Call(requirement.condition(context), None if urgent is None else urgent.condition(context))
    return Interrupt(call=call, context=context, **node)


def _interrupts(*, children: Sequence[Any], **node: Any) -> Interrupts:
    *watches, mission = children
    return Interrupts(watches=watches, mission=mission, **node)


KINDS: Final[Mapping[str, NodeKind]] = MappingProxyType(
    {
        "monitor": NodeKind(_monitor, ("context",)),
        "interrupt": NodeKind(_interrupt, ("child", "context")),
        "interrupts": NodeKind(_interrupts, ("children",)),
    }
)
