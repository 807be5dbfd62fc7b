"""Missions of a store, run by a stub in place of the simulated world."""

from contextlib import contextmanager

import pytest

from executive.app.report.run_report import RunReport
from executive.app.runs.one_run import FinishedRun
from executive.app.runs.queue import MissionRuns, RunOptions
from executive.mission.request import Request
from executive.run.control import Control
from executive.store.database import STORE_FILE
from executive.store.missions import MissionState, MissionStore
from executive.tree.node_view import node_view
from executive.words.goal import RefereeReport
from skills.inputs.errors import InputError

GO = "Take [Nothing] to [kitchen] and do [Nothing] to [Nothing]"


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

    def test_a_full_disk_ends_the_queue(self, runs, store, mission):
        def fill(prepared, **_):
            raise STORE_FILE.full_disk_error(store.path)

        with pytest.raises(InputError, match="the disk is full"):
            runs(fill).run(mission)

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


def cancelled_by_control(prepared, *, control, **_):
    """The end of a run that somebody has cancelled."""
    report = RunReport(
        "cancelled", None, control.poll().cancel, RefereeReport(False, "", 0, 0), (), "flat", 1, 1.0, 1.0, 1.0, 1, "log"
    )
    return FinishedRun(report, node_view(prepared.tree.root))
