"""The loose objects: a can, a bottle, a hammer and a cube. The origin of each is the centre of its bounding box.

A primitive on a box has a single contact point in point contact and would wobble. So each object rests on small
spheres at its rim or corners, which protrude by `PROUD_M`.
"""

from __future__ import annotations

import numpy as np

from errand_make.shapes import Box, Cylinder, Model, Shape, Sphere
from errand_train.models.mass import join_masses, shape_mass

PROUD_M = 0.0003
RIM_POINTS = 8

CAN_RADIUS_M, CAN_HEIGHT_M = 0.033, 0.115
BOTTLE_RADIUS_M, BOTTLE_HEIGHT_M = 0.0305, 0.23
BOTTLE_BODY_M, BOTTLE_NECK_RADIUS_M = 0.135, 0.0135
CUBE_M = 0.05
HAMMER_LENGTH_M, HAMMER_THICKNESS_M, HANDLE_WIDTH_M = 0.33, 0.03, 0.03
HEAD_WIDTH_M, HEAD_LENGTH_M = 0.032, 0.12


def coke() -> Model:
    """Makes a 0.33 l can."""
    bodies = [Cylinder(radius=CAN_RADIUS_M, length=CAN_HEIGHT_M - 2 * PROUD_M)]
    rims = [*_rim(0.029, -CAN_HEIGHT_M / 2), *_rim(0.028, CAN_HEIGHT_M / 2)]
    return Model("coke", "coke.obj", [*bodies, *rims], join_masses([shape_mass(bodies[0], 0.35)]), comment="a red can")


def beer() -> Model:
    """Makes a glass bottle of beer: body, sloping shoulder and neck."""
    bottom, top = -BOTTLE_HEIGHT_M / 2, BOTTLE_HEIGHT_M / 2
    neck_from = bottom + BOTTLE_BODY_M
    body = Cylinder(radius=BOTTLE_RADIUS_M, length=BOTTLE_BODY_M - PROUD_M, p=(0, 0, bottom + BOTTLE_BODY_M / 2))
    neck = Cylinder(radius=BOTTLE_NECK_RADIUS_M, length=top - neck_from, p=(0, 0, (top + neck_from) / 2))
    shoulder = Cylinder(radius=0.023, length=0.02, p=(0, 0, neck_from + 0.01))
    mass = join_masses([shape_mass(body, 0.48), shape_mass(neck, 0.05), shape_mass(shoulder, 0.02)])
    return Model("beer", "beer.obj", [body, shoulder, neck, *_rim(0.026, bottom)], mass, comment="a bottle")


def cube() -> Model:
    """Makes a wooden cube, painted blue."""
    box = Box(size=(CUBE_M - 2 * PROUD_M,) * 3)
    corners = _corners((0, 0, 0), (CUBE_M, CUBE_M, CUBE_M))
    return Model("cube", "cube.obj", [box, *corners], join_masses([shape_mass(box, 0.12)]), comment="a blue cube")


def hammer() -> Model:
    """Makes a claw hammer that lies flat: handle along x, head at its +x end, face towards +y, claw towards -y."""
    half, thick = HAMMER_LENGTH_M / 2, HAMMER_THICKNESS_M - 2 * PROUD_M
    head_x = half - HEAD_WIDTH_M / 2
    handle_length = HAMMER_LENGTH_M - HEAD_WIDTH_M
    handle = Box(size=(handle_length, HANDLE_WIDTH_M, thick), p=(-HEAD_WIDTH_M / 2, 0, 0))
    head = Box(size=(HEAD_WIDTH_M, HEAD_LENGTH_M, thick), p=(head_x, 0, 0))
    feet = [
        *_corners(head.p, (HEAD_WIDTH_M, HEAD_LENGTH_M, HAMMER_THICKNESS_M)),
        *_corners((-half + 0.01, 0, 0), (0.02, HANDLE_WIDTH_M, HAMMER_THICKNESS_M)),
    ]
    mass = join_masses([shape_mass(handle, 0.13), shape_mass(head, 0.42)])
    return Model("hammer", "hammer.obj", [handle, head, *feet], mass, comment="a claw hammer")


def _rim(radius_m: float, z_m: float) -> list[Shape]:
    """Small spheres on a circle, which touch the plane at z_m from inside."""
    small = 0.003
    angles = np.arange(RIM_POINTS) * 2 * np.pi / RIM_POINTS
    z = z_m - np.sign(z_m) * small
    return [Sphere(radius=small, p=(radius_m * np.cos(a), radius_m * np.sin(a), z)) for a in angles]


def _corners(centre: tuple[float, float, float], size: tuple[float, float, float]) -> list[Shape]:
    """Small spheres in the eight corners of a box, touching its sides from inside."""
    small = 0.004
    offsets = [np.array([sx, sy, sz]) for sx in (-1, 1) for sy in (-1, 1) for sz in (-1, 1)]
    places = [np.array(centre) + o * (np.array(size) / 2 - small) for o in offsets]
    return [Sphere(radius=small, p=(float(p[0]), float(p[1]), float(p[2]))) for p in places]
