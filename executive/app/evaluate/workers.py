"""Workers that apply one function to many items, in processes of this machine or on a Dask cluster.

If a worker dies, another one takes its item. A Dask cluster needs the extra `cluster`.
"""

from __future__ import annotations

import hashlib
import logging
import multiprocessing
import os
import signal
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import Any, Final, Generic, TypeVar

from executive.record.announce import versions
from skills.inputs.errors import InputError

MOST_DEATHS: Final = 3
"""Number of dead workers after which an item is given up."""
_ROOT: Final = Path(__file__).resolve().parents[3]
_PACKAGES: Final = ("executive", "skills", "plant", "missions")
_LIBRARIES: Final = ("drake", "numpy", "numba", "onnxruntime", "ompl", "opencv-python-headless", "scipy")
_LETTERS: Final = 12
ANSWER_S: Final = 10.0
"""Longest wait for a scheduler, and for its first worker, in s."""
GONE_S: Final = 120.0
"""Longest wait for a result without a connected worker, in s; a nanny or a person may start one."""
_LOOK_S: Final = 5.0
_GO_ON: Final = "finished runs are stored; the same command continues"
_START_ONE: Final = f"start workers again; {_GO_ON}"
Item = TypeVar("Item")
Result = TypeVar("Result")


@dataclass(frozen=True)
class WorkResult(Generic[Item, Result]):
    """Item with its result; if every worker that tried the item died, `result` is None and `lost` is the reason."""

    item: Item
    result: Result | None
    lost: str = ""


@dataclass(frozen=True)
class LocalWorkers:
    """Processes on this machine, each of which keeps its imports and loaded models from item to item.

    A process that dies is replaced, and its item begins again in another.
    """

    count: int

    def map_items(
        self, function: Callable[[Item], Result], items: Sequence[Item]
    ) -> Iterator[WorkResult[Item, Result]]:
        """Applies the function to each item and yields each result as it ends; errors of the function pass through.

        Closing the iterator ends the processes.
        """
        waiting = deque((item, 0) for item in items)
        idle = [_Process() for _ in range(min(self.count, len(items)))]
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
                            yield WorkResult(item, None, f"{MOST_DEATHS} worker processes have died with it")
                    else:
                        idle.append(process)
                        yield WorkResult(item, result)
        finally:
            for process in (*idle, *(process for process, *_ in running.values())):
                process.end()


class _Process:
    """Worker process, which starts when it gets its first item."""

    def __init__(self) -> None:
        self._pool = ProcessPoolExecutor(1, multiprocessing.get_context("spawn"), initializer=_begin)

    def submit(self, function: Callable[[Item], Result], item: Item) -> Future[Result]:
        return self._pool.submit(function, item)

    def replaced(self) -> _Process:
        self._pool.shutdown(wait=False)
        return _Process()

    def end(self) -> None:
        """Kills the process."""
        for process in list((self._pool._processes or {}).values()):
            process.kill()
        self._pool.shutdown(wait=True, cancel_futures=True)


def _begin() -> None:
    """Prepares a worker process: it ignores Ctrl-C, and ends when the process that started it ends."""
    os.setpgrp()
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    starter = multiprocessing.parent_process()
    if starter is None:
        return

    def outlive() -> None:
        starter.join()
        os._exit(1)

    threading.Thread(target=outlive, name="end-with-starter", daemon=True).start()


class _OtherVersionError(Exception):
    """Raised by a worker whose version of Errand differs from the version of the evaluating process."""


class ClusterWorkers:
    """Workers of a connected Dask client."""

    def __init__(self, client: Any) -> None:
        """Raises InputError if there is no worker, or a worker has another version or several threads."""
        self._client = client
        self._check()

    @property
    def count(self) -> int:
        """Number of connected workers."""
        return len(self._client.scheduler_info(n_workers=-1)["workers"])

    def map_items(
        self, function: Callable[[Item], Result], items: Sequence[Item]
    ) -> Iterator[WorkResult[Item, Result]]:
        """Applies the function to each item, as `LocalWorkers.map_items` does.

        Raises:
            InputError: the scheduler or all workers are gone, or a worker of another version has joined.
        """
        from distributed.scheduler import KilledWorker

        work = partial(_checked, installed_code(), function)
        futures = self._client.map(work, items, pure=False, retries=0)
        item_of = {future.key: item for future, item in zip(futures, items, strict=True)}
        ended: SimpleQueue[Any] = SimpleQueue()
        for each in futures:
            each.add_done_callback(ended.put)
        try:
            with _errors_as_input():
                for _ in futures:
                    future = self._patiently(ended.get)
                    item = item_of[future.key]
                    if future.status == "cancelled":
                        raise InputError("the scheduler has stopped answering", hint=_GO_ON)
                    if future.status == "error":
                        error = future.exception()
                        if not isinstance(error, KilledWorker):
                            raise error
                        yield WorkResult(item, None, f"{MOST_DEATHS} worker processes have died with it")
                    else:
                        yield WorkResult(item, self._patiently(future.result))
                    future.release()
        finally:
            if self._client.status == "running":
                self._client.cancel(futures, force=True)

    def _patiently(self, get: Callable[..., Any]) -> Any:
        """Repeats `get` until it returns. Raises InputError when no worker has been connected for `GONE_S`.

        If the last worker that holds a result disappears, another worker computes the result again.
        """
        seen_s = time.monotonic()
        while True:
            try:
                return get(timeout=min(_LOOK_S, GONE_S))
            except (Empty, TimeoutError) as error:
                if self.count:
                    seen_s = time.monotonic()
                elif time.monotonic() - seen_s >= GONE_S:
                    raise InputError(f"no worker has been connected for {GONE_S:g} s", hint=_START_ONE) from error

    def _check(self) -> None:
        """Raises InputError without workers, or for a worker that has another version or several threads."""
        with _errors_as_input():
            try:
                self._client.wait_for_workers(1, timeout=ANSWER_S)
            except TimeoutError as error:
                address = self._client.scheduler.address
                hint = f"start one: dask worker {address} --nthreads 1"
                raise InputError(f"the scheduler at {address} has no workers", hint=hint) from error
            found = self._client.scheduler_info(n_workers=-1)["workers"]
            for address, facts in found.items():
                if facts["nthreads"] != 1:
                    what = f"the worker at {address} has {facts['nthreads']} threads, and a mission needs a process"
                    raise InputError(what, hint="start it with --nthreads 1, and several processes by --nworkers")
            codes = self._client.run(_code_here, on_error="return")
        for address, code in codes.items():
            _refuse_other(address, code)


def _refuse_other(address: str, code: Any) -> None:
    """Raises InputError if a worker has no Errand, or another version."""
    own = installed_code()
    if isinstance(code, ModuleNotFoundError):
        raise InputError(f"the worker at {address} has no Errand ({code})", hint=f"install {own} there")
    if code != own:
        what = f"the worker at {address} has another version of Errand ({code}; here it is {own})"
        raise InputError(what, hint="install the same version and start the worker again")


def _code_here() -> str:
    return installed_code()


def _checked(expected: str, function: Callable[[Item], Result], item: Item) -> Result:
    """Applies a function to an item; raises an error if the worker's version is not `expected`."""
    if installed_code() != expected:
        raise _OtherVersionError(f"a worker has another version of Errand ({installed_code()}; here it is {expected})")
    return function(item)


@contextmanager
def _errors_as_input() -> Iterator[None]:
    """Turns the errors for a lost scheduler and for a worker of another version into InputError."""
    try:
        yield
    except _OtherVersionError as error:
        raise InputError(str(error), hint=f"install the same version there; {_GO_ON}") from error
    except OSError as error:
        raise InputError(f"the scheduler has stopped answering ({error})", hint=_GO_ON) from error


def _distributed() -> Any:
    try:
        import distributed
    except ImportError as error:
        hint = "pip install 'spot-errand[cluster]', or run it without --workers and --scheduler"
        raise InputError("the extra `cluster` is not installed", hint=hint) from error
    for name in ("distributed.client", "distributed.nanny", "distributed.scheduler", "distributed.batched"):
        logging.getLogger(name).setLevel(logging.CRITICAL)
    return distributed


@contextmanager
def local_cluster(count: int) -> Iterator[ClusterWorkers]:
    """Starts `count` worker processes on this machine, each with a nanny that replaces it when it dies.

    Raises InputError if the extra `cluster` is not installed.
    """
    distributed = _distributed()
    with (
        distributed.LocalCluster(
            n_workers=count,
            threads_per_worker=1,
            processes=True,
            dashboard_address=None,
            memory_limit=0,
            silence_logs=logging.CRITICAL,
        ) as cluster,
        distributed.Client(cluster) as client,
    ):
        yield ClusterWorkers(client)


@contextmanager
def scheduler_at(address: str) -> Iterator[ClusterWorkers]:
    """Connects to the workers of a scheduler.

    Raises InputError if the extra `cluster` is not installed, or no scheduler answers at the address.
    """
    distributed = _distributed()
    try:
        client = distributed.Client(address, timeout=ANSWER_S)
    except (OSError, TimeoutError, ValueError, TypeError) as error:
        hint = "start one with `dask scheduler`, and give the address that it prints, like tcp://HOST:8786"
        raise InputError(f"no scheduler answers at {address}", hint=hint) from error
    with client:
        yield ClusterWorkers(client)


Workers = LocalWorkers | ClusterWorkers
"""Workers that apply a function to items; `count` is their number."""


@dataclass(frozen=True)
class Pool:
    """Settings of the workers: `jobs` local processes, a local cluster of `workers`, or a running `scheduler`.

    Raises:
        InputError: both `workers` and `scheduler` are given.
    """

    jobs: int = 2
    workers: int | None = None
    scheduler: str | None = None

    def __post_init__(self) -> None:
        if self.workers is not None and self.scheduler is not None:
            hint = "give one of them; a scheduler has its own workers"
            raise InputError("--workers and --scheduler do not go together", hint=hint)

    @contextmanager
    def opened(self) -> Iterator[Workers]:
        """Starts or connects the workers while the context is open. Raises InputError if they are not available."""
        if self.scheduler is not None:
            with scheduler_at(self.scheduler) as workers:
                yield workers
        elif self.workers is not None:
            with local_cluster(self.workers) as workers:
                yield workers
        else:
            yield LocalWorkers(self.jobs)


@cache
def installed_code() -> str:
    """Returns the version of Errand with a hash over code, models, worlds and library versions."""
    made, known = hashlib.sha256(), versions((*_LIBRARIES, "spot-errand"))
    for package in _PACKAGES:
        for path in sorted((_ROOT / package).rglob("*")):
            if path.is_file() and "__pycache__" not in path.parts and path.suffix != ".pyc":
                made.update(path.relative_to(_ROOT).as_posix().encode() + b"\0" + path.read_bytes())
    for library in _LIBRARIES:
        made.update(f"{library} {known[library]}\n".encode())
    return f"{known['spot-errand']}+{made.hexdigest()[:_LETTERS]}"
