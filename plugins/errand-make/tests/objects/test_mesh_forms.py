"""Meshes of the forms that other programs write are read right, or refused by their reason."""

import re

import numpy as np
import pytest

pytest.importorskip("trimesh")
pytest.importorskip("coacd")
pytest.importorskip("networkx")

from mesh_forms import FORMS, SIZE_M, exported

from errand_make.objects import STEPS, ImportOptions, ImportReports, ObjectImportError, import_object


def imported(folder, write, name="m.stl", **options):
    """The object that is made of a file, what its import noted, and its steps."""
    notes, steps = [], []
    write(folder / name)
    reports = ImportReports(note=notes.append, step=steps.append)
    return import_object(folder / name, ImportOptions("gadget", **options), folder, reports), notes, steps


def refusal(folder, write, name="m.stl", **options):
    with pytest.raises(ObjectImportError) as error:
        imported(folder, write, name, **options)
    return f"{error.value.message}; {error.value.hint}"


@pytest.mark.parametrize("form", [pytest.param(form, id=name) for name, form in FORMS.items() if not form.refused])
def test_a_mesh_of_another_program_is_the_body_that_was_saved(tmp_path, form):
    made, notes, steps = imported(tmp_path, form.write, form.name, **form.options)
    assert made.size_m == pytest.approx(SIZE_M, abs=2e-5)
    assert made.mass_kg == pytest.approx(600.0 * np.prod(SIZE_M) * form.share, rel=1e-3)
    assert made.com_m == pytest.approx((0.0, 0.0, 0.0), abs=2e-5)
    assert np.linalg.eigvalsh(np.diag(made.inertia_kg_m2[:3]))[0] > 0.0
    assert (len(notes), tuple(steps)) == (form.note is not None, STEPS)
    assert form.note is None or re.search(form.note, notes[0])


@pytest.mark.parametrize("form", [pytest.param(form, id=name) for name, form in FORMS.items() if form.refused])
def test_a_mesh_that_is_no_body_is_refused_by_its_reason(tmp_path, form):
    assert re.search(form.refused, refusal(tmp_path, form.write, form.name, **form.options))


@pytest.mark.parametrize("name", ["OBJ with a picture", "COLLADA in centimetres, y up"])
def test_the_picture_of_a_mesh_becomes_its_texture(tmp_path, name):
    imported(tmp_path, FORMS[name].write, FORMS[name].name)
    assert "map_Kd surface_000.png" in (tmp_path / "gadget.mtl").read_text()


def test_an_unusual_size_is_doubted_with_the_units_that_fit(tmp_path):
    _, (note,), _ = imported(tmp_path, exported(scale=25.0), mass_kg=5.0)
    assert note.startswith("it is 3 m long") and "0.0254 if its unit is inches (0.0762 m long)" in note


@pytest.mark.parametrize(
    ("scale", "said"), [(25.0, "weighs 5.4e.03 kg.*0.0254 if its unit"), (0.05, "weighs 4.32e-05 kg")]
)
def test_a_volume_that_no_object_has_is_refused_with_the_units_that_fit(tmp_path, scale, said):
    assert re.search(said, refusal(tmp_path, exported(scale=scale)))
