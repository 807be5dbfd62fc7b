"""Light of a world, as it is drawn, and the threads and the process that draw."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from pydrake.geometry import Box
from pydrake.math import RigidTransform
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
from pydrake.systems.framework import DiagramBuilder

from executive.words.variation import DAY_LIGHT, LIGHTS
from plant.rendering import MESA_THREADS, RENDERER, MountedCamera, Scene, lights, render_parameters
from plant.sensors.camera_spec import colour_render_camera, depth_render_camera
from skills.robot import Intrinsics

RENDERS = """
from pathlib import Path
from tests.plant.test_rendering import box_scene, pictures

pictures(*box_scene())
print(sum(each.read_text().startswith("llvmpipe") for each in Path("/proc/self/task").glob("*/comm")))
"""


def test_a_dim_light_dims_each_beam_and_the_sky():
    day, dim = lights(DAY_LIGHT), lights(LIGHTS["dim"])
    assert [each.intensity for each in dim] == pytest.approx([0.4 * each.intensity for each in day])
    assert np.max(render_parameters(LIGHTS["dim"]).default_clear_color) < 0.5


def test_a_low_sun_is_one_beam_more():
    assert len(lights(LIGHTS["low sun"])) == len(lights()) + 1


def test_software_renderer_draws_without_threads_of_its_own():
    usual = {name: value for name, value in os.environ.items() if name != MESA_THREADS}
    options = {"env": usual, "cwd": Path(__file__).parents[2], "capture_output": True, "text": True, "check": True}
    ended = subprocess.run([sys.executable, "-c", RENDERS], **options)
    assert ended.stdout.split() == ["0"]


NOWHERE = np.zeros(0)


def box_scene():
    """A scene of one box before a camera, and the camera's number."""
    builder = DiagramBuilder()
    plant, scene_graph = AddMultibodyPlantSceneGraph(builder, 0.01)
    X_WG, colour = RigidTransform([0.1, 0.0, 1.0]), np.array([0.9, 0.1, 0.1, 1.0])
    plant.RegisterVisualGeometry(plant.world_body(), X_WG, Box(0.3, 0.2, 0.2), "box", colour)
    plant.Finalize()
    scene = Scene(builder.Build(), plant, scene_graph)
    lens = Intrinsics(width=64, height=48, fx=60.0, fy=60.0, cx=31.5, cy=23.5)
    cameras = colour_render_camera(lens, RENDERER), depth_render_camera(lens, RENDERER, (0.3, 4.0))
    number = scene.mount(MountedCamera(*cameras, scene_graph.world_frame_id(), RigidTransform()))
    return scene, number


def pictures(scene, camera):
    return [scene.picture(NOWHERE, camera, depth=depth) for depth in (False, True)]


def children():
    """Process ids of this thread's child processes."""
    return {int(each) for each in Path(f"/proc/self/task/{os.getpid()}/children").read_text().split()}


@pytest.fixture(scope="module")
def aside(tmp_path_factory):
    """A scene that a process of its own draws, the camera's number, that process, and a file open at its beginning."""
    before = children()
    with (tmp_path_factory.mktemp("aside") / "lock").open("w") as file:
        scene, camera = box_scene()
        scene.render_aside()
        (process,) = children() - before
        yield scene, camera, process, Path(file.name)


def test_a_process_of_its_own_draws_the_same_bytes(aside):
    for seen, expected in zip(pictures(*aside[:2]), pictures(*box_scene()), strict=True):
        assert np.array_equal(seen, expected)
        assert len(np.unique(seen)) > 1  # the box and the sky


def test_the_process_ends_with_the_scene():
    before = children()
    scene, _ = box_scene()
    scene.render_aside()
    assert len(children() - before) == 1
    del scene
    assert children() == before


def test_scenes_may_end_in_any_order():
    before = children()
    (first, camera), (second, _) = box_scene(), box_scene()
    first.render_aside()
    second.render_aside()
    del first
    assert second.picture(NOWHERE, camera, depth=False).shape == (48, 64, 3)
    del second
    assert children() == before


def test_a_run_is_told_when_the_process_has_died():
    before = children()
    scene, camera = box_scene()
    scene.render_aside()
    (process,) = children() - before
    os.kill(process, signal.SIGKILL)
    with pytest.raises(RuntimeError, match="the process that renders the cameras' pictures has ended"):
        pictures(scene, camera)


def test_a_run_is_told_why_rendering_failed(aside):
    scene, camera, *_ = aside
    with pytest.raises(RuntimeError, match="rendering failed: IndexError"):
        scene.picture(NOWHERE, camera + 1, depth=False)
    assert pictures(scene, camera)[0].shape == (48, 64, 3)


def test_a_terminal_that_interrupts_the_run_leaves_the_process_to_the_run(aside):
    scene, camera, process, _ = aside
    pictures(scene, camera)
    for each in (signal.SIGINT, signal.SIGHUP, signal.SIGTERM):
        os.kill(process, each)
    assert pictures(scene, camera)[0].shape == (48, 64, 3)


def test_the_process_holds_no_file_of_the_run(aside):
    scene, camera, process, file = aside
    pictures(scene, camera)
    held = {each.resolve() for each in Path(f"/proc/{process}/fd").iterdir()}
    assert file.resolve() not in held
