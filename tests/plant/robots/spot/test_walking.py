"""Spot walks on its floating base without sliding of its standing feet."""

import numpy as np
import pytest

from plant.robots.spot.description import LEGS, spot_facts

SETTLE_S = 0.05


def feet_W(engine):
    plant, model = engine.world.plant, engine.world.robots["Alice"]
    centre = np.array(spot_facts()["legs"]["foot"]["xyz"])
    links = [plant.GetBodyByName(f"{leg}_lleg", model.instance) for leg in LEGS]
    return np.array([plant.EvalBodyPoseInWorld(engine.context, link) @ centre for link in links])


def stances(engine, vx, vy, wz, seconds):
    """For each foot the lists of its positions while it stood on the floor, one list a stance."""
    spot = engine.robots["Alice"]
    lease = spot.take_lease("test")
    found, open_stances = [], [[] for _ in LEGS]
    for _ in range(round(seconds / 0.01)):
        spot.drive(vx, vy, wz, until_s=engine.now() + 0.2, lease=lease)
        engine.advance(0.01)
        for foot, p_W in enumerate(feet_W(engine)):
            if p_W[2] < 0.04:
                open_stances[foot].append(p_W)
            elif open_stances[foot]:
                found.append(np.array(open_stances[foot]))
                open_stances[foot] = []
    return [stance for stance in found if len(stance) > 2 * SETTLE_S / 0.01]


@pytest.mark.parametrize(("vx", "vy", "wz"), [(0.8, 0.0, 0.0), (0.5, 0.2, 0.5), (0.0, 0.0, 1.0)])
def test_stance_feet_slide_less_than_a_centimetre(engine, vx, vy, wz):
    walked = stances(engine, vx, vy, wz, 3.0)
    assert len(walked) >= 8
    skip = round(SETTLE_S / 0.01)
    slides = [np.linalg.norm(np.ptp(stance[skip:-skip], axis=0)[:2]) for stance in walked]
    assert max(slides) < 0.01
