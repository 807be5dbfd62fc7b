"""Distractors from garage and store."""

from __future__ import annotations

import numpy as np

from plant.dataset.objects.distractors.common import (
    Made,
    any_colour,
    between,
    box,
    print_on,
    printed_box,
    steel,
    surface_of,
    turn,
)
from plant.dataset.objects.draft import PLASTIC, STEEL, UP_TO_X, WOOD, Draft, pick, shade, turned
from plant.models.builder.outlines import arc, curve
from plant.models.builder.pictures import wood
from plant.models.builder.surfaces import add_extruded, add_ring, add_rounded_box, add_tube


def tape_measure(draft: Draft) -> Made:
    """A tape measure."""
    name, colour = any_colour(draft, "yellow", "red", "black", "blue")
    draft.picture("case", print_on(draft, colour, words=("5 m", "8 m", "3 m"), shape=(128, 128), repeats=1))
    draft.paint("tape", (0.95, 0.85, 0.15))
    draft.paint("dark", (0.1, 0.1, 0.1))
    outline = np.concatenate([arc((0, 0), 0.034, 0, 250, 18), [(0.034, -0.03)]])
    part = draft.part()
    add_extruded(part, "dark", outline, -0.016, 0.016, bevel=0.004, top="case")
    draft.solid(part, 1800, turned("x", np.pi / 2) if draft.rng.random() < 0.5 else np.eye(3))
    return draft.finish(), "tape measure", name


def tape_roll(draft: Draft) -> Made:
    """A roll of adhesive tape."""
    name, colour = any_colour(draft, "brown", "grey", "black", "white", "yellow", "red", "blue")
    surface_of(draft, "tape", colour, shine=0.6)
    draft.paint("core", (0.72, 0.60, 0.42))
    r, h = between(draft, 0.035, 0.06), between(draft, 0.015, 0.05)
    part, core = draft.part(), draft.part()
    add_ring(part, "tape", r * 0.7, r, 0, h)
    add_ring(core, "core", r * 0.64, r * 0.7, 0, h)
    draft.solid(part, 1000)
    draft.solid(core, 600)
    return draft.finish(), "tape roll", name


def spray_can(draft: Draft) -> Made:
    """A spray can with a cap."""
    name, colour = any_colour(draft)
    draft.picture("label", print_on(draft, colour, words=("SPRAY", "PAINT", "LUBE", "DEO", "HAIR")))
    draft.paint("metal", (0.75, 0.76, 0.78), shine=0.7, metal=1.0)
    draft.paint("cap", any_colour(draft)[1] if draft.rng.random() < 0.5 else colour)
    r, h = between(draft, 0.024, 0.034), between(draft, 0.14, 0.22)
    turn(draft, "metal", [(0, 0.004), (r * 0.9, 0), (r, 0.004)])
    turn(draft, "label", [(r, 0.004), (r, h * 0.82)])
    turn(draft, "metal", [(r, h * 0.82), (r * 0.9, h * 0.86), (r * 0.75, h * 0.88)])
    turn(draft, "cap", [(r * 0.9, h * 0.84), (r * 0.88, h), (0, h)])
    return draft.finish(), "spray can", name


def paint_tin(draft: Draft) -> Made:
    """A tin or bucket of paint with a bail."""
    name, colour = any_colour(draft)
    draft.picture("label", print_on(draft, colour, words=("PAINT", "LACQUER", "MATT", "WALL")))
    draft.paint("metal", (0.72, 0.73, 0.75), shine=0.7, metal=1.0)
    r = between(draft, 0.05, 0.12)
    h = r * between(draft, 1.7, 2.2)
    turn(draft, "metal", [(0, 0), (r, 0), (r, 0.06 * h)], density=1200)
    turn(draft, "label", [(r, 0.06 * h), (r, 0.9 * h)], density=1200)
    turn(
        draft,
        "metal",
        [(r, 0.9 * h), (r * 1.03, 0.92 * h), (r * 1.03, h), (r * 0.85, h), (r * 0.82, h - 0.006), (0, h - 0.006)],
        density=1200,
    )
    part = draft.part()
    angle = np.linspace(0, np.pi, 17)
    add_tube(
        part,
        "metal",
        np.stack([0.25 * r * np.sin(angle), 1.03 * r * np.cos(angle), 0.88 * h + 0.6 * r * np.sin(angle)], axis=1),
        0.002,
        sides=6,
    )
    draft.look(part)
    return draft.finish(), "paint tin", name


def bucket(draft: Draft) -> Made:
    """A plastic bucket."""
    name, colour = any_colour(draft)
    surface_of(draft, "wall", colour)
    draft.paint("inside", np.asarray(colour) * 0.5)
    r, h = between(draft, 0.11, 0.15), between(draft, 0.2, 0.28)
    turn(draft, "wall", [(0, 0), (r * 0.75, 0), (r, h), (r * 1.06, h), (r * 1.06, h - 0.015)], shell=2.0)
    turn(draft, "inside", [(r * 0.98, h), (r * 0.75, 0.01), (0, 0.01)], shell=0.3)
    return draft.finish(), "bucket", name


def cone(draft: Draft) -> Made:
    """A traffic cone."""
    surface_of(draft, "orange", shade(draft.rng, (0.93, 0.32, 0.05)))
    draft.paint("white", (0.93, 0.93, 0.92))
    h = between(draft, 0.2, 0.7)
    r = h * 0.22
    box(draft, "orange", (-r * 1.5, -r * 1.5, 0), (r * 1.5, r * 1.5, 0.04 * h), density=900)
    for material, low, high in (
        ("orange", 0.04, 0.4),
        ("white", 0.4, 0.6),
        ("orange", 0.6, 0.75),
        ("white", 0.75, 0.87),
        ("orange", 0.87, 1.0),
    ):
        turn(draft, material, [(r * (1.05 - 0.88 * low), low * h), (r * (1.05 - 0.88 * high), high * h)], shell=1.5)
    return draft.finish(), "traffic cone", "orange"


def cardboard_box(draft: Draft) -> Made:
    """A parcel that is no cube."""
    surface_of(draft, "board", shade(draft.rng, (0.66, 0.52, 0.36)), shine=0.05)
    draft.paint("tape", pick(draft.rng, (0.55, 0.40, 0.24), (0.82, 0.78, 0.7)))
    w = between(draft, 0.14, 0.4)
    d, h = w * between(draft, 0.45, 0.75), w * between(draft, 0.25, 0.6)
    box(draft, "board", (-w / 2, -d / 2, 0), (w / 2, d / 2, h), radius=0.002, density=120)
    box(
        draft, "tape", (-w / 2 - 0.0004, -0.025, h * 0.7), (w / 2 + 0.0004, 0.025, h + 0.0004), radius=0.0001, density=1
    )
    return draft.finish(), "cardboard box", "brown"


def crate(draft: Draft) -> Made:
    """A plastic crate with slots."""
    name, colour = any_colour(draft)
    surface_of(draft, "wall", colour)
    w, d, h = between(draft, 0.3, 0.5), between(draft, 0.22, 0.35), between(draft, 0.12, 0.28)
    box(draft, "wall", (-w / 2, -d / 2, 0), (w / 2, d / 2, 0.01), density=900)
    for k in range(3):
        z = 0.01 + k * (h - 0.03) / 2
        for a, b in (
            ((-w / 2, -d / 2), (w / 2, -d / 2 + 0.008)),
            ((-w / 2, d / 2 - 0.008), (w / 2, d / 2)),
            ((-w / 2, -d / 2), (-w / 2 + 0.008, d / 2)),
            ((w / 2 - 0.008, -d / 2), (w / 2, d / 2)),
        ):
            box(draft, "wall", (*a, z), (*b, z + h * 0.22), radius=0.001, density=900)
    for x in (-w / 2, w / 2 - 0.02):
        for y in (-d / 2, d / 2 - 0.02):
            box(draft, "wall", (x, y, 0), (x + 0.02, y + 0.02, h), radius=0.002, density=900)
    return draft.finish(), "crate", name


def toolbox(draft: Draft) -> Made:
    """A closed tool box with a handle."""
    name, colour = any_colour(draft, "red", "black", "blue", "grey", "yellow")
    surface_of(draft, "case", colour)
    surface_of(draft, "dark", (0.1, 0.1, 0.11))
    w, d, h = between(draft, 0.32, 0.5), between(draft, 0.16, 0.24), between(draft, 0.14, 0.22)
    box(draft, "case", (-w / 2, -d / 2, 0), (w / 2, d / 2, h * 0.6), radius=0.01, density=500)
    box(
        draft,
        "dark" if draft.rng.random() < 0.5 else "case",
        (-w / 2, -d / 2, h * 0.61),
        (w / 2, d / 2, h),
        radius=0.015,
        density=400,
    )
    part = draft.part()
    add_tube(
        part,
        "dark",
        curve(
            [(-w * 0.2, 0, h - 0.01), (-w * 0.18, 0, h + 0.035), (w * 0.18, 0, h + 0.035), (w * 0.2, 0, h - 0.01)], 6
        ),
        0.01,
    )
    for x in (-w * 0.3, w * 0.3):
        part.add_box("dark", (x - 0.015, -d / 2 - 0.006, h * 0.5), (x + 0.015, -d / 2, h * 0.72))
    draft.solid(part, PLASTIC)
    return draft.finish(), "tool box", name


def flashlight(draft: Draft) -> Made:
    """A torch, lying."""
    name, colour = any_colour(draft, "black", "yellow", "grey", "red", "blue")
    surface_of(draft, "body", colour)
    draft.paint("lens", (0.93, 0.94, 0.9), shine=0.9)
    r, long, part = between(draft, 0.012, 0.02), between(draft, 0.12, 0.25), draft.part()
    part.add_lathe(
        "body", [(0, 0), (r, 0.001), (r * 1.02, long * 0.65), (r * 1.7, long * 0.8), (r * 1.75, long)], sides=24
    )
    part.add_lathe("lens", [(r * 1.75, long), (r * 1.5, long - 0.002), (0, long - 0.003)], sides=24)
    draft.solid(part, 1500, UP_TO_X)
    return draft.finish(), "torch", name


def battery(draft: Draft) -> Made:
    """A large block battery or a battery pack."""
    name, colour = any_colour(draft, "black", "yellow", "grey", "blue", "green")
    printed_box(
        draft,
        (between(draft, 0.06, 0.16), between(draft, 0.05, 0.08), between(draft, 0.08, 0.13)),
        colour,
        ("12 V", "18 V", "POWER", "6 V"),
        1900,
    )
    surface_of(draft, "pole", (0.6, 0.55, 0.4), metal=0.9)
    for x in (-0.02, 0.02):
        part = draft.part()
        part.add_cylinder("pole", 0.006, (x, 0, 0.08), 0.06)
        draft.solid(part, STEEL)
    return draft.finish(), "battery", name


def plank(draft: Draft) -> Made:
    """A board or batten."""
    draft.picture("wood", wood(draft.rng, (96, 256), tuple(shade(draft.rng, (0.78, 0.6, 0.38), 0.1)), 0.08))
    long, wide, thick = between(draft, 0.3, 0.9), between(draft, 0.04, 0.14), between(draft, 0.015, 0.04)
    part = draft.part()
    part.add_box("wood", (-long / 2, -wide / 2, 0), (long / 2, wide / 2, thick))
    draft.solid(part, WOOD)
    return draft.finish(), "plank", "brown"


def level(draft: Draft) -> Made:
    """A spirit level."""
    name, colour = any_colour(draft, "yellow", "red", "grey", "blue")
    surface_of(draft, "rail", colour)
    draft.paint("vial", (0.75, 0.9, 0.25), shine=0.9)
    draft.paint("end", (0.1, 0.1, 0.1))
    long, part = between(draft, 0.25, 0.7), draft.part()
    part.add_box("rail", (-long / 2, -0.012, 0), (long / 2, 0.012, 0.05), faces={"-x": "end", "+x": "end"})
    for x in (0, -long * 0.38, long * 0.38):
        part.add_box("vial", (x - 0.018, -0.0125, 0.018), (x + 0.018, 0.0125, 0.032))
    draft.solid(part, 900)
    return draft.finish(), "level", name


def broom(draft: Draft) -> Made:
    """A hand brush."""
    name, colour = any_colour(draft)
    surface_of(draft, "grip", colour)
    draft.paint("hair", pick(draft.rng, (0.15, 0.13, 0.12), (0.8, 0.72, 0.5), (0.25, 0.35, 0.6)))
    part = draft.part()
    add_tube(
        part,
        "grip",
        curve([(0, 0, 0.05), (0.08, 0, 0.05), (0.14, 0, 0.045)], 5),
        np.tile([0.008, 0.013], (11, 1)),
        up=(0, 0, 1),
    )
    add_rounded_box(part, "grip", (0.13, -0.022, 0.035), (0.3, 0.022, 0.055), 0.006)
    add_rounded_box(part, "hair", (0.135, -0.03, 0), (0.31, 0.03, 0.037), 0.006)
    draft.solid(part, 500)
    return draft.finish(), "hand brush", name


def pipe(draft: Draft) -> Made:
    """A bent pipe or elbow with flanges."""
    steel(draft)
    r, long, part = between(draft, 0.012, 0.03), between(draft, 0.1, 0.25), draft.part()
    path = curve([(0, 0, 0), (long * 0.7, 0, 0), (long, long * 0.12, 0), (long * 1.08, long * 0.5, 0)], 6)
    add_tube(part, "steel", path, r, sides=18)
    for at, way in ((path[0], (1, 0, 0)), (path[-1], path[-1] - path[-2])):
        step = np.asarray(way) / np.linalg.norm(way) * r * 0.5
        add_tube(part, "steel", [at - step, at + step], [r * 1.35, r * 1.35], sides=18)
    draft.solid(part, 3000)
    return draft.finish(), "pipe", "grey"
