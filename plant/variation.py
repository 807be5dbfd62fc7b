"""How a simulation differs from what its world's files say."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from pydrake.geometry import ProximityProperties, RoleAssign, SceneGraph
from pydrake.multibody.plant import CoulombFriction, MultibodyPlant
from pydrake.multibody.tree import BodyIndex

from plant.worlds.lights import DAY_LIGHT, Light

__all__ = ["AS_IT_IS", "Variation", "multiply_friction"]

_MATERIAL: Final = "material"
_FRICTION: Final = "coulomb_friction"


@dataclass(frozen=True)
class Variation:
    """The `light`, how many more objects lie about (`clutter`), and a factor on `friction` coefficients.

    Clutter is of none of the classes in `spared`. The factor is on those of all that moves: loose objects and robots.
    """

    light: Light = DAY_LIGHT
    clutter: int = 0
    spared: frozenset[str] = frozenset()
    friction: float = 1.0


AS_IT_IS: Final = Variation()


def multiply_friction(plant: MultibodyPlant, scene_graph: SceneGraph, factor: float) -> None:
    """Multiply the friction coefficients of all bodies that are not fixed to the world; the plant is finalized."""
    inspector, source = scene_graph.model_inspector(), plant.get_source_id()
    for body in (plant.get_body(BodyIndex(index)) for index in range(plant.num_bodies())):
        for geometry in () if plant.IsAnchored(body) else plant.GetCollisionGeometriesForBody(body):
            properties = ProximityProperties(inspector.GetProximityProperties(geometry))
            known = properties.GetPropertyOrDefault(_MATERIAL, _FRICTION, CoulombFriction(1.0, 1.0))
            changed = CoulombFriction(factor * known.static_friction(), factor * known.dynamic_friction())
            properties.UpdateProperty(_MATERIAL, _FRICTION, changed)
            scene_graph.AssignRole(source, geometry, properties, RoleAssign.kReplace)
