"""Who does the work of a command that gives out much of it: processes of this machine, or a Dask cluster."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass

from executive.app.evaluate.cluster import local_cluster, scheduler_at
from executive.app.evaluate.workers import LocalWorkers, Workers
from skills.files.errors import InputError

__all__ = ["Pool"]


@dataclass(frozen=True)
class Pool:
    """Who does the work: so many local processes (`jobs`), a local cluster of `workers`, or those of a `scheduler`.

    Raises:
        InputError: both of a cluster and a scheduler are given.
    """

    jobs: int = 2
    workers: int | None = None
    scheduler: str | None = None

    def __post_init__(self) -> None:
        if self.workers is not None and self.scheduler is not None:
            hint = "a scheduler has the workers that were started for it"
            raise InputError("--workers and --scheduler do not go together", hint=hint)

    def opened(self) -> AbstractContextManager[Workers]:
        """The workers, for as long as the context is open. Raises InputError: they cannot be had."""
        if self.scheduler is not None:
            return scheduler_at(self.scheduler)
        return _local(self.jobs) if self.workers is None else local_cluster(self.workers)


@contextmanager
def _local(count: int) -> Iterator[Workers]:
    yield LocalWorkers(count)
