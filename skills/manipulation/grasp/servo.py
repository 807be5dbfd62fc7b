"""Visual servoing: measures how an object has shifted, in the hand camera's view from just before the grasp.

It shifts the object's known points until their outline fits the picture best (analysis by synthesis). Pixels nearer
than the camera's minimum depth have no depth, and count as part of the object.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray
from pydrake.math import RigidTransform

from skills.manipulation.arm.collision import ArmScene
from skills.manipulation.arm.kinematics import ArmModel
from skills.manipulation.grasp.placements import Target
from skills.manipulation.grasp.planning import GraspPlan
from skills.perception.point_cloud import lens_rays, project
from skills.robot import ArmTrajectory, FloatArray, Image, Intrinsics

SEARCHED_M: Final = 0.06
"""Largest shift that is searched."""
_STEPS_M: Final = ((0.01, SEARCHED_M), (0.0025, 0.0075))
"""Step and range of the coarse and of the fine search."""
_WIDTH_PX = 80
"""Width of the reduced picture."""
_POINTS = 300
"""Number of the object's points that are used."""
_LEVELS = 4
"""Number of heights of the points that are added below the observed ones."""
_BEHIND_M = 0.03
"""Depth behind the object beyond which pixels are not its own."""
_NEAREST_M = 0.22
"""Least depth of the camera."""
_OF_HEIGHT = 0.3
"""Fraction of the object's height below which its points do not count."""
_LEAST_HEIGHT_M = 0.004
"""Least height over the surface of the object's points that count."""
_WINDOW_PX = 9
"""Width of the window around the outline in which solid pixels count."""
_LOOKS_DOWN = 0.5
"""Least vertical component of a camera's axis at which it measures horizontal shifts in both directions."""
_PER_M = 0.5
"""Overlap that a shift of one metre must gain."""
_AIMED_M = 0.003
"""Shift below which the hand is not moved."""
_FAR_OFF_M = 0.05
"""Shift beyond which the object counts as gone."""
_LEAST_OVERLAP = 0.5
"""Overlap below which the object counts as gone."""

Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class SeenShift:
    """Horizontal shift (3,) of an object in B, and the overlap of its shifted outline with the picture."""

    offset_B: FloatArray
    overlap: float


def measure_shift(target: Target, image: Image, X_BC: RigidTransform) -> SeenShift | None:
    """Returns the shift of the object since `target` was observed, from the depth of a picture taken at X_BC.

    None when the object's position is out of view. The body must be level: its z axis points up.
    """
    picture = _Picture.around(target, image, X_BC)
    if not picture.shows_place:
        return None
    best = SeenShift(np.zeros(3), picture.overlap(np.zeros(3)))
    for step_m, reach_m in _STEPS_M:
        middle_B = best.offset_B
        for offset_B in _offsets(X_BC, step_m, reach_m):
            overlap, nearer_m = picture.overlap(middle_B + offset_B), np.linalg.norm(best.offset_B)
            if overlap + _PER_M * (nearer_m - np.linalg.norm(middle_B + offset_B)) > best.overlap:
                best = SeenShift(middle_B + offset_B, overlap)
    return best


Aim = tuple[FloatArray, tuple[ArmTrajectory, ArmTrajectory] | None]
"""Shift (3,) of the hand in B, and the approach from there, or None if that is not free."""


def aim_approach(
    found: SeenShift | None, plan: GraspPlan, model: ArmModel, scene_now: Callable[[], ArmScene]
) -> Aim | None:
    """Shifts a grasp across the fingers to the object's present position; None when the object is no longer there."""
    if found is None:
        return np.zeros(3), None
    if found.overlap < _LEAST_OVERLAP or np.linalg.norm(found.offset_B) > _FAR_OFF_M:
        return None
    closing_B = plan.candidate.X_BH.rotation().col(2)
    offset_B = (found.offset_B @ closing_B) * closing_B * [1.0, 1.0, 0.0]
    if np.linalg.norm(offset_B) < _AIMED_M:
        return np.zeros(3), None
    approach = [shift_trajectory(model, each, offset_B) for each in (plan.to_grasp, plan.last_bit)]
    scene = scene_now()
    scene.set_padding(0.0)
    free = [each for each in approach if each is not None and scene.path_free(each.positions_rad)]
    return offset_B, (free[0], free[1]) if len(free) == len(approach) else None


def shift_trajectory(model: ArmModel, trajectory: ArmTrajectory, offset_B: FloatArray) -> ArmTrajectory | None:
    """Returns the trajectory with the hand shifted by offset_B (3,) throughout; None when the arm cannot reach."""
    positions = list[FloatArray]()
    for q_rad in trajectory.positions_rad:
        X_BH = model.X_BH(q_rad)
        beside = RigidTransform(X_BH.rotation(), X_BH.translation() + offset_B)
        q = model.nearest_inverse(beside, positions[-1] if positions else q_rad)
        if q is None:
            return None
        positions.append(q)
    return ArmTrajectory(trajectory.times_s, np.array(positions))


def _offsets(X_BC: RigidTransform, step_m: float, reach_m: float) -> Iterator[FloatArray]:
    """Yields measurable horizontal shifts (3,): a grid, or only lateral shifts for a camera that looks ahead."""
    axis = X_BC.rotation().matrix()[:, 2]
    ahead = np.array([axis[0], axis[1], 0.0])
    ahead = ahead / np.linalg.norm(ahead) if np.linalg.norm(ahead) > 1e-3 else np.array([1.0, 0.0, 0.0])
    left = np.array([-ahead[1], ahead[0], 0.0])
    steps = np.arange(-reach_m, reach_m + 0.5 * step_m, step_m)
    for across, along in itertools.product(steps, steps if axis[2] < -_LOOKS_DOWN else (0.0,)):
        yield across * left + along * ahead


@dataclass(frozen=True)
class _Picture:
    """Reduced depth image: pixels on the object's space (`solid`), and pixels with information (`known`)."""

    solid: Mask
    known: Mask
    points_B: FloatArray
    X_CB: RigidTransform
    lens: Intrinsics
    stride: int

    @classmethod
    def around(cls, target: Target, image: Image, X_BC: RigidTransform) -> _Picture:
        """Reduces an image to the region around a target."""
        lens = image.depth_intrinsics
        stride = max(1, lens.width // _WIDTH_PX)
        depth = image.depth_m[::stride, ::stride].astype(np.float64)
        rays_B = _rays(lens, stride) @ X_BC.rotation().matrix().T
        points_B = _filled(target)
        with np.errstate(divide="ignore"):
            surface = (target.base_m - X_BC.translation()[2]) / rays_B[..., 2]
        surface = np.where(surface > 0.0, surface, np.inf)
        valid = (depth > 0.0) & np.isfinite(depth)
        above = X_BC.translation()[2] + depth * rays_B[..., 2] - target.base_m
        farthest = float((X_BC.inverse() @ points_B.T)[2].max()) + _BEHIND_M
        seen = valid & (above > _lowest_m(target)) & (depth < farthest)
        near = ~valid & (surface > _NEAREST_M)
        small = cv2.morphologyEx((seen | near).astype(np.uint8), cv2.MORPH_OPEN, np.ones((3, 3), np.uint8))
        return cls(small > 0, valid | near, points_B, X_BC.inverse(), lens, stride)

    @property
    def shows_place(self) -> bool:
        """Returns whether the known pixels cover at least half of the object's former outline."""
        outline = self._outline(np.zeros(3))
        return bool(outline.sum() > 0 and (outline & self.known).sum() > 0.5 * outline.sum())

    def overlap(self, offset_B: FloatArray) -> float:
        """Intersection over union of the shifted object's outline with the solid pixels around it."""
        outline = self._outline(offset_B)
        about = cv2.dilate(outline.astype(np.uint8), np.ones((_WINDOW_PX, _WINDOW_PX), np.uint8)) > 0
        both = (outline & self.solid & self.known).sum()
        either = ((outline | (self.solid & about)) & self.known).sum()
        return float(both / max(either, 1))

    def _outline(self, offset_B: FloatArray) -> Mask:
        """Mask of the pixels that the shifted object covers."""
        p_C = self.X_CB @ (self.points_B + offset_B).T
        pixels = project(p_C[:, p_C[2] > 0.02].T, self.lens)
        u, v = (np.rint(each / self.stride).astype(np.int64) for each in pixels)
        inside = (u >= 0) & (v >= 0) & (u < self.solid.shape[1]) & (v < self.solid.shape[0])
        mask = np.zeros(self.solid.shape, np.uint8)
        mask[v[inside], u[inside]] = 1
        return cv2.morphologyEx(mask, cv2.MORPH_CLOSE, np.ones((7, 7), np.uint8)) > 0


def _rays(lens: Intrinsics, stride: int) -> FloatArray:
    """Directions (H, W, 3) in the camera frame with z = 1, one for each pixel of the reduced picture."""
    x, y = (slopes[::stride] for slopes in lens_rays(lens))
    return np.stack([*np.meshgrid(x, y), np.ones((len(y), len(x)))], axis=-1)


def _lowest_m(target: Target) -> float:
    """Minimum height above the surface of the points that count; lower points are too near the surface."""
    return max(_OF_HEIGHT * target.height_m, _LEAST_HEIGHT_M)


def _filled(target: Target) -> FloatArray:
    """Points (N, 3) that fill an object: the observed ones, and points below them down to `_lowest_m`."""
    low_m = target.base_m + _lowest_m(target)
    seen = target.points_B[target.points_B[:, 2] > low_m]
    seen = seen[:: max(1, len(seen) // _POINTS)]
    heights = [low_m + part * (seen[:, 2] - low_m) for part in np.linspace(0.0, 1.0, _LEVELS)]
    return np.concatenate([np.column_stack([seen[:, :2], height]) for height in heights])
