"""`errand object`, and missions with what it makes: each wrong input is one line and status 2."""

import json
import shutil
import sys

import cv2
import pytest

from executive import load_world
from tests.executive.cli.calls import done, errand, json_of, refusal

trimesh = pytest.importorskip("trimesh")

MISSION = """\
name: bring the drill
imports: [drill]
objects:
  my drill: {model: drill, surfaces: [workbench]}
steps:
  - say: bring me the wrench from the workshop
"""


def made(mesh, out, *more):
    return errand("object", "import", mesh, "--name", "drill", "--mass", 1.2, "--out", out, *more)


def test_a_mesh_becomes_a_model_that_is_shown(mesh, tmp_path):
    result = made(mesh, tmp_path / "drill", "--class", "wrench")
    assert result.exit_code == 0, result.output
    assert "drill, class wrench, 0.200 x 0.060 x 0.040 m, 1.2 kg, 1 collision part\n" in result.stdout
    shown = done("object", "show", tmp_path / "drill", "--out", tmp_path / "drill.png")
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


@pytest.mark.parametrize(("name", "warned"), [("it", True), ("please", True), ("oil_can", False), ("two_cups", False)])
def test_a_name_that_no_sentence_can_say_is_warned_of(mesh, tmp_path, name, warned):
    result = errand("object", "import", mesh, "--name", name, "--mass", 1.2, "--out", tmp_path / "made")
    assert (f"no sentence can say '{name}'" in result.stderr) is warned and result.exit_code == 0


def test_show_prints_the_same_json_as_import(mesh, tmp_path):
    first = json.loads(made(mesh, tmp_path / "drill", "--json").stdout)
    assert first == json_of(errand("object", "show", tmp_path / "drill", "--json"))
    assert (first["class"], first["mass_kg"], first["size_m"]) == ("drill", 1.2, [0.2, 0.06, 0.04])


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
def test_a_missing_library_is_refused_with_what_to_install(tmp_path, monkeypatch, library):
    trimesh.creation.annulus(0.03, 0.04, 0.1, sections=8).export(tmp_path / "pipe.stl")
    monkeypatch.setitem(sys.modules, library, None)
    result = made(tmp_path / "pipe.stl", tmp_path / "made")
    assert result.exit_code == 2
    assert f"needs {library}, which is not installed; pip install errand-make" in result.stderr


def test_a_mission_with_an_imported_object_is_checked(mesh, tmp_path):
    assert made(mesh, tmp_path / "drill", "--class", "wrench").exit_code == 0
    (tmp_path / "m.yaml").write_text(MISSION)
    result = done("check", tmp_path / "m.yaml")
    assert "✓" in result.stdout


def test_an_imported_object_that_is_the_only_one_of_its_class_counts_with_its_mass(mesh, tmp_path):
    assert made(mesh, tmp_path / "drill", "--class", "wrench", "--mass", 30).exit_code == 0
    world = tmp_path / "world"
    copy_of_flat(world, "{name: wrench, model: wrench", "{name: wrench, model: drill", imports="[../drill]")
    (tmp_path / "m.yaml").write_text("name: m\nsteps: [{say: bring me the wrench}]\n")
    assert "'wrench' is too heavy: 30 kg" in refusal("check", tmp_path / "m.yaml", "--world", world)


def copy_of_flat(folder, old, new, *, imports):
    """The flat with other objects."""
    shutil.copytree(load_world("flat").folder, folder)
    path = folder / "objects.yaml"
    text = path.read_text()
    assert old in text
    path.write_text(f"imports: {imports}\n{text.replace(old, new)}")


def test_a_tag_is_drawn_to_print_with_its_line_for_the_knowledge_file(tmp_path):
    result = done("object", "tag", 7, "--size", 0.06, "--out", tmp_path / "tag.svg")
    assert "{id: 7, size: 0.06, at: [x, y, z], yaw: 0.0}" in result.stdout
    assert 'width="75mm"' in (tmp_path / "tag.svg").read_text()


def test_a_tag_is_stuck_on_an_imported_model(mesh, tmp_path):
    made(mesh, tmp_path / "drill")
    result = done(
        "object", "tag", 7, "--size", 0.03, "--on", tmp_path / "drill", "--side", "top", "--out", tmp_path / "t.svg"
    )
    assert "{id: 7, size: 0.03, on: drill}" in result.stdout
    assert '<visual name="tag_7_top">' in (tmp_path / "drill" / "drill.sdf").read_text()


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
    result = done("object", "import", mesh, "--name", "big_mug")
    assert "big_mug, class of its own, known by its model, 0.200 x 0.060 x 0.040 m, 0.288 kg" in result.stdout
    (tmp_path / "m.yaml").write_text(OWN)
    result = done("check", "m.yaml")


def test_an_object_in_a_world_is_a_word_there(mesh, tmp_path):
    assert made(mesh, tmp_path / "drill").exit_code == 0
    world = tmp_path / "world"
    copy_of_flat(world, "{name: wrench, model: wrench", "{name: my drill, model: drill", imports="[../drill]")
    result = done("parse", "bring me the drill from the workshop", "--world", world)
    assert "do [grasp] to [drill]" in result.stdout


def test_an_object_with_the_name_of_another_thing_is_refused_where_both_are(mesh, tmp_path):
    done("object", "import", mesh, "--name", "bottle", "--out", tmp_path / "bottle")
    (tmp_path / "m.yaml").write_text(OWN.replace("big_mug", "bottle").replace("big mug", "bottle"))
    result = errand("check", tmp_path / "m.yaml")
    assert result.exit_code == 2
    (line,) = result.stderr.splitlines()
    assert "the imported object 'bottle' has a name that means 'beer' in this world; import it under another" in line


def photographed(photographs, *more):
    out = photographs.parent / "jar"
    return errand("object", "import", photographs, "--name", "jar", "--out", out, *more)


def test_photographs_become_a_model_that_no_world_can_place(photographs, tmp_path):
    result = photographed(photographs, "--size", "8x8x9.5cm")
    assert result.exit_code == 0, result.output
    assert "jar, class of its own, known by its model, 0.080 x 0.080 x 0.095 m" in result.stdout
    assert ", 4 photographs" in result.stdout
    assert f"left out: {photographs / '4.png'}: the border cuts the object" in result.stderr
    shown = json_of(errand("object", "show", tmp_path / "jar", "--json"))
    assert (shown["photographs"], shown["size_m"]) == (4, [0.08, 0.08, 0.095])


def test_a_mission_may_name_what_photographs_show_but_not_place_it(photographs, tmp_path):
    photographed(photographs, "--size", "80x80x95")
    mission = tmp_path / "fetch_jar.yaml"
    mission.write_text("name: fetch the jar\nimports: [jar]\nsteps:\n  - say: fetch me the jar\n")
    done("check", mission)
    mission.write_text(f"objects:\n  my jar: {{model: jar, surfaces: [workbench]}}\n{mission.read_text()}")
    refused = errand("check", mission)
    assert refused.exit_code == 2
    assert "'jar' is of photographs: no mesh to place" in refused.stderr + refused.stdout
