"""The measure of own objects asks and counts."""

from itertools import islice
from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("trimesh")

from skills.detection import NoDetector
from skills.perception.model_matching import ModelDetector
from tests.benchmarks import own_objects
from tests.benchmarks.own_objects import ask, by_photographs, generated, imported, scene, summary


def test_a_generated_object_is_asked_for_among_others(tmp_path, monkeypatch):
    monkeypatch.setattr(own_objects, "foreign", lambda folder, half: [])
    monkeypatch.setattr(own_objects, "OBJECTS", 5)
    pool = imported(tmp_path, 0)
    assert len(pool) == 8
    made = scene(np.random.default_rng(4802), pool[0], pool)
    assert made is not None and made.absent in {model.name for model in pool[1:5]}
    asked = ask(made, 0, pool[0].name, ModelDetector(NoDetector(), pool[:5]), tmp_path, 4802)
    assert (asked.there, asked.mistaken) == (True, False), asked.message


def test_photographs_of_an_object_become_a_model_of_its_size(tmp_path, monkeypatch):
    monkeypatch.setattr(own_objects, "foreign", lambda folder, half: [])
    monkeypatch.setattr(own_objects, "generated", lambda folder, half: islice(generated(folder, half), 1))
    monkeypatch.setattr(own_objects, "STANDING", 3)
    monkeypatch.setattr(own_objects, "LYING", 1)
    (mug,) = imported(tmp_path, 0)
    (seen,) = by_photographs(tmp_path, [mug])
    assert np.ptp(seen.points, axis=0) == pytest.approx(np.ptp(mug.points, axis=0), abs=3e-3)
    assert len(seen.views) == 6
    blue = seen.views[seen.views[..., 3] > 127][:, :3].mean(axis=0)
    assert blue[2] > 1.5 * blue[0]


def test_shares_count_found_and_mistaken_objects():
    names = ("name", "there", "found", "mistaken", "wall_s")
    rows = [("mug", True, True, False, 1.0), ("mug", True, False, True, 1.0), ("cup", False, False, False, 1.0)]
    counts = summary([SimpleNamespace(**dict(zip(names, row, strict=True))) for row in rows])
    assert (counts["asked"], counts["found"], counts["mistaken_of_there"]) == (2, 0.5, 0.5)
    assert (counts["absent"], counts["mistaken_of_absent"], counts["by_object"]) == (1, 0.0, {"mug": "1/2"})
