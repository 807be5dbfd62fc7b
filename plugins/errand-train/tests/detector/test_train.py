"""From a folder of pictures to the ONNX file; skipped without torch."""

import json
from dataclasses import replace
from shutil import copytree

import numpy as np
import pytest

pytest.importorskip("torch")
pytest.importorskip("onnx")

from splits import write_split

from errand_train.detector.canvases import CanvasOptions
from errand_train.detector.labels import TrainingDataError
from errand_train.detector.loop import CHECKPOINT
from errand_train.detector.schedule import Budget, Phase, Schedule
from errand_train.detector.train import MODEL, Report, TrainOptions, train
from errand_train.detector.validate import examination
from skills.perception.detector.model_files import load_model

pytestmark = pytest.mark.usefixtures("small_networks")
NAMES = ("beer", "coke")
SMALL = Schedule(warm_up_steps=2, phases=(Phase(0.0, CanvasOptions(96, 64), 2),))


def write_blocks(folder, split, count):
    """Grey pictures with a green block, which is brighter in each."""
    pictures = np.full((count, 240, 320, 3), 60, dtype=np.uint8)
    for number, picture in enumerate(pictures):
        picture[60:160, 100:180] = (30, 200, 30 * number)
    write_split(folder, split, pictures, [[100, 60, 80, 100]], NAMES)


def options_in(folder):
    return TrainOptions(folder / "data", folder / "out", Budget(pictures=4), examined=2, schedule=SMALL)


@pytest.fixture
def options(tmp_path):
    """A training that has not begun."""
    data = tmp_path / "data"
    data.mkdir()
    write_blocks(data, "train", 4)
    write_blocks(data, "val", 2)
    return options_in(tmp_path)


@pytest.fixture(scope="module")
def once(small_networks, tmp_path_factory):
    """The folder of a finished training, and what it told."""
    folder, told = tmp_path_factory.mktemp("once"), list[Report]()
    (folder / "data").mkdir()
    write_blocks(folder / "data", "train", 4)
    write_blocks(folder / "data", "val", 2)
    train(options_in(folder), told.append)
    return folder, told


@pytest.fixture
def finished(once, tmp_path):
    """Options of a copy of the finished training, which a test may change."""
    copytree(once[0], tmp_path / "once")
    return options_in(tmp_path / "once")


def test_a_data_set_becomes_a_detectors_file(once):
    folder, told = once
    options = options_in(folder)
    assert load_model(options.out / MODEL).class_names == NAMES
    assert told[-1].progress == 1.0
    assert told[-1].figures is not None
    assert {path.name for path in options.out.iterdir()} >= {CHECKPOINT, MODEL, "training.jsonl", "pictures"}


@pytest.mark.usefixtures("unwritten")
def test_a_resumed_training_counts_what_it_has_seen(finished):
    told = list[Report]()
    train(replace(finished, resume=True, budget=Budget(pictures=6)), told.append)
    assert told[-1].steps == 3


def test_a_finished_training_writes_its_file_again(finished):
    file = finished.out / MODEL
    content = file.read_bytes()
    file.unlink()
    assert train(replace(finished, resume=True), lambda _report: None) == file
    assert file.read_bytes() == content


def test_weights_that_are_not_there_are_named(options, tmp_path):
    chosen = replace(options, start=tmp_path / "none.pt")
    with pytest.raises(TrainingDataError, match=r"none\.pt"):
        train(chosen, lambda _report: None)


@pytest.mark.usefixtures("unwritten")
@pytest.mark.parametrize("file", [CHECKPOINT, MODEL])
def test_weights_of_another_training_are_taken_over(finished, tmp_path, file):
    told = list[Report]()
    train(replace(finished, out=tmp_path / "next", start=finished.out / file), told.append)
    assert told[-1].steps == 2


@pytest.mark.parametrize("content", [b"", b"no network"])
def test_an_onnx_file_that_is_damaged_is_named(options, tmp_path, content):
    file = tmp_path / "old.onnx"
    file.write_bytes(content)
    with pytest.raises(TrainingDataError, match=r"old\.onnx"):
        train(replace(options, start=file), lambda _report: None)


def test_scores_are_shifted_by_pictures_that_are_not_crowded(options):
    document = json.loads((options.data / "train.json").read_text())
    for image in document["images"][1:]:
        image["crowded"] = True
    (options.data / "train.json").write_text(json.dumps(document))
    assert [one.file for one in examination(options.data, "train", NAMES).pictures] == ["train0.png"]


def test_a_picture_that_is_damaged_is_named(options):
    (options.data / "train2.png").write_bytes(b"no picture")
    with pytest.raises(TrainingDataError, match=r"train2\.png"):
        train(options, lambda _report: None)
