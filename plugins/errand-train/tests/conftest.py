"""An empty data set, scenes of few models, and small networks."""

import json
from contextlib import contextmanager

import pytest

from errand_train.dataset.objects import numbers


@pytest.fixture
def data(tmp_path):
    """The folder of a data set without pictures."""
    folder = tmp_path / "data"
    folder.mkdir()
    for name in ("train.json", "val.json"):
        (folder / name).write_text(json.dumps({"images": [], "annotations": [], "categories": []}))
    return folder


@pytest.fixture
def few_models(monkeypatch):
    """Scenes of one instance of each class for training, one for validation, and six kinds of distractors."""
    kinds = ("mug", "battery", "pliers", "tissue_box", "food_can", "book")
    monkeypatch.setattr("errand_train.dataset.compose.DISTRACTORS", kinds)
    monkeypatch.setattr("errand_train.dataset.compose.numbers", lambda name, **use: numbers(name, **use)[:1])


@contextmanager
def small_sizes():
    """Gives proposal and refinement networks few channels and blocks."""
    with pytest.MonkeyPatch.context() as patch:
        for name, size in {"STEM": (8, 16), "LEVELS": (16, 24, 32), "NECK": (16, 16, 24), "_DEPTH": 1}.items():
            patch.setattr(f"errand_train.detector.network.{name}", size)
        for name, size in {"LEVELS": (16, 24, 32), "NECK": (16, 16, 24), "_RESIDUALS": (1, 1)}.items():
            patch.setattr(f"errand_train.detector.refinement_network.{name}", size)
        yield


@pytest.fixture(scope="module")
def small_networks():
    """Makes all networks of a file small."""
    with small_sizes():
        yield


@pytest.fixture
def small_network():
    """Makes the networks of one test small."""
    with small_sizes():
        yield


@pytest.fixture
def unwritten(monkeypatch):
    """Replaces a training's ONNX file and figures by nothing; its checkpoint and reports remain."""
    for name in ("export", "offsets_by", "offsets_fact", "examine", "figures_of"):
        monkeypatch.setattr(f"errand_train.detector.train.{name}", lambda *_, **__: {})
    for module in ("train", "refine"):
        monkeypatch.setattr(f"errand_train.detector.{module}.SETTLED_BY", 2)
