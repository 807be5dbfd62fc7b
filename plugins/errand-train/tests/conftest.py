"""An empty data set, scenes of few models, and small networks."""

import json

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


def small_sizes():
    """Gives proposal and refinement networks few channels and blocks."""
    sizes = {"STEM": (8, 16), "LEVELS": (16, 24, 32), "NECK": (16, 16, 24), "_DEPTH": 1, "_RESIDUALS": (1, 1)}
    with pytest.MonkeyPatch.context() as patch:
        for name, size in sizes.items():
            for module in ("network", "refinement_network"):
                patch.setattr(f"errand_train.detector.{module}.{name}", size, raising=False)
        yield


small_networks, small_network = pytest.fixture(scope="module")(small_sizes), pytest.fixture(small_sizes)


@pytest.fixture
def unwritten(monkeypatch):
    """Replaces a training's ONNX file and figures by nothing; its checkpoint and reports remain."""
    for name in ("export", "offsets_by", "offsets_fact", "examine", "figures_of"):
        monkeypatch.setattr(f"errand_train.detector.train.{name}", lambda *_, **__: {})
    for module in ("train", "refine"):
        monkeypatch.setattr(f"errand_train.detector.{module}.SETTLED_BY", 2)
