"""A request's variation in its world and plant."""

from executive.app.mission_run import mentioned_classes
from executive.app.prepare import prepare
from executive.mission.request import Request
from executive.words.variation import Variation
from plant.worlds.seeding import place_people

BEER = "Hey Alice, bring me a beer"


def prepared_with(folder, variation):
    return prepare(Request(BEER, world="flat", seed=2, out=folder / "out", variation=variation), ask=None)


def test_clutter_spares_the_classes_that_are_asked_for(tmp_path):
    assert "beer" in mentioned_classes(prepared_with(tmp_path, Variation(clutter=5)))


def test_people_of_a_variation_walk_in_the_world(tmp_path):
    prepared = prepared_with(tmp_path, Variation(people=2))
    walking = {each.name for each in place_people(prepared.world, 2) if each.route is not None}
    assert {"passer-by 1", "passer-by 2"} <= walking
