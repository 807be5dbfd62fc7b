"""Writes SDF model files."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from plant.models.builder.shapes import Geometry, MassProperties, number

_SMALL_KG_M2 = 5e-6
"""Smaller moments of inertia are written with more places."""


@dataclass(frozen=True)
class Model:
    """One rigid body: its visual geometry (a mesh file beside the SDF), collision shapes, mass and friction.

    A model without mass properties is meant to be welded to the world; it gets a token mass.
    """

    name: str
    mesh: str
    collisions: Sequence[Geometry]
    mass: MassProperties | None = None
    friction: float = 0.8
    comment: str = field(default="")
    maker: str = "a builder script"


def model_sdf(model: Model) -> str:
    """The SDF text of a model."""
    collisions = "".join(_collision(index, shape, model.friction) for index, shape in enumerate(model.collisions))
    return f"""<?xml version="1.0"?>
<!-- {model.comment or model.name}; made by {model.maker}, don't edit. -->
<sdf version="1.9" xmlns:drake="drake.mit.edu">
  <model name="{model.name}">
    <link name="{model.name}">
{_inertial(model.mass)}      <visual name="looks">
        <geometry><mesh><uri>{model.mesh}</uri></mesh></geometry>
      </visual>
{collisions}    </link>
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
