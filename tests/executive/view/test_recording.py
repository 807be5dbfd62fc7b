"""Recording and live scene in a browser: the camera follows the robot, a caption tells the step, all the world fits."""

import gzip
import json

import numpy as np
import pytest

from executive.testing.bench import write_small_room
from plant.recording import Frame, View, save_html
from plant.simulation import Simulation
from plant.worlds.world import load_world

playwright_api = pytest.importorskip("playwright.sync_api", reason="not installed: pip install playwright")
expect = playwright_api.expect
pytestmark = pytest.mark.browser

SEEK = "t => { viewer.animator.pause(); viewer.animator.seek(t); }"
NOT_DRAWN = "() => { viewer.renderer.render = () => {}; }"
"""Frames pass, but no picture is drawn, which without a GPU takes longer than a test may wait."""
CORNERS = """corners => corners.map(([x, y]) => {
  const { camera, controls } = viewer, at = controls.target.clone().set(x, 0, -y);
  camera.updateMatrixWorld();
  return at.project(camera).toArray().slice(0, 2);
})"""
"""The corners of the world in the window, from -1 to 1."""


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    """The recording of a robot that glides by two metres in four seconds, and the corners of its world."""
    folder = tmp_path_factory.mktemp("recording")
    world = load_world(write_small_room(folder, can=False))
    simulation = Simulation(world, seed=1, record=True, visuals=False)
    simulation.recorder(0.0)
    still, frames = simulation.recorder.frames[0].positions, []
    plant = simulation.engine.world.plant
    start = plant.GetBodyByName(simulation.engine.world.robots[next(iter(simulation.robots))].body.name())
    column = start.floating_positions_start() + 4 if start.is_floating_base_body() else 0
    for t in np.arange(0.0, 4.01, 0.1):
        positions = still.copy()
        positions[column] += 0.5 * t
        frames.append(Frame(float(t), positions))
    steps = {"Alice": [(0.0, "go to the hall – on the way"), (3.0, "go to the hall – stopping at </script> the goal")]}
    save_html(simulation.engine.world, frames, folder / "recording.html", View.from_above(world.corners), steps)
    return folder / "recording.html", world.corners


@pytest.fixture(params=[(1280, 800), (390, 844)], ids=str)
def page(browser, request, recording):
    width, height = request.param
    context = browser.new_context(viewport={"width": width, "height": height})
    opened, defects = context.new_page(), []
    opened.on("pageerror", lambda error: defects.append(str(error)))
    opened.goto(recording[0].as_uri(), timeout=60_000)
    opened.locator("#recording").wait_for()
    opened.evaluate(NOT_DRAWN)
    yield opened
    context.close()
    assert defects == []


def test_the_camera_follows_the_robot_and_a_caption_tells_the_step(page):
    page.evaluate(SEEK, 0.5)
    expect(page.locator("#recording p")).to_have_text("Alice: go to the hall – on the way")
    before = page.evaluate("viewer.controls.target.toArray()")
    page.evaluate(SEEK, 3.5)
    expect(page.locator("#recording p")).to_have_text("Alice: go to the hall – stopping at </script> the goal")
    far = "([x, , z]) => Math.hypot(viewer.controls.target.x - x, viewer.controls.target.z - z) > 1.2"
    page.wait_for_function(far, arg=before)


def test_a_recording_stays_at_its_end_and_plays_again_from_there(page):
    page.evaluate("() => { viewer.animator.pause(); viewer.animator.seek(3.7); viewer.animator.play(); }")
    page.wait_for_function("() => !viewer.animator.playing")
    page.wait_for_timeout(300)
    expect(page.locator("#recording output")).to_have_text("4.0 s")
    expect(page.locator("#recording p")).to_have_text("Alice: go to the hall – stopping at </script> the goal")
    expect(page.locator("#recording button")).to_have_text("▶")
    again = """() => {
      document.querySelector("#recording button").click();
      return [viewer.animator.playing, viewer.animator.actions[0].time];
    }"""
    assert page.evaluate(again) == [True, 0.0]


def test_the_whole_world_fits_into_the_window_above_the_caption(page, recording):
    page.select_option("#recording select", "")
    page.wait_for_function("() => Math.hypot(viewer.controls.target.x - 1, viewer.controls.target.z) < 0.01")
    seen = np.array(page.evaluate(CORNERS, [list(corner) for corner in recording[1]]))
    assert np.abs(seen).max() < 1.0
    box = page.locator("#recording").bounding_box()
    assert seen[:, 1].min() > 1.0 - 2.0 * box["y"] / page.viewport_size["height"]
    assert max(np.ptp(seen[:, 0]), np.ptp(seen[:, 1])) > 0.8


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    """A page around the scene of a small room, and the state of the scene after the robot has moved by a metre."""
    folder, sent = tmp_path_factory.mktemp("scene"), []
    world = load_world(write_small_room(folder, can=False))
    simulation = Simulation(world, seed=1, visuals=False)
    shown = simulation.show_live()
    shown.send(sent.append, lambda: True)
    shown.publish()
    (state,) = sent
    state["poses"][state["followed"]][9] += 1.0
    (folder / "scene.html").write_bytes(gzip.decompress(shown.page()))
    (folder / "page.html").write_text("<iframe src='scene.html' width=800 height=600></iframe>")
    return folder / "page.html", json.loads(json.dumps(state))


def test_the_live_scene_moves_the_bodies_and_the_camera_as_the_page_posts(browser, scene):
    address, state = scene
    page = browser.new_page()
    page.goto(address.as_uri(), timeout=60_000)
    post = "state => document.querySelector('iframe').contentWindow.postMessage(state, '*')"
    at = state["poses"][state["followed"]][9:]
    frame, target, before = page.frames[1], [at[0], at[2], -at[1]], "viewer.controls.target.toArray()"
    body = f"/drake/visualizer/{state['followed']}".split("/")[1:]
    page.evaluate(post, {**state, "follows": False})
    frame.wait_for_function(
        "([path, x]) => Math.abs(viewer.scene_tree.find(path).object.position.x - x) < 1e-3", arg=[body, at[0]]
    )
    whole = frame.evaluate(before)
    page.evaluate(post, {**state, "follows": True})
    frame.wait_for_function(f"at => Math.hypot(...{before}.map((each, n) => each - at[n])) < 1e-3", arg=target)
    page.evaluate(post, {**state, "follows": False})
    frame.wait_for_function(f"at => Math.hypot(...{before}.map((each, n) => each - at[n])) < 1e-3", arg=whole)
    page.close()
