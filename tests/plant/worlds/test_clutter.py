"""Clutter and passers-by that a variation adds to the flat."""

import itertools
import math

import numpy as np
import pytest

from plant.worlds.seeding import (
    add_crowd,
    add_passers_by,
    outline_of,
    place_clutter,
    place_objects,
    place_people,
    polygon_distance,
)
from plant.worlds.world import WorldError, load_world

SEEDS = (1, 2)


@pytest.fixture(scope="module")
def world():
    return load_world("flat")


def test_clutter_lies_on_surfaces_and_touches_nothing(world):
    for seed in SEEDS:
        things = place_objects(world, seed)
        clutter = place_clutter(world, things, 12, seed)
        assert len(clutter) > 6
        assert {each.surface for each in clutter} <= set(world.surfaces)
        outlines = [outline_of(each) for each in (*things, *clutter)]
        assert min(polygon_distance(a, b) for a, b in itertools.combinations(outlines, 2)) > 0


def test_clutter_is_of_no_class_that_the_mission_speaks_of(world):
    for seed in SEEDS:
        things = place_objects(world, seed)
        clutter = place_clutter(world, things, 12, seed, spared=("coke", "beer"))
        assert not {each.class_name for each in clutter} & {"coke", "beer", "person"}


def test_clutter_moves_nothing_that_was_there_and_is_the_same_for_a_seed(world):
    things = place_objects(world, 3)
    first, second = place_clutter(world, things, 6, 3), place_clutter(world, things, 6, 3)
    assert [(each.name, each.surface) for each in first] == [(each.name, each.surface) for each in second]
    assert all(a.X_WO.IsExactlyEqualTo(b.X_WO) for a, b in zip(first, second, strict=True))
    more = place_clutter(world, things, 9, 3)
    assert all(a.X_WO.IsExactlyEqualTo(b.X_WO) for a, b in zip(first, more, strict=False))


def test_passers_by_walk_between_places_of_the_world(world):
    varied = add_passers_by(world, 2, 5)
    routes = {each.name: each.route for each in place_people(varied, 5)}
    for name in ("passer-by 1", "passer-by 2"):
        assert routes[name] is not None
    before = {each.name: each.X_WO.translation() for each in place_people(world, 5)}
    after = {each.name: each.X_WO.translation() for each in place_people(varied, 5)}
    assert all(np.array_equal(after[name], place) for name, place in before.items())


def test_without_passers_by_the_world_stays_as_it_is(world):
    assert add_passers_by(world, 0, 5) is world


def test_a_crowd_stands_apart_at_places_that_the_seed_chooses():
    world = load_world("flat")
    crowds = [place_people(add_crowd(world, 8, seed), seed)[1:] for seed in (5, 5, 6)]
    places = [[tuple(each.X_WO.translation()[:2]) for each in crowd] for crowd in crowds]
    assert places[0] == places[1] != places[2]
    assert min(math.dist(*pair) for pair in itertools.combinations(places[0], 2)) > 1.0
    with pytest.raises(WorldError, match="room for a crowd"):
        add_crowd(world, 40, 5)
