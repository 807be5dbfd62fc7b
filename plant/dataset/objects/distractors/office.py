"""Distractors from desks and shelves."""

from __future__ import annotations

import numpy as np

from plant.dataset.objects.distractors.common import (
    Made,
    any_colour,
    between,
    box,
    print_on,
    surface_of,
    turn,
)
from plant.dataset.objects.draft import PAPER, Draft, pick, shade, turned
from plant.dataset.objects.lettering import brand, write_tall, write_word
from plant.dataset.objects.wear import plain
from plant.models.builder.outlines import curve
from plant.models.builder.pictures import wood
from plant.models.builder.surfaces import add_ellipsoid, add_ring, add_rounded_box, add_tube


def screen(draft: Draft) -> Made:
    """A monitor on its foot."""
    w, h = between(draft, 0.42, 0.7), between(draft, 0.26, 0.40)
    draft.paint("case", pick(draft.rng, (0.06, 0.06, 0.07), (0.75, 0.76, 0.77), (0.2, 0.2, 0.21)))
    draft.picture("picture", _screen_picture(draft), shine=0.8)
    box(draft, "case", (-0.01, -w / 2, 0.1), (0.02, w / 2, 0.1 + h), radius=0.006, density=900)
    part = draft.part()
    part.add_rectangle("picture", (0.021, -w / 2 + 0.012, 0.113), (0, w - 0.024, 0), (0, 0, h - 0.026))
    draft.look(part)
    box(draft, "case", (-0.03, -0.03, 0.0), (-0.01, 0.03, 0.1 + h / 2), density=1200)
    box(draft, "case", (-0.1, -0.12, 0.0), (0.1, 0.12, 0.012), density=1500)
    return draft.finish(), "screen", "black"


def _screen_picture(draft: Draft) -> np.ndarray:
    rng = draft.rng
    image = plain(pick(rng, (0.03, 0.04, 0.05), (0.12, 0.25, 0.42), (0.92, 0.93, 0.94), (0.15, 0.16, 0.18)), (160, 256))
    for _ in range(int(rng.integers(0, 7))):
        y, x = int(rng.integers(0, 110)), int(rng.integers(0, 180))
        image[y : y + int(rng.integers(15, 60)), x : x + int(rng.integers(20, 90))] = rng.uniform(0.05, 0.95, 3)
    return image


def laptop(draft: Draft) -> Made:
    """An open laptop."""
    name, colour = any_colour(draft, "grey", "black", "white")
    surface_of(draft, "case", colour, shine=0.5)
    draft.picture("keys", _keys(draft, colour))
    draft.picture("picture", _screen_picture(draft), shine=0.8)
    w, d = between(draft, 0.29, 0.37), between(draft, 0.20, 0.25)
    box(draft, "case", (-d / 2, -w / 2, 0), (d / 2, w / 2, 0.015), density=1400)
    lid, tilt = draft.part(), between(draft, 0.1, 0.5)
    lid.add_box("case", (0, -w / 2, 0), (0.006, w / 2, d), faces={"+x": "picture"})
    draft.solid(lid, 1400, turned("y", -tilt), (-d / 2, 0, 0.014))
    top = draft.part()
    top.add_rectangle("keys", (d / 2 - 0.09, -w / 2 + 0.02, 0.0155), (0, w - 0.04, 0), (-(d - 0.11), 0, 0))
    draft.look(top)
    return draft.finish(), "laptop", name


def _keys(draft: Draft, colour: np.ndarray) -> np.ndarray:
    image = plain(np.asarray(colour) * 0.8, (96, 256))
    key = draft.rng.choice([0.08, 0.9, 0.3])
    for row in range(5):
        for column in range(15):
            image[4 + row * 18 : 18 + row * 18, 4 + column * 17 : 18 + column * 17] = key
    return image


def keyboard(draft: Draft) -> Made:
    """A keyboard."""
    name, colour = any_colour(draft, "black", "white", "grey")
    surface_of(draft, "case", colour)
    draft.picture("keys", _keys(draft, colour))
    w, d = between(draft, 0.3, 0.45), between(draft, 0.11, 0.15)
    part = draft.part()
    part.add_box("case", (-d / 2, -w / 2, 0), (d / 2, w / 2, 0.02), faces={"+z": "keys"})
    draft.solid(part, 700, turned("z", np.pi / 2))
    return draft.finish(), "keyboard", name


def mouse(draft: Draft) -> Made:
    """A computer mouse."""
    name, colour = any_colour(draft, "black", "white", "grey", "red")
    surface_of(draft, "case", colour)
    part = draft.part()
    add_ellipsoid(part, "case", (0, 0, 0.012), (0.055, 0.032, 0.022), sides=24)
    draft.solid(part, 800)
    return draft.finish(), "mouse", name


def phone(draft: Draft) -> Made:
    """A telephone, screen up."""
    name, colour = any_colour(draft, "black", "white", "grey", "blue", "pink")
    surface_of(draft, "case", colour, shine=0.6)
    draft.picture("picture", _screen_picture(draft), shine=0.9)
    w, h = between(draft, 0.065, 0.08), between(draft, 0.14, 0.165)
    part = draft.part()
    add_rounded_box(part, "case", (-h / 2, -w / 2, 0), (h / 2, w / 2, 0.008), 0.003, top="picture")
    draft.solid(part, 2000)
    return draft.finish(), "phone", name


def remote(draft: Draft) -> Made:
    """A remote control."""
    surface_of(draft, "case", any_colour(draft, "black", "grey", "white")[1])
    draft.paint("button", any_colour(draft, "grey", "red", "white", "black")[1])
    long = between(draft, 0.14, 0.22)
    box(draft, "case", (-long / 2, -0.022, 0), (long / 2, 0.022, 0.018), radius=0.006, density=900)
    part = draft.part()
    for k in range(8):
        for y in (-0.012, 0, 0.012):
            part.add_cylinder("button", 0.004, (-long * 0.4 + k * long * 0.09, y, 0.018), 0.0015, sides=10)
    draft.look(part)
    return draft.finish(), "remote", "black"


def book(draft: Draft) -> Made:
    """A closed book, lying."""
    name, _ = _add_book(draft, 0.0, "a")
    return draft.finish(), "book", name


def book_stack(draft: Draft) -> Made:
    """Several books on one another."""
    z, name = 0.0, "brown"
    for k in range(int(draft.rng.integers(2, 6))):
        name, z = _add_book(draft, z, f"b{k}")
    return draft.finish(), "books", name


def _add_book(draft: Draft, z: float, key: str) -> tuple[str, float]:
    """A book at a height; its colour and its top's height."""
    rng = draft.rng
    name, colour = any_colour(draft)
    cover = print_on(draft, colour, words=("Novel", "Atlas", "Poems", "History", "Garden"), shape=(256, 192), repeats=1)
    draft.picture(f"cover{key}", cover)
    spine = plain(colour, (32, 192))
    write_word(spine, brand(rng), (0.1, 0.1, 0.9, 0.9), (0.95, 0.9, 0.8))
    draft.picture(f"spine{key}", spine)
    draft.paint(f"paper{key}", shade(rng, (0.92, 0.89, 0.80)))
    w, d, t = between(draft, 0.12, 0.22), between(draft, 0.17, 0.29), between(draft, 0.012, 0.05)
    part = draft.part()
    faces: dict[str, str | None] = {"-x": f"spine{key}", "+x": f"paper{key}", "-y": f"paper{key}", "+y": f"paper{key}"}
    part.add_box(f"cover{key}", (-w / 2, -d / 2, 0), (w / 2, d / 2, t), faces=faces)
    draft.solid(part, PAPER, turned("z", float(rng.normal(0, 0.25))), (0, 0, z))
    return name, z + t


def binder(draft: Draft) -> Made:
    """A standing lever-arch file."""
    name, colour = any_colour(draft)
    surface_of(draft, "cover", colour)
    back = plain(colour, (256, 64))
    write_tall(back, brand(draft.rng), (0.1, 0.2, 0.6, 0.8), (0.95, 0.95, 0.95), 0)
    draft.picture("back", back)
    part = draft.part()
    part.add_box("cover", (0, -0.035, 0), (0.28, 0.035, 0.32), faces={"-x": "back"})
    draft.solid(part, 400)
    return draft.finish(), "binder", name


def desk_lamp(draft: Draft) -> Made:
    """A lamp with a bent arm or a shade on a foot."""
    name, colour = any_colour(draft)
    surface_of(draft, "metal", colour, shine=0.6)
    draft.paint("bulb", (0.99, 0.96, 0.85))
    h = between(draft, 0.25, 0.5)
    turn(draft, "metal", [(0, 0), (0.08, 0), (0.08, 0.012), (0.01, 0.02)], density=2500)
    part = draft.part()
    if draft.rng.random() < 0.5:
        add_tube(part, "metal", [(0, 0, 0.015), (0, 0, h)], [0.006, 0.006])
        draft.solid(part, 2000)
        surface_of(draft, "shade", any_colour(draft, "white", "cream", "yellow", "teal")[1])
        r = between(draft, 0.08, 0.13)
        turn(draft, "shade", [(r, h - 0.06), (r * 0.6, h + 0.12)], shell=0.4)
        turn(draft, "bulb", [(0, h), (0.03, h + 0.03), (0, h + 0.06)], shell=0.3)
    else:
        add_tube(
            part, "metal", curve([(0, 0, 0.015), (-0.08, 0, h * 0.6), (0.05, 0, h), (0.13, 0, h * 0.95)], 5), 0.006
        )
        add_tube(part, "metal", [(0.10, 0, h), (0.14, 0, h * 0.93), (0.18, 0, h * 0.8)], [0.025, 0.04, 0.065])
        draft.solid(part, 1500)
    return draft.finish(), "lamp", name


def clock(draft: Draft) -> Made:
    """A standing alarm clock."""
    name, colour = any_colour(draft)
    surface_of(draft, "case", colour, shine=0.5)
    face = plain((0.95, 0.95, 0.93))
    rows, columns = np.indices((128, 128)) - 63.5
    angle, radius = np.arctan2(rows, columns), np.hypot(rows, columns)
    face[(np.abs((angle * 6 / np.pi + 0.05) % 1 - 0.05) < 0.05) & (radius > 44) & (radius < 56)] = 0.1
    face[(np.abs(columns) < 2) & (rows < 0) & (rows > -42)] = 0.1
    face[(np.abs(rows) < 3) & (columns > 0) & (columns < 28)] = 0.1
    draft.picture("face", face)
    r = between(draft, 0.04, 0.08)
    part = draft.part()
    part.add_lathe("case", [(0, -0.03), (r, -0.03), (r, 0.0), (r * 0.93, 0.003), (r * 0.92, 0)], sides=36)
    draft.solid(part, 700, turned("y", np.pi / 2), (0, 0, r))
    front = draft.part()
    front.add_rectangle("face", (0.001, -r * 0.7, r * 0.3), (0, r * 1.4, 0), (0, 0, r * 1.4))
    draft.look(front)
    return draft.finish(), "clock", name


def picture_frame(draft: Draft) -> Made:
    """A standing picture."""
    name, colour = any_colour(draft, "brown", "black", "white", "yellow")
    draft.picture("wood", wood(draft.rng, (64, 64), tuple(colour), 0.06))
    draft.picture("picture", _screen_picture(draft))
    w, h, part = between(draft, 0.08, 0.2), between(draft, 0.1, 0.25), draft.part()
    part.add_box("wood", (-0.01, -w / 2, 0), (0.01, w / 2, h))
    part.add_rectangle("picture", (0.0105, -w / 2 + 0.015, 0.015), (0, w - 0.03, 0), (0, 0, h - 0.03))
    draft.solid(part, 700, turned("y", -0.2))
    return draft.finish(), "picture frame", name


def headphones(draft: Draft) -> Made:
    """Headphones, lying."""
    name, colour = any_colour(draft, "black", "white", "red", "blue", "grey")
    surface_of(draft, "plastic", colour)
    draft.paint("pad", (0.08, 0.08, 0.08))
    part = draft.part()
    angle = np.linspace(0.1, np.pi - 0.1, 16)
    add_tube(
        part,
        "plastic",
        np.stack([0.08 * np.cos(angle), 0.09 * np.sin(angle), 0 * angle + 0.02], axis=1),
        np.tile([0.012, 0.004], (16, 1)),
        up=(0, 0, 1),
    )
    for x in (-0.075, 0.075):
        add_ellipsoid(part, "plastic", (x, 0, 0.02), (0.012, 0.038, 0.038))
        add_ellipsoid(part, "pad", (x * 0.82, 0, 0.02), (0.012, 0.035, 0.035))
    draft.solid(part, 400)
    return draft.finish(), "headphones", name


def speaker(draft: Draft) -> Made:
    """A loudspeaker box."""
    name, colour = any_colour(draft, "black", "white", "brown", "grey")
    surface_of(draft, "case", colour)
    draft.paint("cone", (0.15, 0.15, 0.16))
    w, h = between(draft, 0.06, 0.1), between(draft, 0.2, 0.34)
    box(draft, "case", (-w, -w, 0), (w, w, h), radius=0.006, density=350)
    part = draft.part()
    for z, r in ((h * 0.35, w * 0.75), (h * 0.78, w * 0.4)):
        ring = draft.part()
        add_ring(ring, "cone", r * 0.3, r, 0, 0.004)
        part.add_mesh(ring, turned("y", np.pi / 2), (w, 0, z))
    draft.look(part)
    return draft.finish(), "speaker", name
