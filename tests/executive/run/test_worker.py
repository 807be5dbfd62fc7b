"""The lock-step worker and the thread worker."""

import gc
import threading
import time

import pytest

from executive.run.guarded_robot import GuardedRobot
from executive.run.watchdog import Watchdog
from executive.run.worker import LockStepWorker, ThreadWorker
from plant.robots.spot.kind import spot_capabilities
from skills.testing.clock import VirtualClock
from skills.testing.robot import ScriptedRobot


def test_lock_step_result_appears_after_its_latency(clock):
    job = LockStepWorker(clock).submit(lambda: 42, latency_s=0.2, name="sum")
    clock.advance(0.15)
    assert not job.done()
    with pytest.raises(RuntimeError):
        job.result()
    clock.advance(0.05)
    assert (job.done(), job.result()) == (True, 42)


def test_a_negative_latency_is_refused(clock):
    with pytest.raises(ValueError, match="latency"):
        LockStepWorker(clock).submit(lambda: 1, latency_s=-0.1, name="bad")


@pytest.fixture
def worker(clock):
    with LockStepWorker(clock) as worker:
        yield worker


def test_lock_step_starts_at_once_and_time_goes_on_meanwhile(worker, clock):
    begun, gate = threading.Event(), threading.Event()
    job = worker.submit(lambda: (begun.set(), gate.wait(5.0)), latency_s=0.2, name="slow")
    assert begun.wait(5.0)
    clock.advance(0.1)
    assert (clock.now(), job.done()) == (0.1, False)
    gate.set()


def test_a_result_that_is_due_is_waited_for(worker, clock):
    job = worker.submit(lambda: (time.sleep(0.05), 7)[1], latency_s=0.0, name="slow")
    assert (job.done(), job.result()) == (True, 7)


def test_work_is_done_in_the_order_in_which_it_was_submitted_by_one_thread(worker):
    done = []
    jobs = [
        worker.submit(lambda n=n: done.append((n, threading.current_thread())), latency_s=0.0, name=str(n))
        for n in range(20)
    ]
    for job in reversed(jobs):
        job.result()
    assert [number for number, _ in done] == list(range(20))
    assert len({thread for _, thread in done} - {threading.main_thread()}) == 1


def test_lock_step_reads_sensors_at_once_in_this_thread(worker):
    job = worker.sense(threading.current_thread, lambda given: (given, threading.current_thread()),
                       latency_s=0.0, name="who")  # fmt: skip
    read_by, done_by = job.result()
    assert (read_by, done_by is read_by) == (threading.main_thread(), False)


BAD_JOBS = [
    lambda worker: worker.sense(lambda: 1 / 0, lambda given: given, latency_s=0.0, name="bad"),
    lambda worker: worker.submit(lambda: 1 / 0, latency_s=0.0, name="bad"),
]


@pytest.mark.parametrize("begin", BAD_JOBS)
def test_an_exception_of_a_job_or_while_reading_is_raised_by_result(worker, begin):
    job = begin(worker)
    assert job.done()
    with pytest.raises(ZeroDivisionError):
        job.result()


def test_a_withdrawn_job_no_longer_runs(worker):
    ended = []
    worker.submit(lambda: (time.sleep(0.05), ended.append(1)), latency_s=9.0, name="slow").withdraw()
    assert ended == [1]


def test_closing_waits_for_what_runs_drops_the_rest_and_ends_the_thread(clock):
    others = set(threading.enumerate())
    worker, begun, done = LockStepWorker(clock), threading.Event(), []
    worker.submit(lambda: (begun.set(), time.sleep(0.05), done.append("first")), latency_s=0.0, name="first")
    worker.submit(lambda: done.append("second"), latency_s=0.0, name="second")
    assert begun.wait(5.0)
    worker.close()
    assert done == ["first"]
    assert set(threading.enumerate()) <= others
    with pytest.raises(RuntimeError, match="closed"):
        worker.submit(lambda: 1, latency_s=0.0, name="late")


def test_a_job_may_not_touch_the_robot(worker, robot):
    guarded = GuardedRobot(robot, Watchdog())
    with pytest.raises(RuntimeError, match=r"'odometry' was called inside a job"):
        worker.submit(guarded.odometry, latency_s=0.0, name="bad").result()


def test_a_job_may_ask_for_capabilities_which_never_change(worker):
    guarded = GuardedRobot(ScriptedRobot(VirtualClock(), capabilities=spot_capabilities()), Watchdog())
    job = worker.submit(guarded.capabilities, latency_s=0.0, name="good")
    assert job.result() == spot_capabilities()


def test_thread_worker_does_not_block_and_raises_later():
    worker, gate = ThreadWorker(), threading.Event()
    slow = worker.submit(lambda: gate.wait(5.0), latency_s=0.0, name="slow")
    bad = worker.submit(lambda: 1 / 0, latency_s=0.0, name="bad")
    assert not slow.done()
    with pytest.raises(RuntimeError, match="not done"):
        slow.result()
    gate.set()
    deadline = time.monotonic() + 5.0
    while not bad.done() and time.monotonic() < deadline:
        time.sleep(0.001)
    assert slow.result() is True
    with pytest.raises(ZeroDivisionError):
        bad.result()
    worker.close()


class Cycle:
    """Garbage that only the collector finds; it notes in which thread it goes."""

    def __init__(self, threads):
        self.itself, self.threads = self, threads

    def __del__(self):
        self.threads.append(threading.current_thread().name)


def test_garbage_is_never_collected_in_a_job(worker, clock):
    threads = []
    for _ in range(50):
        Cycle(threads)
    gc.enable()
    gc.set_threshold(700)
    job = worker.submit(lambda: (gc.isenabled(), [[] for _ in range(50_000)])[0], latency_s=0.1, name="allocate")
    clock.advance(0.1)
    assert job.result() is False
    job.withdraw()
    worker.submit(lambda: None, latency_s=0.0, name="after")
    worker.close()
    gc.collect()
    assert gc.isenabled()
    gc.disable()  # as in all tests
    gc.set_threshold(0)
    assert (len(threads), set(threads)) == (50, {threading.current_thread().name})
