"""Positions of objects, from boxes and depth, in analytic scenes."""

from dataclasses import replace

import numpy as np
import pytest
from pydrake.math import RigidTransform
from table_scene import BLUE, COKE, GREY, LENS, RED, TABLE, Can, scene, seen_as

from skills.api import Detection
from skills.manipulation.arm.poses import camera_pose
from skills.perception.position import locate
from skills.robot import FrameTree, Image

MIDDLE = (COKE.x, COKE.y, TABLE.height_m + 0.5 * COKE.height)


def off_m(position, middle=MIDDLE):
    return float(np.linalg.norm(position.p_OT - np.array(middle)))


def can_off_m(*things, name="coke", middle=MIDDLE):
    """How far from its middle the red object among things is located."""
    image = scene(things)
    return off_m(locate(image, seen_as(name, image)), middle)


def pictured(X_WC, depth_m, lens=LENS):
    """Grey image with a depth picture."""
    colour = np.full((lens.height, lens.width, 3), GREY, dtype=np.uint8)
    frames = FrameTree({"hand_camera": ("odom", X_WC)})
    return Image(0.0, "hand", "hand_camera", lens, lens, colour, colour[..., 0], depth_m, frames)


def test_a_can_is_at_its_axis_and_not_its_front():
    image = scene([COKE])
    position = locate(image, seen_as("coke", image))
    assert off_m(position) < 0.006
    assert position.extents.round
    assert (position.extents.width_m, position.extents.height_m) == pytest.approx((0.066, 0.115), abs=0.008)


def test_a_depth_image_of_lower_resolution_is_enough():
    image = scene([COKE])
    half = replace(LENS, width=160, height=120, fx=138.0, fy=138.0, cx=79.75, cy=59.75)
    small = Image(**{**image.__dict__, "depth_intrinsics": half, "depth_m": image.depth_m[::2, ::2].copy()})
    assert off_m(locate(small, seen_as("coke", image))) < 0.015


def test_half_of_the_objects_depth_is_enough():
    image = scene([COKE])
    lost = np.random.default_rng(3).random(image.depth_m.shape) < 0.5
    holes = replace(image, depth_m=np.where(lost, np.float32(0.0), image.depth_m))
    assert off_m(locate(holes, seen_as("coke", image))) < 0.01


def test_a_flat_object_is_located_where_its_box_meets_the_table():
    image = scene([])
    lens, X_CW = image.intrinsics, image.frames.pose("hand_camera").inverse()
    x, y, z = X_CW @ np.array([1.0, 0.1, TABLE.height_m])
    u, v = x / z * lens.fx + lens.cx, y / z * lens.fy + lens.cy
    position = locate(image, Detection("screwdriver", 0.8, (u - 25, v - 8, u + 25, v + 8)))
    assert off_m(position, (1.0, 0.1, TABLE.height_m)) < 0.015


@pytest.mark.parametrize("noise_m", [0.0015, 0.004])
def test_the_error_agrees_with_the_covariance(noise_m):
    image = scene([COKE], noise_m=noise_m)
    position = locate(image, seen_as("coke", image))
    off = position.p_OT - np.array(MIDDLE)
    assert off @ np.linalg.solve(position.covariance_O, off) < 16.3
    assert np.all(np.linalg.eigvalsh(position.covariance_O) > 0.0)


@pytest.mark.parametrize(
    ("things", "name", "middle", "most_m"),
    [
        ([COKE, Can(COKE.x + 0.10, COKE.y, 0.05, 0.20, BLUE)], "coke", MIDDLE, 0.008),
        ([COKE, Can(COKE.x - 0.12, COKE.y - 0.045, 0.03, 0.06, BLUE)], "coke", MIDDLE, 0.02),
        ([Can(1.0, 0.1, 0.05, 0.008, RED)], "wrench", (1.0, 0.1, TABLE.height_m + 0.004), 0.012),
        ([Can(1.36, 0.2, 0.033, 0.115, RED)], "coke", (1.36, 0.2, TABLE.height_m + 0.0575), 0.01),
        ([COKE], "unicorn", MIDDLE, 0.01),
    ],
    ids=["close before another", "half hidden", "thin as a wrench", "at the table's edge", "of a class without form"],
)
def test_an_object_is_located_alone_and_on_the_table(things, name, middle, most_m):
    assert can_off_m(*things, name=name, middle=middle) < most_m


def test_an_object_cut_off_by_the_picture_has_a_larger_covariance():
    image = scene([COKE])
    u0, v0, u1, v1 = seen_as("coke", image).box
    whole = locate(image, Detection("coke", 0.9, (u0, v0, u1, v1)))
    rows = int(v0 + 0.6 * (v1 - v0))
    narrow = replace(image.intrinsics, height=rows)
    parts = {"colour": image.colour[:rows], "grey": image.grey[:rows], "depth_m": image.depth_m[:rows]}
    cut = replace(image, intrinsics=narrow, depth_intrinsics=narrow, **parts)
    part = locate(cut, Detection("coke", 0.9, (u0, v0, u1, float(rows))))
    assert part.covariance_O.trace() > 2.0 * whole.covariance_O.trace()


@pytest.mark.parametrize(
    "depth", [0.0, np.nan, np.inf, -1.0, None], ids=["none", "NaN", "infinite", "negative", "empty"]
)
def test_without_depth_there_is_no_position(depth):
    image = scene([COKE])
    empty = np.empty((0, 0), dtype=np.float32)
    blind = replace(image, depth_m=empty if depth is None else np.full_like(image.depth_m, depth))
    assert locate(blind, seen_as("coke", image)) is None


@pytest.mark.parametrize(
    "box", [(-50.0, -50.0, -20.0, -20.0), (400.0, 300.0, 500.0, 400.0), (10.0, 10.0, 10.0, 10.0)],
    ids=["left of it", "right of it", "of no size"],
)  # fmt: skip
def test_a_box_beside_the_picture_gives_no_position_or_one_that_is_a_number(box):
    position = locate(scene([COKE]), Detection("coke", 0.9, box))
    assert position is None or np.all(np.isfinite(position.p_OT))


def test_the_height_of_a_cube_seen_from_above_is_its_width():
    depth = np.zeros((LENS.height, LENS.width), dtype=np.float32)
    depth[92:148, 132:188] = 0.8  # 56 pixels are 0.162 m, seen from above; what is around it has no depth
    image = pictured(camera_pose(np.array([0.5, 0.0, 1.0]), np.array([0.501, 0.0, 0.0])), depth)
    position = locate(image, Detection("cube", 0.9, (132.0, 92.0, 188.0, 148.0)))
    assert position.p_OT == pytest.approx([0.5, 0.0, 0.2 - 0.5 * 0.162], abs=0.01)
    assert position.extents.height_m == pytest.approx(0.162, abs=0.01)


def test_a_person_reaches_from_the_floor_to_the_top_of_the_head():
    depth = np.full((LENS.height, LENS.width), 3.8, dtype=np.float32)
    depth[24:230, 130:190] = 2.0  # a flat man, 1.49 m high and 43 cm wide, who stands 2 m away
    image = pictured(camera_pose(np.array([0.0, 0.0, 0.9]), np.array([2.0, 0.0, 0.9])), depth)
    position = locate(image, Detection("person", 0.9, (130.0, 24.0, 190.0, 230.0)))
    top_m = 0.9 + (120.0 - 24.0) / 276.0 * 2.0
    assert position.p_OT == pytest.approx([2.1, 0.0, 0.5 * top_m], abs=0.05)


def test_the_camera_may_be_rolled():
    image = scene([COKE])
    lens = replace(LENS, width=240, height=320, cx=119.0, cy=160.0)
    roll = RigidTransform(np.array([[0, 1, 0, 0], [-1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1.0]]))
    plain = pictured(image.frames.pose("hand_camera") @ roll, np.rot90(image.depth_m, k=-1).copy(), lens)
    other = replace(plain, colour=np.rot90(image.colour, k=-1).copy())
    assert off_m(locate(other, seen_as("coke", other))) < 0.01
