"""Furniture by parameters. Every function gives a new `Piece`; lengths in metres."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from plant.models.builder.mesh import Material
from plant.worlds.builder.piece import Piece

Materials = Mapping[str, Material]


def cabinet(m: Materials, *, size: tuple[float, float, float], body: str, top: str, grid: tuple[int, int]) -> Piece:
    """A closed cabinet on a dark plinth, with a grid of doors or drawers."""
    (width, depth, height), piece = size, Piece(m)
    half, slab = width / 2, 0.03
    piece.block((-half, -depth, 0), (half, 0, height))
    piece.look_box("charcoal", (-half + 0.02, -depth + 0.05, 0), (half - 0.02, 0, 0.08), {"-z": None})
    piece.look_box(body, (-half, -depth + 0.014, 0.08), (half, 0, height - slab), {"-y": "gap"})
    piece.look_box(top, (-half, -depth, height - slab), (half, 0, height))
    piece.fronts(body, (-half, 0.08), (half, height - slab), -depth + 0.014, grid)
    return piece


def table(
    m: Materials, *, size: tuple[float, float, float], top: str, leg: str, thick: float = 0.05, slab: float = 0.03
) -> Piece:
    """A table with four legs."""
    (width, depth, height), piece = size, Piece(m)
    half = width / 2
    piece.solid_box(top, (-half, -depth, height - slab), (half, 0, height))
    piece.legs(leg, half - 0.02, (-depth + 0.02, -0.02), thick, height - slab)
    piece.look_box(leg, (-half + 0.07, -depth + 0.06, height - 0.09), (half - 0.07, -0.06, height - slab))
    return piece


def chair(m: Materials, *, wood: str = "wood_dark", seat: str = "cloth_sand") -> Piece:
    """A kitchen chair."""
    piece = Piece(m)
    piece.solid_box(wood, (-0.21, -0.44, 0.40), (0.21, 0, 0.45), {"+z": seat})
    piece.legs(wood, 0.21, (-0.44, 0), 0.04, 0.40)
    piece.solid_box(wood, (-0.21, -0.035, 0.62), (0.21, 0, 0.86))
    for x in (-0.21, 0.17):
        piece.solid_box(wood, (x, -0.035, 0.45), (x + 0.04, 0, 0.62))
    return piece


def counter(m: Materials, *, width: float, sink_x: float, hob_x: float) -> Piece:
    """A kitchen run: cupboards under a worktop at 0.90 with a sink, a tap and a hob."""
    piece = cabinet(m, size=(width, 0.60, 0.90), body="white", top="worktop", grid=(round(width / 0.6), 1))
    top = 0.902
    piece.look_box("steel", (sink_x - 0.30, -0.50, 0.90), (sink_x + 0.30, -0.10, top))
    piece.look_box("dark_steel", (sink_x - 0.26, -0.47, top), (sink_x + 0.12, -0.13, top + 0.001))
    piece.solid_cylinder("steel", 0.02, (sink_x, -0.07, 0.90), 0.28)
    piece.look_box("steel", (sink_x - 0.012, -0.24, 1.155), (sink_x + 0.012, -0.06, 1.18))
    piece.look_box("black", (hob_x - 0.29, -0.55, 0.90), (hob_x + 0.29, -0.05, top))
    for x in (-0.15, 0.15):
        for y, radius in ((-0.42, 0.085), (-0.18, 0.10)):
            piece.mesh.add_cylinder("ring", radius, (hob_x + x, y, top), 0.001)
    piece.look_box("black", (hob_x - 0.28, -0.604, 0.20), (hob_x + 0.28, -0.60, 0.72))
    piece.look_box("steel", (hob_x - 0.25, -0.63, 0.74), (hob_x + 0.25, -0.604, 0.76))
    return piece


def wall_cupboards(m: Materials, *, width: float, low: float, high: float, depth: float) -> Piece:
    """Cupboards on the wall, over a counter, with a tiled back below them."""
    piece, half = Piece(m), width / 2
    piece.block((-half, -depth, low), (half, 0, high))
    piece.look_box("white", (-half, -depth + 0.014, low), (half, 0, high), {"-y": "gap"})
    piece.fronts("white", (-half, low), (half, high), -depth + 0.014, (round(width / 0.6), 1))
    piece.mesh.add_rectangle("wall_tiles", (-half, -0.014, 0.90), (width, 0, 0), (0, 0, low - 0.90))
    return piece


def tall_unit(m: Materials, *, size: tuple[float, float, float], body: str, grid: tuple[int, int]) -> Piece:
    """A fridge, wardrobe or pantry."""
    return cabinet(m, size=size, body=body, top=body, grid=grid)


def microwave(m: Materials) -> Piece:
    """A microwave oven that stands at 0.90."""
    piece = Piece(m)
    piece.solid_box("charcoal", (-0.24, -0.40, 0.90), (0.24, -0.05, 1.18))
    piece.look_box("screen", (-0.22, -0.405, 0.93), (0.10, -0.40, 1.15))
    piece.look_box("steel", (0.12, -0.405, 0.93), (0.22, -0.40, 1.15))
    return piece


def sofa(m: Materials, *, width: float, cloth: str, depth: float = 0.90) -> Piece:
    """A sofa, or an armchair when narrow."""
    piece, half, arm = Piece(m), width / 2, 0.16
    piece.solid_box(cloth, (-half, -depth, 0.06), (half, 0, 0.30))
    piece.solid_box(cloth, (-half, -0.22, 0.30), (half, 0, 0.82))
    for low in (-half, half - arm):
        piece.solid_box(cloth, (low, -depth, 0.30), (low + arm, -0.22, 0.60))
    seats = max(1, round((width - 2 * arm) / 0.8))
    wide = (width - 2 * arm) / seats
    for i in range(seats):
        x = -half + arm + i * wide
        piece.look_box(cloth, (x + 0.008, -depth - 0.01, 0.30), (x + wide - 0.008, -0.22, 0.46))
        piece.look_box(cloth, (x + 0.02, -0.36, 0.46), (x + wide - 0.02, -0.22, 0.78))
    piece.block((-half + arm, -depth, 0.30), (half - arm, -0.22, 0.46))
    if seats > 1:
        piece.look_box("teal", (-half + arm + 0.05, -0.50, 0.47), (-half + arm + 0.45, -0.37, 0.85))
    for x in (-half + 0.05, half - 0.11):
        for y in (-depth + 0.05, -0.11):
            piece.look_box("charcoal", (x, y, 0), (x + 0.06, y + 0.06, 0.06))
    return piece


def television(m: Materials) -> Piece:
    """A low board with a television on it."""
    piece = cabinet(m, size=(1.6, 0.40, 0.45), body="white", top="wood_dark", grid=(3, 1))
    piece.solid_box("black", (-0.60, -0.20, 0.52), (0.60, -0.15, 1.22), {"-y": "screen"})
    piece.solid_box("black", (-0.20, -0.28, 0.45), (0.20, -0.10, 0.52))
    return piece


def bookshelf(m: Materials, *, width: float, height: float, boards: int) -> Piece:
    """Open shelves full of books."""
    piece, half, depth, side = Piece(m), width / 2, 0.30, 0.025
    piece.block((-half, -depth, 0), (half, 0, height))
    for low in (-half, half - side):
        piece.look_box("wood_light", (low, -depth, 0), (low + side, 0, height))
    pitch = (height - side) / boards
    for i in range(boards + 1):
        piece.look_box("wood_light", (-half + side, -depth, i * pitch), (half - side, 0, i * pitch + side))
    for i in range(boards):
        corner, span = (-half + side, -depth + 0.05, i * pitch + side), width - 2 * side
        piece.mesh.add_rectangle("books", corner, (span, 0, 0), (0, 0, pitch - side))
    return piece


def bed(m: Materials, *, width: float = 1.6, length: float = 2.05) -> Piece:
    """A double bed whose head is the back."""
    piece, half = Piece(m), width / 2
    piece.solid_box("wood_dark", (-half, -length, 0.0), (half, 0, 0.30))
    piece.solid_box("wood_dark", (-half, -0.06, 0.30), (half, 0, 0.95))
    piece.solid_box("cloth_white", (-half + 0.03, -length + 0.03, 0.30), (half - 0.03, -0.06, 0.50))
    piece.look_box("cloth_slate", (-half + 0.01, -length + 0.01, 0.34), (half - 0.01, -0.75, 0.52))
    for x in (-half + 0.12, 0.08):
        piece.look_box("pillow", (x, -0.50, 0.50), (x + half - 0.20, -0.10, 0.60))
    return piece


def bathtub(m: Materials, *, width: float) -> Piece:
    """A tub in a tiled surround."""
    piece, half = Piece(m), width / 2
    piece.block((-half, -0.72, 0), (half, 0, 0.58))
    piece.look_box("wall_tiles", (-half, -0.72, 0), (half, 0, 0.56), {"+z": "porcelain"})
    piece.look_box("porcelain", (-half, -0.72, 0.56), (half, 0, 0.58))
    piece.look_box("water", (-half + 0.10, -0.62, 0.58), (half - 0.10, -0.10, 0.582))
    piece.look_box("steel", (half - 0.20, -0.40, 0.58), (half - 0.14, -0.34, 0.70))
    return piece


def toilet(m: Materials) -> Piece:
    """A toilet with its cistern."""
    piece = Piece(m)
    piece.solid_box("porcelain", (-0.19, -0.18, 0.38), (0.19, 0, 0.80))
    piece.solid_cylinder("porcelain", 0.19, (0, -0.40, 0.0), 0.42, cap="light_grey")
    piece.solid_box("porcelain", (-0.13, -0.40, 0.0), (0.13, 0, 0.38))
    return piece


def washbasin(m: Materials) -> Piece:
    """A washbasin on a small cabinet, with a mirror above."""
    piece = cabinet(m, size=(0.70, 0.45, 0.85), body="wood_grey", top="porcelain", grid=(2, 1))
    piece.look_box("water", (-0.25, -0.38, 0.85), (0.25, -0.12, 0.853))
    piece.solid_cylinder("steel", 0.018, (0, -0.06, 0.85), 0.14)
    piece.look_box("steel", (-0.01, -0.17, 0.97), (0.01, -0.06, 0.99))
    piece.look_box("charcoal", (-0.31, -0.015, 1.14), (0.31, -0.002, 1.86), {"-y": "mirror"})
    return piece


def workbench(m: Materials, *, width: float) -> Piece:
    """A low workbench (an assembly bench) with a lower board, boxes on it and a vice at the right end."""
    piece, half = Piece(m), width / 2
    piece.solid_box("bench_top", (-half, -0.65, 0.77), (half, 0, 0.82))
    piece.legs("dark_steel", half - 0.03, (-0.62, -0.03), 0.07, 0.77)
    piece.solid_box("wood_grey", (-half + 0.05, -0.60, 0.20), (half - 0.05, -0.05, 0.23))
    for x, wide, tall, colour in ((-0.9, 0.5, 0.3, "carton"), (-0.2, 0.4, 0.26, "grey"), (0.4, 0.45, 0.36, "teal")):
        piece.solid_box(colour, (x, -0.5, 0.23), (x + wide, -0.12, 0.23 + tall))
    piece.solid_box("dark_steel", (half - 0.22, -0.62, 0.82), (half - 0.06, -0.40, 0.98))
    piece.look_box("steel", (half - 0.24, -0.66, 0.92), (half - 0.04, -0.62, 0.98))
    return piece


def trolley(m: Materials) -> Piece:
    """A tool trolley: three flat trays on four posts."""
    piece, half, depth = Piece(m), 0.35, 0.45
    for z, thick, colour in ((0.14, 0.03, "trolley"), (0.46, 0.03, "trolley"), (0.765, 0.035, "tray")):
        piece.solid_box(colour, (-half, -depth, z), (half, 0, z + thick))
    piece.legs("charcoal", half - 0.005, (-depth + 0.005, -0.005), 0.035, 0.765)
    piece.solid_box("grey", (-0.25, -0.35, 0.49), (0.05, -0.10, 0.60))
    piece.solid_box("teal", (0.08, -0.33, 0.17), (0.28, -0.12, 0.33))
    return piece


def rack(m: Materials, *, width: float) -> Piece:
    """A storage rack with boxes."""
    piece, half, depth = Piece(m), width / 2, 0.42
    piece.block((-half, -depth, 0), (half, 0, 1.85))
    for x in (-half, half - 0.04):
        for y in (-depth, -0.04):
            piece.look_box("dark_steel", (x, y, 0), (x + 0.04, y + 0.04, 1.85))
    rng = np.random.default_rng(3)
    for z in (0.08, 0.62, 1.16, 1.80):
        piece.look_box("grey", (-half, -depth, z), (half, 0, z + 0.03))
    for z in (0.11, 0.65, 1.19):
        x = -half + 0.06
        while x < half - 0.35:
            wide, tall = rng.uniform(0.22, 0.34), rng.uniform(0.2, 0.42)
            colour = str(rng.choice(["carton", "grey", "teal", "charcoal"]))
            piece.look_box(colour, (x, -depth + 0.03, z), (x + wide, -0.05, z + tall))
            x += wide + 0.03
    return piece


def desk(m: Materials) -> Piece:
    """A desk with a monitor and keyboard at its left half."""
    piece = table(m, size=(1.6, 0.70, 0.74), top="white", leg="dark_steel")
    piece.solid_box("black", (-0.62, -0.20, 0.84), (-0.08, -0.16, 1.18), {"-y": "screen"})
    piece.solid_box("charcoal", (-0.45, -0.28, 0.74), (-0.25, -0.10, 0.84))
    piece.look_box("charcoal", (-0.56, -0.52, 0.74), (-0.14, -0.38, 0.755))
    return piece


def office_chair(m: Materials) -> Piece:
    """A swivel chair."""
    piece = Piece(m)
    piece.solid_cylinder("charcoal", 0.26, (0, -0.28, 0.03), 0.05)
    piece.solid_cylinder("steel", 0.03, (0, -0.28, 0.08), 0.36)
    piece.solid_box("cloth_slate", (-0.23, -0.50, 0.44), (0.23, -0.04, 0.51))
    piece.solid_box("cloth_slate", (-0.21, -0.06, 0.55), (0.21, 0, 1.00))
    piece.solid_box("charcoal", (-0.03, -0.05, 0.44), (0.03, -0.01, 0.60))
    return piece


def plant(m: Materials, *, height: float, seed: int) -> Piece:
    """A plant in a pot: leaves about a stem."""
    piece, rng = Piece(m), np.random.default_rng(seed)
    piece.solid_cylinder("pot", 0.17, (0, -0.2, 0), 0.34, cap="soil")
    piece.mesh.add_cylinder("soil", 0.015, (0, -0.2, 0.34), (height - 0.34) * 0.7, sides=8)
    piece.block_cylinder(0.20, (0, -0.2, 0.34), height - 0.34)
    for k in range(46):
        angle, z = rng.uniform(0, 2 * np.pi), 0.42 + (height - 0.50) * rng.uniform(0, 1)
        reach = 0.06 + 0.15 * rng.uniform(0.4, 1)
        out = np.array([np.cos(angle), np.sin(angle), 0.0])
        across, base = np.array([-out[1], out[0], 0.0]) * 0.05, np.array([0, -0.2, z]) + out * (reach - 0.15)
        tip = out * 0.14 + np.array([0, 0, rng.uniform(0.01, 0.09)])
        colour = "leaf" if k % 3 else "leaf_dark"
        piece.mesh.add_rectangle(colour, base - across, 2 * across, tip)
        piece.mesh.add_rectangle(colour, base + across, -2 * across, tip)
    return piece


def floor_lamp(m: Materials) -> Piece:
    """A standing lamp."""
    piece = Piece(m)
    piece.solid_cylinder("charcoal", 0.14, (0, -0.18, 0), 0.06)
    piece.solid_cylinder("charcoal", 0.015, (0, -0.18, 0.06), 1.32)
    piece.block_cylinder(0.18, (0, -0.18, 1.35), 0.28)
    piece.mesh.add_lathe("lamp", [(0.18, 1.35), (0.12, 1.63)], centre=(0, -0.18, 0))
    piece.mesh.add_lathe("lamp", [(0.12, 1.63), (0.0, 1.63)], centre=(0, -0.18, 0))
    return piece


def rug(m: Materials, *, width: float, depth: float) -> Piece:
    """A rug, to see only."""
    piece = Piece(m)
    piece.mesh.add_rectangle("rug", (-width / 2, -depth, 0.003), (width, 0, 0), (0, depth, 0))
    return piece


def mat(m: Materials, *, width: float, depth: float) -> Piece:
    """The dark plate of the charging dock, to see only."""
    piece, half = Piece(m), width / 2
    piece.mesh.add_rectangle("dock", (-half, -depth, 0.003), (width, 0, 0), (0, depth, 0))
    for y in (-depth, -0.03):
        piece.mesh.add_rectangle("dock_line", (-half, y, 0.004), (width, 0, 0), (0, 0.03, 0))
    return piece


def basket(m: Materials) -> Piece:
    """A laundry basket."""
    piece = Piece(m)
    piece.solid_cylinder("cloth_sand", 0.20, (0, -0.22, 0), 0.55, cap="cloth_white")
    return piece
