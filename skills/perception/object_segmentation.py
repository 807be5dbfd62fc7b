"""The points of an object among those in its box: what stands above the plane below it, and fills the box best.

Every level plane that is seen about the box is supposed to be what the object rests on, in turn, and so is none. What
stands above it is grouped as seen from above; the supposition counts whose group has the box of the detection.
Heights are along z of the level frame O of the picture's frame tree.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from skills.perception.class_forms import ClassForm
from skills.perception.plane import LevelPlane
from skills.perception.point_cloud import MAX_DEPTH_M, MIN_DEPTH_M, grid_labels
from skills.robot import FloatArray, Image, Intrinsics

Box = tuple[float, float, float, float]
Mask = NDArray[np.bool_]

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
_FLOATS_M, _FLOATING = 0.025, 0.7
_SMOOTHED = 5
_GAP_PX = 11


@dataclass(frozen=True)
class Window:
    """The depth about a box, rows by columns: points p_O (H, W, 3), pixels (u, v) of the colour picture, depth z (m).

    `valid` says where there is depth, `inside` which pixels lie in the box; `pixel_m` is what a pixel spans at 1 m.
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

    def rays_O(self) -> list[FloatArray]:
        """Rays through the middles of the left, right, top and bottom side of the box, and through its middle."""
        u0, v0, u1, v1 = self.box
        um, vm = 0.5 * (u0 + u1), 0.5 * (v0 + v1)
        pixels = ((u0, vm), (u1, vm), (um, v0), (um, v1), (um, vm))
        return [
            self.R_OC @ np.array([(u - self.lens.cx) / self.lens.fx, (v - self.lens.cy) / self.lens.fy, 1.0])
            for u, v in pixels
        ]

    def border_px(self, p_O: FloatArray) -> float:
        """How far from the nearest edge of the picture a point is seen, negative outside of it."""
        x, y, z = self.R_OC.T @ (p_O - self.p_OC)
        if z < MIN_DEPTH_M:
            return -math.inf
        u, v = x / z * self.lens.fx + self.lens.cx, y / z * self.lens.fy + self.lens.cy
        return float(min(u, v, self.lens.width - 1 - u, self.lens.height - 1 - v))


@dataclass(frozen=True)
class ObjectSegment:
    """The points of an object: their mask in the window, the plane below (None: unseen), how well they fit the box.

    An empty mask means that nothing rises above the plane: the object is flat.
    """

    window: Window
    mask: Mask
    plane: LevelPlane | None
    fit: float
    covered: float

    def pixel_mask(self, height: int, width: int) -> Mask:
        """The object's pixels in the whole colour picture (height, width), the gaps between them closed."""
        mask = np.zeros((height, width), dtype=np.uint8)
        u, v = self.window.u[self.mask], self.window.v[self.mask]
        mask[_index(v, height), _index(u, width)] = 1
        return np.asarray(cv2.morphologyEx(mask, cv2.MORPH_CLOSE, np.ones((_GAP_PX, _GAP_PX), np.uint8)) > 0)

    @property
    def points_O(self) -> FloatArray:
        """The points (N, 3)."""
        return np.asarray(self.window.p_O[self.mask])


def window_about(image: Image, box: Box, taken: Mask | None = None) -> Window | None:
    """The depth about a box of the colour picture; None when no depth is there at all.

    `taken` (H, W) says which pixels of the colour picture are known to be other objects.
    """
    lens, depth_lens = image.intrinsics, image.depth_intrinsics
    if image.depth_m.ndim != 2 or image.depth_m.size == 0:
        return None
    u0, v0, u1, v1 = box
    grow_u, grow_v = (max(_GROWN_LEAST_PX, _GROWN_SHARE * size) for size in (u1 - u0, v1 - v0))
    columns = _pixels(u0 - grow_u, u1 + grow_u, lens.cx, lens.fx, depth_lens.cx, depth_lens.fx, image.depth_m.shape[1])
    rows = _pixels(v0 - grow_v, v1 + grow_v, lens.cy, lens.fy, depth_lens.cy, depth_lens.fy, image.depth_m.shape[0])
    if len(columns) == 0 or len(rows) == 0:
        return None
    z = image.depth_m[np.ix_(rows.astype(int), columns.astype(int))].astype(np.float64)
    valid = np.isfinite(z) & (z > MIN_DEPTH_M) & (z < MAX_DEPTH_M)
    z = np.where(valid, z, 0.0)
    x_ray, y_ray = (columns - depth_lens.cx) / depth_lens.fx, (rows - depth_lens.cy) / depth_lens.fy
    rays = np.stack([*np.meshgrid(x_ray, y_ray), np.ones_like(z)], axis=-1)
    X_OC = image.frames.pose(image.camera_frame)
    p_O = (rays * z[..., None]) @ X_OC.rotation().matrix().T + X_OC.translation()
    u, v = np.meshgrid(x_ray * lens.fx + lens.cx, y_ray * lens.fy + lens.cy)
    if taken is not None:
        valid &= ~taken[_index(v, taken.shape[0]), _index(u, taken.shape[1])]
    inside = (u >= u0) & (u <= u1) & (v >= v0) & (v <= v1)
    if not np.any(valid & inside):
        return None
    step = float(columns[1] - columns[0]) if len(columns) > 1 else 1.0
    return Window(
        p_O, u, v, z, valid, inside, box, X_OC.translation(), step / depth_lens.fx, X_OC.rotation().matrix(), lens
    )


def _index(values: FloatArray, size: int) -> NDArray[np.int64]:
    return np.clip(np.rint(values), 0, size - 1).astype(np.int64)


def _pixels(low: float, high: float, c: float, f: float, depth_c: float, depth_f: float, size: int) -> FloatArray:
    """Rows or columns of the depth picture between two of the colour picture, at most `_MOST_PIXELS` of them."""
    first = max(0, math.ceil((low - c) / f * depth_f + depth_c))
    last = min(size - 1, math.floor((high - c) / f * depth_f + depth_c))
    step = max(1, math.ceil((last - first + 1) / _MOST_PIXELS))
    return np.arange(first, last + 1, step, dtype=np.float64)


def segment_object(window: Window, form: ClassForm) -> ObjectSegment:
    """What in the window is the object, whose class has a form."""
    planes = [*level_planes(window), None]
    found = [each for plane in planes for each in _supposing(window, plane, form)]
    return max(found, key=lambda each: each.fit)


def level_planes(window: Window) -> list[LevelPlane]:
    """Level planes about the box, the ones with the most points first."""
    around = window.p_O[window.valid & ~window.inside]
    if len(around) < _FEWEST_ON_PLANE:
        around = window.p_O[window.valid]
    if len(around) < _FEWEST_ON_PLANE:
        return []
    low, high = float(around[:, 2].min()), float(around[:, 2].max())
    counts, edges = np.histogram(around[:, 2], bins=np.arange(low - 2 * _BIN_M, high + 3 * _BIN_M, _BIN_M))
    smooth = np.convolve(counts, [1.0, 2.0, 3.0, 2.0, 1.0], mode="same") / 3.0
    planes = []
    for height_m in _peaks(smooth, edges, max(_FEWEST_ON_PLANE, _LEAST_PLANE_SHARE * len(around))):
        plane = _fitted(window.p_O[window.valid], height_m)
        if plane is not None:
            planes.append(plane)
    return planes


def _peaks(counts: FloatArray, edges: FloatArray, least: float) -> Iterator[float]:
    """Heights of the highest peaks, those at least 3 cm apart."""
    left = counts.copy()
    apart = round(0.03 / _BIN_M)
    for _ in range(_MOST_PLANES):
        k = int(np.argmax(left))
        if left[k] < least:
            return
        yield float(edges[k] + 0.5 * _BIN_M)
        left[max(0, k - apart) : k + apart + 1] = 0.0


def _fitted(points: FloatArray, height_m: float) -> LevelPlane | None:
    """The plane near a height, by trimmed least squares; a slope beyond 2 degrees is taken for clutter."""
    near = points[np.abs(points[:, 2] - height_m) < 0.02]
    if len(near) < _FEWEST_ON_PLANE:
        return None
    origin = near[:, :2].mean(axis=0)
    plane = LevelPlane((float(origin[0]), float(origin[1])), height_m, (0.0, 0.0), 0.005)
    for _ in range(3):
        plane = plane.refined(near, max(0.004, 2.0 * plane.noise_m)) or plane
    return plane


def _supposing(window: Window, plane: LevelPlane | None, form: ClassForm) -> Iterator[ObjectSegment]:
    """The segment if the object rests on a plane, or on nothing that is seen; by each way of grouping."""
    standing = window.valid & ~_level(window, plane)
    ways = [_groups_from_above(window, standing), _groups_in_picture(window, standing, parted=False)]
    if form.form != "long":
        ways.append(_groups_in_picture(window, standing, parted=True))
    for labels, count in ways:
        mask, fit = _best_groups(window, labels, count, form)
        yield ObjectSegment(window, mask, plane, fit * _resting(window, mask, plane), _covered(window, mask))


def _resting(window: Window, mask: Mask, plane: LevelPlane | None) -> float:
    """1 for what begins right above its plane, less for what floats, or stands on nothing that is seen."""
    if plane is None or not np.any(mask):
        return _WITHOUT_PLANE
    points = window.p_O[mask]
    lowest = float(np.percentile(points[:, 2] - plane.z(points[:, :2]), 2))
    return 1.0 if lowest < _FLOATS_M else _FLOATING


def _best_groups(window: Window, labels: NDArray[np.int32], count: int, form: ClassForm) -> tuple[Mask, float]:
    """The group that fits best, with others that hardly reach beyond the box where they make it fit better.

    The first may be one that reaches beyond, such as a wall, or else one that does not.
    """
    largest = _largest_inside(window, labels, count)
    fits = {k: _fit(window, labels == k, form) for k in largest}
    order = sorted(fits, key=lambda k: -fits[k])
    kept = [k for k in order if _share_inside(window, labels == k) >= _MOSTLY_INSIDE]
    firsts = dict.fromkeys([*order[:1], *kept[:1]])
    options = [_with_others(window, labels, first, kept, fits[first], form) for first in firsts]
    mask, fit = max(options, key=lambda option: option[1], default=(np.zeros_like(window.valid), 0.0))
    return mask & window.inside, fit


def _with_others(
    window: Window, labels: NDArray[np.int32], first: int, others: list[int], fit: float, form: ClassForm
) -> tuple[Mask, float]:
    """A group with those of some others that make it fit better, one after the other."""
    mask = labels == first
    for k in others:
        both = _fit(window, mask | (labels == k), form) if k != first else 0.0
        if both > fit + _JOIN_GAIN:
            mask, fit = mask | (labels == k), both
    return mask, fit


def _share_inside(window: Window, mask: Mask) -> float:
    """The share of a group that lies in the box."""
    return int((mask & window.inside).sum()) / max(int(mask.sum()), 1)


def _largest_inside(window: Window, labels: NDArray[np.int32], count: int) -> list[int]:
    """The groups with the most points in the box."""
    sizes = np.bincount(labels[window.inside], minlength=count)
    sizes[0] = 0
    order = np.argsort(-sizes)[:_MOST_GROUPS]
    return [int(k) for k in order if sizes[k] >= _FEWEST_POINTS]


def _level(window: Window, plane: LevelPlane | None) -> Mask:
    """What lies in the plane or below it; the depth's noise is smoothed away."""
    if plane is None:
        return np.zeros_like(window.valid)
    above = np.where(window.valid, window.p_O[..., 2] - plane.z(window.p_O[..., :2]), 0.0)
    weight = cv2.boxFilter(window.valid.astype(np.float64), -1, (_SMOOTHED, _SMOOTHED))
    smooth = cv2.boxFilter(np.clip(above, -0.05, 0.05), -1, (_SMOOTHED, _SMOOTHED)) / np.maximum(weight, 1e-6)
    return np.asarray(smooth < max(_LOWEST_M, 1.2 * plane.noise_m))


def _groups_from_above(window: Window, standing: Mask) -> tuple[NDArray[np.int32], int]:
    """Points grouped by neighbourhood on a grid seen from above: labels (H, W), 0 for none, and their number + 1."""
    labels = np.zeros(standing.shape, dtype=np.int32)
    points = window.p_O[standing]
    if len(points) < _FEWEST_POINTS:
        return labels, 1
    about = standing & window.inside
    cell_m = 0.006 + 2.5 * window.pixel_m * float(np.median(window.z[about if np.any(about) else standing]))
    labels[standing], count = grid_labels(points[:, :2], cell_m, fewest=2)
    return labels, count


def _groups_in_picture(window: Window, standing: Mask, *, parted: bool) -> tuple[NDArray[np.int32], int]:
    """Points grouped by neighbourhood in the picture where the depth has no step: labels (H, W), and their number + 1.

    `parted` cuts narrow bridges between groups.
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
    """How well a group has the box of the detection and the size of its class, 0 to 1."""
    inside = mask & window.inside
    share = _share_inside(window, mask)
    return float(_covered(window, inside) * share**_SHARE_POWER * _sized(window.p_O[inside], form) ** 2)


def _covered(window: Window, inside: Mask) -> float:
    """The share of the box that the box about some of its pixels fills."""
    if not np.any(inside):
        return 0.0
    (left, right), (top, bottom) = np.percentile(window.u[inside], [1, 99]), np.percentile(window.v[inside], [1, 99])
    u0, v0, u1, v1 = window.box
    return float(min((right - left) * (bottom - top) / max((u1 - u0) * (v1 - v0), 1e-6), 1.0))


def _sized(points: FloatArray, form: ClassForm) -> float:
    """1 for points that an object of the form has room for, less the more they are spread beyond it."""
    middled = points - np.median(points, axis=0)
    _, axes = np.linalg.eigh(middled.T @ middled)
    low, high = np.percentile(middled @ axes, [3, 97], axis=0)
    _, width, length = high - low
    return float(min(1.0, form.length_m[1] / max(length, 1e-6)) * min(1.0, form.width_m[1] / max(width, 1e-6)))
