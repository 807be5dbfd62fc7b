"""The world home: its people and objects are drawn by the seed, and the robot's hand can hold most objects."""

import numpy as np
import pytest

from executive.app.prepare.worlds import knowledge_of, open_world, refuse_unusable
from plant.worlds.seeding import place_objects, place_people

WIDEST_M = 0.115
"""Width of an object that the gripper takes."""


@pytest.fixture(scope="module")
def home():
    return open_world("home")


def test_the_world_is_found_by_its_name_and_can_be_used(home):
    refuse_unusable(home)
    knowledge = knowledge_of(home)
    assert (len(knowledge.rooms), len(knowledge.tops), len(knowledge.people)) == (5, 12, 6)


def test_most_objects_fit_into_the_gripper(home):
    sides = {name: each.object.size_m for name, each in home.imports.items()}
    assert len(sides) == 24
    assert sum(min(size_m[:2]) < WIDEST_M for size_m in sides.values()) >= 18


@pytest.mark.parametrize("seed", range(40, 60))
def test_all_objects_find_a_place_at_each_seed(home, seed):
    assert {each.class_name for each in place_objects(home, seed)} == {*home.imports}


def test_people_stand_at_places_that_the_seed_chooses(home):
    spots = [
        {each.name: tuple(np.round(each.X_WO.translation()[:2], 2)) for each in place_people(home, seed)}
        for seed in range(12)
    ]
    assert {name: len({each[name] for each in spots}) > 1 for name in spots[0]} == dict.fromkeys(spots[0], True)
