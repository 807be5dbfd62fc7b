"""The loop of learning in one process: steps until the time is over, and an examination every tenth of it."""

from __future__ import annotations

import json
import multiprocessing
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, Protocol

from skills.perception.training.learner import LearningState
from skills.perception.training.parallel import Report, Told
from skills.perception.training.schedule import Budget
from skills.perception.training.scoring import Score
from skills.perception.training.workers import Workers

__all__ = ["CHECKPOINT", "Lesson", "Loop", "Stepped", "figures_of"]

CHECKPOINT: Final = "checkpoint.pt"
JOURNAL: Final = "training.jsonl"
_NOTED_EVERY_STEPS: Final = 20
_EXAMINED_EVERY: Final = 0.1


@dataclass(frozen=True)
class Stepped:
    """What one step did: canvases that all processes took, the two losses, the rate, and the first process's clock."""

    taken: int
    scores: float
    boxes: float
    rate: float
    clock: float


class Lesson(Protocol):
    """What is learnt in the loop."""

    @property
    def state(self) -> LearningState[Any]:
        """All that changes while learning."""

    def step(self, done: float, clock: float) -> Stepped:
        """Learn from one batch, with a share of the time done and so many seconds on this process's clock."""

    def written(self, *, last: bool) -> dict[str, float]:
        """Write the ONNX file, and give its figures of some held-out pictures."""


@dataclass
class Loop:
    """Learns until the time is over, or the process that began it all is no more."""

    lesson: Lesson
    budget: Budget
    workers: Workers
    out: Path
    told: Told
    resting_since: float = field(default_factory=time.monotonic)

    def run(self) -> None:
        """Learn, then examine a last time."""
        starter = multiprocessing.parent_process()
        if self._done() >= 1.0:
            self._examine()
        while (done := self._done()) < 1.0 and (starter is None or starter.is_alive()):
            self._step(done)
            if int(self._done() / _EXAMINED_EVERY) > int(done / _EXAMINED_EVERY):
                self._examine()

    def _done(self) -> float:
        progress = self.lesson.state.progress
        return self.budget.progress(progress.taken, progress.seconds)

    def _step(self, done: float) -> None:
        state = self.lesson.state
        before, now = state.progress.seconds, time.monotonic()
        made = self.lesson.step(done, before + now - self.resting_since)
        self.resting_since = now
        state.progress.seconds = made.clock
        state.progress.steps += 1
        state.progress.taken += made.taken
        if self.workers.first and state.progress.steps % _NOTED_EVERY_STEPS == 0:
            speed = made.taken / max(made.clock - before, 1e-6)
            self._note({"progress": done, "scores": made.scores, "boxes": made.boxes, "rate": made.rate})
            self.told(Report(done, state.progress.steps, speed, (made.scores, made.boxes)))

    def _examine(self) -> None:
        """Write the ONNX file and the checkpoint, and report the figures of held-out pictures."""
        state = self.lesson.state
        self.workers.mean_statistics(state.network)
        self.workers.mean_statistics(state.average.network)
        if self.workers.first:
            done = self._done()
            figures = self.lesson.written(last=done >= 1.0)
            self._note({"progress": done, **figures})
            state.save(self.out / CHECKPOINT)
            self.told(Report(done, state.progress.steps, 0.0, (0.0, 0.0), figures))
        self.workers.wait()
        self.resting_since = time.monotonic()

    def _note(self, row: Mapping[str, float]) -> None:
        """Append a row to the journal: losses of a step, or figures of held-out pictures."""
        with (self.out / JOURNAL).open("a", encoding="utf-8") as journal:
            journal.write(json.dumps(row) + "\n")


def figures_of(found: Score) -> dict[str, float]:
    """The figures of an examination that are written down."""
    named = {
        "mAP50": found.map50,
        "mAP50-95": found.map50_95,
        "precision": found.precision,
        "recall": found.recall,
        "false": found.false_per_100_distractor_pictures,
    }
    return {name: float(value) for name, value in named.items() if value is not None}
