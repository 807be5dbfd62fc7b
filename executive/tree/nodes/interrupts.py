"""Root of every mission's tree: monitors and interrupts by priority above the mission itself.

    stop button > lost lease > battery low > localisation lost > mission

A violated monitor ends the mission. A called interrupt suspends everything of lower priority and does its work (it
charges at the dock, or localises the robot); then the mission continues where it was.
"""

from collections.abc import Iterator, Sequence
from dataclasses import field
from typing import Any, ClassVar, Final

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from executive.tree.behaviour import ExplainedDecorator, ExplainedLeaf, MemoryComposite, cause_of, message_of, suspend
from executive.tree.board import FromBoard
from executive.tree.context import RunContext
from executive.tree.node import NodeSpec
from executive.tree.nodes.dock import dock_plan
from executive.tree.nodes.guard import BatteryForWork, Condition, KnowsPlace, NoStopButton, OwnLease, Waiting
from executive.tree.nodes.recovery import Recovery, Trigger
from executive.tree.nodes.skill_leaf import SkillLeaf
from executive.tree.plan import PlanBuilder
from executive.words.knowledge import Pose
from skills.api import Cause, Failed

HANDLING: Final = frozenset({"grasp", "place", "hand_over", "stow"})
"""Skills that an interrupt does not suspend, since their object is not held safely meanwhile."""
MOST_CHARGES: Final = 5
MOST_RELOCALISATIONS: Final = 5
LOST_PATIENCE_S: Final = 2.0


class Monitor(ExplainedLeaf):
    """Leaf that judges a condition at every tick.

    | condition | status |
    |---|---|
    | holds | SUCCESS |
    | waiting | RUNNING; the mission is suspended |
    | violated | FAILURE with the condition's cause; the mission ends |
    """

    kind = "monitor"
    plumbing = True
    watches = True
    waiting: ClassVar[str] = ""
    condition: Condition
    context: RunContext

    def __post_init__(self) -> None:
        super().__post_init__()
        self.condition = self.condition.for_run(self.context)

    def begin(self) -> None:
        """Handles the start of the mission."""
        self.condition.begin(self.context)

    def wants_tick(self, mission: Behaviour) -> bool:
        """Returns True, because a monitor is ticked at every tick."""
        return True

    def update(self) -> Status:
        """Judges the condition."""
        verdict = self.condition.check(self.context)
        if isinstance(verdict, Failed):
            return self.fail(verdict)
        return self.say("holds") if verdict is None else self.say(verdict.message, Status.RUNNING)


class Interrupt(ExplainedDecorator):
    """Decorator whose child interrupts the mission when `condition` is violated, at most `uses` times.

    | case | status |
    |---|---|
    | never triggered | INVALID |
    | child RUNNING, SUCCESS | as the child |
    | child FAILURE | FAILURE with its cause |
    | triggered more than `uses` times | FAILURE with EXECUTION |
    | halted | INVALID with CANCELLED |

    While the mission runs a skill named in `spares`, the interrupt waits, unless `urgent` is violated too.
    """

    kind = "interrupt"
    watches = True
    afresh = True
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
        """Handles the start of the mission: counts calls from zero."""
        self.count, self.waiting = 0, ""
        for condition in filter(None, (self.condition, self.urgent)):
            condition.begin(self.context)

    def wants_tick(self, mission: Behaviour) -> bool:
        """Returns whether the interrupt is running or called; sets `waiting` while its condition cannot be judged."""
        self.waiting = ""
        if self.status == Status.RUNNING:
            return True
        verdict = self.condition.check(self.context)
        if isinstance(verdict, Waiting):
            self.waiting = verdict.message
        if not isinstance(verdict, Failed):
            return False
        running = (n for n in mission.iterate() if isinstance(n, SkillLeaf) and n.status == Status.RUNNING)
        spared = any(leaf.skill_name in self.spares for leaf in running)
        if spared and not (self.urgent and isinstance(self.urgent.check(self.context), Failed)):
            return False
        self._why = verdict.message
        return True

    def initialise(self) -> None:
        """Counts the call that begins."""
        self.count += 1
        self.condition.note_call()

    def _held_back(self) -> Status | None:
        if self.count <= self.uses:
            return None
        return self.fail(Failed(Cause.EXECUTION, f"{self._why}, again after {self.uses} times {self.name}"))

    def update(self) -> Status:
        """Returns the child's status, with the reason of the call before its message."""
        status = self.pass_on()
        self.message = f"{self._why}: {self.message}"
        return status


class Interrupts(MemoryComposite):
    """Composite of monitors and interrupts, the most important first, above the mission, which is the last child.

    At every tick they are checked in order:

    | monitor or interrupt | children after it | status |
    |---|---|---|
    | monitor holds, interrupt not called or SUCCESS | the next one is checked in the same tick | as that one |
    | monitor or condition of an interrupt is waiting | suspended | RUNNING |
    | interrupt RUNNING | suspended | RUNNING |
    | monitor or interrupt FAILURE | halted | FAILURE with its cause |
    | none of these | the mission is ticked | as the mission |
    | halted | halted | INVALID with CANCELLED |
    """

    kind = "interrupts"
    usual = slice(-1, None)
    watches = True
    container = True

    def _tick(self) -> Iterator[Behaviour]:
        """Ticks monitors and called interrupts in order, then the mission."""
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
        """Suspends all children below a monitor or interrupt; halts them when it has failed."""
        self.current_child = watch
        if not watch.waiting and watch.status == Status.FAILURE:
            for child in below:
                if child.status == Status.RUNNING:
                    child.stop(Status.INVALID)
            self._end(cause_of(watch), message_of(watch))
            return
        for child in below:
            suspend(child)
        self._go_on(watch.waiting or message_of(watch))


def watch_plan(builder: PlanBuilder, mission: NodeSpec) -> NodeSpec:
    """Builds the root with monitors and interrupts above the mission; `builder` is the builder of the mission.

    Raises InputError when a skill that the interrupts need is not registered.
    """
    below = builder.at("watch")
    watches = (
        below.node("monitor", "stop button released", part="stop-button", condition=NoStopButton()),
        below.node("monitor", "lease held", part="lease", condition=OwnLease()),
        *([] if builder.knowledge.dock is None else [_battery_plan(below.at("battery"), builder.knowledge.dock)]),
        _lost_plan(below.at("lost")),
    )
    return below.node("interrupts", f"{mission.name}, watched", *watches, mission)


def _battery_plan(builder: PlanBuilder, place: Pose) -> NodeSpec:
    """Charges at the dock and returns to the earlier pose; urgent below half of the charge that triggers charging."""
    facts, dock = builder.knowledge.battery, place.pose_2d()
    key = builder.key("where")
    work = builder.at("charge").sequence(
        f"charge to {facts.charged:.0%}",
        builder.node("remember", "where it was", part="remember", key=key),
        builder.skill("stow"),
        dock_plan(builder.at("dock"), dock, facts.charged),
        builder.at("back").navigate(FromBoard(key), "where it was"),
    )
    below, lost = builder.at("lost"), Recovery((Trigger(frozenset({Cause.PRECONDITION, Cause.EXECUTION})),))
    return builder.node(
        "interrupt",
        "battery low: charge",
        below.recover(work.name, work, (below.skill("relocalise"), lost), attempts=2),
        spares=HANDLING,
        uses=MOST_CHARGES,
        condition=BatteryForWork(facts.low, dock),
        urgent=BatteryForWork(0.5 * facts.low, dock),
    )


def _lost_plan(builder: PlanBuilder) -> NodeSpec:
    settle = builder.pause("settle", "stand still")
    find_out = builder.at("find-out").sequence("find out where it is", settle, builder.skill("relocalise"))
    return builder.node(
        "interrupt",
        "localisation lost: find out where it is",
        find_out,
        spares=HANDLING,
        uses=MOST_RELOCALISATIONS,
        condition=KnowsPlace(patience_s=LOST_PATIENCE_S),
    )
