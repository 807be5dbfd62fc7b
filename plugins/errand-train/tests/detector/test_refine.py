"""From a folder of pictures and a proposal network to the refinement network's file; skipped without torch."""

from dataclasses import replace
from shutil import copytree

import cv2
import numpy as np
import pytest
from random_networks import random_network

from tests.skills.tiny_detector import CLASSES, picture_of, write_model

torch = pytest.importorskip("torch")
pytest.importorskip("onnx")

from splits import write_split  # noqa: E402

from errand_train.detector.labels import TrainingDataError  # noqa: E402
from errand_train.detector.learner import read_checkpoint  # noqa: E402
from errand_train.detector.loop import CHECKPOINT  # noqa: E402
from errand_train.detector.refine import TABLE, refine  # noqa: E402
from errand_train.detector.schedule import Budget, RefineOptions, Report, Schedule  # noqa: E402
from errand_train.detector.train import MODEL  # noqa: E402
from executive.app.report.pictures import open_detector  # noqa: E402
from skills.perception.detector.model_files import classifier_file, load_model, refinement_file  # noqa: E402

pytestmark = pytest.mark.usefixtures("small_networks")


def write_noise(folder, split, count, names=CLASSES):
    """Pictures of noise that are said to hold many things as large as an unlearnt network's boxes."""
    drawn = (np.random.default_rng(number).integers(0, 256, (480, 640, 3), dtype=np.uint8) for number in range(count))
    boxes = [[x, y, 22, 15] for y in range(9, 470, 24) for x in range(1 + y % 48, 610, 48)]
    write_split(folder, split, drawn, boxes, names)


def options_in(folder):
    first, schedule = folder / "first.onnx", Schedule(1e-3)
    data, out = folder / "data", folder / "out"
    return RefineOptions(data, out, Budget(pictures=4), model=first, examined=1, batch=4, schedule=schedule)


@pytest.fixture(scope="module")
def begun(small_networks, tmp_path_factory):
    """A folder as a data set and a proposal network stand after `errand dataset train`."""
    folder = tmp_path_factory.mktemp("begun")
    (folder / "data").mkdir()
    write_noise(folder / "data", "train", 4)
    write_noise(folder / "data", "val", 2)
    real_first(folder / "first.onnx")
    return folder


@pytest.fixture
def options(begun, tmp_path):
    """A refinement that has not begun, in a folder that a test may change."""
    return options_in(copytree(begun, tmp_path / "begun"))


@pytest.fixture(scope="module")
def once(begun, tmp_path_factory):
    """The folder of a finished refinement, and what it told."""
    folder, told = copytree(begun, tmp_path_factory.mktemp("refined") / "once"), list[Report]()
    refine(options_in(folder), told.append)
    return folder, told


@pytest.fixture
def finished(once, tmp_path):
    """Options of a copy of the finished refinement, which a test may change."""
    return options_in(copytree(once[0], tmp_path / "once"))


def real_first(file):
    """A proposal network in the form that learning can take over, which sees something everywhere."""
    from errand_train.detector.export import export

    export(random_network(0, len(CLASSES)), file, class_names=CLASSES, facts={}, score_offsets=(4.0,) * len(CLASSES))
    return file


def test_a_proposal_network_gets_a_refinement_network(once):
    folder, told = once
    options = options_in(folder)
    assert refinement_file(options.out / MODEL).is_file()
    model = load_model(options.out / MODEL)
    assert model.refinement is not None
    assert len(open_detector(options.out / MODEL, 0.5).detect([picture_of()])) == 1
    assert told[-1].progress == 1.0
    assert told[-1].figures is not None
    assert {path.name for path in options.out.iterdir()} >= {CHECKPOINT, MODEL, TABLE, "training.jsonl"}


def test_both_get_a_classifier_network_that_belongs_to_them(finished, tmp_path):
    next_one = replace(finished, classifier=True, model=finished.out / MODEL, out=tmp_path / "next")
    file = refine(next_one, lambda _: None)
    assert file == classifier_file(next_one.out / MODEL)
    model = load_model(next_one.out / MODEL)
    assert model.refinement is not None
    assert model.classifier is not None
    assert model.classifier.metadata["second"] == model.refinement.digest
    assert len(open_detector(next_one.out / MODEL, 0.5).detect([picture_of()])) == 1


def test_without_a_refinement_network_there_is_no_classifier_network(options):
    with pytest.raises(TrainingDataError, match=r"first_refinement\.onnx: cannot be copied"):
        refine(replace(options, classifier=True), lambda _: None)


@pytest.mark.usefixtures("unwritten")
def test_a_training_resumes_from_its_checkpoint(finished):
    told = list[Report]()
    refine(replace(finished, budget=Budget(pictures=12), resume=True), told.append)
    assert [report.steps for report in told if report.figures is not None] == [2, 3]


@pytest.mark.usefixtures("unwritten")
@pytest.mark.parametrize("kind", ["checkpoint", "ONNX file"])
def test_weights_of_another_training_are_taken_over(finished, tmp_path, kind):
    start = {"checkpoint": finished.out / CHECKPOINT, "ONNX file": refinement_file(finished.out / MODEL)}[kind]
    refine(replace(finished, out=tmp_path / "next", start=start, schedule=Schedule(0.0)), lambda _: None)
    before, after = (read_checkpoint(out / CHECKPOINT) for out in (finished.out, tmp_path / "next"))
    assert after["progress"]["steps"] == 1
    averaged, weight = "module.scores.weight", "scores.weight"
    assert before["average"][averaged].abs().max() > 0
    assert torch.allclose(
        before["average"][averaged], after["network"][weight], atol=0 if kind == "checkpoint" else 1e-4
    )


def test_a_network_of_other_classes_is_refused(options):
    for split in ("train", "val"):
        write_noise(options.data, split, 4, names=("beer", "coke", "wrench"))
    with pytest.raises(TrainingDataError, match="knows other classes"):
        refine(options, lambda _: None)


def test_a_network_without_proposals_is_refused(options, tmp_path):
    blind = write_model(tmp_path / "blind.onnx")
    for file in options.data.glob("*.png"):
        cv2.imwrite(str(file), picture_of())
    with pytest.raises(TrainingDataError, match="finds nothing"):
        refine(replace(options, model=blind), lambda _: None)


def test_a_file_that_is_no_network_is_refused(options):
    (options.data / "none.onnx").write_bytes(b"none")
    with pytest.raises(TrainingDataError, match=r"none\.onnx.*damaged or no ONNX file"):
        refine(replace(options, model=options.data / "none.onnx"), lambda _: None)
