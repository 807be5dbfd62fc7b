"""Rounded bodies as fields: a distance is negative inside; fields join smoothly and become meshes.

Blending by the polynomial smooth minimum (Quilez 2008), meshing by naive surface nets (Gibson 1998).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from skills.robot import FloatArray

Field = Callable[[FloatArray], FloatArray]
"""Points (..., 3) to distances (...), in metres."""


def ball(centre: ArrayLike, radii: ArrayLike, R: ArrayLike | None = None) -> Field:
    """An ellipsoid; R turns it."""
    c, r = np.asarray(centre, dtype=float), np.broadcast_to(np.asarray(radii, dtype=float), (3,))
    turn = np.eye(3) if R is None else np.asarray(R, dtype=float)

    def field(p: FloatArray) -> FloatArray:
        q = (p - c) @ turn
        near = np.linalg.norm(q / r, axis=-1)
        return np.asarray(near * (near - 1.0) / np.maximum(np.linalg.norm(q / r**2, axis=-1), 1e-9))

    return field


def limb(low: ArrayLike, high: ArrayLike, r_low: float, r_high: float) -> Field:
    """A capsule between two points whose radius changes evenly."""
    a, b = np.asarray(low, dtype=float), np.asarray(high, dtype=float)
    along = b - a
    length2 = float(along @ along)

    def field(p: FloatArray) -> FloatArray:
        t = np.clip((p - a) @ along / length2, 0.0, 1.0)
        return np.asarray(np.linalg.norm(p - a - t[..., None] * along, axis=-1) - (r_low + t * (r_high - r_low)))

    return field


def block(centre: ArrayLike, half: ArrayLike, radius: float, R: ArrayLike | None = None) -> Field:
    """A box with rounded edges."""
    c, h = np.asarray(centre, dtype=float), np.asarray(half, dtype=float) - radius
    turn = np.eye(3) if R is None else np.asarray(R, dtype=float)

    def field(p: FloatArray) -> FloatArray:
        q = np.abs((p - c) @ turn) - h
        outside = np.linalg.norm(np.maximum(q, 0), axis=-1)
        return np.asarray(outside + np.minimum(q.max(axis=-1), 0) - radius)

    return field


def join(fields: Sequence[Field], blend_m: float = 0.0) -> Field:
    """The union, smooth over about `blend_m`."""

    def field(p: FloatArray) -> FloatArray:
        """The distance of points to the union."""
        total = fields[0](p)
        for other in fields[1:]:
            d = other(p)
            if blend_m <= 0:
                total = np.minimum(total, d)
                continue
            h = np.maximum(blend_m - np.abs(total - d), 0.0) / blend_m
            total = np.minimum(total, d) - h * h * blend_m / 4
        return np.asarray(total)

    return field


def cut(body: Field, tool: Field, blend_m: float = 0.0) -> Field:
    """The body without the tool."""

    def inverse(of: Field) -> Field:
        return lambda p: -of(p)

    return inverse(join([inverse(body), tool], blend_m))


def half_space(point: ArrayLike, outward: ArrayLike) -> Field:
    """All behind a plane."""
    c, n = np.asarray(point, dtype=float), np.asarray(outward, dtype=float)
    n = n / np.linalg.norm(n)
    return lambda p: np.asarray((p - c) @ n)


def both(a: Field, b: Field) -> Field:
    """The part that two bodies share."""
    return lambda p: np.maximum(a(p), b(p))


def grown(body: Field, by_m: float) -> Field:
    """The body, thicker by a distance."""
    return lambda p: body(p) - by_m


def surface(body: Field, low: ArrayLike, high: ArrayLike, step_m: float) -> tuple[FloatArray, FloatArray]:
    """Triangles of the surface within a box: corner points (3N, 3) and smooth normals (3N, 3), looking outward."""
    a, b = np.asarray(low, dtype=float) - 2 * step_m, np.asarray(high, dtype=float) + 2 * step_m
    axes = [np.arange(a[k], b[k] + step_m, step_m) for k in range(3)]
    d = body(np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1))
    vertex, index = _net_vertices(d)
    points = a + vertex * step_m
    faces = _net_faces(d, index)
    if not len(faces):
        return np.zeros((0, 3)), np.zeros((0, 3))
    points, normals = _pulled(body, points, step_m)
    order = faces.reshape(-1)
    return points[order], normals[order]


def _net_vertices(d: FloatArray) -> tuple[FloatArray, NDArray[np.int64]]:
    """One vertex in each cell that the surface crosses, in cells; and each cell's vertex number (-1: none)."""
    shape = tuple(n - 1 for n in d.shape)
    total, count = np.zeros((*shape, 3)), np.zeros(shape)
    for axis in range(3):
        for u in (0, 1):
            for v in (0, 1):
                start = np.insert(np.array([u, v]), axis, 0)
                step = np.eye(3, dtype=int)[axis]
                first, second = _shifted(d, start, shape), _shifted(d, start + step, shape)
                crossing = (first < 0) != (second < 0)
                t = np.where(crossing, first / np.where(crossing, first - second, 1.0), 0.0)
                total += np.where(crossing[..., None], start + t[..., None] * step, 0.0)
                count += crossing
    active = count > 0
    index = np.full(shape, -1, dtype=np.int64)
    index[active] = np.arange(int(active.sum()))
    return np.argwhere(active) + total[active] / count[active][:, None], index


def _shifted(d: FloatArray, start: NDArray[np.int64], shape: tuple[int, ...]) -> FloatArray:
    i, j, k = start
    return d[i : i + shape[0], j : j + shape[1], k : k + shape[2]]


def _net_faces(d: FloatArray, index: NDArray[np.int64]) -> NDArray[np.int64]:
    """Two triangles (vertex numbers) for each edge of the grid that crosses the surface."""
    inside, faces = d < 0, []
    for axis in range(3):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        step = np.eye(3, dtype=int)[axis]
        low = tuple(slice(1 if k != axis else 0, -1) for k in range(3))
        high = tuple(slice(1, -1 if k != axis else None) for k in range(3))
        leaves, enters = inside[low] & ~inside[high], ~inside[low] & inside[high]
        for mask, order in ((leaves, (0, 1, 2, 3)), (enters, (3, 2, 1, 0))):
            cell = np.argwhere(mask) + (1 - step)
            eu, ev = np.eye(3, dtype=int)[u], np.eye(3, dtype=int)[v]
            around = [cell - eu - ev, cell - ev, cell, cell - eu]
            quad = np.stack([index[tuple(c.T)] for c in around], axis=1)[:, list(order)]
            faces += [quad[:, [0, 1, 2]], quad[:, [0, 2, 3]]]
    return np.concatenate(faces)


def _pulled(body: Field, points: FloatArray, step_m: float) -> tuple[FloatArray, FloatArray]:
    """Points moved onto the surface, and the unit gradient there."""
    normals = np.zeros_like(points)
    for _ in range(2):
        offset = 0.3 * step_m
        gradient = np.stack([body(points + offset * e) - body(points - offset * e) for e in np.eye(3)], axis=-1) / (
            2 * offset
        )
        normals = gradient / np.maximum(np.linalg.norm(gradient, axis=1, keepdims=True), 1e-9)
        points = points - np.clip(body(points), -step_m, step_m)[:, None] * normals * 0.7
    return points, normals
