"""A mesh as a solid body: its closed surface, its volume, and the convex parts that fill it."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, QhullError

from plant.models.catalogue import ObjectImportError, objects_module
from skills.robot import FloatArray

MOST_PIECES: Final = 1_000
Faces = NDArray[np.int64]


def connected_pieces(faces: Faces) -> tuple[NDArray[np.int64], NDArray[np.bool_]] | None:
    """Connected piece of each triangle (T,), and the mask of triangles to flip so that neighbours agree.

    None when three triangles meet at an edge, the surface has only one side, or there are too many pieces.
    """
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    _, index, count = np.unique(np.sort(edges, axis=1), axis=0, return_inverse=True, return_counts=True)
    if len(count) == 0 or count.max() > 2:
        return None
    order = np.argsort(index.reshape(-1), kind="stable")
    order = order[count[index.reshape(-1)[order]] == 2]
    first, second = order[::2], order[1::2]
    agrees = (edges[first] == edges[second][:, ::-1]).all(axis=1)
    around: list[list[tuple[int, bool]]] = [[] for _ in faces]
    triangle = np.tile(np.arange(len(faces)), 3)
    for one, other, same in zip(triangle[first].tolist(), triangle[second].tolist(), agrees.tolist(), strict=True):
        around[one].append((other, same))
        around[other].append((one, same))
    piece, turned = np.full(len(faces), -1), np.zeros(len(faces), dtype=np.bool_)
    number = 0
    for start in range(len(faces)):
        if piece[start] >= 0:
            continue
        piece[start], waiting = number, [start]
        number += 1
        while waiting:
            here = waiting.pop()
            for there, same in around[here]:
                if piece[there] < 0:
                    piece[there], turned[there] = piece[start], turned[here] == same
                    waiting.append(there)
                elif (turned[there] == turned[here]) != same:
                    return None
    return None if number > MOST_PIECES else (piece, turned)


def outward_flips(points: FloatArray, faces: Faces, piece: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Mask of triangles (T,) to flip so that each piece faces outward, and a piece inside another inward."""
    numbers = np.unique(piece)
    corners = {number: points[faces[piece == number]] for number in numbers.tolist()}
    volumes = {number: _volume(triangles) for number, triangles in corners.items()}
    boxes = {number: (each.min(axis=(0, 1)), each.max(axis=(0, 1))) for number, each in corners.items()}
    turn = np.zeros(len(faces), dtype=np.bool_)
    for number, volume in volumes.items():
        probe, (low, high) = corners[number][:16, 0], boxes[number]
        around = [other for other in boxes if (boxes[other][0] < low).all() and (boxes[other][1] > high).all()]
        within = sum(_is_inside(probe, corners[other]) for other in around)
        if (volume < 0.0) != (within % 2 == 1):
            turn[piece == number] = True
    return turn


def _is_inside(probe: FloatArray, triangles: FloatArray) -> bool:
    """Returns whether all probe points are inside a closed surface, by their winding numbers."""
    for point in probe:
        a, b, c = (triangles[:, k] - point for k in range(3))
        la, lb, lc = (np.linalg.norm(each, axis=1) for each in (a, b, c))
        above = np.einsum("ij,ij->i", a, np.cross(b, c))
        below = la * lb * lc + np.einsum("ij,ij->i", a, b) * lc + np.einsum("ij,ij->i", b, c) * la
        below = below + np.einsum("ij,ij->i", c, a) * lb
        if abs(float(np.sum(2.0 * np.arctan2(above, below)))) < 2.0 * np.pi:
            return False
    return True


MOST_PARTS: Final = 16
MOST_CORNERS: Final = 64
CONCAVITY: Final = 0.05
"""CoACD's `threshold`: the allowed difference of a convex part from the body."""
AS_GOOD_AS_CONVEX: Final = 0.97
_EFFORT: Final = MappingProxyType({"mcts_iterations": 60, "mcts_nodes": 10, "resolution": 1000})
"""Half of CoACD's default search, which takes a quarter of the time and finds equally good parts."""
_SAME_POINT: Final = 1e-6
_LEAST_VOLUME: Final = 1e-6


@dataclass(frozen=True)
class Solid:
    """A closed surface that faces outward: points (N, 3) in metres and indices of triangles (T, 3)."""

    points: FloatArray
    faces: Faces

    @property
    def triangles(self) -> FloatArray:
        """Corners (T, 3, 3) of the triangles."""
        return np.asarray(self.points[self.faces])

    @property
    def volume_m3(self) -> float:
        """Enclosed volume."""
        return _volume(self.triangles)


def solid_of(triangles: FloatArray, *, close_holes: bool = False) -> tuple[Solid, NDArray[np.bool_]]:
    """Solid that triangles (T, 3, 3) enclose, and the mask (T,) of the triangles that are flipped to face outward.

    In a closed surface every edge of a triangle has a partner in the opposite direction. With `close_holes`, a fan
    about its centre closes each ring of edges without partners.

    Raises:
        ObjectImportError: the surface is open, its triangles cannot be wound alike, or it is flat.
    """
    points, faces, kept = _welded(triangles)
    alike = connected_pieces(faces)
    turned = np.zeros(len(faces), dtype=np.bool_) if alike is None else alike[1]
    faces = _turned(faces, turned)
    rims = _unpaired(faces)
    if len(np.unique(rims, axis=0)) < len(rims):
        hint = "let its normals be calculated again in the program that made it"
        raise ObjectImportError("its triangles do not all look outward", hint)
    if len(rims) and not close_holes:
        hint = "close it in the program that made it, or add --close-holes"
        raise ObjectImportError(f"it is open (not watertight), at {len(rims)} edges", hint)
    points, faces = _closed(points, faces, rims)
    closed = connected_pieces(faces)
    if closed is not None:
        inward = outward_flips(points, faces, closed[0])
    else:
        inward = np.full(len(faces), _volume(np.asarray(points[faces])) < 0.0)
    solid = Solid(points, _turned(faces, inward))
    box = float(np.prod(np.ptp(points, axis=0)))
    if abs(solid.volume_m3) <= _LEAST_VOLUME * box or box == 0.0:
        raise ObjectImportError("it encloses no volume", "give a body with a thickness instead of a sheet")
    changed = np.zeros(len(triangles), dtype=np.bool_)
    changed[kept] = turned ^ inward[: len(turned)]
    return solid, changed


def _turned(faces: Faces, which: NDArray[np.bool_]) -> Faces:
    return np.where(which[:, None], faces[:, ::-1], faces)


def _volume(triangles: FloatArray) -> float:
    a, b, c = triangles[:, 0], triangles[:, 1], triangles[:, 2]
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6.0)


def unique_points(triangles: FloatArray) -> tuple[FloatArray, Faces]:
    """Unique points (N, 3) and the indices of the triangles (T, 3); nearly equal points count as equal."""
    corners = triangles.reshape(-1, 3)
    step = max(float(np.ptp(corners, axis=0).max()) * _SAME_POINT, 1e-12)
    _, first, index = np.unique(
        np.round(corners / step).astype(np.int64), axis=0, return_index=True, return_inverse=True
    )
    return corners[first], index.reshape(-1, 3)


def _welded(triangles: FloatArray) -> tuple[FloatArray, Faces, NDArray[np.bool_]]:
    """Points, indices of the triangles that are not degenerate, and the mask (T,) of these."""
    points, faces = unique_points(triangles)
    apart = (faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])
    return points, faces[apart], apart


def _edges(faces: Faces) -> Faces:
    return np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])


def _unpaired(faces: Faces) -> Faces:
    """Edges (E, 2) of triangles without a partner in the opposite direction, each as often as it lacks one."""
    edges = _edges(faces)
    low, sign = np.sort(edges, axis=1), np.where(edges[:, 0] < edges[:, 1], 1, -1)
    unique, index = np.unique(low, axis=0, return_inverse=True)
    surplus = np.zeros(len(unique), np.int64)
    np.add.at(surplus, index.reshape(-1), sign)
    open_ = np.flatnonzero(surplus)
    ends = np.where((surplus[open_] > 0)[:, None], unique[open_], unique[open_][:, ::-1])
    return np.repeat(ends, np.abs(surplus[open_]), axis=0)


def _closed(points: FloatArray, faces: Faces, rims: Faces) -> tuple[FloatArray, Faces]:
    """Surface with a fan in each ring of edges without partners; these edges always form rings."""
    following: dict[int, list[int]] = {}
    for a, b in rims.tolist():
        following.setdefault(b, []).append(a)  # a fan runs against the rim
    middles, fans = list[FloatArray](), list[list[int]]()
    while following:
        ring = [next(iter(following))]
        while len(ring) == 1 or ring[-1] != ring[0]:
            ahead = following[ring[-1]]
            if len(ahead) == 1:
                del following[ring[-1]]
            ring.append(ahead.pop())
        fans += [[len(points) + len(middles), a, b] for a, b in itertools.pairwise(ring)]
        middles.append(points[ring[:-1]].mean(axis=0))
    if not fans:
        return points, faces
    return np.vstack([points, *middles]), np.vstack([faces, np.array(fans, dtype=np.int64)])


def convex_parts(solid: Solid) -> tuple[FloatArray, ...]:
    """Decomposes a body into at most `MOST_PARTS` convex parts, each of at most `MOST_CORNERS` corners (N, 3).

    A body that almost fills its convex hull is the only part; CoACD decomposes other bodies.

    Raises:
        ObjectsExtraMissingError: CoACD is not installed.
    """
    hull = hull_of(solid.points)
    whole = _few_corners(solid.points[hull.vertices])
    if solid.volume_m3 >= AS_GOOD_AS_CONVEX * hull.volume:
        return (whole,)
    coacd = objects_module("coacd")
    coacd.set_log_level("off")
    found = coacd.run_coacd(
        coacd.Mesh(solid.points, solid.faces),
        threshold=CONCAVITY,
        max_convex_hull=MOST_PARTS,
        seed=0,
        **_EFFORT,
    )
    low, high = solid.points.min(axis=0), solid.points.max(axis=0)
    return tuple(_cornered(np.clip(points, low, high) for points, _ in found)) or (whole,)


def _cornered(parts: Iterable[FloatArray]) -> Iterator[FloatArray]:
    """Corners of parts, without parts that are as thin as paper."""
    for points in parts:
        try:
            hull = hull_of(points)
        except ObjectImportError:
            continue
        yield _few_corners(points[hull.vertices])


def hull_of(points: FloatArray) -> ConvexHull:
    """Convex hull of points (N, 3). Raises ObjectImportError when they lie in a plane."""
    try:
        return ConvexHull(points)
    except QhullError as error:
        raise ObjectImportError("it encloses no volume", "give a body with a thickness instead of a sheet") from error


def _few_corners(corners: FloatArray) -> FloatArray:
    """Selects the corners that lie farthest in `MOST_CORNERS` directions, if there are more corners than that."""
    if len(corners) <= MOST_CORNERS:
        return corners
    step = np.arange(MOST_CORNERS) + 0.5
    height, turn = 1.0 - 2.0 * step / MOST_CORNERS, np.pi * (1.0 + np.sqrt(5.0)) * step
    across = np.sqrt(1.0 - height**2)
    directions = np.stack([across * np.cos(turn), across * np.sin(turn), height], axis=1)
    return np.asarray(corners[np.unique(np.argmax(corners @ directions.T, axis=0))])
