"""The measure of own objects asks and counts."""

import numpy as np
import pytest

from executive.app.worlds import open_world
from skills.detection import NoDetector
from skills.perception.model_detector import ModelDetector
from tests.benchmarks import own_objects
from tests.benchmarks.own_objects import Asked, ask, imported, scene, summary


def test_a_generated_object_is_asked_for_among_others(tmp_path, monkeypatch):
    pytest.importorskip("trimesh")
    monkeypatch.setattr(own_objects, "foreign", lambda folder, half: [])
    monkeypatch.setattr(own_objects, "OBJECTS", 5)
    pool = imported(tmp_path, 0)
    assert len(pool) == 8
    made = scene(np.random.default_rng(4802), open_world("flat"), pool[0], pool)
    assert made is not None and made.absent in {model.name for model in pool[1:5]}
    asked = ask(made, 0, pool[0].name, ModelDetector(NoDetector(), pool[:5]), tmp_path, 4802)
    assert (asked.there, asked.mistaken) == (True, False), asked.message


def test_shares_count_found_and_mistaken_objects():
    rows = [("mug", True, True, False), ("mug", True, False, True), ("cup", False, False, False)]
    counts = summary([Asked(name, 0, there, found, wrong, "", 1.0) for name, there, found, wrong in rows])
    assert (counts["asked"], counts["found"], counts["mistaken_of_there"]) == (2, 0.5, 0.5)
    assert (counts["absent"], counts["mistaken_of_absent"], counts["by_object"]) == (1, 0.0, {"mug": "1/2"})
