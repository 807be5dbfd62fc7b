"""Catalogues of models that others made are read as they are told: classes, sizes, faces."""

import zipfile

import numpy as np
import pytest

from tests.benchmarks.foreign_models import entries, read_wavefront, supplied

OBJ = """mtllib thing.mtl
v 0 0 0
v 2 0 0
v 2 1 0
v 0 1 0
v 0 0 4
usemtl paint
f 1 2 3 4
f -1 1 2
f 3 4 5
f 1 4 5
f 2 3 5
"""
FACTS = {
    1: ("Hammer", "a/hammer.obj", (30, 5, 12)),
    2: ("Mug", "a/mug.obj", (9, 10, 9)),
    3: ("Wall lamp", "a/lamp.obj", (9, 10, 9)),
    4: ("Wardrobe", "a/wardrobe.obj", (120, 200, 60)),
}


@pytest.fixture
def catalogues(tmp_path):
    folder = tmp_path / "catalogues"
    folder.mkdir()
    lines = []
    with zipfile.ZipFile(folder / "Some.sh3f", "w") as archive:
        for number, (name, path, (width, height, depth)) in FACTS.items():
            archive.writestr(path, OBJ)
            lines += [f"name#{number}={name}", f"model#{number}=/{path}"]
            lines += [f"width#{number}={width}", f"height#{number}={height}", f"depth#{number}={depth}"]
        archive.writestr("a/thing.mtl", "newmtl paint\nKd 0.1 0.2 0.9\n")
        archive.writestr("PluginFurnitureCatalog.properties", "\n".join(lines))
    return folder


def test_a_face_of_four_corners_becomes_two_triangles_and_negative_numbers_count_from_the_end():
    corners = [point for point, _, _ in read_wavefront(OBJ).corners["paint"]]
    assert corners[:9] == [0, 1, 2, 0, 2, 3, 4, 0, 1]


def test_tools_are_of_their_class_small_things_of_none_and_lamps_and_furniture_are_left_out(catalogues):
    # name: category
    expected = {"Hammer": "hammer", "Mug": "other", "Wall lamp": None, "Wardrobe": None}
    assert {entry.name: entry.category for entry in entries(catalogues / "Some.sh3f")} == expected


def test_a_model_has_the_size_that_its_catalogue_tells_with_z_up(catalogues, tmp_path):
    made = supplied(tmp_path / "models", catalogues)
    (hammer,) = made["hammer"]
    assert hammer.size_m == pytest.approx((0.30, 0.12, 0.05))
    np.testing.assert_allclose(np.ptp(hammer.surface.points, axis=0), hammer.size_m, atol=1e-4)
    assert hammer.class_id and not made["other"][0].class_id


def test_without_catalogues_the_package_is_named(tmp_path):
    with pytest.raises(FileNotFoundError, match="install Debian's sweethome3d-furniture"):
        supplied(tmp_path / "models", tmp_path)
