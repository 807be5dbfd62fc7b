"""Runs of an evaluation as plain data, their results, and the SQLite file of both."""

import enum
import hashlib
import json
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from html import escape
from pathlib import Path
from typing import Final

from executive.app.report.run_report import RunReport
from executive.mission.request import Request
from executive.store.database import Database, FileKind, form
from skills.inputs.errors import InputError

FALSE_CLAIM: Final = "FALSE CLAIM"
_ID_LETTERS: Final = 16
_OF_THE_MACHINE: Final = ("wall_time_s", "real_time_factor", "log")
_COUNTERS_OF_THE_MACHINE: Final = ("bytes_logged",)


@dataclass(frozen=True)
class RunSpec:
    """Specification of a run: request, name of the `mission`, and the varied values by dimension, such as "light".

    `files` maps the path of each file of the request to its text, used files included, so that any machine can run it.
    A run with a `folder` writes all its files there; a run without a `folder` writes files only if it fails.
    """

    request: Request
    mission: str
    varied: Mapping[str, str] = field(default_factory=dict)
    files: Mapping[str, str] = field(default_factory=dict)
    folder: str = ""

    @cached_property
    def id(self) -> str:
        """Hash of the run's content: equal for equal runs, wherever their files lie."""
        content = json.loads(replace(self.request, out=Path()).to_json())
        for name in {"file", "stack"} & content.keys():
            content[name] = self.files.get(content[name], content[name])
        content["scenario_files"] = [self.files.get(str(path), str(path)) for path in self.request.scenario_files]
        text = json.dumps({**content, "files": sorted(self.files.values())}, sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()[:_ID_LETTERS]

    @property
    def variation_words(self) -> str:
        """Varied values on one line."""
        return ", ".join(f"{name} {value}" for name, value in self.varied.items())


@dataclass(frozen=True)
class Evaluation:
    """Runs to evaluate; `name` is the evaluation file, or the options from which random missions were drawn."""

    name: str
    runs: Sequence[RunSpec]

    @cached_property
    def digest(self) -> str:
        """Hash that is equal for evaluations of the same runs."""
        return hashlib.sha256("".join(run.id for run in self.runs).encode()).hexdigest()[:_ID_LETTERS]


class Standing(enum.Enum):
    """Claim of a run compared with the referee's verdict, as a phrase and as a column; failures follow by gravity."""

    FULFILLED = "claimed and fulfilled", "fulfilled"
    FALSE_CLAIM = "claimed, not fulfilled: FALSE CLAIM", "false claims"
    NOT_JUDGED = "claimed, not judged", "not judged"
    FAILED = "failed and said so", "failed"
    FULFILLED_YET_FAILED = "failed, though fulfilled", "failed, yet fulfilled"
    REFUSED = "refused", "refused"
    BROKEN = "broken by an error", "broken"

    def __init__(self, words: str, column: str) -> None:
        self.words, self.column = words, column


_CLAIMED: Final = {True: Standing.FULFILLED, False: Standing.FALSE_CLAIM, None: Standing.NOT_JUDGED}
_NO_CLAIM: Final = {"refused": Standing.REFUSED, "error": Standing.BROKEN}


@dataclass(frozen=True)
class Evidence:
    """Evidence of a failure: timeline as (s, subject, text), pictures as JPEG with captions, and other files."""

    timeline: tuple[tuple[float, str, str], ...] = ()
    pictures: tuple[tuple[str, bytes], ...] = ()
    files: Mapping[str, bytes] = field(default_factory=dict)


@dataclass(frozen=True)
class Case:
    """Result of a run: its report, and evidence for the report page.

    `steps_s` is the run time of each skill on the robot's clock. `spent_s` is the wall time of the run, `worker` the
    machine and process that executed it.
    """

    run: RunSpec
    report: RunReport
    steps_s: Mapping[str, float] = field(default_factory=dict)
    evidence: Evidence = Evidence()
    spent_s: float = 0.0
    worker: str = ""

    @cached_property
    def standing(self) -> Standing:
        """Claim of the run compared with the referee's verdict."""
        if self.report.claimed:
            return _CLAIMED[self.report.seen.success]
        if self.report.outcome in _NO_CLAIM:
            return _NO_CLAIM[self.report.outcome]
        return Standing.FULFILLED_YET_FAILED if self.report.seen.holds else Standing.FAILED

    @property
    def cause(self) -> str:
        """Cause of a failure or false claim; empty for a success."""
        if self.report.achieved:
            return ""
        return FALSE_CLAIM if self.report.false_claim else self.report.cause or "ERROR"

    @property
    def failure_cause(self) -> str:
        """Cause that a failed run reports; empty for all others."""
        failed = self.standing in (Standing.FAILED, Standing.FULFILLED_YET_FAILED)
        return self.report.cause or "" if failed else ""

    @property
    def label(self) -> str:
        """Claim compared with the verdict, in words, with the cause of a failure."""
        return self.standing.words + (f" ({self.failure_cause})" if self.failure_cause else "")

    @property
    def why(self) -> str:
        """Sentence on why the run failed or why it was not judged."""
        return self.report.seen.why if self.report.claimed else self.report.message

    @property
    def asked(self) -> str:
        """Sentence of the request, else the name of the mission."""
        return self.run.request.sentence or self.run.mission

    @property
    def digest(self) -> str:
        """Hash of the result without wall times and paths: equal on every machine."""
        report = {name: value for name, value in self.report.to_json().items() if name not in _OF_THE_MACHINE}
        report["work"] = {name: count for name, count in report["work"].items() if name not in _COUNTERS_OF_THE_MACHINE}
        text = json.dumps([report, dict(self.steps_s)], sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()[:_ID_LETTERS]


class Cases(tuple[Case, ...]):
    """Results of an evaluation; a notebook displays them as a table."""

    def _repr_html_(self) -> str:
        cells = ((each.run.request.seed, each.asked, each.label, each.why) for each in self)
        rows = ("".join(f"<td>{escape(str(cell))}</td>" for cell in row) for row in cells)
        head = "".join(f"<th>{name}</th>" for name in ("seed", "mission", "claim against verdict", "why"))
        return f"<table><tr>{head}</tr>{''.join(f'<tr>{row}</tr>' for row in rows)}</table>"


RESULTS_FILE: Final = FileKind(
    name="results file",
    option="its path",
    application_id=0x45525256,  # "ERRV"
    version=2,
    absent="`errand evaluate FILE` writes one",
    lost="its results",
    older="read it with the version that wrote it",
    claimed="writes its results just now",
    go_on="the same command goes on where it stopped",
    schema="""
CREATE TABLE about (name TEXT PRIMARY KEY, value TEXT NOT NULL) WITHOUT ROWID;
CREATE TABLE run (number INTEGER PRIMARY KEY, id TEXT NOT NULL UNIQUE, spec TEXT NOT NULL);
CREATE TABLE file (path TEXT PRIMARY KEY, text TEXT NOT NULL) WITHOUT ROWID;
CREATE TABLE result (
    id TEXT PRIMARY KEY REFERENCES run (id),
    outcome TEXT NOT NULL,
    achieved INTEGER NOT NULL,
    digest TEXT NOT NULL,
    report TEXT NOT NULL,
    steps TEXT NOT NULL,
    spent_s REAL NOT NULL,
    worker TEXT NOT NULL,
    at TEXT NOT NULL DEFAULT (strftime('%Y-%m-%dT%H:%M:%fZ', 'now'))
);
CREATE TABLE timeline (id TEXT PRIMARY KEY REFERENCES result (id), entries BLOB NOT NULL) WITHOUT ROWID;
CREATE TABLE picture (
    id TEXT NOT NULL REFERENCES result (id), number INTEGER NOT NULL, caption TEXT NOT NULL, jpeg BLOB NOT NULL,
    PRIMARY KEY (id, number)
);
""",
)


@dataclass(frozen=True)
class Results:
    """Runs that have a result, with the facts stored about their evaluation."""

    cases: Sequence[Case]
    about: Mapping[str, str]

    def log_folder(self, case: Case) -> Path | None:
        """Returns the folder with the log of a run; None if this machine has none."""
        folder = Path(self.about["logs"]) / case.run.id if "logs" in self.about else None
        return folder if folder is not None and folder.is_dir() else None


class ResultsFile(Database):
    """SQLite file that stores the results of an evaluation."""

    kind = RESULTS_FILE

    def begin(self, evaluation: Evaluation, *, code: str) -> None:
        """Stores the runs of an evaluation and the code's version, or checks that the file holds the same.

        Raises InputError if it holds the results of other runs, or of another version of Errand.
        """
        about = self.about()
        if not about:
            with self.writing() as connection:
                facts = {"scenario": evaluation.name, "digest": evaluation.digest, "code": code}
                facts["runs"] = str(len(evaluation.runs))
                connection.executemany("INSERT INTO about VALUES (?, ?)", facts.items())
                files = {path: text for run in evaluation.runs for path, text in run.files.items()}
                connection.executemany("INSERT INTO file VALUES (?, ?)", files.items())
                rows = ((number, run.id, _spec_text(run)) for number, run in enumerate(evaluation.runs))
                connection.executemany("INSERT INTO run VALUES (?, ?, ?)", rows)
            return
        hint = f"name another file by --results, or remove {self.path.name}"
        if about["digest"] != evaluation.digest:
            what = f"it holds results of other runs ({about['scenario']}, or an earlier form of it)"
            raise InputError(what, hint=hint, file=self.path)
        if about["code"] != code:
            what = f"its results are of another version of Errand ({about['code']}; this is {code})"
            raise InputError(what, hint=hint, file=self.path)

    def about(self) -> Mapping[str, str]:
        """Returns facts by name: evaluation file, digest of the runs, version of the code; empty in a new file."""
        return {row["name"]: row["value"] for row in self.rows("SELECT name, value FROM about")}

    def note(self, **facts: str) -> None:
        """Stores facts about the evaluation by name."""
        with self.writing() as connection:
            connection.executemany("INSERT OR REPLACE INTO about VALUES (?, ?)", facts.items())

    def done_ids(self) -> frozenset[str]:
        """Returns the ids of the runs that have a result."""
        return frozenset(run_id for (run_id,) in self.rows("SELECT id FROM result"))

    def add(self, case: Case) -> bool:
        """Stores a result in one transaction; returns False and keeps the old result if the run has one.

        Raises InputError if it cannot be written.
        """
        run_id, evidence = case.run.id, case.evidence
        with self.writing() as connection:
            report, steps = json.dumps(case.report.to_json()), json.dumps(case.steps_s)
            row = (run_id, case.report.outcome, case.report.achieved, case.digest, report, steps)
            columns = "id, outcome, achieved, digest, report, steps, spent_s, worker"
            new = connection.execute(
                f"INSERT OR IGNORE INTO result ({columns}) VALUES (?, ?, ?, ?, ?, ?, ?, ?)",
                (*row, case.spent_s, case.worker),
            )
            if new.rowcount != 1:
                return False
            if evidence.timeline:
                packed = zlib.compress(json.dumps(evidence.timeline).encode())
                connection.execute("INSERT INTO timeline VALUES (?, ?)", (run_id, packed))
            pictures = ((run_id, number, *picture) for number, picture in enumerate(evidence.pictures))
            connection.executemany("INSERT INTO picture VALUES (?, ?, ?, ?)", pictures)
        return True

    def results(self) -> Results:
        """Returns the runs that have a result, in order, without evidence. Raises InputError if the file is damaged."""
        files = {row["path"]: row["text"] for row in self.rows("SELECT path, text FROM file")}
        query = "SELECT spec, report, steps, spent_s, worker FROM result JOIN run USING (id) ORDER BY number"
        cases = [
            Case(
                _spec(spec, files),
                RunReport.from_json(json.loads(report)),
                json.loads(steps),
                spent_s=spent_s,
                worker=worker,
            )
            for spec, report, steps, spent_s, worker in self.rows(query)
        ]
        return Results(cases, self.about())

    def evidence(self, run_id: str) -> Evidence:
        """Returns the timeline and the pictures of a run."""
        packed = self.rows("SELECT entries FROM timeline WHERE id = ?", run_id)
        entries = json.loads(zlib.decompress(packed[0][0])) if packed else []
        pictures = self.rows("SELECT caption, jpeg FROM picture WHERE id = ? ORDER BY number", run_id)
        return Evidence(tuple((float(t_s), about, text) for t_s, about, text in entries), tuple(map(tuple, pictures)))


def _spec_text(run: RunSpec) -> str:
    """Encodes a run as JSON, with the paths of its files but without their texts."""
    text: bytes = form(RunSpec).dump_json(replace(run, files=dict.fromkeys(run.files, "")), exclude_defaults=True)
    return text.decode()


def _spec(text: str, files: Mapping[str, str]) -> RunSpec:
    run: RunSpec = form(RunSpec).validate_json(text)
    return replace(run, files={path: files[path] for path in run.files})
