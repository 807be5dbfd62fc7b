"""The results file: one SQLite row for each run, written as it ends, so that a broken evaluation goes on."""

from __future__ import annotations

import fcntl
import json
import os
import sqlite3
import zlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from types import TracebackType
from typing import Any, Final, TextIO

from executive.app.evaluate.outcome import Evidence, RunOutcome
from executive.app.evaluate.runs import Evaluation, RunSpec
from executive.words.variation import Variation
from skills.files.errors import InputError, disk_is_full

__all__ = ["ResultsFile"]

APPLICATION_ID: Final = 0x45525256  # "ERRV"
VERSION: Final = 1
BUSY_S: Final = 5.0
_SCHEMA: Final = """
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
"""


class ResultsFile:
    """One results file. Use it as a context manager, or close it."""

    def __init__(self, path: Path, *, create: bool = False) -> None:
        """Open it. Raises InputError: there is none, it is locked or damaged, or it is no results file."""
        self.path = path
        if not create and not path.is_file():
            raise InputError("there is no results file", hint="`errand evaluate SCENARIO` writes one", file=path)
        with self._told():
            path.parent.mkdir(parents=True, exist_ok=True)
            self._connection = sqlite3.connect(path, timeout=BUSY_S, isolation_level=None)
            try:
                self._prepare()
            except BaseException:
                self._connection.close()
                raise

    def __enter__(self) -> ResultsFile:
        return self

    def __exit__(self, *_: type[BaseException] | BaseException | TracebackType | None) -> None:
        self.close()

    def close(self) -> None:
        """Close it; idempotent."""
        self._connection.close()

    @contextmanager
    def claimed(self) -> Iterator[None]:
        """Only one process at a time writes results; the claim ends with the process, however that ends.

        Raises InputError: another process writes.
        """
        with self._told():
            file = self.path.with_name(f"{self.path.name}-claim").open("a+")
        with file:
            self._claim(file)
            yield

    def _claim(self, file: TextIO) -> None:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            file.seek(0)
            what = f"process {file.read() or '?'} writes its results just now"
            raise InputError(
                what, hint="wait until it is done, or name another by --results", file=self.path
            ) from error
        file.truncate(0)
        file.write(str(os.getpid()))
        file.flush()

    def begin(self, evaluation: Evaluation, *, code: str) -> None:
        """Note all runs of an evaluation and the version that runs them, or check that they are those of the file.

        Raises InputError: it holds the results of other runs, or of another version of Errand.
        """
        about = self.about()
        if not about:
            with self._writing() as connection:
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
        return dict(self._rows("SELECT name, value FROM about"))

    def note(self, **facts: str) -> None:
        """Keep facts about the evaluation by name."""
        with self._writing() as connection:
            connection.executemany("INSERT OR REPLACE INTO about VALUES (?, ?)", facts.items())

    def done(self) -> frozenset[str]:
        """The ids of the runs that have a result."""
        return frozenset(run_id for (run_id,) in self._rows("SELECT id FROM result"))

    def add(self, outcome: RunOutcome) -> bool:
        """Keep a result, whole or not at all; False where the run had one already, which stays.

        Raises InputError: it cannot be written.
        """
        run_id, evidence = outcome.run_id, outcome.evidence
        with self._writing() as connection:
            row = (
                run_id,
                outcome.report["outcome"],
                outcome.achieved,
                outcome.digest,
                json.dumps(outcome.report),
                json.dumps(outcome.steps_s),
                outcome.spent_s,
                outcome.worker,
            )
            columns = "id, outcome, achieved, digest, report, steps, spent_s, worker"
            new = connection.execute(f"INSERT OR IGNORE INTO result ({columns}) VALUES (?, ?, ?, ?, ?, ?, ?, ?)", row)
            if new.rowcount != 1:
                return False
            if evidence.timeline:
                packed = zlib.compress(json.dumps(evidence.timeline).encode())
                connection.execute("INSERT INTO timeline VALUES (?, ?)", (run_id, packed))
            pictures = ((run_id, number, *picture) for number, picture in enumerate(evidence.pictures))
            connection.executemany("INSERT INTO picture VALUES (?, ?, ?, ?)", pictures)
        return True

    def runs(self) -> Sequence[RunSpec]:
        """All runs, in order. Raises InputError: it is damaged."""
        files = dict(self._rows("SELECT path, text FROM file"))
        return [_spec(text, files) for (text,) in self._rows("SELECT spec FROM run ORDER BY number")]

    def outcomes(self) -> Sequence[tuple[int, RunOutcome]]:
        """The number of each run that has a result, and the result, in the order of the runs, without evidence."""
        query = (
            "SELECT run.number, result.id, report, steps, spent_s, worker FROM result JOIN run USING (id) "
            "ORDER BY number"
        )
        return [
            (number, RunOutcome(run_id, json.loads(report), json.loads(steps), Evidence(), spent_s, worker))
            for number, run_id, report, steps, spent_s, worker in self._rows(query)
        ]

    def evidence(self, run_id: str) -> Evidence:
        """The timeline and the pictures of a run."""
        packed = self._rows("SELECT entries FROM timeline WHERE id = ?", run_id)
        entries = json.loads(zlib.decompress(packed[0][0])) if packed else []
        pictures = self._rows("SELECT caption, jpeg FROM picture WHERE id = ? ORDER BY number", run_id)
        return Evidence(tuple((float(t_s), about, text) for t_s, about, text in entries), tuple(pictures))

    def digests(self) -> Mapping[str, str]:
        """For each run with a result, what is equal where results are."""
        return dict(self._rows("SELECT id, digest FROM result"))

    def _prepare(self) -> None:
        (application,) = self._connection.execute("PRAGMA application_id").fetchone()
        (version,) = self._connection.execute("PRAGMA user_version").fetchone()
        (tables,) = self._connection.execute("SELECT count(*) FROM sqlite_master").fetchone()
        if tables and application != APPLICATION_ID:
            raise InputError("it is a database, but holds no results", hint="name another file", file=self.path)
        if tables and version != VERSION:
            what = f"the results have version {version}, and this errand reads {VERSION}"
            raise InputError(what, hint="read them with the version that wrote them", file=self.path)
        self._connection.execute("PRAGMA journal_mode = WAL")
        self._connection.execute("PRAGMA synchronous = NORMAL")
        if not tables:
            with self._writing() as connection:
                for statement in filter(str.strip, _SCHEMA.split(";")):
                    connection.execute(statement)
                connection.execute(f"PRAGMA application_id = {APPLICATION_ID}")
                connection.execute(f"PRAGMA user_version = {VERSION}")

    @contextmanager
    def _writing(self) -> Iterator[sqlite3.Connection]:
        """A transaction: all or nothing."""
        with self._told():
            self._connection.execute("BEGIN IMMEDIATE")
            try:
                yield self._connection
            except BaseException:
                if self._connection.in_transaction:
                    self._connection.execute("ROLLBACK")
                raise
            self._connection.execute("COMMIT")

    def _rows(self, query: str, *values: object) -> list[Any]:
        with self._told():
            return self._connection.execute(query, values).fetchall()

    @contextmanager
    def _told(self) -> Iterator[None]:
        """Failures of the database become an InputError."""
        try:
            yield
        except sqlite3.OperationalError as error:
            if "full" in str(error):
                raise self._full() from error
            raise InputError(f"cannot use it ({error})", hint="name another file", file=self.path) from error
        except sqlite3.DatabaseError as error:
            raise InputError(f"it is no results file ({error})", hint="name another file", file=self.path) from error
        except OSError as error:
            if disk_is_full(error):
                raise self._full() from error
            raise InputError(f"cannot use it ({error.strerror})", hint="name another file", file=self.path) from error

    def _full(self) -> InputError:
        return InputError("the disk is full", hint="free space; the same command goes on where it stopped")


def _spec_text(run: RunSpec) -> str:
    """A run as JSON, its files by path only."""
    return json.dumps({**asdict(run), "files": list(run.files)})


def _spec(text: str, files: Mapping[str, str]) -> RunSpec:
    values = json.loads(text)
    lists = {name: tuple(values[name]) for name in ("answers", "faults")}
    own: Iterable[str] = values["files"]
    variation = Variation(**values["variation"])
    return RunSpec(**{**values, **lists, "variation": variation, "files": {path: files[path] for path in own}})
