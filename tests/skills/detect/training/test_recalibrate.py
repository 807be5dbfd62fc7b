"""Scores of a detector's last network, shifted anew."""

import json
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
from tiny_detector import CLASSES, picture_of, write_model, write_pair, write_three

onnx = pytest.importorskip("onnx")

from skills.detect.detector_file import load_model, regions_file, third_file  # noqa: E402
from skills.detect.training.labels import TrainingDataError  # noqa: E402
from skills.detect.training.onnx_files import facts_of, offsets_in, write_sealed  # noqa: E402
from skills.detect.training.recalibrate import main, recalibrate, shift_scores  # noqa: E402

BOX = (100.0, 100.0, 200.0, 200.0)
BEERS = 24
BIAS = "network.scores.bias"


def with_bias(file: Path) -> Path:
    """Give a tiny second or third network biases of its scores, 0.25 of the first class."""
    network = onnx.load(file)
    values = np.array([0.25, 0.0, 0.0], dtype=np.float32)
    network.graph.initializer.append(onnx.numpy_helper.from_array(values, BIAS))
    write_sealed(network, file, facts_of(network))
    return file


def bias_in(file: Path) -> list[float]:
    (bias,) = (one for one in onnx.load(file).graph.initializer if one.name == BIAS)
    return [float(value) for value in onnx.numpy_helper.to_array(bias)]


@pytest.fixture
def data(tmp_path: Path) -> Path:
    """Pictures with a beer each, of which the tiny networks tell a score of 0.2."""
    folder = tmp_path / "data"
    folder.mkdir()
    picture = picture_of(("beer", 0.4, BOX))
    picture[100:200, 100:200, 0] = 51
    images = [{"id": k, "file_name": f"{k}.png", "width": 640, "height": 480} for k in range(BEERS)]
    for image in images:
        cv2.imwrite(str(folder / str(image["file_name"])), picture[..., ::-1])
    label = {"category_id": 0, "bbox": [100, 100, 100, 100], "area": 10000, "visibility": 1.0, "truncation": 0.0}
    labels = [{"id": k, "image_id": k, "iscrowd": 0, "ignore": 0, "distance_m": 1.0, **label} for k in range(BEERS)]
    categories = [{"id": k, "name": name} for k, name in enumerate(CLASSES)]
    told = {"images": images, "annotations": labels, "categories": categories}
    (folder / "train.json").write_text(json.dumps(told))
    return folder


# networks -> whose file is changed
@pytest.mark.parametrize(("write", "last"), [(write_pair, regions_file), (write_three, third_file)])
def test_the_last_network_tells_higher_scores_of_what_it_is_unsure_of_and_right(
    tmp_path: Path, data: Path, write: Callable[[Path], Path], last: Callable[[Path], Path]
) -> None:
    first = write(tmp_path / "detector.onnx")
    changed = with_bias(last(first))
    kept = {file: file.read_bytes() for file in (first, regions_file(first)) if file != changed}
    assert recalibrate(first, data) == changed
    offset, *others = offsets_in(facts_of(onnx.load(changed)), len(CLASSES))
    assert 0.0 < offset < 3.0
    assert others == [0.0, 0.0]  # too few labels to tell
    assert bias_in(changed) == pytest.approx([0.25 + offset, 0.0, 0.0], abs=1e-4)
    assert {file: file.read_bytes() for file in kept} == kept
    load_model(first)


def test_what_was_added_before_is_told_too(tmp_path: Path) -> None:
    file = with_bias(regions_file(write_pair(tmp_path / "detector.onnx")))
    shift_scores(file, (0.5, 0.0, -0.25))
    shift_scores(file, (0.25, 0.0, 1.0))
    assert offsets_in(facts_of(onnx.load(file)), len(CLASSES)) == [0.75, 0.0, 0.75]
    assert bias_in(file) == [1.0, 0.0, 0.75]


def test_a_file_without_scores_to_shift_is_refused_and_stays(tmp_path: Path) -> None:
    file = regions_file(write_pair(tmp_path / "detector.onnx"))
    before = file.read_bytes()
    with pytest.raises(TrainingDataError, match="no scores to shift"):
        shift_scores(file, (0.5, 0.0, 0.0))
    assert file.read_bytes() == before


def test_a_detector_of_one_network_is_refused(tmp_path: Path, data: Path) -> None:
    with pytest.raises(TrainingDataError, match=r"detector\.onnx.*no second network"):
        recalibrate(write_model(tmp_path / "detector.onnx"), data)


def test_a_missing_file_is_named_and_ends_with_2(
    tmp_path: Path, data: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("sys.argv", ["recalibrate", str(tmp_path / "none.onnx"), "--data", str(data)])
    assert main() == 2
    assert "none.onnx" in capsys.readouterr().err
