"""Work given out to processes that may die."""

import multiprocessing
import subprocess
import sys
from pathlib import Path

import pytest

from executive.app.evaluate.workers import LocalWorkers
from tests.executive.app.evaluate import cheap_run


@pytest.fixture
def quick_start(monkeypatch):
    """Workers are forked from a process that has imported what they need, in place of a fresh one each."""
    forking = multiprocessing.get_context("forkserver")
    forking.set_forkserver_preload([cheap_run.__name__, LocalWorkers.__module__])
    monkeypatch.setattr(multiprocessing, "get_context", lambda method: forking)


def test_each_item_is_worked_on_once(quick_start):
    finished = list(LocalWorkers(2).map_items(cheap_run.square, range(20)))
    assert sorted(one.item for one in finished) == list(range(20))
    assert all(one.result == one.item**2 for one in finished)


def test_a_worker_that_is_killed_loses_nothing_and_doubles_nothing(quick_start, tmp_path):
    items = [(number, str(tmp_path)) for number in range(30)]
    finished = list(LocalWorkers(2).map_items(cheap_run.square_or_die, items))
    assert sorted(one.item[0] for one in finished) == list(range(30))
    assert all(one.result == one.item[0] ** 2 for one in finished)


def test_an_item_that_kills_each_worker_is_given_up_alone(quick_start):
    finished = {one.item: one for one in LocalWorkers(2).map_items(cheap_run.always_die, range(6))}
    assert (finished[3].result, "3 worker processes have died" in finished[3].lost) == (None, True)
    assert [finished[number].result for number in (0, 1, 2, 4, 5)] == [0, 1, 2, 4, 5]


ENDLESS = """
import sys
sys.path.insert(0, {folder!r})
import cheap_run
from executive.app.evaluate.workers import LocalWorkers
if __name__ == "__main__":
    list(LocalWorkers(2).map_items(cheap_run.never_end, range(4)))
"""


def test_workers_end_when_the_process_that_started_them_is_killed(tmp_path):
    (tmp_path / "endless.py").write_text(ENDLESS.format(folder=str(Path(__file__).parent)))
    command = [sys.executable, str(tmp_path / "endless.py")]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as started:
        assert started.stdout.readline() == "begun\n"
        started.kill()
        started.communicate(timeout=30)  # returns when none of them holds the pipe any more
