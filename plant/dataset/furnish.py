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
    """Where things may lie in a piece's frame: (x0, y0, x1, y1) in metres, its height and the free height above."""

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


def counter(rng: np.random.Generator, m: Materials) -> Furnished:
    """A kitchen run."""
    w = _of(rng, 2.2, 3.6)
    sink, hob = -w / 2 + 0.45, w / 2 - 0.45
    piece = f.counter(m, width=w, sink_x=sink, hob_x=hob)
    return Furnished(piece, w, 0.6, (Top((sink + 0.32, -0.58, hob - 0.32, -0.03), 0.90),))


def workbench(rng: np.random.Generator, m: Materials) -> Furnished:
    """A workbench with a vice, or a plain one of another height."""
    w = _of(rng, 1.9, 2.6)
    return Furnished(
        f.workbench(m, width=w),
        w,
        0.65,
        (Top((-w / 2, -0.64, w / 2 - 0.3, -0.02), 0.82), Top((-w / 2 + 0.1, -0.6, -1.0, -0.1), 0.23, 0.3)),
    )


def trolley(rng: np.random.Generator, m: Materials) -> Furnished:
    """A tool trolley."""
    return Furnished(f.trolley(m), 0.7, 0.45, (Top((-0.33, -0.43, 0.33, -0.02), 0.80),))


def desk(rng: np.random.Generator, m: Materials) -> Furnished:
    """A desk with a screen at its left."""
    return Furnished(f.desk(m), 1.6, 0.7, (Top((-0.05, -0.68, 0.78, -0.02), 0.74),))


def shelf(rng: np.random.Generator, m: Materials) -> Furnished:
    """Open shelves on which things stand."""
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


def bookshelf(rng: np.random.Generator, m: Materials) -> Furnished:
    """A bookshelf; low ones carry things."""
    w, h = _of(rng, 0.6, 1.4), _of(rng, 0.8, 2.0)
    tops = (_whole(w, 0.30, h),) if h < 1.4 else ()
    return Furnished(f.bookshelf(m, width=w, height=h, boards=max(2, round(h / 0.36))), w, 0.30, tops)


def tall(rng: np.random.Generator, m: Materials) -> Furnished:
    """A fridge, wardrobe or locker."""
    w, d, h = _of(rng, 0.5, 1.6), _of(rng, 0.5, 0.66), _of(rng, 1.5, 2.2)
    return Furnished(
        f.tall_unit(
            m, size=(w, d, h), body=str(rng.choice(_BODIES)), grid=(max(1, round(w / 0.6)), int(rng.integers(1, 4)))
        ),
        w,
        d,
    )


def rack(rng: np.random.Generator, m: Materials) -> Furnished:
    """A storage rack."""
    w = _of(rng, 0.9, 1.6)
    return Furnished(f.rack(m, width=w), w, 0.42)


def sofa(rng: np.random.Generator, m: Materials) -> Furnished:
    """A sofa or an armchair; things lie on its seat."""
    w = _of(rng, 0.85, 2.2)
    return Furnished(
        f.sofa(m, width=w, cloth=str(rng.choice(_CLOTHS))),
        w,
        0.9,
        (Top((-w / 2 + 0.2, -0.86, w / 2 - 0.2, -0.4), 0.46),),
    )


def bed(rng: np.random.Generator, m: Materials) -> Furnished:
    """A bed; things lie on its cover."""
    w = _of(rng, 0.9, 1.7)
    return Furnished(f.bed(m, width=w), w, 2.05, (Top((-w / 2 + 0.1, -1.9, w / 2 - 0.1, -0.8), 0.52),))


def television(rng: np.random.Generator, m: Materials) -> Furnished:
    """A television on a board."""
    return Furnished(f.television(m), 1.6, 0.4, (Top((-0.78, -0.39, 0.78, -0.29), 0.45),))


def stool(rng: np.random.Generator, m: Materials) -> Furnished:
    """A stool, a box or a crate to put things on."""
    w, h, piece = _of(rng, 0.3, 0.5), _of(rng, 0.3, 0.65), Piece(m)
    material = str(rng.choice(_TOPS))
    if rng.random() < 0.5:
        piece.solid_box(material, (-w / 2, -w, 0), (w / 2, 0, h))
    else:
        piece.solid_box(material, (-w / 2, -w, h - 0.04), (w / 2, 0, h))
        piece.legs(str(rng.choice(_BODIES)), w / 2, (-w, 0), 0.035, h - 0.04)
    return Furnished(piece, w, w, (_whole(w, w, h),))


def chair(rng: np.random.Generator, m: Materials) -> Furnished:
    """A chair; things lie on its seat."""
    if rng.random() < 0.3:
        return Furnished(f.office_chair(m), 0.5, 0.52, (Top((-0.2, -0.48, 0.2, -0.1), 0.51),))
    return Furnished(
        f.chair(
            m, wood=str(rng.choice(("wood_dark", "wood_light", "white", "charcoal"))), seat=str(rng.choice(_CLOTHS))
        ),
        0.42,
        0.44,
        (Top((-0.2, -0.43, 0.2, -0.06), 0.45),),
    )


def lamp(rng: np.random.Generator, m: Materials) -> Furnished:
    """A floor lamp."""
    return Furnished(f.floor_lamp(m), 0.4, 0.4)


def plant(rng: np.random.Generator, m: Materials) -> Furnished:
    """A large plant."""
    return Furnished(f.plant(m, height=_of(rng, 0.7, 1.7), seed=int(rng.integers(1000))), 0.45, 0.45)


def basket(rng: np.random.Generator, m: Materials) -> Furnished:
    """A laundry basket."""
    return Furnished(f.basket(m), 0.44, 0.44)


def washbasin(rng: np.random.Generator, m: Materials) -> Furnished:
    """A washbasin with a mirror."""
    return Furnished(f.washbasin(m), 0.7, 0.45)


BY_THE_WALL: tuple[Maker, ...] = (
    table,
    table,
    cabinet,
    cabinet,
    counter,
    workbench,
    trolley,
    desk,
    shelf,
    shelf,
    bookshelf,
    tall,
    rack,
    sofa,
    bed,
    television,
    stool,
    chair,
    lamp,
    plant,
    basket,
    washbasin,
)
IN_THE_MIDDLE: tuple[Maker, ...] = (table, table, round_table, stool, trolley, chair)
