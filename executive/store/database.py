"""Opens the store's SQLite file, and turns every failure to do so into one error with a hint."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final

from skills.files.errors import InputError, disk_is_full

VERSION: Final = 9
APPLICATION_ID: Final = 0x45525244  # "ERRD"
BUSY_S: Final = 2.0
_DAMAGED: Final = "move it away (its missions are lost), or name another by --store"
_SCHEMA: Final = """
CREATE TABLE mission (
    id INTEGER PRIMARY KEY AUTOINCREMENT,
    state TEXT NOT NULL,
    name TEXT NOT NULL,
    sentence TEXT,
    file TEXT,
    text TEXT,
    require_wake INTEGER NOT NULL,
    world TEXT,
    world_name TEXT NOT NULL,
    robot TEXT NOT NULL,
    seed INTEGER NOT NULL,
    out TEXT NOT NULL,
    record INTEGER NOT NULL,
    stack TEXT,
    map TEXT,
    given TEXT NOT NULL,
    start TEXT,
    commands TEXT NOT NULL,
    fingerprint TEXT NOT NULL,
    queued INTEGER NOT NULL,
    starts INTEGER NOT NULL DEFAULT 0,
    message TEXT NOT NULL DEFAULT '',
    clock_s REAL,
    pose TEXT
);
CREATE TABLE step (
    mission INTEGER NOT NULL REFERENCES mission (id) ON DELETE CASCADE,
    path_id TEXT NOT NULL,
    status TEXT NOT NULL,
    cause TEXT,
    message TEXT NOT NULL,
    checkpoint TEXT,
    clock_s REAL NOT NULL,
    PRIMARY KEY (mission, path_id)
);
CREATE TABLE value (
    mission INTEGER NOT NULL REFERENCES mission (id) ON DELETE CASCADE,
    key TEXT NOT NULL,
    text TEXT NOT NULL,
    PRIMARY KEY (mission, key)
);
"""
_TRIGGERS: Final = """
CREATE TABLE standing (
    mission INTEGER PRIMARY KEY REFERENCES mission (id) ON DELETE CASCADE,
    trigger TEXT NOT NULL,
    missed TEXT NOT NULL,
    anchor TEXT NOT NULL,
    since TEXT NOT NULL
);
CREATE TABLE origin (
    mission INTEGER PRIMARY KEY REFERENCES mission (id) ON DELETE CASCADE,
    standing INTEGER NOT NULL,
    why TEXT NOT NULL
);
CREATE TABLE battery (
    mission INTEGER PRIMARY KEY REFERENCES mission (id) ON DELETE CASCADE,
    lowest REAL NOT NULL,
    last REAL NOT NULL,
    ended TEXT
);
"""
_SCENARIOS_AND_TIMES: Final = """
ALTER TABLE mission ADD COLUMN scenario TEXT;
ALTER TABLE mission ADD COLUMN time_of_day TEXT;
ALTER TABLE mission ADD COLUMN time_limit_s REAL;
"""
_VARIATIONS: Final = """
ALTER TABLE mission ADD COLUMN variation TEXT;
"""
_FLEET: Final = """
CREATE TABLE given (
    mission INTEGER PRIMARY KEY REFERENCES mission (id) ON DELETE CASCADE,
    robot TEXT,
    reassigned INTEGER NOT NULL DEFAULT 0,
    done INTEGER NOT NULL DEFAULT 0,
    blocked TEXT,
    referee TEXT
);
"""
_CHAINS: Final = """
ALTER TABLE given ADD COLUMN part_of INTEGER;
ALTER TABLE given ADD COLUMN follows INTEGER;
"""
_ROBOTS: Final = """
ALTER TABLE mission ADD COLUMN robots TEXT;
CREATE TABLE part (
    mission INTEGER NOT NULL REFERENCES mission (id) ON DELETE CASCADE,
    robot TEXT NOT NULL,
    pose TEXT,
    instead TEXT,
    PRIMARY KEY (mission, robot)
);
"""
_OLDEST: Final = 4
_ADDED: Final = {5: _TRIGGERS + _SCENARIOS_AND_TIMES, 6: _VARIATIONS, 7: _FLEET, 8: _CHAINS, 9: _ROBOTS}
"""What each version has added to the one before; `_OLDEST` is `_SCHEMA`."""


def connect(path: Path, *, create: bool) -> sqlite3.Connection:
    """Open the store, made new where `create` allows it.

    A killed process loses nothing that was committed: the file is in write-ahead mode. Raises InputError: there is
    none, it cannot be opened, it is damaged, or another version wrote it.
    """
    if not create and not path.is_file():
        raise InputError("there is no store", hint="run or queue a mission first, or name one by --store", file=path)
    if path.is_file() and path.stat().st_size == 0:
        raise InputError("the store is damaged (it is empty)", hint=_DAMAGED, file=path)
    with told(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        connection = sqlite3.connect(path, timeout=BUSY_S, isolation_level=None)
        try:
            _prepare(connection, path)
        except BaseException:
            connection.close()
            raise
        return connection


def _prepare(connection: sqlite3.Connection, path: Path) -> None:
    """Set the modes, check whose file it is, and make the tables that it lacks."""
    (application,) = connection.execute("PRAGMA application_id").fetchone()
    (version,) = connection.execute("PRAGMA user_version").fetchone()
    (tables,) = connection.execute("SELECT count(*) FROM sqlite_master").fetchone()
    if tables and application != APPLICATION_ID:
        raise InputError("it is a database, but no store of missions", hint="name another file by --store", file=path)
    if tables and not _OLDEST <= version <= VERSION:
        hint = "finish its missions with the version that wrote it, or name another file by --store"
        raise InputError(f"the store has version {version}, and this errand reads {VERSION}", hint=hint, file=path)
    connection.execute("PRAGMA journal_mode = WAL")
    connection.execute("PRAGMA synchronous = NORMAL")
    connection.execute("PRAGMA foreign_keys = ON")
    if version != VERSION:
        with transaction(connection):
            _migrate(connection)


def _migrate(connection: sqlite3.Connection) -> None:
    """Make the tables that are not there yet; another process may just have done so."""
    (version,) = connection.execute("PRAGMA user_version").fetchone()
    added = [_ADDED[number] for number in range(max(version, _OLDEST) + 1, VERSION + 1)]
    for statement in filter(str.strip, ";".join([*([] if version else [_SCHEMA]), *added]).split(";")):
        connection.execute(statement)
    connection.execute(f"PRAGMA application_id = {APPLICATION_ID}")
    connection.execute(f"PRAGMA user_version = {VERSION}")


class StoreError(InputError):
    """The store cannot be read or written, whichever mission it is about."""


@contextmanager
def transaction(connection: sqlite3.Connection) -> Iterator[None]:
    """All or nothing."""
    connection.execute("BEGIN IMMEDIATE")
    try:
        yield
    except BaseException:
        if connection.in_transaction:  # a full disk has rolled it back
            connection.execute("ROLLBACK")
        raise
    connection.execute("COMMIT")


@contextmanager
def told(path: Path) -> Iterator[None]:
    """Failures of the database become a StoreError."""
    try:
        yield
    except sqlite3.OperationalError as error:
        if "full" in str(error):
            raise full_disk(path) from error
        hint = "end the program that keeps it open, then try again" if _busy(error) else "name another by --store"
        what = "another program has locked the store" if _busy(error) else f"cannot use the store ({error})"
        raise StoreError(what, hint=hint, file=path) from error
    except sqlite3.DatabaseError as error:
        raise StoreError(f"the store is damaged ({error})", hint=_DAMAGED, file=path) from error
    except OSError as error:
        if disk_is_full(error):
            raise full_disk(path) from error
        raise StoreError(
            f"cannot use the store ({error.strerror})", hint="name another by --store", file=path
        ) from error


def full_disk(store: Path) -> StoreError:
    """The way on when the disk has become full under a mission of a store."""
    hint = f"what was written is kept: free space, then go on with `errand resume --store {store}`"
    return StoreError("the disk is full", hint=hint)


def _busy(error: sqlite3.OperationalError) -> bool:
    return "locked" in str(error) or "busy" in str(error)
