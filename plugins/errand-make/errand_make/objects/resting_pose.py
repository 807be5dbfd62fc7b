"""The rest of a body on a plane: its resting sides, and small spheres at their corners that carry it.

A convex part on a box has a single contact point and would wobble. So each resting side gets spheres at its corners,
which touch the side's plane from inside.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import shapely
from scipy.spatial import ConvexHull

from errand_make.shapes import Sphere
from skills.robot import FloatArray

FOOT_M: Final = 0.003
CORNERS: Final = 6
MOST_SIDES: Final = 6
_FEWEST_FEET: Final = 3
_THICKNESS: Final = 0.01
_LEAST_M: Final = 0.0003
"""Greatest distance of a side's points from its plane: a share of the body's height above it, or metres."""
_LEAST_TIPPING_RAD: Final = 0.05
_SLENDER: Final = 8.0
"""Height of a body as a multiple of its width, from which on it does not stand."""
_LEAST_AREA: Final = 0.04
_MOST_CANDIDATES: Final = 60
_OTHER_SIDE: Final = 0.97
_WALL: Final = 0.9
_SLACK: Final = 0.5
"""Share of its radius by which a foot may stand out of a round handle's faces (under 26 degrees from its side)."""
MOST_RESTS: Final = 10
_OTHER_REST: Final = 0.85
_PROJECTIONS, _EXACT = 200, 0.02
DOWN: Final = (0.0, 0.0, -1.0)


@dataclass(frozen=True)
class Side:
    """A side on which a body can lie: its outward normal, its corners (K, 3) in its plane, in order, and its area.

    The centre of mass is `height_m` above the plane, and the body falls over when it is tilted by `tipping_rad`.
    """

    normal: FloatArray
    corners: FloatArray
    area_m2: float
    height_m: float
    tipping_rad: float


def resting_rotation(points: FloatArray, com: FloatArray) -> FloatArray:
    """Rotation (3, 3) of a body into its resting pose; the identity if it rests already.

    A slender body, such as a pencil, lies even if it could stand on its end.
    """
    as_it_is = side_towards(points, com, np.array(DOWN))
    width, depth, height = np.ptp(points, axis=0)
    slender = height > _SLENDER * max(width, depth)
    if as_it_is is not None and as_it_is.tipping_rad >= _LEAST_TIPPING_RAD and not slender:
        return np.eye(3)
    sides = resting_sides(points, com)
    if not sides:
        return np.eye(3)
    flat = _turning(sides[0].normal, np.array(DOWN))
    outline = shapely.MultiPoint((points @ flat.T)[:, :2]).minimum_rotated_rectangle
    corners = np.array(outline.exterior.coords)[:3]
    longest = max(corners[1] - corners[0], corners[2] - corners[1], key=lambda edge: float(np.linalg.norm(edge)))
    c, s = longest / np.linalg.norm(longest)
    return np.asarray(np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]) @ flat)


def resting_rotations(points: FloatArray, com: FloatArray) -> FloatArray:
    """Rotations (K, 3, 3) of resting poses: the given one, then the steadiest on clearly different sides."""
    downs = [np.array(DOWN)]
    for side in sorted(resting_sides(points, com), key=lambda side: -side.tipping_rad):
        if all(float(side.normal @ down) < _OTHER_REST for down in downs):
            downs.append(side.normal)
    return np.stack([_turning(down, np.array(DOWN)) for down in downs[:MOST_RESTS]])


def resting_sides(points: FloatArray, com: FloatArray) -> list[Side]:
    """Stable sides of a body, the lowest centre of mass first."""
    hull = ConvexHull(points)
    normals, index = np.unique(np.round(hull.equations[:, :3], 3), axis=0, return_inverse=True)
    triangles = points[hull.simplices]
    areas = np.linalg.norm(np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]), axis=1) / 2
    sums = np.zeros(len(normals))
    np.add.at(sums, index.reshape(-1), areas)
    found = list[Side]()
    for number in np.argsort(-sums)[:_MOST_CANDIDATES]:
        normal = normals[number] / np.linalg.norm(normals[number])
        side = side_towards(points, com, normal)
        if side is not None and side.tipping_rad >= _LEAST_TIPPING_RAD:
            found.append(side)
    return sorted(found, key=lambda side: side.height_m)


def side_towards(points: FloatArray, com: FloatArray, normal: FloatArray) -> Side | None:
    """Side that faces a direction; None when the body touches a plane there only in a line or a point."""
    heights = points @ normal
    top, depth = float(heights.max()), float(np.ptp(heights))
    touching = points[heights >= top - max(_THICKNESS * depth, _LEAST_M)]
    to_plane = _turning(normal, np.array([0.0, 0.0, 1.0]))
    flat = (touching @ to_plane.T)[:, :2]
    outline = shapely.MultiPoint(flat).convex_hull
    if not isinstance(outline, shapely.Polygon):
        return None
    middle = shapely.Point((to_plane @ com)[:2])
    lever = outline.exterior.distance(middle) * (1.0 if outline.contains(middle) else -1.0)
    ring = np.array(outline.exterior.coords)[:-1]
    corners = np.column_stack([ring, np.full(len(ring), top)]) @ to_plane
    height = top - float(com @ normal)
    return Side(normal, corners, float(outline.area), height, float(np.arctan2(lever, height)))


def feet(points: FloatArray, com: FloatArray, parts: Sequence[FloatArray]) -> list[Sphere]:
    """Small spheres at the corners of a body's resting sides, those of its present side first.

    They touch the planes of the sides from inside, each within one of the body's convex `parts` (N, 3): between a
    hammer's claw and its handle they would catch the fingers of a gripper.
    """
    hull = ConvexHull(points)
    radius = min(FOOT_M, float(np.ptp(points, axis=0).min()) / 6.0)
    standing = side_towards(points, com, np.array(DOWN))
    sides = [] if standing is None else [standing]
    for side in resting_sides(points, com):
        new = all(float(side.normal @ other.normal) < _OTHER_SIDE for other in sides)
        if new and side.area_m2 > _LEAST_AREA * hull.area and len(sides) < MOST_SIDES:
            sides.append(side)
    hulls = [ConvexHull(part).equations for part in parts]
    found = [_feet_of(side, hulls, radius) for side in sides]
    if standing is not None and not found[0]:
        found[0] = _rounded_feet(standing, radius)
    return [foot for each in found for foot in each]


def _rounded_feet(side: Side, radius: float) -> list[Sphere]:
    """Feet of a curved side, for instance of a ball, which would roll away."""
    middle = side.corners.mean(axis=0)
    centres = middle + (_spread(side.corners) - middle) / 2.0 - side.normal * radius
    return [Sphere(radius=radius, p=(x, y, z)) for x, y, z in centres.tolist()]


def _feet_of(side: Side, hulls: Sequence[FloatArray], radius: float) -> list[Sphere]:
    """Feet of one side, each in the part at its corner, smaller in a narrow part; none if too few fit."""
    slack_m = _SLACK * radius
    walls = [hull - np.outer(hull[:, :3] @ side.normal > _WALL, [0.0, 0.0, 0.0, slack_m]) for hull in hulls]
    found = list[Sphere]()
    for corner in _spread(side.corners):
        own = min(walls, key=lambda wall: float(np.max(wall @ [*corner, 1.0])))
        for small in (radius, radius / 2.0, radius / 4.0):
            centre = _inside(corner - small * side.normal, side.normal, own, small)
            if centre is not None:
                x, y, z = centre.tolist()
                found.append(Sphere(radius=small, p=(x, y, z)))
                break
    return found if len(found) >= _FEWEST_FEET else []


def _inside(start: FloatArray, normal: FloatArray, hull: FloatArray, radius: float) -> FloatArray | None:
    """Point near `start`, in its plane, where a sphere stays within a hull's half spaces (K, 4); None without one."""
    centre = start
    for _ in range(_PROJECTIONS):
        out = hull[:, :3] @ centre + hull[:, 3] + radius
        worst = int(np.argmax(out))
        if out[worst] < _EXACT * radius:
            return centre
        centre = centre - hull[worst, :3] * out[worst]
        centre = centre - normal * float((centre - start) @ normal)
    return None


def _spread(corners: FloatArray) -> FloatArray:
    """Selects at most `CORNERS` corners that are far apart."""
    if len(corners) <= CORNERS:
        return corners
    chosen = [int(np.argmax(np.linalg.norm(corners - corners.mean(axis=0), axis=1)))]
    while len(chosen) < CORNERS:
        gaps = np.linalg.norm(corners[:, None] - corners[chosen], axis=2).min(axis=1)
        chosen.append(int(np.argmax(gaps)))
    return np.asarray(corners[sorted(chosen)])


def _turning(a: FloatArray, b: FloatArray) -> FloatArray:
    """Rotation (3, 3) of the unit vector a to b."""
    cross, cosine = np.cross(a, b), float(a @ b)
    if cosine < -1.0 + 1e-9:
        other = np.eye(3)[int(np.argmin(np.abs(a)))]
        axis = np.cross(a, other)
        axis /= np.linalg.norm(axis)
        return np.asarray(2.0 * np.outer(axis, axis) - np.eye(3))
    x, y, z = cross
    skew = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(np.eye(3) + skew + skew @ skew / (1.0 + cosine))
