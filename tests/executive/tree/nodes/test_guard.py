"""Conditions, and what they make of readings that are too old."""

import dataclasses

import pytest

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
from executive.words.step import StaleData
from skills.api import Cause, Failed, ObjectKind
from skills.robot import Lease, Pose2D
from tests.executive.tree.scripted import F, Leaf, N, R, S, Switch, tick

FELL = Failed(Cause.EXECUTION, "the flag fell")


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


OLD = Failed(Cause.PRECONDITION, "the last reading of the sensor is 1.5 s old")
WAITS = Waiting("waits for the sensor: the last reading of the sensor is 1.5 s old")


# policy, age of the reading (s) -> verdict
@pytest.mark.parametrize(
    ("policy", "age_s", "verdict"),
    [*[(policy, 1.0, None) for policy in StaleData], (StaleData.ACCEPT, 60.0, None), (StaleData.FAIL, 1.5, OLD)],
)
def test_only_readings_that_count_are_judged(readings, context, clock, policy, age_s, verdict):
    clock.advance(age_s)
    assert readings.fresh(policy).check(context) == verdict
    assert readings.asked == (verdict is None)


def test_wait_waits_and_goes_on_with_a_new_reading(readings, context, clock):
    condition = readings.fresh(StaleData.WAIT)
    clock.advance(1.5)
    assert condition.check(context) == WAITS
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


def guard_of(context, condition, child):
    return Guard(path_id="a/g", name="g", child=child, condition=condition, context=context)


def test_a_guard_that_waits_ticks_nothing_below(readings, context, clock):
    # reading   fresh  old    fresh
    # guard     R      R      S
    guard = guard_of(context, readings.fresh(StaleData.WAIT), Leaf("RS"))
    assert tick(guard) == [R]
    clock.advance(2.0)
    assert tick(guard) == [R]
    readings.taken_s = 2.0
    assert tick(guard) == [S]


def test_a_guard_may_wait_before_it_begins(readings, context, clock):
    clock.advance(5.0)
    guard = guard_of(context, readings.fresh(StaleData.WAIT), Leaf("S"))
    assert (tick(guard), guard.children[0].status) == ([R], N)
    readings.taken_s = 5.0
    assert (tick(guard), readings.begun) == ([S], 1)


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


def test_guard_halts_its_child_when_the_condition_breaks(context):
    switch, child = Switch(), Leaf("RRRS")
    root = guard_of(context, switch, child)
    assert tick(root, 2) == [R, R]
    switch.verdict = FELL
    assert tick(root) == [F]
    assert (root.cause, root.message, child.log, switch.begun) == (
        Cause.EXECUTION,
        "the flag fell",
        ["+leaf", "-leaf"],
        1,
    )


def test_guard_does_not_begin_its_child_when_the_condition_is_broken_before(context):
    switch = Switch()
    switch.verdict = FELL
    root = guard_of(context, switch, Leaf("S"))
    assert (tick(root), root.children[0].status) == ([F], N)


def test_guard_passes_its_child_on(context):
    root = guard_of(context, Switch(), Leaf("RF"))
    assert tick(root, 2) == [R, F]
    assert (root.cause, root.message) == (Cause.EXECUTION, "leaf F")


def test_holding_ignores_short_losses_and_reports_long_ones(context, clock, robot):
    # time  0.0   0.05       0.1        0.7 0.75
    # held  yes   no         yes        no  no
    condition = Holds("coke")
    condition.begin(context)
    assert condition.check(context).cause is Cause.PRECONDITION
    robot.holding = True
    assert condition.check(context) is None
    for dt_s, held in ((0.05, False), (0.05, True), (0.6, False)):
        clock.advance(dt_s)
        robot.holding = held
        assert condition.check(context) is None
    clock.advance(0.05)
    assert condition.check(context) == Failed(Cause.EXECUTION, "the coke was lost on the way")


@pytest.fixture
def held(context, robot):
    """A guard around a child while the gripper holds the coke, up to the place where it is put down."""

    def make(script, until_put_down=True):
        robot.holding = True
        return guard_of(context, Holds("coke", "home", until_put_down), Leaf(script))

    return make


@pytest.mark.parametrize(("until_put_down", "status"), [(False, F), (True, S)])
def test_a_guard_contradicts_a_success_when_the_gripper_is_empty_then(held, clock, robot, until_put_down, status):
    root = held("RS", until_put_down)
    assert tick(root, 1, clock) == [R]
    # it falls in the tick in which the drive ends
    root.children[0].update = lambda: (setattr(robot, "holding", False), S)[1]
    assert tick(root, 1, clock) == [status]
    assert root.cause is (None if until_put_down else Cause.EXECUTION)


# Whether it is offered when it is gone from the closed gripper -> whether the guard breaks
@pytest.mark.parametrize(("offered", "breaks"), [(False, True), (True, False)])
def test_the_guard_leaves_an_offered_object_to_the_skill_that_offers_it(held, context, clock, robot, offered, breaks):
    root = held("R")
    assert tick(root, 1, clock) == [R]
    robot.holding, context.payload.offered = False, offered
    assert (F in tick(root, 12, clock)) is breaks


def test_the_guard_does_not_grip_again_what_a_skill_lets_go(held, context, clock, robot):
    root = held("R")
    assert tick(root, 1, clock) == [R]
    robot.clamp_force_n, context.payload.offered = 0.0, True  # the fingers open slowly
    assert F not in tick(root, 12, clock)
    assert robot.clamp_force_n == 0.0


def test_a_guard_takes_another_object_in_the_gripper_for_what_it_is(context, robot):
    robot.holding, context.payload.kind = True, ObjectKind("hammer")
    root = guard_of(context, Holds("beer", "to Robin", known_as=("beer",)), Leaf("S"))
    assert tick(root) == [F]
    assert (root.cause, root.message) == (Cause.PRECONDITION, "the gripper holds the hammer, not the beer")
