"""Meshes, photographs, maps, and worlds of one's own, for the commands that make them."""

import shutil

import cv2
import numpy as np
import pytest

from tests.executive.cli.calls import MAP, done, write_room


@pytest.fixture
def mesh(tmp_path):
    """A box as large as a drill."""
    trimesh = pytest.importorskip("trimesh")
    trimesh.creation.box((0.2, 0.06, 0.04)).export(tmp_path / "drill.stl")
    return tmp_path / "drill.stl"


@pytest.fixture
def photographs(tmp_path):
    """Five photographs of a box; the border cuts it in the last."""
    folder = tmp_path / "photographs"
    folder.mkdir()
    for k in range(5):
        picture = np.full((300, 300, 3), 200, np.uint8)
        picture[90 : 300 if k == 4 else 210, 100:200] = (200, 60, 30)
        cv2.imwrite(str(folder / f"{k}.png"), picture)
    return folder


@pytest.fixture
def map_file(tmp_path):
    """A map of a room of 6 x 5 m, turned."""
    return write_room(tmp_path, yaw=0.3)


@pytest.fixture(scope="session")
def rooms_world(tmp_path_factory):
    """Folder with a map of two rooms with a door of 0.9 m, and its world `own` with a dock and Robin."""
    folder = tmp_path_factory.mktemp("rooms")
    rooms = np.full((120, 240), 0, np.uint8)
    rooms[4:-4, 4:118] = rooms[4:-4, 122:-4] = 254
    rooms[51:69, 118:122] = 254
    cv2.imwrite(str(folder / "room.pgm"), rooms)
    (folder / "room.yaml").write_text(MAP.format(yaw=0.0))
    done("world", "from-map", folder / "room.yaml", "--out", folder / "own")
    return folder


@pytest.fixture
def own(rooms_world, tmp_path):
    """Folder of a world of two rooms, beside its map."""
    shutil.copytree(rooms_world, tmp_path, dirs_exist_ok=True)
    return tmp_path / "own"


@pytest.fixture
def own_table(own):
    """The same world with a table."""
    done("world", "add", "table", own, "table")
    return own
