"""The doorbell: who waits hears of a ring from any thread and any process, and of nothing else."""

import subprocess
import sys
import threading
import time
from datetime import timedelta
from pathlib import Path

import pytest

from executive.mission.errors import InputError
from executive.store import doorbell as doorbell_module
from executive.store.doorbell import Doorbell, ring
from executive.store.missions import MissionStore

ROOT = Path(__file__).parents[3]


@pytest.fixture
def store(tmp_path):
    with MissionStore(tmp_path / "missions.sqlite") as store:
        yield store


def waited_s(door, store, seconds):
    begun = time.monotonic()
    door.wait(store.now() + timedelta(seconds=seconds))
    return time.monotonic() - begun


def test_a_ring_before_the_wait_is_heard_once(store):
    with Doorbell(store) as door:
        for _ in range(3):
            door.ring()
        assert waited_s(door, store, 30) < 10
        assert waited_s(door, store, 0.05) >= 0.04


def test_a_ring_from_another_thread_ends_the_wait(store):
    with Doorbell(store) as door:
        threading.Timer(0.05, door.ring).start()
        assert waited_s(door, store, 30) < 10


def test_a_ring_from_another_process_ends_the_wait(store):
    line = f"from executive.store.doorbell import ring; from pathlib import Path; ring(Path({str(store.path)!r}))"
    with Doorbell(store) as door:
        other = subprocess.Popen([sys.executable, "-c", line], cwd=ROOT)
        assert waited_s(door, store, 50) < 45
        assert other.wait(30) == 0


def test_a_ring_where_nobody_waits_does_nothing(store):
    ring(store.path)
    Doorbell(store).close()
    ring(store.path)
    assert list(store.path.parent.glob("*doorbell*")) == []


def test_more_rings_than_a_pipe_holds_block_nobody(store):
    with Doorbell(store) as door:
        for _ in range(70_000):
            door.ring()
        ring(store.path)
        assert waited_s(door, store, 30) < 10


def test_a_wait_for_what_has_passed_returns_at_once(store):
    with Doorbell(store) as door:
        assert waited_s(door, store, -5) < 5


def test_a_wait_is_never_so_long_that_a_clock_which_is_set_would_go_unnoticed(store, monkeypatch):
    monkeypatch.setattr(doorbell_module, "LONGEST_WAIT", timedelta(seconds=0.05))
    with Doorbell(store) as door:
        assert waited_s(door, store, 1000) < 10
        door.wait(None)


def test_a_pipe_that_a_killed_server_left_is_taken_over(store):
    Doorbell(store)  # not closed
    with Doorbell(store) as door:
        ring(store.path)
        assert waited_s(door, store, 30) < 10


def test_something_else_in_its_place_is_refused(store):
    store.path.with_name("missions.sqlite-doorbell").write_text("x")
    with pytest.raises(InputError, match="something else in the place of a pipe; move it away"):
        Doorbell(store)
