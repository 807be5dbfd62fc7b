"""Imported meshes: sizes, masses, collision parts and appearance; refusal of meshes that are no solid body."""

import re
import sys

import cv2
import numpy as np
import pytest
from scipy.spatial import ConvexHull

from errand_make.objects import ImportOptions, LibraryMissingError, ObjectImportError, import_object
from errand_make.objects.import_object import ImportReports
from errand_make.objects.solid import solid_of
from plant.models.catalogue import read_imported

trimesh = pytest.importorskip("trimesh")
pytest.importorskip("coacd")

L_SHAPE = np.array([[0, 0], [0.2, 0], [0.2, 0.05], [0.05, 0.05], [0.05, 0.2], [0, 0.2]])
L_TRIANGLES = np.array([[3, 0, 1], [3, 1, 2], [3, 4, 5], [3, 5, 0]])


def imported(mesh, tmp_path, ending="ply", **wanted):
    """The mesh written to a file, and made a model of 0.6 kg."""
    path, folder = tmp_path / f"mesh.{ending}", tmp_path / "model"
    mesh.export(path)
    folder.mkdir()
    return import_object(path, ImportOptions(**{"name": "gadget", "mass_kg": 0.6, **wanted}), folder), folder


def l_shape():
    return trimesh.creation.extrude_triangulation(L_SHAPE, L_TRIANGLES, 0.05)


def pipe():
    return trimesh.creation.annulus(0.03, 0.04, 0.1, sections=8)


def numbers(lines, key):
    return np.array([line.split()[1:] for line in lines if line.startswith(f"{key} ")], float)


def part_points(folder):
    return [numbers(file.read_text().splitlines(), "v") for file in sorted(folder.glob("gadget_part_*.obj"))]


def test_a_box_has_the_inertia_of_a_box(tmp_path):
    made, folder = imported(trimesh.creation.box((0.2, 0.06, 0.04)), tmp_path)
    assert (made.size_m, made.com_m) == (pytest.approx((0.2, 0.06, 0.04)), pytest.approx((0.0, 0.0, 0.0), abs=1e-9))
    expected = 0.6 / 12 * np.array([0.06**2 + 0.04**2, 0.2**2 + 0.04**2, 0.2**2 + 0.06**2])
    np.testing.assert_allclose(made.inertia_kg_m2[:3], expected, rtol=1e-6)
    assert (made.collision_parts, made.triangles, made.class_name, made.round) == (1, 12, "gadget", False)
    assert read_imported(folder).size_m == made.size_m


def test_its_form_has_the_height_at_which_it_rests(tmp_path):
    made, folder = imported(trimesh.creation.cylinder(0.03, 0.1), tmp_path, class_name="cylinder")
    form = made.form(folder)
    assert (made.class_name, form.round, form.rest_height_m) == ("cylinder", True, pytest.approx(0.05))
    assert form.path() == (folder / "gadget.sdf").resolve()


@pytest.mark.parametrize("make", [l_shape, pipe])
def test_a_hollow_body_is_few_convex_parts_none_larger_than_it(tmp_path, make):
    mesh = make()
    made, folder = imported(mesh, tmp_path)
    parts, half = part_points(folder), np.array(made.size_m) / 2
    assert 2 <= made.collision_parts == len(parts) <= 16
    assert all((np.abs(part) <= half + 1e-6).all() for part in parts)
    volumes = sum(ConvexHull(part).volume for part in parts)
    assert 0.85 * mesh.volume < volumes < 1.1 * mesh.volume and max(map(len, parts)) <= 64
    sdf = (folder / "gadget.sdf").read_text()
    assert sdf.count("<drake:declare_convex/>") == made.collision_parts
    assert sdf.count("<drake:mu_dynamic>0.8<") == sdf.count("<collision ")


def test_the_bearing_spheres_stay_within_the_body(tmp_path):
    made, folder = imported(l_shape(), tmp_path)
    text = (folder / "gadget.sdf").read_text()
    found = re.findall(r"<pose>(\S+ \S+ \S+) 0 0 0</pose>\s*<geometry><sphere><radius>([0-9.]+)<", text)
    assert len(found) >= 8
    reach = np.array([np.abs(np.array(p.split(), float)) + float(r) for p, r in found])
    assert (reach <= np.array(made.size_m) / 2 + 1e-4).all()
    assert reach[:, 2].max() == pytest.approx(made.size_m[2] / 2, abs=1e-4)


def test_a_ball_gets_spheres_to_rest_on(tmp_path):
    _, folder = imported(trimesh.creation.icosphere(3, 0.04), tmp_path)
    assert (folder / "gadget.sdf").read_text().count("<sphere>") >= 3


def test_an_object_that_cannot_stand_is_laid_down_along_x(tmp_path):
    rod = trimesh.creation.cylinder(0.01, 0.3)
    rod.apply_transform(trimesh.transformations.rotation_matrix(0.4, [1, 1, 0]))
    assert imported(rod, tmp_path)[0].size_m == pytest.approx((0.3, 0.02, 0.02), abs=2e-4)


# extents of a mesh that stands on its end; y may be up, and is in glTF
@pytest.mark.parametrize(
    ("extents_m", "up", "ending"),
    [((0.04, 0.06, 0.2), None, "ply"), ((0.04, 0.2, 0.06), "y", "ply"), ((0.04, 0.2, 0.06), None, "glb")],
)
def test_a_standing_object_is_left_standing(tmp_path, extents_m, up, ending):
    made, _ = imported(trimesh.creation.box(extents_m), tmp_path, ending, up=up)
    assert made.size_m == pytest.approx((0.04, 0.06, 0.2))


def test_a_body_inside_out_is_turned(tmp_path):
    box = trimesh.creation.box((0.1, 0.08, 0.06))
    box.invert()
    made, folder = imported(box, tmp_path)
    assert min(made.inertia_kg_m2[:3]) > 0
    lines = (folder / "gadget.obj").read_text().splitlines()
    points, normals = numbers(lines, "v"), numbers(lines, "vn")
    corners = [line.split()[1:] for line in lines if line.startswith("f")]
    for first in (face[0].split("/") for face in corners):
        assert points[int(first[0]) - 1] @ normals[int(first[2]) - 1] > 0


def test_edges_are_sharp_and_round_sides_are_smooth(tmp_path):
    _, folder = imported(trimesh.creation.cylinder(0.03, 0.1, sections=32), tmp_path)
    normals = numbers((folder / "gadget.obj").read_text().splitlines(), "vn")
    assert (set(np.round(np.abs(normals[:, 2]), 2)), len(normals)) == ({0.0, 1.0}, 32 + 2)


def test_colours_of_triangles_stay(tmp_path):
    box = trimesh.creation.box((0.1, 0.1, 0.1))
    box.visual.face_colors = [[200, 0, 0, 255]] * 6 + [[0, 0, 200, 255]] * 6
    _, folder = imported(box, tmp_path)
    palette = cv2.imread(str(folder / "palette.png"))[..., ::-1].reshape(-1, 3)
    assert {(200, 0, 0), (0, 0, 200)} <= set(map(tuple, palette.tolist()))


def test_very_many_colours_become_few(tmp_path):
    ball = trimesh.creation.icosphere(3, 0.04)
    ball.visual.face_colors = np.random.default_rng(1).integers(0, 255, (len(ball.faces), 4))
    _, folder = imported(ball, tmp_path)
    assert len(np.unique(cv2.imread(str(folder / "palette.png")).reshape(-1, 3), axis=0)) <= 125


def test_parts_of_one_colour_share_it(tmp_path):
    scene = trimesh.Scene()
    for number in range(3):
        material = trimesh.visual.material.PBRMaterial(baseColorFactor=[255, 0, 0, 255])
        box = trimesh.creation.box((0.05, 0.05, 0.05))
        box.apply_translation((0.05 * number, 0.0, 0.0))
        box.visual = trimesh.visual.TextureVisuals(material=material)
        scene.add_geometry(box)
    made, folder = imported(scene, tmp_path, "glb")
    assert made.size_m == pytest.approx((0.15, 0.05, 0.05))
    assert sorted(path.name for path in folder.glob("*.png")) == ["palette.png"]
    assert (folder / "gadget.obj").read_text().count("usemtl") == 1


def test_a_texture_stays(tmp_path):
    image = pytest.importorskip("PIL.Image").new("RGB", (8, 8), (10, 200, 30))
    box = trimesh.creation.box((0.1, 0.1, 0.1))
    material = trimesh.visual.material.PBRMaterial(baseColorTexture=image)
    box.visual = trimesh.visual.TextureVisuals(uv=np.random.default_rng(1).uniform(size=(8, 2)), material=material)
    _, folder = imported(box, tmp_path, "glb")
    assert (cv2.imread(str(folder / "surface_000.png"))[0, 0] == (30, 200, 10)).all()
    assert "map_Kd surface_000.png" in (folder / "gadget.mtl").read_text()


@pytest.mark.parametrize(
    ("make", "why"),
    [
        (lambda: trimesh.creation.box((0.002, 0.001, 0.001)), "give --scale"),
        (lambda: trimesh.PointCloud(np.eye(3)), "it is no mesh: there are no triangles in it"),
    ],
)
def test_a_mesh_that_encloses_no_body_is_refused(tmp_path, make, why):
    with pytest.raises(ObjectImportError, match=re.escape(why)):
        imported(make(), tmp_path)


def test_a_million_triangles_are_counted_and_refused(tmp_path):
    count = 1_000_000
    triangle = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attributes", "<u2")])
    data = np.zeros(count, triangle)
    data["corners"] = np.random.default_rng(1).uniform(size=(count, 3, 3))
    (tmp_path / "m.stl").write_bytes(b" " * 80 + np.uint32(count).tobytes() + data.tobytes())
    with pytest.raises(ObjectImportError, match="it has 1000000 triangles, and at most 100000 are taken"):
        import_object(tmp_path / "m.stl", ImportOptions("gadget", 1.0), tmp_path)


def test_without_the_extra_the_library_is_named(tmp_path, monkeypatch):
    (tmp_path / "m.stl").write_text("")
    monkeypatch.setitem(sys.modules, "trimesh", None)
    with pytest.raises(LibraryMissingError, match="trimesh"):
        import_object(tmp_path / "m.stl", ImportOptions("gadget", 1.0), tmp_path)


def _boxes(*middles):
    parts = [trimesh.creation.box((0.1, 0.06, 0.06)) for _ in middles]
    return trimesh.util.concatenate(
        [part.apply_translation(middle) for part, middle in zip(parts, middles, strict=True)]
    )


#   middles of boxes of 0.1 x 0.06 x 0.06 m                 bodies, gap (m)
@pytest.mark.parametrize(
    ("middles", "apart"),
    [
        ([(0, 0, 0), (1.0, 0, 0)], (2, 0.9)),
        ([(0, 0, 0), (0.15, 0, 0)], (2, 0.05)),
        ([(0, 0, 0), (0.4, 0, 0), (0, 0.4, 0)], (3, 0.3)),
        ([(0, 0, 0), (0.05, 0, 0)], (1, 0.0)),
        ([(0, 0, 0), (0.102, 0, 0), (0.204, 0, 0)], (1, 0.0)),
    ],
)
def test_bodies_with_wide_gaps_between_them_are_counted(middles, apart):
    solid, _ = solid_of(np.array(_boxes(*middles).triangles))
    assert solid.bodies_apart() == pytest.approx(apart)


def test_bodies_far_apart_in_one_file_are_a_warning(tmp_path):
    _boxes((0, 0, 0), (0.3, 0.3, 0)).export(tmp_path / "pair.stl")
    (tmp_path / "pair").mkdir()
    notes = []
    import_object(tmp_path / "pair.stl", ImportOptions("pair"), tmp_path / "pair", ImportReports(note=notes.append))
    assert [note.split(",")[0] for note in notes] == ["it holds 2 bodies"]


def remarks(tmp_path, mesh, **options):
    """Remarks on the import of a mesh."""
    mesh.export(tmp_path / "part.stl")
    (tmp_path / "part").mkdir()
    notes = []
    reports = ImportReports(note=notes.append)
    import_object(tmp_path / "part.stl", ImportOptions("part", 0.1, **options), tmp_path / "part", reports)
    return notes


def test_an_object_too_flat_to_be_recognised_is_a_warning(tmp_path):
    (note,) = remarks(tmp_path, trimesh.creation.box((0.18, 0.02, 0.007)))
    assert note.startswith("it is 0.007 m high, and the robot does not recognise objects under 0.01 m by their models")


@pytest.mark.parametrize(
    ("size", "options"), [((0.18, 0.02, 0.007), {"class_name": "screwdriver"}), ((0.18, 0.02, 0.011), {})]
)
def test_a_flat_object_of_a_known_class_and_a_higher_one_are_no_warning(tmp_path, size, options):
    assert remarks(tmp_path, trimesh.creation.box(size), **options) == []


#   edge of a cube, scale                                  hint
@pytest.mark.parametrize(
    ("edge", "scale", "hint"),
    [
        (0.001, 1.0, "give --scale 100 (0.1 m long) or 1000 (1 m long), if its lengths were divided by that"),
        (0.1, 0.001, "give --scale 1 if its unit is metres (0.1 m long)"),
        (8.0, 0.0001, "give --scale 0.01 if its unit is centimetres (0.08 m long), 0.0254 if its unit is inches"),
        (1e-6, 1.0, "give --scale, the metres of one unit of the file"),
        (300.0, 1.0, "give --scale 0.001 if its unit is millimetres (0.3 m long)"),
    ],
)
def test_a_size_that_is_refused_has_a_hint_of_the_unit(tmp_path, edge, scale, hint):
    with pytest.raises(ObjectImportError) as refused:
        remarks(tmp_path, trimesh.creation.box((edge, edge, edge)), scale=scale)
    assert refused.value.hint.startswith(hint)
