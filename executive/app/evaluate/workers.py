"""How work is given out: one function for many items, to processes that may die and are replaced."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from typing import Any, Final, Generic, Protocol, TypeVar

__all__ = ["MOST_DEATHS", "Finished", "LocalWorkers", "Workers"]

MOST_DEATHS: Final = 3
"""Work with which so many workers have died is given up."""
Item = TypeVar("Item")
Result = TypeVar("Result")


@dataclass(frozen=True)
class Finished(Generic[Item, Result]):
    """An item and its result; `result` is None where each worker that took it has died, as `lost` says."""

    item: Item
    result: Result | None
    lost: str = ""


class Workers(Protocol):
    """Those who do the work."""

    @property
    def count(self) -> int:
        """How many there are."""

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
        """How many processes."""
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
