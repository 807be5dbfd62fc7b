"""Training of the refinement or the classifier network, from a folder of pictures to its ONNX file."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Final

import torch

from skills.perception.detector.cascade_files import (
    CLASSIFIER_FORMAT,
    REFINEMENT_FORMAT,
    classifier_file,
    load_model,
    refinement_file,
)
from skills.perception.detector.network_file import ModelFileError
from skills.perception.training.crop_batches import CropFeed
from skills.perception.training.crop_learner import CropLearner
from skills.perception.training.export import export_crops
from skills.perception.training.labels import TrainingDataError, TrainingPicture, category_names, digest_of, read_split
from skills.perception.training.loop import CHECKPOINT, Loop, Stepped, figures_of
from skills.perception.training.onnx_files import offsets_fact
from skills.perception.training.proposal_table import ProposalTable, proposals_in, refined_in, table_of
from skills.perception.training.schedule import RefineOptions, Report
from skills.perception.training.store import PictureStore, open_store
from skills.perception.training.train import MODEL, PICTURES
from skills.perception.training.validate import CALIBRATED_BY, examination, examine, offsets_by

TABLE: Final = "proposals.npz"
_SETTLED_BY: Final = 24


def refine(options: RefineOptions, report: Callable[[Report], None]) -> Path:
    """Train, and return the network's ONNX file, beside copies of those before it. Raises TrainingDataError."""
    options.out.mkdir(parents=True, exist_ok=True)
    pictures, names = read_split(options.data, "train"), category_names(options.data)
    exam, first = examination(options.data, "val", names, options.examined), options.out / MODEL
    _copy(options.model, first, options)
    if options.classifier:
        _copy(refinement_file(options.model), refinement_file(first), options)
    store = open_store(options.out / PICTURES, pictures)
    if not options.resume or not (options.out / TABLE).is_file():
        _proposals_of(options, names, pictures, store).save(options.out / TABLE)
    feed = CropFeed(ProposalTable.read(options.out / TABLE), store, options.seed)
    device = torch.device("cuda" if torch.cuda.is_available() else "cpu")
    learner = CropLearner.new(len(names), options.seed, device, classifier=options.classifier)
    _begin(learner, options, feed)

    def step(done: float) -> Stepped:
        progress = learner.progress
        rate = options.schedule.rate(progress.steps, done)
        return Stepped(options.batch, learner.step(feed.batch(progress.taken, options.batch), rate), rate)

    def written(last: bool) -> dict[str, float]:
        export_refined(learner, options, calibrated=last)
        return figures_of(examine(first, exam, networks=_networks(options)))

    Loop(learner, step, written, options.budget, options.out, report).run()
    return _file(options)


def _networks(options: RefineOptions) -> int:
    """How many networks there are with the one that is trained."""
    return 3 if options.classifier else 2


def _file(options: RefineOptions) -> Path:
    """The file of the network that is trained."""
    return (classifier_file if options.classifier else refinement_file)(options.out / MODEL)


def _copy(model: Path, file: Path, options: RefineOptions) -> None:
    """Copy a network's file to the output folder; a resumed training keeps the one that it had."""
    try:
        if not file.is_file() or not (options.resume or model.samefile(file)):
            shutil.copyfile(model, file)
    except OSError as error:
        raise TrainingDataError(
            f"{model}: cannot be copied ({error.strerror})", hint="name a detector's ONNX file with --model"
        ) from error


def _proposals_of(
    options: RefineOptions, names: tuple[str, ...], pictures: tuple[TrainingPicture, ...], store: PictureStore
) -> ProposalTable:
    """What the networks before find in the training pictures. Raises TrainingDataError."""
    try:
        model = load_model(options.out / MODEL, networks=_networks(options) - 1)
    except ModelFileError as error:
        raise TrainingDataError(f"{options.model}: {error.message}", hint=error.hint) from error
    if model.class_names != names:
        raise TrainingDataError(
            f"{options.model}: knows other classes than {options.data}", hint="render the data anew"
        )
    seen = ((store.scales(k), picture.labels) for k, picture in enumerate(pictures))
    table = table_of(partial(refined_in if options.classifier else proposals_in, model), seen)
    if not (table.classes >= 0).any() or not (table.classes < 0).any():
        raise TrainingDataError(
            f"{options.model}: finds nothing to tell apart in {options.data}", hint="train it for longer first"
        )
    return table


def _begin(learner: CropLearner, options: RefineOptions, feed: CropFeed) -> None:
    """Give the learner the weights that it begins with. Raises TrainingDataError."""
    checkpoint, size = options.out / CHECKPOINT, options.batch
    some = (feed.batch(k * size, size) for k in range(_SETTLED_BY))
    if options.resume and checkpoint.is_file():
        learner.restore(checkpoint)
    elif options.start is not None:
        learner.start_from(options.start, some)
    else:
        learner.begin(options.out / MODEL, some)
    learner.keep_early()


def export_refined(learner: CropLearner, options: RefineOptions, *, calibrated: bool) -> None:
    """Write the averaged network's ONNX file; calibrated by pictures of the training split."""
    first, names, networks = options.out / MODEL, category_names(options.data), _networks(options)
    model = load_model(first, networks=networks - 1)
    before = model.refinement if options.classifier else model.proposal
    assert before is not None  # its proposals are what the network is trained on
    facts = {"seed": str(options.seed), "data": digest_of(options.data)}
    facts["second" if options.classifier else "first"] = before.digest
    form = CLASSIFIER_FORMAT if options.classifier else REFINEMENT_FORMAT
    write = partial(export_crops, learner.average, _file(options), form=form, class_names=names)
    write(facts=facts)
    if calibrated:
        offsets = offsets_by(first, examination(options.data, "train", names, CALIBRATED_BY), networks=networks)
        write(facts={**facts, **offsets_fact(offsets)}, score_offsets=offsets)
