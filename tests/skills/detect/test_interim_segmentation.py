"""Segmentation of analytic scenes: a table top with boxes and cylinders, ray-cast into colour and depth."""

from dataclasses import dataclass

import numpy as np
import pytest
from pydrake.math import RigidTransform

from skills.api import Surface
from skills.arm.poses import camera_pose
from skills.detect.appearance import load_appearance
from skills.detect.interim_segmentation import observation, sightings, view_surface
from skills.robot import FrameTree, Image, Intrinsics

LENS = Intrinsics(320, 240, 276.0, 276.0, 160.0, 120.0)
TABLE = Surface("table", ((0.8, -0.6), (1.4, -0.6), (1.4, 0.6), (0.8, 0.6)), 0.75)
CAMERA = np.array([0.35, 0.05, 1.25])
RED, BLUE, GREY, PINK = (190, 15, 20), (25, 60, 190), (150, 148, 140), (240, 120, 200)


@dataclass(frozen=True)
class Can:
    x: float
    y: float
    radius: float
    height: float
    colour: tuple[int, int, int]


def _rays(X_WC):
    u, v = np.meshgrid(np.arange(LENS.width), np.arange(LENS.height))
    rays_C = np.stack([(u - LENS.cx) / LENS.fx, (v - LENS.cy) / LENS.fy, np.ones_like(u, dtype=float)], axis=-1)
    return rays_C @ X_WC.rotation().matrix().T


def _level(rays, height_m):
    """Depth along the optical axis to a level plane; rays have unit length along it."""
    with np.errstate(divide="ignore", invalid="ignore"):
        depth = (height_m - CAMERA[2]) / rays[..., 2]
    return np.where(depth > 0, depth, np.inf)


def _can_depth(rays, can):
    """Depth to the side or the lid of an upright can on the table."""
    base, top = TABLE.height_m, TABLE.height_m + can.height
    p = CAMERA[:2] - [can.x, can.y]
    a = np.sum(rays[..., :2] ** 2, axis=-1)
    b = rays[..., 0] * p[0] + rays[..., 1] * p[1]
    root = b**2 - a * (p @ p - can.radius**2)
    side = np.where(root >= 0, (-b - np.sqrt(np.maximum(root, 0))) / a, np.inf)
    z = CAMERA[2] + side * rays[..., 2]
    side = np.where((z >= base) & (z <= top) & (side > 0), side, np.inf)
    lid = _level(rays, top)
    at = CAMERA[:2] + np.where(np.isfinite(lid), lid, 0.0)[..., None] * rays[..., :2]
    lid = np.where(np.linalg.norm(at - [can.x, can.y], axis=-1) <= can.radius, lid, np.inf)
    return np.minimum(side, lid)


def _scene(things, noise_m=0.0015, tilt_rad=0.0):
    """An Image of the table with cans on it, seen from CAMERA, depth noise included."""
    X_WC = camera_pose(CAMERA, np.array([1.05, 0.0, TABLE.height_m]))
    rays = _rays(X_WC)
    colour = np.full((LENS.height, LENS.width, 3), GREY, dtype=np.uint8)
    table = _level(rays, TABLE.height_m)
    at = CAMERA[:2] + np.where(np.isfinite(table), table, 0.0)[..., None] * rays[..., :2]
    on_table = (at[..., 0] > 0.8) & (at[..., 0] < 1.4) & (np.abs(at[..., 1]) < 0.6)
    depth = np.where(on_table, table, np.minimum(_level(rays, 0.0), 3.9))
    for thing in things:
        nearer = _can_depth(rays, thing)
        colour[nearer < depth] = thing.colour
        depth = np.minimum(depth, nearer)
    depth = depth + np.random.default_rng(7).normal(0.0, noise_m, depth.shape)
    frames = FrameTree({"hand_camera": ("odom", X_WC)})
    grey = colour.mean(axis=-1).astype(np.uint8)
    return Image(1.5, "hand", "hand_camera", LENS, LENS, colour, grey, depth.astype(np.float32), frames)


COKE = Can(0.95, -0.1, 0.033, 0.115, RED)


def _found(image, classes=("coke", "beer", "hammer", "cube"), attributes=(), X_WO=None, surface=TABLE):
    view = view_surface(image, X_WO or RigidTransform(), surface)
    assert view is not None
    return sightings(view.clusters, load_appearance(), classes, attributes)


def test_a_red_can_is_seen_as_coke_where_it_stands():
    (found,) = _found(_scene([COKE]))
    seen = observation(found, 1.5)
    assert seen.thing.name == "coke"
    assert seen.surface == "table"
    assert seen.position_W == pytest.approx((0.95, -0.1, 0.75 + 0.0575), abs=0.008)
    assert seen.size_m[0] == pytest.approx(0.066, abs=0.01)
    assert seen.size_m[2] == pytest.approx(0.115, abs=0.008)


def test_the_box_in_the_picture_holds_the_can():
    image = _scene([COKE])
    (found,) = _found(image)
    u0, v0, u1, v1 = found.cluster.box
    red = np.argwhere(np.all(image.colour == RED, axis=-1))
    assert abs(u0 - red[:, 1].min()) <= 3
    assert abs(u1 - red[:, 1].max()) <= 3
    assert abs(v0 - red[:, 0].min()) <= 3
    assert 0 <= red[:, 0].max() - v1 <= 6


def test_two_cans_are_two_sightings():
    image = _scene([COKE, Can(1.1, 0.2, 0.033, 0.115, RED)])
    assert sorted(round(observation(s, 0).position_W[1], 1) for s in _found(image)) == [-0.1, 0.2]


def test_a_localisation_error_of_the_surface_does_not_shift_the_can_in_the_odometry_frame():
    wrong = RigidTransform([0.02, -0.02, 0.02])
    (found,) = _found(_scene([COKE]), X_WO=wrong)
    seen = observation(found, 1.5)
    assert seen.position_W == pytest.approx((0.97, -0.12, 0.75 + 0.02 + 0.0575), abs=0.008)


def test_an_unknown_thing_is_nothing():
    assert _found(_scene([Can(0.95, 0.0, 0.05, 0.19, PINK)])) == []


def test_a_thing_of_another_class_is_not_taken_for_the_one_asked_for():
    assert _found(_scene([COKE]), classes=("beer", "cube")) == []


def test_a_red_thing_that_is_too_tall_is_no_coke():
    assert _found(_scene([Can(0.95, -0.1, 0.033, 0.3, RED)]), classes=("coke",)) == []


def test_attributes_must_fit():
    image = _scene([COKE])
    assert len(_found(image, attributes=("red",))) == 1
    assert _found(image, attributes=("blue",)) == []


def test_an_empty_table_has_no_clusters():
    assert view_surface(_scene([]), RigidTransform(), TABLE).clusters == ()


def test_more_depth_noise_gives_no_ghosts():
    assert view_surface(_scene([], noise_m=0.006), RigidTransform(), TABLE).clusters == ()


def test_a_surface_out_of_the_picture_is_not_judged():
    away = Surface("shelf", ((-3.0, -0.5), (-2.0, -0.5), (-2.0, 0.5), (-3.0, 0.5)), 0.75)
    assert view_surface(_scene([COKE]), RigidTransform(), away) is None


def test_a_grey_picture_is_refused():
    image = _scene([COKE])
    grey = Image(**{**image.__dict__, "colour": None})
    with pytest.raises(ValueError, match="no colour"):
        view_surface(grey, RigidTransform(), TABLE)
