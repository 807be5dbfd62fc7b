"""Signals end a run in order: the robot is stopped, the log is closed, and the mission may be resumed."""

import os
import pty
import signal
import sys
import textwrap
from pathlib import Path

import pytest

from executive.app.runs import signals
from executive.app.runs.signals import ended_by_signals, interrupted_by_hang_up
from executive.record.history import read_history
from executive.run.control import Control
from executive.store.missions import MissionState, MissionStore

ROOT = Path(__file__).parents[4]


@pytest.fixture(autouse=True)
def a_terminal_that_can_hang_up():
    """The tests themselves may run under `nohup`, which has the signal ignored."""
    before = signal.signal(signal.SIGHUP, signal.SIG_DFL)
    yield
    signal.signal(signal.SIGHUP, before)


RUN = """
    import sys, threading, time
    from pathlib import Path
    from dataclasses import replace
    sys.path.insert(0, {tests!r})
    from scripted_backend import ScriptedBackend
    from executive.cli import screen
    from executive.app.prepare import from_request as preparing
    from executive.app.runs.queue import MissionRuns
    from executive.app.runs.one_run import run_request
    from executive.app.prepare.from_request import prepare
    from executive.mission.request import Request
    from executive.store.missions import MissionStore
    from tests.visitors import OnTick
    from rich.console import Console

    preparing.load_parser = screen.load_parser = lambda: None
    out, robot = Path({out!r}), ScriptedBackend()
    request = Request(file=out / "m.yaml", out=out)
    prepared = prepare(request)

    def told(progress):
        (out / "begun").touch()
        time.sleep(0.01)

    def run(prepared, *, control, visitors, **_):
        return run_request(prepared, robot, control=control, visitors=[*visitors, OnTick(told)])

    with MissionStore(out / "missions.sqlite") as store:
        mission = store.add(prepared.request, queued=False)
        ended = MissionRuns(store, screen.ConsoleScreen(Console(), quiet=False), run=run).run(mission, prepared)
    assert ended.hung_up
    (out / "stopped").write_text(next(call for call in reversed(robot.robot.calls) if call in ("stop", "drive")))
"""


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_cancels_and_the_handlers_are_put_back(number):
    control, before = Control(pace=None), signal.getsignal(number)
    with ended_by_signals(control.cancel) as ending:
        signal.raise_signal(number)
    assert ending.hung_up is (number == signal.SIGHUP)
    assert control.poll().cancel == f"cancelled by {signal.Signals(number).name}"
    assert signal.getsignal(number) == before


def test_a_signal_ends_the_inner_and_the_outer_block():
    reasons, control = [], Control(pace=None)
    with ended_by_signals(reasons.append):
        with ended_by_signals(control.cancel):
            signal.raise_signal(signal.SIGTERM)
        assert (control.poll().cancel, reasons) == ("cancelled by SIGTERM", ["cancelled by SIGTERM"])
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)


def test_a_second_ctrl_c_breaks_in_and_a_second_hang_up_does_not():
    with ended_by_signals(Control(pace=None).cancel):
        for number in (signal.SIGHUP, signal.SIGHUP, signal.SIGINT):
            signal.raise_signal(number)
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)


def test_sigterm_breaks_in_when_the_block_does_not_end(monkeypatch):
    monkeypatch.setattr(signals, "_ENDS_WITHIN_S", 0.01)
    reasons = []
    with ended_by_signals(reasons.append), ended_by_signals(reasons.append):
        signal.raise_signal(signal.SIGTERM)
        with pytest.raises(KeyboardInterrupt, match="cancelled by SIGTERM"):
            signal.pause()
    assert reasons == ["cancelled by SIGTERM"] * 2


def test_after_the_block_nothing_is_left_of_the_limit():
    with ended_by_signals(Control(pace=None).cancel):
        signal.raise_signal(signal.SIGTERM)
        assert signal.getitimer(signal.ITIMER_REAL)[0] < 5.0
    assert signal.getitimer(signal.ITIMER_REAL) == (0.0, 0.0)


def test_an_alarm_of_others_reaches_them_in_the_block():
    rung = []
    before = signal.signal(signal.SIGALRM, lambda number, frame: rung.append(number))
    try:
        with ended_by_signals(Control(pace=None).cancel):
            signal.raise_signal(signal.SIGALRM)
    finally:
        signal.signal(signal.SIGALRM, before)
    assert rung == [signal.SIGALRM]


def test_a_hang_up_ends_listening_as_ctrl_c_does():
    with pytest.raises(KeyboardInterrupt), interrupted_by_hang_up():
        signal.raise_signal(signal.SIGHUP)


def test_under_nohup_the_run_goes_on():
    before, control = signal.signal(signal.SIGHUP, signal.SIG_IGN), Control(pace=None)
    try:
        with ended_by_signals(control.cancel):
            signal.raise_signal(signal.SIGHUP)
    finally:
        signal.signal(signal.SIGHUP, before)
    assert control.poll().cancel is None


def test_closing_the_terminal_stops_the_robot_closes_the_log_and_leaves_the_mission_resumable(tmp_path):
    steps = "".join(f"  - {{skill: navigate, with: {{x: {n % 2}.0, y: 0.5}}}}\n" for n in range(200))
    (tmp_path / "m.yaml").write_text(f"name: drives\nsteps:\n{steps}")
    script = textwrap.dedent(RUN).format(tests=str(Path(__file__).parent), out=str(tmp_path))
    child, terminal = pty.fork()
    if child == 0:
        os.execve(sys.executable, [sys.executable, "-c", script], {**os.environ, "PYTHONPATH": str(ROOT)})
    told = b""
    while not (tmp_path / "begun").exists():
        told += os.read(terminal, 4096)
    os.close(terminal)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0, told.decode()
    assert (tmp_path / "stopped").read_text() == "stop"
    with MissionStore(tmp_path / "missions.sqlite", create=False) as store:
        (mission,) = store.missions()
        assert (mission.state, mission.message) == (MissionState.CANCELLED, "cancelled by SIGHUP")
    (end,) = [event.data for event in read_history(tmp_path / "last").events if event.topic == "outcome"]
    assert end["outcome"] == "cancelled"
