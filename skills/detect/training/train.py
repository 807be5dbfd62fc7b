"""Learning from a rendered data set, from its folder to the ONNX file."""

from __future__ import annotations

import json
import multiprocessing
import queue
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import cv2
import torch

from skills.detect.scoring import Score
from skills.detect.training.batches import Feed
from skills.detect.training.canvases import CanvasMaker
from skills.detect.training.export import export
from skills.detect.training.labels import TrainingDataError, category_names, digest_of, read_split
from skills.detect.training.learner import ONNX, Learner
from skills.detect.training.onnx_weights import settle
from skills.detect.training.options import TrainOptions
from skills.detect.training.peers import Peers, joined_peers
from skills.detect.training.records import draw_curves
from skills.detect.training.store import open_store
from skills.detect.training.validate import Examination, examination, examine, offsets_by

__all__ = ["CHECKPOINT", "MODEL", "Report", "TrainOptions", "train"]

CHECKPOINT: Final = "checkpoint.pt"
MODEL: Final = "errand_detector.onnx"
CURVES: Final = "curves.png"
PICTURES: Final = "pictures"
_NOTED_EVERY_STEPS: Final = 20
_GO_ON: Final = "perhaps for want of memory; the same command with --resume goes on from its checkpoint"
_EXAMINED_EVERY: Final = 0.1
_CALIBRATED_BY: Final = 900
_SETTLED_BY: Final = 24


@dataclass(frozen=True)
class Report:
    """How far learning has come; `figures` of the held-out pictures when they were just taken."""

    progress: float
    steps: int
    pictures_per_s: float
    losses: tuple[float, float]
    figures: dict[str, float] | None = None


Told = Callable[[Report], None]


def train(options: TrainOptions, told: Told) -> Path:
    """Learn, and give the ONNX file. Raises TrainingDataError."""
    options.out.mkdir(parents=True, exist_ok=True)
    pictures = read_split(options.data, "train")
    examination(options.data, "val", category_names(options.data))
    _begin(Learner.new(len(category_names(options.data)), options.seed, torch.device("cpu")), options)
    open_store(options.out / PICTURES, pictures)
    if torch.cuda.is_available() or options.processes == 1:
        _learn(0, 1, options, Path(), told)
    else:
        _learn_together(options, told)
    return options.out / MODEL


def _learn_together(options: TrainOptions, told: Told) -> None:
    """Several processes; what the first one tells is passed on."""
    context = torch.multiprocessing.get_context("spawn")
    reports = context.Queue()
    with tempfile.TemporaryDirectory() as folder:
        arguments = (options.processes, options, Path(folder) / "meeting", reports)
        running = torch.multiprocessing.spawn(_process, arguments, nprocs=options.processes, join=False)
        try:
            while not running.join(timeout=0.2):
                _pass_on(reports, told)
        except torch.multiprocessing.ProcessExitedException as error:
            raise TrainingDataError(f"{options.out}: a training process was killed", mend=_GO_ON) from error
        finally:
            _end(running.processes)
        _pass_on(reports, told)


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


def _process(rank: int, count: int, options: TrainOptions, meeting: Path, reports: Any) -> None:
    torch.set_num_threads(1)
    _learn(rank, count, options, meeting, reports.put)


def _learn(rank: int, count: int, options: TrainOptions, meeting: Path, told: Told) -> None:
    """One process's part in learning."""
    cv2.setNumThreads(1)
    peers = joined_peers(rank, count, meeting)
    names = category_names(options.data)
    device = torch.device("cuda" if torch.cuda.is_available() else "cpu")
    learner = Learner.new(len(names), options.seed, device)
    _begin(learner, options)
    pictures = read_split(options.data, "train")
    store = open_store(options.out / PICTURES, pictures)
    maker = CanvasMaker(pictures, store)
    _settle(learner, options, maker)
    if options.keep_early:
        learner.keep_early()
    feed = Feed(maker, options.seed, rank, count)
    exam = examination(options.data, "val", names, options.examined)
    _Course(options, learner, peers, feed, exam, told).run()


def _beginning(options: TrainOptions) -> Path | None:
    """The checkpoint from which learning begins."""
    checkpoint = options.out / CHECKPOINT
    return checkpoint if options.resume and checkpoint.is_file() else options.start


def _begin(learner: Learner, options: TrainOptions) -> None:
    begins = _beginning(options)
    if begins is not None and begins == options.start:
        learner.start_from(begins)
    elif begins is not None:
        learner.restore(begins)


def _settle(learner: Learner, options: TrainOptions, maker: CanvasMaker) -> None:
    """Find statistics for the weights of an ONNX file; the same in all processes."""
    begins = _beginning(options)
    if begins is None or begins != options.start or begins.suffix != ONNX:
        return
    feed, phase = Feed(maker, options.seed, 0, 1), options.schedule.phase(0.0)
    settle(
        learner.network, (feed.batch(k * phase.batch, phase).pictures.to(learner.device) for k in range(_SETTLED_BY))
    )
    learner.average.network.load_state_dict(learner.network.state_dict())


@dataclass
class _Course:
    """The loop of learning in one process."""

    options: TrainOptions
    learner: Learner
    peers: Peers
    feed: Feed
    exam: Examination
    told: Told
    resting_since: float = field(default_factory=time.monotonic)

    def run(self) -> None:
        """Learn until the time is over, then write the file; or until the process that began it all is no more."""
        starter = multiprocessing.parent_process()
        if self._done() >= 1.0:
            self._examine()
        while (done := self._done()) < 1.0 and (starter is None or starter.is_alive()):
            self._step(done)
            if int(self._done() / _EXAMINED_EVERY) > int(done / _EXAMINED_EVERY):
                self._examine()

    def _done(self) -> float:
        progress = self.learner.progress
        return self.options.budget.progress(progress.taken, progress.seconds)

    def _step(self, done: float) -> None:
        progress, schedule = self.learner.progress, self.options.schedule
        phase = schedule.phase(done)
        batch = self.feed.batch(progress.taken, phase)
        rate = schedule.rate(progress.steps, done)
        before, now = progress.seconds, time.monotonic()
        scores, boxes, clock = self.learner.step(batch, rate, self.peers, before + now - self.resting_since)
        self.resting_since = now
        progress.seconds = clock
        progress.steps += 1
        taken = phase.batch * self.peers.count
        progress.taken += taken
        if self.peers.first and progress.steps % _NOTED_EVERY_STEPS == 0:
            speed = taken / max(clock - before, 1e-6)
            self.learner.course.steps.append({"progress": done, "scores": scores, "boxes": boxes, "rate": rate})
            self.told(Report(done, progress.steps, speed, (scores, boxes)))

    def _examine(self) -> None:
        """Write checkpoint, ONNX file and curves, and tell how good it is."""
        self.peers.mean_statistics(self.learner.network)
        self.peers.mean_statistics(self.learner.average.network)
        if self.peers.first:
            figures = self._written()
            progress = self.learner.progress
            self.told(Report(self._done(), progress.steps, 0.0, (0.0, 0.0), figures))
        self.peers.wait()
        self.resting_since = time.monotonic()

    def _written(self) -> dict[str, float]:
        out, learner = self.options.out, self.learner
        export_model(learner, self.options, calibrated=self._done() >= 1.0)
        figures = _figures(examine(out / MODEL, self.exam))
        learner.course.exams.append({"progress": self._done(), **figures})
        draw_curves(learner.course, out / CURVES)
        learner.save(out / CHECKPOINT)
        return figures


def export_model(learner: Learner, options: TrainOptions, *, calibrated: bool) -> None:
    """Write the averaged network's ONNX file; calibrated by pictures that were learnt from."""
    file, names = options.out / MODEL, category_names(options.data)
    network = learner.average.network
    facts = {"seed": str(options.seed), "data": digest_of(options.data)}
    export(network, file, class_names=names, facts=facts)
    if calibrated:
        offsets = offsets_by(file, examination(options.data, "train", names, _CALIBRATED_BY))
        told = {**facts, "score_offsets": json.dumps([round(value, 4) for value in offsets])}
        export(network, file, class_names=names, facts=told, score_offsets=offsets)


def _figures(found: Score) -> dict[str, float]:
    named = {
        "mAP50": found.map50,
        "mAP50-95": found.map50_95,
        "precision": found.precision,
        "recall": found.recall,
        "false": found.false_per_100_distractor_pictures,
    }
    return {name: float(value) for name, value in named.items() if value is not None}
