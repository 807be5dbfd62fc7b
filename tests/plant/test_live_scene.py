"""The live scene: its page, the poses that it sends, and no effect on the run."""

import base64
import gzip
import re

import numpy as np
import pytest

from plant import recording
from plant.simulation import Simulation
from plant.worlds.world import load_world
from tests.plant.kept_engine import KeptEngine


@pytest.fixture(scope="module")
def simulation():
    """A plant that no test commands; each test shows it again."""
    return Simulation(load_world("flat"), seed=1)


@pytest.fixture
def shown(simulation):
    """A scene that is wanted, and a list of what it has sent."""
    scene, sent = simulation.show_live(), []
    scene.send(sent.append, lambda: True)
    return scene, sent


@pytest.fixture(scope="module")
def page(simulation):
    """A page that is built while no Meshcat can be made here.

    Its server takes any number of clients, and its end in another thread ends the process.
    """
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(recording, "Meshcat", None)
        return gzip.decompress(simulation.show_live().page()).decode()


def commands(page):
    """The viewer's commands in a page."""
    return [
        base64.b64decode(each)
        for each in re.findall(r'^fetch\("data:application/octet-binary;base64,(.*)"\)', page, re.M)
    ]


def test_the_page_has_each_body_that_the_scene_moves(simulation, shown, page):
    scene, sent = shown
    scene.publish()
    (state,) = sent
    plant = simulation.engine.world.plant
    drawn = {path for path, body in scene._bodies.items() if plant.GetVisualGeometriesForBody(body)}
    kinds = {"Alice/arm_wr1", "coke/coke", "Robin/person"}
    assert kinds <= drawn <= set(state["poses"])
    placed = [each for each in commands(page) if b"set_transform" in each]
    missing = [
        path
        for path in drawn
        if not any(f"/drake/visualizer/{path}\xa6matrix".encode("latin-1") in each for each in placed)
    ]
    assert missing == []


def test_the_page_counts_the_commands_that_come_before_the_poses(page):
    counted = re.search(r'COMMAND = "(.*?)"', page)[1]
    scripts, overlay = page.rsplit("<!-- Moves the bodies", 1)
    assert scripts.count(counted) == len(commands(page)) > 100
    assert overlay.rstrip().endswith("</html>")


def test_a_page_that_cannot_be_built_says_why(simulation, monkeypatch):
    monkeypatch.setattr(recording, "_WRITE_PAGE", "raise SystemExit('no memory')")
    with pytest.raises(RuntimeError, match="the 3D scene cannot be built: no memory"):
        simulation.show_live().page()


@pytest.mark.parametrize(("wanted", "refreshed"), [(True, 16), (False, 0)])
def test_it_is_refreshed_ten_times_a_second_of_the_wall_while_somebody_looks(
    simulation, monkeypatch, wanted, refreshed
):
    wall, refreshes = {"s": 100.0}, []
    monkeypatch.setattr(recording.time, "perf_counter", lambda: wall["s"])
    scene = simulation.show_live()
    scene.send(lambda _: None, lambda: wanted)
    publish = scene.publish
    monkeypatch.setattr(scene, "publish", lambda: (refreshes.append(wall["s"]), publish()))
    for _ in range(64):
        wall["s"] += 0.025
        scene()
    assert len(refreshes) == pytest.approx(refreshed, abs=2 * wanted)


def test_it_sends_the_poses_of_the_bodies_and_which_one_the_camera_follows(simulation, shown):
    scene, sent = shown
    simulation.clock.advance(0.3)
    scene.publish()
    state = sent[-1]
    assert state["followed"] == "Alice/body"
    X_WB = np.array(state["poses"]["Alice/body"]).reshape(4, 3).T
    engine = simulation.engine
    true = engine.world.plant.EvalBodyPoseInWorld(engine.context, engine.world.robots["Alice"].body)
    assert pytest.approx(true.GetAsMatrix34(), abs=1e-4) == X_WB


def test_nothing_is_sent_while_nothing_moves(shown):
    scene, sent = shown
    scene.publish()
    before = len(sent)
    scene.publish()
    assert len(sent) == before == 1


def test_a_run_is_the_same_with_it_and_without(simulation):
    kept, ends = KeptEngine(simulation.engine), []
    for shows in (False, True):
        engine, sent = kept.again(), []
        if shows:
            simulation.show_live().send(sent.append, lambda: True)
        engine.advance(0.2)
        X_OB = engine.robots["Alice"].odometry().X_OB
        ends.append([*engine.world.plant.GetPositions(engine.context), *X_OB.GetAsMatrix34().ravel()])
        assert bool(sent) is shows
    assert np.array_equal(*ends)
