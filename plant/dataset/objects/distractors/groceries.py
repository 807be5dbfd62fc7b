"""Distractors from the shop: packed food, drinks and fruit."""

from __future__ import annotations

import numpy as np

from plant.dataset.objects.containers import Bottle, Can, make_bottle, make_can
from plant.dataset.objects.distractors.common import (
    Made,
    any_colour,
    between,
    print_on,
    printed_box,
    surface_of,
    turn,
)
from plant.dataset.objects.draft import Draft, pick, shade
from plant.models.builder.outlines import curve
from plant.models.builder.surfaces import add_ellipsoid, add_extruded, add_tube


def wine_bottle(draft: Draft) -> Made:
    """0.75 l with high shoulders."""
    name, colour = (("green", (0.05, 0.12, 0.05)), ("black", (0.04, 0.03, 0.03)), ("clear", (0.78, 0.72, 0.5)))[
        int(draft.rng.integers(3))
    ]
    r, h = between(draft, 0.036, 0.041), between(draft, 0.29, 0.33)
    outline = (
        (r * 0.95, 0.0),
        (r, 0.008),
        (r, 0.55 * h),
        (r * 0.93, 0.62 * h),
        (0.020, 0.70 * h),
        (0.0145, 0.76 * h),
        (0.0140, h * 0.97),
        (0.0150, h),
    )
    label = print_on(
        draft,
        any_colour(draft, "cream", "white", "black", "red")[1],
        words=("VINO", "Merlot", "Riesling", "1987", "Rosso"),
    )
    foil = tuple(any_colour(draft, "red", "black", "yellow", "purple")[1])
    neck = np.zeros((16, 16, 3)) + np.array(foil)
    done = make_bottle(
        draft,
        Bottle(outline, (0.14 * h, 0.45 * h), (0.80 * h, h), True, True),
        label=label,
        neck=neck,
        glass=colour,
        cap=(foil[0], foil[1], foil[2]),
        wide_cap=False,
    )
    return done, "wine bottle", name


def water_bottle(draft: Draft) -> Made:
    """A clear plastic bottle with a coloured cap."""
    r, h = between(draft, 0.031, 0.045), between(draft, 0.20, 0.33)
    outline = (
        (r * 0.9, 0.0),
        (r, 0.02),
        (r * 0.95, 0.3 * h),
        (r, 0.34 * h),
        (r, 0.62 * h),
        (r * 0.95, 0.68 * h),
        (r * 0.6, 0.85 * h),
        (0.0135, 0.92 * h),
        (0.0135, h),
    )
    name, cap = any_colour(draft, "blue", "white", "green", "teal")
    label = print_on(
        draft, any_colour(draft, "blue", "white", "teal", "green")[1], words=("WATER", "spring", "AQUA", "still")
    )
    done = make_bottle(
        draft,
        Bottle(outline, (0.36 * h, 0.6 * h), None, False, True),
        label=label,
        neck=None,
        glass=(0.74, 0.82, 0.86),
        cap=(cap[0], cap[1], cap[2]),
        wide_cap=True,
    )
    return done, "water bottle", name


def juice_bottle(draft: Draft) -> Made:
    """Orange, apple or multivitamin juice, lemonade."""
    r, h = between(draft, 0.033, 0.046), between(draft, 0.17, 0.28)
    outline = (
        (r * 0.93, 0.0),
        (r, 0.012),
        (r, 0.6 * h),
        (r * 0.8, 0.75 * h),
        (0.021, 0.88 * h),
        (0.019, 0.9 * h),
        (0.019, h),
    )
    drink = pick(
        draft.rng, (0.93, 0.55, 0.06), (0.85, 0.70, 0.20), (0.90, 0.88, 0.30), (0.65, 0.80, 0.25), (0.92, 0.5, 0.55)
    )
    name, cap = any_colour(draft, "orange", "green", "white", "yellow")
    label = print_on(
        draft, any_colour(draft, "orange", "green", "white", "yellow")[1], words=("ORANGE", "JUICE", "LEMON", "APPLE")
    )
    done = make_bottle(
        draft,
        Bottle(outline, (0.15 * h, 0.55 * h), None, True, True),
        label=label,
        neck=None,
        glass=drink,
        cap=(cap[0], cap[1], cap[2]),
        wide_cap=True,
    )
    return done, "juice bottle", name


def sauce_bottle(draft: Draft) -> Made:
    """Ketchup, mustard, oil or vinegar."""
    r, h = between(draft, 0.026, 0.036), between(draft, 0.17, 0.27)
    outline = (
        (r * 0.95, 0.0),
        (r, 0.015),
        (r * 0.97, 0.4 * h),
        (r, 0.6 * h),
        (r * 0.55, 0.8 * h),
        (0.014, 0.9 * h),
        (0.012, h),
    )
    name, body = (
        ("red", (0.68, 0.06, 0.04)),
        ("yellow", (0.92, 0.72, 0.08)),
        ("olive", (0.55, 0.52, 0.10)),
        ("brown", (0.22, 0.10, 0.05)),
    )[int(draft.rng.integers(4))]
    label = print_on(
        draft,
        any_colour(draft, "white", "cream", "green", "yellow")[1],
        words=("KETCHUP", "OIL", "SAUCE", "CHILI", "MUSTARD"),
    )
    done = make_bottle(
        draft,
        Bottle(outline, (0.2 * h, 0.58 * h), None, False, True),
        label=label,
        neck=None,
        glass=body,
        cap=pick(draft.rng, (0.95, 0.95, 0.95), (0.1, 0.4, 0.15), body),
        wide_cap=True,
    )
    return done, "sauce bottle", name


def soda_can(draft: Draft) -> Made:
    """A can of orange, lemon or energy drink: no cola, no beer."""
    name, colour = any_colour(draft, "orange", "green", "blue", "purple", "yellow", "teal", "pink")
    label = print_on(draft, colour, words=("ORANGE", "LEMON", "ENERGY", "ICE TEA", "TONIC", "GRAPE"))
    return make_can(draft, Can.drawn(draft.rng), label), "soda can", name


def food_can(draft: Draft) -> Made:
    """A tin of soup or vegetables with ridges."""
    name, colour = any_colour(draft, "white", "green", "yellow", "red", "blue", "cream")
    draft.picture("label", print_on(draft, colour, words=("SOUP", "BEANS", "TOMATO", "CORN", "PEAS", "TUNA")))
    draft.paint("tin", shade(draft.rng, (0.72, 0.73, 0.75)), shine=0.7, metal=1.0)
    r = between(draft, 0.032, 0.052)
    h = r * between(draft, 0.9, 2.9)
    turn(
        draft,
        "tin",
        [(0, 0.003), (r * 0.92, 0.003), (r * 0.94, 0), (r * 1.02, 0), (r * 1.02, 0.003), (r, 0.005)],
        density=1000,
    )
    turn(draft, "label", [(r, 0.005), (r, h - 0.005)], density=1000)
    turn(
        draft,
        "tin",
        [(r, h - 0.005), (r * 1.02, h - 0.003), (r * 1.02, h), (r * 0.95, h), (r * 0.93, h - 0.003), (0, h - 0.003)],
        density=1000,
    )
    draft.collide_upright(r, 0, h)
    return draft.finish(), "food can", name


def jar(draft: Draft) -> Made:
    """Jam, pickles or coffee in glass, with a lid."""
    filling = pick(
        draft.rng, (0.45, 0.06, 0.08), (0.45, 0.52, 0.15), (0.25, 0.14, 0.07), (0.85, 0.55, 0.10), (0.88, 0.86, 0.76)
    )
    draft.paint("filling", filling, shine=0.8)
    draft.picture(
        "label",
        print_on(draft, any_colour(draft, "white", "cream", "yellow")[1], words=("JAM", "HONEY", "COFFEE", "PICKLES")),
    )
    name, lid = any_colour(draft, "red", "white", "green", "yellow", "black")
    surface_of(draft, "lid", lid, shine=0.5)
    r, h = between(draft, 0.028, 0.05), between(draft, 0.07, 0.16)
    turn(draft, "filling", [(0, 0), (r * 0.95, 0), (r, 0.008), (r, 0.2 * h)], density=1200)
    turn(draft, "label", [(r, 0.2 * h), (r, 0.7 * h)], density=1200)
    turn(draft, "filling", [(r, 0.7 * h), (r, 0.78 * h), (r * 0.85, 0.85 * h)], density=1200)
    turn(draft, "lid", [(0, 0.85 * h), (r * 0.92, 0.85 * h), (r * 0.92, h - 0.002), (r * 0.88, h), (0, h)], density=400)
    return draft.finish(), "jar", name


def carton(draft: Draft) -> Made:
    """A milk or juice carton, with or without a gable."""
    name, colour = any_colour(draft, "white", "blue", "green", "orange", "yellow")
    w, h = between(draft, 0.06, 0.095), between(draft, 0.16, 0.25)
    printed_box(draft, (w, w, h), colour, ("MILK", "JUICE", "OAT", "SOY"), 1000)
    if draft.rng.random() < 0.5:
        part = draft.part()
        roof = [
            (-w / 2, h),
            (w / 2, h),
            (0.002, h + w * 0.4),
            (0.002, h + w * 0.6),
            (-0.002, h + w * 0.6),
            (-0.002, h + w * 0.4),
        ]
        add_extruded(part, "top", roof, -w / 2, w / 2)
        draft.solid(part, 200, [[1, 0, 0], [0, 0, -1], [0, 1, 0]])
    else:
        draft.paint("screw", any_colour(draft, "white", "blue", "green", "red")[1])
        turn(draft, "screw", [(0.014, h), (0.014, h + 0.012), (0, h + 0.012)], density=500)
    return draft.finish(), "carton", name


def cereal_box(draft: Draft) -> Made:
    """A flat box of cereal, tea or biscuits."""
    name, colour = any_colour(draft)
    size = (between(draft, 0.12, 0.22), between(draft, 0.04, 0.075), between(draft, 0.18, 0.31))
    printed_box(draft, size, colour, ("FLAKES", "MUESLI", "RICE", "TEA", "PASTA"), 250)
    return draft.finish(), "cereal box", name


def banana(draft: Draft) -> Made:
    """A banana."""
    surface_of(draft, "peel", shade(draft.rng, (0.92, 0.78, 0.16)), wear=0.4)
    draft.paint("end", (0.25, 0.18, 0.08))
    long = between(draft, 0.15, 0.2)
    path = curve([(-long / 2, 0.03, 0), (-long / 4, 0.005, 0), (0, 0, 0), (long / 4, 0.008, 0), (long / 2, 0.04, 0)], 6)
    part = draft.part()
    add_tube(
        part,
        "peel",
        path,
        np.interp(
            np.linspace(0, 1, len(path)), [0, 0.08, 0.3, 0.7, 0.93, 1], [0.004, 0.010, 0.018, 0.018, 0.011, 0.004]
        ),
    )
    add_tube(part, "end", [path[-1] - [0.004, 0.003, 0], path[-1] + [0.012, 0.012, 0]], [0.0045, 0.004])
    draft.solid(part, 900)
    return draft.finish(), "banana", "yellow"


def fruit(draft: Draft) -> Made:
    """An apple, an orange, a lemon or a tomato."""
    kind, colour, tall = (
        ("apple", (0.72, 0.10, 0.08), 0.9),
        ("apple", (0.50, 0.66, 0.16), 0.9),
        ("orange", (0.93, 0.52, 0.06), 0.96),
        ("lemon", (0.94, 0.85, 0.15), 1.25),
        ("tomato", (0.80, 0.12, 0.06), 0.8),
    )[int(draft.rng.integers(5))]
    surface_of(draft, "skin", shade(draft.rng, colour), shine=0.5, wear=0.1)
    draft.paint("stalk", (0.25, 0.3, 0.1))
    r = between(draft, 0.028, 0.042)
    part = draft.part()
    add_ellipsoid(part, "skin", (0, 0, r * tall), (r, r, r * tall), sides=24)
    draft.solid(part, 900)
    if kind in ("apple", "tomato"):
        stalk = draft.part()
        add_tube(stalk, "stalk", [(0, 0, 1.95 * r * tall), (0.004, 0, 2.3 * r * tall)], [0.0015, 0.002])
        draft.look(stalk)
    return draft.finish(), kind, "red"


def bread(draft: Draft) -> Made:
    """A loaf."""
    surface_of(draft, "crust", shade(draft.rng, (0.66, 0.42, 0.2)), shine=0.1, wear=0.3)
    part = draft.part()
    add_ellipsoid(part, "crust", (0, 0, 0.04), (between(draft, 0.09, 0.15), 0.06, 0.045), sides=28)
    draft.solid(part, 300)
    return draft.finish(), "bread", "brown"
