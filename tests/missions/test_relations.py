"""Objects that relations name, in the flat: the robot takes the right one of two, by the referee's verdict."""

from dataclasses import replace

import numpy as np
import pytest
from pydrake.math import RigidTransform

from executive.run.outcome import Outcome
from plant import simulation
from plant.worlds.seeding import place_objects
from skills.api import Cause
from tests.missions.flat_mission import FlatMission

pytestmark = [pytest.mark.mission, pytest.mark.nightly]

GRASP = "Take [Nothing] to [kitchen counter] and do [grasp] to [coke{}]"
PUT = "Take [coke] to [kitchen table {}] and do [Nothing] to [Nothing]"


def put(monkeypatch, **spots):
    """Two cokes and a beer in the kitchen at most, and nothing else: x on the counter, or (x, y) on the table."""

    def placed(world, seed):
        found = {each.name: each for each in place_objects(world, seed)}
        found["coke_2"] = replace(found["coke"], name="coke_2")
        for name, spot in spots.items():
            one, is_table = found[name], isinstance(spot, tuple)
            surface, (x, y) = ("kitchen table", spot) if is_table else ("kitchen counter", (spot, 8.42))
            z = world.surfaces[surface].height_m + one.form.rest_height_m + 0.001
            yield replace(one, X_WO=RigidTransform(one.X_WO.rotation(), np.array([x, y, z])), surface=surface)

    monkeypatch.setattr(simulation, "place_objects", lambda world, seed: tuple(placed(world, seed)))


@pytest.mark.parametrize(
    ("relation", "taken"),
    [
        ("next to the beer", "coke_2"),
        ("left of the beer", "coke"),
        ("2nd from the left", "coke_2"),
    ],
)
def test_the_robot_takes_the_coke_that_is_meant(relation, taken, monkeypatch):
    put(monkeypatch, coke=7.2, coke_2=8.1, beer=7.92)
    mission = FlatMission([GRASP.format(f" {relation}")])
    result, verdict = mission.run()
    assert result.outcome is Outcome.SUCCESS, result.message
    assert verdict.success, verdict.why
    assert [name for name, each in mission.simulation.referee.objects.items() if each.lifts] == [taken]


def test_the_robot_asks_which_of_two_fits_and_fails_without_an_answer(monkeypatch):
    put(monkeypatch, coke=7.35, coke_2=7.75, beer=7.56)
    result, verdict = FlatMission([GRASP.format(" next to the beer")]).run()
    assert (result.outcome, result.cause) == (Outcome.FAILURE, Cause.PRECONDITION)
    assert "there are two cokes on the kitchen counter next to the beer, and it is not said which one" in result.message
    assert not verdict.success


@pytest.mark.parametrize("relation", ["left of the beer", "next to the beer"])
def test_the_robot_puts_the_coke_where_it_is_told(relation, monkeypatch):
    put(monkeypatch, coke=7.2, beer=(11.2, 6.5))
    result, verdict = FlatMission([GRASP.format(""), PUT.format(relation)]).run()
    assert result.outcome is Outcome.SUCCESS, result.message
    assert verdict.success, verdict.why
