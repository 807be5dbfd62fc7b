"""Placements of grasps on an object: points on its outline where the fingers close, the local width, and a cost.

Along a long object the local width counts, so that a hammer is grasped by its handle, and over the height of an upright
one, so that a bottle that is too wide for the gripper is grasped by its neck.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from skills.geometry import wrap
from skills.perception.fitting import fit_circle, fit_rectangle, without_strays
from skills.robot import FloatArray

UPRIGHT_M: Final = 0.075
"""An object higher than this is grasped from the side."""
_BIN_M = 0.01
"""Length of the slices of an outline."""
_LOCAL_HALF_M = 0.036
"""Half the length of an outline within which its local width is measured."""
_FEWEST_LOCAL_POINTS = 8
"""A length of an outline with fewer points has no local width."""
_FINGER_YIELDS_M = 0.004
"""Depth by which a finger yields to an outline that it touches."""
_EDGES_PERCENT = (1, 99)
"""Percentiles of points at the two edges of an outline; strays lie beyond them."""
_OBLIQUE_RAD = np.linspace(-0.28, 0.28, 15)
"""Angles by which a part of an outline may lie oblique to the whole."""
_SQUARE_RATIO = 1.4
"""Ratio of length to width below which an object is grasped along both axes."""
_SHIFTS_M = (0.0, 0.03, -0.03, 0.06, -0.06, 0.09, -0.09)
"""Distances along a long object from its centre of mass at which it is grasped."""
_FLAT_HALF_DEPTH_M = 0.02
"""Half the depth to which the fingers enclose a flat object along their approach."""
_ROUND_TURNS_RAD = (0.0, 0.3, -0.3, 0.6, -0.6, 0.9, -0.9)
"""Angles from the direction of the shoulder at which a round object is approached."""
_PER_ROUND_TURN_RAD = 0.5
"""Cost of such an angle, per radian."""
_PER_OFF_AHEAD_RAD = 0.15
"""Cost of the angle between any other approach and the direction from the shoulder, per radian."""
_LEAST_TOUCHING = 0.55
"""Least part of a finger's breadth that must touch the outline."""
_FINGER_HALF_M = 0.03
"""Half the breadth of a finger."""
_PER_BEYOND_END_M = 30.0
"""Cost per metre of the breadth of fingers that lies beyond the end of an object."""
_LOOSE_COST = 1.5
"""Cost of a finger that touches the outline nowhere."""
_PER_LEVER_M = 4.0
"""Cost of a level distance from the centre of mass, per metre."""
_PER_WIDTH_M = 2.0
"""Cost of the local width, per metre."""
_WIDE_M = 0.095
"""Local width from which on the fingers have little space on both sides."""
_PER_WIDE_M = 20.0
"""Additional cost of the local width beyond that, per metre."""
_SLIM_M = 0.01
"""Local width below which a part turns in the fingers."""
_PER_SLIM_M = 40.0
"""Additional cost of the width missing below that, per metre."""
_USUAL_SHARE = 0.56
"""Usual height of a grip, as a fraction of the height of a low upright object, within the next limits."""
_USUAL_HEIGHTS_M = (0.05, 0.095)
_USUAL_SHARE_OF_TALL = 0.45
"""Least usual height of a grip, as a fraction of the object's height; decisive for a tall one."""
_SLICE_M = 0.03
"""Half the height of a slice of an upright object, and the distance between slices."""
_FEWEST_POINTS = 25
"""A slice with fewer points has no outline."""
_RIM_STEP_RAD = np.pi / 6.0
_RIM_BELOW_TOP_M = 0.012
"""Depth below the top down to which points belong to a rim."""
_RIM_DEPTH_M = 0.035
"""Depth to which a finger enters a hollow object, which must be as deep there."""
_HOLLOW_FROM_RIM_M = 0.01
"""Distance from the rim at which the hollow begins."""
_FINGER_SPACE_M = 0.045
"""Distance from the rim over which the hollow must be seen."""
_THICKEST_RIM_M = 0.03
_RIM_COST = 0.3
"""Cost of a grasp by the rim, which turns more easily than a whole object."""
_MOST_POINTS = 4000
"""Number of points that are enough to slice an upright object."""
_NARROWER_M = 0.015
"""Another slice than the usual one is considered when it is narrower by this."""
_PER_OFF_USUAL_M = 3.0
"""Cost of the distance of a grip from the usual height, per metre."""
_FINGER_LENGTH_M = 0.1
"""Length of the fingers ahead of the palm."""
_LEAST_REACH_M = 0.03
"""Least length of the fingers on a slice whose wider neighbour stops the palm."""
_HAND_HALF_M = 0.06
"""Half the breadth of the hand, within which a wider part of an upright object stops the palm."""
_MOST_OFF_AHEAD_RAD = 1.7
"""Largest angle between the approach to a box's side and the direction from the shoulder."""
_HIDDEN_SIDE_RAD = 1.0
"""Angle from which on the far side of a box is hidden from the shoulder."""
_TOP_DEPTHS_M = (0.098, 0.045)
"""Depths below its top to which fingers reach that grasp an upright object from above."""
_ROUND_TOP_COST = 1.0
"""Cost of holding an object by a round top alone: a bottle's neck tapers, and slips out of the fingertips."""


@dataclass(frozen=True)
class Target:
    """Object to grasp, in the body frame: its points (N, 3), outline box, and the height of its surface (m)."""

    points_B: FloatArray
    centre_B: tuple[float, float]
    yaw_rad: float
    length_m: float
    width_m: float
    height_m: float
    base_m: float
    round: bool

    @property
    def upright(self) -> bool:
        """Returns whether the object is tall enough to be grasped from the side."""
        return self.height_m > UPRIGHT_M

    def slice(self, p_BS: FloatArray, low_m: float, high_m: float = np.inf) -> Target:
        """Returns the slice between two heights above the surface, as seen from p_BS; the whole when points are few."""
        above = self.points_B[:, 2] - self.base_m
        points_B = self.points_B[(above > low_m) & (above < high_m)]
        if not _FEWEST_POINTS < len(points_B) < len(above):
            return self
        circle = fit_circle(points_B[:, :2], p_BS)
        if circle is None:
            (x, y), length, width, yaw = fit_rectangle(without_strays(points_B[:, :2]))
        else:
            (x, y), length, width, yaw = circle[:2], 2.0 * circle[2], 2.0 * circle[2], 0.0
        centre_B, is_round = (float(x), float(y)), circle is not None
        return Target(points_B, centre_B, yaw, length, width, self.height_m, self.base_m, is_round)


@dataclass(frozen=True)
class Placement:
    """Placement of a grasp: point (x, y), azimuth of the approach, local width and depth (m), cost.

    `lever_m` is the estimated horizontal distance to the centre of mass. For an upright object, the point is `height_m`
    above the surface, or the fingers reach `below_top_m` below its top from above. At a `rim` they point straight down.
    """

    xy: FloatArray
    azimuth_rad: float
    width_m: float
    half_depth_m: float
    cost: float
    lever_m: float = 0.0
    height_m: float = 0.0
    below_top_m: float = 0.0
    rim: bool = False


def placements(target: Target, p_BS: FloatArray, ahead_rad: float) -> list[Placement]:
    """Returns the grasp placements on an object in the direction ahead_rad from the shoulder at p_BS."""
    rims = list(_rims(target))
    if not target.upright:
        return [*(_round(target, ahead_rad) if target.round else _along(target, ahead_rad)), *rims]
    target = replace(target, points_B=target.points_B[:: 1 + len(target.points_B) // _MOST_POINTS])
    heights_m = np.arange(_SLICE_M, target.height_m - 0.5 * _SLICE_M, _SLICE_M)
    slices = [(float(each), target.slice(p_BS, each - _SLICE_M, each + _SLICE_M)) for each in heights_m]
    areas = [part.length_m * part.width_m + 1e-9 for _, part in slices]
    middle = np.average([part.centre_B for _, part in slices], axis=0, weights=areas)
    low_usual_m = float(np.clip(_USUAL_SHARE * target.height_m, *_USUAL_HEIGHTS_M))
    usual_m = max(low_usual_m, _USUAL_SHARE_OF_TALL * target.height_m)
    usual = target.slice(p_BS, usual_m - _SLICE_M, usual_m + _SLICE_M)
    narrow_m = usual.width_m - _NARROWER_M
    better = [each for each in slices if each[1].width_m < narrow_m or (each[1].round and not usual.round)]
    aside = [_aside(target, part, each_m, ahead_rad) for each_m, part in [(usual_m, usual), *better]]
    above = _above(target, p_BS, ahead_rad, middle)
    return [*(_with_lever(each, middle, usual_m) for each in itertools.chain(*aside, above)), *rims]


def _with_lever(placement: Placement, middle: FloatArray, usual_m: float) -> Placement:
    """Returns the placement with its lever, and with the costs of the lever and of an unusual height."""
    lever_m = float(np.linalg.norm(placement.xy - middle))
    off_m = 0.0 if placement.below_top_m else abs(placement.height_m - usual_m)
    cost = placement.cost + _PER_LEVER_M * lever_m + _PER_OFF_USUAL_M * off_m
    return replace(placement, lever_m=lever_m, cost=cost)


def _aside(target: Target, part: Target, height_m: float, ahead_rad: float) -> Iterator[Placement]:
    """Yields placements on a slice from the side; a wider part below or above it keeps the palm off the slice."""
    beside = target.points_B[np.abs(target.points_B[:, 2] - target.base_m - height_m) < _HAND_HALF_M, :2]
    higher_B = target.points_B[target.points_B[:, 2] - target.base_m > height_m - _SLICE_M]
    for each in _round(part, ahead_rad) if part.round else _from_sides(part, higher_B, ahead_rad):
        s, t = _turned(each.azimuth_rad) @ (beside - each.xy).T
        half_depth_m = max(each.half_depth_m, -float(np.min(s[np.abs(t) < _HAND_HALF_M], initial=0.0)))
        reach_m = _FINGER_LENGTH_M - half_depth_m + (0.0 if part.round else each.half_depth_m)
        if reach_m > _LEAST_REACH_M:
            yield replace(each, half_depth_m=half_depth_m, height_m=height_m)


def _above(target: Target, p_BS: FloatArray, ahead_rad: float, middle: FloatArray) -> Iterator[Placement]:
    """Yields placements on an upright object from above, about its top, such as a handle or a neck."""
    widest_m = np.inf
    for depth_m in _TOP_DEPTHS_M:
        part = target.slice(p_BS, target.height_m - depth_m)
        if part.width_m < widest_m - _NARROWER_M:
            widest_m = part.width_m
            for each in _round(part, ahead_rad) if part.round else _along(part, ahead_rad, middle):
                slips = part.round and depth_m < _TOP_DEPTHS_M[0]
                yield replace(each, below_top_m=depth_m, cost=each.cost + slips * _ROUND_TOP_COST)


def _rims(target: Target) -> Iterator[Placement]:
    """Yields placements about the rim of a hollow object, into which one finger enters from above."""
    centre = np.array(target.centre_B)
    below_top_m = target.height_m + target.base_m - target.points_B[:, 2]
    for azimuth in np.arange(0.0, 2.0 * np.pi, _RIM_STEP_RAD):
        s, t = _turned(azimuth) @ (target.points_B[:, :2] - centre).T
        local = (np.abs(t) < _LOCAL_HALF_M) & (s > 0.0)
        wall = s[local & (below_top_m < _RIM_BELOW_TOP_M)]
        if len(wall) < _FEWEST_POINTS:
            continue
        inner, outer = np.percentile(wall, _EDGES_PERCENT)
        inside = below_top_m[local & (s < inner - _HOLLOW_FROM_RIM_M) & (s > inner - _FINGER_SPACE_M)]
        if outer - inner < _THICKEST_RIM_M and len(inside) > _FEWEST_POINTS and np.percentile(inside, 5) > _RIM_DEPTH_M:
            lever_m = 0.5 * float(inner + outer)
            xy, cost = centre + lever_m * _turned(azimuth)[0], _RIM_COST + _PER_LEVER_M * lever_m
            width_m, azimuth_rad = float(outer - inner), float(azimuth + 0.5 * np.pi)
            yield Placement(xy, azimuth_rad, width_m, 0.0, cost, lever_m, below_top_m=_RIM_DEPTH_M, rim=True)


def _round(target: Target, ahead_rad: float) -> list[Placement]:
    """Returns placements on a round object from several sides; approaching from the shoulder's side costs least."""
    centre, z = np.array(target.centre_B), target.points_B[:, 2]
    off = np.linalg.norm(target.points_B[:, :2] - centre, axis=1)
    touching = _touching(z, off, 0.5 * target.width_m, float(np.ptp(z))) if target.upright else 1.0
    cost = _width_cost(target.width_m) + _LOOSE_COST * (1.0 - touching)
    turned = ((ahead_rad + turn, cost + _PER_ROUND_TURN_RAD * abs(turn)) for turn in _ROUND_TURNS_RAD)
    return [Placement(centre, yaw, target.width_m, 0.5 * target.width_m, each) for yaw, each in turned]


def _from_sides(target: Target, higher_B: FloatArray, ahead_rad: float) -> Iterator[Placement]:
    """Yields placements on an upright box from its sides; the width counts as deep as the fingers reach.

    The object's back is occluded: its lateral width is measured at its top, among the points `higher_B`.
    """
    centre = np.array(target.centre_B)
    for azimuth in (wrap(target.yaw_rad + turn) for turn in (0.0, 0.5 * np.pi, np.pi, 1.5 * np.pi)):
        off = abs(wrap(azimuth - ahead_rad))
        if off > _MOST_OFF_AHEAD_RAD:
            continue
        directions = _turned(azimuth)
        points_B = target.points_B if off < _HIDDEN_SIDE_RAD else higher_B
        s, t = directions @ (points_B[:, :2] - centre).T
        near = float(np.percentile(s, _EDGES_PERCENT[0]))
        reached = s < near + _FINGER_LENGTH_M
        s, t, z = s[reached], t[reached], points_B[reached, 2]
        low, high = np.percentile(t, _EDGES_PERCENT)
        touching = _touching_both(z, t, low, high)
        if touching > _LEAST_TOUCHING:
            half_depth = 0.5 * (float(s.max()) - near)
            xy = centre + np.array([near + half_depth, 0.5 * (low + high)]) @ directions
            cost = _width_cost(high - low) + _PER_OFF_AHEAD_RAD * off + _LOOSE_COST * (1.0 - touching)
            yield Placement(xy, azimuth, float(high - low), half_depth, cost)


def _along(target: Target, ahead_rad: float, middle_B: FloatArray | None = None) -> Iterator[Placement]:
    """Yields placements along a box's axes with the local width there; along both axes of a nearly square box.

    A nearly square box that the gripper can enclose has them at its centre only; a wider one may have a narrow part.
    The cheapest is at the centre of mass `middle_B` (x, y), or where the outline suggests the centre of mass.
    """
    alike, centre = target.length_m < _SQUARE_RATIO * target.width_m, np.array(target.centre_B)
    square = alike and target.width_m < _WIDE_M
    outline_B, wide = target.points_B[:, :2], alike and not square and middle_B is None
    middle_B = np.mean(outline_B, axis=0) if wide else middle_B
    for yaw in (target.yaw_rad, target.yaw_rad + 0.5 * np.pi) if alike else (target.yaw_rad,):
        axis = _turned(yaw)[0]
        along = (outline_B - centre) @ axis
        middle = _balance(along, (outline_B - centre) @ _turned(yaw)[1])
        middle = middle if middle_B is None else float(axis @ (middle_B - centre))
        for shift in (0.0,) if square else _SHIFTS_M:
            local = np.abs(along - middle - shift) < _LOCAL_HALF_M
            if np.count_nonzero(local) < _FEWEST_LOCAL_POINTS:
                continue
            near, at = outline_B[local], centre + (0.0 if square else middle + shift) * axis
            turned = yaw if square else _aligned(near, yaw)
            s, t = _turned(turned) @ (near - at).T
            low, high = np.percentile(t, _EDGES_PERCENT)
            touching = _touching_both(s, t, low, high, float(np.ptp(along)))
            if touching < _LEAST_TOUCHING:
                continue
            xy = at + 0.5 * (low + high) * _turned(turned)[1]
            end_m = min(middle + shift - float(np.min(along)), float(np.max(along)) - middle - shift)
            lever_m = float(np.linalg.norm(xy - middle_B)) if wide and middle_B is not None else abs(shift)
            for azimuth in (turned, turned + np.pi):
                cost = _PER_LEVER_M * lever_m + _width_cost(high - low)
                cost += _PER_OFF_AHEAD_RAD * abs(wrap(azimuth - ahead_rad))
                cost += _LOOSE_COST * (1.0 - touching)
                cost += 0.0 if square else _PER_BEYOND_END_M * max(0.0, _FINGER_HALF_M - end_m)
                yield Placement(xy, azimuth, float(high - low), _FLAT_HALF_DEPTH_M, cost, lever_m)


def _aligned(xy: FloatArray, yaw_rad: float) -> float:
    """Direction near a yaw along which points (N, 2) are narrowest: an oblique handle lies straight in the fingers."""
    turned = yaw_rad + _OBLIQUE_RAD
    return float(turned[np.argmin([np.ptp(np.percentile(_turned(each)[1] @ xy.T, _EDGES_PERCENT)) for each in turned])])


def _turned(azimuth_rad: float) -> FloatArray:
    """Horizontal unit vectors along an azimuth and to the left of it, as rows (2, 2)."""
    c, s = np.cos(azimuth_rad), np.sin(azimuth_rad)
    return np.array([[c, s], [-s, c]])


def _width_cost(width_m: float) -> float:
    wide_m, slim_m = max(0.0, width_m - _WIDE_M), max(0.0, _SLIM_M - width_m)
    return _PER_WIDTH_M * width_m + _PER_WIDE_M * wide_m + _PER_SLIM_M * slim_m


def _touching_both(s: FloatArray, t: FloatArray, low_m: float, high_m: float, length_m: float | None = None) -> float:
    """The smaller contact fraction of two fingers that close at low_m and high_m (see `_touching`)."""
    length_m = float(np.ptp(s)) if length_m is None else length_m
    return min(_touching(s, -t, -low_m, length_m), _touching(s, t, high_m, length_m))


def _touching(s: FloatArray, t: FloatArray, edge_m: float, length_m: float) -> float:
    """Fraction of a finger's breadth in contact with an outline (s along, t across, m) when it closes at edge_m.

    A finger at the cheek of a hammer's head touches at one end of its breadth only, and the hammer turns out of it; so
    does a finger half beyond the end of a handle. For an object shorter (length_m) than the finger's breadth, the
    fraction refers to the object's length.
    """
    bins = np.round(s / _BIN_M).astype(int)
    touched = [np.percentile(t[bins == k], 98) > edge_m - _FINGER_YIELDS_M for k in np.unique(bins)]
    return float(sum(touched) / max(len(touched), min(2.0 * _LOCAL_HALF_M, length_m) // _BIN_M))


def _balance(s: FloatArray, t: FloatArray) -> float:
    """Position of the centre of mass along a long object (s along, t across, m), taken as a solid of revolution.

    A hammer is heavy at its head: held by the far end of its handle it would turn in the gripper.
    """
    bins = np.round(s / _BIN_M).astype(int)
    found = [(k * _BIN_M, np.ptp(np.percentile(t[bins == k], [2, 98]))) for k in np.unique(bins)]
    places, widths = np.array(found).T
    return float(np.average(places, weights=np.maximum(widths, 1e-3) ** 2))
