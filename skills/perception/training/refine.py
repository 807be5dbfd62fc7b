"""Training of the refinement or the classifier network, from a folder of pictures to its ONNX file."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Final

import torch

from skills.perception.detector.cascade_files import (
    CLASSIFIER_FORMAT,
    REFINEMENT_FORMAT,
    DetectorModel,
    classifier_file,
    load_model,
    refinement_file,
)
from skills.perception.detector.network_file import ModelFileError, Network
from skills.perception.detector.proposals import Proposals
from skills.perception.detector.scales import Scales
from skills.perception.training.crop_batches import CropFeed
from skills.perception.training.crop_export import export_crops
from skills.perception.training.crop_learner import ClassifierLearner, CropLearner, RefinementLearner
from skills.perception.training.crop_store import CropStore, written_crops
from skills.perception.training.labels import LearningPicture, TrainingDataError, category_names, digest_of, read_split
from skills.perception.training.loop import CHECKPOINT, Loop, Stepped, figures_of
from skills.perception.training.onnx_files import offsets_fact
from skills.perception.training.options import RefineOptions
from skills.perception.training.parallel import Told, run_parallel
from skills.perception.training.proposal_table import ProposalTable, proposals_in, refined_in, table_of
from skills.perception.training.store import read_scales
from skills.perception.training.train import MODEL
from skills.perception.training.validate import CALIBRATED_BY, Examination, examination, examine, offsets_by
from skills.perception.training.workers import Workers

__all__ = ["refine"]

TABLE: Final = "regions.npz"
_SETTLED_BY: Final = 24


@dataclass(frozen=True)
class _Stage:
    """What is particular to learning the network that comes after so many others.

    It learns from the `look` of the last of those, to whose digest its own file tells that it belongs.
    """

    before: int
    look: Callable[[DetectorModel, Scales], Proposals]
    learner: type[CropLearner]
    form: str
    belongs: str
    file: Callable[[Path], Path]
    last: Callable[[DetectorModel], Network | None]

    @property
    def networks(self) -> int:
        """How many there are with it."""
        return self.before + 1


_REFINEMENT: Final = _Stage(
    1, proposals_in, RefinementLearner, REFINEMENT_FORMAT, "first", refinement_file, lambda model: model.proposal
)
_CLASSIFIER: Final = _Stage(
    2, refined_in, ClassifierLearner, CLASSIFIER_FORMAT, "second", classifier_file, lambda model: model.refinement
)


def _stage(options: RefineOptions) -> _Stage:
    return _CLASSIFIER if options.classifier else _REFINEMENT


def refine(options: RefineOptions, told: Told) -> Path:
    """Learn, and give the network's ONNX file, beside copies of those before it. Raises TrainingDataError."""
    options.out.mkdir(parents=True, exist_ok=True)
    pictures = read_split(options.data, "train")
    names = category_names(options.data)
    examination(options.data, "val", names)
    first = options.out / MODEL
    _copy(options.model, first, options)
    if options.classifier:
        _copy(refinement_file(options.model), refinement_file(first), options)
    if not options.resume or not (options.out / TABLE).is_file() or not CropStore.are_in(options.out):
        (options.out / TABLE).unlink(missing_ok=True)
        _look_at_all(options, names, pictures)
    run_parallel(partial(_learn, options), options.processes, options.out, told)
    return _stage(options).file(first)


def _copy(model: Path, file: Path, options: RefineOptions) -> None:
    """Bring a network's file to where it is written to; what is gone on with keeps the one that it had."""
    try:
        if not file.is_file() or not (options.resume or model.samefile(file)):
            shutil.copyfile(model, file)
    except OSError as error:
        raise TrainingDataError(
            f"{model}: cannot be copied ({error.strerror})", mend="name a detector's ONNX file with --model"
        ) from error


def _look_at_all(options: RefineOptions, names: tuple[str, ...], pictures: tuple[LearningPicture, ...]) -> None:
    """Write down what the networks before find. Raises TrainingDataError."""
    stage = _stage(options)
    try:
        model = load_model(options.out / MODEL, networks=stage.before)
    except ModelFileError as error:
        raise TrainingDataError(f"{options.model}: {error.message}", mend=error.mend) from error
    if model.class_names != names:
        raise TrainingDataError(
            f"{options.model}: knows other classes than {options.data}", mend="render the data anew"
        )
    with written_crops(options.out) as kept:
        seen = ((read_scales(picture.file), picture.labels) for picture in pictures)
        table = table_of(partial(stage.look, model), seen, kept)
    if not (table.classes >= 0).any() or not (table.classes < 0).any():
        raise TrainingDataError(
            f"{options.model}: finds nothing to tell apart in {options.data}", mend="train it for longer first"
        )
    table.save(options.out / TABLE)


def _learn(options: RefineOptions, workers: Workers, device: torch.device, told: Told) -> None:
    """One process's part in learning."""
    names = category_names(options.data)
    learner = _stage(options).learner.new(len(names), options.seed, device)
    table, about = ProposalTable.read(options.out / TABLE), CropStore.read(options.out)
    _begin(learner, options, CropFeed(table, about, options.seed, 0, 1))
    feed = CropFeed(table, about, options.seed, workers.rank, workers.count)
    exam = examination(options.data, "val", names, options.examined)
    Loop(_Regions(options, learner, workers, feed, exam), options.budget, workers, options.out, told).run()


def _begin(learner: CropLearner, options: RefineOptions, feed: CropFeed) -> None:
    """Give the learner the weights that it begins with; the same in all processes. Raises TrainingDataError."""
    checkpoint, size = options.out / CHECKPOINT, options.batch
    some = (feed.batch(k * size, size) for k in range(_SETTLED_BY))
    if options.resume and checkpoint.is_file():
        learner.restore(checkpoint)
    elif options.start is not None:
        learner.start_from(options.start, some)
    else:
        learner.begin(options.out / MODEL, some)
    learner.keep_early()


@dataclass(frozen=True)
class _Regions:
    """Learning from crops about regions."""

    options: RefineOptions
    state: CropLearner
    workers: Workers
    feed: CropFeed
    exam: Examination

    def step(self, done: float, clock: float) -> Stepped:
        """Learn from one batch."""
        progress, options = self.state.progress, self.options
        batch = self.feed.batch(progress.taken, options.batch)
        rate = options.schedule.rate(progress.steps, done)
        scores, boxes, clock = self.state.step(batch, rate, self.workers, clock)
        return Stepped(options.batch * self.workers.count, scores, boxes, rate, clock)

    def written(self, *, last: bool) -> dict[str, float]:
        """Write the ONNX file, and give its figures of some held-out pictures."""
        export_refined(self.state, self.options, calibrated=last)
        return figures_of(examine(self.options.out / MODEL, self.exam, networks=_stage(self.options).networks))


def export_refined(learner: CropLearner, options: RefineOptions, *, calibrated: bool) -> None:
    """Write the averaged network's ONNX file; calibrated by pictures that were learnt from."""
    stage, first, names = _stage(options), options.out / MODEL, category_names(options.data)
    before = stage.last(load_model(first, networks=stage.before))
    assert before is not None  # its look at all pictures is what was learnt from
    facts = {"seed": str(options.seed), "data": digest_of(options.data), stage.belongs: before.digest}
    write = partial(export_crops, learner.average.network, stage.file(first), form=stage.form, class_names=names)
    write(facts=facts)
    if calibrated:
        exam = examination(options.data, "train", names, CALIBRATED_BY)
        offsets = offsets_by(first, exam, networks=stage.networks)
        write(
            facts={**facts, **offsets_fact(offsets)},
            score_offsets=offsets,
        )
