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
        ("resolution: 0.1", "resolution: 0", 2, "resolution"),
        ("resolution: 0.1", "resolution: 50", 2, "resolution"),
        ("negate: 0", "mode: raw", 4, "mode"),
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


def test_a_turned_map_is_given_with_axes_of_the_world(tmp_path):
    turned = YAML.replace("0.0]", "1.5707963267948966]")
    grid = load_grid_map(write_map(tmp_path, turned))
    assert grid.resolution_m == pytest.approx(0.05)
    assert grid.origin_m == pytest.approx((-3.0, -2.0))
    assert grid.size_m == pytest.approx((2.0, 3.0))
    assert grid.unknown is not None
    assert grid.occupied[:, :2].all() and grid.occupied.sum() == 4 * 30  # the picture's top row is the smallest x now
    assert np.argwhere(grid.unknown).min(axis=0).tolist() == [14, 10]


def test_a_map_turned_by_any_angle_keeps_its_walls_in_place(tmp_path):
    grid = load_grid_map(write_map(tmp_path, YAML.replace("0.0]", "0.6]")))
    along = np.linspace(0.1, 2.9, 50)
    wall = (
        np.array([-1.0, -2.0])
        + along[:, None] * [np.cos(0.6), np.sin(0.6)]
        + 1.95 * np.array([-np.sin(0.6), np.cos(0.6)])
    )
    assert np.abs(grid.distance_m(wall)).max() < 0.08
    assert grid.occupied[tuple(grid.cells(wall).T)].all()


def test_scale_mode_takes_what_is_likelier(tmp_path):
    grid = load_grid_map(write_map(tmp_path, YAML + "mode: scale\n"))
    assert grid.unknown is not None and not grid.unknown.any()
    cv2.imwrite(str(tmp_path / "room.pgm"), np.full((4, 4), 120, dtype=np.uint8))
    assert load_grid_map(tmp_path / "room.yaml").occupied.all()


def test_negated_maps_are_white_where_occupied(tmp_path):
    grid = load_grid_map(write_map(tmp_path, YAML.replace("negate: 0", "negate: 1")))
    assert grid.occupied.sum() == 20 * 30 - 30


def _png(folder, picture):
    cv2.imwrite(str(folder / "other.png"), picture)
    return "other.png"


def _pgm(folder, head, size):
    (folder / "other.pgm").write_bytes(head + b"\0" * size)
    return "other.pgm"


@pytest.mark.parametrize(
    ("picture", "why"),
    [
        (lambda folder: _png(folder, np.zeros((9, 9, 3), np.uint8)), "colours"),
        (lambda folder: _pgm(folder, b"P5\n30 20\n255\n", 599), "30 x 20 cells, 600 bytes, and has 599"),
        (lambda folder: _pgm(folder, b"P5\n30 20\n255\n", 700), "has 700"),
        (lambda folder: _pgm(folder, b"P5\n20000 20000\n255\n", 9), "20000 x 20000 cells"),
        (lambda folder: _pgm(folder, b"GIF89a", 99), "neither PGM nor PNG"),
    ],
)
def test_a_picture_that_is_no_map_is_refused_with_the_reason(tmp_path, picture, why):
    path = write_map(tmp_path)
    path.write_text(YAML.replace("room.pgm", picture(tmp_path)))
    with pytest.raises(MapError, match=rf"room\.yaml:1: image: .*{why}"):
        load_grid_map(path)


def test_a_file_that_is_no_text_is_refused(tmp_path):
    (tmp_path / "room.yaml").write_bytes(bytes(range(256)))
    with pytest.raises(MapError, match=r"room\.yaml:1: it is no text"):
        load_grid_map(tmp_path / "room.yaml")
