"""What a world's geometry names is looked at before Drake reads it."""

import os
import shutil
import struct
import time
import zlib
from pathlib import Path

import pytest

from plant.worlds.geometry_files import MOST_XML_DEPTH, check_directives, check_model
from plant.worlds.world import load_world
from skills.inputs.errors import InputError
from tests.project import shipped_worlds
from tests.tables import table

FILES = Path(__file__).with_name("geometry_files")
DIRECTIVES = (FILES / "world.dmd.yaml").read_text()
MODEL = (FILES / "walls.sdf").read_text()


@pytest.fixture
def home(tmp_path):
    folder = shutil.copytree(FILES, tmp_path / "home")
    (folder / "walls.obj").write_text("mtllib walls.mtl\nv 0 0 0\n")
    (folder / "walls.mtl").write_text("newmtl a\nKd 1 1 1\nmap_Kd -s 1 1 1 picture.png\n")
    (folder / "picture.png").write_bytes(png(4, 4))
    return folder


def png(width, height):
    """The head of a picture without its pixels."""
    data = b"IHDR" + struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + struct.pack(">I", 13) + data + struct.pack(">I", zlib.crc32(data))


def refuse(home, file, line, said):
    """Asserts that the world is refused for a line of a file; None stands for any file and for any line."""
    with pytest.raises(InputError) as error:
        check_directives(home / "world.dmd.yaml", home)
    assert said in str(error.value)
    assert file is None or error.value.file == home / file
    assert error.value.line == line if line else error.value.line is not None


def test_a_good_world_is_taken(home):
    check_directives(home / "world.dmd.yaml", home)


@pytest.mark.parametrize("name", shipped_worlds())
def test_the_worlds_that_come_with_the_plant_are_taken(name):
    assert load_world(name).name == name


@pytest.mark.parametrize(*table(__file__, "names"))
def test_a_name_that_leads_elsewhere_is_refused_in_its_line(home, name, said):
    (home / "world.dmd.yaml").write_text(DIRECTIVES.replace("package://world/walls.sdf", name))
    refuse(home, "world.dmd.yaml", 4, said)


@pytest.mark.parametrize("name", ["http://x/walls.obj", "../walls.obj", "none.obj", "model://nobody/x.obj"])
def test_a_bad_file_name_in_a_model_is_refused_in_its_line(home, name):
    (home / "walls.sdf").write_text(MODEL.replace("walls.obj", name))
    refuse(home, "walls.sdf", 2, "")


def test_a_world_that_includes_itself_is_refused(home):
    (home / "world.dmd.yaml").write_text(DIRECTIVES + "- add_directives: {file: package://world/more.dmd.yaml}\n")
    (home / "more.dmd.yaml").write_text("directives:\n- add_directives: {file: package://world/world.dmd.yaml}\n")
    refuse(home, "more.dmd.yaml", 2, "includes itself")


def test_directives_that_multiply_are_refused(home):
    for n in range(15):
        text = f"- add_directives: {{file: package://world/{n + 1}.dmd.yaml}}\n" * 4
        (home / f"{n}.dmd.yaml").write_text(f"directives:\n{text}")
    (home / "15.dmd.yaml").write_text("directives: []\n")
    (home / "world.dmd.yaml").write_text("directives:\n- add_directives: {file: package://world/0.dmd.yaml}\n")
    refuse(home, None, None, "too many other files")


ITSELF = MODEL.replace("</model>", "<include><uri>walls.sdf</uri></include></model>")


@pytest.mark.parametrize(
    ("model", "said"),
    [
        ("<a>" * (MOST_XML_DEPTH + 1), "nested more than"),
        ("<a>" * 100_000, "nested more than"),
        ("<sdf><model>\n</sdf>", "broken XML"),
        ('<!DOCTYPE a [<!ENTITY b "c">]><sdf>&b;</sdf>', "document types"),
        ("", "broken XML"),
        (ITSELF, "includes itself"),
    ],
)
def test_a_broken_model_is_refused_in_its_line(home, model, said):
    (home / "walls.sdf").write_text(model)
    refuse(home, "walls.sdf", None, said)


def test_a_texture_is_no_pipe_and_not_too_large(home):
    (home / "picture.png").write_bytes(png(13_000, 13_000))
    refuse(home, "walls.mtl", 3, "13000 x 13000 pixels")
    (home / "picture.png").unlink()
    os.mkfifo(home / "picture.png")
    begun = time.perf_counter()
    refuse(home, None, None, "pipe")
    assert time.perf_counter() - begun < 1.0


@pytest.mark.parametrize(
    ("text", "line"),
    [
        (DIRECTIVES + "directives: []\n", 9),
        (DIRECTIVES.replace("    name: walls\n", "    name: walls\n    name: walls\n"), 4),
        (DIRECTIVES.replace("!Rpy", "!Roll"), 8),
        ("models: []\n", 1),
    ],
)
def test_broken_directives_are_refused_in_their_line(home, text, line):
    (home / "world.dmd.yaml").write_text(text)
    refuse(home, None, line, "")


def test_an_imported_model_is_looked_at_as_well(home):
    check_model(home / "walls.sdf", home)
    (home / "walls.obj").unlink()
    with pytest.raises(InputError, match=r"walls\.sdf:2: walls\.obj: there is no such file"):
        check_model(home / "walls.sdf", home)
