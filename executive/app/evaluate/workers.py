"""Gives out the work of an evaluation: one function for many items, to processes that may die."""

from __future__ import annotations

import hashlib
import multiprocessing
import os
import signal
import threading
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any, Final, Generic, Protocol, TypeVar

__all__ = ["MOST_DEATHS", "Finished", "LocalWorkers", "Workers", "installed_code"]

MOST_DEATHS: Final = 3
"""Work with which so many workers have died is given up."""
_ROOT: Final = Path(__file__).resolve().parents[3]
_PACKAGES: Final = ("executive", "skills", "plant", "missions")
_LIBRARIES: Final = ("drake", "numpy", "numba", "onnxruntime", "ompl", "opencv-python-headless", "scipy")
_LETTERS: Final = 12
Item = TypeVar("Item")
Result = TypeVar("Result")


@dataclass(frozen=True)
class Finished(Generic[Item, Result]):
    """An item and its result; `result` is None where each worker that took it has died, as `lost` says."""

    item: Item
    result: Result | None
    lost: str = ""


class Workers(Protocol):
    """Workers that apply a function to items."""

    @property
    def count(self) -> int:
        """The number of workers."""

    def give_out(self, function: Callable[[Item], Result], items: Sequence[Item]) -> Iterator[Finished[Item, Result]]:
        """Have each item worked on once, and give each as it ends. What the function raises is raised here."""


class LocalWorkers:
    """Processes on this machine, which keep what they have imported and loaded from item to item.

    One that dies is replaced, and its item is begun again by another.
    """

    def __init__(self, count: int) -> None:
        self._count = count

    @property
    def count(self) -> int:
        """The number of processes."""
        return self._count

    def give_out(self, function: Callable[[Item], Result], items: Sequence[Item]) -> Iterator[Finished[Item, Result]]:
        """As `Workers` says; closing the iterator ends the processes."""
        waiting = deque((item, 0) for item in items)
        idle = [_Process() for _ in range(min(self._count, len(items)))]
        running: dict[Future[Any], tuple[_Process, Item, int]] = {}
        try:
            while waiting or running:
                while idle and waiting:
                    (item, deaths), process = waiting.popleft(), idle.pop()
                    running[process.submit(function, item)] = process, item, deaths
                for future in wait(running, return_when=FIRST_COMPLETED).done:
                    process, item, deaths = running.pop(future)
                    try:
                        result = future.result()
                    except BrokenProcessPool:
                        idle.append(process.replaced())
                        if deaths + 1 < MOST_DEATHS:
                            waiting.append((item, deaths + 1))
                        else:
                            yield Finished(item, None, f"{MOST_DEATHS} worker processes have died with it")
                    else:
                        idle.append(process)
                        yield Finished(item, result)
        finally:
            for process in (*idle, *(process for process, *_ in running.values())):
                process.end()


class _Process:
    """One worker process, begun with its first item."""

    def __init__(self) -> None:
        self._pool = ProcessPoolExecutor(1, multiprocessing.get_context("spawn"), initializer=_begin)

    def submit(self, function: Callable[[Item], Result], item: Item) -> Future[Result]:
        return self._pool.submit(function, item)

    def replaced(self) -> _Process:
        self._pool.shutdown(wait=False)
        return _Process()

    def end(self) -> None:
        """End it at once, whatever it does."""
        for process in list((self._pool._processes or {}).values()):
            process.kill()
        self._pool.shutdown(wait=True, cancel_futures=True)


def _begin() -> None:
    """A worker does not hear Ctrl-C at the terminal, and ends with the process that started it."""
    os.setpgrp()
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    _end_with_starter()


def _end_with_starter() -> None:
    """Let this process end when the one that started it is gone: one that is killed cannot end its own."""
    starter = multiprocessing.parent_process()
    if starter is None:
        return

    def outlive() -> None:
        starter.join()
        os._exit(1)

    threading.Thread(target=outlive, name="end-with-starter", daemon=True).start()


@cache
def installed_code() -> str:
    """The version, and a hash of all files of the code, the models and the worlds, and of the libraries' versions."""
    made = hashlib.sha256()
    for package in _PACKAGES:
        for path in sorted((_ROOT / package).rglob("*")):
            if path.is_file() and "__pycache__" not in path.parts and path.suffix != ".pyc":
                made.update(path.relative_to(_ROOT).as_posix().encode() + b"\0" + path.read_bytes())
    for library in _LIBRARIES:
        made.update(f"{library} {_version(library)}\n".encode())
    return f"{_version('spot-errand')}+{made.hexdigest()[:_LETTERS]}"


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "not installed"
