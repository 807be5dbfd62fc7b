"""Families of things: nine classes and many distractors, each instance made from its number.

`instance("hammer", 17)` gives an `ObjectModel`; the same family, number and sources give the same files.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np

from plant.models.catalogue import load_catalogue
from plant.models.families.blocks import cube, cylinder
from plant.models.families.cache import cache_folder, kept_folder, sources_digest
from plant.models.families.distractors import DISTRACTOR_MAKERS
from plant.models.families.draft import Draft, Finished
from plant.models.families.drinks import beer, coke
from plant.models.families.extinguishers import extinguisher
from plant.models.families.hammers import hammer
from plant.models.families.model import ObjectModel, Surface, held_out, read_model, write_model
from plant.models.families.oddments import ODDMENT, oddment
from plant.models.families.people import person
from plant.models.families.repainting import in_one_colour, plainly_painted
from plant.models.families.screwdrivers import screwdriver
from plant.models.families.sketches import SKETCH_MAKERS
from plant.models.families.wrenches import wrench

__all__ = [
    "CLASSES",
    "DISTRACTORS",
    "ODDMENT",
    "ObjectModel",
    "Surface",
    "held_out",
    "instance",
    "make",
    "numbers",
    "repainted",
    "sketched",
    "sources_digest",
]

Maker = Callable[[Draft], tuple[Finished, str, str]]

INSTANCES = 960
"""How many instances of each class there are for the data set, but of people."""
PEOPLE = 72
"""How many people: each but the sketched ones takes seconds to make."""
DISTRACTOR_INSTANCES = 96
"""How many of each kind of distractor there are."""
ODDMENTS = 640
"""How many things of no kind there are, for training alone."""
VALIDATION_BELOW, DISTRACTOR_VALIDATION_BELOW = 48, 8
"""Validation takes held-out instances below these numbers, so that its pictures stay the same when more are added."""
SKETCHED_OF_FIVE = (0, 2)
"""Of the instances that validation does not take, those whose number leaves these when divided by five are sketches."""
REPAINTED_OF_FIVE = 4
"""Of those of some classes, the ones whose number leaves this are detailed in form and plain in colour."""
_ONE_COLOUR: Mapping[str, float] = {"extinguisher": 0.0, "hammer": 0.4, "screwdriver": 0.4, "wrench": 0.4}
"""Those classes, and how often they are of a single colour: not what is told by its colours."""
_PLAIN_AS_A_CLASS = frozenset(
    {
        "battery",
        "candle",
        "food_can",
        "jar",
        "paint_tin",
        "pipe",
        "sauce_bottle",
        "soda_can",
        "spray_can",
        "tissue_box",
        "wine_bottle",
    }
)
"""What would pass for a cylinder, a cube or a bottle of beer without its picture."""

_CLASS_MAKERS: Mapping[str, Maker] = {
    "beer": beer,
    "coke": coke,
    "extinguisher": extinguisher,
    "hammer": hammer,
    "screwdriver": screwdriver,
    "wrench": wrench,
    "person": person,
    "cylinder": cylinder,
    "cube": cube,
}
_OTHER_MAKERS: Mapping[str, Maker] = {**DISTRACTOR_MAKERS, ODDMENT: oddment}
CLASSES: tuple[str, ...] = tuple(_CLASS_MAKERS)
DISTRACTORS: tuple[str, ...] = tuple(sorted(DISTRACTOR_MAKERS))


def numbers(family: str, *, for_training: bool) -> list[int]:
    """The instances of a family that training may see, or those that validation does.

    Every fourth number is kept from training. Validation sees no oddments.
    """
    if family == ODDMENT:
        return [number for number in range(ODDMENTS) if not held_out(number)] if for_training else []
    if not for_training:
        below = VALIDATION_BELOW if family in _CLASS_MAKERS else DISTRACTOR_VALIDATION_BELOW
        return [number for number in range(below) if held_out(number)]
    count = PEOPLE if family == "person" else INSTANCES if family in _CLASS_MAKERS else DISTRACTOR_INSTANCES
    return [number for number in range(count) if not held_out(number)]


def sketched(family: str, seed: int) -> bool:
    """Whether an instance is a sketch: in plain colours, and one of a class of a few solids.

    So are all people from number 48 on.
    """
    below = VALIDATION_BELOW if family in _CLASS_MAKERS else DISTRACTOR_VALIDATION_BELOW
    if seed < below or family in _PLAIN_AS_A_CLASS or family == ODDMENT:
        return False
    return family == "person" or seed % 5 in SKETCHED_OF_FIVE


def repainted(family: str, seed: int) -> bool:
    """Whether an instance of a class is of its usual form, but in plain colours without pictures."""
    return family in _ONE_COLOUR and seed >= VALIDATION_BELOW and seed % 5 == REPAINTED_OF_FIVE


def make(family: str, seed: int) -> tuple[Finished, str, str]:
    """Make an instance without writing it: the model, its kind and its main colour. Raises KeyError, ValueError."""
    plain = sketched(family, seed)
    makers = SKETCH_MAKERS if plain else _CLASS_MAKERS
    maker = makers.get(family) or _OTHER_MAKERS.get(family)
    if maker is None:
        raise KeyError(f"no family {family!r}; there are {', '.join((*CLASSES, *DISTRACTORS, ODDMENT))}")
    if seed < 0:
        raise ValueError(f"an instance's number is 0 or more, not {seed}")
    draft = Draft(np.random.default_rng([seed, *family.encode()]))
    made, kind, colour = maker(draft)
    if plain and family in DISTRACTOR_MAKERS:
        made = plainly_painted(made, draft.rng)
    if repainted(family, seed):
        if draft.rng.random() < _ONE_COLOUR[family]:
            made, colour = in_one_colour(made, draft.rng)
        else:
            made = plainly_painted(made, draft.rng, own_colours=1.0)
    return made, kind, colour


def instance(family: str, seed: int) -> ObjectModel:
    """The instance of a family by its number, made now unless the cache has it. Raises KeyError, ValueError."""

    def fill(folder: Path) -> None:
        made, kind, colour = make(family, seed)
        x, y, z = (float(v) for v in made.mass.com)
        class_id = load_catalogue()[family].id if family in _CLASS_MAKERS else 0
        model = ObjectModel(folder, family, seed, class_id, kind, colour, made.mass.mass_kg, (x, y, z), made.size_m)
        write_model(folder, model, made)

    return read_model(kept_folder(cache_folder() / f"{family}_{seed:03d}", fill))
