"""Turns the triangles of a closed surface so that all look outward."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from skills.robot import FloatArray

MOST_PIECES: Final = 1_000
Faces = NDArray[np.int64]


def pieces(faces: Faces) -> tuple[NDArray[np.int64], NDArray[np.bool_]] | None:
    """The connected piece of each triangle (T,), and which to turn so that the neighbours in a piece agree.

    None where three triangles meet at an edge, the surface has one side only, or there are too many pieces.
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


def outward(points: FloatArray, faces: Faces, piece: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Which triangles (T,) to turn so that each piece looks outward, and those that lie within another inward."""
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


def _volume(triangles: FloatArray) -> float:
    a, b, c = triangles[:, 0], triangles[:, 1], triangles[:, 2]
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6.0)


def _is_inside(probe: FloatArray, triangles: FloatArray) -> bool:
    """Whether a closed surface winds about all of some points."""
    for point in probe:
        a, b, c = (triangles[:, k] - point for k in range(3))
        la, lb, lc = (np.linalg.norm(each, axis=1) for each in (a, b, c))
        above = np.einsum("ij,ij->i", a, np.cross(b, c))
        below = la * lb * lc + np.einsum("ij,ij->i", a, b) * lc + np.einsum("ij,ij->i", b, c) * la
        below = below + np.einsum("ij,ij->i", c, a) * lb
        if abs(float(np.sum(2.0 * np.arctan2(above, below)))) < 2.0 * np.pi:
            return False
    return True
