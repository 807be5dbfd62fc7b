"""The tray on which a person receives an object. Its origin is the middle of the plate's upper side.

The plate is level, its handle is along -x. Its mass is that of the tray with the arms that hold it. Its collision
shape is deeper than the visible plate: an object that falls a centimetre in one step of the plant would pass through
a thin one. Upright in a person's torso the tray is invisible.
"""

from __future__ import annotations

from errand_make.mesh import Material, Mesh
from errand_make.shapes import Box, Model, Shape
from errand_train.models.appearance import Appearance
from errand_train.models.mass import join_masses, shape_mass

SIZE_M, PLATE_M, DEEP_M = (0.36, 0.31), 0.008, 0.04
RIM_M, RIM_HEIGHT_M = 0.006, 0.010
HANDLE_M = (0.30, 0.035, 0.018)
TRAY_KG = 15.0
MATERIALS = {"tray": Material((0.42, 0.29, 0.19)), "lining": Material((0.72, 0.66, 0.55))}


def tray() -> Model:
    """Collision shapes of the tray: plate and rim; the handle is only seen."""
    plate = Box(size=(*SIZE_M, DEEP_M), p=(0, 0, -DEEP_M / 2))
    shapes: list[Shape] = [plate, *_rim()]
    return Model("tray", "tray.obj", shapes, join_masses([shape_mass(plate, TRAY_KG)]), comment="a person's tray")


def tray_appearance() -> Appearance:
    """Appearance: a wooden tray with a light lining and a handle."""
    mesh = Mesh(MATERIALS)
    x, y = SIZE_M[0] / 2, SIZE_M[1] / 2
    mesh.add_box("tray", (-x, -y, -PLATE_M), (x, y, -0.001))
    mesh.add_box("lining", (RIM_M - x, RIM_M - y, -0.001), (x - RIM_M, y - RIM_M, 0.0))
    for rim in _rim():
        low = tuple(c - s / 2 for c, s in zip(rim.p, rim.size, strict=True))
        high = tuple(c + s / 2 for c, s in zip(rim.p, rim.size, strict=True))
        mesh.add_box("tray", low, high)
    length, width, thick = HANDLE_M
    mesh.add_box("tray", (-x - length, -width / 2, -PLATE_M - thick), (-x + 0.05, width / 2, -PLATE_M))
    return Appearance(mesh, {})


def _rim() -> list[Box]:
    """Four low walls about the plate."""
    x, y, z = SIZE_M[0] / 2 - RIM_M / 2, SIZE_M[1] / 2 - RIM_M / 2, RIM_HEIGHT_M / 2
    across = [Box(size=(RIM_M, SIZE_M[1], RIM_HEIGHT_M), p=(side * x, 0, z)) for side in (-1, 1)]
    along = [Box(size=(SIZE_M[0], RIM_M, RIM_HEIGHT_M), p=(0, side * y, z)) for side in (-1, 1)]
    return [*across, *along]
