"""A standing person of about 1.75 m. The origin lies on the floor between the feet; the person faces x.

The arms are meshes of their own, each along -z from its joint, which `plant.models.person_arms` can lift.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from pydrake.math import RollPitchYaw, RotationMatrix

from errand_make.mesh import Material, Mesh
from errand_make.shapes import Box, Cylinder, Model, Part, Shape
from errand_train.models.appearance import Appearance
from errand_train.models.pictures import cloth, to_picture
from skills.robot import FloatArray

MATERIALS = {
    "skin": Material((0.80, 0.62, 0.50)),
    "hair": Material((0.24, 0.17, 0.12)),
    "eye": Material((0.97, 0.97, 0.96)),
    "pupil": Material((0.16, 0.13, 0.11)),
    "mouth": Material((0.66, 0.42, 0.37)),
    "shoe": Material((0.24, 0.22, 0.21)),
    "sole": Material((0.86, 0.85, 0.82)),
    "belt": Material((0.20, 0.16, 0.13)),
    "sweater": Material((0.58, 0.48, 0.60), "knit.png"),
    "trousers": Material((0.30, 0.32, 0.37), "knit.png"),
}
SHOULDER, ELBOW, HAND = (0.0, 0.205, 1.40), (-0.0164, 0.2573, 1.1213), (0.062, 0.25, 0.805)
"""Joints of the left arm as it hangs, and the middle of its hand."""
UPPER_M, LOWER_M, HAND_M = 0.284, 0.326, 0.068
"""Lengths from the shoulder to the elbow, and from there to the middle of the hand; the last is beyond the wrist."""


def person() -> Model:
    """Collision shapes of the person: upright boxes and cylinders only."""
    legs: list[Shape] = [Cylinder(radius=0.085, length=0.84, p=(0, y, 0.42)) for y in (-0.10, 0.10)]
    feet: list[Shape] = [Box(size=(0.27, 0.10, 0.08), p=(0.05, y, 0.04)) for y in (-0.10, 0.10)]
    arms: list[Shape] = [Cylinder(radius=0.055, length=0.68, p=(0, y, 1.07)) for y in (-0.245, 0.245)]
    torso = Box(size=(0.22, 0.38, 0.60), p=(0, 0, 1.14))
    head = Cylinder(radius=0.10, length=0.31, p=(0.01, 0, 1.595))
    shapes = [*legs, *feet, torso, *arms, head]
    return Model("person", "person.obj", shapes, comment="a standing person, welded", parts=_arm_parts())


def _arm_parts() -> list[Part]:
    """The arms as they hang."""
    parts = list[Part]()
    for name, side in (("left", 1.0), ("right", -1.0)):
        shoulder, elbow, hand = ((x, side * y, z) for x, y, z in (SHOULDER, ELBOW, HAND))
        parts.append(Part(f"{name}_upper_arm", "upper_arm.obj", (*shoulder, *_rpy_rad(elbow, shoulder))))
        parts.append(Part(f"{name}_lower_arm", "lower_arm.obj", (*elbow, *_rpy_rad(hand, elbow))))
    return parts


def _rpy_rad(low: ArrayLike, high: ArrayLike) -> tuple[float, float, float]:
    """Roll, pitch and yaw of a limb whose z axis goes from its low to its high end."""
    roll, pitch, yaw = RollPitchYaw(RotationMatrix(_axes(low, high))).vector()
    return float(roll), float(pitch), float(yaw)


def person_appearance() -> Appearance:
    """Appearance: sweater, trousers, shoes, head with hair and face."""
    mesh = Mesh(MATERIALS)
    _torso(mesh)
    for side in (-1, 1):
        _leg(mesh, side)
    _head(mesh)
    knit = cloth(np.random.default_rng(21), (96, 96), (0.97, 0.97, 0.97), 0.04)
    return Appearance(
        mesh, {"knit.png": to_picture(knit)}, {"upper_arm.obj": _upper_arm(), "lower_arm.obj": _lower_arm()}
    )


def _torso(mesh: Mesh) -> None:
    profile = [(0.165, 0.90), (0.170, 0.98), (0.160, 1.10), (0.175, 1.28), (0.190, 1.38), (0.165, 1.45), (0.06, 1.49)]
    _oval(mesh, "sweater", profile, (0.62, 1.0))
    _oval(mesh, "belt", [(0.167, 0.875), (0.168, 0.905)], (0.62, 1.0))
    _oval(mesh, "trousers", [(0.10, 0.76), (0.165, 0.82), (0.167, 0.875)], (0.62, 1.0))
    _oval(mesh, "skin", [(0.055, 1.44), (0.050, 1.54)], (1.0, 1.0))


def _leg(mesh: Mesh, side: int) -> None:
    y = 0.095 * side
    _limb(mesh, "trousers", (0, y, 0.07), (0.0, 0.085 * side, 0.84), (0.062, 0.070, 0.092))
    _ellipsoid(mesh, "shoe", (0.055, y, 0.055), (0.135, 0.050, 0.045))
    mesh.add_box("sole", (-0.075, y - 0.046, 0.0), (0.175, y + 0.046, 0.025))


def _upper_arm() -> Mesh:
    mesh = Mesh(MATERIALS)
    _ellipsoid(mesh, "sweater", (0, 0, 0), (0.064, 0.056, 0.062))
    _limb(mesh, "sweater", (0, 0, -UPPER_M), (0, 0, 0), (0.048, 0.052, 0.056))
    return mesh


def _lower_arm() -> Mesh:
    """The lower arm with the hand."""
    mesh = Mesh(MATERIALS)
    wrist_m = LOWER_M - HAND_M
    _ellipsoid(mesh, "sweater", (0, 0, 0), (0.048, 0.048, 0.048))
    _limb(mesh, "sweater", (0, 0, -wrist_m), (0, 0, 0), (0.036, 0.042, 0.047))
    _ellipsoid(mesh, "skin", (0, 0, -LOWER_M), (0.038, 0.024, 0.075))
    return mesh


def _head(mesh: Mesh) -> None:
    _ellipsoid(mesh, "skin", (0.015, 0, 1.625), (0.095, 0.078, 0.120))
    _ellipsoid(mesh, "hair", (-0.016, 0, 1.668), (0.102, 0.087, 0.095))
    _ellipsoid(mesh, "skin", (0.112, 0, 1.610), (0.018, 0.013, 0.022))
    mesh.add_box("mouth", (0.085, -0.022, 1.560), (0.101, 0.022, 1.568))
    for side in (-1, 1):
        _ellipsoid(mesh, "eye", (0.096, 0.032 * side, 1.640), (0.010, 0.014, 0.009))
        _ellipsoid(mesh, "pupil", (0.104, 0.032 * side, 1.640), (0.004, 0.006, 0.006))
        mesh.add_box("hair", (0.092, 0.032 * side - 0.016, 1.658), (0.104, 0.032 * side + 0.016, 1.664))
        _ellipsoid(mesh, "skin", (0.005, 0.080 * side, 1.615), (0.020, 0.010, 0.030))


def _oval(mesh: Mesh, material: str, profile: list[tuple[float, float]], scale: tuple[float, float]) -> None:
    """A lathe that is scaled along x and y."""
    part = Mesh(mesh.materials)
    part.add_lathe(material, profile, sides=28)
    mesh.add_mesh(part, np.diag([scale[0], scale[1], 1.0]))


def _limb(mesh: Mesh, material: str, low: ArrayLike, high: ArrayLike, radii: tuple[float, float, float]) -> None:
    """A tapered limb between two points; radii at its low end, middle and high end."""
    length = float(np.linalg.norm(np.subtract(high, low)))
    part = Mesh(mesh.materials)
    part.add_lathe(material, [(0, 0), (radii[0], 0), (radii[1], length / 2), (radii[2], length)], sides=18)
    mesh.add_mesh(part, _axes(low, high), low)


def _axes(low: ArrayLike, high: ArrayLike) -> FloatArray:
    """Rotation (3, 3) of a limb: z from its low to its high end, y to the left."""
    z = np.subtract(high, low) / np.linalg.norm(np.subtract(high, low))
    x = np.cross([0.0, 1.0, 0.0], z) / np.linalg.norm(np.cross([0.0, 1.0, 0.0], z))
    return np.column_stack([x, np.cross(z, x), z])


def _ellipsoid(mesh: Mesh, material: str, centre: ArrayLike, radii: tuple[float, float, float]) -> None:
    part = Mesh(mesh.materials)
    angle = np.linspace(-np.pi / 2, np.pi / 2, 13)
    profile = [(max(float(np.cos(a)), 0.0), float(np.sin(a))) for a in angle]
    part.add_lathe(material, profile, sides=20)
    mesh.add_mesh(part, np.diag(radii), centre)
