"""Meshes of other programs: units, axes, triangles that look inward, and files that are no mesh."""

import os
import struct

import numpy as np
import pytest

pytest.importorskip("trimesh")
pytest.importorskip("coacd")

import trimesh
from mesh_forms import SIZE_M, collada, png, text

from errand_make.objects import ImportOptions, ObjectImportError, import_object
from errand_make.objects.solid import solid_of
from tests.tables import table


def imported(path, folder, **wanted):
    folder.mkdir()
    return import_object(path, ImportOptions(**{"name": "gadget", "mass_kg": 0.6, **wanted}), folder)


def refusal(path, folder, **wanted):
    with pytest.raises(ObjectImportError) as error:
        imported(path, folder, **wanted)
    assert error.value.hint
    return error.value


@pytest.mark.parametrize("kind", ["triangles", "polylist"])
@pytest.mark.parametrize(("meter", "up"), [(0.01, "Z_UP"), (0.001, "Y_UP"), (1.0, "X_UP")])
def test_a_collada_file_has_its_unit_and_its_axis(tmp_path, kind, meter, up):
    text(collada(meter, up, kind=kind), skin_png=png((200, 30, 30)))(tmp_path / "box.dae")
    assert imported(tmp_path / "box.dae", tmp_path / "model").size_m == pytest.approx(SIZE_M, abs=1e-6)
    assert "map_Kd surface_000.png" in (tmp_path / "model/gadget.mtl").read_text()


def test_a_collada_node_moves_and_scales_its_geometry(tmp_path):
    node = "<translate>5 0 0</translate><rotate>0 0 1 90</rotate><scale>2 1 -1</scale>"
    (tmp_path / "box.dae").write_text(collada(up="Z_UP", node=node))
    made = imported(tmp_path / "box.dae", tmp_path / "model")
    assert made.size_m == pytest.approx((0.08, 0.12, 0.12), abs=1e-6)


@pytest.mark.parametrize(*table(__file__, "broken_collada"))
def test_a_broken_collada_file_is_refused_with_the_reason(tmp_path, old, new, said):
    (tmp_path / "box.dae").write_text(new if old is None else collada().replace(old, new))
    assert said in refusal(tmp_path / "box.dae", tmp_path / "model").message


@pytest.mark.parametrize(
    ("scale", "units"),
    [
        (1.0, ["0.01 if its unit is centimetres (0.12 m long)", "0.0254 if its unit is inches (0.305 m long)"]),
        (10.0, ["0.001 if its unit is millimetres (0.12 m long)"]),
    ],
)
def test_the_unit_is_guessed_by_the_size(tmp_path, scale, units):
    trimesh.creation.box((6 * scale, 6 * scale, 12 * scale)).export(tmp_path / "box.stl")
    hint = refusal(tmp_path / "box.stl", tmp_path / "model").hint
    assert [unit for unit in units if unit not in hint] == []
    assert ("millimetres" in hint) is (scale == 10.0)


def test_triangles_that_look_inward_are_turned(tmp_path):
    box = trimesh.creation.box(SIZE_M)
    for index, wrong in enumerate(([0], [3, 7], list(range(12)), [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10])):
        mesh = box.copy()
        mesh.faces[wrong] = mesh.faces[wrong][:, ::-1]
        mesh.export(tmp_path / "flipped.stl")
        made = imported(tmp_path / "flipped.stl", tmp_path / f"model{index}")
        expected = 0.6 / 12 * np.array([0.08**2 + 0.12**2, 0.06**2 + 0.12**2, 0.06**2 + 0.08**2])
        np.testing.assert_allclose(made.inertia_kg_m2[:3], expected, rtol=1e-3)


def triangles_of(mesh):
    return np.asarray(mesh.triangles, dtype=float)


def test_pieces_that_are_inside_out_count_and_hollows_stay_hollow():
    outer, apart = trimesh.creation.box((1, 1, 1)), trimesh.creation.box((0.5, 0.5, 0.5))
    apart.apply_translation((2, 0, 0))
    apart.invert()
    solid, turned = solid_of(np.vstack([triangles_of(outer), triangles_of(apart)]))
    assert (solid.volume_m3, turned.tolist()) == (pytest.approx(1.125), [False] * 12 + [True] * 12)
    hollow = trimesh.creation.box((0.5, 0.5, 0.5))
    for inner in (hollow, hollow.copy()):
        assert solid_of(np.vstack([triangles_of(outer), triangles_of(inner)]))[0].volume_m3 == pytest.approx(0.875)
        hollow.invert()


def test_a_git_lfs_pointer_and_a_pipe_are_refused(tmp_path):
    (tmp_path / "lfs.stl").write_text("version https://git-lfs.github.com/spec/v1\noid sha256:1\nsize 9\n")
    assert "git lfs pull" in refusal(tmp_path / "lfs.stl", tmp_path / "model").hint
    os.mkfifo(tmp_path / "pipe.stl")
    assert "pipe" in refusal(tmp_path / "pipe.stl", tmp_path / "other").message


def test_a_huge_picture_of_a_mesh_is_refused_by_its_head(tmp_path):
    size = struct.pack(">IIBBBBB", 13_000, 13_000, 8, 2, 0, 0, 0)
    (tmp_path / "a.png").write_bytes(b"\x89PNG\r\n\x1a\n" + struct.pack(">I", 13) + b"IHDR" + size + b"\0" * 8)
    (tmp_path / "a.mtl").write_text("newmtl a\nmap_Kd a.png\n")
    (tmp_path / "a.obj").write_text("mtllib a.mtl\nusemtl a\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    assert "13000 x 13000 pixels" in refusal(tmp_path / "a.obj", tmp_path / "model").message
