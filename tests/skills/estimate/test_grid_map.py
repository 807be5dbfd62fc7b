from pathlib import Path

import cv2
import numpy as np
import pytest

from skills.estimate.grid_map import GridMap, MapError, load_grid_map

YAML = """image: room.pgm
resolution: 0.1
origin: [-1.0, -2.0, 0.0]
negate: 0
occupied_thresh: 0.65
free_thresh: 0.196
height_band_m: [0.7, 1.3]
"""


def write_map(folder: Path, text: str = YAML) -> Path:
    grey = np.full((20, 30), 254, dtype=np.uint8)
    grey[0, :] = 0  # the picture's top row: the largest y
    grey[5, 7] = 205
    cv2.imwrite(str(folder / "room.pgm"), grey)
    path = folder / "room.yaml"
    path.write_text(text)
    return path


def test_top_row_of_the_picture_is_the_largest_y(tmp_path):
    grid = load_grid_map(write_map(tmp_path))
    assert grid.occupied[-1].all()
    assert grid.occupied.sum() == 30
    assert grid.unknown is not None and np.argwhere(grid.unknown).tolist() == [[14, 7]]
    assert grid.height_band_m == (0.7, 1.3)


def test_world_and_cells_go_there_and_back(tmp_path):
    grid = load_grid_map(write_map(tmp_path))
    cells = np.array([[0, 0], [19, 29], [4, 11]])
    centres = grid.centres(cells)
    assert centres[0] == pytest.approx([-0.95, -1.95])
    assert grid.cells(centres).tolist() == cells.tolist()


def test_distance_is_to_the_surface_and_signed():
    occupied = np.zeros((40, 40), dtype=np.bool_)
    occupied[:, 20:] = True
    grid = GridMap(occupied, 0.05, (0.0, 0.0))
    points = np.array([[0.5, 1.0], [0.98, 1.0], [1.0, 1.0], [1.2, 1.0]])
    assert grid.distance_m(points) == pytest.approx([0.5, 0.02, 0.0, -0.2], abs=1e-3)


def test_off_the_grid_counts_as_blocked():
    grid = GridMap(np.zeros((10, 10), dtype=np.bool_), 0.1, (0.0, 0.0))
    assert grid.distance_m(np.array([[1.5, 0.5], [-0.3, -0.4]])) == pytest.approx([-0.5, -0.5])


def test_unknown_ground_is_blocked_for_planning(tmp_path):
    grid = load_grid_map(write_map(tmp_path)).with_unknown_blocked()
    assert grid.distance_m(grid.centres(np.array([[14, 7]])))[0] < 0.0


@pytest.mark.parametrize(
    ("old", "new", "line", "key"),
    [
        ("resolution: 0.1", "resolution: -1", 2, "resolution"),
        ("resolution: 0.1", "resolution: fine", 2, "resolution"),
        ("origin: [-1.0, -2.0, 0.0]", "origin: [1, 2]", 3, "origin"),
        ("origin: [-1.0, -2.0, 0.0]", "origin: [1, 2, 0.5]", 3, "origin"),
        ("negate: 0", "negative: 0", 4, "negative"),
        ("free_thresh: 0.196", "free_thresh: 0.9", 6, "free_thresh"),
        ("image: room.pgm", "image: hall.pgm", 1, "image"),
        ("negate: 0", "negate: [0", 5, ""),
    ],
)
def test_errors_name_file_line_and_hint(tmp_path, old, new, line, key):
    path = write_map(tmp_path, YAML.replace(old, new))
    with pytest.raises(MapError) as error:
        load_grid_map(path)
    assert str(error.value).startswith(f"{path}:{line}: {key}")


def test_missing_key_and_missing_file_are_named(tmp_path):
    with pytest.raises(MapError, match="resolution"):
        load_grid_map(write_map(tmp_path, YAML.replace("resolution: 0.1\n", "")))
    with pytest.raises(MapError, match=r"nowhere\.yaml:1: cannot be read"):
        load_grid_map(tmp_path / "nowhere.yaml")
