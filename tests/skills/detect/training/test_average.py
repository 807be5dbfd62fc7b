"""The mean of several networks' files; skipped without torch."""

import json
from pathlib import Path

import numpy as np
import pytest
from random_networks import random_network
from tiny_detector import CLASSES

pytest.importorskip("torch")
onnx = pytest.importorskip("onnx")

from skills.detect.detector_file import load_model  # noqa: E402
from skills.detect.training.average import average, main  # noqa: E402
from skills.detect.training.eight_bits import write_in_eight_bits  # noqa: E402
from skills.detect.training.export import export  # noqa: E402
from skills.detect.training.labels import TrainingDataError  # noqa: E402
from skills.detect.training.onnx_files import learnt_weights  # noqa: E402


def written(file: Path, seed: int, shift: float = 0.0, names: tuple[str, ...] = CLASSES) -> Path:
    told = {"score_offsets": json.dumps([shift] * len(names))}
    export(random_network(seed, len(names)), file, class_names=names, facts=told, score_offsets=(shift,) * len(names))
    return file


def weights_of(file: Path) -> dict[str, np.ndarray]:
    return {one.name: onnx.numpy_helper.to_array(one) for one in onnx.load(file).graph.initializer}


def test_each_weight_is_the_mean_and_so_is_the_shift_of_scores(tmp_path: Path) -> None:
    one, other = written(tmp_path / "1.onnx", 1, 0.5), written(tmp_path / "2.onnx", 2, -0.1)
    average([one, other], tmp_path / "mean.onnx")
    found, first, second = (weights_of(file) for file in (tmp_path / "mean.onnx", one, other))
    learnt = [name for name in first if name.startswith("network.")]
    assert len(learnt) > 50
    for name in learnt:
        assert np.allclose(found[name], (first[name] + second[name]) / 2, atol=1e-6)
    told = load_model(tmp_path / "mean.onnx").first.metadata["score_offsets"]
    assert json.loads(told) == pytest.approx([0.2] * len(CLASSES))


def test_the_mean_of_a_network_with_itself_says_the_same(tmp_path: Path) -> None:
    one = written(tmp_path / "1.onnx", 1)
    average([one, one], tmp_path / "mean.onnx")
    given = {"images": np.random.default_rng(0).integers(0, 256, (1, 480, 640, 3), dtype=np.uint8)}
    said, expected = (load_model(file).first.session.run(None, given) for file in (tmp_path / "mean.onnx", one))
    assert all(np.array_equal(mine, theirs) for mine, theirs in zip(said, expected, strict=True))


def test_a_network_of_other_classes_is_refused_and_nothing_written(tmp_path: Path) -> None:
    one, other = written(tmp_path / "1.onnx", 1), written(tmp_path / "2.onnx", 2, names=("beer", "coke"))
    with pytest.raises(TrainingDataError, match=r"2\.onnx.*another network than.*1\.onnx"):
        average([one, other], tmp_path / "mean.onnx")
    assert not (tmp_path / "mean.onnx").exists()


def test_a_network_in_8_bits_takes_part_and_what_is_written_reckons_with_floats(tmp_path: Path) -> None:
    one, other = written(tmp_path / "1.onnx", 1), in_8_bits(written(tmp_path / "2.onnx", 2))
    average([other, one], tmp_path / "mean.onnx")
    assert set(weights_of(tmp_path / "mean.onnx")) == set(weights_of(one))
    found, first, second = (learnt_weights(onnx.load(file)) for file in (tmp_path / "mean.onnx", one, other))
    for name, weights in first.items():
        assert np.allclose(found[name], (weights + second[name].astype(np.float32)) / 2, atol=1e-6)


def test_networks_in_8_bits_alone_have_no_mean(tmp_path: Path) -> None:
    one = in_8_bits(written(tmp_path / "1.onnx", 1))
    with pytest.raises(TrainingDataError, match=r"1\.onnx.*8 bits"):
        average([one, one], tmp_path / "mean.onnx")


def in_8_bits(file: Path) -> Path:
    given = {"images": np.random.default_rng(0).integers(0, 256, (1, 480, 640, 3), dtype=np.uint8)}
    write_in_eight_bits(file, [given], file)
    return file


def test_a_damaged_file_is_named_and_ends_with_2(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "none.onnx").write_bytes(b"none")
    monkeypatch.setattr("sys.argv", ["average", str(tmp_path / "none.onnx"), "--out", str(tmp_path / "mean.onnx")])
    assert main() == 2
    assert "none.onnx" in capsys.readouterr().err
