"""Repainting of finished models in plain colours, without pictures."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from errand_make.mesh import Material, Mesh
from errand_train.dataset.objects.draft import Finished, pick, vary_colour
from errand_train.dataset.objects.lettering import COLOURS, GREYS

__all__ = ["paint_in_one_colour", "paint_plainly"]


def paint_plainly(made: Finished, rng: np.random.Generator, *, own_colours: float = 0.5) -> Finished:
    """Replaces every picture of a model by its mean colour (with a probability), or by any plain colour."""
    own = rng.random() < own_colours
    painted: dict[str, Material] = {}
    for name, material in made.mesh.materials.items():
        picture = made.pictures.get(material.texture or "")
        mean = None if picture is None else np.asarray(picture, dtype=float).reshape(-1, 3).mean(axis=0) / 255.0
        colour = np.array(COLOURS[str(rng.choice(list(COLOURS)))]) if mean is None or not own else mean
        keep = picture is None and (own or rng.random() < 0.5)
        painted[name] = material if keep else Material(vary_colour(rng, colour), None, None, material.shine, 0.0)
    mesh = Mesh(painted)
    mesh.add_mesh(made.mesh)
    return replace(made, mesh=mesh, pictures={})


def paint_in_one_colour(made: Finished, rng: np.random.Generator) -> tuple[Finished, str]:
    """Paints a model in a single plain colour, as CAD files have it, and returns the colour's name."""
    word = str(rng.choice(list(COLOURS)))
    colour = COLOURS[word]
    if rng.random() < 0.6:
        word, colour = "grey", pick(rng, *GREYS)
    paint = Material(vary_colour(rng, colour, 0.04), None, None, float(rng.uniform(0.0, 0.6)), 0.0)
    mesh = Mesh(dict.fromkeys(made.mesh.materials, paint))
    mesh.add_mesh(made.mesh)
    return replace(made, mesh=mesh, pictures={}), word
