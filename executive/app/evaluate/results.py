"""The results file: one SQLite row for each run, written as it ends, so that a broken evaluation goes on."""

from __future__ import annotations

import json
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

from executive.app.evaluate.case import Case, Evaluation, Evidence, RunSpec
from executive.app.report import RunReport
from executive.store.database import Database, FileKind, form
from skills.files.errors import InputError

RESULTS_FILE: Final = FileKind(
    name="results file",
    option="--results",
    application_id=0x45525256,  # "ERRV"
    version=2,
    absent="`errand evaluate SCENARIO` writes one",
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
class Evaluated:
    """The runs that have a result, and what is known about all of them."""

    cases: Sequence[Case]
    about: Mapping[str, str]

    def log_folder(self, case: Case) -> Path | None:
        """The folder with the log of a run; None where there is none, or the evaluation ran on another machine."""
        folder = Path(self.about["logs"]) / case.run.id if "logs" in self.about else None
        return folder if folder is not None and folder.is_dir() else None


class ResultsFile(Database):
    """One results file."""

    kind = RESULTS_FILE

    def begin(self, evaluation: Evaluation, *, code: str) -> None:
        """Note all runs of an evaluation and the version that runs them, or check that they are those of the file.

        Raises InputError: it holds the results of other runs, or of another version of Errand.
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
        """The scenario, the digest of its runs, and the version of the code; empty where nothing was begun."""
        return {row["name"]: row["value"] for row in self.rows("SELECT name, value FROM about")}

    def note(self, **facts: str) -> None:
        """Keep facts about the evaluation by name."""
        with self.writing() as connection:
            connection.executemany("INSERT OR REPLACE INTO about VALUES (?, ?)", facts.items())

    def done(self) -> frozenset[str]:
        """The ids of the runs that have a result."""
        return frozenset(run_id for (run_id,) in self.rows("SELECT id FROM result"))

    def add(self, case: Case) -> bool:
        """Keep a result, whole or not at all; False where the run had one already, which stays.

        Raises InputError: it cannot be written.
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

    def evaluated(self) -> Evaluated:
        """The runs that have a result, in order, without evidence. Raises InputError: it is damaged."""
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
        return Evaluated(cases, self.about())

    def evidence(self, run_id: str) -> Evidence:
        """The timeline and the pictures of a run."""
        packed = self.rows("SELECT entries FROM timeline WHERE id = ?", run_id)
        entries = json.loads(zlib.decompress(packed[0][0])) if packed else []
        pictures = self.rows("SELECT caption, jpeg FROM picture WHERE id = ? ORDER BY number", run_id)
        return Evidence(tuple((float(t_s), about, text) for t_s, about, text in entries), tuple(map(tuple, pictures)))


def _spec_text(run: RunSpec) -> str:
    """A run as JSON, its files by path only."""
    text: bytes = form(RunSpec).dump_json(replace(run, files=dict.fromkeys(run.files, "")), exclude_defaults=True)
    return text.decode()


def _spec(text: str, files: Mapping[str, str]) -> RunSpec:
    run: RunSpec = form(RunSpec).validate_json(text)
    return replace(run, files={path: files[path] for path in run.files})
