"""`errand object`, and missions with what it makes: each wrong input is one line and status 2."""

import json
import shutil
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest
from typer.testing import CliRunner

from executive.cli import entry
from plant.worlds.world import WORLDS_FOLDER

trimesh = pytest.importorskip("trimesh")

MISSION = """\
name: bring the drill
imports: [drill]
objects:
  my drill: {model: drill, surfaces: [workbench]}
steps:
  - say: bring me the wrench from the workshop
"""


def invoke(*arguments: object):
    return CliRunner().invoke(entry.app, list(map(str, arguments)))


@pytest.fixture
def mesh(tmp_path: Path) -> Path:
    path = tmp_path / "drill.stl"
    trimesh.creation.box((0.2, 0.06, 0.04)).export(path)
    return path


def made(mesh: Path, out: Path, *more: object):
    return invoke("object", "import", mesh, "--name", "drill", "--mass", 1.2, "--out", out, *more)


def test_a_mesh_becomes_a_model_that_is_shown(mesh, tmp_path):
    result = made(mesh, tmp_path / "drill", "--class", "wrench")
    assert result.exit_code == 0, result.output
    assert "drill, class wrench, 0.200 x 0.060 x 0.040 m, 1.2 kg, 1 collision part\n" in result.stdout
    shown = invoke("object", "show", tmp_path / "drill", "--out", tmp_path / "drill.png")
    assert shown.exit_code == 0, shown.output
    lines = [" ".join(line.split()) for line in shown.stdout.splitlines()]
    assert lines[:3] == ["drill: class wrench", "extents (m) 0.2 0.06 0.04", "mass (kg) 1.2"]
    assert "collision parts 1" in lines
    assert "inertia (kg m^2) 0.00052 0.00416 0.00436 0 0 0 (xx yy zz xy xz yz)" in lines
    picture = cv2.imread(str(tmp_path / "drill.png"))
    assert picture.shape == (480, 640, 3)
    assert picture.std() > 5.0


def test_a_size_that_its_class_never_has_is_warned_of(mesh, tmp_path):
    result = made(mesh, tmp_path / "drill", "--class", "screwdriver", "--scale", 3)
    assert result.exit_code == 0
    assert result.stderr == (
        "errand: warning: drill is 0.600 m long; of class screwdriver the robot expects 0.08 to 0.45 m, "
        "and may not find it\n"
    )


def test_show_prints_the_same_json_as_import(mesh, tmp_path):
    first = json.loads(made(mesh, tmp_path / "drill", "--json").stdout)
    assert first == json.loads(invoke("object", "show", tmp_path / "drill", "--json").stdout)
    assert (first["class"], first["mass_kg"], first["size_m"]) == ("drill", 1.2, [0.2, 0.06, 0.04])


@pytest.mark.parametrize(
    ("arguments", "why"),
    [
        (("--mass", 0), "--mass: should be above 0 and at most 100 kg; it reads 0 now"),
        (("--mass", -1.5), "should be above 0 and at most 100 kg; it reads -1.5 now"),
        (("--mass", "nan"), "should be a finite number"),
        (("--mass", "300"), "it reads 300 now; write 0.3 for 300 g"),
        (("--scale", 0), "--scale: should be above 0 and at most 1000"),
        (("--scale", 1000), "drill.stl: it is 200 x 60 x 40 m large; give --scale 1 if its unit is millimetres"),
        (("--name", "my drill"), "the name 'my drill' is no identifier"),
        (("--name", "wrench"), "the name 'wrench' is taken by a class of objects"),
        (("--class", "drill"), "there is no class 'drill'; known are beer, coke"),
        (("--class", "person"), "there is no class 'person'"),
        (("--up", "w"), "there is no axis 'w'; give x, y or z"),
        (("--out", "{tmp}"), "it exists already; name a new folder by --out"),
        (("--out", "{tmp}/drill.stl"), "it exists already"),
    ],
)
def test_bad_input_is_refused_in_one_line_with_status_2(mesh, tmp_path, arguments, why):
    given = [str(each).replace("{tmp}", str(tmp_path)) for each in arguments]
    result = made(mesh, tmp_path / "made", *given)
    assert result.exit_code == 2
    (line,) = result.stderr.splitlines()
    assert line.startswith("errand: ") and why in line
    assert not (tmp_path / "made").exists()


@pytest.mark.parametrize(
    ("name", "text", "why"),
    [
        ("none.stl", None, "none.stl: there is no such file; check the path"),
        ("notes.txt", "hello", "files *.txt are not read; export it as one of obj, stl, ply"),
        ("notes", "hello", "its name has no ending"),
        ("notes.stl", "hello", "notes.stl: it is no mesh: there are no triangles in it"),
        ("notes.obj", "hello", "notes.obj: it is no mesh: there are no triangles in it"),
        ("notes.glb", "hello", "notes.glb: it is damaged"),
        ("plane.obj", "v 0 0\nv 1 0\nv 0 1\nf 1 2 3\n", "plane.obj: it is damaged"),
        (
            "parts.gltf",
            '{"asset": {"version": "2.0"}, "buffers": [{"uri": "no.bin", "byteLength": 1}], "scenes": [{}]}',
            "parts.gltf: no.bin, which it names, is missing; put it beside the mesh",
        ),
        ("empty.obj", "", "empty.obj: it is empty"),
        ("empty.ply", "", "empty.ply: it is empty"),
        ("sheet.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "sheet.obj: it encloses no volume"),
        ("flat.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nf 3 2 1\n", "flat.obj: it encloses no volume"),
    ],
)
def test_a_file_that_is_no_mesh_is_refused(tmp_path, name, text, why):
    if text is not None:
        (tmp_path / name).write_text(text)
    result = made(tmp_path / name, tmp_path / "made")
    assert result.exit_code == 2
    (line,) = result.stderr.splitlines()
    assert why in line
    assert not (tmp_path / "made").exists()


def test_a_missing_picture_is_warned_of(tmp_path):
    box = trimesh.creation.box((0.1, 0.08, 0.06)).export(file_type="obj", include_color=False)
    (tmp_path / "grey.obj").write_text(f"mtllib none.mtl\n{box}")
    result = made(tmp_path / "grey.obj", tmp_path / "made")
    assert result.exit_code == 0, result.output
    assert "grey.obj: none.mtl, which it names, is missing, so it is grey there" in result.stderr


def test_an_open_mesh_offers_to_be_closed_and_is(tmp_path):
    box = trimesh.creation.box((0.1, 0.08, 0.06))
    box.update_faces(box.face_normals[:, 2] < 0.5)
    box.export(tmp_path / "open.stl")
    refused = made(tmp_path / "open.stl", tmp_path / "made")
    assert refused.exit_code == 2
    assert "it is open (not watertight), at 4 edges; close it in the program that made it, or add --close-holes" in (
        refused.stderr
    )
    closed = made(tmp_path / "open.stl", tmp_path / "made", "--close-holes")
    assert closed.exit_code == 0, closed.output


@pytest.mark.parametrize("library", ["trimesh", "coacd"])
def test_without_its_extra_it_says_what_to_install(tmp_path, monkeypatch, library):
    trimesh.creation.annulus(0.03, 0.04, 0.1, sections=8).export(tmp_path / "pipe.stl")
    monkeypatch.setitem(sys.modules, library, None)
    result = made(tmp_path / "pipe.stl", tmp_path / "made")
    assert result.exit_code == 2
    assert f"needs {library}, which is not installed; pip install 'spot-errand[objects]'" in result.stderr


def test_a_folder_without_a_model_is_refused(tmp_path):
    result = invoke("object", "show", tmp_path)
    assert result.exit_code == 2
    assert f"{tmp_path}: there is no imported object (object.yaml is missing)" in result.stderr


def test_a_mission_with_an_imported_object_is_checked(mesh, tmp_path):
    assert made(mesh, tmp_path / "drill", "--class", "wrench").exit_code == 0
    (tmp_path / "m.yaml").write_text(MISSION)
    result = invoke("check", tmp_path / "m.yaml")
    assert result.exit_code == 0, result.output
    assert "✓" in result.stdout


@pytest.mark.parametrize(
    ("old", "new", "line", "why"),
    [
        ("[drill]", "[drill, drll]", 2, "drll: there is no imported object"),
        ("model: drill", "model: drll", 4, "no model 'drll' for my drill; did you mean 'drill'?"),
        ("[workbench]", "[workbnch]", 4, "no surface 'workbnch' in knowledge.yaml; did you mean 'workbench'?"),
        ("[workbench]", "[desk]", 4, "surface 'desk' may carry objects but has no entry under `fronts`"),
        ("my drill:", "hammer:", 4, "'hammer' names two objects or people"),
        ("[workbench]", "[]", 4, "surfaces"),
    ],
)
def test_a_mission_that_names_what_is_not_there_is_refused_at_its_line(mesh, tmp_path, old, new, line, why):
    assert made(mesh, tmp_path / "drill", "--class", "wrench").exit_code == 0
    (tmp_path / "m.yaml").write_text(MISSION.replace(old, new))
    result = invoke("check", tmp_path / "m.yaml")
    assert result.exit_code == 2
    assert f"m.yaml:{line}: " in result.stderr and why in result.stderr


def test_an_imported_object_that_is_the_only_one_of_its_class_counts_with_its_mass(mesh, tmp_path):
    assert made(mesh, tmp_path / "drill", "--class", "wrench", "--mass", 30).exit_code == 0
    world = tmp_path / "world"
    copy_of_flat(world, "{name: wrench, model: wrench", "{name: wrench, model: drill", imports="[../drill]")
    (tmp_path / "m.yaml").write_text("name: m\nsteps: [{say: bring me the wrench}]\n")
    result = invoke("check", tmp_path / "m.yaml", "--world", world)
    assert result.exit_code == 2
    assert "'wrench' is too heavy: 30 kg" in result.stderr


def copy_of_flat(folder: Path, old: str, new: str, *, imports: str) -> None:
    """The flat with other objects."""
    shutil.copytree(WORLDS_FOLDER / "flat", folder)
    path = folder / "objects.yaml"
    text = path.read_text()
    assert old in text
    path.write_text(f"imports: {imports}\n{text.replace(old, new)}")


def test_a_tag_is_drawn_to_print_with_its_line_for_the_knowledge_file(tmp_path):
    result = invoke("object", "tag", 7, "--size", 0.06, "--out", tmp_path / "tag.svg")
    assert result.exit_code == 0, result.output
    assert "{id: 7, size: 0.06, at: [x, y, z], yaw: 0.0}" in result.stdout
    assert 'width="75mm"' in (tmp_path / "tag.svg").read_text()


def test_a_tag_is_stuck_on_an_imported_model(mesh, tmp_path):
    made(mesh, tmp_path / "drill")
    result = invoke(
        "object", "tag", 7, "--size", 0.03, "--on", tmp_path / "drill", "--side", "top", "--out", tmp_path / "t.svg"
    )
    assert result.exit_code == 0, result.output
    assert "{id: 7, size: 0.03, on: drill}" in result.stdout
    assert '<visual name="tag_7_top">' in (tmp_path / "drill" / "drill.sdf").read_text()


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ((587, "--out", "t.svg"), "from 0 to 586"),
        ((7, "--size", 100, "--out", "t.svg"), "2"),
        ((7, "--on", ".", "--out", "t.svg"), "there is no imported object"),
    ],
)
def test_a_wrong_tag_is_refused(tmp_path, monkeypatch, given, says):
    monkeypatch.chdir(tmp_path)
    result = invoke("object", "tag", *given)
    assert result.exit_code == 2
    assert says in result.stderr
    assert not (tmp_path / "t.svg").exists()


OWN = """\
name: bring the mug
imports: [big_mug]
objects:
  my mug: {model: big_mug, surfaces: [workbench]}
steps:
  - say: bring me the big mug
"""


def test_an_object_with_a_name_alone_is_a_word_of_its_mission(mesh, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    result = invoke("object", "import", mesh, "--name", "big_mug")
    assert result.exit_code == 0, result.output
    assert "big_mug, class of its own, known by its model, 0.200 x 0.060 x 0.040 m, 0.288 kg" in result.stdout
    (tmp_path / "m.yaml").write_text(OWN)
    result = invoke("check", "m.yaml")
    assert result.exit_code == 0, result.output


def test_an_object_in_a_world_is_a_word_there(mesh, tmp_path):
    assert made(mesh, tmp_path / "drill").exit_code == 0
    world = tmp_path / "world"
    copy_of_flat(world, "{name: wrench, model: wrench", "{name: my drill, model: drill", imports="[../drill]")
    result = invoke("parse", "bring me the drill from the workshop", "--world", world)
    assert result.exit_code == 0, result.output
    assert "do [grasp] to [drill]" in result.stdout


def test_an_object_with_the_name_of_another_thing_is_refused_where_both_are(mesh, tmp_path):
    assert invoke("object", "import", mesh, "--name", "bottle", "--out", tmp_path / "bottle").exit_code == 0
    (tmp_path / "m.yaml").write_text(OWN.replace("big_mug", "bottle").replace("big mug", "bottle"))
    result = invoke("check", tmp_path / "m.yaml")
    assert result.exit_code == 2
    (line,) = result.stderr.splitlines()
    assert "the imported object 'bottle' has a name that means 'beer' in this world; import it under another" in line


@pytest.fixture
def photographs(tmp_path: Path) -> Path:
    """Five photographs of a box; the border cuts it in the last."""
    folder = tmp_path / "photographs"
    folder.mkdir()
    for k in range(5):
        picture = np.full((300, 300, 3), 200, np.uint8)
        picture[90 : 300 if k == 4 else 210, 100:200] = (200, 60, 30)
        cv2.imwrite(str(folder / f"{k}.png"), picture)
    return folder


def photographed(photographs: Path, *more: object):
    out = photographs.parent / "jar"
    return invoke("object", "import", photographs, "--name", "jar", "--out", out, *more)


def test_photographs_become_a_model_that_no_world_can_place(photographs, tmp_path):
    result = photographed(photographs, "--size", "8x8x9.5cm")
    assert result.exit_code == 0, result.output
    assert "jar, class of its own, known by its model, 0.080 x 0.080 x 0.095 m" in result.stdout
    assert ", 4 photographs" in result.stdout
    assert f"left out: {photographs / '4.png'}: the border cuts the object" in result.stderr
    shown = json.loads(invoke("object", "show", tmp_path / "jar", "--json").stdout)
    assert (shown["photographs"], shown["size_m"]) == (4, [0.08, 0.08, 0.095])


def test_a_mission_may_name_what_photographs_show_but_not_place_it(photographs, tmp_path):
    photographed(photographs, "--size", "80x80x95")
    mission = tmp_path / "fetch_jar.yaml"
    mission.write_text("name: fetch the jar\nimports: [jar]\nsteps:\n  - say: fetch me the jar\n")
    assert invoke("check", mission).exit_code == 0
    mission.write_text(f"objects:\n  my jar: {{model: jar, surfaces: [workbench]}}\n{mission.read_text()}")
    refused = invoke("check", mission)
    assert refused.exit_code == 2
    assert "'jar' is of photographs: no mesh to place" in refused.stderr + refused.stdout


@pytest.mark.parametrize(
    ("more", "why"),
    [
        ((), "photographs show no size; give it by --size, for example 80x80x95"),
        (
            ("--size", "80x80"),
            "--size: should be width x depth x height, from 8 to 600 mm each; write 80x80x95 for mm, or 8x8x9.5cm",
        ),
        (("--size", "0.08x0.08x0.095"), "--size: should be width x depth x height, from 8 to 600 mm each; write"),
        (("--size", "80x80x95", "--class", "wrench"), "--close-holes are for a mesh; leave them out"),
    ],
)
def test_wrong_options_of_photographs_are_refused_in_one_line(photographs, more, why):
    result = photographed(photographs, *more)
    assert result.exit_code == 2
    (line,) = result.stderr.splitlines()
    assert line.startswith("errand: ") and why in line


def test_a_size_is_refused_for_a_mesh(mesh, tmp_path):
    assert (
        "it is no folder of photographs; leave --size out for a mesh"
        in made(mesh, tmp_path / "drill", "--size", "80x80x95").stderr
    )
