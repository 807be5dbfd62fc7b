"""Runs of a folder as rows: what was asked, what was claimed, what the referee saw; two runs compared."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from itertools import zip_longest
from pathlib import Path
from typing import Any, Final

from executive.app.evaluate.results import Case, ResultsFile
from executive.app.report.run_report import VERDICTS
from executive.app.runs.folders import FACTS, kept_run
from executive.record.history import Entry, read_history, timeline
from executive.tree.node_view import NodeView, outline
from skills.inputs.errors import InputError

PICTURES: Final = re.compile(r"[\w.-]{1,80}\.(?:png|jpg)", re.ASCII)
_RUNNING: Final = "running or interrupted"


@dataclass(frozen=True)
class RunRow:
    """Run of the board. `id` is its folder below that of the runs, or the number of an evaluation's case.

    `time_s` is on the robot's clock; `contacts` counts collisions and drops.
    """

    id: str
    mission: str
    world: str
    seed: int
    begun: datetime | None
    outcome: str
    verdict: str
    time_s: float
    contacts: int
    cause: str
    message: str
    source: str = ""

    @property
    def look(self) -> str:
        """Look of the row: success, failure, running or cancelled."""
        if self.outcome == _RUNNING:
            return "running"
        if self.outcome == "success":
            return "failure" if self.verdict == VERDICTS[False] else "success"
        return "cancelled" if self.outcome == "cancelled" else "failure"

    @property
    def is_good(self) -> bool:
        """Returns whether the run claims success and no referee denies it."""
        return self.look == "success"


class RunsTable:
    """Runs below a folder. A row is read again only when its file has changed."""

    def __init__(self, out: Path) -> None:
        self.out = out
        self._rows: dict[Path, tuple[int, list[RunRow]]] = {}

    def rows(self) -> list[RunRow]:
        """Returns all runs, the newest first; those of evaluations last."""
        kept: dict[Path, tuple[int, list[RunRow]]] = {}
        for file in (
            *self.out.glob(f"*/{FACTS}"),
            *self.out.glob("results.sqlite"),
            *self.out.glob("*/results.sqlite"),
        ):
            if file.parent.is_symlink():
                continue
            stamp, known = file.stat().st_mtime_ns, self._rows.get(file)
            kept[file] = known if known is not None and known[0] == stamp else (stamp, list(self._read(file)))
        self._rows = kept
        found = [row for _, rows in kept.values() for row in rows]
        return sorted(
            found, key=lambda row: (row.begun is not None, row.begun and row.begun.timestamp(), row.id), reverse=True
        )

    def folder(self, run: str) -> Path:
        """Returns the folder of a run. Raises InputError for a name that is none of a run below the folder."""
        found = self.out / run
        if "/" in run or run.startswith(".") or not (found / FACTS).is_file():
            raise InputError(f"there is no run '{run[:60]}'", hint="choose one on the board")
        return found

    def _read(self, file: Path) -> Iterator[RunRow]:
        try:
            if file.name == FACTS:
                yield _row_of(file.parent)
            else:
                with ResultsFile(file) as results:
                    about = str(file.parent.relative_to(self.out))
                    cases = results.results().cases
                for number, case in enumerate(cases):
                    yield _case_row(case, f"{about}#{number}", about if about != "." else "evaluation")
        except InputError as error:
            yield RunRow(file.parent.name, "?", "", 0, None, "damaged", "", 0.0, 0, "ERROR", str(error))


def _row_of(folder: Path) -> RunRow:
    kept = kept_run(folder)
    asked, report = kept.request, kept.report or {}
    referee = report.get("referee") or {}
    return RunRow(
        id=folder.name,
        mission=asked.name or (asked.file.stem if asked.file else str(asked.sentence or "")),
        world=str(report.get("world") or asked.world or ""),
        seed=asked.seed,
        begun=kept.begun,
        outcome=str(report.get("outcome") or _RUNNING),
        verdict="" if not report else VERDICTS[referee.get("success")],
        time_s=float(report.get("sim_time_s") or 0.0),
        contacts=int(referee.get("collisions") or 0) + int(referee.get("drops") or 0),
        cause=str(report.get("cause") or ""),
        message=str(report.get("message") or ""),
    )


def _case_row(case: Case, identity: str, source: str) -> RunRow:
    report = case.report
    return RunRow(
        id=identity,
        mission=case.asked,
        world=report.world,
        seed=case.run.request.seed,
        begun=None,
        outcome=report.outcome,
        verdict=VERDICTS[report.seen.success],
        time_s=report.sim_time_s,
        contacts=report.seen.collisions + report.seen.drops,
        cause=case.cause,
        message=case.why,
        source=source,
    )


def chosen(
    rows: Sequence[RunRow], *, text: str = "", mission: str = "", failures_first: bool = True, only: str = "all"
) -> list[RunRow]:
    """Filters rows by words, mission and look ("all", "failures", "successes"), and puts failures first."""
    words = text.lower().split()
    wanted = {"all": (True, False), "failures": (False,), "successes": (True,)}[only]
    found = [
        row
        for row in rows
        if row.is_good in wanted
        and (not mission or row.mission == mission)
        and all(
            word in f"{row.mission} {row.world} {row.seed} {row.cause} {row.message} {row.id}".lower() for word in words
        )
    ]
    return sorted(found, key=lambda row: row.is_good) if failures_first else found


def causes(rows: Sequence[RunRow]) -> Mapping[str, int]:
    """Counts the failures by cause, the most frequent first."""
    bad = [row.cause or row.verdict or row.outcome for row in rows if not row.is_good]
    return {cause: bad.count(cause) for cause in sorted(set(bad), key=bad.count, reverse=True)}


@dataclass(frozen=True)
class Visit:
    """One of two compared runs: its row, last tree, timeline, and the duration (s) of each step."""

    row: RunRow
    trees: tuple[NodeView, ...]
    entries: tuple[Entry, ...]
    steps_s: Mapping[str, float]
    pictures: tuple[str, ...]


def visit(table: RunsTable, run: str) -> Visit:
    """Reads a run to compare it. Raises InputError if it has no log."""
    folder = table.folder(run)
    history = read_history(folder)
    entries = tuple(timeline(history.events, leaves_only=True))
    trees = tuple(map(outline, history.trees()))
    pictures = tuple(sorted(file.name for file in folder.iterdir() if PICTURES.fullmatch(file.name)))
    return Visit(_row_of(folder), trees, entries, _durations(history.transitions(), trees), pictures)


def _durations(transitions: Iterator[Mapping[str, Any]], trees: Sequence[NodeView]) -> Mapping[str, float]:
    """Returns the time (s) from begin to end of each step's row, summed over its rounds."""
    names = {node.path_id: node.name for tree in trees for _, node in tree.walk() if node.kind == "step"}
    begun, spent = dict[str, float](), dict.fromkeys(names.values(), 0.0)
    for each in transitions:
        node, t_s = str(each["node"]), float(each["t"])
        if node not in names:
            continue
        if each["to"] == "RUNNING":
            begun.setdefault(node, t_s)
        else:
            spent[names[node]] += t_s - begun.pop(node, t_s)
    return spent


def first_difference(left: Sequence[Entry], right: Sequence[Entry]) -> int | None:
    """Returns the index of the first entry that differs in node, text without numbers, or state; None if none does."""
    for number, (one, other) in enumerate(zip_longest(left, right)):
        if _gist(one) != _gist(other):
            return number
    return None


def _gist(entry: Entry | None) -> tuple[str, str, str] | None:
    if entry is None:
        return None
    state = "" if entry.state is None else f"{entry.state.status.value} {entry.state.cause_text}"
    return entry.about, re.sub(r"\d+(\.\d+)?", "0", entry.text), state
