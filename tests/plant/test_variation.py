"""How a plant differs from its files: friction and light."""

from __future__ import annotations

import numpy as np
import pytest
from pydrake.geometry import Box, SceneGraph
from pydrake.math import RigidTransform
from pydrake.multibody.plant import CoulombFriction, MultibodyPlant
from pydrake.multibody.tree import SpatialInertia
from pydrake.systems.framework import DiagramBuilder

from plant.variation import multiply_friction
from plant.worlds.lights import DAY_LIGHT, LIGHTS, Light, light_of, lights, render_parameters


def friction_of(plant: MultibodyPlant, scene_graph: SceneGraph, body: str) -> tuple[float, float]:
    inspector = scene_graph.model_inspector()
    (geometry,) = plant.GetCollisionGeometriesForBody(plant.GetBodyByName(body))
    found = inspector.GetProximityProperties(geometry).GetProperty("material", "coulomb_friction")
    return found.static_friction(), found.dynamic_friction()


def test_the_friction_of_what_moves_is_multiplied_and_that_of_the_floor_stays() -> None:
    builder = DiagramBuilder()
    plant, scene_graph = MultibodyPlant(0.01), builder.AddSystem(SceneGraph())
    plant.RegisterAsSourceForSceneGraph(scene_graph)
    for name in ("floor", "box"):
        body = plant.AddRigidBody(name, SpatialInertia.SolidBoxWithMass(1.0, 0.1, 0.1, 0.1))
        plant.RegisterCollisionGeometry(body, RigidTransform(), Box(0.1, 0.1, 0.1), name, CoulombFriction(0.8, 0.6))
    plant.WeldFrames(plant.world_frame(), plant.GetFrameByName("floor"))
    plant.Finalize()
    multiply_friction(plant, scene_graph, 0.5)
    assert friction_of(plant, scene_graph, "floor") == pytest.approx((0.8, 0.6))
    assert friction_of(plant, scene_graph, "box") == pytest.approx((0.4, 0.3))


def test_a_light_is_named_or_a_brightness() -> None:
    assert light_of("dim") is LIGHTS["dim"]
    assert light_of("0.7") == Light(0.7)


@pytest.mark.parametrize("words", ["moonlight", "7", "-1"])
def test_what_is_no_light_is_refused(words: str) -> None:
    with pytest.raises(ValueError, match=words):
        light_of(words)


def test_a_dim_light_dims_each_beam_and_the_sky() -> None:
    day, dim = lights(DAY_LIGHT), lights(LIGHTS["dim"])
    assert [each.intensity for each in dim] == pytest.approx([0.4 * each.intensity for each in day])
    sky = render_parameters(LIGHTS["dim"]).default_clear_color
    assert np.max(sky) < 0.5


def test_a_low_sun_is_one_beam_more() -> None:
    assert len(lights(LIGHTS["low sun"])) == len(lights()) + 1
