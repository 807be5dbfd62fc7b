"""Procedural objects: nine classes and many distractors, each instance made from its number.

`instance("hammer", 17)` gives an `ObjectModel`; the same category, number and sources give the same files.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Mapping
from functools import cache
from pathlib import Path

import numpy as np

from errand_train.dataset.objects.draft import Draft, Finished
from errand_train.dataset.objects.model import ObjectModel, Surface, held_out, read_model, write_model
from errand_train.dataset.objects.recipes import build, load_recipes
from errand_train.dataset.objects.repainting import paint_in_one_colour, paint_plainly
from plant.models.catalogue import MODELS_FOLDER, cached_folder, load_catalogue, user_cache

__all__ = [
    "CLASSES",
    "DISTRACTORS",
    "ObjectModel",
    "Surface",
    "held_out",
    "instance",
    "is_untextured",
    "make",
    "numbers",
    "repainted",
    "sources_digest",
]

INSTANCES = 960
"""Instances of each class in the data set, except people."""
PEOPLE = 72
"""Instances of people: each textured one takes seconds to make."""
DISTRACTOR_INSTANCES = 96
"""Instances of each distractor category."""
VALIDATION_BELOW, DISTRACTOR_VALIDATION_BELOW = 48, 8
"""Validation takes held-out instances below these numbers, so that its pictures stay the same when more are added."""
UNTEXTURED_OF_FIVE = (0, 2)
"""Remainders by five of the numbers that are untextured, among the instances that validation does not take."""
REPAINTED_OF_FIVE = 4
"""Remainders of the numbers in some classes that are detailed in form and plain in colour."""
_ONE_COLOUR: Mapping[str, float] = {"extinguisher": 0.0, "hammer": 0.4, "screwdriver": 0.4, "wrench": 0.4}
"""Those classes, and the share that has a single colour; excludes classes recognised by their colours."""
CLASSES: tuple[str, ...] = tuple(load_recipes("classes"))
DISTRACTORS: tuple[str, ...] = tuple(sorted(load_recipes("distractors")))


@cache
def sources_digest() -> str:
    """Digest (ten hexadecimal digits) of the sources of the models."""
    objects, digest = Path(__file__).resolve().parent, hashlib.sha256()
    for folder in (objects, objects.parents[1] / "models", MODELS_FOLDER / "builder"):
        for path in sorted(path for path in folder.rglob("*") if path.suffix in (".py", ".yaml")):
            digest.update(path.relative_to(folder).as_posix().encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()[:10]


def numbers(category: str, *, for_training: bool) -> list[int]:
    """Numbers of the instances of a category for training, or for validation.

    Every fourth number is held out from training.
    """
    if not for_training:
        below = VALIDATION_BELOW if category in CLASSES else DISTRACTOR_VALIDATION_BELOW
        return [number for number in range(below) if held_out(number)]
    count = PEOPLE if category == "person" else INSTANCES if category in CLASSES else DISTRACTOR_INSTANCES
    return [number for number in range(count) if not held_out(number)]


def is_untextured(category: str, seed: int) -> bool:
    """Returns whether an instance is untextured: plain colours, and for one of a class a few basic solids.

    So are all people from number 48 on.
    """
    below = VALIDATION_BELOW if category in CLASSES else DISTRACTOR_VALIDATION_BELOW
    if seed < below or (category in DISTRACTORS and not load_recipes("distractors")[category].may_be_plain):
        return False
    return category == "person" or seed % 5 in UNTEXTURED_OF_FIVE


def is_repainted(category: str, seed: int) -> bool:
    """Returns whether an instance of a class has its usual form, but plain colours without pictures."""
    return category in _ONE_COLOUR and seed >= VALIDATION_BELOW and seed % 5 == REPAINTED_OF_FIVE


def make(category: str, seed: int) -> tuple[Finished, str, str]:
    """Makes an instance without writing it: the model, its kind and its main colour. Raises KeyError, ValueError."""
    plain = is_untextured(category, seed)
    basic = load_recipes("untextured") if plain else {}
    recipe = basic.get(category) or {**load_recipes("classes"), **load_recipes("distractors")}.get(category)
    if recipe is None:
        raise KeyError(f"no category {category!r}; there are {', '.join((*CLASSES, *DISTRACTORS))}")
    if seed < 0:
        raise ValueError(f"an instance's number is 0 or more, not {seed}")
    draft = Draft(np.random.default_rng([seed, *category.encode()]))
    made, kind, colour = build(category, recipe, draft)
    if plain and category not in basic:
        made = paint_plainly(made, draft.rng)
    if is_repainted(category, seed):
        if draft.rng.random() < _ONE_COLOUR[category]:
            made, colour = paint_in_one_colour(made, draft.rng)
        else:
            made = paint_plainly(made, draft.rng, own_colours=1.0)
    return made, kind, colour


def instance(category: str, seed: int) -> ObjectModel:
    """Makes the instance of a category by its number, or reads it from the cache. Raises KeyError, ValueError.

    `ERRAND_MODEL_CACHE` names another folder than the user's cache.
    """

    def fill(folder: Path) -> None:
        made, kind, colour = make(category, seed)
        x, y, z = (float(v) for v in made.mass.com)
        class_id = load_catalogue()[category].id if category in CLASSES else 0
        model = ObjectModel(folder, category, seed, class_id, kind, colour, made.mass.mass_kg, (x, y, z), made.size_m)
        write_model(folder, model, made)

    chosen = os.environ.get("ERRAND_MODEL_CACHE")
    folder = (Path(chosen) if chosen else user_cache() / "models") / sources_digest()
    return read_model(cached_folder(folder / f"{category}_{seed:03d}", fill))
