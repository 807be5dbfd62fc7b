"""Training of the proposal network, from a rendered data set's folder to the ONNX file."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Final

import torch

from errand_train.detector.batches import Feed
from errand_train.detector.canvases import CanvasMaker
from errand_train.detector.export import export
from errand_train.detector.labels import category_names, digest_of, read_split
from errand_train.detector.learner import Learner, ProposalLearner
from errand_train.detector.loop import CHECKPOINT, Loop, Stepped, figures_of
from errand_train.detector.onnx_files import offsets_fact
from errand_train.detector.schedule import Report, TrainOptions
from errand_train.detector.store import open_store
from errand_train.detector.validate import CALIBRATED_BY, Examination, examination, examine, offsets_by

MODEL: Final = "errand_detector.onnx"
PICTURES: Final = "pictures"
SETTLED_BY: Final = 24


def train(options: TrainOptions, report: Callable[[Report], None]) -> Path:
    """Trains the proposal network; returns its ONNX file. Raises TrainingDataError."""
    options.out.mkdir(parents=True, exist_ok=True)
    pictures, names = read_split(options.data, "train"), category_names(options.data)
    exam = examination(options.data, "val", names, options.examined)
    learner = ProposalLearner.new(len(names), options.seed, device())
    feed = Feed(CanvasMaker(pictures, open_store(options.out / PICTURES, pictures)), options.seed)
    begun = options.schedule.phase(0.0)
    if options.resume and (options.out / CHECKPOINT).is_file():
        learner.restore(options.out / CHECKPOINT)
    elif options.start is not None:
        learner.start_from(options.start, (feed.batch(k * begun.batch, begun) for k in range(SETTLED_BY)))

    def step(done: float) -> Stepped:
        progress, phase = learner.progress, options.schedule.phase(done)
        rate = options.schedule.rate(progress.steps, done)
        return Stepped(phase.batch, learner.step(feed.batch(progress.taken, phase), rate), rate)

    return run_loop(learner, step, options, exam, options.out / MODEL, report)


def device() -> torch.device:
    """Device of the training."""
    return torch.device("cuda" if torch.cuda.is_available() else "cpu")


def run_loop(
    learner: Learner[Any],
    step: Callable[[float], Stepped],
    options: TrainOptions,
    exam: Examination,
    file: Path,
    report: Callable[[Report], None],
    *,
    belongs: Mapping[str, str] | None = None,
    networks: int = 1,
) -> Path:
    """Trains until the time is over; returns the ONNX `file` of the averaged network, the last of `networks`.

    `belongs` is the metadata about the network before it. At the end, pictures of the training split calibrate the
    scores.
    """
    first, names = options.out / MODEL, exam.class_names
    facts = {"seed": str(options.seed), "data": digest_of(options.data), **(belongs or {})}

    def written(last: bool) -> dict[str, float]:
        export(learner.average, file, class_names=names, facts=facts)
        if last:
            offsets = offsets_by(first, examination(options.data, "train", names, CALIBRATED_BY), networks=networks)
            calibrated = {**facts, **offsets_fact(offsets)}
            export(learner.average, file, class_names=names, facts=calibrated, score_offsets=offsets)
        return figures_of(examine(first, exam, networks=networks))

    Loop(learner, step, written, options.budget, options.out, report).run()
    return file
