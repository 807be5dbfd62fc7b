"""From a folder of pictures and a first network to the second one's file; skipped without torch."""

import json
from dataclasses import replace
from pathlib import Path

import cv2
import pytest
from tiny_detector import CLASSES, picture_of, write_model

pytest.importorskip("torch")
pytest.importorskip("onnx")

from skills.detect.detector_file import load_model, regions_file
from skills.detect.onnx_detector import OnnxDetector
from skills.detect.training.labels import TrainingDataError
from skills.detect.training.options import RefineOptions
from skills.detect.training.refine import TABLE, refine
from skills.detect.training.schedule import Budget, Schedule
from skills.detect.training.together import Report
from skills.detect.training.train import CHECKPOINT, MODEL

THING, FAR = (100, 100, 200, 200), (300, 300, 400, 400)


def write_split(folder: Path, split: str, count: int, names: tuple[str, ...] = CLASSES) -> None:
    """Pictures in which the tiny first network sees a thing and something that is none."""
    images, labels = [], []
    for k in range(count):
        name, of = f"{split}{k}.png", CLASSES[k % 2]
        picture = picture_of((of, 0.6, THING), ("hammer", 0.6, FAR))
        picture[100:200, 100:200] = (30, 200, 100 * (k % 2))
        cv2.imwrite(str(folder / name), cv2.cvtColor(picture, cv2.COLOR_RGB2BGR))
        images.append({"id": k, "file_name": name, "width": 640, "height": 480})
        labels.append({"id": k, "image_id": k, "category_id": 1 + k % 2, "bbox": [100, 100, 100, 100]})
    categories = [{"id": k + 1, "name": name} for k, name in enumerate(names)]
    (folder / f"{split}.json").write_text(
        json.dumps({"images": images, "annotations": labels, "categories": categories})
    )


@pytest.fixture
def options(tmp_path: Path) -> RefineOptions:
    """As a data set and a first network stand after `errand dataset train`."""
    data = tmp_path / "data"
    data.mkdir()
    write_split(data, "train", 4)
    write_split(data, "val", 2)
    first = real_first(tmp_path / "first.onnx")
    return RefineOptions(
        data, first, tmp_path / "out", Budget(pictures=8), examined=2, batch=4, schedule=Schedule(1e-3)
    )


def real_first(file: Path) -> Path:
    """A first network in the form that learning can take over, which sees something everywhere."""
    import torch

    from skills.detect.training.export import export
    from skills.detect.training.network import DetectorNetwork

    torch.manual_seed(0)
    network = DetectorNetwork(len(CLASSES)).eval()
    export(network, file, class_names=CLASSES, facts={}, score_offsets=(4.0,) * len(CLASSES))
    return file


@pytest.mark.parametrize("processes", [1, 2])
def test_a_first_network_gets_a_second_one(options: RefineOptions, processes: int) -> None:
    told = list[Report]()
    file = refine(replace(options, processes=processes), told.append)
    assert file == regions_file(options.out / MODEL)
    model = load_model(options.out / MODEL)
    assert model.second is not None
    assert len(OnnxDetector(model).detect([picture_of()])) == 1
    assert told[-1].progress == 1.0
    assert told[-1].figures is not None
    assert {path.name for path in options.out.iterdir()} >= {CHECKPOINT, MODEL, TABLE, "curves.png", "pictures"}


def test_it_goes_on_where_it_stood(options: RefineOptions) -> None:
    refine(options, lambda _: None)
    told = list[Report]()
    refine(replace(options, budget=Budget(pictures=16), resume=True), told.append)
    assert [report.steps for report in told if report.figures] == [3, 4]


def test_a_network_of_other_classes_is_refused(options: RefineOptions) -> None:
    for split in ("train", "val"):
        write_split(options.data, split, 4, names=("beer", "coke", "wrench"))
    with pytest.raises(TrainingDataError, match="knows other classes"):
        refine(options, lambda _: None)


def test_a_network_that_finds_nothing_is_refused(options: RefineOptions, tmp_path: Path) -> None:
    blind = write_model(tmp_path / "blind.onnx")
    for file in options.data.glob("*.png"):
        cv2.imwrite(str(file), picture_of())
    with pytest.raises(TrainingDataError, match="finds nothing"):
        refine(replace(options, model=blind), lambda _: None)


def test_a_file_that_is_no_network_is_refused(options: RefineOptions) -> None:
    (options.data / "none.onnx").write_bytes(b"none")
    with pytest.raises(TrainingDataError, match=r"none\.onnx.*damaged or no ONNX file"):
        refine(replace(options, model=options.data / "none.onnx"), lambda _: None)
