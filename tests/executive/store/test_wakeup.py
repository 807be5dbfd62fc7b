"""The wakeup pipe: who waits hears of a call from any thread and any process, and of nothing else."""

import subprocess
import sys
import threading
import time
from datetime import timedelta
from pathlib import Path

import pytest

from executive.store import wakeup as wakeup_module
from executive.store.missions import MissionStore
from executive.store.standing_missions import LATE
from executive.store.wakeup import LONGEST_WAIT, WakeupPipe, wake_server
from skills.inputs.errors import InputError

ROOT = Path(__file__).parents[3]


@pytest.fixture
def store(tmp_path):
    with MissionStore(tmp_path / "missions.sqlite") as store:
        yield store


def waited_s(pipe, store, seconds):
    begun = time.monotonic()
    pipe.wait(store.now() + timedelta(seconds=seconds))
    return time.monotonic() - begun


def test_a_call_before_the_wait_is_heard_once(store):
    with WakeupPipe(store) as pipe:
        for _ in range(3):
            pipe.wake()
        assert waited_s(pipe, store, 30) < 10
        assert waited_s(pipe, store, 0.05) >= 0.04


def test_a_wait_for_a_past_moment_returns_at_once(store):
    with WakeupPipe(store) as pipe:
        assert waited_s(pipe, store, -5) < 5


def test_a_call_from_another_thread_ends_the_wait(store):
    with WakeupPipe(store) as pipe:
        threading.Timer(0.05, pipe.wake).start()
        assert waited_s(pipe, store, 30) < 10


def test_a_call_from_another_process_ends_the_wait(store):
    imports = "from executive.store.wakeup import wake_server; from pathlib import Path"
    line = f"{imports}; wake_server(Path({str(store.path)!r}))"
    with WakeupPipe(store) as pipe:
        other = subprocess.Popen([sys.executable, "-c", line], cwd=ROOT)
        assert waited_s(pipe, store, 50) < 45
        assert other.wait(30) == 0


def test_a_call_where_nobody_waits_does_nothing(store):
    wake_server(store.path)
    WakeupPipe(store).close()
    wake_server(store.path)
    assert list(store.path.parent.glob("*wakeup*")) == []


def test_more_calls_than_a_pipe_holds_block_nobody(store):
    with WakeupPipe(store) as pipe:
        for _ in range(70_000):
            pipe.wake()
        wake_server(store.path)
        assert waited_s(pipe, store, 30) < 10


def test_a_wait_is_never_so_long_that_a_clock_which_is_set_would_go_unnoticed(store, monkeypatch):
    assert LONGEST_WAIT < LATE
    monkeypatch.setattr(wakeup_module, "LONGEST_WAIT", timedelta(seconds=0.05))
    with WakeupPipe(store) as pipe:
        assert waited_s(pipe, store, 1000) < 10
        pipe.wait(None)


def test_a_pipe_that_a_killed_server_left_is_taken_over(store):
    WakeupPipe(store)  # not closed
    with WakeupPipe(store) as pipe:
        wake_server(store.path)
        assert waited_s(pipe, store, 30) < 10


def test_something_else_in_its_place_is_refused(store):
    store.path.with_name("missions.sqlite-wakeup").write_text("x")
    with pytest.raises(InputError, match="something else in the place of a pipe; move it away"):
        WakeupPipe(store)
