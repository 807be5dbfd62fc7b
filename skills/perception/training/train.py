"""Learning from a rendered data set, from its folder to the ONNX file."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Final

import torch

from skills.perception.training.batches import Feed
from skills.perception.training.canvases import CanvasMaker
from skills.perception.training.export import export
from skills.perception.training.labels import category_names, digest_of, read_split
from skills.perception.training.learner import ONNX, Learner
from skills.perception.training.loop import CHECKPOINT, Loop, Stepped, figures_of
from skills.perception.training.onnx_files import offsets_fact
from skills.perception.training.onnx_weights import settle
from skills.perception.training.options import TrainOptions
from skills.perception.training.parallel import Report, Told, run_parallel
from skills.perception.training.store import open_store
from skills.perception.training.validate import CALIBRATED_BY, Examination, examination, examine, offsets_by
from skills.perception.training.workers import Workers

__all__ = ["MODEL", "Report", "TrainOptions", "train"]

MODEL: Final = "errand_detector.onnx"
PICTURES: Final = "pictures"
_SETTLED_BY: Final = 24


def train(options: TrainOptions, told: Told) -> Path:
    """Learn, and give the ONNX file. Raises TrainingDataError."""
    options.out.mkdir(parents=True, exist_ok=True)
    pictures = read_split(options.data, "train")
    examination(options.data, "val", category_names(options.data))
    _begin(Learner.new(len(category_names(options.data)), options.seed, torch.device("cpu")), options)
    open_store(options.out / PICTURES, pictures)
    run_parallel(partial(_learn, options), options.processes, options.out, told)
    return options.out / MODEL


def _learn(options: TrainOptions, workers: Workers, device: torch.device, told: Told) -> None:
    """One process's part in learning."""
    names = category_names(options.data)
    learner = Learner.new(len(names), options.seed, device)
    _begin(learner, options)
    pictures = read_split(options.data, "train")
    store = open_store(options.out / PICTURES, pictures)
    maker = CanvasMaker(pictures, store)
    _settle(learner, options, maker)
    feed = Feed(maker, options.seed, workers.rank, workers.count)
    exam = examination(options.data, "val", names, options.examined)
    Loop(_Canvases(options, learner, workers, feed, exam), options.budget, workers, options.out, told).run()


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
        learner.network, ((feed.batch(k * phase.batch, phase).pictures.to(learner.device),) for k in range(_SETTLED_BY))
    )
    learner.average.network.load_state_dict(learner.network.state_dict())


@dataclass(frozen=True)
class _Canvases:
    """Learning from canvases."""

    options: TrainOptions
    state: Learner
    workers: Workers
    feed: Feed
    exam: Examination

    def step(self, done: float, clock: float) -> Stepped:
        """Learn from one batch."""
        progress, schedule = self.state.progress, self.options.schedule
        phase = schedule.phase(done)
        batch = self.feed.batch(progress.taken, phase)
        rate = schedule.rate(progress.steps, done)
        scores, boxes, clock = self.state.step(batch, rate, self.workers, clock)
        return Stepped(phase.batch * self.workers.count, scores, boxes, rate, clock)

    def written(self, *, last: bool) -> dict[str, float]:
        """Write the ONNX file, and give its figures of some held-out pictures."""
        export_model(self.state, self.options, calibrated=last)
        return figures_of(examine(self.options.out / MODEL, self.exam, networks=1))


def export_model(learner: Learner, options: TrainOptions, *, calibrated: bool) -> None:
    """Write the averaged network's ONNX file; calibrated by pictures that were learnt from."""
    file, names = options.out / MODEL, category_names(options.data)
    network = learner.average.network
    facts = {"seed": str(options.seed), "data": digest_of(options.data)}
    export(network, file, class_names=names, facts=facts)
    if calibrated:
        offsets = offsets_by(file, examination(options.data, "train", names, CALIBRATED_BY), networks=1)
        told = {**facts, **offsets_fact(offsets)}
        export(network, file, class_names=names, facts=told, score_offsets=offsets)
