"""Entities of the plant: the robot, object, person or piece of scenery that each body belongs to."""

from __future__ import annotations

import enum
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from pydrake.geometry import GeometryId
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import BodyIndex, RigidBody

from skills.files.errors import definite

if TYPE_CHECKING:
    from plant.robots.robot_kind import RobotKind
    from plant.worlds.seeding import Placement


class Kind(enum.Enum):
    """Kind of a body, as the referee distinguishes them."""

    SCENERY = "scenery"
    PERSON = "person"
    TRAY = "tray"
    OBJECT = "object"
    BODY = "body"
    LEG = "leg"
    ARM = "arm"
    GRIPPER = "gripper"


_NAMELESS_INSTANCES = frozenset({"WorldModelInstance", "DefaultModelInstance"})
ROBOT_KINDS = frozenset({Kind.BODY, Kind.LEG, Kind.ARM, Kind.GRIPPER})


@dataclass(frozen=True)
class Entity:
    """Role of one body: its kind, the model instance that owns it, and its name in sentences."""

    kind: Kind
    owner: str
    label: str


BASE_LINK = "body"


def _kind_of_link(link: str, robot: RobotKind) -> Kind:
    """Kind of a robot's link."""
    if link in robot.gripper_links:
        return Kind.GRIPPER
    if link in robot.trunk_links:
        return Kind.BODY
    return Kind.LEG if link in robot.leg_links else Kind.ARM


@dataclass(frozen=True)
class Entities:
    """All entities by number, the entity of each collision shape, and the bodies whose motion is observed.

    The number of a body's entity is the body's index; pieces of the scenery have the numbers after the bodies.
    """

    all: Mapping[int, Entity]
    of_geometry: Mapping[GeometryId, int]
    objects: Mapping[str, RigidBody]
    classes: Mapping[str, str]
    persons: Mapping[str, RigidBody]
    bases: Mapping[str, RigidBody]
    hands: Mapping[str, RigidBody]

    @staticmethod
    def from_plant(
        plant: MultibodyPlant,
        placements: Iterable[Placement],
        robots: Mapping[str, RobotKind],
        persons: Sequence[str],
        scenery: Mapping[GeometryId, str],
    ) -> Entities:
        """Reads the entities of a finalized plant. Raises ValueError with the name that the plant does not have.

        `scenery` names the piece of furniture of each collision shape of the world body.
        """
        loose = [placed for placed in placements if placed.name not in persons]
        objects = {placed.name: _bodies(plant, placed.name)[0] for placed in loose}
        roles = {int(body.index()): Entity(Kind.OBJECT, name, definite(name)) for name, body in objects.items()}
        entities = {int(body.index()): _scenery(plant, body) for body in _all_bodies(plant)} | roles
        for name in persons:
            entities |= {int(body.index()): Entity(Kind.PERSON, name, name) for body in _bodies(plant, name)}
            tray = f"{name}'s tray"
            if plant.HasModelInstanceNamed(tray):
                entities[int(_bodies(plant, tray)[0].index())] = Entity(Kind.TRAY, name, tray)
        for name in robots:
            for body in _bodies(plant, name):
                kind = _kind_of_link(body.name(), robots[name])
                entities[int(body.index())] = Entity(kind, name, f"{name}'s {kind.value} ({body.name()})")
        bases = _links(plant, dict.fromkeys(robots, BASE_LINK))
        for name in set(robots) - set(bases):
            raise ValueError(f"robot {name!r} has no link {BASE_LINK!r}")
        pieces = {name: plant.num_bodies() + number for number, name in enumerate(sorted({*scenery.values()}))}
        entities |= {number: Entity(Kind.SCENERY, name, f"the {name}") for name, number in pieces.items()}
        return Entities(
            all=entities,
            of_geometry={
                each: int(body.index())
                for body in _all_bodies(plant)
                for each in plant.GetCollisionGeometriesForBody(body)
            }
            | {each: pieces[name] for each, name in scenery.items()},
            objects=objects,
            classes={placed.name: placed.class_name for placed in loose},
            persons={name: _bodies(plant, name)[0] for name in persons},
            bases=bases,
            hands=_links(plant, {name: kind.gripper_links[0] for name, kind in robots.items()}),
        )


def _scenery(plant: MultibodyPlant, body: RigidBody) -> Entity:
    """Entity of a body of the scenery, with the name of its model."""
    instance = plant.GetModelInstanceName(body.model_instance())
    name = body.name() if instance in _NAMELESS_INSTANCES else instance
    return Entity(Kind.SCENERY, name, f"the {name}")


def _all_bodies(plant: MultibodyPlant) -> list[RigidBody]:
    return [plant.get_body(BodyIndex(i)) for i in range(plant.num_bodies())]


def _bodies(plant: MultibodyPlant, instance_name: str) -> list[RigidBody]:
    """All bodies of a model instance. Raises ValueError when the plant has no such instance."""
    if not plant.HasModelInstanceNamed(instance_name):
        raise ValueError(f"the referee expects {instance_name!r}, but the plant has no model instance of that name")
    instance = plant.GetModelInstanceByName(instance_name)
    return [plant.get_body(index) for index in plant.GetBodyIndices(instance)]


def _links(plant: MultibodyPlant, links: Mapping[str, str]) -> dict[str, RigidBody]:
    """The named link of each robot that has it."""
    return {name: body for name, link in links.items() for body in _bodies(plant, name) if body.name() == link}
