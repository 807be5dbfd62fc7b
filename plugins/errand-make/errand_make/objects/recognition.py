"""Describes an imported object for the robot: points on its surface with normals and colours, and its resting poses."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from errand_make.objects.mesh_files import Patch
from errand_make.objects.resting_pose import resting_rotations
from skills.perception.object_model import ObjectModel
from skills.robot import FloatArray

POINTS: Final = 2500


def recognition_model(name: str, patches: Sequence[Patch], points: FloatArray, com: FloatArray) -> ObjectModel:
    """Samples the surface of patches evenly, with outward normals; points (N, 3) and com are the body's."""
    triangles = np.concatenate([patch.triangles for patch in patches])
    across = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    areas = np.linalg.norm(across, axis=1)
    rng = np.random.default_rng(0)
    steps = (np.arange(POINTS) + 0.5) / POINTS * areas.sum()
    chosen = np.minimum(np.searchsorted(np.cumsum(areas), steps), len(areas) - 1)
    u, v = rng.random((2, POINTS))
    u, v = np.where(u + v > 1.0, 1.0 - u, u), np.where(u + v > 1.0, 1.0 - v, v)
    shares = np.stack([1.0 - u - v, u, v], axis=1)
    return ObjectModel(
        name,
        np.einsum("ij,ijk->ik", shares, triangles[chosen]),
        across[chosen] / np.maximum(areas[chosen, None], 1e-20),
        _colours(patches, chosen, shares),
        resting_rotations(points, com),
    )


def _colours(
    patches: Sequence[Patch], chosen: FloatArray, shares: FloatArray
) -> np.ndarray[tuple[int, int], np.dtype[np.uint8]]:
    """Colours (N, 3) at barycentric shares (N, 3) of chosen triangles (N,), from the patches' colours and pictures."""
    colours, first = np.zeros((len(chosen), 3), dtype=np.uint8), 0
    for patch in patches:
        own = (chosen >= first) & (chosen < first + len(patch.triangles))
        if patch.picture is None:
            colours[own] = np.round(255.0 * np.array(patch.colour)).astype(np.uint8)
        else:
            height, width = patch.picture.shape[:2]
            u, v = np.einsum("ij,ijk->ki", shares[own], patch.uvs[chosen[own] - first])
            rows, columns = np.floor((1.0 - v) * height).astype(int) % height, np.floor(u * width).astype(int) % width
            colours[own] = patch.picture[rows, columns]
        first += len(patch.triangles)
    return colours
