"""Furniture for random rooms: the flat's kinds in other sizes and materials, and more, with their tops."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from errand_make.mesh import Material
from errand_train.worlds.furniture import Piece
from errand_train.worlds.materials import materials

Materials = Mapping[str, Material]
Rect = tuple[float, float, float, float]

_BODIES = ("white", "grey", "wood_light", "wood_dark", "wood_grey", "cream", "teal", "charcoal", "light_grey")
_TOPS = ("worktop", "bench_top", "wood_light", "wood_dark", "wood_grey", "white", "tray")
_CLOTHS = ("cloth_grey", "cloth_sand", "cloth_slate", "cloth_white")


@dataclass(frozen=True)
class Top:
    """Area for objects in a piece's frame: (x0, y0, x1, y1) in metres, its height and the free height above."""

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
    """Materials of furniture with random appearance; `textures` gives files by role."""
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


def _one(rng: np.random.Generator, names: Sequence[str]) -> str:
    return str(rng.choice(names))


def _whole(width: float, depth: float, height: float) -> Top:
    return Top((-width / 2, -depth, width / 2, 0.0), height)


def _sized(name: str, m: Materials, w: float, d: float, h: float, *tops: Top, **options: float | str) -> Furnished:
    """A piece of a width, depth and height."""
    return Furnished(Piece(name, m, width=w, depth=d, height=h, **options), w, d, tops)


def table(rng: np.random.Generator, m: Materials) -> Furnished:
    """A table or a coffee table."""
    low = rng.random() < 0.25
    w, d, h = _of(rng, 0.7, 1.8), _of(rng, 0.55, 0.95), _of(rng, 0.38, 0.5) if low else _of(rng, 0.68, 0.80)
    top, leg, thick = _one(rng, _TOPS), _one(rng, _BODIES), _of(rng, 0.03, 0.08)
    return _sized("table", m, w, d, h, _whole(w, d, h), top=top, leg=leg, thick=thick)


def round_table(rng: np.random.Generator, m: Materials) -> Furnished:
    """A round table on one foot."""
    r, h = _of(rng, 0.32, 0.6), _of(rng, 0.45, 0.78)
    piece = Piece("round_table", m, radius=r, height=h, top=_one(rng, _TOPS))
    return Furnished(piece, 2 * r, 2 * r, (Top((-0.65 * r, -1.65 * r, 0.65 * r, -0.35 * r), h),))


def cabinet(rng: np.random.Generator, m: Materials) -> Furnished:
    """A sideboard, dresser or night stand."""
    w, d, h = _of(rng, 0.4, 1.6), _of(rng, 0.35, 0.6), _of(rng, 0.45, 1.05)
    grid = {"columns": max(1, round(w / 0.45)), "rows": int(rng.integers(1, 4))}
    return _sized("cabinet", m, w, d, h, _whole(w, d, h), body=_one(rng, _BODIES), top=_one(rng, _TOPS), **grid)


def shelf(rng: np.random.Generator, m: Materials) -> Furnished:
    """An open shelf for objects."""
    w, d, h, boards = _of(rng, 0.6, 1.4), _of(rng, 0.26, 0.45), _of(rng, 0.8, 1.9), int(rng.integers(2, 5))
    body, back, side = _one(rng, _BODIES), int(rng.random() < 0.7), 0.025
    pitch, tops = (h - side) / boards, []
    for k in range(boards + 1):
        free = pitch - side - 0.02 if k < boards else 2.0
        tops.append(Top((-w / 2 + 0.04, -d, w / 2 - 0.04, -0.02), k * pitch + side, free))
    return _sized("shelf", m, w, d, h, *tops, boards=boards, body=body, back=back)


def stool(rng: np.random.Generator, m: Materials) -> Furnished:
    """A stool, a box or a crate to put objects on."""
    w, h, top = _of(rng, 0.3, 0.5), _of(rng, 0.3, 0.65), _one(rng, _TOPS)
    if rng.random() < 0.5:
        return _sized("crate", m, w, w, h, _whole(w, w, h), top=top)
    return _sized("stool", m, w, w, h, _whole(w, w, h), top=top, leg=_one(rng, _BODIES))


def _sofa(rng: np.random.Generator, m: Materials) -> Furnished:
    w = _of(rng, 0.85, 2.2)
    top = Top((0.2 - w / 2, -0.86, w / 2 - 0.2, -0.4), 0.46)
    return Furnished(Piece("sofa", m, width=w, cloth=_one(rng, _CLOTHS)), w, 0.9, (top,))


def _chair(rng: np.random.Generator, m: Materials) -> Furnished:
    wood = _one(rng, ("wood_dark", "wood_light", "white", "charcoal"))
    piece = Piece("chair", m, wood=wood, seat=_one(rng, _CLOTHS))
    return Furnished(piece, 0.42, 0.44, (Top((-0.2, -0.43, 0.2, -0.06), 0.45),))


def _tall(rng: np.random.Generator, m: Materials) -> Furnished:
    """A fridge, wardrobe or locker."""
    w, d, h = _of(rng, 0.5, 1.6), _of(rng, 0.5, 0.66), _of(rng, 1.5, 2.2)
    grid = {"columns": max(1, round(w / 0.6)), "rows": int(rng.integers(1, 4))}
    return _sized("cabinet", m, w, d, h, body=_one(rng, _BODIES), **grid)


def _fixed(name: str, size: tuple[float, float], *tops: Top, **options: float) -> Maker:
    """A piece of the flat as it is, with its width, its depth and its tops."""
    return lambda _, m: Furnished(Piece(name, m, **options), *size, tops)


BY_THE_WALL: tuple[Maker, ...] = (
    *(table, table, cabinet, cabinet, shelf, shelf, stool, _sofa, _chair, _tall),
    _fixed("counter", (3.0, 0.6), Top((-0.73, -0.58, 0.73, -0.03), 0.90), width=3.0, sink_x=-1.05, hob_x=1.05),
    _fixed("workbench", (2.4, 0.65), Top((-1.2, -0.64, 0.9, -0.02), 0.82), width=2.4),
    _fixed("trolley", (0.7, 0.45), Top((-0.33, -0.43, 0.33, -0.02), 0.80)),
    _fixed("desk", (1.6, 0.7), Top((-0.05, -0.68, 0.78, -0.02), 0.74)),
    _fixed("bookshelf", (0.9, 0.3), _whole(0.9, 0.3, 1.1), width=0.9, height=1.1, boards=3),
    _fixed("bookshelf", (1.3, 0.3), width=1.3, height=1.9, boards=5),
    _fixed("rack", (1.3, 0.42), width=1.3),
    _fixed("bed", (1.4, 2.05), Top((-0.6, -1.9, 0.6, -0.8), 0.52), width=1.4),
    _fixed("television", (1.6, 0.4), Top((-0.78, -0.39, 0.78, -0.29), 0.45)),
    _fixed("office_chair", (0.5, 0.52), Top((-0.2, -0.48, 0.2, -0.1), 0.51)),
    _fixed("floor_lamp", (0.4, 0.4)),
    _fixed("plant", (0.45, 0.45), height=1.3, seed=5),
    _fixed("basket", (0.44, 0.44)),
    _fixed("washbasin", (0.7, 0.45)),
)
IN_THE_MIDDLE: tuple[Maker, ...] = (table, table, round_table, stool, _chair)
