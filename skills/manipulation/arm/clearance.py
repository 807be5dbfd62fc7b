"""Clearance between convex shapes and boxes, compiled: the arm's shapes in many configurations, among many boxes.

A gap is the largest separation along candidate axes, so it never exceeds the distance. It is smaller than the distance
only between a cylinder's rim, or a box's corner or edge, and an edge or corner. Shapes are spheres, capsules, cylinders
and boxes about the origin of their own frame; round ones extend along z.
"""

from __future__ import annotations

import enum
import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from skills.compiled import compiled
from skills.robot import FloatArray

_PARALLEL = 1e-6
"""Sine of the angle between two edges below which they are parallel."""
_HALVINGS = 40
"""Steps of the search for the nearest point of an axis."""


class Kind(enum.IntEnum):
    """Kind of a shape. The half extents (3,) of a round shape are radius, radius, and half the length without caps."""

    SPHERE = 0
    CAPSULE = 1
    CYLINDER = 2
    BOX = 3


FIXED: Final = -1
"""Joint of a shape that no joint moves."""


@compiled
def touching(
    found: NDArray[np.bool_],
    padding_m: float,
    path_rad: FloatArray,
    axes: FloatArray,
    R_PF: FloatArray,
    p_PF: FloatArray,
    group_joints: NDArray[np.int64],
    group_ends: NDArray[np.int64],
    group_spheres: FloatArray,
    radii: FloatArray,
    kinds: NDArray[np.int64],
    halves: FloatArray,
    R_LS: FloatArray,
    p_LS: FloatArray,
    box_halves: FloatArray,
    R_BX: FloatArray,
    p_BX: FloatArray,
) -> bool:
    """Returns whether any of S shapes comes within `padding_m` of any of N boxes on path_rad (K, J).

    Joint j turns about `axes` (J, 3) in its frame F, which is fixed to the previous link, for the first joint to the
    body: R_PF (J, 3, 3), p_PF (J, 3). Shapes come in G groups, one per link: `group_joints` (G,) are the joints that
    move the links, or `FIXED` for the body, and `group_ends` (G,) are one past the index of each group's last shape.
    `group_spheres` (G, 4), centre and radius, bound the groups; spheres of `radii` (S,) bound single shapes. The first
    contact ends the check, unless `found` (S,) collects all shapes in contact.
    """
    joints, groups, boxes = path_rad.shape[1], group_joints.shape[0], box_halves.shape[0]
    reach = np.sqrt(box_halves[:, 0] ** 2 + box_halves[:, 1] ** 2 + box_halves[:, 2] ** 2) + padding_m
    R, p = np.empty((joints + 1, 3, 3)), np.empty((joints + 1, 3))
    shapes, any_touch = kinds.shape[0], False
    R_BS, p_BS, placed = np.empty((shapes, 3, 3)), np.empty((shapes, 3)), np.zeros(shapes, dtype=np.int64)
    for k in range(path_rad.shape[0]):
        place_links(R, p, path_rad[k], axes, R_PF, p_PF)
        first = 0
        for g in range(groups):
            link, last = group_joints[g] + 1, group_ends[g]
            cx, cy, cz, radius = group_spheres[g]
            x = R[link, 0, 0] * cx + R[link, 0, 1] * cy + R[link, 0, 2] * cz + p[link, 0]
            y = R[link, 1, 0] * cx + R[link, 1, 1] * cy + R[link, 1, 2] * cz + p[link, 1]
            z = R[link, 2, 0] * cx + R[link, 2, 1] * cy + R[link, 2, 2] * cz + p[link, 2]
            for n in range(boxes):
                near = radius + reach[n]
                if (x - p_BX[n, 0]) ** 2 + (y - p_BX[n, 1]) ** 2 + (z - p_BX[n, 2]) ** 2 > near * near:
                    continue
                if _centre_gap(x, y, z, box_halves[n], R_BX[n], p_BX[n]) > radius + padding_m:
                    continue
                for s in range(first, last):
                    if placed[s] <= k:
                        _place(R_BS[s], p_BS[s], R[link], p[link], R_LS[s], p_LS[s])
                        placed[s] = k + 1
                    gap = _centre_gap(p_BS[s, 0], p_BS[s, 1], p_BS[s, 2], box_halves[n], R_BX[n], p_BX[n])
                    if gap > radii[s] + padding_m:
                        continue
                    if _gap(kinds[s], halves[s], R_BS[s], p_BS[s], box_halves[n], R_BX[n], p_BX[n]) <= padding_m:
                        if found.shape[0] == 0:
                            return True
                        found[s] = any_touch = True
            first = last
    return any_touch


@compiled
def place_links(
    R: FloatArray, p: FloatArray, q_rad: FloatArray, axes: FloatArray, R_PF: FloatArray, p_PF: FloatArray
) -> None:
    """Writes the poses of the body and of J links, in the body frame, into R (J + 1, 3, 3) and p (J + 1, 3)."""
    R[0], p[0] = np.eye(3), np.zeros(3)
    for j in range(q_rad.shape[0]):
        _place(R[j + 1], p[j + 1], R[j], p[j], R_PF[j], p_PF[j])
        _turn(R[j + 1], axes[j], q_rad[j])


@compiled
def box_gaps(
    halves: FloatArray,
    R_FG: FloatArray,
    p_FG: FloatArray,
    moves: FloatArray,
    others: FloatArray,
    R_FX: FloatArray,
    p_FX: FloatArray,
) -> FloatArray:
    """Gaps (K, N) in m between a box, after each of K moves (K, 3), and N others; negative where they overlap."""
    gaps = np.empty((moves.shape[0], others.shape[0]))
    for k in range(moves.shape[0]):
        for n in range(others.shape[0]):
            gaps[k, n] = _box_gap(halves, R_FG, p_FG + moves[k], others[n], R_FX[n], p_FX[n])
    return gaps


@compiled
def _place(
    R_AC: FloatArray, p_AC: FloatArray, R_AB: FloatArray, p_AB: FloatArray, R: FloatArray, p: FloatArray
) -> None:
    """Writes X_AB @ X_BC into R_AC and p_AC."""
    for i in range(3):
        p_AC[i] = p_AB[i] + R_AB[i, 0] * p[0] + R_AB[i, 1] * p[1] + R_AB[i, 2] * p[2]
        for j in range(3):
            R_AC[i, j] = R_AB[i, 0] * R[0, j] + R_AB[i, 1] * R[1, j] + R_AB[i, 2] * R[2, j]


@compiled
def _turn(R: FloatArray, axis: FloatArray, angle_rad: float) -> None:
    """Rotates R about a unit axis in its own frame, by Rodrigues' formula."""
    c, s = math.cos(angle_rad), math.sin(angle_rad)
    x, y, z = axis[0], axis[1], axis[2]
    for i in range(3):
        a, b, d = R[i, 0], R[i, 1], R[i, 2]
        along = (1.0 - c) * (a * x + b * y + d * z)
        R[i, 0] = c * a + along * x + s * (b * z - d * y)
        R[i, 1] = c * b + along * y + s * (d * x - a * z)
        R[i, 2] = c * d + along * z + s * (a * y - b * x)


@compiled
def _gap(
    kind: int,
    half: FloatArray,
    R_BS: FloatArray,
    p_BS: FloatArray,
    box_half: FloatArray,
    R_BX: FloatArray,
    p_BX: FloatArray,
) -> float:
    """Gap (m) between a shape and a box; 0 or less where they touch."""
    if kind == Kind.BOX:
        return _box_gap(half, R_BS, p_BS, box_half, R_BX, p_BX)
    dx, dy, dz = p_BS[0] - p_BX[0], p_BS[1] - p_BX[1], p_BS[2] - p_BX[2]
    cx = R_BX[0, 0] * dx + R_BX[1, 0] * dy + R_BX[2, 0] * dz
    cy = R_BX[0, 1] * dx + R_BX[1, 1] * dy + R_BX[2, 1] * dz
    cz = R_BX[0, 2] * dx + R_BX[1, 2] * dy + R_BX[2, 2] * dz
    radius, length = half[0], half[2]
    if kind == Kind.SPHERE:
        return float(_from_box(cx, cy, cz, box_half) - radius)
    ax = R_BX[0, 0] * R_BS[0, 2] + R_BX[1, 0] * R_BS[1, 2] + R_BX[2, 0] * R_BS[2, 2]
    ay = R_BX[0, 1] * R_BS[0, 2] + R_BX[1, 1] * R_BS[1, 2] + R_BX[2, 1] * R_BS[2, 2]
    az = R_BX[0, 2] * R_BS[0, 2] + R_BX[1, 2] * R_BS[1, 2] + R_BX[2, 2] * R_BS[2, 2]
    low, high = -length, length
    for _ in range(_HALVINGS):  # the distance from a convex body is convex along a line
        t = 0.5 * (low + high)
        x, y, z = cx + t * ax, cy + t * ay, cz + t * az
        slope = ax * (x - min(max(x, -box_half[0]), box_half[0])) + ay * (y - min(max(y, -box_half[1]), box_half[1]))
        slope += az * (z - min(max(z, -box_half[2]), box_half[2]))
        if slope > 0.0:
            high = t
        else:
            low = t
    t = 0.5 * (low + high)
    gap = _from_box(cx + t * ax, cy + t * ay, cz + t * az, box_half) - radius
    if kind == Kind.CYLINDER:  # flat ends: along the box's own axes, and along the cylinder's
        for centre, along, half_box in ((cx, ax, box_half[0]), (cy, ay, box_half[1]), (cz, az, box_half[2])):
            span = length * abs(along) + radius * math.sqrt(max(0.0, 1.0 - along * along))
            gap = max(gap, abs(centre) - half_box - span)
        span = box_half[0] * abs(ax) + box_half[1] * abs(ay) + box_half[2] * abs(az)
        gap = max(gap, abs(cx * ax + cy * ay + cz * az) - length - span)
    return float(gap)


@compiled
def _centre_gap(x: float, y: float, z: float, half: FloatArray, R_BX: FloatArray, p_BX: FloatArray) -> float:
    """Distance (m) from a point in the body frame to a box; tighter than the bounding sphere of a long box."""
    dx, dy, dz = x - p_BX[0], y - p_BX[1], z - p_BX[2]
    cx = R_BX[0, 0] * dx + R_BX[1, 0] * dy + R_BX[2, 0] * dz
    cy = R_BX[0, 1] * dx + R_BX[1, 1] * dy + R_BX[2, 1] * dz
    cz = R_BX[0, 2] * dx + R_BX[1, 2] * dy + R_BX[2, 2] * dz
    return float(_from_box(cx, cy, cz, half))


@compiled
def _from_box(x: float, y: float, z: float, half: FloatArray) -> float:
    """Distance (m) from a point to a box about the origin; 0 inside."""
    x, y, z = max(0.0, abs(x) - half[0]), max(0.0, abs(y) - half[1]), max(0.0, abs(z) - half[2])
    return math.sqrt(x * x + y * y + z * z)


@compiled
def _box_gap(
    half: FloatArray, R_FG: FloatArray, p_FG: FloatArray, other: FloatArray, R_FX: FloatArray, p_FX: FloatArray
) -> float:
    """Gap (m) between two boxes along their fifteen separating axes; negative where they overlap.

    Gottschalk, Lin and Manocha, "OBBTree", 1996.
    """
    R, A, d = np.empty((3, 3)), np.empty((3, 3)), np.empty(3)
    for i in range(3):
        d[i] = 0.0
        for k in range(3):
            d[i] += R_FG[k, i] * (p_FX[k] - p_FG[k])
        for j in range(3):
            R[i, j] = R_FG[0, i] * R_FX[0, j] + R_FG[1, i] * R_FX[1, j] + R_FG[2, i] * R_FX[2, j]
            A[i, j] = abs(R[i, j])
    gap = -np.inf
    for i in range(3):
        gap = max(gap, abs(d[i]) - half[i] - (A[i, 0] * other[0] + A[i, 1] * other[1] + A[i, 2] * other[2]))
        along = abs(d[0] * R[0, i] + d[1] * R[1, i] + d[2] * R[2, i])
        gap = max(gap, along - other[i] - (A[0, i] * half[0] + A[1, i] * half[1] + A[2, i] * half[2]))
    for i in range(3):
        u, v = (i + 1) % 3, (i + 2) % 3
        for j in range(3):
            length = math.sqrt(max(0.0, 1.0 - R[i, j] * R[i, j]))
            if length < _PARALLEL:
                continue
            w, q = (j + 1) % 3, (j + 2) % 3
            span = half[u] * A[v, j] + half[v] * A[u, j] + other[w] * A[i, q] + other[q] * A[i, w]
            gap = max(gap, (abs(d[v] * R[u, j] - d[u] * R[v, j]) - span) / length)
    return gap
