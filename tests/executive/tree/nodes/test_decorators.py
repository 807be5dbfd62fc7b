"""Timeout, Retry and Guard on the robot's clock."""

import pytest
from py_trees.behaviours import StatusQueue
from py_trees.common import Status

from executive.tree.behaviour import Explained
from executive.tree.nodes.composites import MemorySequence
from executive.tree.nodes.guard import Guard, Holds
from executive.tree.nodes.policies import Retry, Timeout
from skills.api import Cause, Failed, Thing

R, S, F, N = Status.RUNNING, Status.SUCCESS, Status.FAILURE, Status.INVALID


class Queue(Explained, StatusQueue):
    """A scripted leaf that says why it fails."""

    def __init__(self, *statuses: Status, cause: Cause = Cause.EXECUTION) -> None:
        super().__init__(name="queue", queue=list(statuses), eventually=S)
        self.path_id, self.fails_with, self.stopped = "a/queue", cause, 0
        self.clear_explanation()

    def update(self) -> Status:
        status = super().update()
        self.cause, self.message = (self.fails_with, "slipped") if status == F else (None, "goes on")
        return status

    def terminate(self, new_status: Status) -> None:
        self.stopped += new_status == N and self.status == R


def ticked(root, clock, times: int, dt_s: float = 1.0) -> list[Status]:
    statuses = []
    for _ in range(times):
        clock.advance(dt_s)
        root.tick_once()
        statuses.append(root.status)
    return statuses


def timeout(child, clock, limit_s=1.5):
    return Timeout(path_id="a/t", name="t", child=child, limit_s=limit_s, clock=clock)


@pytest.mark.parametrize("last", [R, S])
def test_timeout_fails_on_the_robots_clock_even_when_success_comes_late(clock, last):
    # time     1   2   3      limit 1.5 s after 1 s
    # child    R   R   R or S
    # timeout  R   R   F
    child = Queue(R, R, last, R)
    root = timeout(child, clock)
    assert ticked(root, clock, 3) == [R, R, F]
    assert root.cause is Cause.TIMEOUT
    assert child.status != R


def test_timeout_stops_a_running_child(clock):
    child = Queue(R, R, R, R)
    ticked(timeout(child, clock), clock, 3)
    assert child.stopped == 1


def test_timeout_lets_success_in_time_and_failure_pass(clock):
    assert ticked(timeout(Queue(R, S), clock), clock, 2) == [R, S]
    root = timeout(Queue(R, R, F), clock)
    assert ticked(root, clock, 3) == [R, R, F]
    assert root.cause is Cause.EXECUTION


def test_timeout_starts_anew_after_an_end(clock):
    root = timeout(Queue(R, R, R, R, S), clock)
    assert ticked(root, clock, 3) == [R, R, F]
    assert ticked(root, clock, 2) == [R, S]


def retry(child, attempts=3, causes=frozenset({Cause.EXECUTION})):
    return Retry(path_id="a/r", name="r", child=child, attempts=attempts, causes=causes)


def test_retry_tries_again_one_tick_later_until_it_works(clock):
    # child  F  F  S
    # retry  R  R  S
    root = retry(Queue(F, F, S))
    assert ticked(root, clock, 2) == [R, R]
    assert "attempt 3 of 3, since slipped" in root.message
    assert ticked(root, clock, 1) == [S]


def test_retry_is_bounded_and_says_how_often(clock):
    root = retry(Queue(F, F, F))
    assert ticked(root, clock, 3) == [R, R, F]
    assert (root.cause, root.message) == (Cause.EXECUTION, "slipped (after 3 attempts)")


@pytest.mark.parametrize("cause", [Cause.TIMEOUT, Cause.ERROR, Cause.PRECONDITION])
def test_retry_leaves_other_causes_alone(clock, cause):
    root = retry(Queue(F, S, cause=cause))
    assert ticked(root, clock, 1) == [F]
    assert root.cause is cause


def test_retry_begins_a_sequence_at_its_first_step(clock):
    first, second = Queue(S, R, S), Queue(F, S)
    root = retry(MemorySequence(path_id="a/s", name="s", children=[first, second]))
    assert ticked(root, clock, 3) == [R, R, S]
    assert first.status == S


def test_retry_counts_from_one_after_an_end(clock):
    root = retry(Queue(F, F, F, F, F, S))
    assert ticked(root, clock, 3) == [R, R, F]
    assert ticked(root, clock, 3) == [R, R, S]


class Flag:
    """A condition that the test switches."""

    def __init__(self) -> None:
        self.bad = False
        self.begun = 0

    def for_run(self, context):
        return self

    def begin(self, context) -> None:
        self.begun += 1

    def violated(self, context):
        return Failed(Cause.EXECUTION, "the flag fell") if self.bad else None


def test_guard_halts_its_child_when_the_condition_breaks(context, clock):
    flag, child = Flag(), Queue(R, R, R, S)
    root = Guard(path_id="a/g", name="g", child=child, condition=flag, context=context)
    assert ticked(root, clock, 2) == [R, R]
    flag.bad = True
    assert ticked(root, clock, 1) == [F]
    assert (root.cause, root.message, child.stopped, flag.begun) == (Cause.EXECUTION, "the flag fell", 1, 1)


def test_guard_does_not_begin_its_child_when_the_condition_is_broken_before(context, clock):
    flag, child = Flag(), Queue(S)
    flag.bad = True
    root = Guard(path_id="a/g", name="g", child=child, condition=flag, context=context)
    assert ticked(root, clock, 1) == [F]
    assert child.status == N


def test_guard_passes_its_child_on(context, clock):
    root = Guard(path_id="a/g", name="g", child=Queue(R, F), condition=Flag(), context=context)
    assert ticked(root, clock, 2) == [R, F]
    assert (root.cause, root.message) == (Cause.EXECUTION, "slipped")


def test_interrupted_decorators_say_so(context, clock):
    for root in (timeout(Queue(R, R), clock), retry(Queue(R, R))):
        ticked(root, clock, 1)
        root.stop(N)
        assert (root.cause, root.children[0].status) == (Cause.CANCELLED, N)


def test_holding_lets_short_losses_pass_and_tells_long_ones(context, clock, robot):
    # time  0.0   0.05       0.1        0.7 0.75
    # held  yes   no         yes        no  no
    condition = Holds("coke")
    condition.begin(context)
    robot.holding = True
    assert condition.violated(context) is None
    for dt_s, held in ((0.05, False), (0.05, True), (0.6, False)):
        clock.advance(dt_s)
        robot.holding = held
        assert condition.violated(context) is None
    clock.advance(0.05)
    failure = condition.violated(context)
    assert failure is not None
    assert (failure.cause, failure.message) == (Cause.EXECUTION, "the coke was lost on the way")


def test_holding_nothing_at_the_start_is_a_precondition(context, robot):
    condition = Holds("coke")
    condition.begin(context)
    failure = condition.violated(context)
    assert failure is not None
    assert failure.cause is Cause.PRECONDITION


@pytest.mark.parametrize(("until_put_down", "status"), [(False, F), (True, S)])
def test_a_guard_contradicts_a_success_when_the_gripper_is_empty_then(context, clock, robot, until_put_down, status):
    robot.holding = True
    child = Queue(R, S)
    root = Guard(path_id="a/g", name="g", child=child, condition=Holds("coke", "home", until_put_down), context=context)
    assert ticked(root, clock, 1) == [R]
    child.update = lambda: (setattr(robot, "holding", False), S)[1]  # it falls in the tick in which the drive ends
    assert ticked(root, clock, 1) == [status]
    assert root.cause is (None if until_put_down else Cause.EXECUTION)


# Whether it is offered when it is gone from the closed gripper -> whether the guard breaks
@pytest.mark.parametrize(("offered", "breaks"), [(False, True), (True, False)])
def test_the_guard_leaves_an_offered_object_to_the_skill_that_offers_it(context, clock, robot, offered, breaks):
    robot.holding = True
    condition = Holds("coke", "home", until_put_down=True)
    root = Guard(path_id="a/g", name="g", child=Queue(*[R] * 20), condition=condition, context=context)
    assert ticked(root, clock, 1) == [R]
    robot.holding, context.payload.offered = False, offered
    assert (F in ticked(root, clock, 12)) is breaks


def test_a_guard_takes_another_object_in_the_gripper_for_what_it_is(context, clock, robot):
    robot.holding, context.payload.thing = True, Thing("hammer")
    root = Guard(
        path_id="a/g",
        name="g",
        child=Queue(S),
        condition=Holds("beer", "to Robin", known_as=("beer",)),
        context=context,
    )
    assert ticked(root, clock, 1) == [F]
    assert (root.cause, root.message) == (Cause.PRECONDITION, "the gripper holds the hammer, not the beer")
