"""Meshes of other programs: units, axes, triangles that look inward, and files that are no mesh."""

import os
import struct

import numpy as np
import pytest

from plant.models.builder.importing import ImportOptions, ObjectImportError, import_object
from plant.models.builder.importing.solid import solid_of

trimesh = pytest.importorskip("trimesh")
pytest.importorskip("coacd")

BOX = (0.06, 0.08, 0.12)


def imported(path, folder, **wanted):
    folder.mkdir()
    return import_object(path, ImportOptions(**{"name": "gadget", "mass_kg": 0.6, **wanted}), folder)


def refusal(path, folder, **wanted):
    with pytest.raises(ObjectImportError) as error:
        imported(path, folder, **wanted)
    assert error.value.hint
    return error.value


def collada(box, meter=0.01, up="Y_UP", kind="triangles", node=""):
    points = " ".join(f"{value / meter:.9g}" for value in box.vertices.flat)
    corners = " ".join(str(value) for value in box.faces.flat)
    counts = f"<vcount>{' '.join(['3'] * len(box.faces))}</vcount>" if kind == "polylist" else ""
    return f"""<?xml version="1.0"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><unit name="u" meter="{meter}"/><up_axis>{up}</up_axis></asset>
<library_effects><effect id="e"><profile_COMMON><technique sid="c"><phong><diffuse><color>1 0 0 1</color></diffuse>
</phong></technique></profile_COMMON></effect></library_effects>
<library_materials><material id="m"><instance_effect url="#e"/></material></library_materials>
<library_geometries><geometry id="g"><mesh>
<source id="p"><float_array id="pa" count="{3 * len(box.vertices)}">{points}</float_array>
<technique_common><accessor source="#pa" count="{len(box.vertices)}" stride="3"/></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
<{kind} count="{len(box.faces)}" material="s"><input semantic="VERTEX" source="#v" offset="0"/>{counts}
<p>{corners}</p></{kind}></mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="vs"><node>{node}<instance_geometry url="#g"><bind_material><technique_common>
<instance_material symbol="s" target="#m"/></technique_common></bind_material></instance_geometry></node></visual_scene>
</library_visual_scenes><scene><instance_visual_scene url="#vs"/></scene></COLLADA>
"""


@pytest.mark.parametrize("kind", ["triangles", "polylist"])
@pytest.mark.parametrize(
    ("meter", "up", "size"),
    [(0.01, "Z_UP", (0.06, 0.08, 0.12)), (0.001, "Y_UP", (0.06, 0.12, 0.08)), (1.0, "X_UP", (0.12, 0.08, 0.06))],
)
def test_a_collada_file_has_its_unit_and_its_axis(tmp_path, kind, meter, up, size):
    (tmp_path / "box.dae").write_text(collada(trimesh.creation.box(BOX), meter, up, kind))
    made = imported(tmp_path / "box.dae", tmp_path / "model")
    assert made.size_m == pytest.approx(size, abs=1e-6)
    assert "Kd 1" in (tmp_path / "model/gadget.mtl").read_text() or (tmp_path / "model/palette.png").is_file()


def test_a_collada_node_moves_and_scales_its_geometry(tmp_path):
    node = "<translate>5 0 0</translate><rotate>0 0 1 90</rotate><scale>2 1 -1</scale>"
    (tmp_path / "box.dae").write_text(collada(trimesh.creation.box(BOX), up="Z_UP", node=node))
    made = imported(tmp_path / "box.dae", tmp_path / "model")
    assert made.size_m == pytest.approx((0.08, 0.12, 0.12), abs=1e-6)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "empty"),
        ("<COLLADA", "broken XML"),
        ("<svg/>", "no COLLADA"),
        ("<COLLADA/>", "no triangles"),
        (collada(trimesh.creation.box(BOX)).replace('url="#g"', 'url="#h"'), "damaged"),
        (collada(trimesh.creation.box(BOX)).replace("<p>", "<p>999 "), "damaged"),
        (collada(trimesh.creation.box(BOX)).replace('meter="0.01"', 'meter="0"'), "its unit is 0 m"),
        (collada(trimesh.creation.box(BOX)).replace("<COLLADA", "<!DOCTYPE a><COLLADA"), "document types"),
    ],
    ids=["empty", "broken", "svg", "nothing", "reference", "corner", "unit", "doctype"],
)
def test_a_broken_collada_file_is_refused_with_the_reason(tmp_path, text, said):
    (tmp_path / "box.dae").write_text(text)
    assert said in refusal(tmp_path / "box.dae", tmp_path / "model").message


def test_the_unit_is_guessed_by_the_size(tmp_path):
    trimesh.creation.box((6, 6, 12)).export(tmp_path / "cm.stl")
    hint = refusal(tmp_path / "cm.stl", tmp_path / "model").hint
    assert "0.01 if its unit is centimetres (0.12 m long)" in hint
    assert "0.0254 if its unit is inches (0.305 m long)" in hint
    assert "millimetres" not in hint
    trimesh.creation.box((60, 60, 120)).export(tmp_path / "mm.stl")
    assert "0.001 if its unit is millimetres (0.12 m long)" in refusal(tmp_path / "mm.stl", tmp_path / "other").hint


def test_triangles_that_look_inward_are_turned(tmp_path):
    box = trimesh.creation.box(BOX)
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
    assert solid.volume_m3 == pytest.approx(1.125)
    assert turned.tolist() == [False] * 12 + [True] * 12
    hollow = trimesh.creation.box((0.5, 0.5, 0.5))
    for inner in (hollow, hollow.copy()):
        solid, _ = solid_of(np.vstack([triangles_of(outer), triangles_of(inner)]))
        assert solid.volume_m3 == pytest.approx(0.875)
        hollow.invert()


def test_a_git_lfs_pointer_and_a_pipe_are_refused(tmp_path):
    (tmp_path / "lfs.stl").write_text("version https://git-lfs.github.com/spec/v1\noid sha256:1\nsize 9\n")
    assert "git lfs pull" in refusal(tmp_path / "lfs.stl", tmp_path / "model").hint
    os.mkfifo(tmp_path / "pipe.stl")
    assert "pipe" in refusal(tmp_path / "pipe.stl", tmp_path / "other").message


def test_a_huge_picture_of_a_mesh_is_refused_by_its_head(tmp_path):
    head = (
        b"\x89PNG\r\n\x1a\n" + struct.pack(">I", 13) + b"IHDR" + struct.pack(">IIBBBBB", 13_000, 13_000, 8, 2, 0, 0, 0)
    )
    (tmp_path / "a.png").write_bytes(head + b"\0" * 8)
    (tmp_path / "a.mtl").write_text("newmtl a\nmap_Kd a.png\n")
    (tmp_path / "a.obj").write_text("mtllib a.mtl\nusemtl a\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    assert "13000 x 13000 pixels" in refusal(tmp_path / "a.obj", tmp_path / "model").message
