"""Collision shapes, mass properties of shapes and triangle meshes, and SDF model files."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from errand_make.mesh import Mesh
from skills.robot import FloatArray

Vector = tuple[float, float, float]


def number(value: float) -> str:
    """Formats a number for a file: at most six places, no trailing zeros, no minus zero."""
    text = f"{value:.6f}".rstrip("0").rstrip(".")
    return "0" if text in ("-0", "") else text


@dataclass(frozen=True, kw_only=True)
class Geometry(ABC):
    """Collision geometry in the frame of its model: `p` is its origin (m), `rpy` its roll, pitch and yaw (rad)."""

    p: Vector = (0.0, 0.0, 0.0)
    rpy: Vector = (0.0, 0.0, 0.0)

    @abstractmethod
    def sdf(self) -> str:
        """Content of the SDF element `<geometry>`."""

    def pose_text(self) -> str:
        """Pose in SDF form."""
        return " ".join(number(v) for v in (*self.p, *self.rpy))


@dataclass(frozen=True, kw_only=True)
class ConvexMesh(Geometry):
    """The convex hull of a mesh file beside the SDF."""

    file: str

    def sdf(self) -> str:
        """Content of the SDF element `<geometry>`."""
        return f"<mesh><drake:declare_convex/><uri>{self.file}</uri></mesh>"


@dataclass(frozen=True, kw_only=True)
class Shape(Geometry):
    """A primitive shape; `p` is its centre."""


@dataclass(frozen=True, kw_only=True)
class Box(Shape):
    """A box with full edge lengths `size` (m)."""

    size: Vector

    def sdf(self) -> str:
        """Content of the SDF element `<geometry>`."""
        return f"<box><size>{' '.join(number(v) for v in self.size)}</size></box>"


@dataclass(frozen=True, kw_only=True)
class Cylinder(Shape):
    """A cylinder along its own z axis (m)."""

    radius: float
    length: float

    def sdf(self) -> str:
        """Content of the SDF element `<geometry>`."""
        return f"<cylinder><radius>{number(self.radius)}</radius><length>{number(self.length)}</length></cylinder>"


@dataclass(frozen=True, kw_only=True)
class Sphere(Shape):
    """A sphere (m)."""

    radius: float

    def sdf(self) -> str:
        """Content of the SDF element `<geometry>`."""
        return f"<sphere><radius>{number(self.radius)}</radius></sphere>"


@dataclass(frozen=True)
class MassProperties:
    """Mass (kg), centre of mass (m) and (3, 3) inertia about it (kg m^2) in the model's frame."""

    mass_kg: float
    com: FloatArray
    inertia: FloatArray


def solid_mass(mesh: Mesh, density_kg_m3: float) -> MassProperties:
    """Mass properties of a closed mesh of uniform density. Raises ValueError when it encloses no volume."""
    a, b, c = _corners(mesh)
    volume = np.einsum("ij,ij->i", a, np.cross(b, c)) / 6
    return _gathered(a, b, c, volume * density_kg_m3, apex=True)


def shell_mass(mesh: Mesh, density_kg_m2: float) -> MassProperties:
    """Mass properties of a thin skin along all surfaces. Raises ValueError when the mesh has none."""
    a, b, c = _corners(mesh)
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2
    return _gathered(a, b, c, area * density_kg_m2, apex=False)


def scale_mass(body: MassProperties, mass_kg: float) -> MassProperties:
    """Mass properties of the same form with another mass."""
    return MassProperties(mass_kg, body.com, body.inertia * (mass_kg / body.mass_kg))


def _corners(mesh: Mesh) -> tuple[FloatArray, FloatArray, FloatArray]:
    points = np.concatenate([p for _, p, _, _ in mesh.groups()])
    return points[0::3], points[1::3], points[2::3]


def _gathered(a: FloatArray, b: FloatArray, c: FloatArray, masses: FloatArray, *, apex: bool) -> MassProperties:
    """Sums triangles, or tetrahedra with their apex at the origin, of given masses (Blow and Binstock, 2004)."""
    total = float(masses.sum())
    if total <= 0:
        raise ValueError("the mesh has no mass: it is empty, open or inside out")
    corners = 4 if apex else 3
    sums = a + b + c
    com = (masses[:, None] * sums).sum(axis=0) / corners / total
    outer = sum(np.einsum("i,ij,ik->jk", masses, v, v) for v in (a, b, c, sums))
    moment = np.asarray(outer) / (corners * (corners + 1)) - total * np.outer(com, com)
    return MassProperties(total, com, np.trace(moment) * np.eye(3) - moment)


_SMALL_KG_M2 = 5e-6
"""Smaller moments of inertia are written with more places."""


@dataclass(frozen=True)
class Model:
    """One rigid body: its visual geometry (a mesh file beside the SDF), collision shapes, mass and friction.

    A model without mass properties must be welded to the world. `parts` are further meshes by name, with their poses.
    """

    name: str
    mesh: str
    collisions: Sequence[Geometry]
    mass: MassProperties | None = None
    friction: float = 0.8
    comment: str = field(default="")
    maker: str = "a builder script"
    parts: Sequence[Part] = ()


@dataclass(frozen=True)
class Part:
    """A further mesh of a model: its name, its file, and its pose (x, y, z, roll, pitch, yaw; m and rad)."""

    name: str
    mesh: str
    pose: tuple[float, float, float, float, float, float]


def model_sdf(model: Model) -> str:
    """Returns the SDF text of a model."""
    collisions = "".join(_collision(index, shape, model.friction) for index, shape in enumerate(model.collisions))
    parts = "".join(map(_visual, model.parts))
    return f"""<?xml version="1.0"?>
<!-- {model.comment or model.name}; made by {model.maker}, don't edit. -->
<sdf version="1.9" xmlns:drake="drake.mit.edu">
  <model name="{model.name}">
    <link name="{model.name}">
{_inertial(model.mass)}      <visual name="visual">
        <geometry><mesh><uri>{model.mesh}</uri></mesh></geometry>
      </visual>
{parts}{collisions}    </link>
  </model>
</sdf>
"""


def _inertial(mass: MassProperties | None) -> str:
    if mass is None:
        return ""
    com = " ".join(number(v) for v in mass.com)
    names = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
    values = mass.inertia[[0, 0, 0, 1, 1, 2], [0, 1, 2, 1, 2, 2]]
    places = 9 if min(mass.inertia.diagonal()) >= _SMALL_KG_M2 else 14
    moments = "".join(f"<{name}>{value:z.{places}f}</{name}>" for name, value in zip(names, values, strict=True))
    return f"""      <inertial>
        <pose>{com} 0 0 0</pose>
        <mass>{number(mass.mass_kg)}</mass>
        <inertia>{moments}</inertia>
      </inertial>
"""


def _visual(part: Part) -> str:
    return f"""      <visual name="{part.name}">
        <pose>{" ".join(number(value) for value in part.pose)}</pose>
        <geometry><mesh><uri>{part.mesh}</uri></mesh></geometry>
      </visual>
"""


def _collision(index: int, shape: Geometry, friction: float) -> str:
    return f"""      <collision name="{type(shape).__name__.lower()}_{index}">
        <pose>{shape.pose_text()}</pose>
        <geometry>{shape.sdf()}</geometry>
        <drake:proximity_properties>
          <drake:mu_dynamic>{number(friction)}</drake:mu_dynamic>
          <drake:mu_static>{number(friction)}</drake:mu_static>
        </drake:proximity_properties>
      </collision>
"""
