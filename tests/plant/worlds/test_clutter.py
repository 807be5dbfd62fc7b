"""Clutter and passers-by that a variation adds to the flat."""

import itertools
import math

import pytest

from plant.worlds import seeding
from plant.worlds.seeding import place_clutter, place_objects, place_people
from plant.worlds.world import WorldError, load_world

SEEDS = (1, 2)


@pytest.fixture(scope="module")
def world():
    return load_world("flat")


@pytest.fixture(scope="module", params=SEEDS)
def cluttered(world, request):
    """The placed objects, and clutter that spares two classes."""
    things = place_objects(world, request.param)
    return things, place_clutter(world, things, 12, request.param, spared=("coke", "beer"))


def test_clutter_lies_on_surfaces_and_touches_nothing(world, cluttered):
    things, clutter = cluttered
    assert len(clutter) > 6 and {each.surface for each in clutter} <= set(world.surfaces)
    outlines = [seeding.outline_of(each) for each in (*things, *clutter)]
    assert min(seeding.polygon_distance(a, b) for a, b in itertools.combinations(outlines, 2)) > 0


def test_clutter_is_of_no_class_that_the_mission_speaks_of(cluttered):
    assert not {each.class_name for each in cluttered[1]} & {"coke", "beer", "person"}


def test_clutter_moves_nothing_that_was_there_and_is_the_same_for_a_seed(world):
    things = place_objects(world, 3)
    first, second = place_clutter(world, things, 6, 3), place_clutter(world, things, 6, 3)
    assert [(each.name, each.surface) for each in first] == [(each.name, each.surface) for each in second]
    assert all(a.X_WO.IsExactlyEqualTo(b.X_WO) for a, b in zip(first, second, strict=True))
    more = place_clutter(world, things, 9, 3)
    assert all(a.X_WO.IsExactlyEqualTo(b.X_WO) for a, b in zip(first, more, strict=False))


def test_passers_by_walk_between_places_of_the_world(world):
    before, after = (
        {each.name: each for each in place_people(varied, 5)} for varied in (world, seeding.add_passers_by(world, 2, 5))
    )
    assert all(after[f"passer-by {number}"].route is not None for number in (1, 2))
    assert all(
        after[name].X_WO.translation().tolist() == each.X_WO.translation().tolist() for name, each in before.items()
    )
    assert seeding.add_passers_by(world, 0, 5) is world


def test_a_crowd_stands_apart_at_places_that_the_seed_chooses(world):
    crowds = [place_people(seeding.add_crowd(world, 8, seed), seed)[1:] for seed in (5, 5, 6)]
    places = [[tuple(each.X_WO.translation()[:2]) for each in crowd] for crowd in crowds]
    assert places[0] == places[1] != places[2]
    assert min(math.dist(*pair) for pair in itertools.combinations(places[0], 2)) > 1.0
    with pytest.raises(WorldError, match="room for a crowd"):
        seeding.add_crowd(world, 40, 5)
