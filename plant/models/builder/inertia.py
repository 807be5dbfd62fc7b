"""Mass properties of triangle meshes: solids by their volume, shells by their surface.

Both sum the second moments of tetrahedra or triangles exactly (Blow and Binstock 2004).
"""

from __future__ import annotations

import numpy as np

from plant.models.builder.mesh import Mesh
from plant.models.builder.shapes import MassProperties
from skills.robot import FloatArray


def solid_mass(mesh: Mesh, density_kg_m3: float) -> MassProperties:
    """A closed mesh filled with matter. Raises ValueError when it encloses nothing."""
    a, b, c = _corners(mesh)
    volume = np.einsum("ij,ij->i", a, np.cross(b, c)) / 6
    return _gathered(a, b, c, volume * density_kg_m3, apex=True)


def shell_mass(mesh: Mesh, density_kg_m2: float) -> MassProperties:
    """A thin skin along all surfaces. Raises ValueError when there is none."""
    a, b, c = _corners(mesh)
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2
    return _gathered(a, b, c, area * density_kg_m2, apex=False)


def scaled_to(body: MassProperties, mass_kg: float) -> MassProperties:
    """The same form with another mass."""
    return MassProperties(mass_kg, body.com, body.inertia * (mass_kg / body.mass_kg))


def _corners(mesh: Mesh) -> tuple[FloatArray, FloatArray, FloatArray]:
    points = np.concatenate([p for _, p, _, _ in mesh.groups()])
    return points[0::3], points[1::3], points[2::3]


def _gathered(a: FloatArray, b: FloatArray, c: FloatArray, masses: FloatArray, *, apex: bool) -> MassProperties:
    """Sum triangles, or tetrahedra with their apex at the origin, of the given masses."""
    total = float(masses.sum())
    if total <= 0:
        raise ValueError("the mesh has no mass: it is empty, open or inside out")
    corners = 4 if apex else 3
    sums = a + b + c
    com = (masses[:, None] * sums).sum(axis=0) / corners / total
    outer = sum(np.einsum("i,ij,ik->jk", masses, v, v) for v in (a, b, c, sums))
    moment = np.asarray(outer) / (corners * (corners + 1)) - total * np.outer(com, com)
    return MassProperties(total, com, np.trace(moment) * np.eye(3) - moment)
