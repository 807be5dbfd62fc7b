"""Distractors from living rooms, bedrooms and bathrooms."""

from __future__ import annotations

import numpy as np

from plant.dataset.objects.distractors.common import (
    Made,
    any_colour,
    between,
    box,
    print_on,
    printed_box,
    surface_of,
    turn,
)
from plant.dataset.objects.draft import CERAMIC, PLASTIC, Draft, pick, shade, turned
from plant.dataset.objects.wear import plain
from plant.models.builder.outlines import curve
from plant.models.builder.pictures import cloth, noise
from plant.models.builder.surfaces import add_ellipsoid, add_extruded, add_rounded_box, add_tube


def vase(draft: Draft) -> Made:
    """A vase, often with a waist."""
    name, colour = any_colour(draft)
    surface_of(draft, "glaze", colour, shine=0.7)
    r, h = between(draft, 0.04, 0.09), between(draft, 0.14, 0.36)
    w = [between(draft, 0.4, 1.0) for _ in range(4)]
    turn(
        draft,
        "glaze",
        [
            (0, 0),
            (r * 0.6, 0.001),
            (r * w[0], 0.2 * h),
            (r, 0.45 * h),
            (r * w[1], 0.7 * h),
            (r * 0.4 * w[2] + 0.01, 0.9 * h),
            (r * 0.6 * w[3] + 0.01, h),
        ],
        smooth=True,
        shell=CERAMIC * 0.006,
    )
    return draft.finish(), "vase", name


def potted_plant(draft: Draft) -> Made:
    """Leaves of one form about a pot."""
    surface_of(draft, "pot", any_colour(draft, "white", "brown", "orange", "grey", "teal")[1])
    leaf = shade(draft.rng, pick(draft.rng, (0.16, 0.42, 0.14), (0.30, 0.50, 0.18), (0.10, 0.32, 0.18)), 0.1)
    draft.picture("leaf", plain(leaf) * (1 + 0.15 * noise(draft.rng, (128, 128), (3, 20)))[..., None])
    draft.paint("soil", (0.16, 0.11, 0.07))
    r, h = between(draft, 0.05, 0.14), between(draft, 0.08, 0.22)
    turn(draft, "pot", [(0, 0), (r * 0.75, 0), (r, h), (r * 0.92, h), (r * 0.9, h - 0.015)], density=900)
    turn(draft, "soil", [(r * 0.9, h - 0.015), (0, h - 0.01)], shell=1.0)
    part, high = draft.part(), between(draft, 1.2, 4.0) * h
    for _ in range(int(draft.rng.integers(10, 26))):
        angle, rise, spread = between(draft, 0, 6.3), between(draft, 0.3, 1.0) * high, between(draft, 0.3, 1.6) * r
        tip = np.array([spread * np.cos(angle), spread * np.sin(angle), h + rise])
        path = curve([(0, 0, h - 0.01), tuple(tip * [0.4, 0.4, 0.9]), tuple(tip)], 5)
        wide = np.interp(
            np.linspace(0, 1, len(path)), [0, 0.4, 0.7, 1], [0.002, 0.004, between(draft, 0.012, 0.04), 0.002]
        )
        add_tube(
            part,
            "leaf",
            path,
            np.column_stack([np.full(len(path), 0.0015), wide]),
            sides=8,
            up=(np.cos(angle), np.sin(angle), 0.3),
        )
    draft.shell(part, 0.2)
    draft.collide_upright(r, 0, h)
    return draft.finish(), "potted plant", "green"


def cactus(draft: Draft) -> Made:
    """A small cactus in a pot."""
    surface_of(draft, "pot", any_colour(draft, "white", "brown", "orange", "pink")[1])
    draft.picture("green", plain((0.2, 0.42, 0.2)) * (1 + 0.2 * np.sin(np.arange(128) * 0.8))[None, :, None], shine=0.2)
    r = between(draft, 0.03, 0.06)
    turn(draft, "pot", [(0, 0), (r * 0.8, 0), (r, r * 1.4), (0, r * 1.35)], density=1200)
    part = draft.part()
    add_ellipsoid(
        part,
        "green",
        (0, 0, r * between(draft, 1.9, 2.6)),
        (r * 0.75, r * 0.75, r * between(draft, 0.9, 1.6)),
        sides=24,
    )
    draft.solid(part, 900)
    return draft.finish(), "cactus", "green"


def cushion(draft: Draft) -> Made:
    """A cushion."""
    name, colour = any_colour(draft)
    draft.picture("cloth", cloth(draft.rng, (128, 128), tuple(colour), 0.12), shine=0.0)
    part, w = draft.part(), between(draft, 0.17, 0.25)
    add_rounded_box(part, "cloth", (-w, -w, 0), (w, w, w * 0.5), w * 0.24)
    draft.solid(part, 60)
    return draft.finish(), "cushion", name


def shoe(draft: Draft) -> Made:
    """A single shoe."""
    name, colour = any_colour(draft)
    surface_of(draft, "upper", colour)
    draft.paint("sole", pick(draft.rng, (0.92, 0.92, 0.9), (0.1, 0.1, 0.1), (0.5, 0.35, 0.2)))
    draft.paint("inside", (0.15, 0.13, 0.12))
    long, part = between(draft, 0.24, 0.30), draft.part()
    path = [
        (-long / 2, 0, 0.05),
        (-long * 0.42, 0, 0.055),
        (-long * 0.1, 0, 0.05),
        (long * 0.2, 0, 0.036),
        (long * 0.42, 0, 0.03),
        (long / 2, 0, 0.025),
    ]
    tall, wide = [0.01, 0.045, 0.045, 0.033, 0.024, 0.006], [0.01, 0.033, 0.036, 0.045, 0.04, 0.008]
    add_tube(part, "upper", path, np.column_stack([tall, wide]), sides=20, up=(0, 0, 1))
    add_ellipsoid(part, "inside", (-long * 0.25, 0, 0.075), (long * 0.17, 0.027, 0.027))
    outline = (
        np.array(
            [
                (-0.5, -0.11),
                (-0.3, -0.12),
                (0.0, -0.12),
                (0.3, -0.16),
                (0.45, -0.1),
                (0.5, 0),
                (0.45, 0.1),
                (0.3, 0.16),
                (0.0, 0.12),
                (-0.3, 0.12),
                (-0.5, 0.11),
            ]
        )
        * long
    )
    add_extruded(part, "sole", outline, 0.0, 0.022, bevel=0.004)
    draft.solid(part, 300)
    return draft.finish(), "shoe", name


def boot(draft: Draft) -> Made:
    """A work or rubber boot."""
    name, colour = any_colour(draft, "black", "brown", "green", "yellow")
    surface_of(draft, "upper", colour)
    draft.paint("sole", (0.12, 0.11, 0.1))
    h, part = between(draft, 0.2, 0.36), draft.part()
    add_tube(part, "upper", [(-0.06, 0, 0.03), (-0.06, 0, 0.12), (-0.065, 0, h)], [0.045, 0.045, 0.06], sides=20)
    add_tube(
        part,
        "upper",
        [(-0.1, 0, 0.05), (0, 0, 0.05), (0.12, 0, 0.04), (0.17, 0, 0.03)],
        np.array([[0.04, 0.04], [0.045, 0.045], [0.038, 0.048], [0.01, 0.02]]),
        sides=20,
        up=(0, 0, 1),
    )
    add_rounded_box(part, "sole", (-0.11, -0.045, 0), (0.17, 0.045, 0.025), 0.01)
    draft.solid(part, 350)
    return draft.finish(), "boot", name


def ball(draft: Draft) -> Made:
    """A toy ball, a tennis ball or a football."""
    name, colour = any_colour(draft)
    _, second = any_colour(draft)
    image = plain(colour)
    if draft.rng.random() < 0.6:
        image[(np.indices((128, 128))[1] // int(draft.rng.integers(8, 33))) % 2 == 0] = second
    draft.picture("skin", image)
    r, part = between(draft, 0.03, 0.12), draft.part()
    add_ellipsoid(part, "skin", (0, 0, r), (r, r, r), turned("x", between(draft, 0, 3)), sides=32)
    draft.solid(part, 120)
    return draft.finish(), "ball", name


def teddy(draft: Draft) -> Made:
    """A teddy bear that sits."""
    fur = shade(draft.rng, pick(draft.rng, (0.55, 0.36, 0.2), (0.75, 0.6, 0.42), (0.85, 0.83, 0.8), (0.35, 0.24, 0.17)))
    draft.picture("fur", cloth(draft.rng, (96, 96), tuple(fur), 0.2), shine=0.0)
    draft.paint("eye", (0.05, 0.05, 0.05), shine=0.8)
    s, part = between(draft, 0.6, 1.3), draft.part()
    for centre, radii in (
        ((0, 0, 0.09), (0.07, 0.075, 0.09)),
        ((0, 0, 0.22), (0.06, 0.065, 0.06)),
        ((0.05, 0, 0.205), (0.03, 0.03, 0.026)),
    ):
        add_ellipsoid(part, "fur", np.array(centre) * s, np.array(radii) * s)
    for y in (-1, 1):
        add_ellipsoid(part, "fur", np.array([0, 0.05 * y, 0.275]) * s, np.array([0.014, 0.024, 0.024]) * s)
        add_ellipsoid(part, "fur", np.array([0.1, 0.055 * y, 0.035]) * s, np.array([0.08, 0.03, 0.033]) * s)
        add_ellipsoid(
            part, "fur", np.array([0.045, 0.085 * y, 0.13]) * s, np.array([0.065, 0.025, 0.028]) * s, turned("y", 0.5)
        )
        add_ellipsoid(part, "eye", np.array([0.055, 0.025 * y, 0.235]) * s, np.array([0.006, 0.006, 0.006]) * s)
    add_ellipsoid(part, "eye", np.array([0.08, 0, 0.212]) * s, np.array([0.008, 0.011, 0.008]) * s)
    draft.solid(part, 90)
    return draft.finish(), "teddy bear", "brown"


def toy_car(draft: Draft) -> Made:
    """A toy car."""
    name, colour = any_colour(draft, "red", "blue", "green", "yellow", "white", "orange")
    surface_of(draft, "body", colour, shine=0.7)
    draft.paint("dark", (0.07, 0.07, 0.08))
    s, part = between(draft, 0.5, 1.4), draft.part()
    side = (
        np.array(
            [
                (-0.09, 0.015),
                (0.09, 0.015),
                (0.09, 0.04),
                (0.045, 0.045),
                (0.02, 0.07),
                (-0.045, 0.07),
                (-0.07, 0.045),
                (-0.09, 0.042),
            ]
        )
        * s
    )
    add_extruded(part, "body", side, -0.035 * s, 0.035 * s, bevel=0.004 * s)
    whole = draft.part()
    whole.add_mesh(part, [[1, 0, 0], [0, 0, -1], [0, 1, 0]])
    for x in (-0.055, 0.055):
        for y in (-0.034, 0.034):
            add_tube(
                whole,
                "dark",
                [(x * s, (y - 0.008) * s, 0.018 * s), (x * s, (y + 0.008) * s, 0.018 * s)],
                [0.018 * s, 0.018 * s],
                sides=18,
            )
    whole.add_box("dark", np.array([-0.042, -0.0353, 0.048]) * s, np.array([0.018, 0.0353, 0.064]) * s)
    draft.solid(whole, 500)
    return draft.finish(), "toy car", name


def candle(draft: Draft) -> Made:
    """A candle on a small plate."""
    name, colour = any_colour(draft, "white", "cream", "red", "pink", "green")
    draft.paint("wax", colour, shine=0.4)
    draft.paint("wick", (0.1, 0.08, 0.07))
    draft.paint("dish", shade(draft.rng, (0.6, 0.6, 0.6)), shine=0.6)
    r, h = between(draft, 0.010, 0.02), between(draft, 0.1, 0.24)
    turn(draft, "dish", [(0, 0), (r * 3, 0.002), (r * 3.6, 0.012), (r, 0.006)], density=2000)
    turn(draft, "wax", [(r, 0.006), (r * 0.95, h), (r * 0.5, h + 0.004), (0, h - 0.002)], density=900)
    turn(draft, "wick", [(0.0012, h - 0.002), (0.001, h + 0.012), (0, h + 0.012)], density=500)
    return draft.finish(), "candle", name


def soap_dispenser(draft: Draft) -> Made:
    """A bottle with a pump."""
    name, colour = any_colour(draft)
    draft.picture("label", print_on(draft, colour, words=("SOAP", "CREAM", "ALOE", "HANDS")))
    surface_of(draft, "body", colour)
    draft.paint("pump", pick(draft.rng, (0.95, 0.95, 0.95), (0.1, 0.1, 0.1), (0.75, 0.76, 0.78)))
    r, h = between(draft, 0.026, 0.04), between(draft, 0.12, 0.18)
    turn(draft, "body", [(0, 0), (r * 0.95, 0), (r, 0.01), (r, 0.2 * h)])
    turn(draft, "label", [(r, 0.2 * h), (r, 0.7 * h)])
    turn(draft, "body", [(r, 0.7 * h), (r * 0.9, 0.85 * h), (0.015, h)])
    turn(
        draft,
        "pump",
        [
            (0.017, h),
            (0.017, h + 0.015),
            (0.005, h + 0.017),
            (0.005, h + 0.045),
            (0.014, h + 0.047),
            (0.014, h + 0.06),
            (0, h + 0.06),
        ],
    )
    part = draft.part()
    add_tube(part, "pump", [(0, 0, h + 0.055), (r + 0.015, 0, h + 0.05)], [0.005, 0.004])
    draft.solid(part, PLASTIC)
    return draft.finish(), "soap dispenser", name


def detergent(draft: Draft) -> Made:
    """A flat bottle of cleaner with a handle or a spray head."""
    name, colour = any_colour(draft, "blue", "green", "white", "orange", "yellow", "pink")
    draft.picture(
        "front", print_on(draft, colour, words=("CLEAN", "FRESH", "OXI", "BATH"), shape=(256, 192), repeats=1)
    )
    surface_of(draft, "body", colour)
    draft.paint("cap", any_colour(draft, "red", "white", "blue", "green")[1])
    w, h = between(draft, 0.06, 0.10), between(draft, 0.17, 0.26)
    part = draft.part()
    sides: dict[str, str | None] = {"-x": "front", "+x": "front"}
    add_rounded_box(part, "body", (-0.035, -w, 0), (0.035, w, h), 0.02)
    draft.solid(part, 950)
    label = draft.part()
    label.add_box(
        "front",
        (-0.0355, -w * 0.7, 0.03),
        (0.0355, w * 0.7, h - 0.04),
        faces={**sides, "-y": None, "+y": None, "-z": None, "+z": None},
    )
    draft.look(label)
    turn(draft, "cap", [(0.02, h - 0.002), (0.02, h + 0.035), (0, h + 0.035)])
    if draft.rng.random() < 0.5:
        head = draft.part()
        add_rounded_box(head, "cap", (-0.015, -0.06, h + 0.03), (0.015, 0.03, h + 0.06), 0.008)
        add_tube(head, "cap", curve([(0, -0.03, h + 0.035), (0, -0.045, h + 0.01), (0, -0.04, h - 0.01)], 5), 0.005)
        draft.solid(head, 500)
    return draft.finish(), "detergent", name


def tissue_box(draft: Draft) -> Made:
    """A box of tissues."""
    name, colour = any_colour(draft)
    printed_box(draft, (between(draft, 0.2, 0.25), 0.12, between(draft, 0.06, 0.1)), colour, ("SOFT", "tissues"), 120)
    draft.paint("tissue", (0.97, 0.97, 0.97))
    part = draft.part()
    top = 0.08
    add_tube(
        part,
        "tissue",
        [(0, 0, top - 0.03), (0.005, 0, top + 0.01), (0.02, 0.01, top + 0.05)],
        np.array([[0.008, 0.045], [0.012, 0.04], [0.002, 0.02]]),
        sides=10,
        up=(1, 0, 0),
    )
    draft.look(part)
    return draft.finish(), "tissue box", name


def bag(draft: Draft) -> Made:
    """A rucksack or handbag."""
    name, colour = any_colour(draft)
    draft.picture("cloth", cloth(draft.rng, (128, 128), tuple(colour), 0.1), shine=0.05)
    draft.paint("strap", np.asarray(colour) * 0.5)
    w, d, h = between(draft, 0.12, 0.17), between(draft, 0.06, 0.1), between(draft, 0.26, 0.45)
    box(draft, "cloth", (-d, -w, 0), (d, w, h), radius=0.05, density=120)
    box(draft, "cloth", (d * 0.8, -w * 0.7, 0.02), (d * 1.4, w * 0.7, h * 0.5), radius=0.025, density=120)
    part = draft.part()
    for y in (-0.06, 0.06):
        add_tube(
            part,
            "strap",
            curve([(-d, y, h * 0.9), (-d - 0.06, y, h * 0.6), (-d, y, 0.08)], 6),
            np.tile([0.004, 0.018], (13, 1)),
            up=(1, 0, 0),
        )
    add_tube(part, "strap", curve([(0, -0.04, h - 0.01), (0, 0, h + 0.05), (0, 0.04, h - 0.01)], 6), 0.008)
    draft.solid(part, 300)
    return draft.finish(), "bag", name


def basket(draft: Draft) -> Made:
    """A waste-paper basket or a bin with a lid."""
    name, colour = any_colour(draft, "black", "grey", "white", "blue", "green", "brown")
    surface_of(draft, "wall", colour)
    draft.paint("inside", np.asarray(colour) * 0.35)
    r, h = between(draft, 0.10, 0.17), between(draft, 0.25, 0.5)
    turn(draft, "wall", [(0, 0), (r * 0.8, 0), (r, h), (r * 1.03, h), (r * 1.03, h - 0.012)], shell=2.0)
    if draft.rng.random() < 0.4:
        turn(draft, "wall", [(r, h), (r * 0.8, h + 0.06), (0, h + 0.09)], shell=1.5)
    else:
        turn(draft, "inside", [(r * 0.98, h), (r * 0.85, h * 0.25), (0, h * 0.25)], shell=0.5)
    return draft.finish(), "bin", name


def umbrella(draft: Draft) -> Made:
    """A folded umbrella, lying."""
    name, colour = any_colour(draft)
    draft.picture("cloth", cloth(draft.rng, (64, 128), tuple(colour), 0.12))
    surface_of(draft, "grip", any_colour(draft, "brown", "black")[1])
    part, long = draft.part(), between(draft, 0.25, 0.85)
    add_tube(
        part,
        "cloth",
        [(0, 0, 0), (long * 0.1, 0, 0), (long * 0.7, 0, 0), (long, 0, 0)],
        [0.02, 0.03, 0.018, 0.004],
        sides=12,
    )
    add_tube(part, "grip", curve([(0.01, 0, 0), (-0.06, 0, 0), (-0.1, 0.03, 0), (-0.08, 0.06, 0)], 6), 0.009)
    draft.solid(part, 400)
    return draft.finish(), "umbrella", name
