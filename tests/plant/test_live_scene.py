"""The live scene: served on this machine, and without any effect on the run."""

import urllib.request

import numpy as np
import pytest

from plant import recording
from plant.simulation import Simulation
from plant.worlds.world import load_world
from tests.plant.kept_engine import KeptEngine


@pytest.fixture(scope="module")
def simulation():
    """A plant that no test commands; each test shows it again."""
    return Simulation(load_world("flat"), seed=1, visuals=False)


def test_the_scene_is_served_on_this_machine(simulation):
    scene = simulation.show_live()
    with urllib.request.urlopen(scene.url) as answer:
        assert b"meshcat" in answer.read().lower()


@pytest.mark.parametrize(("easy", "refreshed"), [(False, 10), (True, 2)])
def test_it_is_refreshed_a_few_times_a_second_of_the_wall(simulation, monkeypatch, easy, refreshed):
    wall = {"s": 100.0}
    monkeypatch.setattr(recording.time, "perf_counter", lambda: wall["s"])
    scene = simulation.show_live()
    if easy:
        scene.refresh_seldom()
    shown = []
    publish = scene.publish
    monkeypatch.setattr(scene, "publish", lambda: (shown.append(wall["s"]), publish()))
    for _ in range(32):
        wall["s"] += 0.05
        scene(0.0)
    assert len(shown) == pytest.approx(1.6 * refreshed, rel=0.4)


def test_the_camera_follows_the_robot_on_request(simulation, monkeypatch):
    # at first the whole world; following: beside the robot's body; no longer: the whole world again
    scene = simulation.show_live()
    cameras = []
    monkeypatch.setattr(recording, "set_camera", lambda _, view: cameras.append(view.p_WTarget))
    for wanted in (False, True, False):
        scene.follow(wanted)
        scene.publish()
    start = load_world("flat").start
    beside, whole = cameras
    assert (beside[:2], whole[2]) == (pytest.approx((start.x_m, start.y_m), abs=0.05), 0.0)


def test_it_shows_the_plant_as_it_is(simulation):
    scene = simulation.show_live()
    simulation.clock.advance(0.3)
    scene.publish()
    shown = scene._shown.plant.GetPositions(scene._shown_context)
    assert np.array_equal(shown, simulation.engine.world.plant.GetPositions(simulation.engine.context))


def test_a_run_is_the_same_with_it_and_without(simulation):
    kept, ends = KeptEngine(simulation.engine), []
    for shows in (False, True):
        engine = kept.again()
        if shows:
            simulation.show_live()
        engine.advance(0.2)
        X_OB = engine.robots["Alice"].odometry().X_OB
        ends.append([*engine.world.plant.GetPositions(engine.context), *X_OB.GetAsMatrix34().ravel()])
    assert np.array_equal(*ends)
