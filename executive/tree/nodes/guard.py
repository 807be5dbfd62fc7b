"""Conditions that must hold while nodes run, and what they make of readings that are too old.

They stand in a compiled tree as plain data; each run looks at them by copies of its own. A condition answers with None
when it holds, `Failed` when it does not, and `Waiting` when that cannot be said yet.
"""

from __future__ import annotations

import copy
import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import ClassVar, Self

from py_trees.common import Status

from executive.tree.behaviour import ExplainedDecorator, suspend
from executive.tree.context import RunContext
from executive.words.policy import StaleData
from skills.api import Cause, Failed, ObjectKind
from skills.manipulation.arm.hold import Grip, HoldWatch, grip_again, hold_watch
from skills.perception.class_forms import THING
from skills.robot import Pose2D

CONTROL_TOPIC = "control"


@dataclass(frozen=True)
class Waiting:
    """Nothing can be said yet; one plain sentence on what is waited for. The nodes below stand still meanwhile."""

    message: str


Verdict = Failed | Waiting | None


@dataclass(frozen=True)
class Freshness:
    """How old (s) a reading may be, what happens when it is older, and how long WAIT waits at most (s)."""

    max_age_s: float = 1.0
    policy: StaleData = StaleData.WAIT
    patience_s: float = 5.0


@dataclass
class Condition(ABC):
    """Something that must hold while a subtree runs; `stale` says what an old reading means (None: as usual).

    Reading fresh, or policy ACCEPT: as `judged`. Too old: Waiting (WAIT) until the patience is over, then, or at once
    (FAIL), Failed with PRECONDITION.
    """

    reading: ClassVar[str] = ""
    freshness: ClassVar[Freshness] = Freshness()
    stale: StaleData | None = field(default=None, kw_only=True)
    _since_s: float | None = field(default=None, init=False, repr=False, compare=False)
    _stale_since_s: float | None = field(default=None, init=False, repr=False, compare=False)

    @abstractmethod
    def judged(self, context: RunContext) -> Verdict:
        """What the readings say against going on, None when nothing does."""

    def stamp_s(self, context: RunContext) -> float:
        """When the reading was taken; now where there is none."""
        return context.clock.now()

    def for_run(self, context: RunContext) -> Self:
        """A copy for a run that begins now."""
        mine = copy.copy(self)
        mine.run_begins(context)
        return mine

    def run_begins(self, context: RunContext) -> None:  # noqa: B027 - most conditions need not know
        """The run begins for which this is a copy."""

    def begin(self, context: RunContext) -> None:
        """The subtree starts anew: forget for how long something was so."""
        self._since_s = self._stale_since_s = None

    def called(self) -> None:  # noqa: B027 - most conditions need not know
        """What is done about it has begun."""

    def violated_at_end(self, context: RunContext) -> Failed | None:
        """What speaks against a success of the subtree, None when nothing does."""
        return None

    def violated(self, context: RunContext) -> Verdict:
        """What speaks against going on, None when nothing does. Called before each tick of the subtree."""
        fresh, policy = self.freshness, self.stale or self.freshness.policy
        if policy is StaleData.ACCEPT:
            return self.judged(context)
        now_s = context.clock.now()
        age_s = now_s - self.stamp_s(context)
        if age_s <= fresh.max_age_s:
            self._stale_since_s = None
            return self.judged(context)
        self._stale_since_s = now_s if self._stale_since_s is None else self._stale_since_s
        old = f"the last reading of {self.reading} is {age_s:.1f} s old"
        said = old if math.isfinite(age_s) else f"there is no reading of {self.reading} yet"
        if policy is StaleData.WAIT and now_s - self._stale_since_s <= fresh.patience_s:
            return Waiting(f"waits for {self.reading}: {said}")
        return Failed(Cause.PRECONDITION, said)


def is_known_as(item: ObjectKind | None, classes: Sequence[str], attributes: Sequence[str] = ()) -> bool:
    """Whether an object was taken for one of these classes, or any (`THING`), with at least these attributes."""
    if item is None:
        return False
    return (THING in classes or item.name in classes) and set(attributes) <= set(item.attributes)


@dataclass
class Holds(Condition):
    """The gripper holds `item`, which is brought `to` somewhere ("to the kitchen").

    PRECONDITION at the start when what it holds was taken for something else than one of the classes `known_as` with
    all `attributes`; of what nobody knows, as after a restart, it is believed.

    PRECONDITION when nothing is held at the start, EXECUTION when it is lost on the way, within 0.3 s. What begins to
    slip is gripped again more firmly, once; EXECUTION when it slips on. With `until_put_down` the gripper may open to
    let go, what slips on is left to the skill that puts it down, and so is an empty gripper at the start; what is lost
    while it is offered is left to the skill that offers it. Without it, the gripper holds it at the end, too.
    """

    reading = "the gripper"
    item: str
    to: str = ""
    until_put_down: bool = False
    known_as: tuple[str, ...] = ()
    attributes: tuple[str, ...] = ()
    _begins: bool = field(default=True, init=False, repr=False, compare=False)
    _watch: HoldWatch = field(default_factory=HoldWatch, init=False, repr=False, compare=False)

    def stamp_s(self, context: RunContext) -> float:
        """The gripper's stamp."""
        return context.robot.gripper().stamp_s

    def begin(self, context: RunContext) -> None:
        """The subtree starts anew: nothing has been held yet."""
        super().begin(context)
        self._watch, self._begins = hold_watch(context.robot.capabilities()), True

    def judged(self, context: RunContext) -> Verdict:
        """A failure when it is lost or slips on, or is another object; grips again what slips."""
        watch, held = self._watch, context.payload.kind
        begins, self._begins = self._begins, False
        another = held is not None and self.known_as and not is_known_as(held, self.known_as, self.attributes)
        if begins and another and context.robot.gripper().holding:
            return Failed(Cause.PRECONDITION, f"the gripper holds the {held}, not the {self.item}")
        grip = watch.judge(context.robot.gripper(), context.clock.now())
        if grip is Grip.SLIPPING:
            grip_again(context.robot, watch.force_n, clock=context.clock, lease=context.lease)
            sentence = f"the {self.item} began to slip and is gripped again, more firmly"
            context.publish(CONTROL_TOPIC, {"t": round(context.clock.now(), 6), "what": "slip", "message": sentence})
        if grip is Grip.EMPTY:
            why = f"there is no {self.item} in the gripper"
            return None if self.until_put_down else Failed(Cause.PRECONDITION, why)
        if grip is Grip.LOST and self.until_put_down and context.payload.offered:
            return None
        if grip is Grip.LOST or (grip is Grip.RELEASED and not self.until_put_down):
            return Failed(Cause.EXECUTION, f"the {self.item} was lost on the way{self._to}")
        if grip is Grip.SLIPS_ON and not self.until_put_down:
            return Failed(Cause.EXECUTION, f"the {self.item} slips out of the gripper on the way{self._to}")
        return None

    def violated_at_end(self, context: RunContext) -> Failed | None:
        """A failure when the gripper feels nothing any more."""
        if self.until_put_down or context.robot.gripper().holding:
            return None
        return Failed(Cause.EXECUTION, f"the {self.item} was lost on the way{self._to}")

    @property
    def _to(self) -> str:
        return f" {self.to}" if self.to else ""


@dataclass
class HoldsNothingElse(Condition):
    """The gripper holds no other object when `item` is to be taken, one of the classes `known_as` with `attributes`.

    PRECONDITION at the start when what it holds was taken for something else; what nobody knows, as after a restart, is
    left to the skill that grasps.
    """

    reading = "the gripper"
    item: str
    known_as: tuple[str, ...]
    attributes: tuple[str, ...] = ()
    _begins: bool = field(default=True, init=False, repr=False, compare=False)

    def begin(self, context: RunContext) -> None:
        """The subtree starts anew: the gripper is felt once more."""
        super().begin(context)
        self._begins = True

    def judged(self, context: RunContext) -> Verdict:
        """A failure when it begins with another object."""
        begins, self._begins = self._begins, False
        held = context.payload.kind
        if not begins or held is None or not context.robot.gripper().holding:
            return None
        if is_known_as(held, self.known_as, self.attributes):
            return None
        return Failed(Cause.PRECONDITION, f"the gripper holds the {held} already; put it down first")


@dataclass
class KnowsPlace(Condition):
    """The robot knows where it is. Not knowing for up to `patience_s` (robot's clock) is let pass; PRECONDITION."""

    reading = "its place"
    freshness = Freshness(2.0)
    patience_s: float = 5.0

    def stamp_s(self, context: RunContext) -> float:
        """The estimate's stamp."""
        return context.localiser.estimate().stamp_s

    def judged(self, context: RunContext) -> Verdict:
        """A failure when the place has been unknown for longer than the patience."""
        if context.localiser.estimate().localised:
            self._since_s = None
            return None
        now_s = context.clock.now()
        self._since_s = now_s if self._since_s is None else self._since_s
        if now_s - self._since_s <= self.patience_s:
            return None
        return Failed(Cause.PRECONDITION, "the robot does not know where it is")


@dataclass
class BatteryAtLeast(Condition):
    """The battery's charge (0 to 1) is at least `charge`; an old reading will do, since charge changes slowly."""

    reading = "the battery"
    freshness = Freshness(10.0, StaleData.ACCEPT)
    charge: float

    def stamp_s(self, context: RunContext) -> float:
        """The battery's stamp."""
        return context.robot.battery().stamp_s

    def judged(self, context: RunContext) -> Verdict:
        """A failure with PRECONDITION when the charge is below."""
        charge, least = context.robot.battery().charge, self.least(context)
        if charge >= least:
            return None
        return Failed(Cause.PRECONDITION, f"the battery is at {charge:.0%}, less than {least:.0%}")

    def least(self, context: RunContext) -> float:
        """The least charge that is enough here."""
        return self.charge


@dataclass
class BatteryForWork(BatteryAtLeast):
    """The charge is at least `charge`, and enough for the route to the dock.

    The route is taken as twice the distance as the crow flies, at `per_m` of charge for each metre.
    """

    dock: Pose2D
    per_m: float = 0.0008

    def least(self, context: RunContext) -> float:
        """More, the farther the dock is."""
        here = context.pose()
        return max(self.charge, 2.0 * self.per_m * math.hypot(here.x_m - self.dock.x_m, here.y_m - self.dock.y_m))


@dataclass
class NoStopButton(Condition):
    """No stop button is pressed. The mission stands still as long as one is."""

    def judged(self, context: RunContext) -> Verdict:
        """Waiting while it is pressed."""
        pressed = context.stop_pressed()
        return None if pressed is None else Waiting(pressed)


@dataclass
class OwnLease(Condition):
    """Nobody else may move the robot. The mission stands still as long as somebody does."""

    def judged(self, context: RunContext) -> Verdict:
        """Waiting while another holds the lease."""
        held = context.robot.lease_holder()
        if held is None or held.holder == context.lease.holder:
            return None
        return Waiting(f"{held.holder} holds the lease of {context.robot.name}")


@dataclass
class NotAfter(Condition):
    """At most `limit_s` on the robot's clock have passed since the run began; TIMEOUT when not."""

    limit_s: float
    _begun_s: float = field(default=0.0, init=False, repr=False, compare=False)

    def run_begins(self, context: RunContext) -> None:
        """Count from now."""
        self._begun_s = context.clock.now()

    def judged(self, context: RunContext) -> Verdict:
        """A failure when the time is over."""
        if context.clock.now() - self._begun_s <= self.limit_s:
            return None
        return Failed(Cause.TIMEOUT, f"more than {self.limit_s:g} s have passed since the mission began")


class Guard(ExplainedDecorator):
    """A condition above actions, looked at before every tick.

    Condition violated: child halted, FAILURE with the condition's cause. Condition waiting: child suspended, RUNNING.
    Child SUCCESS that the condition contradicts (`violated_at_end`): FAILURE with its cause. Else as the child.
    """

    kind = "guard"
    condition: Condition
    context: RunContext
    _looked: bool = field(default=False, init=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        self.condition = self.condition.for_run(self.context)

    def initialise(self) -> None:
        """Forgets for how long something was so."""
        self.condition.begin(self.context)

    def _held_back(self) -> Status | None:
        self._looked = True
        verdict = self.condition.violated(self.context)
        if isinstance(verdict, Waiting):
            suspend(self.decorated)
            return self.say(verdict.message, Status.RUNNING)
        return None if verdict is None else self.fail(verdict)

    def update(self) -> Status:
        """As the child, unless the condition contradicts its success."""
        status = self.pass_on()
        done, self._looked = self._looked and status == Status.SUCCESS, False
        contradicts = self.condition.violated_at_end(self.context) if done else None
        return status if contradicts is None else self.fail(contradicts)
