"""Folders of imported objects are read back, and damaged ones are refused."""

import re

import pytest

from plant.models.catalogue import ImportedObject, read_imported
from skills.inputs.errors import InputError
from tests.tables import table

DRILL = ImportedObject(
    name="drill",
    class_name="wrench",
    mass_kg=1.2,
    size_m=(0.2, 0.06, 0.04),
    com_m=(0.01, 0.0, 0.0),
    inertia_kg_m2=(5.2e-4, 4.16e-3, 4.36e-3, 0.0, 1e-12, 0.0),
    collision_parts=3,
    triangles=120,
)


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "drill.sdf").write_text("<sdf/>")
    DRILL.write(tmp_path)
    return tmp_path


def test_a_written_object_is_read_back(folder):
    assert read_imported(folder) == DRILL


def test_its_form_lies_in_the_folder_and_rests_at_half_its_height(folder):
    form = DRILL.form(folder)
    assert form.path() == folder / "drill.sdf"
    assert (form.half_extents_m, form.rest_height_m, form.round) == ((0.1, 0.03), 0.02, False)


@pytest.mark.parametrize(*table(__file__, "damaged"))
def test_a_damaged_folder_is_refused_with_its_place(folder, old, new, why):
    facts = folder / "object.yaml"
    facts.write_text(facts.read_text().replace(old, new, 1))
    with pytest.raises(InputError, match=f"{re.escape(str(folder))}.*{why}.*`errand object import`"):
        read_imported(folder)


def test_a_folder_without_one_is_refused(tmp_path):
    with pytest.raises(InputError, match=r"there is no imported object \(object.yaml is missing\)"):
        read_imported(tmp_path)
