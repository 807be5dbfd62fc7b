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
pytest_plugins = ["tests.browser"]
pytestmark = pytest.mark.browser

SEEK = "t => { viewer.animator.pause(); viewer.animator.seek(t); }"
NOT_DRAWN = """Object.defineProperty(window, "viewer", { configurable: true, set(viewer) {
  viewer.renderer.render = () => {};
  Object.defineProperty(window, "viewer", { value: viewer });
} });"""
"""Frames pass, but no picture is drawn, which without a GPU takes longer than a test may wait."""
TWO_FRAMES = "() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))"
CORNERS = """corners => corners.map(([x, y]) => {
  const { camera, controls } = viewer, at = controls.target.clone().set(x, 0, -y);
  camera.updateMatrixWorld();
  return at.project(camera).toArray().slice(0, 2);
})"""
"""The corners of the world in the window, from -1 to 1."""


@pytest.fixture(scope="module")
def simulation(tmp_path_factory):
    """A robot in a small room."""
    world = load_world(write_small_room(tmp_path_factory.mktemp("room"), can=False))
    return Simulation(world, seed=1, record=True, visuals=False)


@pytest.fixture
def recording(simulation, tmp_path):
    """The recording of a robot that glides by two metres in four seconds."""
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
    view = View.from_above(simulation.world.corners)
    save_html(simulation.engine.world, frames, tmp_path / "recording.html", view, steps)
    return tmp_path / "recording.html"


@pytest.fixture
def page(browser):
    """A page that draws no scene, and may raise nothing."""
    opened, defects = browser.new_page(viewport={"width": 1280, "height": 800}), []
    opened.add_init_script(NOT_DRAWN)
    opened.on("pageerror", lambda error: defects.append(str(error)))
    yield opened
    opened.close()
    assert defects == []


def test_the_camera_of_a_recording_follows_the_robot_or_shows_the_whole_world_and_a_caption_tells_the_step(
    page, recording, simulation
):
    page.goto(recording.as_uri(), timeout=60_000)
    page.locator("#recording").wait_for(timeout=60_000)
    page.evaluate(SEEK, 0.5)
    expect(page.locator("#recording p")).to_have_text("Alice: go to the hall – on the way")
    before = page.evaluate("viewer.controls.target.toArray()")
    page.evaluate(SEEK, 3.5)
    expect(page.locator("#recording p")).to_have_text("Alice: go to the hall – stopping at </script> the goal")
    far = "([x, , z]) => Math.hypot(viewer.controls.target.x - x, viewer.controls.target.z - z) > 1.2"
    page.wait_for_function(far, arg=before)
    # it stays at its end, and plays again from its beginning
    page.evaluate("() => { viewer.animator.seek(3.7); viewer.animator.play(); }")
    page.wait_for_function("() => !viewer.animator.playing")
    page.evaluate(TWO_FRAMES)
    expect(page.locator("#recording output")).to_have_text("4.0 s")
    expect(page.locator("#recording button")).to_have_text("▶")
    again = """() => {
      document.querySelector("#recording button").click();
      return [viewer.animator.playing, viewer.animator.actions[0].time];
    }"""
    assert page.evaluate(again) == [True, 0.0]
    page.select_option("#recording select", "")
    corners = [list(corner) for corner in simulation.world.corners]
    for width, height in ((1280, 800), (390, 844)):
        page.set_viewport_size({"width": width, "height": height})
        page.wait_for_function("ratio => Math.abs(viewer.camera.aspect - ratio) < 0.1", arg=width / height)
        page.evaluate(TWO_FRAMES)
        assert page.evaluate("Math.hypot(viewer.controls.target.x - 1, viewer.controls.target.z)") < 0.01
        seen = np.array(page.evaluate(CORNERS, corners))
        assert np.abs(seen).max() < 1.0
        box = page.locator("#recording").bounding_box()
        assert seen[:, 1].min() > 1.0 - 2.0 * box["y"] / height
        assert max(np.ptp(seen[:, 0]), np.ptp(seen[:, 1])) > 0.8


CUT = """robot => {
  const cut = { walls: false, robot: false };
  viewer.scene.traverse((each) => {
    let own = false;
    for (let above = each; above; above = above.parent) own = own || above.name === robot;
    if (each.isMesh && each.material.clippingPlanes) cut[own ? "robot" : "walls"] = true;
  });
  return cut;
}"""


def test_walls_are_cut_and_robots_are_not_and_a_telephone_shows_the_page_in_its_own_width(page, recording):
    page.goto(recording.as_uri(), timeout=60_000)
    page.wait_for_function(f"robot => ({CUT})(robot).walls", arg="Alice", timeout=60_000)
    assert page.evaluate(CUT, "Alice") == {"walls": True, "robot": False}
    assert page.locator("meta[name=viewport]").get_attribute("content").startswith("width=device-width")


@pytest.fixture
def scene(simulation, tmp_path):
    """A page around the scene of a small room, and the state of the scene after the robot has moved by a metre."""
    shown, sent = simulation.show_live(), []
    shown.send(sent.append, lambda: True)
    shown.publish()
    (state,) = sent
    state["poses"][state["followed"]][9] += 1.0
    (tmp_path / "scene.html").write_bytes(gzip.decompress(shown.page()))
    (tmp_path / "page.html").write_text("<iframe src='scene.html' width=800 height=600></iframe>")
    return tmp_path / "page.html", json.loads(json.dumps(state))


def test_the_live_scene_moves_the_bodies_and_the_camera_as_the_page_posts(page, scene):
    address, state = scene
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
