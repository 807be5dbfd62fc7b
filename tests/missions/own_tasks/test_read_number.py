"""The reader of displays, tried on drawn pictures of meters, with the noise of the hand camera."""

from dataclasses import replace

import numpy as np
import pytest
from pydrake.geometry import Box
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
from pydrake.systems.framework import DiagramBuilder

from executive.words.variation import LIGHTS
from plant.rendering import RENDERER, Scene, render_parameters
from plant.scene_pictures import look_at
from plant.sensors.camera_spec import colour_render_camera, depth_render_camera
from plant.sensors.noise import DepthDegrader, DepthNoise, PictureDegrader, PictureNoise
from skills.robot import FrameTree, Image, Intrinsics
from tests.missions.own_tasks.meter import BODY_M, LIT, SEGMENTS, meter_sdf
from tests.missions.own_tasks.read_number import digits, read_number

LENS = Intrinsics(width=640, height=480, fx=552.03, fy=552.03, cx=320.0, cy=240.0)
MIDDLE_W = np.array([BODY_M[0], 0.0, 1.0])
LIGHT = ("normal", "dim", "bright", "evening")


def meter_scene(number, light="normal", lit=LIT, before=()):
    """A meter that shows a number, on a bright wall at x = 0, and boxes `before` it, each at a y."""
    builder = DiagramBuilder()
    plant, scene_graph = AddMultibodyPlantSceneGraph(builder, 0.01)
    plant.RegisterVisualGeometry(
        plant.world_body(), RigidTransform([-0.05, 0.0, 1.0]), Box(0.1, 4.0, 2.0), "wall", [0.85, 0.84, 0.8, 1.0]
    )
    for y in before:
        X_WG = RigidTransform([0.15, y, 1.0])
        plant.RegisterVisualGeometry(plant.world_body(), X_WG, Box(0.02, 0.05, 0.3), f"box at {y}", [0.8, 0.8, 0.8, 1])
    Parser(plant).AddModelsFromString(meter_sdf(number, lit), "sdf")
    plant.WeldFrames(plant.world_frame(), plant.GetFrameByName("meter"), RigidTransform([BODY_M[0] / 2, 0.0, 1.0]))
    plant.Finalize()
    return Scene(builder.Build(), plant, scene_graph, render_parameters(LIGHTS[light])), scene_graph.world_frame_id()


def picture(scene, X_WC, rng):
    """Takes a noisy picture of a scene, as the sensors of the plant do."""
    (drawn, world), size = scene, (LENS.height, LENS.width)
    query = drawn.query_at(np.zeros(0))
    colour = np.array(query.RenderColorImage(colour_render_camera(LENS, RENDERER), world, X_WC).data[..., :3])
    clean_m = query.RenderDepthImage(depth_render_camera(LENS, RENDERER, (0.2, 4.0)), world, X_WC).data[..., 0]
    colour = PictureDegrader(rng, *size, PictureNoise()).colour(colour)
    grey = colour.mean(axis=2).astype(np.uint8)
    depth_m = DepthDegrader(rng, LENS, (0.2, 4.0), DepthNoise()).depth(np.array(clean_m), grey)
    frames = FrameTree({"camera": ("odom", X_WC)})
    return Image(0.0, "hand", "camera", LENS, LENS, colour, grey, depth_m, frames)


AHEAD = look_at(MIDDLE_W + [0.5, 0.1, 0.1], MIDDLE_W)


def read_ahead(**scene):
    """What is read on a meter of 64 from half a metre ahead, with changes to the scene."""
    return read_number(picture(meter_scene("64", **scene), AHEAD, np.random.default_rng(1)), AHEAD, MIDDLE_W)


def drawn_trial(seed, far_m):
    """A drawn number, light, pose of the camera, and error of the known place; returns the number and what is read."""
    rng = np.random.default_rng(seed)
    number = "".join(rng.choice(list("0123456789"), rng.integers(1, 5)))
    turn, rise = rng.uniform(-0.8, 0.8), rng.uniform(-0.4, 0.6)
    towards = np.array([np.cos(turn) * np.cos(rise), np.sin(turn) * np.cos(rise), np.sin(rise)])
    aim = MIDDLE_W + rng.uniform(-0.04, 0.04, 3) * [0, 1, 1]
    roll = RigidTransform(RollPitchYaw(0.0, 0.0, rng.uniform(-0.3, 0.3)), [0.0, 0.0, 0.0])
    X_WC = look_at(MIDDLE_W + rng.uniform(*far_m) * towards, aim) @ roll
    image = picture(meter_scene(number, LIGHT[seed % 4]), X_WC, rng)
    believed_W = RigidTransform(RollPitchYaw(0.0, 0.0, rng.normal(0.0, 0.01)), rng.normal(0.0, 0.01, 3))
    return number, read_number(image, believed_W @ X_WC, MIDDLE_W), image


@pytest.mark.parametrize(("far_m", "fewest"), [((0.35, 0.7), 7), ((0.7, 1.2), 6), ((1.2, 2.5), 3)])
def test_most_drawn_numbers_are_read_and_none_is_read_wrong(far_m, fewest):
    trials = [drawn_trial(seed, far_m)[:2] for seed in range(8)]
    assert [(number, read) for number, read in trials if read not in (number, None)] == []
    assert sum(read == number for number, read in trials) >= fewest


def test_a_display_is_read_from_ahead():
    assert read_ahead() == "64"


@pytest.mark.parametrize(
    "scene",
    [
        pytest.param({"lit": LIT | {"6": "afecd"}}, id="a segment is broken"),
        pytest.param({"lit": LIT | {"6": "", "4": ""}}, id="the display is off"),
        pytest.param({"before": (-0.03,)}, id="something hides a digit"),
    ],
)
def test_no_number_is_guessed(scene):
    assert read_ahead(**scene) is None


def test_a_segment_that_is_half_lit_is_not_certain():
    lit = np.zeros((200, 200), dtype=bool)
    for left, right, top, bottom in SEGMENTS.values():
        lit[50 + round(100 * top) : 50 + round(100 * bottom), 50 + round(100 * left) : 50 + round(100 * right)] = True
    assert digits(lit) == "8"
    lit[50 + 43 : 50 + 57, 50 + 14 : 50 + 27] = False
    assert digits(lit) is None


def test_a_picture_without_contrast_shows_no_number():
    image = picture(meter_scene("64"), AHEAD, np.random.default_rng(1))
    assert read_number(replace(image, colour=np.full_like(image.colour, 128)), AHEAD, MIDDLE_W) is None


def test_a_wall_without_a_display_shows_no_number():
    there_W = MIDDLE_W + [-BODY_M[0], 0.6, 0.0]
    X_WC = look_at(there_W + [0.5, 0.1, 0.1], there_W)
    assert read_number(picture(meter_scene("64"), X_WC, np.random.default_rng(1)), X_WC, there_W) is None
