"""Objects of public catalogues are imported in the size, the mass and the class that are told."""

import zipfile

import pytest
import trimesh

from tests.benchmarks.catalogue_objects import OBJECTS, furniture_file, imported


@pytest.fixture
def box_mm():
    return trimesh.creation.box(extents=(200.0, 30.0, 100.0))


@pytest.fixture
def catalogues(tmp_path, box_mm):
    lines = ["name#1=Hammer", "model#1=/a/hammer.obj", "width#1=20", "height#1=3", "depth#1=10"]
    with zipfile.ZipFile(tmp_path / "Some.sh3f", "w") as archive:
        archive.writestr("a/hammer.obj", trimesh.exchange.obj.export_obj(box_mm))
        archive.writestr("PluginFurnitureCatalog.properties", "\n".join(lines))
    return tmp_path


def test_a_piece_of_furniture_has_the_size_that_its_catalogue_tells(catalogues, tmp_path):
    pytest.importorskip("coacd")
    made = imported("mallet", "Hammer", 0.7, tmp_path / "mallet", class_name="hammer", catalogues=catalogues)
    assert sorted(made.size_m) == pytest.approx([0.03, 0.1, 0.2], rel=0.01)
    assert (made.class_name, made.mass_kg) == ("hammer", 0.7)


def test_a_scan_is_in_metres_with_z_up(box_mm, tmp_path):
    pytest.importorskip("coacd")
    (tmp_path / "box.stl").write_bytes(box_mm.apply_scale(0.001).export(file_type="stl"))
    made = imported("parcel", "box", 0.3, tmp_path / "parcel", tmp_path)
    assert made.size_m == pytest.approx((0.2, 0.03, 0.1), rel=0.01)


def test_a_missing_model_names_the_package(tmp_path):
    with pytest.raises(SystemExit, match="sweethome3d-furniture"):
        furniture_file("Hammer", tmp_path, tmp_path)


def test_half_of_the_objects_are_of_either_catalogue():
    assert [len(objects) for objects in OBJECTS.values()] == [7, 7]
