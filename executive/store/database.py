"""Opens SQLite files of Errand; each failure to use a file becomes one error with a hint."""

from __future__ import annotations

import fcntl
import os
import sqlite3
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import cache
from hashlib import blake2b
from itertools import product
from pathlib import Path
from types import TracebackType
from typing import Any, Final, Self

from pydantic import TypeAdapter

from skills.inputs.errors import InputError, shortage, shortage_of_files

BUSY_S: Final = 2.0


@dataclass(frozen=True)
class FileKind:
    """Kind of a database file: its tables, its identity among databases, and the texts of its errors.

    `name` is the kind's name in messages, `option` the option to name another file. The other fields are parts of
    messages: `absent` names the command that writes the file, `lost` the data in it, `older` the action for a file of
    another version, `claimed` the work of the process that has claimed it. `go_on` says how to continue after a lack of
    disk, files or memory; "{path}" in it stands for the file. Each row of the tables `summed` has a checksum in its
    column `sum`; the first column has the number of the row's mission.
    """

    name: str
    option: str
    application_id: int
    version: int
    schema: str
    absent: str
    lost: str
    older: str
    claimed: str
    go_on: str
    summed: tuple[str, ...] = ()

    def shortage_error(self, path: Path, lack: str) -> StoreError:
        """Returns the error for what this machine lacks, as in "the disk is full"."""
        go_on = self.go_on.format(path=path)
        return StoreError(lack, hint=f"what was written is kept: make room, then {go_on}")

    def damage_error(self, path: Path, why: object) -> StoreError:
        """Returns the error for a file that cannot be read."""
        hint = f"move it away ({self.lost} are lost), or name another by {self.option}"
        return StoreError(f"the {self.name} is damaged ({why})", hint=hint, file=path)

    @contextmanager
    def failures(self, path: Path) -> Iterator[None]:
        """Turns errors of the database or of the disk into StoreError."""
        what, hint = f"cannot use the {self.name}", f"name another by {self.option}"
        try:
            yield
        except sqlite3.OperationalError as error:
            code = getattr(error, "sqlite_errorcode", 0) & 0xFF
            if lack := shortage(error) or (shortage_of_files(1) if code == sqlite3.SQLITE_CANTOPEN else None):
                raise self.shortage_error(path, lack) from error
            if code in (sqlite3.SQLITE_BUSY, sqlite3.SQLITE_LOCKED):
                hint = "end the program that keeps it open, then try again"
                raise StoreError(f"another program has locked the {self.name}", hint=hint, file=path) from error
            raise StoreError(f"{what} ({error})", hint=hint, file=path) from error
        except sqlite3.DatabaseError as error:
            raise self.damage_error(path, error) from error
        except OSError as error:
            if lack := shortage(error):
                raise self.shortage_error(path, lack) from error
            raise StoreError(f"{what} ({error.strerror})", hint=hint, file=path) from error


class StoreError(InputError):
    """Raised for a file that cannot be read or written at all."""


class Database:
    """Open database file; use it as a context manager, or close it."""

    kind: FileKind

    def __init__(self, path: Path, *, create: bool = False) -> None:
        """Opens the file; with `create`, creates a missing file.

        A killed process loses no committed data: the file is in write-ahead mode. Raises InputError when the file is
        missing, cannot be opened, is damaged, or was written by another version.
        """
        self.path = path
        if not create and not path.is_file():
            raise InputError(f"there is no {self.kind.name}", hint=self.kind.absent, file=path)
        if path.is_file() and path.stat().st_size == 0:
            raise self.kind.damage_error(path, "it is empty")
        with self.kind.failures(self.path):
            path.parent.mkdir(parents=True, exist_ok=True)
            self._connection = sqlite3.connect(path, timeout=BUSY_S, isolation_level=None)
            try:
                self._prepare()
            except BaseException:
                self._connection.close()
                raise

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: type[BaseException] | BaseException | TracebackType | None) -> None:
        self.close()

    def close(self) -> None:
        """Closes the file; idempotent."""
        self._connection.close()

    @contextmanager
    def claim(self) -> Iterator[None]:
        """Claims the file for this process; the claim ends with the context, or with the process.

        Raises InputError when another process has claimed it.
        """
        with ExitStack() as stack:
            with self.kind.failures(self.path):
                file = stack.enter_context(self.path.with_name(f"{self.path.name}-claim").open("a+"))
                try:
                    fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
                except BlockingIOError as error:
                    file.seek(0)
                    what = f"process {file.read() or '?'} {self.kind.claimed}"
                    hint = f"wait until it is done, or name another by {self.kind.option}"
                    raise InputError(what, hint=hint, file=self.path) from error
                file.truncate(0)
                file.write(str(os.getpid()))
                file.flush()
            yield

    @contextmanager
    def writing(self) -> Iterator[sqlite3.Connection]:
        """Opens one transaction for changes. Raises StoreError when the file cannot be written."""
        with self.kind.failures(self.path), transaction(self._connection):
            yield self._connection

    def rows(self, query: str, *values: object) -> list[sqlite3.Row]:
        """Returns the rows of a query. Raises StoreError when the file cannot be read."""
        with self.kind.failures(self.path):
            cursor = self._connection.cursor()
            cursor.row_factory = sqlite3.Row
            return cursor.execute(query, values).fetchall()

    def _prepare(self) -> None:
        """Sets the modes, checks the file's kind and version, and creates the tables in a new file."""
        kind, connection = self.kind, self._connection
        (application,) = connection.execute("PRAGMA application_id").fetchone()
        (version,) = connection.execute("PRAGMA user_version").fetchone()
        (tables,) = connection.execute("SELECT count(*) FROM sqlite_master").fetchone()
        if tables and application != kind.application_id:
            what, hint = f"it is a database, but no {kind.name}", f"name another file by {kind.option}"
            raise InputError(what, hint=hint, file=self.path)
        if tables and version != kind.version:
            what = f"the {kind.name} has version {version}, and this errand reads {kind.version}"
            raise InputError(what, hint=f"{kind.older}, or name another file by {kind.option}", file=self.path)
        connection.execute("PRAGMA journal_mode = WAL")
        connection.execute("PRAGMA synchronous = NORMAL")
        connection.execute("PRAGMA foreign_keys = ON")
        connection.create_function("checksum", -1, _checksum, deterministic=True)
        if not tables:
            with transaction(connection):
                for statement in filter(str.strip, kind.schema.split(";")):
                    connection.execute(statement)
                for table, event in product(kind.summed, ("INSERT", "UPDATE")):
                    put = f"UPDATE {table} SET sum = {self._checksum_of(table)} WHERE rowid = NEW.rowid"
                    connection.execute(f"CREATE TRIGGER {table}_{event} AFTER {event} ON {table} BEGIN {put}; END")
                connection.execute(f"PRAGMA application_id = {kind.application_id}")
                connection.execute(f"PRAGMA user_version = {kind.version}")
        for table in kind.summed:
            changed = connection.execute(
                f"SELECT * FROM {table} WHERE sum IS NOT {self._checksum_of(table)}"
            ).fetchone()
            if changed is not None:
                raise kind.damage_error(self.path, f"in its table {table}, mission {changed[0]} has changed by itself")

    def _checksum_of(self, table: str) -> str:
        """Returns the SQL expression for the checksum of a row."""
        columns = [row[1] for row in self._connection.execute(f"PRAGMA table_info({table})")]
        return f"checksum({', '.join(name for name in columns if name != 'sum')})"


def _checksum(*values: object) -> str:
    return blake2b(repr(values).encode(errors="surrogateescape"), digest_size=8).hexdigest()


@cache
def form(kind: Any) -> TypeAdapter[Any]:
    """Returns the adapter that writes and reads values of a type, such as a request, as JSON."""
    return TypeAdapter(kind)


@contextmanager
def transaction(connection: sqlite3.Connection) -> Iterator[None]:
    """Runs the statements within as one transaction."""
    connection.execute("BEGIN IMMEDIATE")
    try:
        yield
    except BaseException:
        if connection.in_transaction:  # a full disk has rolled it back
            connection.execute("ROLLBACK")
        raise
    connection.execute("COMMIT")


STORE_FILE: Final = FileKind(
    name="store",
    option="--store",
    application_id=0x45525244,  # "ERRD"
    version=11,
    summed=("mission", "step", "value"),
    absent="run or queue a mission first, or name one by --store",
    lost="its missions",
    older="finish its missions with the version that wrote it",
    claimed="runs a mission of this store",
    go_on="go on with `errand resume --store {path}`",
    schema="""
CREATE TABLE IF NOT EXISTS mission (
    id INTEGER PRIMARY KEY AUTOINCREMENT,
    state TEXT NOT NULL,
    request TEXT NOT NULL,
    queued INTEGER NOT NULL,
    starts INTEGER NOT NULL DEFAULT 0,
    message TEXT NOT NULL DEFAULT '',
    clock_s REAL,
    poses TEXT NOT NULL DEFAULT '{}',
    instead TEXT NOT NULL DEFAULT '{}',
    lowest_charge REAL,
    last_charge REAL,
    ended TEXT,
    trigger TEXT,
    missed TEXT,
    anchor TEXT,
    since TEXT,
    standing INTEGER,
    why TEXT NOT NULL DEFAULT '',
    given TEXT,
    sum TEXT
);
CREATE TABLE IF NOT EXISTS step (
    mission INTEGER NOT NULL REFERENCES mission (id) ON DELETE CASCADE,
    path_id TEXT NOT NULL,
    record TEXT NOT NULL,
    sum TEXT,
    PRIMARY KEY (mission, path_id)
);
CREATE TABLE IF NOT EXISTS value (
    mission INTEGER NOT NULL REFERENCES mission (id) ON DELETE CASCADE,
    key TEXT NOT NULL,
    text TEXT NOT NULL,
    sum TEXT,
    PRIMARY KEY (mission, key)
);
""",
)
