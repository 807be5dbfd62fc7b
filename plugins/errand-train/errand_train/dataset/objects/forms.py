"""Writes the shipped forms of the classes, made by their recipes: `python -m errand_train.dataset.objects.forms`."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Final

import numpy as np

from errand_make.shapes import Box, Cylinder, Model, Shape
from errand_train.dataset.objects.draft import Draft
from errand_train.dataset.objects.recipes import build, load_recipes
from errand_train.models.__main__ import write_model
from errand_train.models.appearance import Appearance
from plant.models.catalogue import MODELS_FOLDER

FORMS: Final[Mapping[tuple[str, str], int]] = MappingProxyType(
    {
        ("coke", "cola_can"): 6,
        ("coke", "glass_bottle"): 9,
        ("beer", "green_bottle"): 11,
        ("beer", "stubby_bottle"): 18,
        ("hammer", "red_claw"): 11,
        ("hammer", "ball_peen"): 13,
        ("cube", "wooden"): 4,
        ("cube", "green"): 6,
        ("extinguisher", "powder"): 8,
        ("extinguisher", "carbon_dioxide"): 13,
        ("extinguisher", "water"): 6,
        ("screwdriver", "yellow"): 0,
        ("screwdriver", "red"): 14,
        ("screwdriver", "green"): 21,
        ("wrench", "open_ended"): 3,
        ("wrench", "pipe"): 0,
        ("wrench", "adjustable"): 17,
        ("cylinder", "orange"): 3,
        ("cylinder", "green"): 11,
        ("cylinder", "striped"): 5,
    }
)
"""Number of the instance of each form, by class and name of the form."""

TOOLS: Final = frozenset({"hammer", "screwdriver", "wrench"})
"""Classes without cylinders: Drake mistakes how deep a box swallows a thin disc, and the contact flings the tool."""


def write_forms(folder: Path) -> None:
    """Writes each form into `CLASS/FORM` below a folder. The same sources give the same bytes."""
    recipes = {**load_recipes("classes"), **load_recipes("shipped_forms")}
    for (category, form), number in FORMS.items():
        draft = Draft(np.random.default_rng([number, *category.encode()]))
        made, kind, _ = build(category, recipes[category], draft)
        shapes = tuple(_without_discs(made.collisions)) if category in TOOLS else made.collisions
        model = Model(category, f"{category}.obj", shapes, made.mass, comment=f"{kind} {category}")
        write_model(folder / category / form, model, Appearance(made.mesh, made.pictures))


def _without_discs(shapes: Sequence[Shape]) -> Iterator[Shape]:
    """Yields the shapes, with two boxes in each upright cylinder, one turned by 45 degrees."""
    for shape in shapes:
        if not isinstance(shape, Cylinder):
            yield shape
            continue
        side_m, (roll, pitch, yaw) = math.sqrt(2.0) * shape.radius, shape.rpy
        for turn_rad in (0.0, math.pi / 4.0):
            yield Box(p=shape.p, rpy=(roll, pitch, yaw + turn_rad), size=(side_m, side_m, shape.length))


if __name__ == "__main__":
    write_forms(MODELS_FOLDER)
