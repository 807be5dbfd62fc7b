"""Distributes the runs of an evaluation to workers, and stores each result with evidence of failures."""

import base64
import os
import platform
import tempfile
import threading
import time
import traceback
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext, suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from executive.app.evaluate.results import Case, Evaluation, Evidence, Results, ResultsFile, RunSpec, Standing
from executive.app.evaluate.workers import Pool, installed_code
from executive.app.prepare.from_request import prepare_checked
from executive.app.report.artifacts import to_jpeg
from executive.app.report.run_report import RunReport
from executive.app.runs.one_run import return_memory, run_request
from executive.mission.request import Request
from executive.record.history import Event, read_events, timeline
from executive.tree.node_view import logged_view
from executive.view.map_picture import map_picture
from executive.words.goal import RefereeReport
from executive.words.schemas import TRANSITIONS, TREE
from executive.words.variation import NO_VARIATION
from skills.inputs.errors import InputError, Problems

Progress = Callable[[int], AbstractContextManager[Callable[[str], None]]]
"""Shows progress over a number of runs; the yielded function is called after each run with a line about it."""
LOGS: Final = "logs"
REFUSED: Final = "REFUSED"
MOST_ENTRIES: Final = 60
MOST_PICTURES: Final = 3
_CANCELLED: Final = "cancelled"
_WIDEST_PX: Final = 360
_JPEG_QUALITY: Final = 60
_ONE_AT_A_TIME: Final = threading.Lock()


def evaluate_runs(
    evaluation: Evaluation,
    pool: Pool,
    results: Path,
    *,
    out: Path,
    tell: Callable[[str], None] = lambda line: None,
    progress: Progress = lambda total: nullcontext(lambda line: None),
    before: Callable[[Sequence[RunSpec]], None] | None = None,
    checked: bool = False,
) -> Results:
    """Executes the runs that have no result yet; writes results to the file `results` and files of runs to `out`.

    Args:
        evaluation: the runs.
        pool: the workers.
        results: the results file, which is created if missing.
        out: the folder for files of runs.
        tell: shows a line.
        progress: shows the progress.
        before: called once with the runs that have no result yet; it may raise InputError to refuse them.
        checked: whether a run with errors of `errand check` counts as refused.

    Raises:
        InputError: `before` refuses the runs, or results cannot be written; stored results stay.
    """
    with ResultsFile(results, create=True) as stored, stored.claim():
        stored.begin(evaluation, code=installed_code())
        done = stored.done_ids()
        missing = [run for run in evaluation.runs if run.id not in done]
        if missing and before is not None:
            before(missing)
        if done:
            tell(f"{len(done)} of {len(evaluation.runs)} runs have a result in {stored.path}.")
        stored.note(logs=str((out / LOGS).resolve()))
        if missing:
            _execute(missing, stored, pool, out, progress, checked=checked)
        return stored.results()


def _execute(
    missing: Sequence[RunSpec], stored: ResultsFile, pool: Pool, out: Path, progress: Progress, *, checked: bool
) -> None:
    """Executes the runs and stores each result at the run's end; a cancelled run gets no result and is repeated."""
    with pool.opened() as workers, progress(len(missing)) as advance:
        count, began = workers.count, time.monotonic()
        for finished in workers.map_items(partial(run_one, checked=checked), missing):
            run = finished.item
            case = finished.result or Case(run, _report(run, "error", "ERROR", finished.lost))
            if case.report.outcome != _CANCELLED:
                stored.add(_write_files(case, out / (run.folder or f"{LOGS}/{run.id}")))
                advance(f"seed {run.request.seed}, {run.mission}: {case.label}")
        hours = (time.monotonic() - began) / 3600.0
    stored.note(workers=str(count), missions_per_hour=f"{len(missing) / hours:.1f}")


def _write_files(case: Case, folder: Path) -> Case:
    """Writes the files of a case into a folder, and sets the path of its log."""
    files = case.evidence.files
    if not files:
        return case
    folder.mkdir(parents=True, exist_ok=True)
    for name, data in files.items():
        (folder / Path(name).name).write_bytes(data)
    return replace(case, report=replace(case.report, log=str(folder / "log.mcap")))


def refuse_impossible_runs(runs: Sequence[RunSpec]) -> None:
    """Checks each run once for all its seeds, as `errand check` does. Raises InputError with all errors found."""
    problems, seen = Problems(), set[str]()
    for run in runs:
        request = run.request
        varied = replace(NO_VARIATION, light=request.variation.light)
        plain = replace(request, seed=1, scenario=replace(request.scenario, random=0), variation=varied)
        if plain.to_json() not in seen:
            seen.add(plain.to_json())
            with problems:
                prepare_checked(plain)
    problems.raise_any()


def run_one(spec: RunSpec, *, checked: bool = False) -> Case:
    """Executes a run and returns its result. Never raises: refusals and defects are results.

    With `checked`, errors of `errand check` refuse the run.
    """
    began = time.monotonic()
    with _ONE_AT_A_TIME, tempfile.TemporaryDirectory(prefix="errand-run-", ignore_cleanup_errors=True) as folder:
        case = _run_in(Path(folder), spec, checked)
    return_memory()
    worker = f"{platform.node()}:{os.getpid()}"
    return replace(case, spent_s=round(time.monotonic() - began, 3), worker=worker)


def _run_in(folder: Path, spec: RunSpec, checked: bool) -> Case:
    """Executes a run with its files in a temporary folder."""
    try:
        request = replace(_request(spec, folder), out=folder / "out", record=False)
        prepared = prepare_checked(request, anyway=not checked)
        report = run_request(prepared).report
    except InputError as error:
        return Case(spec, _report(spec, "refused", REFUSED, str(error)))
    except Exception as error:
        what = f"{type(error).__name__}: {error}"
        evidence = Evidence(timeline=((0.0, "error", traceback.format_exc()),))
        return Case(spec, _report(spec, "error", "ERROR", what), evidence=evidence)
    events = read_events(folder / "out" / "log.mcap")
    case = Case(spec, replace(report, log=""), steps_of(events))
    failed = case.standing is not Standing.FULFILLED
    if not failed and not spec.folder:
        return case
    files = {path.name: path.read_bytes() for path in sorted((folder / "out").iterdir()) if path.is_file()}
    return replace(case, evidence=evidence_of(events, files) if failed else Evidence(files=files))


def _request(spec: RunSpec, folder: Path) -> Request:
    """Returns the request with its files as they were when the evaluation began; copies files changed since then."""
    request = spec.request
    if all(_has_text(Path(path), text) for path, text in spec.files.items()):
        return request

    def copied(name: str, path: Path | None) -> Path | None:
        """Writes a file and the files beside it into a folder; returns the file's path there."""
        if path is None:
            return None
        for each, text in spec.files.items():
            if Path(each).is_relative_to(path.parent):
                copy = folder / name / Path(each).relative_to(path.parent)
                copy.parent.mkdir(parents=True, exist_ok=True)
                copy.write_text(text, encoding="utf-8")
        return folder / name / path.name

    scenarios = (copied(f"scenario-{number}", path) for number, path in enumerate(request.scenario_files))
    return replace(
        request,
        file=copied("file", request.file),
        stack=copied("stack", request.stack),
        scenario_files=tuple(filter(None, scenarios)),
    )


def _has_text(path: Path, text: str) -> bool:
    with suppress(OSError, UnicodeDecodeError):
        return path.read_text(encoding="utf-8") == text
    return False


def _report(spec: RunSpec, outcome: str, cause: str, message: str) -> RunReport:
    """Builds the report of a run that ended before it could report."""
    return RunReport(
        outcome=outcome,
        cause=cause,
        message=message,
        referee=RefereeReport(False, "the run gave no report", 0, 0),
        commands=(),
        world=spec.request.world or "",
        seed=spec.request.seed,
        sim_time_s=0.0,
        wall_time_s=0.0,
        real_time_factor=0.0,
        ticks=0,
        log="",
    )


def steps_of(events: Sequence[Event]) -> dict[str, float]:
    """Returns the run time of each skill by its name (s, on the robot's clock); skills in parallel count separately."""
    skills, since, spent = dict[str, str](), dict[str, float](), defaultdict[str, float](float)
    for event in events:
        if event.topic == TREE:
            nodes = (node for _, node in logged_view(event.data["root"], {}).walk())
            skills |= {node.path_id: node.name for node in nodes if node.behaviour.runs_skill}
        elif event.topic == TRANSITIONS and (name := skills.get(event.data["node"])) is not None:
            node, t_s = str(event.data["node"]), float(event.data.get("t", event.stamp_s))
            if node in since:
                spent[name] += t_s - since.pop(node)
            if event.data["to"] == "RUNNING":
                since[node] = t_s
    end_s = max((event.stamp_s for event in events), default=0.0)
    for node, begun_s in since.items():
        spent[skills[node]] += max(0.0, end_s - begun_s)
    return {name: round(seconds, 3) for name, seconds in sorted(spent.items())}


def evidence_of(events: Sequence[Event], files: Mapping[str, bytes]) -> Evidence:
    """Returns the end of the timeline, the map with the robot's path, and the last pictures."""
    entries = [(entry.t, entry.about, entry.text) for entry in timeline(events, leaves_only=True) if entry.text]
    return Evidence(tuple(entries[-MOST_ENTRIES:]), tuple(_pictures(events)), dict(files))


def _pictures(events: Sequence[Event]) -> Iterator[tuple[str, bytes]]:
    with suppress(InputError):
        yield "the map, with the path of the robot", _jpeg(map_picture(events))
    taken = [event for event in events if event.data.get("format") == "jpeg" and event.data.get("data")]
    for event in taken[-MOST_PICTURES:]:
        data = np.frombuffer(base64.b64decode(event.data["data"]), np.uint8)
        picture = cv2.imdecode(data, cv2.IMREAD_COLOR)
        if picture is not None:
            yield f"{event.topic} at {event.stamp_s:.1f} s", _jpeg(np.asarray(picture, np.uint8))


def _jpeg(picture: NDArray[np.uint8]) -> bytes:
    """Encodes a picture (height, width, 3; blue, green, red) as a small JPEG."""
    return to_jpeg(np.asarray(cv2.cvtColor(picture, cv2.COLOR_BGR2RGB), np.uint8), _WIDEST_PX, _JPEG_QUALITY)
