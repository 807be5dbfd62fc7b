from dataclasses import replace

import cv2
import numpy as np
import pytest
from pydrake.math import RigidTransform

from skills.grid_map import CELL_M, FilterMask, GridMap, load_grid_map, map_columns, wall_columns
from skills.inputs.errors import InputError
from skills.manipulation.arm.solid_cells import column_boxes
from skills.world_model import Surface
from tests.tables import table

YAML = """image: room.pgm
resolution: 0.1
origin: [-1.0, -2.0, 0.0]
negate: 0
occupied_thresh: 0.65
free_thresh: 0.196
height_band_m: [0.7, 1.3]
"""


def write_map(folder, text=YAML):
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


def test_world_and_cells_convert_both_ways(tmp_path):
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


@pytest.mark.parametrize(*table(__file__, "errors"))
def test_errors_name_file_line_and_hint(tmp_path, old, new, line, key):
    path = write_map(tmp_path, YAML.replace(old, new))
    with pytest.raises(InputError) as error:
        load_grid_map(path)
    assert str(error.value).startswith(f"{path}:{line}: {key}")


def test_missing_key_and_missing_file_are_named(tmp_path):
    with pytest.raises(InputError, match="resolution"):
        load_grid_map(write_map(tmp_path, YAML.replace("resolution: 0.1\n", "")))
    with pytest.raises(InputError, match=r"nowhere\.yaml: there is no such file"):
        load_grid_map(tmp_path / "nowhere.yaml")


def test_a_file_that_is_no_text_is_refused(tmp_path):
    (tmp_path / "room.yaml").write_bytes(bytes(range(256)))
    with pytest.raises(InputError, match=r"room\.yaml:2: it is no UTF-8 text"):
        load_grid_map(tmp_path / "room.yaml")


def test_a_turned_map_is_given_with_axes_of_the_world(tmp_path):
    grid = load_grid_map(write_map(tmp_path, YAML.replace("0.0]", "1.5707963267948966]")))
    assert grid.resolution_m == pytest.approx(0.05)
    assert grid.origin_m == pytest.approx((-3.0, -2.0))
    assert grid.size_m == pytest.approx((2.0, 3.0))
    assert grid.unknown is not None
    assert grid.occupied[:, :2].all() and grid.occupied.sum() == 4 * 30  # the picture's top row is the smallest x now
    assert np.argwhere(grid.unknown).min(axis=0).tolist() == [14, 10]


def test_a_map_turned_by_any_angle_keeps_its_walls_in_place(tmp_path):
    grid = load_grid_map(write_map(tmp_path, YAML.replace("0.0]", "0.6]")))
    c, s = np.cos(0.6), np.sin(0.6)
    wall = np.array([-1.0, -2.0]) + np.linspace(0.1, 2.9, 50)[:, None] * [c, s] + 1.95 * np.array([-s, c])
    assert np.abs(grid.distance_m(wall)).max() < 0.08
    assert grid.occupied[tuple(grid.cells(wall).T)].all()


def test_scale_mode_takes_the_likelier_class(tmp_path):
    grid = load_grid_map(write_map(tmp_path, YAML + "mode: scale\n"))
    assert grid.unknown is not None and not grid.unknown.any()
    cv2.imwrite(str(tmp_path / "room.pgm"), np.full((4, 4), 120, dtype=np.uint8))
    assert load_grid_map(tmp_path / "room.yaml").occupied.all()


def test_negated_maps_are_white_where_occupied(tmp_path):
    grid = load_grid_map(write_map(tmp_path, YAML.replace("negate: 0", "negate: 1")))
    assert grid.occupied.sum() == 20 * 30 - 30


# Bytes of a picture -> the reason why it is no map
@pytest.mark.parametrize(
    ("content", "why"),
    [
        (b"P5\n30 20\n255\n" + bytes(599), "30 x 20 pixels, 600 values, and it has 599"),
        (b"P5\n30 20\n65535\n" + bytes(600), "it has 300"),
        (b"P2\n3 2\n255\n1 2 3 4 5 x", "it has 5"),
        (b"P2\n3 2\n255\n1 2 3 4 5", "it has 5"),
        (b"P5\n30 20\n0\n" + bytes(600), "its greatest value is 0"),
        (b"P5\n20000 20000\n255\n" + bytes(9), "20000 x 20000 pixels"),
        (b"P5\n1 600\n255\n" + bytes(600), "1 x 600 cells"),
        (b"version https://git-lfs.github.com/spec/v1\n", "pointer of Git LFS"),
        (b"P9" + bytes(99), "no picture|damaged"),
    ],
)
def test_a_picture_that_is_no_map_is_refused_with_the_reason(tmp_path, content, why):
    path = write_map(tmp_path)
    (tmp_path / "room.pgm").write_bytes(content)
    with pytest.raises(InputError, match=rf"room\.yaml:1: image: .*{why}"):
        load_grid_map(path)


GREYS = np.repeat([[0], [205], [254], [128]], 30, axis=1).astype(np.uint8)
"""Occupied, unknown, free and grey, from the top."""


def classes(folder, content, keys="", name="m.pgm"):
    """Whether each row of a picture is occupied, and unknown, from the top."""
    if isinstance(content, bytes):
        (folder / name).write_bytes(content)
    else:
        name = "m.png"
        cv2.imwrite(str(folder / name), content)
    (folder / "room.yaml").write_text(YAML.replace("room.pgm", name).replace("negate: 0\n", "") + keys)
    grid = load_grid_map(folder / "room.yaml")
    return grid.occupied[::-1, 3].tolist(), grid.unknown[::-1, 3].tolist()


TRINARY = ([True, False, False, False], [False, True, False, True])


def pnm(head, values, kind="u1"):
    return head + values.astype(kind).tobytes()


PLAIN = pnm(b"P5\n30 4\n255\n", GREYS)


@pytest.mark.parametrize(
    "content",
    [
        PLAIN,
        pnm(b"P5 30 4 255 ", GREYS),
        pnm(b"P5\n# made by map_saver 0.050 m/pix\n30 4\n#x\n255\n", GREYS),
        pnm(b"P5\r\n30 4\r\n255\r\n", GREYS),
        PLAIN + b"\n",
        pnm(b"P5\n30 4\n65535\n", GREYS * 257.0, ">u2"),
        pnm(b"P5\n30 4\n200\n", np.rint(GREYS / 255.0 * 200.0 - 0.4)),
        pnm(b"P6\n30 4\n255\n", np.repeat(GREYS[..., None], 3, axis=2)),
        b"P2\n30 4\n255\n" + b" ".join(b"%d" % value for value in GREYS.flat),
        b"P2\n# c\n30 4\n1000 # most\n" + b"\n".join(b"%d" % (value / 255 * 1000) for value in GREYS.flat) + b"\n",
    ],
    ids=["p5", "blanks", "comments", "crlf", "trailing", "16bit", "max200", "colour", "p2", "p2max1000"],
)
def test_a_pgm_is_read_as_map_server_reads_it(tmp_path, content):
    assert classes(tmp_path, content) == TRINARY


@pytest.mark.parametrize("channels", [1, 3])
@pytest.mark.parametrize(("kind", "scale"), [(np.uint8, 1), (np.uint16, 257)])
def test_a_png_is_read_as_map_server_reads_it(tmp_path, channels, kind, scale):
    pixels = np.repeat(GREYS[..., None], channels, axis=2).astype(kind) * scale
    assert classes(tmp_path, pixels.squeeze()) == TRINARY


PERCENT = pnm(b"P5\n30 4\n255\n", np.repeat([[100], [255], [0], [60]], 30, axis=1))
NO_205, NO_0 = (np.dstack([GREYS] * 3 + [np.uint8(255) * (hidden != GREYS)]) for hidden in (205, 0))
DARK_HALF, SECOND = [True, False, False, True], [False, True, False, False]


@pytest.mark.parametrize(
    ("content", "keys", "expected"),
    [
        (np.tile(np.array([255, 255, 0], np.uint8), (4, 30, 1)), "", ([False] * 4, [True] * 4)),
        (PERCENT, "mode: raw\n", (DARK_HALF, SECOND)),
        (PLAIN, "trinary: true\n", TRINARY),
        (PLAIN, "mode: trinary\ntrinary: true\n", TRINARY),
        (PLAIN, "mode: Trinary\n", TRINARY),
        (PLAIN, "trinary: false\n", (DARK_HALF, [False] * 4)),
        (PLAIN, "mode: SCALE\n", (DARK_HALF, [False] * 4)),
        (PERCENT, "mode: Raw\n", (DARK_HALF, SECOND)),
        (NO_205, "mode: scale\n", (DARK_HALF, SECOND)),
        (NO_0, "", ([False] * 4, [True, True, False, True])),
    ],
    ids=["colours", "raw", "trinary", "both", "Trinary", "no trinary", "SCALE", "Raw", "alpha, scale", "alpha"],
)
def test_classes_follow_from_mode_and_transparency(tmp_path, content, keys, expected):
    assert classes(tmp_path, content, keys) == expected


def test_transparent_ground_is_noted_in_trinary_mode_where_map_server_differs(tmp_path):
    classes(tmp_path, NO_0)
    (note,) = load_grid_map(tmp_path / "room.yaml").notes
    assert note.startswith("map_server reads 50 % of the picture otherwise")


def test_unknown_keys_are_noted_and_not_read(tmp_path):
    grid = load_grid_map(write_map(tmp_path, YAML.replace("negate: 0", "negative: 1\nframe: map")))
    assert grid.occupied.sum() == 30
    assert grid.notes == (
        "line 4: the key 'negative' is unknown and counts for nothing; did you mean 'negate'?",
        "line 5: the key 'frame' is unknown and counts for nothing",
    )


def test_unknown_ground_that_counts_as_free_is_noted(tmp_path):
    (note,) = load_grid_map(write_map(tmp_path, YAML.replace("0.196", "0.25"))).notes
    assert "free_thresh is 0.25" in note
    assert load_grid_map(write_map(tmp_path)).notes == ()


@pytest.mark.parametrize("name", ["/home/ros/maps/room.pgm", "C:\\maps\\room.pgm"])
def test_a_map_that_was_moved_reads_the_picture_beside_it(tmp_path, name):
    grid = load_grid_map(write_map(tmp_path, YAML.replace("image: room.pgm", f"image: {name}")))
    assert grid.occupied.sum() == 30
    assert grid.notes == (f"image: there is no {name}; room.pgm beside the file is read",)


@pytest.mark.parametrize("content", [PLAIN + b"\n\0\0tail", b"P2\n30 4\n255\n" + b"0 " * 120 + b"\n9 tail"])
def test_bytes_after_the_last_pixel_are_noted_and_not_read(tmp_path, content):
    classes(tmp_path, content)
    (note,) = load_grid_map(tmp_path / "room.yaml").notes
    assert "after the last pixel" in note


@pytest.mark.parametrize(*table(__file__, "other_files"))
def test_other_files_of_a_map_are_named(tmp_path, name, said):
    write_map(tmp_path)
    with pytest.raises(InputError, match=said):
        load_grid_map(tmp_path / name)


def test_the_outlines_of_a_turned_mask_lie_about_its_cells():
    percent = np.zeros((20, 20), dtype=np.int16)
    percent[5:10, 4:12] = 100
    percent[15, 15] = 40
    (outline,) = FilterMask(percent, 0.1, (2.0, 1.0, np.pi / 2)).outlines_W(100)
    low, high = outline.min(axis=0), outline.max(axis=0)
    assert np.allclose((low, high), [(2.0 - 0.95, 1.45), (2.0 - 0.55, 2.15)])


BODY = RigidTransform([0.0, 0.0, 0.5])


def inside(boxes, p_W):
    p_B = BODY.inverse() @ np.array(p_W)
    local = [box.X_FG.inverse() @ p_B for box in boxes]
    return any(np.all(np.abs(p) <= np.array(box.size_m) / 2 + 1e-9) for p, box in zip(local, boxes, strict=True))


def nothing_of(points):
    return np.zeros(len(points), dtype=bool)


def grid_of(*rectangles):
    """A grid of 2 m x 2 m with occupied rectangles (x0, y0, x1, y1) in m."""
    occupied = np.zeros((80, 80), dtype=bool)
    for x0, y0, x1, y1 in rectangles:
        occupied[round(y0 / 0.025) : round(y1 / 0.025), round(x0 / 0.025) : round(x1 / 0.025)] = True
    return GridMap(occupied, 0.025, (0.0, 0.0))


WALL, TABLE_EDGE, CHAIR_BACK, SOFA = (
    (0.0, 0.0, 2.0, 0.1),
    (0.2, 1.0, 1.2, 1.05),
    (1.5, 1.0, 1.55, 1.4),
    (1.4, 1.6, 2, 2),
)
DESK = Surface("desk", ((0.2, 1.0), (1.2, 1.0), (1.2, 1.6), (0.2, 1.6)), 0.75)


def shows_wall(columns, *rectangle):
    (x0, y0, x1, y1), middles = rectangle, (columns + 0.5) * CELL_M
    return bool(np.any(np.all((middles > (x0 - 0.03, y0 - 0.03)) & (middles < (x1 + 0.03, y1 + 0.03)), axis=1)))


def test_walls_are_what_all_grids_show():
    high, low = grid_of(WALL, CHAIR_BACK), grid_of(WALL, SOFA)
    columns = wall_columns([high, low], ())
    assert shows_wall(columns, *WALL)
    assert not shows_wall(columns, *CHAIR_BACK)
    assert not shows_wall(columns, *SOFA)
    assert shows_wall(wall_columns([high], ()), *CHAIR_BACK)  # a map without a second grid cannot tell


def test_the_edges_of_surfaces_and_single_posts_are_no_walls():
    columns = wall_columns([grid_of(WALL, TABLE_EDGE, (1.6, 0.6, 1.65, 0.65))], [DESK])
    assert shows_wall(columns, *WALL)
    assert not shows_wall(columns, *TABLE_EDGE)
    assert not shows_wall(columns, 1.6, 0.6, 1.65, 0.65)
    assert len(wall_columns([grid_of()], [DESK])) == 0


def test_a_wall_is_solid_at_all_heights_of_the_arm_within_its_reach():
    boxes = column_boxes(map_columns([grid_of(WALL)], ()), BODY, 1.0, lambda p_W: p_W[:, 0] < 0.4)
    assert inside(boxes, (0.6, 0.05, 0.3))
    assert inside(boxes, (0.6, 0.05, 1.8))
    assert not inside(boxes, (0.2, 0.05, 1.0))
    assert not inside(boxes, (1.5, 0.05, 1.0))


def test_furniture_is_solid_from_just_below_its_lowest_surface_to_the_floor():
    shelf = replace(DESK, height_m=1.2)
    boxes = column_boxes(map_columns([grid_of(WALL)], [shelf, DESK]), BODY, 2.0, nothing_of)
    assert inside(boxes, (0.7, 1.3, 0.1))
    assert inside(boxes, (0.7, 1.3, DESK.height_m - 0.05))
    assert not inside(boxes, (0.7, 1.3, DESK.height_m - 0.005))
    assert not inside(boxes, (0.7, 1.3, 1.1))
    assert not inside(boxes, (1.4, 1.3, 0.5))
