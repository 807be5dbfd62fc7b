"""One run of an evaluation, in the process of a worker, which keeps what it has imported and loaded."""

from __future__ import annotations

import os
import platform
import tempfile
import threading
import time
import traceback
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path
from typing import Final

from executive.app.evaluate.evidence import evidence_of, steps_of
from executive.app.evaluate.outcome import RunOutcome, Standing
from executive.app.evaluate.runs import RunSpec
from executive.app.feasibility import refuse_impossible
from executive.app.memory import return_memory
from executive.app.prepare import prepare
from executive.app.prepared import Prepared
from executive.app.report import RefereeReport, RunReport
from executive.app.simulated import run_simulated
from executive.mission.request import Request
from executive.mission.scenario import Scenario
from executive.record.reader import read_events
from executive.words.robots import parse_robots
from plant.kinds import robot_kinds
from skills.files.errors import InputError

__all__ = ["lost_outcome", "request_of", "run_one"]

REFUSED: Final = "REFUSED"
_ONE_AT_A_TIME: Final = threading.Lock()


def run_one(spec: RunSpec, *, checked: bool = False) -> RunOutcome:
    """Run it from beginning to end. What goes wrong with it, a refusal included, is an outcome and raises nothing.

    When `checked`, what `errand check` finds refuses it.
    """
    began = time.monotonic()
    with _ONE_AT_A_TIME, tempfile.TemporaryDirectory(prefix="errand-run-", ignore_cleanup_errors=True) as folder:
        outcome = _ran(spec, Path(folder), checked)
    return_memory()
    worker = f"{platform.node()}:{os.getpid()}"
    return replace(outcome, spent_s=round(time.monotonic() - began, 3), worker=worker)


def _ran(spec: RunSpec, folder: Path, checked: bool) -> RunOutcome:
    out = folder / "out"
    try:
        with _files(spec, folder) as placed:
            prepared = prepared_run(placed, out)
            if checked:
                refuse_impossible(prepared)
            report = run_simulated(prepared).report
    except InputError as error:
        return RunOutcome(spec.id, _report(spec, "refused", REFUSED, str(error)).to_json())
    except Exception as error:
        what = f"{type(error).__name__}: {error}"
        kept = RunOutcome(spec.id, _report(spec, "error", "ERROR", what).to_json())
        return replace(kept, evidence=replace(kept.evidence, timeline=((0.0, "error", traceback.format_exc()),)))
    events = read_events(out / "log.mcap")
    outcome = RunOutcome(spec.id, {**report.to_json(), "log": ""}, steps_of(events))
    if outcome.standing is Standing.FULFILLED:
        return outcome
    files = {path.name: path.read_bytes() for path in sorted(out.iterdir()) if path.is_file()}
    return replace(outcome, evidence=evidence_of(events, files))


def prepared_run(spec: RunSpec, out: Path) -> Prepared:
    """The run's request, understood; nobody is asked. Raises InputError."""
    return prepare(request_of(spec, out))


def request_of(spec: RunSpec, out: Path) -> Request:
    """What `errand run` is asked for."""
    return Request(
        sentence=spec.sentence,
        file=None if spec.file is None else Path(spec.file),
        world=spec.world,
        answers=spec.answers,
        seed=spec.seed,
        out=out,
        record=False,
        stack=None if spec.stack is None else Path(spec.stack),
        given=spec.given,
        scenario=Scenario(spec.faults, spec.random_faults),
        scenario_files=() if spec.scenario is None else (Path(spec.scenario),),
        time_limit_s=spec.time_limit_s,
        variation=spec.variation,
        robots=parse_robots(spec.robot_words, robot_kinds()) if spec.robot_words else (),
    )


@contextmanager
def _files(spec: RunSpec, folder: Path) -> Iterator[RunSpec]:
    """The run with its files as they were when it was given out: where they lie, or copies where those differ."""
    if all(_is_text(Path(path), text) for path, text in spec.files.items()):
        yield spec
        return
    moved = {}
    for name, path in (("file", spec.file), ("scenario", spec.scenario), ("stack", spec.stack)):
        if path is not None:
            home = Path(path).parent
            own = {each: text for each, text in spec.files.items() if Path(each).is_relative_to(home)}
            for each, text in own.items():
                copy = folder / name / Path(each).relative_to(home)
                copy.parent.mkdir(parents=True, exist_ok=True)
                copy.write_text(text, encoding="utf-8")
            moved[name] = str(folder / name / Path(path).name)
    yield replace(spec, file=moved.get("file"), scenario=moved.get("scenario"), stack=moved.get("stack"))


def _is_text(path: Path, text: str) -> bool:
    with suppress(OSError, UnicodeDecodeError):
        return path.read_text(encoding="utf-8") == text
    return False


def lost_outcome(spec: RunSpec, why: str) -> RunOutcome:
    """The outcome of a run with which worker after worker has died."""
    return RunOutcome(spec.id, _report(spec, "error", "ERROR", why).to_json())


def _report(spec: RunSpec, outcome: str, cause: str, message: str) -> RunReport:
    """The report of a run that gave none."""
    return RunReport(
        outcome=outcome,
        cause=cause,
        message=message,
        referee=RefereeReport(False, "the run gave no report", 0, 0),
        commands=(),
        world=spec.world or "",
        seed=spec.seed,
        sim_time_s=0.0,
        wall_time_s=0.0,
        real_time_factor=0.0,
        ticks=0,
        log="",
    )
