"""Work given out to a Dask cluster, and what it says when the cluster is not fit for it; nightly in processes."""

import logging

import pytest

from executive.app.evaluate import workers as module
from executive.app.evaluate.workers import scheduler_at
from skills.inputs.errors import InputError
from tests.executive.app.evaluate import cheap_run

distributed = pytest.importorskip("distributed")

QUIET = {"dashboard_address": ":0", "memory_limit": 0, "silence_logs": logging.CRITICAL}


IN_THREADS = {"threads_per_worker": 1, "processes": False, "protocol": "tcp", **QUIET}
IN_PROCESSES = {"threads_per_worker": 1, "processes": True, **QUIET}


@pytest.fixture(scope="module", params=[IN_THREADS, pytest.param(IN_PROCESSES, marks=pytest.mark.nightly)])
def options(request):
    """Workers that are threads of this process, or processes with a nanny each."""
    return request.param


@pytest.fixture(scope="module")
def address(options):
    """A scheduler with two workers."""
    with distributed.LocalCluster(n_workers=2, **options) as started:
        yield started.scheduler_address


def test_each_item_is_worked_on_once(address):
    with scheduler_at(address) as workers:
        finished = list(workers.map_items(cheap_run.square, range(20)))
    assert sorted(one.item for one in finished) == list(range(20))
    assert all(one.result == one.item**2 for one in finished)


@pytest.mark.nightly
def test_a_worker_that_is_killed_loses_nothing_and_doubles_nothing(tmp_path):
    with (
        distributed.LocalCluster(n_workers=2, **IN_PROCESSES) as started,
        scheduler_at(started.scheduler_address) as workers,
    ):
        finished = list(workers.map_items(cheap_run.square_or_die, [(number, str(tmp_path)) for number in range(30)]))
    assert sorted(one.item[0] for one in finished) == list(range(30))
    assert all(one.result == one.item[0] ** 2 for one in finished)


def test_workers_of_another_version_are_refused_before_anything_runs(address, monkeypatch):
    monkeypatch.setattr(module, "_code_here", lambda: "9.9.9 of tomorrow")
    with (
        pytest.raises(InputError, match=r"has another version of Errand \(9\.9\.9 of tomorrow; here it is "),
        scheduler_at(address),
    ):
        pass


def test_an_exception_of_the_function_is_raised_by_the_iterator(address):
    with scheduler_at(address) as workers, pytest.raises(ZeroDivisionError):
        list(workers.map_items(cheap_run.divide, [1, 0]))


UNFIT = [
    ({"n_workers": 1, "threads_per_worker": 2}, "has 2 threads, and a mission needs a process"),
    ({"n_workers": 0, "protocol": "tcp"}, r"has no workers; start one: dask worker tcp://"),
]


@pytest.mark.parametrize(("workers", "says"), UNFIT)
def test_a_cluster_whose_workers_have_threads_or_that_has_none_is_refused(monkeypatch, workers, says):
    monkeypatch.setattr(module, "ANSWER_S", 0.3)
    with (
        distributed.LocalCluster(processes=False, **workers, **QUIET) as started,
        pytest.raises(InputError, match=says),
        scheduler_at(started.scheduler_address),
    ):
        pass


@pytest.mark.parametrize("named", ["tcp://127.0.0.1:9", "here"])
def test_a_scheduler_that_does_not_answer_is_told(named, monkeypatch):
    monkeypatch.setattr(module, "ANSWER_S", 0.3)
    with pytest.raises(InputError, match=f"no scheduler answers at {named}"), scheduler_at(named):
        pass


def remove_workers(cluster):
    cluster.scale(0)
    cluster.sync(cluster._correct_state)


GONE = [
    (remove_workers, r"no worker has been connected for 0\.5 s; start workers again; finished"),
    (lambda cluster: cluster.close(), "the scheduler has stopped answering"),
]


@pytest.mark.parametrize(("end", "says"), GONE, ids=["no workers", "no scheduler"])
def test_finished_items_outlive_a_cluster_that_is_gone(options, monkeypatch, end, says):
    monkeypatch.setattr(module, "GONE_S", 0.5)
    started = distributed.LocalCluster(n_workers=1, **options)
    landed = []
    with started, pytest.raises(InputError, match=says), scheduler_at(started.scheduler_address) as workers:
        for finished in workers.map_items(cheap_run.slow_square, range(200)):
            landed.append(finished.item)
            if len(landed) == 3:
                end(started)
    assert 3 <= len(landed) < 200
