"""Objects that relations name, in the flat: the robot takes the right one of two, by the referee's verdict."""

from dataclasses import replace

import numpy as np
import pytest
from pydrake.math import RigidTransform

from executive.run.outcome import Outcome
from plant import simulation
from plant.worlds.seeding import place_objects
from tests.missions.flat_mission import FlatMission

pytestmark = [pytest.mark.mission, pytest.mark.nightly]

COUNTER_Y = 8.42
GRASP = "Take [Nothing] to [kitchen counter] and do [grasp] to [coke {}]"


def put_on_counter(monkeypatch, **x_m):
    """Two cokes and a beer on the kitchen counter, and nothing else in the world."""

    def placed(world, seed):
        found = {each.name: each for each in place_objects(world, seed)}
        found["coke_2"] = replace(found["coke"], name="coke_2")
        for name, x in x_m.items():
            one = found[name]
            z = world.surfaces["kitchen counter"].height_m + one.form.rest_height_m + 0.001
            X_WO = RigidTransform(one.X_WO.rotation(), np.array([x, COUNTER_Y, z]))
            yield replace(one, X_WO=X_WO, surface="kitchen counter")

    monkeypatch.setattr(simulation, "place_objects", lambda world, seed: tuple(placed(world, seed)))


@pytest.mark.parametrize(
    ("relation", "taken"),
    [
        ("next to the beer", "coke_2"),
        ("left of the beer", "coke_2"),
        ("1st from the left", "coke"),
    ],
)
def test_the_robot_takes_the_coke_that_is_meant(relation, taken, monkeypatch):
    put_on_counter(monkeypatch, coke=7.2, coke_2=7.75, beer=7.92)
    mission = FlatMission([GRASP.format(relation)])
    result, verdict = mission.run()
    assert result.outcome is Outcome.SUCCESS, result.message
    assert verdict.success, verdict.why
    assert [name for name, each in mission.simulation.referee.objects.items() if each.lifts] == [taken]
