"""One run of an evaluation, in the process of a worker, and what its log shows: times, timeline, small pictures."""

from __future__ import annotations

import base64
import os
import platform
import tempfile
import threading
import time
import traceback
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import cv2
import numpy as np
from numpy.typing import NDArray

from executive.app.evaluate.case import RunSpec
from executive.app.evaluate.outcome import Evidence, RunOutcome, Standing
from executive.app.feasibility import refuse_impossible
from executive.app.mission_run import return_memory, run_request
from executive.app.prepare import prepare
from executive.app.report import RefereeReport, RunReport
from executive.mission.request import Request
from executive.record.reader import Event, read_events
from executive.record.schemas import TRANSITIONS, TREE
from executive.record.timeline import timeline
from executive.view.map_picture import map_picture
from skills.files.errors import InputError

__all__ = ["evidence_of", "lost_outcome", "run_one", "steps_of"]

REFUSED: Final = "REFUSED"
MOST_ENTRIES: Final = 60
MOST_PICTURES: Final = 3
_WIDEST_PX: Final = 360
_JPEG_QUALITY: Final = 60
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
    try:
        prepared = prepare(replace(_with_files(spec, folder), out=folder / "out", record=False), ask=None)
        if checked:
            refuse_impossible(prepared)
        report = run_request(prepared).report
    except InputError as error:
        return RunOutcome(spec.id, _report(spec, "refused", REFUSED, str(error)))
    except Exception as error:
        what = f"{type(error).__name__}: {error}"
        kept = RunOutcome(spec.id, _report(spec, "error", "ERROR", what))
        return replace(kept, evidence=replace(kept.evidence, timeline=((0.0, "error", traceback.format_exc()),)))
    events = read_events(folder / "out" / "log.mcap")
    outcome = RunOutcome(spec.id, replace(report, log=""), steps_of(events))
    failed = outcome.standing is not Standing.FULFILLED
    if not failed and not spec.folder:
        return outcome
    files = {path.name: path.read_bytes() for path in sorted((folder / "out").iterdir()) if path.is_file()}
    return replace(outcome, evidence=evidence_of(events, files) if failed else Evidence(files=files))


def _with_files(spec: RunSpec, folder: Path) -> Request:
    """The request with its files as they were when it was given out: where they lie, or copies where those differ."""
    request = spec.request
    if all(_is_text(Path(path), text) for path, text in spec.files.items()):
        return request

    def copied(name: str, path: Path | None) -> Path | None:
        """Write the texts of a file and of those beside it into a folder; the file's path there."""
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


def lost_outcome(spec: RunSpec, why: str) -> RunOutcome:
    """The outcome of a run with which worker after worker has died."""
    return RunOutcome(spec.id, _report(spec, "error", "ERROR", why))


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
            skills |= dict(_skills(event.data["root"]))
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


def _skills(node: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """The path id and the name of each skill in a logged tree."""
    if node["type"] == "skill":
        yield node["id"], node["name"]
    for child in node["children"]:
        yield from _skills(child)


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
