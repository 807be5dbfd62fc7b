"""Learning in several processes, and what it tells of its progress."""

from __future__ import annotations

import multiprocessing
import queue
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import cv2
import torch

from skills.perception.training.labels import TrainingDataError
from skills.perception.training.workers import Workers, joined_workers

__all__ = ["Report", "Told", "run_parallel"]

_GO_ON: Final = "perhaps for want of memory; the same command with --resume goes on from its checkpoint"


@dataclass(frozen=True)
class Report:
    """How far learning has come; `figures` of the held-out pictures when they were just taken."""

    progress: float
    steps: int
    pictures_per_s: float
    losses: tuple[float, float]
    figures: dict[str, float] | None = None


Told = Callable[[Report], None]
Part = Callable[[Workers, torch.device, Told], None]


def run_parallel(part: Part, processes: int, out: Path, told: Told) -> None:
    """Take part in learning in so many processes of one thread, or in this one alone where there is a GPU.

    What the first process tells is passed on. Raises TrainingDataError when one is killed.
    """
    if torch.cuda.is_available() or processes == 1:
        _take_part(0, 1, Path(), part, told)
        return
    context = torch.multiprocessing.get_context("spawn")
    reports = context.Queue()
    with tempfile.TemporaryDirectory() as folder:
        arguments = (processes, Path(folder) / "meeting", part, reports)
        running = torch.multiprocessing.spawn(_process, arguments, nprocs=processes, join=False)
        try:
            while not running.join(timeout=0.2):
                _pass_on(reports, told)
        except torch.multiprocessing.ProcessExitedException as error:
            raise TrainingDataError(f"{out}: a training process was killed", mend=_GO_ON) from error
        finally:
            _end(running.processes)
        _pass_on(reports, told)


def _process(rank: int, count: int, meeting: Path, part: Part, reports: Any) -> None:
    torch.set_num_threads(1)
    _take_part(rank, count, meeting, part, reports.put)


def _take_part(rank: int, count: int, meeting: Path, part: Part, told: Told) -> None:
    cv2.setNumThreads(1)
    workers = joined_workers(rank, count, meeting)
    part(workers, torch.device("cuda" if torch.cuda.is_available() else "cpu"), told)


def _end(processes: Sequence[multiprocessing.Process]) -> None:
    """End those that still run, so that none stays behind when this one is interrupted."""
    for process in processes:
        if process.is_alive():
            process.terminate()
            process.join()


def _pass_on(reports: Any, told: Told) -> None:
    while True:
        try:
            told(reports.get(timeout=0.2))
        except queue.Empty:
            return
