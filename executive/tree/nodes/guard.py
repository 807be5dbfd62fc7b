"""Conditions that must hold while nodes run, and the policies for readings that are too old.

A compiled tree has them as plain data; each run uses its own copies. A condition returns None when it holds, `Failed`
when it does not, and `Waiting` while its value is unknown.
"""

import copy
import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import ClassVar, Self

from py_trees.common import Status

from executive.tree.behaviour import ExplainedDecorator, suspend
from executive.tree.context import RunContext
from executive.words.step import StaleData
from skills.api import Cause, Failed, ObjectKind
from skills.class_forms import ANY_OBJECT
from skills.hold import Grip, HoldWatch, grip_again, hold_watch
from skills.robot import Pose2D

CONTROL_TOPIC = "control"


@dataclass(frozen=True)
class Waiting:
    """Verdict of a condition without a value yet, with one sentence; the nodes below are suspended meanwhile."""

    message: str


Verdict = Failed | Waiting | None


@dataclass(frozen=True)
class Freshness:
    """Greatest age (s) of a reading, the policy for an older reading, and how long (s) WAIT waits at most."""

    max_age_s: float = 1.0
    policy: StaleData = StaleData.WAIT
    patience_s: float = 5.0


@dataclass
class Condition(ABC):
    """Condition that must hold while a subtree runs; `stale` is the policy for an old reading (None: the usual one).

    | reading | policy | verdict |
    |---|---|---|
    | fresh | any | as `judge` |
    | too old | ACCEPT | as `judge` |
    | too old | WAIT | Waiting until the patience is over, then Failed with PRECONDITION |
    | too old | FAIL | Failed with PRECONDITION |
    """

    reading: ClassVar[str] = ""
    freshness: ClassVar[Freshness] = Freshness()
    stale: StaleData | None = field(default=None, kw_only=True)
    _since_s: float | None = field(default=None, init=False, repr=False, compare=False)
    _stale_since_s: float | None = field(default=None, init=False, repr=False, compare=False)

    @abstractmethod
    def judge(self, context: RunContext) -> Verdict:
        """Judges the condition by the readings; None when it holds."""

    def stamp_s(self, context: RunContext) -> float:
        """Stamp (s) of the reading that the condition judges; the present time for a condition without a reading."""
        return context.clock.now()

    def for_run(self, context: RunContext) -> Self:
        """Returns a copy of the condition for a run that begins now."""
        mine = copy.copy(self)
        mine.run_begins(context)
        return mine

    def run_begins(self, context: RunContext) -> None:  # noqa: B027 - most conditions need not know
        """Handles the beginning of the run to which this copy belongs."""

    def begin(self, context: RunContext) -> None:
        """Handles another start of the subtree: forgets how long readings were old or missing."""
        self._since_s = self._stale_since_s = None

    def note_call(self) -> None:  # noqa: B027 - most conditions need not know
        """Records that the interrupt which the condition called has begun."""

    def check_end(self, context: RunContext) -> Failed | None:
        """Returns the failure if the condition contradicts a success of the subtree; None if it agrees."""
        return None

    def check(self, context: RunContext) -> Verdict:
        """Judges the condition before each tick of the subtree, with the policy for old readings; None if it holds."""
        fresh, policy = self.freshness, self.stale or self.freshness.policy
        if policy is StaleData.ACCEPT:
            return self.judge(context)
        now_s = context.clock.now()
        age_s = now_s - self.stamp_s(context)
        if age_s <= fresh.max_age_s:
            self._stale_since_s = None
            return self.judge(context)
        self._stale_since_s = now_s if self._stale_since_s is None else self._stale_since_s
        old = f"the last reading of {self.reading} is {age_s:.1f} s old"
        said = old if math.isfinite(age_s) else f"there is no reading of {self.reading} yet"
        if policy is StaleData.WAIT and now_s - self._stale_since_s <= fresh.patience_s:
            return Waiting(f"waits for {self.reading}: {said}")
        return Failed(Cause.PRECONDITION, said)


def is_known_as(item: ObjectKind | None, classes: Sequence[str], attributes: Sequence[str] = ()) -> bool:
    """Returns whether an object is of one of these classes (or of any, with `ANY_OBJECT`) and has these attributes."""
    if item is None:
        return False
    return (ANY_OBJECT in classes or item.name in classes) and set(attributes) <= set(item.attributes)


@dataclass
class Holds(Condition):
    """Condition that the gripper holds `item`, while the robot brings it `to` a goal ("to the kitchen").

    | gripper | verdict | verdict with `until_put_down` |
    |---|---|---|
    | at the start: holds an object recognised as another | PRECONDITION | PRECONDITION |
    | at the start: empty | PRECONDITION | holds |
    | the object is lost, within 0.5 s | EXECUTION | EXECUTION, but holds while the object is offered |
    | the object begins to slip | holds; it is gripped once more firmly | the same, but not while it is offered |
    | the object slips once more | EXECUTION | holds |
    | the gripper has opened | EXECUTION | holds |
    | at the end: empty | EXECUTION | holds |

    The object must be recognised as one of the classes `known_as` with all `attributes`; an unrecognised object, as
    after a restart, is accepted.
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
        """Stamp (s) of the gripper's reading."""
        return context.robot.gripper().stamp_s

    def begin(self, context: RunContext) -> None:
        """Handles another start of the subtree: the grip is watched from now on."""
        super().begin(context)
        self._watch, self._begins = hold_watch(context.robot.capabilities()), True

    def judge(self, context: RunContext) -> Verdict:
        """Judges the grip; grips a slipping object again."""
        watch, held = self._watch, context.payload.kind
        begins, self._begins = self._begins, False
        another = held is not None and self.known_as and not is_known_as(held, self.known_as, self.attributes)
        if begins and another and context.robot.gripper().holding:
            return Failed(Cause.PRECONDITION, f"the gripper holds the {held}, not the {self.item}")
        grip = watch.judge(context.robot.gripper(), context.clock.now())
        if self.until_put_down and context.payload.offered:
            return None
        if grip is Grip.SLIPPING:
            grip_again(context.robot, watch.force_n, clock=context.clock, lease=context.lease)
            sentence = f"the {self.item} began to slip and is gripped again, more firmly"
            context.publish(CONTROL_TOPIC, {"t": round(context.clock.now(), 6), "what": "slip", "message": sentence})
        if grip is Grip.EMPTY:
            why = f"there is no {self.item} in the gripper"
            return None if self.until_put_down else Failed(Cause.PRECONDITION, why)
        if grip is Grip.LOST or (grip is Grip.RELEASED and not self.until_put_down):
            return Failed(Cause.EXECUTION, f"the {self.item} was lost on the way{self._to}")
        if grip is Grip.SLIPS_ON and not self.until_put_down:
            return Failed(Cause.EXECUTION, f"the {self.item} slips out of the gripper on the way{self._to}")
        return None

    def check_end(self, context: RunContext) -> Failed | None:
        """Returns a failure when the gripper is empty at the end."""
        if self.until_put_down or context.robot.gripper().holding:
            return None
        return Failed(Cause.EXECUTION, f"the {self.item} was lost on the way{self._to}")

    @property
    def _to(self) -> str:
        return f" {self.to}" if self.to else ""


@dataclass
class HoldsNothingElse(Condition):
    """Condition that the gripper holds no other object before the robot grasps `item`.

    PRECONDITION at the start if the gripper holds an object that was recognised as not being of the classes `known_as`
    with `attributes`; an unrecognised object, as after a restart, is left to the skill that grasps.
    """

    reading = "the gripper"
    item: str
    known_as: tuple[str, ...]
    attributes: tuple[str, ...] = ()
    _begins: bool = field(default=True, init=False, repr=False, compare=False)

    def begin(self, context: RunContext) -> None:
        """Handles another start of the subtree: only the next judgement matters."""
        super().begin(context)
        self._begins = True

    def judge(self, context: RunContext) -> Verdict:
        """Returns a failure when the gripper holds another object at the start."""
        begins, self._begins = self._begins, False
        held = context.payload.kind
        if not begins or held is None or not context.robot.gripper().holding:
            return None
        if is_known_as(held, self.known_as, self.attributes):
            return None
        return Failed(Cause.PRECONDITION, f"the gripper holds the {held} already; put it down first")


@dataclass
class KnowsPlace(Condition):
    """Condition that the robot is localised; PRECONDITION after `patience_s` (robot's clock) without localisation."""

    reading = "its place"
    freshness = Freshness(2.0)
    patience_s: float = 5.0

    def stamp_s(self, context: RunContext) -> float:
        """Stamp (s) of the localiser's estimate."""
        return context.localiser.estimate().stamp_s

    def judge(self, context: RunContext) -> Verdict:
        """Returns a failure when the robot has not been localised for longer than the patience."""
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
    """Condition that the battery's charge is at least `charge` (0 to 1); accepts old readings, as it changes slowly."""

    reading = "the battery"
    freshness = Freshness(10.0, StaleData.ACCEPT)
    charge: float

    def stamp_s(self, context: RunContext) -> float:
        """Stamp (s) of the battery's reading."""
        return context.robot.battery().stamp_s

    def judge(self, context: RunContext) -> Verdict:
        """Returns a failure with PRECONDITION when the charge is below the least charge."""
        charge, least = context.robot.battery().charge, self.least(context)
        if charge >= least:
            return None
        return Failed(Cause.PRECONDITION, f"the battery is at {charge:.0%}, less than {least:.0%}")

    def least(self, context: RunContext) -> float:
        """Least charge that suffices at the robot's pose."""
        return self.charge


@dataclass
class BatteryForWork(BatteryAtLeast):
    """Condition that the charge is at least `charge`, and enough to reach the dock.

    The length of the route is estimated as twice the straight distance, at `per_m` of charge for each metre.
    """

    dock: Pose2D
    per_m: float = 0.0008

    def least(self, context: RunContext) -> float:
        """Least charge that suffices at the robot's pose; it grows with the distance to the dock."""
        here = context.pose()
        return max(self.charge, 2.0 * self.per_m * math.hypot(here.x_m - self.dock.x_m, here.y_m - self.dock.y_m))


@dataclass
class NoStopButton(Condition):
    """Condition that no stop button is pressed; suspends the mission while one is pressed."""

    def judge(self, context: RunContext) -> Verdict:
        """Returns Waiting while a stop button is pressed."""
        pressed = context.stop_pressed()
        return None if pressed is None else Waiting(pressed)


@dataclass
class OwnLease(Condition):
    """Condition that no other program holds the robot's lease; suspends the mission while one holds it."""

    def judge(self, context: RunContext) -> Verdict:
        """Returns Waiting while another program holds the lease."""
        held = context.robot.lease_holder()
        if held is None or held.holder == context.lease.holder:
            return None
        return Waiting(f"{held.holder} holds the lease of {context.robot.name}")


@dataclass
class NotAfter(Condition):
    """Condition that the run began at most `limit_s` ago (s on the robot's clock); TIMEOUT afterwards."""

    limit_s: float
    _begun_s: float = field(default=0.0, init=False, repr=False, compare=False)

    def run_begins(self, context: RunContext) -> None:
        """Starts to count the time limit."""
        self._begun_s = context.clock.now()

    def judge(self, context: RunContext) -> Verdict:
        """Returns a failure when the time limit is exceeded."""
        if context.clock.now() - self._begun_s <= self.limit_s:
            return None
        return Failed(Cause.TIMEOUT, f"more than {self.limit_s:g} s have passed since the mission began")


class Guard(ExplainedDecorator):
    """Decorator that judges a condition before every tick of its child.

    | condition | child | status |
    |---|---|---|
    | violated | halted | FAILURE with the condition's cause |
    | waiting | suspended | RUNNING |
    | holds | RUNNING, FAILURE | as the child |
    | holds | SUCCESS | SUCCESS, or FAILURE with the condition's cause if it contradicts (`check_end`) |
    | - | halted | INVALID with CANCELLED |
    """

    kind = "guard"
    condition: Condition
    context: RunContext
    _looked: bool = field(default=False, init=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        self.condition = self.condition.for_run(self.context)

    def initialise(self) -> None:
        """Starts the condition again."""
        self.condition.begin(self.context)

    def _held_back(self) -> Status | None:
        self._looked = True
        verdict = self.condition.check(self.context)
        if isinstance(verdict, Waiting):
            suspend(self.decorated)
            return self.say(verdict.message, Status.RUNNING)
        return None if verdict is None else self.fail(verdict)

    def update(self) -> Status:
        """Returns the child's status, unless the condition contradicts its success."""
        status = self.pass_on()
        done, self._looked = self._looked and status == Status.SUCCESS, False
        contradicts = self.condition.check_end(self.context) if done else None
        return status if contradicts is None else self.fail(contradicts)
