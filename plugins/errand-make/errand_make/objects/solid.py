"""A mesh as a solid body: its closed surface, its volume, and its convex parts."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components, minimum_spanning_tree
from scipy.spatial import ConvexHull, QhullError, cKDTree

from errand_make.errors import ObjectImportError, library
from errand_make.mesh import unique_rows
from skills.robot import FloatArray

MOST_PIECES: Final = 1_000
Faces = NDArray[np.int64]


@dataclass(frozen=True)
class _Patches:
    """Patches of triangles (T,): joined over edges of two triangles each, and turned so that neighbours agree."""

    number: NDArray[np.int64]
    turned: NDArray[np.bool_]

    @classmethod
    def of(cls, faces: Faces) -> _Patches:
        """Finds the patches. Raises ObjectImportError when one has only one side."""
        first, second, edges = _neighbours(faces)
        alike = (edges[first] != edges[second]).all(axis=1)
        count = len(faces)
        one, other = first % count, second % count
        # each triangle stands twice, as given and turned; joined triangles must be wound alike
        ends = np.where(alike, other, other + count), np.where(alike, other + count, other)
        label = _components(np.concatenate([one, one + count]), np.concatenate(ends), 2 * count)
        as_it_is, turned = label[:count], label[count:]
        if (as_it_is == turned).any():
            hint = "calculate its normals again in the program that made it"
            raise ObjectImportError("its surface has one side only, like a Moebius strip", hint)
        number = np.unique(np.minimum(as_it_is, turned), return_inverse=True)[1].reshape(-1)
        return cls(number, as_it_is > turned)


def _neighbours(faces: Faces) -> tuple[NDArray[np.int64], NDArray[np.int64], Faces]:
    """Indices of the two edges where exactly two triangles meet, and all edges (3 T, 2), by corner after corner."""
    index, count = _equal_edges(faces)
    order = np.argsort(index, kind="stable")
    order = order[count[index[order]] == 2]
    return order[::2], order[1::2], _edges(faces)


def _equal_edges(faces: Faces) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Number of each edge (3 T,), equal for both directions, and how many triangles have the edge of a number."""
    low, high = np.sort(_edges(faces), axis=1).T
    _, index, count = np.unique(low * (faces.max() + 1) + high, return_inverse=True, return_counts=True)
    return index.reshape(-1), count


def _components(rows: NDArray[np.int64], columns: NDArray[np.int64], count: int) -> NDArray[np.int64]:
    """Component of each of `count` nodes that pairs of nodes join."""
    joined = coo_array((np.ones(len(rows), np.int8), (rows, columns)), shape=(count, count))
    return np.asarray(connected_components(joined, directed=False)[1], dtype=np.int64)


def _pieces(faces: Faces) -> NDArray[np.int64]:
    """Connected piece of each triangle (T,), joined over all edges."""
    index, count = _equal_edges(faces)
    triangle = np.tile(np.arange(len(faces)), 3)
    return _components(triangle, len(faces) + index, len(faces) + len(count))[: len(faces)]


def bodies_apart(triangles: FloatArray) -> float:
    """Widest gap (m) between the boxes of the bodies in triangles (T, 3, 3), each joined to its nearest one."""
    points, faces = unique_points(triangles)
    pieces = _pieces(faces)
    if not 0 < pieces.max() < MOST_PIECES:
        return 0.0
    corners = [points[faces[pieces == piece]].reshape(-1, 3) for piece in range(pieces.max() + 1)]
    low, high = (np.array([each(part, axis=0) for part in corners]) for each in (np.min, np.max))
    gaps = np.linalg.norm(np.maximum(0.0, np.maximum(low[:, None] - high, low - high[:, None])), axis=2)
    return float(minimum_spanning_tree(gaps).max())


def _bounding(points: FloatArray, faces: Faces) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Masks (T,) of triangles to flip so that neighbours agree, and of triangles that bound the body.

    At an edge of more than two triangles, rays from both sides of each patch find the inside. A patch between two parts
    of the body, or outside, bounds no volume.
    """
    patches = _Patches.of(faces)
    turned, bounding = patches.turned.copy(), np.ones(len(faces), dtype=np.bool_)
    index, count = _equal_edges(faces)
    meeting = (count[index] > 2).reshape(3, -1).any(axis=0)
    if not meeting.any():
        return turned, bounding
    numbers = np.unique(patches.number[meeting])
    if len(numbers) * len(faces) > _MOST_RAY_TESTS:
        hint = "unite its bodies to one in the program that made it"
        raise ObjectImportError(
            f"its surface is too tangled: at {int((count > 2).sum())} edges many triangles meet", hint
        )
    piece, corners = _pieces(faces), points[_turned(faces, turned)]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    areas = np.linalg.norm(across, axis=1)
    for number in numbers.tolist():
        own = np.flatnonzero(patches.number == number)
        start = own[np.argmax(areas[own])]
        others = corners[(piece == piece[start]) & (np.arange(len(faces)) != start)]
        before, behind = (
            _is_enclosed(corners[start].mean(axis=0), side * across[start] / areas[start], others) for side in (1, -1)
        )
        bounding[own] = before != behind
        turned[own] ^= before and not behind
    return turned, bounding


_RAYS: Final = np.array(
    [(0.0, 0.0, 0.0), (0.31, 0.17, -0.11), (-0.23, 0.29, 0.19), (0.13, -0.37, 0.07), (0.05, 0.11, 0.41)]
)
"""Deviations of rays from a normal."""


def _is_enclosed(origin: FloatArray, normal: FloatArray, triangles: FloatArray) -> bool:
    """Returns whether most rays into the half space of a normal cross triangles (T, 3, 3) an odd number of times."""
    votes = [_crossings(origin, normal + deviation, triangles) % 2 for deviation in _RAYS]
    return sum(votes) > len(votes) / 2


def _crossings(origin: FloatArray, ray: FloatArray, triangles: FloatArray) -> int:
    """Number of triangles that a ray crosses, by the method of Moeller and Trumbore."""
    a, along, aside = triangles[:, 0], triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    over = np.cross(ray, aside)
    size = np.einsum("ij,ij->i", along, over)
    with np.errstate(divide="ignore", invalid="ignore"):
        u = np.einsum("ij,ij->i", origin - a, over) / size
        under = np.cross(origin - a, along)
        v, distance = under @ ray / size, np.einsum("ij,ij->i", aside, under) / size
        return int(np.sum((u >= 0.0) & (v >= 0.0) & (u + v <= 1.0) & (distance > 0.0)))


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
_EFFORT: Final = MappingProxyType({"mcts_iterations": 10, "mcts_max_depth": 2, "mcts_nodes": 10, "resolution": 500})
"""Part of CoACD's default search: a mug of 2400 triangles takes less than half the time of a deeper search."""
_SAME_POINT: Final = 1e-6
_SEAMS: Final = (1e-5, 1e-4)
"""Gaps that are closed in an open mesh, as shares of its size: single precision leaves them."""
_MOST_RAY_TESTS: Final = 50_000_000
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

    def bodies_apart(self) -> tuple[int, float]:
        """Number of bodies with wide gaps between them, and the narrowest of these gaps (m); (1, 0.0) for one body.

        Gaps are those between the convex hulls of connected pieces, along the directions of `_DIRECTIONS`.
        """
        piece = _pieces(self.faces)
        along = self.triangles @ _DIRECTIONS.T
        ends = np.zeros((2, piece.max() + 1, len(_DIRECTIONS)))
        ends[0], ends[1] = np.inf, -np.inf
        np.minimum.at(ends[0], piece, along.min(axis=1))
        np.maximum.at(ends[1], piece, along.max(axis=1))
        gaps = np.zeros((len(ends[0]), len(ends[0])))
        for low, high in zip(*np.moveaxis(ends, 2, 1), strict=True):
            gaps = np.maximum(gaps, low[None] - high[:, None])
        gaps = np.maximum(gaps, gaps.T)
        first, second = np.nonzero(gaps <= _WIDE_GAP * float(np.ptp(self.points, axis=0).max()))
        body = _components(first, second, len(gaps))
        between = gaps[body[:, None] != body]
        return int(body.max()) + 1, float(between.min()) if between.size else 0.0


_WIDE_GAP: Final = 0.1
"""Gap between two bodies, as a share of the longest side of both, that parts of one object do not have."""
_DIRECTIONS: Final = np.array(
    [np.array(d) / np.linalg.norm(d) for d in itertools.product((-1, 0, 1), repeat=3) if d > (0, 0, 0)]
)


def solid_of(triangles: FloatArray, *, close_holes: bool = False) -> tuple[Solid, NDArray[np.bool_]]:
    """Solid within triangles (T, 3, 3), and the mask (T,) of the triangles that are flipped to face outward.

    Merges close points, drops doubled triangles and triangles inside the body, and flips triangles that face inward.
    With `close_holes`, a fan about its centre closes each ring of edges without partners.

    Raises:
        ObjectImportError: the surface is open, has one side only, meets itself, or is flat.
    """
    _refuse_flat(triangles)
    surface = _least_open(triangles)
    if len(surface.rims) and not close_holes:
        hint = "close it in the program that made it, or add --close-holes"
        raise ObjectImportError(f"it is open (not watertight), at {len(surface.rims)} edges", hint)
    points, faces = _closed(surface.points, surface.faces, surface.rims)
    inward = _inward(points, faces)
    solid = Solid(points, _turned(faces, inward))
    if abs(solid.volume_m3) <= _LEAST_VOLUME * float(np.prod(np.ptp(points, axis=0))):
        raise ObjectImportError(*_FLAT)
    outward = _normals(solid.triangles[: len(surface.faces)])[surface.origin]
    return solid, (surface.origin >= 0) & (np.einsum("ij,ij->i", _normals(triangles), outward) < 0.0)


_FLAT: Final = ("it encloses no volume", "give a body with a thickness instead of a sheet")


def _refuse_flat(triangles: FloatArray) -> None:
    """Refuses triangles in one plane. Raises ObjectImportError."""
    points = triangles.reshape(-1, 3) - triangles.reshape(-1, 3).mean(axis=0)
    spread = np.sqrt(np.maximum(np.linalg.eigvalsh(points.T @ points), 0.0))
    if spread[0] <= _LEAST_VOLUME * spread[2]:
        raise ObjectImportError(*_FLAT)


def _least_open(triangles: FloatArray) -> _Surface:
    """Surface of triangles (T, 3, 3), closed over small gaps if this closes all of it."""
    exact = _surface(triangles, _SAME_POINT)
    for gap in _SEAMS if len(exact.rims) else ():
        with suppress(ObjectImportError):
            if not len((joined := _surface(triangles, gap)).rims):
                return joined
    return exact


@dataclass(frozen=True)
class _Surface:
    """A surface whose triangles agree: points, indices, edges (E, 2) without a partner, and its own triangles.

    `origin` (T,) is the surface's triangle for each given one, -1 for none.
    """

    points: FloatArray
    faces: Faces
    rims: Faces
    origin: NDArray[np.int64]


def _surface(triangles: FloatArray, gap: float) -> _Surface:
    """Surface of triangles (T, 3, 3), whose points are joined over gaps that are a share of its size.

    Raises ObjectImportError when the triangles at an edge bound no body.
    """
    points, corners = _joined(triangles, gap)
    apart = (corners[:, 0] != corners[:, 1]) & (corners[:, 1] != corners[:, 2]) & (corners[:, 2] != corners[:, 0])
    _, first, index = np.unique(np.sort(corners[apart], axis=1), axis=0, return_index=True, return_inverse=True)
    faces = corners[apart][first]
    if len(faces) == 0:
        raise ObjectImportError(*_FLAT)
    turned, bounding = _bounding(points, faces)
    if not bounding.any():
        raise ObjectImportError(*_FLAT)
    kept = np.where(bounding, np.cumsum(bounding) - 1, -1)
    origin = np.full(len(triangles), -1)
    origin[apart] = kept[index.reshape(-1)]
    used, faces = np.unique(_turned(faces, turned)[bounding], return_inverse=True)
    points, faces = points[used], faces.reshape(-1, 3)
    rims = _unpaired(faces)
    edges, times = np.unique(rims, axis=0, return_counts=True)
    if (times > 1).any():
        x, y, z = points[edges[np.argmax(times)]].mean(axis=0)
        what = f"its triangles face apart at {int((times > 1).sum())} edges, as at ({x:.3g}, {y:.3g}, {z:.3g}) m"
        hint = "unite its bodies to one, or calculate its normals again, in the program that made it"
        raise ObjectImportError(what, hint)
    return _Surface(points, faces, rims, origin)


def _joined(triangles: FloatArray, gap: float) -> tuple[FloatArray, Faces]:
    """Points (N, 3) and indices of the triangles (T, 3); points with a gap below a share of the size are one."""
    points, faces = unique_points(triangles)
    if gap <= _SAME_POINT:
        return points, faces
    pairs = cKDTree(points).query_pairs(gap * float(np.ptp(points, axis=0).max()), output_type="ndarray")
    label = _components(pairs[:, 0], pairs[:, 1], len(points))
    _, first = np.unique(label, return_index=True)
    return points[first], label[faces]


def _inward(points: FloatArray, faces: Faces) -> NDArray[np.bool_]:
    """Mask (T,) of the triangles to flip so that the pieces of a closed surface bound a body."""
    pieces = _pieces(faces)
    if pieces.max() < MOST_PIECES:
        return outward_flips(points, faces, pieces)
    return np.full(len(faces), _volume(np.asarray(points[faces])) < 0.0)


def _normals(triangles: FloatArray) -> FloatArray:
    """Normals (T, 3) of triangles, as long as twice their areas."""
    return np.asarray(np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]))


def _turned(faces: Faces, which: NDArray[np.bool_]) -> Faces:
    return np.where(which[:, None], faces[:, ::-1], faces)


def _volume(triangles: FloatArray) -> float:
    a, b, c = triangles[:, 0], triangles[:, 1], triangles[:, 2]
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6.0)


def unique_points(triangles: FloatArray) -> tuple[FloatArray, Faces]:
    """Unique points (N, 3) and the indices of the triangles (T, 3); nearly equal points count as equal."""
    corners = triangles.reshape(-1, 3)
    step = max(float(np.ptp(corners, axis=0).max()) * _SAME_POINT, 1e-12)
    first, index = unique_rows(np.round(corners / step))
    return corners[first], index.reshape(-1, 3)


def _edges(faces: Faces) -> Faces:
    return np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])


def _unpaired(faces: Faces) -> Faces:
    """Edges (E, 2) of triangles without a partner in the opposite direction, each as often as it lacks one."""
    edges, (index, count) = _edges(faces), _equal_edges(faces)
    forward = edges[:, 0] < edges[:, 1]
    surplus = np.bincount(index[forward], minlength=len(count)) - np.bincount(index[~forward], minlength=len(count))
    open_, ends = np.flatnonzero(surplus), np.empty((len(count), 2), np.int64)
    ends[index] = np.sort(edges, axis=1)
    ends = np.where((surplus[open_] > 0)[:, None], ends[open_], ends[open_][:, ::-1])
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
        LibraryMissingError: CoACD is not installed.
    """
    hull = hull_of(solid.points)
    whole = _few_corners(solid.points[hull.vertices])
    if solid.volume_m3 >= AS_GOOD_AS_CONVEX * hull.volume:
        return (whole,)
    coacd = library("coacd")
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
    """Selects the farthest corners in `MOST_CORNERS` directions, if there are more corners."""
    if len(corners) <= MOST_CORNERS:
        return corners
    step = np.arange(MOST_CORNERS) + 0.5
    height, turn = 1.0 - 2.0 * step / MOST_CORNERS, np.pi * (1.0 + np.sqrt(5.0)) * step
    across = np.sqrt(1.0 - height**2)
    directions = np.stack([across * np.cos(turn), across * np.sin(turn), height], axis=1)
    return np.asarray(corners[np.unique(np.argmax(corners @ directions.T, axis=0))])
