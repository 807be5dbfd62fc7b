"""A request's variation in its world and plant."""

from executive.app.mission_run import mentioned_classes
from executive.app.prepare import prepare
from executive.mission.request import Request
from executive.words.variation import Variation
from plant.worlds.seeding import place_people

BEER = "Hey Alice, bring me a beer"


def test_clutter_spares_the_classes_that_are_asked_for_and_people_walk_in_the_world(tmp_path):
    request = Request(BEER, world="flat", seed=2, out=tmp_path / "out", variation=Variation(clutter=5, people=2))
    prepared = prepare(request, ask=None)
    assert "beer" in mentioned_classes(prepared)
    walking = {each.name for each in place_people(prepared.world, 2) if each.route is not None}
    assert {"passer-by 1", "passer-by 2"} <= walking
