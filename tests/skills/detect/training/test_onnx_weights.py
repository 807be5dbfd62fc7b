"""Going on from an ONNX file; skipped without torch."""

from pathlib import Path

import pytest

torch = pytest.importorskip("torch")
pytest.importorskip("onnx")

from skills.detect.training.export import export  # noqa: E402
from skills.detect.training.labels import TrainingDataError  # noqa: E402
from skills.detect.training.network import DetectorNetwork  # noqa: E402
from skills.detect.training.onnx_weights import settle, take_over  # noqa: E402

NAMES = ("beer", "coke", "cube")


def some_network(seed: int, classes: int = len(NAMES)) -> DetectorNetwork:
    """A network of random weights whose normalisation has statistics unlike the first ones."""
    torch.manual_seed(seed)
    network = DetectorNetwork(classes)
    for module in network.modules():
        if isinstance(module, torch.nn.BatchNorm2d):
            module.running_mean.normal_(0.0, 0.1)
            module.running_var.uniform_(0.5, 2.0)
            module.weight.data.uniform_(0.5, 1.5)
            module.bias.data.normal_(0.0, 0.1)
    for head in network.heads:
        head.scores.bias.data.add_(0.1 * torch.randn(classes))
        head.sides.bias.data.add_(0.1 * torch.randn(4))
    return network.eval()


@pytest.fixture
def written(tmp_path: Path) -> tuple[DetectorNetwork, Path]:
    """A network and its file, with scores shifted."""
    network, file = some_network(1), tmp_path / "made.onnx"
    shift = {"score_offsets": "[0.5, -0.25, 0.0]"}
    export(network, file, class_names=NAMES, facts=shift, score_offsets=(0.5, -0.25, 0.0))
    return network, file


def test_a_network_says_what_the_one_in_the_file_said(written: tuple[DetectorNetwork, Path]) -> None:
    network, file = written
    pictures, other = torch.rand(2, 3, 64, 96), some_network(2)
    take_over(other, file)
    with torch.no_grad():
        for mine, theirs in zip(other(pictures), network(pictures), strict=True):
            assert torch.allclose(mine, theirs, atol=1e-3)


def test_settled_on_pictures_it_says_the_same_and_so_it_does_while_learning_from_them(
    written: tuple[DetectorNetwork, Path],
) -> None:
    network, file = written
    pictures, other = torch.rand(4, 3, 64, 96), some_network(2)
    take_over(other, file)
    settle(other, [pictures])
    with torch.no_grad():
        expected = network(pictures)
        for mine, theirs in zip(other.eval()(pictures), expected, strict=True):
            assert torch.allclose(mine, theirs, atol=1e-2)
        for mine, theirs in zip(other.train()(pictures), expected, strict=True):
            assert torch.allclose(mine, theirs, atol=5e-2)
    lengths = other.backbone.stem[0][0].weight.flatten(1).norm(dim=1)
    assert torch.allclose(lengths, torch.ones_like(lengths), atol=1e-5)


def test_a_network_of_other_classes_is_refused(written: tuple[DetectorNetwork, Path]) -> None:
    _, file = written
    with pytest.raises(TrainingDataError, match=r"made\.onnx.*another network"):
        take_over(some_network(2, classes=5), file)
