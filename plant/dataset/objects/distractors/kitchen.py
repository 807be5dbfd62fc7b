"""Distractors from the kitchen: dishes and appliances."""

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
from plant.dataset.objects.draft import CERAMIC, GLASS, PLASTIC, STEEL, Draft, pick, shade
from plant.models.builder.outlines import curve
from plant.models.builder.surfaces import add_ellipsoid, add_tube


def mug(draft: Draft) -> Made:
    """A mug with a handle."""
    name, colour = any_colour(draft)
    surface_of(draft, "glaze", colour, shine=0.7)
    if draft.rng.random() < 0.4:
        draft.picture("glaze", print_on(draft, colour, words=("coffee", "tea", "hello")), shine=0.7)
    draft.paint("inside", shade(draft.rng, (0.9, 0.9, 0.88)), shine=0.7)
    r, h = between(draft, 0.036, 0.046), between(draft, 0.08, 0.11)
    turn(draft, "glaze", [(r * 0.9, 0), (r, 0.01), (r * between(draft, 0.95, 1.08), h)], shell=CERAMIC * 0.004)
    turn(draft, "inside", [(0, 0.004), (r * 0.9, 0.005), (r * 0.94, h * 0.95), (r, h)][::-1], shell=CERAMIC * 0.0005)
    handle = draft.part()
    path = curve(
        [(r * 0.97, 0, h * 0.82), (r + 0.026, 0, h * 0.75), (r + 0.028, 0, h * 0.35), (r * 0.97, 0, h * 0.22)], 6
    )
    add_tube(handle, "glaze", path, 0.006)
    draft.solid(handle, CERAMIC)
    draft.collide_upright(r, 0, h)
    return draft.finish(), "mug", name


def paper_cup(draft: Draft) -> Made:
    """A coffee cup of paper with a lid."""
    name, colour = any_colour(draft, "white", "brown", "cream", "green", "red")
    draft.picture("side", print_on(draft, colour, words=("coffee", "hot", "to go")))
    draft.paint("lid", pick(draft.rng, (0.95, 0.95, 0.94), (0.1, 0.1, 0.1), (0.35, 0.22, 0.14)))
    r, h = between(draft, 0.028, 0.033), between(draft, 0.09, 0.15)
    turn(draft, "side", [(r, 0), (r * 1.35, h)], shell=0.35)
    turn(draft, "lid", [(0, 0.001), (r, 0)], shell=0.3)
    turn(draft, "lid", [(r * 1.4, h - 0.004), (r * 1.4, h + 0.004), (r * 1.25, h + 0.012), (0, h + 0.010)], shell=0.3)
    return draft.finish(), "paper cup", name


def glass(draft: Draft) -> Made:
    """A drinking glass, light and greyish."""
    draft.paint("glass", shade(draft.rng, (0.78, 0.85, 0.87)), shine=0.95)
    draft.paint("drink", pick(draft.rng, (0.7, 0.78, 0.8), (0.92, 0.6, 0.1), (0.85, 0.85, 0.82)), shine=0.8)
    r, h = between(draft, 0.028, 0.042), between(draft, 0.08, 0.16)
    turn(draft, "glass", [(0, 0), (r * 0.9, 0), (r, h)], shell=GLASS * 0.003)
    turn(draft, "drink", [(r * 0.97, h * 0.7), (0, h * 0.7)], shell=0.1)
    return draft.finish(), "glass", "clear"


def bowl(draft: Draft) -> Made:
    """A bowl."""
    name, colour = any_colour(draft)
    surface_of(draft, "glaze", colour, shine=0.7)
    r = between(draft, 0.06, 0.13)
    h = r * between(draft, 0.4, 0.8)
    turn(
        draft,
        "glaze",
        [(r * 0.45, 0), (r * 0.5, 0.005), (r * 0.85, 0.5 * h), (r, h)],
        smooth=True,
        shell=CERAMIC * 0.004,
    )
    turn(
        draft,
        "glaze",
        [(r * 0.98, h), (r * 0.8, 0.5 * h), (r * 0.45, 0.012), (0, 0.01)],
        smooth=True,
        shell=CERAMIC * 0.001,
    )
    return draft.finish(), "bowl", name


def plate(draft: Draft) -> Made:
    """A plate."""
    name, colour = any_colour(draft, "white", "cream", "blue", "teal", "grey")
    surface_of(draft, "glaze", colour, shine=0.7)
    r = between(draft, 0.08, 0.14)
    turn(
        draft,
        "glaze",
        [(0, 0), (r * 0.6, 0), (r, 0.018), (r, 0.021), (r * 0.62, 0.005), (0, 0.004)],
        shell=CERAMIC * 0.003,
    )
    return draft.finish(), "plate", name


def pot(draft: Draft) -> Made:
    """A cooking pot with two handles and a lid."""
    name, colour = any_colour(draft, "grey", "red", "black", "blue", "white")
    surface_of(draft, "pot", colour, shine=0.65, metal=float(name == "grey"))
    draft.paint("grip", (0.08, 0.08, 0.08))
    r, h = between(draft, 0.08, 0.14), between(draft, 0.08, 0.18)
    turn(
        draft,
        "pot",
        [(0, 0), (r * 0.95, 0), (r, 0.01), (r, h), (r * 1.03, h), (r * 0.9, h + 0.012), (0, h + 0.025)],
        shell=STEEL * 0.001,
    )
    for sign in (-1, 1):
        part = draft.part()
        add_tube(
            part,
            "grip",
            curve([(sign * r, -0.04, h * 0.8), (sign * (r + 0.03), 0, h * 0.82), (sign * r, 0.04, h * 0.8)], 6),
            0.006,
        )
        draft.solid(part, PLASTIC)
    turn(draft, "grip", [(0, h + 0.02), (0.012, h + 0.025), (0.018, h + 0.04), (0, h + 0.045)])
    return draft.finish(), "pot", name


def pan(draft: Draft) -> Made:
    """A frying pan."""
    surface_of(draft, "iron", (0.10, 0.10, 0.11), shine=0.4)
    r, long = between(draft, 0.10, 0.15), between(draft, 0.15, 0.2)
    turn(
        draft,
        "iron",
        [(0, 0), (r * 0.8, 0), (r, 0.04), (r * 0.99, 0.042), (r * 0.79, 0.004), (0, 0.004)],
        shell=STEEL * 0.0012,
    )
    part = draft.part()
    surface_of(draft, "grip", any_colour(draft, "black", "red", "brown")[1])
    add_tube(
        part,
        "grip",
        curve([(r * 0.97, 0, 0.034), (r + 0.05, 0, 0.045), (r + long, 0, 0.055)], 5),
        np.tile([0.007, 0.012], (11, 1)),
        up=(0, 0, 1),
    )
    draft.solid(part, PLASTIC)
    return draft.finish(), "pan", "black"


def kettle(draft: Draft) -> Made:
    """An electric kettle."""
    name, colour = any_colour(draft, "grey", "white", "black", "red")
    surface_of(draft, "body", colour, shine=0.6, metal=float(name == "grey"))
    draft.paint("trim", (0.1, 0.1, 0.11))
    r, h = between(draft, 0.07, 0.085), between(draft, 0.17, 0.22)
    turn(draft, "trim", [(0, 0), (r * 1.05, 0), (r * 1.05, 0.02), (r, 0.025)], density=600)
    turn(draft, "body", [(r, 0.025), (r * 0.98, 0.4 * h), (r * 0.75, 0.92 * h)], density=500)
    turn(
        draft, "trim", [(r * 0.75, 0.92 * h), (r * 0.7, h), (0.015, h), (0.012, h + 0.015), (0, h + 0.015)], density=500
    )
    part = draft.part()
    add_tube(
        part,
        "trim",
        curve([(r * 0.7, 0, 0.95 * h), (r + 0.045, 0, 0.9 * h), (r + 0.04, 0, 0.3 * h), (r, 0, 0.15 * h)], 6),
        0.011,
    )
    add_tube(part, "body", [(-r * 0.7, 0, 0.7 * h), (-r - 0.02, 0, 0.9 * h)], [0.02, 0.012])
    draft.solid(part, PLASTIC)
    return draft.finish(), "kettle", name


def toaster(draft: Draft) -> Made:
    """A toaster with two slots."""
    name, colour = any_colour(draft, "grey", "white", "black", "red", "teal")
    surface_of(draft, "body", colour, shine=0.6)
    draft.paint("slot", (0.05, 0.05, 0.05))
    w, d, h = between(draft, 0.25, 0.3), between(draft, 0.15, 0.18), between(draft, 0.17, 0.2)
    box(draft, "body", (-w / 2, -d / 2, 0), (w / 2, d / 2, h), radius=0.03, density=250)
    for y in (-0.03, 0.03):
        box(
            draft,
            "slot",
            (-w * 0.33, y - 0.012, h - 0.002),
            (w * 0.33, y + 0.012, h + 0.001),
            radius=0.0005,
            density=10,
        )
    box(draft, "slot", (w / 2, -0.015, 0.1), (w / 2 + 0.02, 0.015, 0.115), density=500)
    return draft.finish(), "toaster", name


def cutlery(draft: Draft) -> Made:
    """A spoon or a fork."""
    draft.paint("steel", shade(draft.rng, (0.72, 0.73, 0.75)), shine=0.85, metal=1.0)
    long, part = between(draft, 0.15, 0.21), draft.part()
    add_tube(
        part,
        "steel",
        curve([(0, 0, 0.006), (long * 0.4, 0, 0.003), (long * 0.7, 0, 0.006)], 5),
        np.column_stack([np.full(11, 0.0012), np.linspace(0.009, 0.004, 11)]),
        up=(0, 0, 1),
    )
    kind = "fork" if draft.rng.random() < 0.5 else "spoon"
    if kind == "spoon":
        add_ellipsoid(part, "steel", (long * 0.83, 0, 0.005), (long * 0.16, 0.02, 0.003))
    else:
        add_ellipsoid(part, "steel", (long * 0.76, 0, 0.005), (long * 0.09, 0.012, 0.002))
        for y in (-0.009, -0.003, 0.003, 0.009):
            add_tube(part, "steel", [(long * 0.78, y, 0.005), (long, y, 0.004)], [0.0016, 0.001])
    draft.solid(part, STEEL)
    return draft.finish(), kind, "silver"
