"""Friction of moving bodies is multiplied."""

import pytest
from pydrake.geometry import Box, SceneGraph
from pydrake.math import RigidTransform
from pydrake.multibody.plant import CoulombFriction, MultibodyPlant
from pydrake.multibody.tree import SpatialInertia
from pydrake.systems.framework import DiagramBuilder

from plant.diagram import multiply_friction


def friction_of(plant, scene_graph, body):
    inspector = scene_graph.model_inspector()
    (geometry,) = plant.GetCollisionGeometriesForBody(plant.GetBodyByName(body))
    found = inspector.GetProximityProperties(geometry).GetProperty("material", "coulomb_friction")
    return found.static_friction(), found.dynamic_friction()


def test_friction_is_multiplied_for_moving_bodies_only():
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
