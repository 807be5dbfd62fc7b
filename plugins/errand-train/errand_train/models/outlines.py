"""Plane outlines (N, 2): area, inset, triangles, and smooth curves."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from skills.robot import FloatArray

Triangle = tuple[int, int, int]


def area(outline: ArrayLike) -> float:
    """Signed area, positive when the outline runs counter-clockwise."""
    p = np.asarray(outline, dtype=float)
    q = np.roll(p, -1, axis=0)
    return float(np.sum(p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0]) / 2)


def inset(outline: FloatArray, distance: float) -> FloatArray:
    """Moves a counter-clockwise outline inward at every corner, without new corners."""
    if distance == 0:
        return outline
    ahead, behind = np.roll(outline, -1, axis=0) - outline, outline - np.roll(outline, 1, axis=0)
    ahead, behind = (e / np.maximum(np.linalg.norm(e, axis=1, keepdims=True), 1e-12) for e in (ahead, behind))
    inward = np.stack([-(ahead + behind)[:, 1], (ahead + behind)[:, 0]], axis=1)
    inward /= np.maximum(np.linalg.norm(inward, axis=1, keepdims=True), 1e-9)
    square = np.maximum(np.sum(inward * np.stack([-ahead[:, 1], ahead[:, 0]], axis=1), axis=1), 0.5)
    return np.asarray(outline + inward * (distance / square)[:, None])


def triangles_of(outline: ArrayLike) -> list[Triangle]:
    """Triangulates a simple counter-clockwise outline by ear clipping: corner indices, counter-clockwise."""
    p = np.asarray(outline, dtype=float)
    left, found = list(range(len(p))), list[Triangle]()
    while len(left) > 3:
        ear = next((k for k in range(len(left)) if _is_ear(p, left, k)), None)
        if ear is None:
            ear = int(np.argmin([abs(_turn(p, left, k)) for k in range(len(left))]))
        found.append((left[ear - 1], left[ear], left[(ear + 1) % len(left)]))
        del left[ear]
    return [*found, (left[0], left[1], left[2])]


def _turn(p: FloatArray, left: Sequence[int], k: int) -> float:
    a, b, c = p[left[k - 1]], p[left[k]], p[left[(k + 1) % len(left)]]
    return float((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))


def _is_ear(p: FloatArray, left: Sequence[int], k: int) -> bool:
    if _turn(p, left, k) <= 1e-14:
        return False
    corners = (left[k - 1], left[k], left[(k + 1) % len(left)])
    others = p[[i for i in left if i not in corners]]
    inside = np.ones(len(others), dtype=bool)
    for i, j in ((0, 1), (1, 2), (2, 0)):
        a, b = p[corners[i]], p[corners[j]]
        inside &= (b[0] - a[0]) * (others[:, 1] - a[1]) - (b[1] - a[1]) * (others[:, 0] - a[0]) > -1e-12
    return not inside.any()


def curve(points: Sequence[tuple[float, ...]], steps: int = 6) -> FloatArray:
    """Interpolates points of any dimension by a smooth line (Catmull and Rom 1974), with `steps` between each two."""
    p = np.asarray(points, dtype=float)
    padded = np.concatenate([2 * p[:1] - p[1:2], p, 2 * p[-1:] - p[-2:-1]])
    t = np.linspace(0, 1, steps, endpoint=False)[:, None]
    pieces = []
    for a, b, c, d in zip(padded[:-3], padded[1:-2], padded[2:-1], padded[3:], strict=True):
        pieces.append(b + 0.5 * t * (c - a + t * (2 * a - 5 * b + 4 * c - d + t * (3 * (b - c) + d - a))))
    return np.concatenate([*pieces, p[-1:]])


def arc(centre: tuple[float, float], radius: float, start_deg: float, end_deg: float, steps: int = 12) -> FloatArray:
    """Points (steps, 2) on a circle."""
    angle = np.radians(np.linspace(start_deg, end_deg, steps))
    return np.asarray(centre) + radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
