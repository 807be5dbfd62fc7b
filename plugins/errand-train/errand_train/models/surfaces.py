"""More surfaces for textured meshes: grids, tubes, ellipsoids, rounded boxes and extruded outlines."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from errand_make.mesh import Mesh
from errand_train.models.outlines import area, inset, triangles_of
from skills.robot import FloatArray

Radii = ArrayLike


def add_grid(mesh: Mesh, material: str, points: ArrayLike, uvs: ArrayLike | None = None, *, ring: bool = False) -> None:
    """Adds a smooth surface through a grid of points (R, C, 3).

    Its front is the side of rows x columns: outward for rings from the bottom up, counter-clockwise seen from above.
    With `ring` the last column equals the first. Without `uvs` (R, C, 2) the texture is stretched over the grid.
    """
    grid = np.asarray(points, dtype=float)
    texture = _stretched(grid.shape) if uvs is None else np.asarray(uvs, dtype=float)
    normals = _grid_normals(grid, ring)
    _add_quads(mesh, material, grid, normals, texture)


def _stretched(shape: tuple[int, ...]) -> FloatArray:
    v, u = np.meshgrid(np.linspace(0, 1, shape[0]), np.linspace(0, 1, shape[1]), indexing="ij")
    return np.stack([u, v], axis=-1)


def _grid_normals(grid: FloatArray, ring: bool) -> FloatArray:
    along_columns = np.gradient(grid, axis=1)
    if ring:
        wrapped = (grid[:, 1] - grid[:, -2]) / 2
        along_columns[:, 0] = along_columns[:, -1] = wrapped
    normals = np.cross(along_columns, np.gradient(grid, axis=0))
    lengths = np.linalg.norm(normals, axis=-1, keepdims=True)
    flat = lengths[..., 0] < 1e-12
    normals = normals / np.maximum(lengths, 1e-12)
    for row, beside in ((0, 1), (-1, -2)):
        if flat[row].any():
            mean = normals[beside].mean(axis=0)
            normals[row][flat[row]] = mean / max(float(np.linalg.norm(mean)), 1e-9)
    return np.asarray(normals)


def _add_quads(mesh: Mesh, material: str, grid: FloatArray, normals: FloatArray, uvs: FloatArray) -> None:
    def corners(a: FloatArray) -> FloatArray:
        low, right, up, across = a[:-1, :-1], a[:-1, 1:], a[1:, :-1], a[1:, 1:]
        quads = np.stack([low, right, across, low, across, up], axis=2)
        return np.asarray(quads.reshape(-1, a.shape[-1]))

    points = corners(grid)
    keep = np.repeat(_areas(points) > 1e-12, 3)
    mesh.add_triangles(material, points[keep], corners(normals)[keep], corners(uvs)[keep])


def _areas(points: FloatArray) -> FloatArray:
    a, b, c = points[0::3], points[1::3], points[2::3]
    return np.asarray(np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2)


def add_tube(
    mesh: Mesh, material: str, path: ArrayLike, radii: Radii, *, sides: int = 12, caps: bool = True, up: ArrayLike = ()
) -> None:
    """Adds a round tube along a path (K, 3); `radii` (K), or (K, 2) for an oval with its first half axis along `up`."""
    line = np.asarray(path, dtype=float)
    wide = np.broadcast_to(np.asarray(radii, dtype=float).reshape(-1, (np.ndim(radii) == 2 and 2) or 1), (len(line), 2))
    first, second = _frames(line, np.asarray(up, dtype=float))
    angle = np.linspace(0, 2 * np.pi, sides + 1)
    round_ = (
        np.cos(angle)[None, :, None] * (first * wide[:, :1])[:, None]
        + np.sin(angle)[None, :, None] * (second * wide[:, 1:])[:, None]
    )
    grid = line[:, None] + round_
    add_grid(mesh, material, grid, ring=True)
    if caps:
        add_fan(mesh, material, grid[0, ::-1])
        add_fan(mesh, material, grid[-1])


def _frames(line: FloatArray, up: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Two normals at each point of a path, parallel-transported along it; first x second is the tangent."""
    tangent = np.gradient(line, axis=0)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    seed = up if up.size else np.eye(3)[int(np.argmin(np.abs(tangent[0])))]
    first = np.empty_like(line)
    for k, t in enumerate(tangent):
        seed = seed - (seed @ t) * t
        seed = seed / np.linalg.norm(seed)
        first[k] = seed
    return first, np.cross(tangent, first)


def add_fan(mesh: Mesh, material: str, ring: ArrayLike) -> None:
    """Adds the flat cap inside a ring (N, 3) that runs counter-clockwise as seen from outside."""
    rim = np.asarray(ring, dtype=float)
    middle = rim[:-1].mean(axis=0)
    normal = np.cross(rim[:-1] - middle, rim[1:] - middle).sum(axis=0)
    normal /= max(float(np.linalg.norm(normal)), 1e-15)
    n = len(rim) - 1
    points = np.stack([np.tile(middle, (n, 1)), rim[:-1], rim[1:]], axis=1).reshape(-1, 3)
    angle = np.linspace(0, 2 * np.pi, n + 1)
    circle = 0.5 + 0.5 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    uvs = np.stack([np.full((n, 2), 0.5), circle[:-1], circle[1:]], axis=1).reshape(-1, 2)
    mesh.add_triangles(material, points, np.tile(normal, (3 * n, 1)), uvs)


def add_ellipsoid(
    mesh: Mesh, material: str, centre: ArrayLike, radii: ArrayLike, R: ArrayLike | None = None, *, sides: int = 20
) -> None:
    """Adds an ellipsoid with half axes `radii`, rotated by R."""
    height, angle = np.linspace(-np.pi / 2, np.pi / 2, sides // 2 + 3), np.linspace(0, 2 * np.pi, sides + 1)
    part = Mesh(mesh.materials)
    across, up = np.meshgrid(np.cos(height), angle, indexing="ij")
    ball = np.stack([across * np.cos(up), across * np.sin(up), np.sin(height)[:, None] + 0 * up], axis=-1)
    texture = _stretched(ball.shape)
    _add_quads(part, material, ball, ball, texture)
    matrix = (np.eye(3) if R is None else np.asarray(R, dtype=float)) @ np.diag(np.asarray(radii, dtype=float))
    mesh.add_mesh(part, matrix, centre)


def add_rounded_box(
    mesh: Mesh, material: str, low: ArrayLike, high: ArrayLike, radius: float, *, top: str | None = None
) -> None:
    """Adds a box whose edges are rounded; its upper face may have another material."""
    a, b = np.asarray(low, dtype=float), np.asarray(high, dtype=float)
    radius = min(radius, float(np.min(b - a)) / 2.02)
    outline = rounded_rectangle((b - a)[:2], radius) + (a + b)[:2] / 2
    add_extruded(mesh, material, outline, float(a[2]), float(b[2]), bevel=radius, top=top)


def rounded_rectangle(size: ArrayLike, radius: float, steps: int = 5) -> FloatArray:
    """A counter-clockwise outline (N, 2) about the origin."""
    half = np.asarray(size, dtype=float) / 2 - radius
    points = []
    for quarter, sign in enumerate(((1, 1), (-1, 1), (-1, -1), (1, -1))):
        angle = np.linspace(0, np.pi / 2, steps) + quarter * np.pi / 2
        points.append(np.array(sign) * half + radius * np.stack([np.cos(angle), np.sin(angle)], axis=1))
    return np.concatenate(points)


def add_extruded(
    mesh: Mesh,
    material: str,
    outline: ArrayLike,
    z0: float,
    z1: float,
    *,
    bevel: float = 0.0,
    top: str | None = None,
    sharp_rad: float = 0.7,
) -> None:
    """Extrudes a simple outline (N, 2) of any form from z0 to z1, with rounded edges when `bevel` is given.

    Faces meet in an edge where the outline turns by more than `sharp_rad`; the rest is smooth.
    """
    flat = np.asarray(outline, dtype=float)
    flat = flat if area(flat) > 0 else flat[::-1]
    bevel = min(bevel, (z1 - z0) / 2.02)
    steps = [(0.0, 0.0)] if bevel <= 0 else [(s, c) for s, c in _quarter(bevel)]
    levels = [(z0 + up, inward) for inward, up in steps] + [(z1 - up, inward) for inward, up in reversed(steps)]
    rings = [np.column_stack([inset(flat, inward), np.full(len(flat), z)]) for z, inward in levels]
    for first, last in _smooth_runs(flat, sharp_rad):
        columns = [k % len(flat) for k in range(first, last + 1)]
        add_grid(mesh, material, np.stack([ring[columns] for ring in rings]), ring=last - first == len(flat))
    faces = np.array(triangles_of(flat))
    _add_face(mesh, material, rings[0], faces[:, ::-1], -1.0)
    _add_face(mesh, top or material, rings[-1], faces, 1.0)


def _quarter(bevel: float) -> list[tuple[float, float]]:
    """Insets and heights of a rounded edge, from its cap to its side."""
    angle = np.linspace(0, np.pi / 2, 4)
    return [(float(bevel * (1 - np.sin(a))), float(bevel * (1 - np.cos(a)))) for a in angle]


def _smooth_runs(flat: FloatArray, sharp_rad: float) -> list[tuple[int, int]]:
    """Runs of corners (first, last) between the sharp corners of an outline; indices beyond its end go round."""
    ahead = np.roll(flat, -1, axis=0) - flat
    heading = np.arctan2(ahead[:, 1], ahead[:, 0])
    turn = np.abs((heading - np.roll(heading, 1) + np.pi) % (2 * np.pi) - np.pi)
    sharp = [int(k) for k in np.flatnonzero(turn > sharp_rad)]
    if not sharp:
        return [(0, len(flat))]
    return list(zip(sharp, [*sharp[1:], sharp[0] + len(flat)], strict=True))


def _add_face(mesh: Mesh, material: str, ring: FloatArray, faces: NDArray[np.int64], up: float) -> None:
    points = ring[faces.reshape(-1)]
    low, span = ring[:, :2].min(axis=0), np.ptp(ring[:, :2], axis=0) + 1e-12
    uvs = (points[:, :2] - low) / span
    mesh.add_triangles(material, points, np.tile([0.0, 0.0, up], (len(points), 1)), uvs)


def add_ring(
    mesh: Mesh, material: str, inner_m: float, outer_m: float, z0: float, z1: float, *, centre: ArrayLike = (0, 0, 0)
) -> None:
    """Adds a flat ring about the vertical: a tyre, a ring spanner's end, a roll of tape."""
    profile: Sequence[tuple[float, float]] = [(inner_m, z0), (outer_m, z0), (outer_m, z1), (inner_m, z1), (inner_m, z0)]
    mesh.add_lathe(material, profile, centre=centre, sides=28)
