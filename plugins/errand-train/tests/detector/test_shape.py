"""Training of the shape model."""

import numpy as np
import pytest

from errand_train.detector.shape import NAMES, accuracy, clusters_of, fit, table_of, write
from skills.perception import shape_model


def test_the_fit_separates_classes_that_differ():
    rng = np.random.default_rng(3)
    y = rng.integers(0, 3, 300)
    x = rng.normal(0.0, 0.3, (300, 5))
    x[np.arange(300), y] += 2.0
    model = fit(x[:200], y[:200], seed=1)
    assert accuracy(model, x[200:], y[200:]) > 0.95
    assert model.names == NAMES


@pytest.mark.parametrize("for_training", [True, False])
def test_the_clusters_of_a_scene_have_a_class_and_features(for_training):
    found = clusters_of(1, 0, for_training=for_training)
    x, y = table_of([found])
    assert len(found) > 5
    assert x.shape == (len(found), len(shape_model.shape_model().mean))
    assert np.isfinite(x).all() and y.max() < len(NAMES)


def test_a_written_model_is_read_back(tmp_path, monkeypatch):
    x, y = np.random.default_rng(1).normal(size=(60, 4)), np.arange(60) % len(NAMES)
    model = fit(x, y, seed=1)
    write(model, tmp_path / "shapes.npz")
    monkeypatch.setattr(shape_model, "MODEL_FILE", tmp_path / "shapes.npz")
    shape_model.shape_model.cache_clear()
    again = shape_model.shape_model()
    shape_model.shape_model.cache_clear()
    assert again.likelihoods(x[0]) == pytest.approx(model.likelihoods(x[0]), rel=1e-3)
