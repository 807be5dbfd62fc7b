"""Segmentation of an object in its box: the points above its plane that fill the box best.

Each level plane near the box is a hypothesis for the plane below the object; one more hypothesis has no plane. The
points above the plane are clustered; the hypothesis whose cluster fills the box best wins. Heights are along z in the
level frame O of the picture's frame tree.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from skills.class_forms import ClassForm
from skills.perception.fitting import LevelPlane
from skills.perception.point_cloud import (
    MAX_DEPTH_M,
    MIN_DEPTH_M,
    Mask,
    grid_labels,
    lens_rays,
    nearest_pixels,
    project,
)
from skills.robot import FloatArray, Image, Intrinsics

Box = tuple[float, float, float, float]

_GROWN_SHARE = 0.35
_GROWN_LEAST_PX = 14.0
_MOST_PIXELS = 150
_BIN_M = 0.004
_FEWEST_ON_PLANE = 40
_LEAST_PLANE_SHARE = 0.05
_MOST_PLANES = 4
_FEWEST_POINTS = 12
_LOWEST_M = 0.004
_JOIN_GAIN = 0.05
_MOST_GROUPS = 5
_MOSTLY_INSIDE = 0.8
_SHARE_POWER = 0.7
_WITHOUT_PLANE = 0.85
_FLOATS_M = 0.025
_FLOATING = 0.7
_SMOOTHED = 5


@dataclass(frozen=True)
class Window:
    """Depth around a box, rows by columns: points p_O (H, W, 3), pixels (u, v) of the colour picture, depth z (m).

    `valid` marks pixels with depth, `inside` those in the box; `pixel_m` is the width of a pixel at 1 m.
    """

    p_O: FloatArray
    u: FloatArray
    v: FloatArray
    z: FloatArray
    valid: Mask
    inside: Mask
    box: Box
    p_OC: FloatArray
    pixel_m: float
    R_OC: FloatArray
    lens: Intrinsics

    def points(self, mask: Mask) -> FloatArray:
        """Points p_O (N, 3) of the pixels in a mask (H, W)."""
        return self.p_O.reshape(-1, 3).compress(mask.ravel(), axis=0)

    def rays_O(self) -> list[FloatArray]:
        """Rays through the midpoints of the box's left, right, top and bottom side, and through its centre."""
        u0, v0, u1, v1 = self.box
        um, vm = 0.5 * (u0 + u1), 0.5 * (v0 + v1)
        pixels = ((u0, vm), (u1, vm), (um, v0), (um, v1), (um, vm))
        return [
            self.R_OC @ np.array([(u - self.lens.cx) / self.lens.fx, (v - self.lens.cy) / self.lens.fy, 1.0])
            for u, v in pixels
        ]

    def border_px(self, p_O: FloatArray) -> float:
        """Distance from a point to the nearest edge of the picture, in pixels; negative outside the picture."""
        p_C = self.R_OC.T @ (p_O - self.p_OC)
        if p_C[2] < MIN_DEPTH_M:
            return -math.inf
        u, v = project(p_C, self.lens)
        return float(min(u, v, self.lens.width - 1 - u, self.lens.height - 1 - v))


@dataclass(frozen=True)
class ObjectSegment:
    """Segment of an object: its mask in the window, the plane below (None: unseen), and its fit to the box (0 to 1).

    An empty mask means that nothing rises above the plane: the object is flat. `covered` is the fraction of the box
    that the segment covers.
    """

    window: Window
    mask: Mask
    plane: LevelPlane | None
    fit: float
    covered: float

    @property
    def pixels(self) -> NDArray[np.int64]:
        """Pixels (N, 2) of the object in the colour picture."""
        return nearest_pixels(self.window.u[self.mask], self.window.v[self.mask], self.window.lens)

    @property
    def points_O(self) -> FloatArray:
        """Points (N, 3) of the object."""
        return self.window.points(self.mask)


def window_about(image: Image, box: Box, taken: Mask | None = None) -> Window | None:
    """Crops the depth around a box of the colour picture; None when there is no depth.

    `taken` (H, W) marks the pixels of the colour picture that belong to other objects.
    """
    lens, depth_lens = image.intrinsics, image.depth_intrinsics
    if image.depth_m.ndim != 2 or image.depth_m.size == 0:
        return None
    u0, v0, u1, v1 = box
    grow_u, grow_v = (max(_GROWN_LEAST_PX, _GROWN_SHARE * size) for size in (u1 - u0, v1 - v0))
    columns = _pixel_range(
        u0 - grow_u, u1 + grow_u, lens.cx, lens.fx, depth_lens.cx, depth_lens.fx, image.depth_m.shape[1]
    )
    rows = _pixel_range(
        v0 - grow_v, v1 + grow_v, lens.cy, lens.fy, depth_lens.cy, depth_lens.fy, image.depth_m.shape[0]
    )
    if len(columns) == 0 or len(rows) == 0:
        return None
    z = image.depth_m[np.ix_(rows, columns)].astype(np.float64)
    valid = np.isfinite(z) & (z > MIN_DEPTH_M) & (z < MAX_DEPTH_M)
    z = np.where(valid, z, 0.0)
    x_all, y_all = lens_rays(depth_lens)
    x_ray, y_ray = x_all[columns], y_all[rows]
    rays = np.stack([*np.meshgrid(x_ray, y_ray), np.ones_like(z)], axis=-1)
    X_OC = image.frames.pose(image.camera_frame)
    p_O = (rays * z[..., None]) @ X_OC.rotation().matrix().T + X_OC.translation()
    u, v = np.meshgrid(x_ray * lens.fx + lens.cx, y_ray * lens.fy + lens.cy)
    if taken is not None:
        pixels = nearest_pixels(u, v, lens)
        valid &= ~taken[pixels[..., 1], pixels[..., 0]]
    inside = (u >= u0) & (u <= u1) & (v >= v0) & (v <= v1)
    if not np.any(valid & inside):
        return None
    step = float(columns[1] - columns[0]) if len(columns) > 1 else 1.0
    return Window(
        p_O, u, v, z, valid, inside, box, X_OC.translation(), step / depth_lens.fx, X_OC.rotation().matrix(), lens
    )


def _pixel_range(
    low: float, high: float, c: float, f: float, depth_c: float, depth_f: float, size: int
) -> NDArray[np.int64]:
    """Rows or columns of the depth picture that correspond to a range in the colour picture, at most `_MOST_PIXELS`."""
    first = max(0, math.ceil((low - c) / f * depth_f + depth_c))
    last = min(size - 1, math.floor((high - c) / f * depth_f + depth_c))
    step = max(1, math.ceil((last - first + 1) / _MOST_PIXELS))
    return np.arange(first, last + 1, step, dtype=np.int64)


def segment_object(window: Window, form: ClassForm) -> ObjectSegment:
    """Segments the object of a class form in its window."""
    planes = [*level_planes(window), None]
    hypotheses = [each for plane in planes for each in _hypotheses(window, plane, form)]
    return max(hypotheses, key=lambda each: each.fit)


def level_planes(window: Window) -> list[LevelPlane]:
    """Fits level planes near the box, those with the most points first; slopes beyond 2 degrees are clutter."""
    around = window.points(window.valid & ~window.inside)
    if len(around) < _FEWEST_ON_PLANE:
        around = window.points(window.valid)
    if len(around) < _FEWEST_ON_PLANE:
        return []
    low, high = float(around[:, 2].min()), float(around[:, 2].max())
    counts, edges = np.histogram(around[:, 2], bins=np.arange(low - 2 * _BIN_M, high + 3 * _BIN_M, _BIN_M))
    smooth = np.convolve(counts, [1.0, 2.0, 3.0, 2.0, 1.0], mode="same") / 3.0
    planes, points = [], window.points(window.valid)
    for height_m in _peaks(smooth, edges, max(_FEWEST_ON_PLANE, _LEAST_PLANE_SHARE * len(around))):
        near = points[np.abs(points[:, 2] - height_m) < 0.02]
        if len(near) >= _FEWEST_ON_PLANE:
            planes.append(LevelPlane.fit(near, height_m, noise_m=0.005, band_m=0.004, sigmas=2.0, steps=3))
    return planes


def _peaks(counts: FloatArray, edges: FloatArray, least: float) -> Iterator[float]:
    """Yields the heights of the highest peaks, at least 3 cm apart."""
    left = counts.copy()
    apart = round(0.03 / _BIN_M)
    for _ in range(_MOST_PLANES):
        k = int(np.argmax(left))
        if left[k] < least:
            return
        yield float(edges[k] + 0.5 * _BIN_M)
        left[max(0, k - apart) : k + apart + 1] = 0.0


def _hypotheses(window: Window, plane: LevelPlane | None, form: ClassForm) -> Iterator[ObjectSegment]:
    """Yields the segment from each clustering, under the hypothesis of one plane, or of none."""
    standing = window.valid & ~in_plane(window, plane)
    clusterings = [_groups_from_above(window, standing), groups_in_picture(window, standing)]
    if form.form != "long":
        clusterings.append(groups_in_picture(window, standing, parted=True))
    for labels, count in clusterings:
        mask, fit = _best_groups(window, labels, count, form)
        yield ObjectSegment(window, mask, plane, fit * _contact(window, mask, plane), _covered(window, mask))


def _contact(window: Window, mask: Mask, plane: LevelPlane | None) -> float:
    """1 for a segment that begins right above its plane; less for a segment that floats or has no plane."""
    if plane is None or not np.any(mask):
        return _WITHOUT_PLANE
    points = window.points(mask)
    lowest = float(np.percentile(points[:, 2] - plane.z(points[:, :2]), 2))
    return 1.0 if lowest < _FLOATS_M else _FLOATING


def _best_groups(window: Window, labels: NDArray[np.int32], count: int, form: ClassForm) -> tuple[Mask, float]:
    """The cluster that fits best, joined with other clusters inside the box that improve the fit.

    Tries both the best of all clusters, which may reach beyond the box as a wall does, and the best inside the box.
    """
    largest = _largest_inside(window, labels, count)
    fits = {k: _fit(window, labels == k, form) for k in largest}
    order = sorted(fits, key=lambda k: -fits[k])
    inside = [k for k in order if _share_inside(window, labels == k) >= _MOSTLY_INSIDE]
    firsts = dict.fromkeys([*order[:1], *inside[:1]])
    options = [_with_others(window, labels, first, inside, fits[first], form) for first in firsts]
    mask, fit = max(options, key=lambda option: option[1], default=(np.zeros_like(window.valid), 0.0))
    return mask & window.inside, fit


def _with_others(
    window: Window, labels: NDArray[np.int32], first: int, others: list[int], fit: float, form: ClassForm
) -> tuple[Mask, float]:
    """A cluster joined, one after the other, with those of `others` that improve its fit."""
    mask = labels == first
    for k in others:
        both = _fit(window, mask | (labels == k), form) if k != first else 0.0
        if both > fit + _JOIN_GAIN:
            mask, fit = mask | (labels == k), both
    return mask, fit


def _share_inside(window: Window, mask: Mask) -> float:
    """Fraction of a cluster that lies in the box."""
    return int((mask & window.inside).sum()) / max(int(mask.sum()), 1)


def _largest_inside(window: Window, labels: NDArray[np.int32], count: int) -> list[int]:
    """Clusters with the most points in the box."""
    sizes = np.bincount(labels[window.inside], minlength=count)
    sizes[0] = 0
    order = np.argsort(-sizes)[:_MOST_GROUPS]
    return [int(k) for k in order if sizes[k] >= _FEWEST_POINTS]


def in_plane(window: Window, plane: LevelPlane | None) -> Mask:
    """Mask of the points in the plane or below it, after smoothing of the depth noise."""
    if plane is None:
        return np.zeros_like(window.valid)
    above = np.where(window.valid, window.p_O[..., 2] - plane.z(window.p_O[..., :2]), 0.0)
    weight = cv2.boxFilter(window.valid.astype(np.float64), -1, (_SMOOTHED, _SMOOTHED))
    smooth = cv2.boxFilter(np.clip(above, -0.05, 0.05), -1, (_SMOOTHED, _SMOOTHED)) / np.maximum(weight, 1e-6)
    return np.asarray(smooth < max(_LOWEST_M, 1.2 * plane.noise_m))


def _groups_from_above(window: Window, standing: Mask) -> tuple[NDArray[np.int32], int]:
    """Clusters points on a grid seen from above: labels (H, W), 0 for none, and the number of labels."""
    labels = np.zeros(standing.shape, dtype=np.int32)
    points = window.points(standing)
    if len(points) < _FEWEST_POINTS:
        return labels, 1
    about = standing & window.inside
    cell_m = 0.006 + 2.5 * window.pixel_m * float(np.median(window.z[about if np.any(about) else standing]))
    labels[standing], count = grid_labels(points[:, :2], cell_m, fewest=2)
    return labels, count


def groups_in_picture(window: Window, standing: Mask, *, parted: bool = False) -> tuple[NDArray[np.int32], int]:
    """Clusters neighbouring pixels without a step in depth: labels (H, W), 0 for none, and the number of labels.

    `parted` cuts narrow bridges between clusters.
    """
    kernel = np.ones((3, 3), np.uint8)
    farthest = cv2.dilate(np.where(standing, window.z, 0.0), kernel)
    nearest = cv2.erode(np.where(standing, window.z, 99.0), kernel)
    step_m = 0.008 + 4.0 * window.pixel_m * window.z + 0.004 * window.z**2
    smooth = (standing & (farthest - nearest < step_m)).astype(np.uint8)
    kernel = np.ones((7, 7), np.uint8) if parted else kernel
    count, cores = cv2.connectedComponents(cv2.erode(smooth, np.ones((5, 5))) if parted else smooth, connectivity=4)
    grown = cv2.dilate(cores.astype(np.float32), kernel).astype(np.int32)
    return np.where(standing, np.where(cores > 0, cores, grown), 0).astype(np.int32), int(count)


def _fit(window: Window, mask: Mask, form: ClassForm) -> float:
    """Fit of a cluster to the detection's box and to the size of its class, 0 to 1."""
    inside = mask & window.inside
    share = _share_inside(window, mask)
    return float(_covered(window, inside) * share**_SHARE_POWER * _sized(window.points(inside), form) ** 2)


def _covered(window: Window, inside: Mask) -> float:
    """Fraction of the box that the bounding box of the pixels `inside` fills."""
    if not np.any(inside):
        return 0.0
    (left, right), (top, bottom) = np.percentile([window.u[inside], window.v[inside]], [1, 99], axis=1).T
    u0, v0, u1, v1 = window.box
    return float(min((right - left) * (bottom - top) / max((u1 - u0) * (v1 - v0), 1e-6), 1.0))


def _sized(points: FloatArray, form: ClassForm) -> float:
    """1 for points no larger than an object of the form; the more they extend beyond it, the less."""
    middled = points - np.median(points, axis=0)
    _, axes = np.linalg.eigh(middled.T @ middled)
    low, high = np.percentile(middled @ axes, [3, 97], axis=0)
    _, width, length = high - low
    return float(min(1.0, form.length_m[1] / max(length, 1e-6)) * min(1.0, form.width_m[1] / max(width, 1e-6)))
