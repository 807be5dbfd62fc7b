"""A piece of furniture: visual geometry and the primitive shapes that are solid about it.

Its frame: the origin lies on the floor in the middle of its back; x to the right for one who stands before it and
looks at it, y into the wall, z up. So its front is at negative y.
"""

from __future__ import annotations

from collections.abc import Mapping

from plant.models.builder.mesh import Material, Mesh
from plant.models.builder.shapes import Box, Cylinder, Shape

Point = tuple[float, float, float]
Faces = Mapping[str, str | None]


class Piece:
    """Grows by `add_` methods; `solid_` ones also add the collision shape."""

    def __init__(self, materials: Mapping[str, Material]) -> None:
        self.mesh = Mesh(materials)
        self.collisions: list[Shape] = []

    def solid_box(self, material: str, low: Point, high: Point, faces: Faces | None = None) -> None:
        """A box to see and to bump into."""
        self.mesh.add_box(material, low, high, faces=faces)
        self.block(low, high)

    def look_box(self, material: str, low: Point, high: Point, faces: Faces | None = None) -> None:
        """A box to see only."""
        self.mesh.add_box(material, low, high, faces=faces)

    def block(self, low: Point, high: Point) -> None:
        """A box to bump into only."""
        size = (high[0] - low[0], high[1] - low[1], high[2] - low[2])
        self.collisions.append(
            Box(size=size, p=((low[0] + high[0]) / 2, (low[1] + high[1]) / 2, (low[2] + high[2]) / 2))
        )

    def solid_cylinder(self, material: str, radius: float, low: Point, height: float, cap: str | None = None) -> None:
        """An upright cylinder to see and to bump into."""
        self.mesh.add_cylinder(material, radius, low, height, cap=cap)
        self.block_cylinder(radius, low, height)

    def block_cylinder(self, radius: float, low: Point, height: float) -> None:
        """An upright cylinder to bump into only."""
        centre = (low[0], low[1], low[2] + height / 2)
        self.collisions.append(Cylinder(radius=radius, length=height, p=centre))

    def legs(self, material: str, half_x: float, y: tuple[float, float], thick: float, height: float) -> None:
        """Four square legs whose outer faces stand at +-half_x and at the two ys."""
        for x0 in (-half_x, half_x - thick):
            for y0 in (y[0], y[1] - thick):
                self.solid_box(material, (x0, y0, 0), (x0 + thick, y0 + thick, height))

    def fronts(
        self, material: str, low: tuple[float, float], high: tuple[float, float], y: float, grid: tuple[int, int]
    ) -> None:
        """Cupboard doors or drawers on the plane y: a grid of (columns, rows) panels with gaps and handles."""
        columns, rows = grid
        wide, tall, gap = (high[0] - low[0]) / columns, (high[1] - low[1]) / rows, 0.006
        for i in range(columns):
            for j in range(rows):
                x, z = low[0] + i * wide, low[1] + j * tall
                self.look_box(
                    material,
                    (x + gap / 2, y - 0.012, z + gap / 2),
                    (x + wide - gap / 2, y, z + tall - gap / 2),
                    {"+y": None},
                )
                middle, top = x + wide / 2, z + tall - min(0.05, tall / 3)
                grip = min(0.08, wide / 4)
                self.look_box("dark_steel", (middle - grip, y - 0.03, top - 0.012), (middle + grip, y - 0.012, top))
