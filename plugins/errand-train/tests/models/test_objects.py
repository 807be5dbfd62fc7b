"""The shipped models: their masses, and files that equal those that are made."""

import numpy as np
import pytest

from errand_make.shapes import Cylinder
from errand_train.dataset.objects.forms import FORMS, write_forms
from errand_train.models import objects
from errand_train.models.__main__ import build
from errand_train.models.mass import join_masses, shape_mass
from tests.sources import ROOT


def test_the_hammer_is_heavy_at_its_head():
    assert objects.hammer().mass.com[0] > 0.05


def test_mass_properties_follow_the_parallel_axis_theorem():
    halves = [Cylinder(radius=0.01, length=0.2, p=(0, 0, z)) for z in (0.1, -0.1)]
    both = shape_mass(Cylinder(radius=0.01, length=0.4), 2.0)
    whole = join_masses([shape_mass(half, 1.0) for half in halves])
    np.testing.assert_allclose(whole.com, 0.0, atol=1e-12)
    np.testing.assert_allclose(whole.inertia, both.inertia, rtol=1e-9, atol=1e-15)


def test_mass_properties_without_mass_are_refused():
    with pytest.raises(ValueError, match="no mass"):
        join_masses([shape_mass(Cylinder(radius=0.01, length=0.2), 0.0)])


@pytest.mark.parametrize(("write", "files"), [(build, 20), (write_forms, 3 * len(FORMS))])
def test_committed_files_equal_those_that_are_made(write, files, tmp_path, monkeypatch):
    monkeypatch.setattr("errand_train.models.__main__.save_png", lambda *_: None)  # its bytes are the library's
    write(tmp_path)
    written = [path for path in tmp_path.rglob("*") if path.suffix in (".sdf", ".obj", ".mtl")]
    assert len(written) == files
    for path in written:
        committed = ROOT / "plant" / "models" / path.relative_to(tmp_path)
        assert committed.read_text(encoding="utf-8") == path.read_text(encoding="utf-8"), committed
