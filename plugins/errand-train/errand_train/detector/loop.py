"""Training loop: steps until the time is over, and a validation after every tenth of it."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from errand_train.detector.learner import Learner
from errand_train.detector.schedule import Budget, Report
from errand_train.detector.scoring import Score

CHECKPOINT: Final = "checkpoint.pt"
JOURNAL: Final = "training.jsonl"
_NOTED_EVERY_STEPS: Final = 20
_EXAMINED_EVERY: Final = 0.1


@dataclass(frozen=True)
class Stepped:
    """Result of one step: number of pictures or crops, the two losses, and the learning rate."""

    taken: int
    losses: tuple[float, float]
    rate: float


@dataclass
class Loop:
    """Training loop of one network.

    `step` trains on one batch, given the completed share of the time. `written` writes the ONNX file and returns its
    figures; its argument says whether this is the last time.
    """

    state: Learner[Any]
    step: Callable[[float], Stepped]
    written: Callable[[bool], dict[str, float]]
    budget: Budget
    out: Path
    report: Callable[[Report], None]
    _since: float = field(default_factory=time.monotonic)

    def run(self) -> None:
        """Trains until the time is over, then validates a last time."""
        if self._done() >= 1.0:
            self._examine()
        while (done := self._done()) < 1.0:
            self._step(done)
            if int(self._done() / _EXAMINED_EVERY) > int(done / _EXAMINED_EVERY):
                self._examine()

    def _done(self) -> float:
        progress = self.state.progress
        return self.budget.progress(progress.taken, progress.seconds)

    def _step(self, done: float) -> None:
        progress, made = self.state.progress, self.step(done)
        now = time.monotonic()
        took, self._since = now - self._since, now
        progress.seconds += took
        progress.steps += 1
        progress.taken += made.taken
        if progress.steps % _NOTED_EVERY_STEPS == 0:
            scores, boxes = made.losses
            self._note({"progress": done, "scores": scores, "boxes": boxes, "rate": made.rate})
            self.report(Report(done, progress.steps, made.taken / max(took, 1e-6), made.losses))

    def _examine(self) -> None:
        """Writes the ONNX file and the checkpoint, and reports the figures on held-out pictures."""
        done = self._done()
        figures = self.written(done >= 1.0)
        self._note({"progress": done, **figures})
        self.state.save(self.out / CHECKPOINT)
        self.report(Report(done, self.state.progress.steps, 0.0, (0.0, 0.0), figures))
        self._since = time.monotonic()

    def _note(self, row: Mapping[str, float]) -> None:
        """Appends a row to the journal: losses of a step, or figures of held-out pictures."""
        with (self.out / JOURNAL).open("a", encoding="utf-8") as journal:
            journal.write(json.dumps(row) + "\n")


def figures_of(found: Score) -> dict[str, float]:
    """Figures of a validation for the journal."""
    named = {
        "mAP50": found.map50,
        "mAP50-95": found.map50_95,
        "precision": found.precision,
        "recall": found.recall,
        "false": found.false_per_100_distractor_pictures,
    }
    return {name: float(value) for name, value in named.items() if value is not None}
