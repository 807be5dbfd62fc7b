"""Conditions, and what they make of readings that are too old."""

import dataclasses

import pytest
from py_trees.behaviours import StatusQueue
from py_trees.common import Status

from executive.tree.nodes.guard import (
    BatteryAtLeast,
    BatteryForWork,
    Condition,
    Freshness,
    Guard,
    Holds,
    KnowsPlace,
    NoStopButton,
    OwnLease,
    Waiting,
)
from executive.words.policy import StaleData
from skills.api import Cause, Failed, ObjectKind
from skills.robot import Lease, Pose2D
from tests.executive.tree.scripted import F, N, Queue, R, S, tick


class Readings(Condition):
    """A condition that counts how often it was asked, with readings whose age is set by hand."""

    reading = "the sensor"

    def __init__(self):
        super().__init__()
        self.taken_s, self.asked, self.begun = 0.0, 0, 0

    def for_run(self, context):
        return self

    def begin(self, context):
        super().begin(context)
        self.begun += 1

    def stamp_s(self, context):
        return self.taken_s

    def judge(self, context):
        self.asked += 1

    def fresh(self, policy, patience_s=2.0):
        self.freshness = Freshness(1.0, policy, patience_s)
        return self


@pytest.fixture
def readings():
    return Readings()


@pytest.mark.parametrize("policy", StaleData)
def test_fresh_readings_are_judged_under_every_policy(readings, context, clock, policy):
    clock.advance(1.0)
    assert readings.fresh(policy).check(context) is None
    assert readings.asked == 1


def test_accept_judges_by_what_there_is(readings, context, clock):
    clock.advance(60.0)
    assert readings.fresh(StaleData.ACCEPT).check(context) is None
    assert readings.asked == 1


def test_fail_counts_an_old_reading_as_violated_at_once(readings, context, clock):
    clock.advance(1.5)
    verdict = readings.fresh(StaleData.FAIL).check(context)
    assert verdict == Failed(Cause.PRECONDITION, "the last reading of the sensor is 1.5 s old")
    assert readings.asked == 0


def test_wait_waits_and_goes_on_with_a_new_reading(readings, context, clock):
    condition = readings.fresh(StaleData.WAIT)
    clock.advance(1.5)
    said = "waits for the sensor: the last reading of the sensor is 1.5 s old"
    assert condition.check(context) == Waiting(said)
    readings.taken_s = 1.5
    assert condition.check(context) is None
    clock.advance(3.0)
    readings.taken_s = 4.5
    assert condition.check(context) is None


def test_wait_fails_when_the_patience_is_over_and_begins_again_with_each_start(readings, context, clock):
    condition = readings.fresh(StaleData.WAIT)
    clock.advance(2.0)
    assert isinstance(condition.check(context), Waiting)
    clock.advance(2.1)
    assert isinstance(condition.check(context), Failed)
    condition.begin(context)
    assert isinstance(condition.check(context), Waiting)
    assert readings.begun == 1


def test_a_reading_that_never_came_is_named(readings, context):
    readings.taken_s = float("-inf")
    assert readings.fresh(StaleData.FAIL).check(context).message == "there is no reading of the sensor yet"


def guard_of(context, condition, *script):
    child = StatusQueue(name="child", queue=list(script), eventually=script[-1])
    return Guard(path_id="alice/g", name="g", child=child, condition=condition, context=context), child


def test_a_guard_that_waits_ticks_nothing_below(readings, context, clock):
    # reading   fresh  old    fresh
    # guard     R      R      S
    guard, _ = guard_of(context, readings.fresh(StaleData.WAIT), R, S)
    said = []
    for stamp_s in (0.0, None, 2.0):
        readings.taken_s = readings.taken_s if stamp_s is None else stamp_s
        guard.tick_once()
        said.append(guard.status)
        clock.advance(2.0 if stamp_s == 0.0 else 0.0)
    assert said == [R, R, S]


def test_a_guard_may_wait_before_it_begins(readings, context, clock):
    clock.advance(5.0)
    guard, child = guard_of(context, readings.fresh(StaleData.WAIT), S)
    guard.tick_once()
    assert (guard.status, child.status) == (R, Status.INVALID)
    readings.taken_s = 5.0
    guard.tick_once()
    assert (guard.status, readings.begun) == (S, 1)


def test_holding_waits_while_the_gripper_tells_nothing_new(context, robot, clock):
    robot.holding = True
    condition, old = Holds("coke"), robot.gripper()
    assert condition.check(context) is None
    robot.gripper = lambda: old
    clock.advance(2.0)
    assert isinstance(condition.check(context), Waiting)
    clock.advance(6.0)
    assert condition.check(context).cause is Cause.PRECONDITION


def test_holding_lets_a_short_loss_pass_and_tells_a_loss_from_never_held(context, robot, clock):
    condition = Holds("coke")
    assert condition.check(context).cause is Cause.PRECONDITION
    robot.holding = True
    assert condition.check(context) is None
    robot.holding = False
    assert condition.check(context) is None
    clock.advance(0.05)
    assert condition.check(context).cause is Cause.EXECUTION


def test_localised_lets_a_short_loss_pass(context, clock):
    condition = KnowsPlace(patience_s=2.0)
    context.localiser.localised = False
    verdicts = []
    for _ in range(3):
        verdicts.append(condition.judge(context))
        clock.advance(1.5)
    assert verdicts[:2] == [None, None]
    assert verdicts[2].cause is Cause.PRECONDITION


def test_localised_waits_for_scans(context, clock):
    clock.advance(3.0)
    assert isinstance(KnowsPlace().check(context), Waiting)


@pytest.mark.parametrize(("charge", "holds"), [(0.5, True), (0.3, True), (0.29, False)])
def test_the_battery_is_above_a_level_or_not(context, robot, charge, holds):
    robot.charge = charge
    assert (BatteryAtLeast(0.3).check(context) is None) == holds


def test_the_reserve_grows_with_the_way_to_the_dock(context, robot):
    robot.charge = 0.2
    assert BatteryForWork(0.15, Pose2D(5.0, 0.0, 0.0)).check(context) is None
    far = BatteryForWork(0.15, Pose2D(300.0, 0.0, 0.0)).check(context)
    assert far == Failed(Cause.PRECONDITION, "the battery is at 20%, less than 48%")


def test_an_old_battery_reading_will_do(context, robot, clock):
    old = robot.battery()
    robot.battery = lambda: old
    clock.advance(100.0)
    assert BatteryForWork(0.15, Pose2D(0.0, 0.0, 0.0)).check(context) is None


def test_the_mission_stands_while_the_stop_button_is_pressed(context):
    assert NoStopButton().check(context) is None
    pressed = dataclasses.replace(context, stop_pressed=lambda: "somebody pressed it")
    assert NoStopButton().check(pressed) == Waiting("somebody pressed it")


def test_the_mission_stands_while_another_holds_the_lease(context, robot):
    assert OwnLease().check(context) is None
    robot.lease = Lease("Alice", context.lease.holder, 5)
    assert OwnLease().check(context) is None
    robot.lease = Lease("Alice", "the tablet", 6)
    assert OwnLease().check(context) == Waiting("the tablet holds the lease of Alice")


class Flag:
    """A condition that the test switches."""

    def __init__(self) -> None:
        self.bad = False
        self.begun = 0

    def for_run(self, context):
        return self

    def begin(self, context) -> None:
        self.begun += 1

    def check(self, context):
        return Failed(Cause.EXECUTION, "the flag fell") if self.bad else None


def test_guard_halts_its_child_when_the_condition_breaks(context, clock):
    flag, child = Flag(), Queue(R, R, R, S)
    root = Guard(path_id="a/g", name="g", child=child, condition=flag, context=context)
    assert tick(root, 2, clock) == [R, R]
    flag.bad = True
    assert tick(root, 1, clock) == [F]
    assert (root.cause, root.message, child.stopped, flag.begun) == (Cause.EXECUTION, "the flag fell", 1, 1)


def test_guard_does_not_begin_its_child_when_the_condition_is_broken_before(context, clock):
    flag, child = Flag(), Queue(S)
    flag.bad = True
    root = Guard(path_id="a/g", name="g", child=child, condition=flag, context=context)
    assert tick(root, 1, clock) == [F]
    assert child.status == N


def test_guard_passes_its_child_on(context, clock):
    root = Guard(path_id="a/g", name="g", child=Queue(R, F), condition=Flag(), context=context)
    assert tick(root, 2, clock) == [R, F]
    assert (root.cause, root.message) == (Cause.EXECUTION, "slipped")


def test_holding_ignores_short_losses_and_reports_long_ones(context, clock, robot):
    # time  0.0   0.05       0.1        0.7 0.75
    # held  yes   no         yes        no  no
    condition = Holds("coke")
    condition.begin(context)
    robot.holding = True
    assert condition.check(context) is None
    for dt_s, held in ((0.05, False), (0.05, True), (0.6, False)):
        clock.advance(dt_s)
        robot.holding = held
        assert condition.check(context) is None
    clock.advance(0.05)
    failure = condition.check(context)
    assert failure is not None
    assert (failure.cause, failure.message) == (Cause.EXECUTION, "the coke was lost on the way")


def test_holding_nothing_at_the_start_is_a_precondition(context, robot):
    condition = Holds("coke")
    condition.begin(context)
    failure = condition.check(context)
    assert failure is not None
    assert failure.cause is Cause.PRECONDITION


@pytest.mark.parametrize(("until_put_down", "status"), [(False, F), (True, S)])
def test_a_guard_contradicts_a_success_when_the_gripper_is_empty_then(context, clock, robot, until_put_down, status):
    robot.holding = True
    child = Queue(R, S)
    root = Guard(path_id="a/g", name="g", child=child, condition=Holds("coke", "home", until_put_down), context=context)
    assert tick(root, 1, clock) == [R]
    child.update = lambda: (setattr(robot, "holding", False), S)[1]  # it falls in the tick in which the drive ends
    assert tick(root, 1, clock) == [status]
    assert root.cause is (None if until_put_down else Cause.EXECUTION)


# Whether it is offered when it is gone from the closed gripper -> whether the guard breaks
@pytest.mark.parametrize(("offered", "breaks"), [(False, True), (True, False)])
def test_the_guard_leaves_an_offered_object_to_the_skill_that_offers_it(context, clock, robot, offered, breaks):
    robot.holding = True
    condition = Holds("coke", "home", until_put_down=True)
    root = Guard(path_id="a/g", name="g", child=Queue(*[R] * 20), condition=condition, context=context)
    assert tick(root, 1, clock) == [R]
    robot.holding, context.payload.offered = False, offered
    assert (F in tick(root, 12, clock)) is breaks


def test_the_guard_does_not_grip_again_what_a_skill_lets_go(context, clock, robot):
    robot.holding = True
    condition = Holds("coke", "home", until_put_down=True)
    root = Guard(path_id="a/g", name="g", child=Queue(*[R] * 20), condition=condition, context=context)
    assert tick(root, 1, clock) == [R]
    robot.clamp_force_n, context.payload.offered = 0.0, True  # the fingers open slowly
    assert F not in tick(root, 12, clock)
    assert robot.clamp_force_n == 0.0


def test_a_guard_takes_another_object_in_the_gripper_for_what_it_is(context, clock, robot):
    robot.holding, context.payload.kind = True, ObjectKind("hammer")
    root = Guard(
        path_id="a/g",
        name="g",
        child=Queue(S),
        condition=Holds("beer", "to Robin", known_as=("beer",)),
        context=context,
    )
    assert tick(root, 1, clock) == [F]
    assert (root.cause, root.message) == (Cause.PRECONDITION, "the gripper holds the hammer, not the beer")
