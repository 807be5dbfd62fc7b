"""Missions of a store, run by a stub in place of the simulated world."""

import errno
import resource
import signal
from contextlib import contextmanager

import pytest

from executive.app.report.run_report import RunReport
from executive.app.runs.one_run import FinishedRun
from executive.app.runs.queue import MissionRuns, RunOptions
from executive.app.runs.signals import ended_by_signals
from executive.mission.request import Request
from executive.run.control import Control
from executive.store.missions import MissionState, MissionStore
from executive.tree.node_view import node_view
from executive.words.goal import RefereeReport
from skills.inputs.errors import InputError

GO = "Take [Nothing] to [kitchen] and do [Nothing] to [Nothing]"


def caused(error, cause):
    """An error with its cause, as `raise error from cause` leaves it."""
    error.__cause__ = cause
    return error


class Screen:
    """Remembers what it is told, and shows nothing."""

    def __init__(self):
        self.lines = []

    def tell(self, line, *, title=False):
        self.lines.append(line)

    @contextmanager
    def watch(self, prepared):
        yield RunOptions(Control(pace=None))

    def conclude(self, finished):
        self.lines.append(finished.report.message)

    def name_files(self, out):
        self.lines.append(f"files in {out.name}")


@pytest.fixture
def store(tmp_path):
    with MissionStore(tmp_path / "missions.sqlite") as store:
        yield store


class TestMissionRuns:
    @pytest.fixture
    def mission(self, store, tmp_path):
        return store.add(
            Request(commands=(GO,), name="go", world_name="flat", robot="Alice", out=tmp_path), queued=True
        )

    @pytest.fixture
    def runs(self, store):
        def of(run):
            return MissionRuns(store, Screen(), run=run)

        return of

    def test_a_mission_that_cannot_begin_ends_with_an_error_and_the_queue_goes_on(self, runs, store, mission):
        def refuse(prepared, **_):
            raise InputError("the world is full", hint="take another")

        ended = runs(refuse).run(mission)
        assert (ended.outcome, ended.achieved, ended.report) == ("error", False, None)
        assert store.mission(1).message == "the world is full; take another"
        assert store.mission(1).state is MissionState.ERROR

    @pytest.mark.parametrize(
        ("error", "lack"),
        [
            (OSError(errno.ENOSPC, "No space left on device"), "the disk is full"),
            (OSError(errno.EMFILE, "Too many open files"), "too many files are open"),
            (OSError(errno.ENFILE, "Too many open files in system"), "too many files are open"),
            (OSError(errno.ENOMEM, "Cannot allocate memory"), "there is too little memory"),
            (MemoryError(), "there is too little memory"),
            (caused(InputError("the world cannot be read"), OSError(errno.EMFILE, "")), "too many files are open"),
        ],
    )
    def test_a_mission_waits_while_this_machine_lacks_something(self, store, mission, monkeypatch, error, lack):
        monkeypatch.setattr("executive.app.runs.queue.ROOM_WAIT_S", 0.01)
        attempts = []

        def run(prepared, *, control, **_):
            attempts.append(prepared)
            if len(attempts) < 4:
                raise error
            return succeeded(prepared)

        screen = Screen()
        assert MissionRuns(store, screen, run=run).run(mission).outcome == "success"
        said = [line for line in screen.lines if "the queue waits" in line]
        assert said == [f"errand: {lack}; the queue waits until there is room"]
        assert store.mission(1).state is MissionState.SUCCESS

    def test_a_mission_waits_while_no_file_can_be_opened(self, store, mission, monkeypatch):
        monkeypatch.setattr("executive.app.runs.queue.ROOM_WAIT_S", 0.01)
        screen, used = Screen(), []
        soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)

        def tell(line, *, title=False):
            used.append(line)
            resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))

        screen.tell = tell
        runs = MissionRuns(store, screen, run=lambda prepared, **_: succeeded(prepared))
        resource.setrlimit(resource.RLIMIT_NOFILE, (20, hard))
        try:
            assert runs.run(mission).outcome == "success"
        finally:
            resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))
        assert used[0] == "errand: too many files are open; the queue waits until there is room"

    def test_a_queue_that_waits_can_be_cancelled(self, runs, store, mission):
        def fill(prepared, **_):
            begun.cancel("cancelled by SIGINT")
            raise OSError(errno.ENOSPC, "No space left on device")

        begun = runs(fill)
        with pytest.raises(InputError, match=r"the disk is full; .*make room, then go on with `errand resume"):
            begun.run(mission)
        assert store.mission(1).state is MissionState.RUNNING

    def test_a_mission_cancelled_before_its_start_is_cancelled_at_once(self, runs, mission):
        begun = runs(cancelled_by_control)
        begun.cancel("cancelled by SIGTERM")
        assert begun.run(mission).message == "cancelled by SIGTERM"

    def test_a_mission_under_way_is_cancelled(self, runs, mission):
        def start(prepared, *, control, **_):
            begun.cancel("cancelled by SIGINT")
            return cancelled_by_control(prepared, control=control)

        begun = runs(start)
        assert begun.run(mission).message == "cancelled by SIGINT"

    def test_a_signal_that_ends_the_queue_and_its_mission_leaves_time_for_always(self, runs, mission):
        def start(prepared, *, control, **_):
            with ended_by_signals(begun.cancel), ended_by_signals(control.cancel):
                signal.raise_signal(signal.SIGTERM)
            insisted.append(control.poll().insists)
            return cancelled_by_control(prepared, control=control)

        begun, insisted = runs(start), []
        assert (begun.run(mission).message, insisted) == ("cancelled by SIGTERM", [False])


def succeeded(prepared):
    """The end of a run whose mission is done."""
    report = RunReport("success", None, "done", RefereeReport(True, "", 0, 0), (), "flat", 1, 1.0, 1.0, 1.0, 1, "log")
    return FinishedRun(report, node_view(prepared.tree.root))


def cancelled_by_control(prepared, *, control, **_):
    """The end of a run that somebody has cancelled."""
    report = RunReport(
        "cancelled", None, control.poll().cancel, RefereeReport(False, "", 0, 0), (), "flat", 1, 1.0, 1.0, 1.0, 1, "log"
    )
    return FinishedRun(report, node_view(prepared.tree.root))
