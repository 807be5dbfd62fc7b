"""Going on from an ONNX file; skipped without torch."""

import numpy as np
import pytest
from random_networks import random_network

torch = pytest.importorskip("torch")
pytest.importorskip("onnx")

from errand_train.detector.export import export  # noqa: E402
from errand_train.detector.labels import TrainingDataError  # noqa: E402
from errand_train.detector.onnx_weights import settle, take_over  # noqa: E402
from errand_train.detector.quantisation import write_quantised  # noqa: E402

NAMES = ("beer", "coke", "cube")


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """A network and its file, with scores shifted."""
    network, file = random_network(1, len(NAMES)), tmp_path_factory.mktemp("written") / "made.onnx"
    shift = {"score_offsets": "[0.5, -0.25, 0.0]"}
    export(network, file, class_names=NAMES, facts=shift, score_offsets=(0.5, -0.25, 0.0))
    return network, file


def test_a_network_says_what_the_one_in_the_file_said(written):
    network, file = written
    pictures, other = torch.rand(2, 3, 64, 96), random_network(2, len(NAMES))
    take_over(other, file)
    with torch.no_grad():
        for mine, theirs in zip(other(pictures), network(pictures), strict=True):
            assert torch.allclose(mine, theirs, atol=1e-3)


def test_quantised_weights_dequantise_to_the_original_ones(written, tmp_path):
    network, file = written
    given = {"images": np.random.default_rng(0).integers(0, 256, (1, 480, 640, 3), dtype=np.uint8)}
    write_quantised(file, [given], tmp_path / "8.onnx")
    pictures, other = torch.rand(2, 3, 64, 96), random_network(2, len(NAMES))
    take_over(other, tmp_path / "8.onnx")
    with torch.no_grad():
        for mine, theirs in zip(other(pictures), network(pictures), strict=True):
            assert torch.allclose(mine, theirs, atol=5e-2)


def test_settled_on_pictures_it_says_the_same_and_so_it_does_while_learning_from_them(written):
    network, file = written
    pictures, other = torch.rand(4, 3, 64, 96), random_network(2, len(NAMES))
    take_over(other, file)
    settle(other, [(pictures,)])
    with torch.no_grad():
        expected = network(pictures)
        for mine, theirs in zip(other.eval()(pictures), expected, strict=True):
            assert torch.allclose(mine, theirs, atol=1e-2)
        for mine, theirs in zip(other.train()(pictures), expected, strict=True):
            assert torch.allclose(mine, theirs, atol=5e-2)
    lengths = other.backbone.stem[0][0].weight.flatten(1).norm(dim=1)
    assert torch.allclose(lengths, torch.ones_like(lengths), atol=1e-5)


def test_a_network_of_other_classes_is_refused(written):
    _, file = written
    with pytest.raises(TrainingDataError, match=r"made\.onnx.*another network"):
        take_over(random_network(2, 5), file)
