"""Meshes: tiling of textures, outward surfaces, and the OBJ and material files."""

import re

import numpy as np
import pytest

from errand_make.mesh import Material, Mesh, mtl_text, obj_text, palette_picture, palette_uv, unique_rows

MATERIALS = {
    "tiles": Material(texture="tiles.png", tile_m=(0.5, 0.5)),
    "red": Material((1.0, 0.0, 0.0)),
    "blue": Material((0.0, 0.0, 1.0)),
}


def groups(mesh):
    return {name: (points, normals, uvs) for name, points, normals, uvs in mesh.groups()}


def test_a_rectangle_larger_than_its_texture_is_cut_into_tiles():
    mesh = Mesh(MATERIALS)
    mesh.add_rectangle("tiles", (0, 0, 0), (1.2, 0, 0), (0, 0.5, 0))
    points, normals, uvs = groups(mesh)["tiles"]
    assert len(points) == 3 * 6 and uvs.min() >= 0.0 and uvs.max() <= 1.0 + 1e-9
    np.testing.assert_allclose(normals, np.tile([0.0, 0.0, 1.0], (18, 1)))
    assert area(points) == pytest.approx(0.6)


def area(points):
    a, b, c = points[0::3], points[1::3], points[2::3]
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)


def add_box(mesh):
    mesh.add_box("red", (-1, -1, -1), (1, 1, 1))


def add_ball(mesh):
    angle = np.linspace(-np.pi / 2, np.pi / 2, 9)
    mesh.add_lathe("red", [(float(np.cos(a)), float(np.sin(a))) for a in angle])


@pytest.mark.parametrize("add", [add_box, add_ball])
def test_closed_shapes_look_outward(add):
    add(mesh := Mesh(MATERIALS))
    points, normals, _ = groups(mesh)["red"]
    a, b, c = points[0::3], points[1::3], points[2::3]
    faces = np.cross(b - a, c - a)
    solid = np.linalg.norm(faces, axis=1) > 1e-9
    for outward in (a + b + c, normals[0::3]):
        assert np.all(np.sum(faces * outward, axis=1)[solid] > 0)


def test_a_turned_mesh_keeps_unit_normals_that_stay_square_to_it():
    part, mesh = Mesh(MATERIALS), Mesh(MATERIALS)
    part.add_rectangle("red", (0, 0, 0), (1, 0, 1), (0, 1, 0))
    mesh.add_mesh(part, np.diag([2.0, 1.0, 0.5]), (1, 2, 3))
    points, normals, _ = groups(mesh)["red"]
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0)
    np.testing.assert_allclose((points[1] - points[0]) @ normals[0], 0.0, atol=1e-12)
    np.testing.assert_allclose(points.min(axis=0), [1, 2, 3])


def test_an_unknown_material_is_refused():
    with pytest.raises(KeyError, match="no material 'gold'"):
        Mesh(MATERIALS).add_box("gold", (0, 0, 0), (1, 1, 1))


def test_plain_colours_share_the_palette_and_find_their_cell():
    mesh = Mesh(MATERIALS)
    mesh.add_box("red", (0, 0, 0), (1, 1, 1))
    mesh.add_box("blue", (2, 0, 0), (3, 1, 1))
    assert re.findall(r"usemtl (\w+)", obj_text(mesh, "m.mtl")) == ["palette"]
    picture = palette_picture(MATERIALS)
    for index, colour in enumerate(((0, 0, 255), (255, 0, 0))):
        u, v = palette_uv(index)
        row, column = int((1 - v) * picture.shape[0]), int(u * picture.shape[1])
        assert tuple(picture[row, column]) == colour


def test_faces_point_at_lines_that_exist():
    mesh = Mesh(MATERIALS)
    add_box(mesh)
    mesh.add_rectangle("tiles", (0, 0, 2), (1, 0, 0), (0, 1, 0))
    text = obj_text(mesh, "m.mtl")
    counts = [len(re.findall(rf"^{key} ", text, re.MULTILINE)) for key in ("v", "vt", "vn")]
    corners = np.array([[int(k) for k in c.split("/")] for c in re.findall(r"\d+/\d+/\d+", text)])
    assert (corners.min(), tuple(corners.max(axis=0))) == (1, tuple(counts))


def test_the_material_file_has_only_used_materials():
    add_box(mesh := Mesh(MATERIALS))
    text = mtl_text(mesh, "palette.png")
    assert [name in text for name in ("palette.png", "tiles.png")] == [True, False]


def test_the_first_of_equal_rows_is_found_in_order_with_the_place_of_each():
    rows = np.array([[1.0, 2.0], [0.0, 3.0], [1.0, 2.0], [0.0, 1.0]])
    first, place = unique_rows(rows)
    assert first.tolist() == [3, 1, 0] and (rows[first][place] == rows).all()
    assert [len(each) for each in unique_rows(np.empty((0, 3)))] == [0, 0]
