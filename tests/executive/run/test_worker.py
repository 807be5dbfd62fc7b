"""The lock-step worker and the thread worker."""

import threading
import time

import pytest

from executive.run.worker import LockStepWorker, ThreadWorker


def test_lock_step_result_appears_after_its_latency(clock):
    job = LockStepWorker(clock).submit(lambda: 42, latency_s=0.2, name="sum")
    clock.advance(0.15)
    assert not job.done()
    with pytest.raises(RuntimeError, match=r"due at 0\.200"):
        job.result()
    clock.advance(0.05)
    assert (job.done(), job.result()) == (True, 42)


def test_lock_step_runs_at_once_in_this_thread(clock):
    threads = []
    LockStepWorker(clock).submit(lambda: threads.append(threading.current_thread()), latency_s=1.0, name="who")
    assert threads == [threading.main_thread()]


def test_what_the_work_raised_is_raised_by_result(clock):
    job = LockStepWorker(clock).submit(lambda: 1 / 0, latency_s=0.0, name="bad")
    assert job.done()
    with pytest.raises(ZeroDivisionError):
        job.result()


def test_a_negative_latency_is_refused(clock):
    with pytest.raises(ValueError, match="latency"):
        LockStepWorker(clock).submit(lambda: 1, latency_s=-0.1, name="bad")


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
