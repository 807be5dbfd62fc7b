"""Position of a detected object: the centre of the whole object, not of its visible side, with the covariance.

The segment in the box gives the visible side. The form of the class says how far the object extends behind it:

| form | centre |
|---|---|
| round, upright | the axis: behind the nearest points by half the width across the view, or of the circle that fits |
| round, lying | the outline from above, extended from its near side to the object's height |
| box | the outline from above, extended from its near sides to the object's height |
| long | the outline from above; for a flat object, the point where the ray of the box's middle meets the plane |
| person | behind the nearest points by half a body's depth; from the floor to the visible top, or a usual height |

The centre is halfway up from the plane to the top. An object that the picture's edge cuts off has its usual length.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from skills.api import Detection
from skills.class_forms import ClassForm, class_form
from skills.perception.fitting import LevelPlane, fit_circle, fit_rectangle, without_strays
from skills.perception.object_segmentation import ObjectSegment, Window, segment_object, window_about
from skills.perception.point_cloud import Mask, distinct_cells
from skills.robot import FloatArray, Image

_UPRIGHT = 1.15
_LEAST_LONG_COVERED = 0.75
_STRIP_M = 0.006
_REACH_M = 0.25
_GRAZING = 0.08
_PERSON_DEPTH_M = 0.30
_PERSON_BEHIND_M = 0.10
_PERSON_HEIGHT_M = 1.70
_PERSON_HALF_M = 0.4
_FEWEST_POINTS = 12
_BORDER_PX = 2.0
_END_AT_BORDER_PX = 30.0


@dataclass(frozen=True)
class Extents:
    """Upright bounding box of an object in the level frame: centre, length, width, height (m), yaw of its length.

    `sigma_m` are the standard deviations of the centre along the view, across it and upwards (m).
    """

    middle: tuple[float, float, float]
    length_m: float
    width_m: float
    height_m: float
    yaw_rad: float
    round: bool
    sigma_m: tuple[float, float, float]


@dataclass(frozen=True)
class Position:
    """Position of an object in the odometry frame at capture: p_OT (m), covariance (3, 3), extents and segment."""

    p_OT: FloatArray
    covariance_O: FloatArray
    extents: Extents
    segment: ObjectSegment

    @property
    def spanned_m(self) -> float:
        """Length of the longer side of the box at the depth of the object, in metres."""
        window = self.segment.window
        u0, v0, u1, v1 = window.box
        depth_m = float((window.R_OC.T @ (self.p_OT - window.p_OC))[2])
        return depth_m * max((u1 - u0) / window.lens.fx, (v1 - v0) / window.lens.fy)


def locate(image: Image, detection: Detection, taken: Mask | None = None) -> Position | None:
    """Locates a detection's object without the pixels `taken` (H, W) by other objects; None when there is no depth."""
    form = class_form(detection.class_name)
    window = window_about(image, detection.box, taken)
    if window is None:
        return None
    segment = segment_object(window, form)
    cut = _cut(image, detection)
    extents = _extents(segment, form, cut)
    if extents is None:
        return None
    p_OT = np.array(extents.middle)
    return Position(p_OT, _covariance(p_OT - window.p_OC, _with_doubt(extents, segment, cut)), extents, segment)


def _with_doubt(extents: Extents, segment: ObjectSegment, cut: _Cut) -> tuple[float, float, float]:
    """Sigmas of the extents, enlarged for an object that the picture cuts off, or whose base is occluded."""
    along, across, up = extents.sigma_m
    longest = max(extents.length_m, extents.height_m)
    if cut.anywhere:
        along, across, up = along + 0.12 * longest, across + 0.15 * longest, up + 0.1 * extents.height_m
    if segment.plane is None:
        up += 0.02 + 0.1 * extents.height_m
    doubt = 1.0 + 2.0 * (1.0 - min(segment.fit, 1.0)) ** 2
    return along * doubt, across * doubt, up * doubt


@dataclass(frozen=True)
class _Cut:
    """Sides of the box that the picture's edge cuts off."""

    top: bool
    bottom: bool
    side: bool

    @property
    def anywhere(self) -> bool:
        """Returns whether any side is cut off."""
        return self.top or self.bottom or self.side


def _cut(image: Image, detection: Detection) -> _Cut:
    u0, v0, u1, v1 = detection.box
    lens = image.intrinsics
    side = u0 < _BORDER_PX or u1 > lens.width - _BORDER_PX
    return _Cut(v0 < _BORDER_PX, v1 > lens.height - _BORDER_PX, side)


def _extents(segment: ObjectSegment, form: ClassForm, cut: _Cut) -> Extents | None:
    points = segment.points_O
    few = len(points) < _FEWEST_POINTS
    if form.form == "person":
        return None if few else _person(points, segment, cut)
    if form.form == "long" and segment.plane is not None and (few or segment.covered < _LEAST_LONG_COVERED):
        flat = _flat(segment, segment.plane, form)
        if flat is not None:
            return flat
    if few:
        return None
    base_m = _base(segment, points)
    height_m = float(
        np.clip(np.percentile(points[:, 2], 99.7 if form.form == "tank" else 98) - base_m, 0.005, form.length_m[1])
    )
    across_m = _across(points, segment.window.p_OC)
    if form.form in ("round", "tank") and height_m > _UPRIGHT * across_m:
        base_m, height_m = _uncut(base_m, height_m, form, segment, cut)
        return _upright(points, segment, form, base_m, height_m)
    return _lying(points, segment, form, base_m, height_m, cut)


def _uncut(base_m: float, height_m: float, form: ClassForm, segment: ObjectSegment, cut: _Cut) -> tuple[float, float]:
    """Base and height of a standing object; its usual height where the picture cuts it off above or below."""
    missing_m = max(0.0, form.usual_m - height_m)
    if cut.top:
        return base_m, height_m + missing_m
    if cut.bottom and segment.plane is None:
        return base_m - missing_m, height_m + missing_m
    return base_m, height_m


def _base(segment: ObjectSegment, points: FloatArray) -> float:
    """Height of the plane below the object, or of its lowest points where the plane is unseen."""
    if segment.plane is None:
        return float(np.percentile(points[:, 2], 1))
    return float(segment.plane.z(np.median(points[:, :2], axis=0)))


def _view(points: FloatArray, p_OC: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Horizontal unit vectors along and across the line of sight to points."""
    along = np.median(points[:, :2], axis=0) - p_OC[:2]
    along = along / max(float(np.linalg.norm(along)), 1e-6)
    return along, np.array([-along[1], along[0]])


def _across(points: FloatArray, p_OC: FloatArray) -> float:
    _, across = _view(points, p_OC)
    low, high = np.percentile(points[:, :2] @ across, [1, 99])
    return float(high - low)


def _upright(points: FloatArray, segment: ObjectSegment, form: ClassForm, base_m: float, height_m: float) -> Extents:
    """Extents of a standing round object, whose axis is behind the visible side."""
    above = points[:, 2] - base_m
    body = points[(above > 0.12 * height_m) & (above < 0.6 * height_m), :2]
    body = body if len(body) >= _FEWEST_POINTS else points[:, :2]
    circle = fit_circle(body, segment.window.p_OC, 0.5 * form.width_m[1])
    if circle is None:
        along, across = _view(points, segment.window.p_OC)
        left, right = (float(value) for value in np.percentile(body @ across, [1, 99]))
        radius = float(np.clip(0.5 * (right - left), 0.5 * form.width_m[0], 0.5 * form.width_m[1]))
        near = float(np.percentile(body @ along, 5))
        centre = (near + radius) * along + 0.5 * (left + right) * across
        x, y = float(centre[0]), float(centre[1])
    else:
        x, y, radius = circle
    sigma_m = (0.004 + 0.2 * radius, 0.003 + 0.15 * radius, 0.004 + 0.03 * height_m)
    if form.form == "tank":
        about = _near_axis(points, np.array([x, y]), segment.window.p_OC)
        return _with_appendages(about, (x, y, radius), base_m, height_m, sigma_m)
    return Extents((x, y, base_m + 0.5 * height_m), 2 * radius, 2 * radius, height_m, 0.0, True, sigma_m)


def _near_axis(points: FloatArray, axis: FloatArray, p_OC: FloatArray) -> FloatArray:
    """Points within the object's lateral reach before and behind an axis."""
    along, across = _view(points, p_OC)
    reach = min(_REACH_M, float(np.percentile(np.abs((points[:, :2] - axis) @ across), 98)))
    near = points[np.abs((points[:, :2] - axis) @ along) < reach]
    return near if len(near) >= _FEWEST_POINTS else points


def _with_appendages(
    points: FloatArray,
    tank: tuple[float, float, float],
    base_m: float,
    height_m: float,
    sigma_m: tuple[float, float, float],
) -> Extents:
    """Extents of a standing tank with its hose and handle."""
    x, y, radius = tank
    turns = np.linspace(0.0, 2.0 * math.pi, 24, endpoint=False)
    rim = np.stack([x + radius * np.cos(turns), y + radius * np.sin(turns)], axis=1)
    (cx, cy), length, width, yaw = fit_rectangle(np.concatenate([without_strays(points[:, :2]), rim]))
    return Extents((float(cx), float(cy), base_m + 0.5 * height_m), length, width, height_m, yaw, False, sigma_m)


def _lying(
    points: FloatArray, segment: ObjectSegment, form: ClassForm, base_m: float, height_m: float, cut: _Cut
) -> Extents:
    """Extents of a lying object: its outline from above, extended on the far side and beyond the picture's edge."""
    centre, length, width, yaw = _outline(points, base_m, height_m, form)
    if form.form == "box" and segment.plane is None and width > height_m:
        base_m, height_m = base_m + height_m - width, width
    if cut.anywhere and form.form in ("long", "round"):
        centre, length = _continued(centre, length, yaw, base_m, segment.window, form)
    wanted = (length, width)
    if form.form == "round":
        wanted = (length, max(width, height_m))
    if form.form == "box":
        wanted = (_towards(length, height_m), _towards(width, height_m))
    centre = _completed(centre, (length, width), wanted, yaw, segment.window.p_OC)
    sigma_m = (0.005 + 0.06 * length, 0.004 + 0.05 * length, 0.004 + 0.05 * height_m)
    middle = (float(centre[0]), float(centre[1]), base_m + 0.5 * height_m)
    return Extents(middle, *wanted, height_m, yaw, False, sigma_m)


def _continued(
    centre: FloatArray, length_m: float, yaw_rad: float, height_m: float, window: Window, form: ClassForm
) -> tuple[FloatArray, float]:
    """Centre and length of an outline that the picture cuts off, extended there to the usual length."""
    missing_m = max(0.0, form.usual_m - length_m)
    along = np.array([math.cos(yaw_rad), math.sin(yaw_rad)])
    ends = [window.border_px(np.array([*(centre + side * 0.5 * length_m * along), height_m])) for side in (1.0, -1.0)]
    if min(ends) > _END_AT_BORDER_PX:
        return centre, length_m
    towards = 1.0 if ends[0] < ends[1] else -1.0
    return centre + towards * 0.5 * missing_m * along, length_m + missing_m


def _towards(seen_m: float, side_m: float) -> float:
    """Side of a cube: the visible one, or its height where that differs clearly."""
    return side_m if seen_m < side_m or seen_m > 1.5 * side_m else seen_m


def _outline(
    points: FloatArray, base_m: float, height_m: float, form: ClassForm
) -> tuple[FloatArray, float, float, float]:
    """Bounding rectangle of points seen from above: centre, length, width, yaw of the length."""
    upper = points[points[:, 2] - base_m > 0.25 * height_m, :2]
    xy = without_strays(upper if len(upper) >= _FEWEST_POINTS else points[:, :2])
    return _rectangle_along(xy, _main_yaw(xy)) if form.form == "long" else fit_rectangle(xy)


def _main_yaw(xy: FloatArray) -> float:
    """Direction of the longest straight part, such as a handle: across it most cells fall into few strips."""
    cells = distinct_cells(np.floor((xy - xy.min(axis=0)) / _STRIP_M).astype(np.int64)) * _STRIP_M

    def gathered(yaw: float) -> int:
        across = cells @ [-math.sin(yaw), math.cos(yaw)]
        counts = np.bincount(np.floor((across - across.min()) / _STRIP_M).astype(np.int64))
        return int(np.sum(counts**2))

    coarse = max((math.radians(k) for k in range(-90, 90, 5)), key=gathered)
    return max((coarse + math.radians(k) for k in range(-4, 5)), key=gathered)


def _rectangle_along(xy: FloatArray, yaw_rad: float) -> tuple[FloatArray, float, float, float]:
    """Bounding rectangle of points with its length in a given direction: centre, length, width, yaw."""
    axes = np.array([[math.cos(yaw_rad), math.sin(yaw_rad)], [-math.sin(yaw_rad), math.cos(yaw_rad)]])
    low, high = np.percentile(xy @ axes.T, [0.5, 99.5], axis=0)
    length, width = high - low
    return 0.5 * (low + high) @ axes, float(length), float(width), yaw_rad


def _completed(
    centre: FloatArray, seen: tuple[float, float], wanted: tuple[float, float], yaw_rad: float, p_OC: FloatArray
) -> FloatArray:
    """Centre of an outline after its sides change length while the near sides stay."""
    along = np.array([math.cos(yaw_rad), math.sin(yaw_rad)])
    view = centre - p_OC[:2]
    view = view / max(float(np.linalg.norm(view)), 1e-6)
    for axis, had, has in zip((along, np.array([-along[1], along[0]])), seen, wanted, strict=True):
        facing = float(np.clip(1.5 * (view @ axis), -1.0, 1.0))
        centre = centre + 0.5 * (has - had) * facing * axis
    return centre


def _flat(segment: ObjectSegment, plane: LevelPlane, form: ClassForm) -> Extents | None:
    """Extents of a flat object, at the point where the ray through its box's centre meets the plane below it."""
    window = segment.window
    meeting = _on_plane(window, plane, 0.35 * form.width_m[0])
    if meeting is None:
        return None
    left, right, top, bottom, middle = meeting
    spans = (float(np.linalg.norm(right - left)), float(np.linalg.norm(bottom - top)))
    length = min(max(spans), form.length_m[1])
    points = segment.points_O
    yaw, height = 0.0, float(form.width_m[0])
    if len(points) >= _FEWEST_POINTS:
        _, seen, _, yaw = _outline(points, _base(segment, points), 0.01, form)
        length = max(length, min(seen, form.length_m[1]))
    sigma_m = (0.006 + 0.08 * length, 0.004 + 0.06 * length, 0.006)
    x, y, z = (float(value) for value in middle)
    return Extents((x, y, z), length, form.width_m[0], height, yaw, False, sigma_m)


def _on_plane(window: Window, plane: LevelPlane, above_m: float) -> list[FloatArray] | None:
    """Points where the rays of `Window.rays_O` meet a plane raised by above_m; None when a ray grazes it."""
    found = []
    for ray in window.rays_O():
        if ray[2] > -_GRAZING * np.linalg.norm(ray):
            return None
        first = window.p_OC + (plane.height_m + above_m - window.p_OC[2]) / ray[2] * ray
        at = window.p_OC + (float(plane.z(first[:2])) + above_m - window.p_OC[2]) / ray[2] * ray
        if at[2] > window.p_OC[2]:
            return None
        found.append(at)
    return found


def _person(points: FloatArray, segment: ObjectSegment, cut: _Cut) -> Extents:
    """Extents of a person who stands or sits on the floor."""
    along, across = _view(points, segment.window.p_OC)
    sideways = points[:, :2] @ across
    body = points[np.abs(sideways - np.median(sideways)) < _PERSON_HALF_M]
    left, right = np.percentile(body[:, :2] @ across, [2, 98])
    front = float(np.median(points[:, :2] @ along))
    centre = (front + _PERSON_BEHIND_M) * along + 0.5 * (left + right) * across
    seen = float(np.percentile(points[:, 2], 99))
    top = max(seen, _PERSON_HEIGHT_M) if cut.top else seen
    x, y = float(centre[0]), float(centre[1])
    return Extents((x, y, 0.5 * top), float(right - left), _PERSON_DEPTH_M, top, 0.0, False, (0.08, 0.06, 0.1))


def _covariance(p_CT_O: FloatArray, sigma_m: tuple[float, float, float]) -> FloatArray:
    """Covariance (3, 3) from sigmas along the horizontal view, across it and upwards."""
    along = np.array([p_CT_O[0], p_CT_O[1], 0.0])
    along = along / max(float(np.linalg.norm(along)), 1e-6)
    axes = np.stack([along, np.cross([0.0, 0.0, 1.0], along), [0.0, 0.0, 1.0]], axis=1)
    return np.asarray(axes @ np.diag(np.square(sigma_m)) @ axes.T)
