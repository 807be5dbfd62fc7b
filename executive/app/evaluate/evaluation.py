"""Gives out the runs of an evaluation, and keeps each result as it ends, with what its log shows of a failure."""

from __future__ import annotations

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

from executive.app.checker import prepare_checked
from executive.app.evaluate.results import Case, Evaluated, Evaluation, Evidence, ResultsFile, RunSpec, Standing
from executive.app.evaluate.workers import Pool, installed_code
from executive.app.mission_run import return_memory, run_request
from executive.app.report import RunReport
from executive.mission.request import Request
from executive.record.history import Event, read_events, timeline
from executive.record.schemas import TRANSITIONS, TREE
from executive.tree.node_view import logged_view
from executive.view.map_picture import map_picture
from executive.words.goal import RefereeReport
from executive.words.variation import NO_VARIATION
from skills.files.errors import InputError, Problems

Progress = Callable[[int], AbstractContextManager[Callable[[], None]]]
"""Shows how many of so many runs are done; what it gives is called after each."""
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
    progress: Progress = lambda total: nullcontext(lambda: None),
    before: Callable[[Sequence[RunSpec]], None] | None = None,
    checked: bool = False,
) -> Evaluated:
    """Runs what is still missing of the runs, and keeps each result in the file `results`, files of runs in `out`.

    Args:
        evaluation: the runs.
        pool: who works on them.
        results: the results file, made where there is none.
        out: the folder for the files of runs.
        tell: shows a line.
        progress: shows how far it is.
        before: is called with the missing runs before the first begins, to refuse them all by InputError.
        checked: whether a run that `errand check` would refuse counts as refused.

    Raises:
        InputError: from `before`, or results cannot be kept; those that are there stay.
    """
    with ResultsFile(results, create=True) as kept, kept.claimed():
        kept.begin(evaluation, code=installed_code())
        done = kept.done()
        missing = [run for run in evaluation.runs if run.id not in done]
        if missing and before is not None:
            before(missing)
        if done:
            tell(f"{len(done)} of {len(evaluation.runs)} runs have a result in {kept.path}.")
        kept.note(logs=str((out / LOGS).resolve()))
        if missing:
            _work_through(missing, kept, pool, out, progress, checked=checked)
        return kept.evaluated()


def _work_through(
    missing: Sequence[RunSpec], kept: ResultsFile, pool: Pool, out: Path, progress: Progress, *, checked: bool
) -> None:
    """Keeps the result of each run as it ends; one that was cancelled is left to the next time."""
    with pool.opened() as workers, progress(len(missing)) as advance:
        count, began = workers.count, time.monotonic()
        for finished in workers.give_out(partial(run_one, checked=checked), missing):
            run = finished.item
            case = finished.result or Case(run, _report(run, "error", "ERROR", finished.lost))
            if case.report.outcome != _CANCELLED:
                kept.add(_with_files(case, out / (run.folder or f"{LOGS}/{run.id}")))
                advance()
        hours = (time.monotonic() - began) / 3600.0
    kept.note(workers=str(count), missions_per_hour=f"{len(missing) / hours:.1f}")


def _with_files(case: Case, folder: Path) -> Case:
    """The case, its files written into a folder of its own, and its log named where there is one."""
    files = case.evidence.files
    if not files:
        return case
    folder.mkdir(parents=True, exist_ok=True)
    for name, data in files.items():
        (folder / Path(name).name).write_bytes(data)
    return replace(case, report=replace(case.report, log=str(folder / "log.mcap")))


def refuse_impossible_runs(runs: Sequence[RunSpec]) -> None:
    """Understands and checks what differs by more than the seed, the light and the like. Raises InputError with all."""
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
    """Runs it from beginning to end. What goes wrong with it, a refusal included, is a result and raises nothing.

    When `checked`, what `errand check` finds refuses it.
    """
    began = time.monotonic()
    with _ONE_AT_A_TIME, tempfile.TemporaryDirectory(prefix="errand-run-", ignore_cleanup_errors=True) as folder:
        case = _ran(spec, Path(folder), checked)
    return_memory()
    worker = f"{platform.node()}:{os.getpid()}"
    return replace(case, spent_s=round(time.monotonic() - began, 3), worker=worker)


def _ran(spec: RunSpec, folder: Path, checked: bool) -> Case:
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
    """The request with its files as they were when it was given out: where they lie, or copies where those differ."""
    request = spec.request
    if all(_is_text(Path(path), text) for path, text in spec.files.items()):
        return request

    def copied(name: str, path: Path | None) -> Path | None:
        """Writes the texts of a file and of those beside it into a folder; the file's path there."""
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


def _is_text(path: Path, text: str) -> bool:
    with suppress(OSError, UnicodeDecodeError):
        return path.read_text(encoding="utf-8") == text
    return False


def _report(spec: RunSpec, outcome: str, cause: str, message: str) -> RunReport:
    """The report of a run that gave none."""
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
    """Run time of each skill by its name (s, on the robot's clock); skills that run at once count each."""
    skills, since, spent = dict[str, str](), dict[str, float](), defaultdict[str, float](float)
    for event in events:
        if event.topic == TREE:
            nodes = (node for _, node in logged_view(event.data["root"], {}).walk())
            skills |= {node.path_id: node.name for node in nodes if node.kind == "skill"}
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
    """The last of what happened, the map with the robot's way, and the last pictures that were taken."""
    entries = [(entry.t, entry.about, entry.text) for entry in timeline(events, leaves_only=True) if entry.text]
    return Evidence(tuple(entries[-MOST_ENTRIES:]), tuple(_pictures(events)), dict(files))


def _pictures(events: Sequence[Event]) -> Iterator[tuple[str, bytes]]:
    with suppress(InputError):
        yield "the map, with the way of the robot", _jpeg(map_picture(events))
    taken = [event for event in events if event.data.get("format") == "jpeg" and event.data.get("data")]
    for event in taken[-MOST_PICTURES:]:
        data = np.frombuffer(base64.b64decode(event.data["data"]), np.uint8)
        picture = cv2.imdecode(data, cv2.IMREAD_COLOR)
        if picture is not None:
            yield f"{event.topic} at {event.stamp_s:.1f} s", _jpeg(np.asarray(picture, np.uint8))


def _jpeg(picture: NDArray[np.uint8]) -> bytes:
    """A picture (height, width, 3; blue, green, red), made small, as a JPEG file."""
    height, width = picture.shape[:2]
    scale = min(1.0, _WIDEST_PX / width)
    size = (round(width * scale), max(1, round(height * scale)))
    small = cv2.resize(picture, size, interpolation=cv2.INTER_AREA) if scale < 1.0 else picture
    return cv2.imencode(".jpg", small, [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY])[1].tobytes()
