"""Exact byte products of the processor."""

import numpy as np
import pytest
from onnxruntime import InferenceSession, SessionOptions

from skills.perception.detector.model_files import MODEL_FILE, has_exact_byte_products, load_model
from tests.tables import table


@pytest.mark.parametrize(*table(__file__, "flags"))
def test_exact_byte_products_need_the_flag_of_all_cores(tmp_path, told, able):
    file = tmp_path / "cpuinfo"
    file.write_text(told)
    assert has_exact_byte_products(file) is able


def test_exact_byte_products_are_not_assumed_without_flags(tmp_path):
    assert not has_exact_byte_products(tmp_path / "none")


def test_detections_here_equal_those_with_exact_sums():
    exact = SessionOptions()
    exact.add_session_config_entry("session.x64quantprecision", "1")
    given = {"images": np.random.default_rng(3).integers(0, 256, (1, 480, 640, 3), dtype=np.uint8)}
    said = load_model(networks=1).proposal.session.run(None, given)
    expected = InferenceSession(str(MODEL_FILE), exact).run(None, given)
    for mine, theirs in zip(said, expected, strict=True):
        assert np.allclose(mine, theirs, atol=1e-3)
