"""Furniture for random rooms: the flat's own kinds in other sizes and materials, and some more, with their tops."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from plant.models.builder.mesh import Material
from plant.worlds.builder import furniture as f
from plant.worlds.builder.materials import materials
from plant.worlds.builder.piece import Piece

Materials = Mapping[str, Material]
Rect = tuple[float, float, float, float]

_BODIES = ("white", "grey", "wood_light", "wood_dark", "wood_grey", "cream", "teal", "charcoal", "light_grey")
_TOPS = ("worktop", "bench_top", "wood_light", "wood_dark", "wood_grey", "white", "tray")
_CLOTHS = ("cloth_grey", "cloth_sand", "cloth_slate", "cloth_white")


@dataclass(frozen=True)
class Top:
    """Where objects may lie in a piece's frame: (x0, y0, x1, y1) in metres, its height and the free height above."""

    rect: Rect
    height_m: float
    room_m: float = 2.0


@dataclass(frozen=True)
class Furnished:
    """A piece with its width and depth (m) and its tops."""

    piece: Piece
    width_m: float
    depth_m: float
    tops: tuple[Top, ...] = ()


def random_materials(rng: np.random.Generator, textures: Mapping[str, tuple[str, ...]]) -> dict[str, Material]:
    """The materials that furniture names, each with a random look; `textures` gives files by role."""
    made = {}
    for name, usual in materials().items():
        role = "cloth" if name.startswith("cloth") or name in ("rug", "pillow") else "wood"
        tint = tuple(float(v) for v in np.clip(rng.uniform(0.55, 1.0) * rng.uniform(0.85, 1.1, 3), 0, 1))
        if name in ("books", "window", "entrance_door", "pegboard", "screen"):
            role = {"window": "outside", "entrance_door": "door"}.get(name, "picture")
            tint = (1.0, 1.0, 1.0)
        if usual.texture is not None or name in _BODIES or name == "screen":
            files = textures[role]
            tile = float(rng.uniform(0.4, 1.2))
            made[name] = Material(
                (tint[0], tint[1], tint[2]), str(rng.choice(files)), (tile, tile), float(rng.uniform(0.05, 0.5))
            )
        else:
            colour = np.clip(np.array(usual.colour) * rng.uniform(0.7, 1.2) + rng.normal(0, 0.06, 3), 0.02, 0.98)
            made[name] = Material(
                (float(colour[0]), float(colour[1]), float(colour[2])), shine=float(rng.uniform(0.05, 0.5))
            )
    return made


Maker = Callable[[np.random.Generator, Materials], Furnished]


def _of(rng: np.random.Generator, low: float, high: float) -> float:
    return float(rng.uniform(low, high))


def _whole(width: float, depth: float, height: float) -> Top:
    return Top((-width / 2, -depth, width / 2, 0.0), height)


def table(rng: np.random.Generator, m: Materials) -> Furnished:
    """A table or a coffee table."""
    low = rng.random() < 0.25
    w, d, h = _of(rng, 0.7, 1.8), _of(rng, 0.55, 0.95), _of(rng, 0.38, 0.5) if low else _of(rng, 0.68, 0.80)
    piece = f.table(
        m, size=(w, d, h), top=str(rng.choice(_TOPS)), leg=str(rng.choice(_BODIES)), thick=_of(rng, 0.03, 0.08)
    )
    return Furnished(piece, w, d, (_whole(w, d, h),))


def round_table(rng: np.random.Generator, m: Materials) -> Furnished:
    """A round table on one foot."""
    r, h, piece = _of(rng, 0.32, 0.6), _of(rng, 0.45, 0.78), Piece(m)
    piece.solid_cylinder(str(rng.choice(_TOPS)), r, (0, -r, h - 0.03), 0.03)
    piece.solid_cylinder("dark_steel", 0.035, (0, -r, 0.02), h - 0.05)
    piece.solid_cylinder("dark_steel", r * 0.6, (0, -r, 0), 0.02)
    return Furnished(piece, 2 * r, 2 * r, (Top((-0.65 * r, -1.65 * r, 0.65 * r, -0.35 * r), h),))


def cabinet(rng: np.random.Generator, m: Materials) -> Furnished:
    """A sideboard, dresser or night stand."""
    w, d, h = _of(rng, 0.4, 1.6), _of(rng, 0.35, 0.6), _of(rng, 0.45, 1.05)
    grid = (max(1, round(w / 0.45)), int(rng.integers(1, 4)))
    piece = f.cabinet(m, size=(w, d, h), body=str(rng.choice(_BODIES)), top=str(rng.choice(_TOPS)), grid=grid)
    return Furnished(piece, w, d, (_whole(w, d, h),))


def shelf(rng: np.random.Generator, m: Materials) -> Furnished:
    """Open shelves on which objects stand."""
    w, d, h, boards = _of(rng, 0.6, 1.4), _of(rng, 0.26, 0.45), _of(rng, 0.8, 1.9), int(rng.integers(2, 5))
    piece, material, side = Piece(m), str(rng.choice(_BODIES)), 0.025
    for x in (-w / 2, w / 2 - side):
        piece.solid_box(material, (x, -d, 0), (x + side, 0, h))
    if rng.random() < 0.7:
        piece.look_box(material, (-w / 2, -0.01, 0), (w / 2, 0, h))
    pitch, tops = (h - side) / boards, []
    for k in range(boards + 1):
        z = k * pitch
        piece.solid_box(material, (-w / 2 + side, -d, z), (w / 2 - side, 0, z + side))
        tops.append(Top((-w / 2 + 0.04, -d, w / 2 - 0.04, -0.02), z + side, pitch - side - 0.02 if k < boards else 2.0))
    return Furnished(piece, w, d, tuple(tops))


def stool(rng: np.random.Generator, m: Materials) -> Furnished:
    """A stool, a box or a crate to put objects on."""
    w, h, piece = _of(rng, 0.3, 0.5), _of(rng, 0.3, 0.65), Piece(m)
    material = str(rng.choice(_TOPS))
    if rng.random() < 0.5:
        piece.solid_box(material, (-w / 2, -w, 0), (w / 2, 0, h))
    else:
        piece.solid_box(material, (-w / 2, -w, h - 0.04), (w / 2, 0, h))
        piece.legs(str(rng.choice(_BODIES)), w / 2, (-w, 0), 0.035, h - 0.04)
    return Furnished(piece, w, w, (_whole(w, w, h),))


def _sofa(rng: np.random.Generator, m: Materials) -> Furnished:
    w = _of(rng, 0.85, 2.2)
    return Furnished(
        f.sofa(m, width=w, cloth=str(rng.choice(_CLOTHS))),
        w,
        0.9,
        (Top((0.2 - w / 2, -0.86, w / 2 - 0.2, -0.4), 0.46),),
    )


def _chair(rng: np.random.Generator, m: Materials) -> Furnished:
    wood = str(rng.choice(("wood_dark", "wood_light", "white", "charcoal")))
    top = Top((-0.2, -0.43, 0.2, -0.06), 0.45)
    return Furnished(f.chair(m, wood=wood, seat=str(rng.choice(_CLOTHS))), 0.42, 0.44, (top,))


def _tall(rng: np.random.Generator, m: Materials) -> Furnished:
    """A fridge, wardrobe or locker."""
    w, d, h = _of(rng, 0.5, 1.6), _of(rng, 0.5, 0.66), _of(rng, 1.5, 2.2)
    grid = (max(1, round(w / 0.6)), int(rng.integers(1, 4)))
    return Furnished(f.tall_unit(m, size=(w, d, h), body=str(rng.choice(_BODIES)), grid=grid), w, d)


def _fixed(make: Callable[..., Piece], size: tuple[float, float], *tops: Top, **options: float) -> Maker:
    """A piece of the flat as it is, with its width, its depth and its tops."""
    return lambda _, m: Furnished(make(m, **options), *size, tops)


BY_THE_WALL: tuple[Maker, ...] = (
    *(table, table, cabinet, cabinet, shelf, shelf, stool, _sofa, _chair, _tall),
    _fixed(f.counter, (3.0, 0.6), Top((-0.73, -0.58, 0.73, -0.03), 0.90), width=3.0, sink_x=-1.05, hob_x=1.05),
    _fixed(f.workbench, (2.4, 0.65), Top((-1.2, -0.64, 0.9, -0.02), 0.82), width=2.4),
    _fixed(f.trolley, (0.7, 0.45), Top((-0.33, -0.43, 0.33, -0.02), 0.80)),
    _fixed(f.desk, (1.6, 0.7), Top((-0.05, -0.68, 0.78, -0.02), 0.74)),
    _fixed(f.bookshelf, (0.9, 0.3), _whole(0.9, 0.3, 1.1), width=0.9, height=1.1, boards=3),
    _fixed(f.bookshelf, (1.3, 0.3), width=1.3, height=1.9, boards=5),
    _fixed(f.rack, (1.3, 0.42), width=1.3),
    _fixed(f.bed, (1.4, 2.05), Top((-0.6, -1.9, 0.6, -0.8), 0.52), width=1.4),
    _fixed(f.television, (1.6, 0.4), Top((-0.78, -0.39, 0.78, -0.29), 0.45)),
    _fixed(f.office_chair, (0.5, 0.52), Top((-0.2, -0.48, 0.2, -0.1), 0.51)),
    _fixed(f.floor_lamp, (0.4, 0.4)),
    _fixed(f.plant, (0.45, 0.45), height=1.3, seed=5),
    _fixed(f.basket, (0.44, 0.44)),
    _fixed(f.washbasin, (0.7, 0.45)),
)
IN_THE_MIDDLE: tuple[Maker, ...] = (table, table, round_table, stool, _chair)
