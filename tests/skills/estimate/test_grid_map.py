from pathlib import Path

import cv2
import numpy as np
import pytest

from skills.estimate.grid_map import FilterMask, GridMap, load_grid_map
from skills.files.errors import InputError

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


@pytest.mark.parametrize(
    ("old", "new", "line", "key"),
    [
        ("resolution: 0.1", "resolution: -1", 2, "resolution"),
        ("resolution: 0.1", "resolution: fine", 2, "resolution"),
        ("origin: [-1.0, -2.0, 0.0]", "origin: [1, 2]", 3, "origin"),
        ("resolution: 0.1", "resolution: 0", 2, "resolution"),
        ("resolution: 0.1", "resolution: 50", 2, "resolution"),
        ("negate: 0", "mode: grey", 4, "mode"),
        ("resolution: 0.1", "resolutoin: 0.1", 2, "unknown key 'resolutoin'; did you mean 'resolution'"),
        ("negate: 0", "resolution: 1", 4, "key 'resolution' stands twice"),
        ("negate: 0", "mode: scale\ntrinary: true", 5, "trinary: 'mode' says scale"),
        ("origin: [-1.0, -2.0, 0.0]", "origin: [448262.5, -2, 0.0]", 3, "origin"),
        (
            "origin: [-1.0, -2.0, 0.0]",
            "origin: [0, 0, 90]",
            3,
            "origin.2: should be from -6.283 to 6.283 rad; it reads 90 now; write 1.57",
        ),
        ("origin: [-1.0, -2.0, 0.0]", "origin: [0, .nan, 0]", 3, "origin"),
        ("resolution: 0.1", "resolution: .inf", 2, "resolution"),
        ("image: room.pgm", "image: http://x/room.pgm", 1, "image"),
        ("image: room.pgm", "image: ../room.pgm", 1, "image: '../room.pgm' leads out of the folder"),
        ("image: room.pgm", "image: /etc/passwd", 1, "image"),
        ("image: room.pgm", "image: .", 1, "image"),
        ("free_thresh: 0.196", "free_thresh: 0.9", 6, "free_thresh"),
        ("image: room.pgm", "image: hall.pgm", 1, "image"),
        ("negate: 0", "negate: [0", 5, "broken YAML"),
    ],
)
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


def test_scale_mode_takes_the_likelier_class(tmp_path):
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
        (lambda folder: _pgm(folder, b"P5\n30 20\n255\n", 599), "30 x 20 pixels, 600 values, and it has 599"),
        (lambda folder: _pgm(folder, b"P5\n30 20\n65535\n", 600), "it has 300"),
        (lambda folder: _pgm(folder, b"P2\n3 2\n255\n1 2 3 4 5 x", 0), "it has 5"),
        (lambda folder: _pgm(folder, b"P2\n3 2\n255\n1 2 3 4 5", 0), "it has 5"),
        (lambda folder: _pgm(folder, b"P5\n30 20\n0\n", 600), "its greatest value is 0"),
        (lambda folder: _pgm(folder, b"P5\n20000 20000\n255\n", 9), "20000 x 20000 pixels"),
        (lambda folder: _pgm(folder, b"P5\n1 600\n255\n", 600), "1 x 600 cells"),
        (lambda folder: _pgm(folder, b"version https://git-lfs.github.com/spec/v1\n", 0), "pointer of Git LFS"),
        (lambda folder: _pgm(folder, b"P9", 99), "no picture|damaged"),
    ],
)
def test_a_picture_that_is_no_map_is_refused_with_the_reason(tmp_path, picture, why):
    path = write_map(tmp_path)
    path.write_text(YAML.replace("room.pgm", picture(tmp_path)))
    with pytest.raises(InputError, match=rf"room\.yaml:1: image: .*{why}"):
        load_grid_map(path)


def test_a_file_that_is_no_text_is_refused(tmp_path):
    (tmp_path / "room.yaml").write_bytes(bytes(range(256)))
    with pytest.raises(InputError, match=r"room\.yaml:2: it is no UTF-8 text"):
        load_grid_map(tmp_path / "room.yaml")


GREYS = np.repeat([[0], [205], [254], [128]], 30, axis=1).astype(np.uint8)
"""Occupied, unknown, free and grey, from the top."""


def classes(folder: Path, name: str, keys: str = "") -> tuple[list[bool], list[bool]]:
    """Whether each row of a picture is occupied, and unknown, from the top."""
    (folder / "room.yaml").write_text(YAML.replace("room.pgm", name).replace("negate: 0\n", "") + keys)
    grid = load_grid_map(folder / "room.yaml")
    assert grid.unknown is not None
    return grid.occupied[::-1, 3].tolist(), grid.unknown[::-1, 3].tolist()


TRINARY = ([True, False, False, False], [False, True, False, True])


def pnm(head: bytes, values: np.ndarray, kind: str = "u1") -> bytes:
    return head + values.astype(kind).tobytes()


@pytest.mark.parametrize(
    "content",
    [
        pnm(b"P5\n30 4\n255\n", GREYS),
        pnm(b"P5 30 4 255 ", GREYS),
        pnm(b"P5\n# made by map_saver 0.050 m/pix\n30 4\n#x\n255\n", GREYS),
        pnm(b"P5\r\n30 4\r\n255\r\n", GREYS),
        pnm(b"P5\n30 4\n255\n", GREYS) + b"\n",
        pnm(b"P5\n30 4\n65535\n", GREYS * 257.0, ">u2"),
        pnm(b"P5\n30 4\n200\n", np.rint(GREYS / 255.0 * 200.0 - 0.4)),
        pnm(b"P6\n30 4\n255\n", np.repeat(GREYS[..., None], 3, axis=2)),
        b"P2\n30 4\n255\n" + b" ".join(b"%d" % value for value in GREYS.flat),
        b"P2\n# c\n30 4\n1000 # most\n" + b"\n".join(b"%d" % (value / 255 * 1000) for value in GREYS.flat) + b"\n",
    ],
    ids=["p5", "blanks", "comments", "crlf", "trailing", "16bit", "max200", "colour", "p2", "p2max1000"],
)
def test_a_pgm_is_read_as_map_server_reads_it(tmp_path, content):
    (tmp_path / "m.pgm").write_bytes(content)
    assert classes(tmp_path, "m.pgm") == TRINARY


@pytest.mark.parametrize("channels", [1, 3])
@pytest.mark.parametrize("kind", [np.uint8, np.uint16])
def test_a_png_is_read_as_map_server_reads_it(tmp_path, channels, kind):
    pixels = np.repeat(GREYS[..., None], channels, axis=2).astype(kind) * (257 if kind is np.uint16 else 1)
    cv2.imwrite(str(tmp_path / "m.png"), pixels.squeeze())
    assert classes(tmp_path, "m.png") == TRINARY


def test_colours_are_averaged(tmp_path):
    cv2.imwrite(str(tmp_path / "m.png"), np.tile(np.array([255, 255, 0], np.uint8), (4, 30, 1)))
    assert classes(tmp_path, "m.png") == ([False] * 4, [True] * 4)


def test_a_map_with_the_key_trinary_is_read_in_that_mode(tmp_path):
    (tmp_path / "m.pgm").write_bytes(pnm(b"P5\n30 4\n255\n", GREYS))
    assert classes(tmp_path, "m.pgm", "trinary: true\n") == TRINARY
    assert classes(tmp_path, "m.pgm", "trinary: false\n") == ([True, False, False, True], [False] * 4)


def test_transparent_ground_is_unknown_in_scale_mode(tmp_path):
    pixels = np.dstack([GREYS, GREYS, GREYS, np.where(GREYS == 205, 0, 255)]).astype(np.uint8)
    cv2.imwrite(str(tmp_path / "m.png"), pixels)
    assert classes(tmp_path, "m.png", "mode: scale\n") == ([True, False, False, True], [False, True, False, False])


def test_transparent_ground_is_unknown_in_trinary_mode_with_a_note_where_map_server_differs(tmp_path):
    pixels = np.dstack([GREYS, GREYS, GREYS, np.where(GREYS == 0, 0, 255)]).astype(np.uint8)
    cv2.imwrite(str(tmp_path / "m.png"), pixels)
    assert classes(tmp_path, "m.png") == ([False] * 4, [True, True, False, True])
    (note,) = load_grid_map(tmp_path / "room.yaml").notes
    assert note.startswith("map_server reads 50 % of the picture otherwise")


def test_values_are_percentages_in_raw_mode(tmp_path):
    (tmp_path / "m.pgm").write_bytes(pnm(b"P5\n30 4\n255\n", np.repeat([[100], [255], [0], [60]], 30, axis=1)))
    assert classes(tmp_path, "m.pgm", "mode: raw\n") == ([True, False, False, True], [False, True, False, False])


@pytest.mark.parametrize("mode", ["Trinary", "SCALE", "Raw"])
def test_the_mode_is_read_in_any_case(tmp_path, mode):
    (tmp_path / "m.pgm").write_bytes(pnm(b"P5\n30 4\n255\n", GREYS))
    assert classes(tmp_path, "m.pgm", f"mode: {mode}\n") == classes(tmp_path, "m.pgm", f"mode: {mode.lower()}\n")


def test_the_keys_mode_and_trinary_may_agree(tmp_path):
    (tmp_path / "m.pgm").write_bytes(pnm(b"P5\n30 4\n255\n", GREYS))
    assert classes(tmp_path, "m.pgm", "mode: trinary\ntrinary: true\n") == TRINARY


def test_unknown_keys_are_noted_and_not_read(tmp_path):
    grid = load_grid_map(write_map(tmp_path, YAML.replace("negate: 0", "negative: 1\nframe: map")))
    assert grid.occupied.sum() == 30
    assert grid.notes == (
        "line 4: the key 'negative' is unknown and counts for nothing; did you mean 'negate'?",
        "line 5: the key 'frame' is unknown and counts for nothing",
    )


def test_a_map_that_was_moved_reads_the_picture_beside_it(tmp_path):
    for name in ("/home/ros/maps/room.pgm", "C:\\maps\\room.pgm"):
        grid = load_grid_map(write_map(tmp_path, YAML.replace("image: room.pgm", f"image: {name}")))
        assert grid.occupied.sum() == 30
        assert grid.notes == (f"image: there is no {name}; room.pgm beside the file is read",)


def test_bytes_after_the_last_pixel_are_noted_and_not_read(tmp_path):
    for content in (pnm(b"P5\n30 4\n255\n", GREYS) + b"\n\0\0tail", b"P2\n30 4\n255\n" + b"0 " * 120 + b"\n9 tail"):
        (tmp_path / "m.pgm").write_bytes(content)
        classes(tmp_path, "m.pgm")
        (note,) = load_grid_map(tmp_path / "room.yaml").notes
        assert "after the last pixel" in note


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("room.pgm", "picture of a map.*give .*room.yaml"),
        ("other.png", "picture of a map.*'resolution'"),
        ("room.posegraph", "pose graph of slam_toolbox.*map_saver_cli"),
        ("room.pbstream", "Cartographer"),
    ],
)
def test_other_files_of_a_map_are_named(tmp_path, name, said):
    write_map(tmp_path)
    with pytest.raises(InputError, match=said):
        load_grid_map(tmp_path / name)


def test_unknown_ground_that_counts_as_free_is_noted(tmp_path):
    path = write_map(tmp_path, YAML.replace("0.196", "0.25"))
    (note,) = load_grid_map(path).notes
    assert "free_thresh is 0.25" in note
    assert load_grid_map(write_map(tmp_path)).notes == ()


def test_the_outlines_of_a_turned_mask_lie_about_its_cells():
    percent = np.zeros((20, 20), dtype=np.int16)
    percent[5:10, 4:12] = 100
    percent[15, 15] = 40
    (outline,) = FilterMask(percent, 0.1, (2.0, 1.0, np.pi / 2)).outlines_W(100)
    low, high = outline.min(axis=0), outline.max(axis=0)
    assert np.allclose((low, high), [(2.0 - 0.95, 1.45), (2.0 - 0.55, 2.15)])
