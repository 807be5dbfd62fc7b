"""Friction of what moves in a plant."""

from __future__ import annotations

from typing import Final

from pydrake.geometry import ProximityProperties, RoleAssign, SceneGraph
from pydrake.multibody.plant import CoulombFriction, MultibodyPlant
from pydrake.multibody.tree import BodyIndex

_MATERIAL: Final = "material"
_FRICTION: Final = "coulomb_friction"


def multiply_friction(plant: MultibodyPlant, scene_graph: SceneGraph, factor: float) -> None:
    """Multiplies the friction coefficients of all bodies that are not fixed to the world; the plant is finalized."""
    inspector, source = scene_graph.model_inspector(), plant.get_source_id()
    for body in (plant.get_body(BodyIndex(index)) for index in range(plant.num_bodies())):
        for geometry in () if plant.IsAnchored(body) else plant.GetCollisionGeometriesForBody(body):
            properties = ProximityProperties(inspector.GetProximityProperties(geometry))
            known = properties.GetPropertyOrDefault(_MATERIAL, _FRICTION, CoulombFriction(1.0, 1.0))
            changed = CoulombFriction(factor * known.static_friction(), factor * known.dynamic_friction())
            properties.UpdateProperty(_MATERIAL, _FRICTION, changed)
            scene_graph.AssignRole(source, geometry, properties, RoleAssign.kReplace)
