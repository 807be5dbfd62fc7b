"""Training of the proposal network, from a rendered data set's folder to the ONNX file."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Final

import torch

from skills.perception.training.batches import Feed
from skills.perception.training.canvases import CanvasMaker
from skills.perception.training.export import export
from skills.perception.training.labels import category_names, digest_of, read_split
from skills.perception.training.learner import ONNX, ProposalLearner
from skills.perception.training.loop import CHECKPOINT, Loop, Stepped, figures_of
from skills.perception.training.onnx_files import offsets_fact
from skills.perception.training.onnx_weights import settle
from skills.perception.training.schedule import Report, TrainOptions
from skills.perception.training.store import open_store
from skills.perception.training.validate import CALIBRATED_BY, examination, examine, offsets_by

MODEL: Final = "errand_detector.onnx"
PICTURES: Final = "pictures"
_SETTLED_BY: Final = 24


def train(options: TrainOptions, report: Callable[[Report], None]) -> Path:
    """Train, and return the ONNX file. Raises TrainingDataError."""
    options.out.mkdir(parents=True, exist_ok=True)
    pictures, names = read_split(options.data, "train"), category_names(options.data)
    exam = examination(options.data, "val", names, options.examined)
    device = torch.device("cuda" if torch.cuda.is_available() else "cpu")
    learner = ProposalLearner.new(len(names), options.seed, device)
    resumed = options.resume and (options.out / CHECKPOINT).is_file()
    if resumed:
        learner.restore(options.out / CHECKPOINT)
    elif options.start is not None:
        learner.start_from(options.start)
    feed = Feed(CanvasMaker(pictures, open_store(options.out / PICTURES, pictures)), options.seed)
    if not resumed and options.start is not None and options.start.suffix == ONNX:
        _settle(learner, options, feed)

    def step(done: float) -> Stepped:
        progress, phase = learner.progress, options.schedule.phase(done)
        rate = options.schedule.rate(progress.steps, done)
        return Stepped(phase.batch, learner.step(feed.batch(progress.taken, phase), rate), rate)

    def written(last: bool) -> dict[str, float]:
        export_model(learner, options, calibrated=last)
        return figures_of(examine(options.out / MODEL, exam, networks=1))

    Loop(learner, step, written, options.budget, options.out, report).run()
    return options.out / MODEL


def _settle(learner: ProposalLearner, options: TrainOptions, feed: Feed) -> None:
    """Find statistics for the weights of an ONNX file."""
    phase = options.schedule.phase(0.0)
    batches = (feed.batch(k * phase.batch, phase).pictures.to(learner.device) for k in range(_SETTLED_BY))
    settle(learner.network, ((pictures,) for pictures in batches))
    learner.begin_average()


def export_model(learner: ProposalLearner, options: TrainOptions, *, calibrated: bool) -> None:
    """Write the averaged network's ONNX file; calibrated by pictures of the training split."""
    file, names = options.out / MODEL, category_names(options.data)
    facts = {"seed": str(options.seed), "data": digest_of(options.data)}
    export(learner.average, file, class_names=names, facts=facts)
    if calibrated:
        offsets = offsets_by(file, examination(options.data, "train", names, CALIBRATED_BY), networks=1)
        facts |= offsets_fact(offsets)
        export(learner.average, file, class_names=names, facts=facts, score_offsets=offsets)
