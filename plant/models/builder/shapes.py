"""Collision shapes and their SDF form; of the primitive ones also their inertias."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from pydrake.math import RollPitchYaw, RotationMatrix
from pydrake.multibody.tree import UnitInertia

from skills.robot import FloatArray

Vector = tuple[float, float, float]


def number(value: float) -> str:
    """A decimal number for a file: at most six places, no trailing zeros, no minus zero."""
    text = f"{value:.6f}".rstrip("0").rstrip(".")
    return "0" if text in ("-0", "") else text


@dataclass(frozen=True, kw_only=True)
class Geometry(ABC):
    """What collides, in its model's frame: `p` is its origin (m), `rpy` its roll, pitch and yaw (rad)."""

    p: Vector = (0.0, 0.0, 0.0)
    rpy: Vector = (0.0, 0.0, 0.0)

    @abstractmethod
    def sdf(self) -> str:
        """The SDF `<geometry>` content."""

    def pose_text(self) -> str:
        """The SDF pose."""
        return " ".join(number(v) for v in (*self.p, *self.rpy))


@dataclass(frozen=True, kw_only=True)
class ConvexMesh(Geometry):
    """The convex hull of a mesh file beside the SDF."""

    file: str

    def sdf(self) -> str:
        """The SDF `<geometry>` content."""
        return f"<mesh><drake:declare_convex/><uri>{self.file}</uri></mesh>"


@dataclass(frozen=True, kw_only=True)
class Shape(Geometry):
    """A primitive shape; `p` is its centre."""

    @abstractmethod
    def _own_inertia(self) -> UnitInertia:
        """About the centre, in the shape's own axes."""

    def rotation(self) -> FloatArray:
        """The (3, 3) rotation of the shape in the model's frame."""
        return np.asarray(RotationMatrix(RollPitchYaw(*self.rpy)).matrix())

    def mass_properties(self, mass_kg: float) -> MassProperties:
        """The shape filled evenly with a mass."""
        own = self._own_inertia().CopyToFullMatrix3()
        return MassProperties(mass_kg, np.array(self.p), mass_kg * self.rotation() @ own @ self.rotation().T)


@dataclass(frozen=True, kw_only=True)
class Box(Shape):
    """A box with full edge lengths `size` (m)."""

    size: Vector

    def sdf(self) -> str:
        """The SDF `<geometry>` content."""
        return f"<box><size>{' '.join(number(v) for v in self.size)}</size></box>"

    def _own_inertia(self) -> UnitInertia:
        return UnitInertia.SolidBox(*self.size)


@dataclass(frozen=True, kw_only=True)
class Cylinder(Shape):
    """A cylinder along its own z axis (m)."""

    radius: float
    length: float

    def sdf(self) -> str:
        """The SDF `<geometry>` content."""
        return f"<cylinder><radius>{number(self.radius)}</radius><length>{number(self.length)}</length></cylinder>"

    def _own_inertia(self) -> UnitInertia:
        return UnitInertia.SolidCylinder(self.radius, self.length, np.array([0.0, 0.0, 1.0]))


@dataclass(frozen=True, kw_only=True)
class Sphere(Shape):
    """A sphere (m)."""

    radius: float

    def sdf(self) -> str:
        """The SDF `<geometry>` content."""
        return f"<sphere><radius>{number(self.radius)}</radius></sphere>"

    def _own_inertia(self) -> UnitInertia:
        return UnitInertia.SolidSphere(self.radius)


@dataclass(frozen=True)
class MassProperties:
    """Mass (kg), centre of mass (m) and (3, 3) inertia about it (kg m^2) in the model's frame."""

    mass_kg: float
    com: FloatArray
    inertia: FloatArray


def together(bodies: Sequence[MassProperties]) -> MassProperties:
    """The mass properties of bodies joined rigidly, all given in one frame. Raises ValueError without a mass."""
    mass = sum(body.mass_kg for body in bodies)
    if mass <= 0:
        raise ValueError("together: the bodies have no mass")
    com = np.asarray(sum(body.mass_kg * body.com for body in bodies)) / mass
    inertia = np.zeros((3, 3))
    for body in bodies:
        offset = body.com - com
        inertia += body.inertia + body.mass_kg * (offset @ offset * np.eye(3) - np.outer(offset, offset))
    return MassProperties(float(mass), com, inertia)
