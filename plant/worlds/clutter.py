"""More objects on a world's surfaces than its rules name, and more people who walk about, by the seed."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np

from executive.words.mission import Route, Stop
from plant.models.catalogue import load_catalogue
from plant.worlds.placement import Placement, outline_of, place_one
from plant.worlds.world import ObjectRule, World, WorldError

PAUSE_S = 4.0
_CLUTTER_STREAM, _PASSING_STREAM = 11, 12
_NEVER = frozenset({"person", "extinguisher"})
"""What is not strewn about: people, and what is too large for most surfaces."""
_STOPS = 4


def place_clutter(
    world: World, objects: Sequence[Placement], count: int, seed: int, *, spared: Collection[str] = ()
) -> tuple[Placement, ...]:
    """Up to so many more objects beside those that are placed, of none of the `spared` classes.

    Each lies at rest on a surface that the rules allow; one that finds no free spot is left out.
    """
    surfaces = tuple(sorted(name for name, fronts in world.seed_rules.fronts.items() if fronts))
    classes = [name for name in load_catalogue() if name not in _NEVER and name not in spared]
    if not surfaces or not classes:
        return ()
    outlines, placed = [outline_of(each) for each in objects], list[Placement]()
    for index in range(count):
        rng = np.random.default_rng([seed, _CLUTTER_STREAM, index])
        model = classes[int(rng.integers(len(classes)))]
        form = [*load_catalogue()[model].forms.values()][int(rng.integers(len(load_catalogue()[model].forms)))]
        rule = ObjectRule(name=f"spare {model} {index + 1}", model=model, surfaces=surfaces)
        try:
            placement, outline = place_one(world, rule, (model, form), outlines, rng)
        except WorldError:
            continue
        placed.append(placement)
        outlines.append(outline)
    return tuple(placed)


def with_passers_by(world: World, count: int, seed: int) -> World:
    """The world with so many more people, each of whom walks between some of its places, again and again.

    Raises WorldError: the world has not places enough.
    """
    places = sorted({place for name, place in world.standing.items() if name in world.rooms})
    if count and len(places) < 2:
        raise WorldError(f"{world.name} has not two places between which somebody could walk")
    walks = {}
    for index in range(count):
        rng = np.random.default_rng([seed, _PASSING_STREAM, index])
        chosen = rng.permutation(len(places))[:_STOPS]
        stops = tuple(Stop(at=places[int(each)], pause=PAUSE_S) for each in chosen)
        walks[f"passer-by {index + 1}"] = Route(waypoints=stops, loop=True, start=float(rng.uniform(0.0, 10.0)))
    return world.with_walks(walks) if walks else world
