"""Named pipe beside the store that wakes the process that waits for work; any process may write to the pipe.

A wake-up says only that the store or the state of the waiting process has changed. Threads, signal handlers and other
processes write in the same way. A wake-up while no process waits ends the next wait; several wake-ups count as one.
"""

from __future__ import annotations

import os
import select
import stat
from contextlib import suppress
from datetime import datetime, timedelta
from pathlib import Path
from typing import Final

from executive.store.missions import MissionStore
from skills.inputs.errors import InputError

LONGEST_WAIT: Final = timedelta(minutes=1)
"""Longest wait (elapsed time); it is limited because the wall clock may change and the machine may sleep."""
_MOST_WAKES: Final = 4096


class WakeupPipe:
    """Waiting side of the pipe; use it as a context manager, or close it."""

    def __init__(self, store: MissionStore) -> None:
        """Opens the pipe beside a store. Raises InputError when the pipe cannot be created."""
        self._store, self._path = store, _path(store.path)
        with store.kind.failures(store.path):
            with suppress(FileExistsError):
                os.mkfifo(self._path, 0o600)
            self._pipe = os.open(self._path, os.O_RDWR | os.O_NONBLOCK)  # never without a writer, so never at an end
        if not _is_pipe(self._pipe):
            os.close(self._pipe)
            raise InputError("there is something else in the place of a pipe", hint="move it away", file=self._path)

    def __enter__(self) -> WakeupPipe:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Removes the pipe."""
        self._path.unlink(missing_ok=True)
        os.close(self._pipe)

    def wake(self) -> None:
        """Ends the present wait, or the next one; may be called from any thread and from signal handlers."""
        with suppress(BlockingIOError):
            os.write(self._pipe, b"!")

    def wait(self, until: datetime | None) -> None:
        """Blocks until a wake-up or until a moment (aware), but never for longer than LONGEST_WAIT."""
        left = LONGEST_WAIT if until is None else min(LONGEST_WAIT, until - self._store.now())
        select.select([self._pipe], [], [], max(0.0, left.total_seconds()))
        with suppress(BlockingIOError):
            os.read(self._pipe, _MOST_WAKES)


def wake_server(store: Path) -> None:
    """Wakes the process that waits at a store, if there is one."""
    try:
        pipe = os.open(_path(store), os.O_WRONLY | os.O_NONBLOCK)
    except OSError:
        return  # nobody waits
    try:
        if _is_pipe(pipe):
            os.write(pipe, b"!")
    except OSError:
        return  # it is full already, or was closed just now
    finally:
        os.close(pipe)


def _is_pipe(opened: int) -> bool:
    return stat.S_ISFIFO(os.fstat(opened).st_mode)


def _path(store: Path) -> Path:
    return store.with_name(f"{store.name}-wakeup")
