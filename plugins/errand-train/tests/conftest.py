"""An empty data set, and scenes of few models."""

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
