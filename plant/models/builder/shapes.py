"""Primitive collision shapes, their inertias and their SDF form."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from skills.robot import FloatArray

Vector = tuple[float, float, float]


def number(value: float) -> str:
    """A decimal number for a file: at most six places, no trailing zeros, no minus zero."""
    text = f"{value:.6f}".rstrip("0").rstrip(".")
    return "0" if text in ("-0", "") else text


@dataclass(frozen=True, kw_only=True)
class Shape(ABC):
    """A primitive shape in its model's frame: `p` is its centre (m), `rpy` its roll, pitch and yaw (rad)."""

    p: Vector = (0.0, 0.0, 0.0)
    rpy: Vector = (0.0, 0.0, 0.0)

    @abstractmethod
    def sdf(self) -> str:
        """The SDF `<geometry>` content."""

    @abstractmethod
    def volume(self) -> float:
        """Volume in cubic metres."""

    @abstractmethod
    def unit_inertia(self) -> Vector:
        """Principal moments about the centre per kilogram (m^2), in the shape's own axes."""

    def pose_text(self) -> str:
        """The SDF pose."""
        return " ".join(number(v) for v in (*self.p, *self.rpy))

    def rotation(self) -> FloatArray:
        """The (3, 3) rotation of the shape in the model's frame."""
        roll, pitch, yaw = self.rpy
        cr, sr, cp, sp = np.cos(roll), np.sin(roll), np.cos(pitch), np.sin(pitch)
        about_x = np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
        about_y = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
        about_z = np.array([[np.cos(yaw), -np.sin(yaw), 0], [np.sin(yaw), np.cos(yaw), 0], [0, 0, 1]])
        return np.asarray(about_z @ about_y @ about_x)


@dataclass(frozen=True, kw_only=True)
class Box(Shape):
    """A box with full edge lengths `size` (m)."""

    size: Vector

    def sdf(self) -> str:
        """The SDF `<geometry>` content."""
        return f"<box><size>{' '.join(number(v) for v in self.size)}</size></box>"

    def volume(self) -> float:
        """Volume in cubic metres."""
        return float(np.prod(self.size))

    def unit_inertia(self) -> Vector:
        """Principal moments about the centre per kilogram (m^2), in the shape's own axes."""
        x, y, z = (v * v / 12.0 for v in self.size)
        return (y + z, x + z, x + y)


@dataclass(frozen=True, kw_only=True)
class Cylinder(Shape):
    """A cylinder along its own z axis (m)."""

    radius: float
    length: float

    def sdf(self) -> str:
        """The SDF `<geometry>` content."""
        return f"<cylinder><radius>{number(self.radius)}</radius><length>{number(self.length)}</length></cylinder>"

    def volume(self) -> float:
        """Volume in cubic metres."""
        return float(np.pi * self.radius**2 * self.length)

    def unit_inertia(self) -> Vector:
        """Principal moments about the centre per kilogram (m^2), in the shape's own axes."""
        across = (3 * self.radius**2 + self.length**2) / 12.0
        return (across, across, self.radius**2 / 2.0)


@dataclass(frozen=True, kw_only=True)
class Sphere(Shape):
    """A sphere (m)."""

    radius: float

    def sdf(self) -> str:
        """The SDF `<geometry>` content."""
        return f"<sphere><radius>{number(self.radius)}</radius></sphere>"

    def volume(self) -> float:
        """Volume in cubic metres."""
        return float(4.0 / 3.0 * np.pi * self.radius**3)

    def unit_inertia(self) -> Vector:
        """Principal moments about the centre per kilogram (m^2), in the shape's own axes."""
        moment = 0.4 * self.radius**2
        return (moment, moment, moment)


@dataclass(frozen=True)
class Part:
    """A shape with a mass (kg), one summand of a body's inertia."""

    shape: Shape
    mass_kg: float


@dataclass(frozen=True)
class MassProperties:
    """Mass (kg), centre of mass (m) and (3, 3) inertia about it (kg m^2) in the model's frame."""

    mass_kg: float
    com: FloatArray
    inertia: FloatArray


def mass_properties(parts: Sequence[Part]) -> MassProperties:
    """Mass properties of rigidly joined parts. Raises ValueError when there is no mass."""
    mass = sum(part.mass_kg for part in parts)
    if mass <= 0:
        raise ValueError("mass_properties: the parts have no mass")
    com = np.asarray(sum(part.mass_kg * np.array(part.shape.p) for part in parts)) / mass
    inertia = np.zeros((3, 3))
    for part in parts:
        R, offset = part.shape.rotation(), np.array(part.shape.p) - com
        own = R @ np.diag(part.shape.unit_inertia()) @ R.T
        inertia += part.mass_kg * (own + offset @ offset * np.eye(3) - np.outer(offset, offset))
    return MassProperties(mass, com, inertia)
