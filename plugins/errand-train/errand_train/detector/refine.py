"""Training of the refinement or the classifier network, from a data set to an ONNX file."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Final

from errand_train.detector.crop_batches import CropFeed
from errand_train.detector.labels import TrainingDataError, TrainingPicture, category_names, read_split
from errand_train.detector.learner import CropLearner
from errand_train.detector.loop import CHECKPOINT, Stepped
from errand_train.detector.proposal_table import ProposalTable, build_table, first_proposals, refined_proposals
from errand_train.detector.schedule import RefineOptions, Report
from errand_train.detector.store import PictureStore, open_store
from errand_train.detector.train import MODEL, PICTURES, SETTLED_BY, device, run_loop
from errand_train.detector.validate import examination
from skills.perception.detector.model_files import (
    DetectorModel,
    ModelFileError,
    classifier_file,
    load_model,
    refinement_file,
)

TABLE: Final = "proposals.npz"


def refine(options: RefineOptions, report: Callable[[Report], None]) -> Path:
    """Trains the network; returns its ONNX file, beside copies of those before it. Raises TrainingDataError."""
    options.out.mkdir(parents=True, exist_ok=True)
    pictures, names = read_split(options.data, "train"), category_names(options.data)
    exam, first = examination(options.data, "val", names, options.examined), options.out / MODEL
    _copy(options.model, first, options)
    if options.classifier:
        _copy(refinement_file(options.model), refinement_file(first), options)
    store = open_store(options.out / PICTURES, pictures)
    before = _networks_before(options, names)
    if not options.resume or not (options.out / TABLE).is_file():
        _proposals_of(options, before, pictures, store).save(options.out / TABLE)
    feed = CropFeed(ProposalTable.read(options.out / TABLE), store, options.seed)
    learner = CropLearner.new(len(names), options.seed, device(), classifier=options.classifier)
    _begin(learner, options, feed)

    def step(done: float) -> Stepped:
        progress = learner.progress
        rate = options.schedule.rate(progress.steps, done)
        return Stepped(options.batch, learner.step(feed.batch(progress.taken, options.batch), rate), rate)

    if before.refinement is None:
        belongs, file, networks = {"first": before.proposal.digest}, refinement_file(first), 2
    else:
        belongs, file, networks = {"second": before.refinement.digest}, classifier_file(first), 3
    return run_loop(learner, step, options, exam, file, report, belongs=belongs, networks=networks)


def _copy(model: Path, file: Path, options: RefineOptions) -> None:
    """Copies a network's file to the output folder; a resumed training keeps the one that it had."""
    try:
        if not file.is_file() or not (options.resume or model.samefile(file)):
            shutil.copyfile(model, file)
    except OSError as error:
        raise TrainingDataError(
            f"{model}: cannot be copied ({error.strerror})", hint="name a detector's ONNX file with --model"
        ) from error


def _networks_before(options: RefineOptions, names: tuple[str, ...]) -> DetectorModel:
    """Loads the networks before the trained one. Raises TrainingDataError."""
    try:
        model = load_model(options.out / MODEL, networks=2 if options.classifier else 1)
    except ModelFileError as error:
        raise TrainingDataError(f"{options.model}: {error.message}", hint=error.hint) from error
    if model.class_names != names:
        raise TrainingDataError(
            f"{options.model}: knows other classes than {options.data}", hint="render the data again"
        )
    return model


def _proposals_of(
    options: RefineOptions, model: DetectorModel, pictures: tuple[TrainingPicture, ...], store: PictureStore
) -> ProposalTable:
    """Runs the networks before on the training pictures. Raises TrainingDataError."""
    seen = ((store.scales(k), picture.labels) for k, picture in enumerate(pictures))
    table = build_table(partial(refined_proposals if options.classifier else first_proposals, model), seen)
    if not (table.classes >= 0).any() or not (table.classes < 0).any():
        raise TrainingDataError(
            f"{options.model}: finds nothing to tell apart in {options.data}", hint="train it for longer first"
        )
    return table


def _begin(learner: CropLearner, options: RefineOptions, feed: CropFeed) -> None:
    """Loads the initial weights of the learner. Raises TrainingDataError."""
    checkpoint, size = options.out / CHECKPOINT, options.batch
    some = (feed.batch(k * size, size) for k in range(SETTLED_BY))
    if options.resume and checkpoint.is_file():
        learner.restore(checkpoint)
    elif options.start is not None:
        learner.start_from(options.start, some)
    else:
        learner.begin(options.out / MODEL, some)
    learner.keep_early()
