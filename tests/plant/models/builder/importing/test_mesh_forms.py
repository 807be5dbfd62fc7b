"""Meshes of the forms that other programs write are read right, or refused by their reason."""

import re

import numpy as np
import pytest

pytest.importorskip("trimesh")
pytest.importorskip("coacd")
pytest.importorskip("networkx")

from plant.models.builder.importing import STEPS, ImportOptions, ImportReports, ObjectImportError, import_object
from tests.plant.models.builder.importing.mesh_forms import FORMS, SIZE_M, exported


@pytest.mark.parametrize("name", [name for name, form in FORMS.items() if form.refused is None])
def test_a_mesh_of_another_program_is_the_body_that_was_saved(tmp_path, name):
    form, notes, folder = FORMS[name], list[str](), tmp_path / "model"
    path = tmp_path / form.name
    form.write(path)
    folder.mkdir()
    made = import_object(path, ImportOptions("gadget", **form.options), folder, ImportReports(note=notes.append))
    assert made.size_m == pytest.approx(SIZE_M, abs=2e-5)
    assert made.mass_kg == pytest.approx(600.0 * np.prod(SIZE_M) * form.share, rel=1e-3)
    assert made.com_m == pytest.approx((0.0, 0.0, 0.0), abs=2e-5)
    assert np.linalg.eigvalsh(np.diag(made.inertia_kg_m2[:3]))[0] > 0.0
    assert len(notes) == (form.note is not None)
    assert form.note is None or re.search(form.note, notes[0])


@pytest.mark.parametrize("name", [name for name, form in FORMS.items() if form.refused is not None])
def test_a_mesh_that_is_no_body_is_refused_by_its_reason(tmp_path, name):
    form = FORMS[name]
    path = tmp_path / form.name
    form.write(path)
    with pytest.raises(ObjectImportError) as error:
        import_object(path, ImportOptions("gadget", **form.options), tmp_path)
    assert re.search(str(form.refused), f"{error.value.message}; {error.value.hint}")


@pytest.mark.parametrize("name", ["OBJ with a picture", "COLLADA in centimetres, y up"])
def test_the_picture_of_a_mesh_becomes_its_texture(tmp_path, name):
    path = tmp_path / FORMS[name].name
    FORMS[name].write(path)
    import_object(path, ImportOptions("gadget"), tmp_path)
    assert "map_Kd surface_000.png" in (tmp_path / "gadget.mtl").read_text()


def test_an_import_reports_its_steps(tmp_path):
    FORMS["binary STL"].write(tmp_path / "m.stl")
    steps = list[str]()
    import_object(tmp_path / "m.stl", ImportOptions("gadget"), tmp_path, ImportReports(step=steps.append))
    assert tuple(steps) == STEPS


def test_an_unusual_size_is_doubted_with_the_units_that_fit(tmp_path):
    notes = list[str]()
    exported(scale=25.0)(tmp_path / "m.stl")
    options = ImportOptions("gadget", mass_kg=5.0)
    import_object(tmp_path / "m.stl", options, tmp_path, ImportReports(note=notes.append))
    (note,) = notes
    assert note.startswith("it is 3 m long") and "0.0254 if its unit is inches (0.0762 m long)" in note


@pytest.mark.parametrize(
    ("scale", "said"), [(25.0, "weighs 5.4e.03 kg.*0.0254 if its unit"), (0.05, "weighs 4.32e-05 kg")]
)
def test_a_volume_that_no_object_has_is_refused_with_the_units_that_fit(tmp_path, scale, said):
    exported(scale=scale)(tmp_path / "m.stl")
    with pytest.raises(ObjectImportError) as error:
        import_object(tmp_path / "m.stl", ImportOptions("gadget"), tmp_path)
    assert re.search(said, f"{error.value.message}; {error.value.hint}")
