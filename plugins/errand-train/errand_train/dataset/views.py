"""Views of the robot's cameras on an object: hand and body cameras, heights, tilts, distances."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix

from errand_train.dataset.compose import Placed
from errand_train.dataset.room import Obstacle, Room
from errand_train.dataset.silhouette import project
from plant.robots.spot.description import CAMERAS
from plant.scene_pictures import look_at
from plant.sensors.camera_spec import CameraSpec, load_cameras
from skills.robot import FloatArray, Intrinsics

BODY_SHARE = 0.4
FULL_SIZE_SHARE = 0.35
NEAREST_M, FARTHEST_M = 0.3, 6.0
STANDING_HEIGHT_M = 0.52
LEAST_PIXELS = 14
TRIES = 80


@dataclass(frozen=True)
class View:
    """A view: camera by name, its pose and intrinsics, grey or not; with `in_hand` the hand is in front of it."""

    camera: str
    X_WC: RigidTransform
    intrinsics: Intrinsics
    grey: bool
    in_hand: bool


@cache
def camera_specs() -> Mapping[str, CameraSpec]:
    """Cameras of the robot, by name."""
    return load_cameras(CAMERAS)


def roll_deg(X_WC: RigidTransform) -> float:
    """Clockwise roll of the picture from upright, in degrees; 0 when it looks straight up or down."""
    up_C = X_WC.rotation().matrix().T @ np.array([0.0, 0.0, 1.0])
    if np.hypot(up_C[0], up_C[1]) < 1e-6:
        return 0.0
    return float(np.degrees(np.arctan2(up_C[0], -up_C[1])))


def view_of(rng: np.random.Generator, room: Room, item: Placed, specs: Mapping[str, CameraSpec]) -> View | None:
    """Draws a view that has an object somewhere in the picture; None when none was found."""
    in_body = rng.random() < BODY_SHARE
    for _ in range(TRIES):
        view = _body_view(rng, room, item, specs) if in_body else _hand_view(rng, room, item, specs["hand"])
        if view is not None and _sees(view, room.obstacles, _aim(item)):
            return view
    return None


def any_view(rng: np.random.Generator, room: Room, specs: Mapping[str, CameraSpec]) -> View:
    """Draws a view into the room from anywhere."""
    width, depth, height = room.size_m
    eye = np.array(
        [rng.uniform(0.2, width - 0.2), rng.uniform(0.2, depth - 0.2), rng.uniform(0.3, min(1.7, height - 0.2))]
    )
    target = np.array([rng.uniform(0, width), rng.uniform(0, depth), rng.uniform(0, 1.2)])
    target[:2] += (target[:2] - eye[:2]) * 0.2 + 0.01
    return View("hand", look_at(eye, target), _varied(rng, specs["hand"].intrinsics()), False, False)


def _aim(item: Placed) -> FloatArray:
    """Target of the view: the middle of an object, or a point of a person's upper body."""
    points = item.model.surface.points
    middle = (points.min(axis=0) + points.max(axis=0)) / 2
    if item.model.category == "person":
        middle = middle + np.array([0, 0, 0.2 * float(np.ptp(points[:, 2]))])
    return np.asarray(item.X_WO @ middle)


def distance_to(rng: np.random.Generator, item: Placed, focal: float) -> float:
    """Draws a distance, log-uniform from where the object fills the picture to where it is some pixels long."""
    size = float(max(item.model.size_m))
    near = max(NEAREST_M, 0.55 * size)
    far = min(FARTHEST_M, focal * size / LEAST_PIXELS)
    return float(np.exp(rng.uniform(np.log(near), np.log(max(far, near * 1.2)))))


def _varied(rng: np.random.Generator, camera: Intrinsics) -> Intrinsics:
    """Every camera differs a little."""
    scale, cx, cy = float(rng.uniform(0.94, 1.06)), float(rng.normal(0, 3)), float(rng.normal(0, 3))
    return Intrinsics(camera.width, camera.height, camera.fx * scale, camera.fy * scale, camera.cx + cx, camera.cy + cy)


def eye_about(rng: np.random.Generator, item: Placed, aim: FloatArray, focal: float) -> FloatArray:
    """Draws a position (3,) of the hand camera to view `aim`: mostly from above, people from about level."""
    distance, around = distance_to(rng, item, focal), float(rng.uniform(0, 2 * np.pi))
    above = float(np.radians(rng.uniform(-5, 75) if item.model.category != "person" else rng.uniform(-25, 25)))
    direction = np.array([np.cos(above) * np.cos(around), np.cos(above) * np.sin(around), np.sin(above)])
    return np.asarray(aim + distance * direction)


def _hand_view(rng: np.random.Generator, room: Room, item: Placed, spec: CameraSpec) -> View | None:
    camera, aim = _varied(rng, spec.intrinsics()), _aim(item)
    eye = eye_about(rng, item, aim, camera.fx)
    if not _free(eye, room) or not 0.12 < eye[2] < 1.8:
        return None
    roll = float(rng.normal(0, 0.05) if rng.random() < 0.8 else rng.normal(0, 0.7))
    return View("hand", off_centre(rng, look_at(eye, aim), camera, roll), camera, bool(rng.random() < 0.08), False)


def off_centre(rng: np.random.Generator, X_WC: RigidTransform, camera: Intrinsics, roll: float) -> RigidTransform:
    """Rotates a camera so that its target is anywhere in the picture."""
    yaw = float(rng.uniform(-0.8, 0.8)) * np.arctan(camera.width / 2 / camera.fx)
    pitch = float(rng.uniform(-0.8, 0.8)) * np.arctan(camera.height / 2 / camera.fy)
    turn = RotationMatrix(RollPitchYaw(pitch, yaw, 0.0)) @ RotationMatrix(RollPitchYaw(0.0, 0.0, roll))
    return RigidTransform(X_WC.rotation() @ turn, X_WC.translation())


def _body_view(rng: np.random.Generator, room: Room, item: Placed, specs: Mapping[str, CameraSpec]) -> View | None:
    """The robot stands on the floor, turned so that one of its body cameras looks about towards the object."""
    spec = specs[str(rng.choice([name for name in specs if name != "hand"]))]
    shrink = 1 if rng.random() < FULL_SIZE_SHARE else spec.picture_shrink
    camera = _varied(rng, spec.model_copy(update={"picture_shrink": shrink}).intrinsics())
    aim, distance, bearing = _aim(item), distance_to(rng, item, camera.fx) + 0.3, float(rng.uniform(0, 2 * np.pi))
    x, y = aim[:2] + distance * np.array([np.cos(bearing), np.sin(bearing)])
    height = STANDING_HEIGHT_M + float(rng.normal(0, 0.04))
    if not (0.4 < x < room.size_m[0] - 0.4 and 0.4 < y < room.size_m[1] - 0.4):
        return None
    X_BC = spec.X_link_camera()
    ahead = X_BC.rotation().matrix()[:, 2]
    yaw = bearing + np.pi - float(np.arctan2(ahead[1], ahead[0])) + float(rng.normal(0, 0.35))
    X_WB = RigidTransform(RollPitchYaw(rng.normal(0, 0.02), rng.normal(0, 0.10), yaw), [x, y, height])
    view = View(spec.name, X_WB @ X_BC, camera, not spec.colour, False)
    return view if _free(view.X_WC.translation(), room) else None


def _free(eye: FloatArray, room: Room) -> bool:
    """Returns whether a camera may be at a point: inside the room and in no furniture."""
    w, d, h = room.size_m
    if not (0.08 < eye[0] < w - 0.08 and 0.08 < eye[1] < d - 0.08 and 0.05 < eye[2] < h - 0.08):
        return False
    return not any(np.all(eye > o.low - 0.05) and np.all(eye < o.high + 0.05) for o in room.obstacles)


def _sees(view: View, obstacles: Sequence[Obstacle], aim: FloatArray) -> bool:
    """Returns whether the point is in the picture and no furniture hides it."""
    in_camera = np.asarray(view.X_WC.inverse() @ aim)
    camera = view.intrinsics
    if in_camera[2] < 0.15:
        return False
    u, v = project(in_camera[None], camera)[0]
    if not (-0.02 * camera.width < u < 1.02 * camera.width and -0.02 * camera.height < v < 1.02 * camera.height):
        return False
    way = view.X_WC.translation() + np.linspace(0.0, 0.92, 24)[:, None] * (aim - view.X_WC.translation())
    return not any(np.any(np.all((way > o.low) & (way < o.high), axis=1)) for o in obstacles)
