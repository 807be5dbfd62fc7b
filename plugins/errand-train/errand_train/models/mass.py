"""Mass properties of primitive shapes, and of bodies that are joined rigidly."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from pydrake.math import RollPitchYaw, RotationMatrix
from pydrake.multibody.tree import UnitInertia

from errand_make.shapes import Box, Cylinder, MassProperties, Shape, Sphere


def shape_mass(shape: Shape, mass_kg: float) -> MassProperties:
    """Mass properties of a box, cylinder or sphere that is filled evenly. Raises TypeError for another shape."""
    R = RotationMatrix(RollPitchYaw(*shape.rpy)).matrix()
    own = _unit_inertia(shape).CopyToFullMatrix3()
    return MassProperties(mass_kg, np.array(shape.p), mass_kg * R @ own @ R.T)


def _unit_inertia(shape: Shape) -> UnitInertia:
    """Unit inertia about the centre, in the axes of the shape."""
    if isinstance(shape, Box):
        return UnitInertia.SolidBox(*shape.size)
    if isinstance(shape, Cylinder):
        return UnitInertia.SolidCylinder(shape.radius, shape.length, np.array([0.0, 0.0, 1.0]))
    if isinstance(shape, Sphere):
        return UnitInertia.SolidSphere(shape.radius)
    raise TypeError(f"no unit inertia for a {type(shape).__name__}")


def join_masses(bodies: Sequence[MassProperties]) -> MassProperties:
    """Mass properties of bodies that are joined rigidly, all given in one frame. Raises ValueError without a mass."""
    mass = sum(body.mass_kg for body in bodies)
    if mass <= 0:
        raise ValueError("join_masses: the bodies have no mass")
    com = np.asarray(sum(body.mass_kg * body.com for body in bodies)) / mass
    inertia = np.zeros((3, 3))
    for body in bodies:
        offset = body.com - com
        inertia += body.inertia + body.mass_kg * (offset @ offset * np.eye(3) - np.outer(offset, offset))
    return MassProperties(float(mass), com, inertia)
