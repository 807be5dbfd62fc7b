"""A disk that fills up in the middle of a run: the robot stops, nothing is lost, and the user is told the way on."""

import errno
import os

import pytest

from executive.app.prepare.from_request import prepare
from executive.app.runs.folders import KeptRun
from executive.app.runs.one_run import run_request
from executive.app.runs.queue import note_run
from executive.mission.request import Request
from executive.record.event_log import EventLog
from executive.record.history import read_events
from executive.run.outcome import Outcome
from executive.store.missions import MissionState, MissionStore
from skills.inputs.errors import InputError
from tests.executive.app.runs.scripted_backend import ScriptedBackend

FULL_AT_S = 3.0


@pytest.fixture
def prepared(tmp_path, monkeypatch):
    monkeypatch.setattr("executive.app.prepare.from_request.load_parser", lambda: None)  # no step here is a sentence
    path = tmp_path / "drive.yaml"
    path.write_text("name: drive\nsteps:\n  - {skill: navigate, with: {x: 3.0, y: 0.5}}\n")
    return prepare(Request(file=path, out=tmp_path, seed=4))


def full():
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


@pytest.fixture
def filling(monkeypatch):
    """The log's file takes no more from a time on."""
    flush = EventLog.flush
    monkeypatch.setattr(EventLog, "flush", lambda log: full() if log._clock.now() > FULL_AT_S else flush(log))


def run_kept(prepared, store, backend, ending=None):
    mission, kept = store.add(prepared.request, queued=False), KeptRun(prepared.request, store.now(), "1")
    with note_run(store, mission, kept) as ended:
        finished = run_request(prepared, backend)
        if ending is not None:
            ending()
        ended(finished.report)


def test_the_robot_stops_and_the_resume_command_is_named(prepared, filling, tmp_path):
    backend = ScriptedBackend()
    with MissionStore(tmp_path / "missions.sqlite") as store, pytest.raises(InputError) as left:
        run_kept(prepared, store, backend)
    told = str(left.value)
    assert ("disk is full" in told, f"errand resume --store {tmp_path}" in told) == (True, True)
    assert "stop" in backend.robot.calls[-2:]
    assert backend.robot.lease_holder() is None


def test_the_mission_may_be_resumed_and_what_was_logged_is_there(prepared, filling, tmp_path):
    with MissionStore(tmp_path / "missions.sqlite") as store, pytest.raises(InputError):
        run_kept(prepared, store, ScriptedBackend())
    with MissionStore(tmp_path / "missions.sqlite", create=False) as store:
        assert [mission.state for mission in store.missions()] == [MissionState.RUNNING]
    assert read_events(tmp_path / "log.mcap")[-1].stamp_s > FULL_AT_S - 1.2


def test_a_disk_that_is_full_when_pictures_are_written_leaves_the_mission_resumable(prepared, tmp_path):
    backend = ScriptedBackend()
    with MissionStore(tmp_path / "missions.sqlite") as store, pytest.raises(InputError):
        run_kept(prepared, store, backend, ending=full)
    assert backend.asked == [("drive", Outcome.SUCCESS)]
    with MissionStore(tmp_path / "missions.sqlite", create=False) as store:
        assert [mission.state for mission in store.missions()] == [MissionState.RUNNING]


def test_a_skill_that_finds_too_many_files_open_leaves_the_mission_resumable(prepared, tmp_path, monkeypatch):
    def starved(self):
        raise OSError(errno.EMFILE, os.strerror(errno.EMFILE))

    monkeypatch.setattr("skills.navigate.skill.Navigate.step", starved)
    with MissionStore(tmp_path / "missions.sqlite") as store:
        with pytest.raises(
            InputError, match="too many files are open; what was written is kept: make room, then go on"
        ):
            run_kept(prepared, store, ScriptedBackend())
        assert [mission.state for mission in store.missions()] == [MissionState.RUNNING]
