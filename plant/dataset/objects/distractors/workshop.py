"""Distractors from the workshop: tools that are none of the classes."""

from __future__ import annotations

import numpy as np

from plant.dataset.objects.distractors.common import (
    Made,
    any_colour,
    between,
    box,
    steel,
    surface_of,
)
from plant.dataset.objects.draft import STEEL, UP_TO_X, WOOD, Draft, pick, turned
from plant.models.builder.outlines import curve
from plant.models.builder.pictures import wood
from plant.models.builder.surfaces import add_extruded, add_rounded_box, add_tube


def pliers(draft: Draft) -> Made:
    """Pliers: two jaws, a joint and two coated handles."""
    name, colour = any_colour(draft, "red", "blue", "yellow", "black", "orange", "green")
    steel(draft)
    surface_of(draft, "grip", colour)
    long, gap, nose = between(draft, 0.14, 0.22), between(draft, 0.05, 0.22), between(draft, 0.03, 0.075)
    for side in (-1, 1):
        part = draft.part()
        grip = curve(
            [
                (0, 0, 0),
                (-0.02, side * 0.010, 0),
                (-long * 0.4, side * (0.016 + gap * 0.05), 0),
                (-long * 0.75, side * (0.012 + gap * 0.1), 0),
            ],
            6,
        )
        add_tube(part, "grip", grip, np.tile([0.0065, 0.0048], (len(grip), 1)), up=(0, 1, 0))
        jaw = [
            (-0.012, 0),
            (0.0, side * 0.012),
            (nose * 0.5, side * 0.010),
            (nose, side * 0.003),
            (nose, side * 0.0004),
            (0.0, side * 0.0004),
        ]
        add_extruded(part, "steel", jaw, -0.005, 0.005, bevel=0.001)
        draft.solid(part, STEEL * 0.7)
    joint = draft.part()
    joint.add_cylinder("steel", 0.011, (-0.002, 0, -0.0065), 0.013)
    draft.solid(joint, STEEL)
    return draft.finish(), "pliers", name


def scissors(draft: Draft) -> Made:
    """Scissors, a little open."""
    name, colour = any_colour(draft, "red", "orange", "black", "blue")
    steel(draft)
    surface_of(draft, "grip", colour)
    for side in (-1, 1):
        part, blade = draft.part(), draft.part()
        add_extruded(
            blade,
            "steel",
            [(-0.02, -0.006), (0.085, -0.001), (0.085, 0.0), (-0.02, 0.007)],
            -0.001 + 0.002 * (side > 0),
            0.001 + 0.002 * (side > 0),
        )
        ring = np.stack(
            [
                (a := np.linspace(0, 2 * np.pi, 19)) * 0 - 0.06 + 0.027 * np.cos(a),
                -side * 0.018 + 0.016 * np.sin(a),
                0 * a,
            ],
            axis=1,
        )
        add_tube(part, "grip", ring, 0.005, sides=8, caps=False)
        add_tube(part, "grip", [(-0.036, -side * 0.012, 0), (-0.012, 0, 0)], [0.005, 0.004], sides=8)
        part.add_mesh(blade, turned("z", side * 0.12))
        draft.solid(part, 3000)
    return draft.finish(), "scissors", name


def drill(draft: Draft) -> Made:
    """A cordless drill."""
    name, colour = any_colour(draft, "yellow", "green", "blue", "red", "teal", "orange")
    surface_of(draft, "case", colour)
    surface_of(draft, "dark", (0.1, 0.1, 0.11))
    steel(draft)
    s = between(draft, 0.85, 1.15)
    part = draft.part()
    add_tube(
        part,
        "case",
        [(-0.09 * s, 0, 0.2 * s), (-0.085 * s, 0, 0.2 * s), (0.05 * s, 0, 0.2 * s), (0.06 * s, 0, 0.2 * s)],
        np.array([0.02, 0.034, 0.032, 0.024]) * s,
        sides=20,
    )
    add_tube(
        part,
        "dark",
        [(0.06 * s, 0, 0.2 * s), (0.08 * s, 0, 0.2 * s), (0.11 * s, 0, 0.2 * s)],
        np.array([0.022, 0.021, 0.012]) * s,
    )
    add_tube(part, "steel", [(0.11 * s, 0, 0.2 * s), (0.17 * s, 0, 0.2 * s)], np.array([0.004, 0.003]) * s)
    add_tube(
        part,
        "dark",
        [(-0.03 * s, 0, 0.18 * s), (-0.045 * s, 0, 0.05 * s)],
        np.array([[0.024, 0.018], [0.026, 0.018]]) * s,
        up=(1, 0, 0),
    )
    draft.solid(part, 900)
    box(
        draft,
        "case" if draft.rng.random() < 0.5 else "dark",
        np.array([-0.09, -0.035, 0]) * s,
        np.array([0.02, 0.035, 0.05]) * s,
        radius=0.008,
        density=1200,
    )
    return draft.finish(), "drill", name


def hand_saw(draft: Draft) -> Made:
    """A saw, lying."""
    steel(draft)
    name, colour = any_colour(draft, "red", "yellow", "black", "brown", "orange")
    surface_of(draft, "grip", colour)
    long, part = between(draft, 0.3, 0.5), draft.part()
    teeth = [(long - k * long / 30, -0.06 + 0.004 * (k % 2) + 0.03 * (1 - k / 30)) for k in range(31)]
    add_extruded(part, "steel", [(0, 0.05), *teeth[::-1], (long, 0.0)], -0.0008, 0.0008)
    draft.solid(part, STEEL)
    grip = draft.part()
    ring = np.stack(
        [-0.03 + 0.045 * np.cos(a := np.linspace(0, 2 * np.pi, 25)), -0.01 + 0.055 * np.sin(a), 0 * a], axis=1
    )
    add_tube(grip, "grip", ring, np.tile([0.012, 0.014], (25, 1)), caps=False, up=(0, 0, 1))
    draft.solid(grip, WOOD)
    return draft.finish(), "saw", name


def chisel(draft: Draft) -> Made:
    """A chisel: a flat broad blade, so no screwdriver."""
    name, colour = any_colour(draft, "yellow", "red", "brown", "black", "blue")
    surface_of(draft, "grip", colour)
    steel(draft)
    r, h, wide = between(draft, 0.012, 0.016), between(draft, 0.1, 0.13), between(draft, 0.006, 0.018)
    part = draft.part()
    part.add_lathe(
        "grip", [(0, 0), (r * 0.9, 0), (r, 0.01), (r * 0.85, h * 0.6), (r, h * 0.9), (r * 0.6, h), (0, h)], sides=20
    )
    draft.solid(part, WOOD, UP_TO_X)
    blade = draft.part()
    add_extruded(
        blade,
        "steel",
        [(h, -0.004), (h + 0.03, -wide), (h + 0.14, -wide), (h + 0.14, wide), (h + 0.03, wide), (h, 0.004)],
        -0.002,
        0.002,
    )
    draft.solid(blade, STEEL)
    return draft.finish(), "chisel", name


def paint_brush(draft: Draft) -> Made:
    """A flat brush."""
    draft.picture(
        "wood", wood(draft.rng, (64, 128), tuple(any_colour(draft, "brown", "red", "yellow", "white")[1]), 0.07)
    )
    steel(draft)
    draft.paint("hair", pick(draft.rng, (0.2, 0.16, 0.12), (0.85, 0.78, 0.6), (0.1, 0.1, 0.1)))
    wide, part = between(draft, 0.015, 0.045), draft.part()
    path = curve([(0, 0, 0), (0.06, 0, 0), (0.12, 0, 0), (0.15, 0, 0)], 5)
    widths = np.interp(np.linspace(0, 1, len(path)), [0, 0.5, 0.8, 1], [0.009, 0.012, 0.01, wide])
    add_tube(part, "wood", path, np.column_stack([widths, np.full(len(path), 0.007)]), up=(0, 1, 0))
    add_rounded_box(part, "steel", (0.145, -wide, -0.008), (0.19, wide, 0.008), 0.003)
    add_rounded_box(part, "hair", (0.185, -wide * 0.97, -0.0065), (0.25, wide * 0.97, 0.0065), 0.005)
    draft.solid(part, WOOD)
    return draft.finish(), "paint brush", "brown"


def crowbar(draft: Draft) -> Made:
    """A crowbar."""
    name, colour = any_colour(draft, "black", "red", "blue", "grey", "yellow")
    surface_of(draft, "steel", colour, metal=0.3)
    long = between(draft, 0.3, 0.7)
    path = curve(
        [
            (0, 0, 0),
            (long * 0.5, 0, 0),
            (long * 0.9, 0, 0),
            (long, 0.03, 0),
            (long * 0.97, 0.07, 0),
            (long * 0.9, 0.085, 0),
        ],
        6,
    )
    part = draft.part()
    add_tube(
        part,
        "steel",
        path,
        np.interp(np.linspace(0, 1, len(path)), [0, 0.06, 0.9, 1], [0.004, 0.009, 0.009, 0.004]),
        sides=6,
    )
    draft.solid(part, STEEL)
    return draft.finish(), "crowbar", name


def nut_and_bolt(draft: Draft) -> Made:
    """A large bolt with its nut."""
    steel(draft)
    r, long = between(draft, 0.006, 0.014), between(draft, 0.05, 0.14)
    part = draft.part()
    part.add_lathe("steel", [(0, 0), (r * 1.8, 0), (r * 1.8, r * 1.2), (0, r * 1.2)], sides=6)
    part.add_lathe("steel", [(0, r * 1.2), (r, r * 1.2), (r, long), (0, long)], sides=18)
    part.add_lathe(
        "steel",
        [(0, long * 0.7), (r * 1.8, long * 0.7), (r * 1.8, long * 0.7 + r * 1.4), (0, long * 0.7 + r * 1.4)],
        sides=6,
    )
    draft.solid(part, STEEL, UP_TO_X)
    return draft.finish(), "bolt", "silver"


def knife(draft: Draft) -> Made:
    """A cutter or a kitchen knife."""
    name, colour = any_colour(draft, "yellow", "black", "red", "brown", "orange")
    surface_of(draft, "grip", colour)
    draft.paint("steel", (0.72, 0.73, 0.75), shine=0.8, metal=1.0)
    long, part = between(draft, 0.06, 0.2), draft.part()
    add_rounded_box(part, "grip", (-0.12, -0.012, -0.007), (0.0, 0.012, 0.007), 0.005)
    add_extruded(
        part, "steel", [(-0.002, -0.01), (long * 0.75, -0.012), (long, 0.008), (-0.002, 0.01)], -0.0008, 0.0008
    )
    draft.solid(part, 1500)
    return draft.finish(), "knife", name
