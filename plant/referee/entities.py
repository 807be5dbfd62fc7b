"""Entities to which bodies of the plant belong (robot, object, person, scenery), their contacts and collisions."""

from __future__ import annotations

import enum
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from pydrake.geometry import GeometryId, PenetrationAsPointPair
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import BodyIndex, RigidBody

from plant.saved_state import Stateful
from skills.inputs.errors import definite

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

    The number of a body's entity is the body's index; pieces of scenery have the numbers after the bodies.
    """

    all: Mapping[int, Entity]
    of_geometry: Mapping[GeometryId, int]
    objects: Mapping[str, RigidBody]
    classes: Mapping[str, str]
    sides_m: Mapping[str, tuple[float, float, float]]
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
        """Reads the entities of a finalized plant. Raises ValueError, with the name, for a body that the plant lacks.

        `scenery` maps each collision shape on the world body to its piece of furniture.
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
            sides_m={placed.name: placed.form.sides_m for placed in loose},
            persons={name: _bodies(plant, name)[0] for name in persons},
            bases=bases,
            hands=_links(plant, {name: kind.hand_link for name, kind in robots.items()}),
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
    """Bodies of the named links, by robot; omits robots without that link."""
    return {name: body for name, link in links.items() for body in _bodies(plant, name) if body.name() == link}


Pair = tuple[int, int]

FLOOR_Z_M = 0.04
MOVES_M_S = 0.05
"""Speed just before a contact with a person above which the robot has caused the contact."""


def contact_heights(
    penetrations: Sequence[PenetrationAsPointPair], entity_of_geometry: Mapping[GeometryId, int]
) -> dict[Pair, float]:
    """Height (m) of the lowest contact point for each pair of entities in contact; the lower number comes first."""
    lowest: dict[Pair, float] = {}
    for each in penetrations:
        a, b = entity_of_geometry[each.id_A], entity_of_geometry[each.id_B]
        pair = (a, b) if a < b else (b, a)
        height_m = float(each.p_WCa[2] + each.p_WCb[2]) / 2.0
        lowest[pair] = min(height_m, lowest.get(pair, height_m))
    return lowest


@dataclass(frozen=True)
class Collision:
    """Collision of a robot with an obstacle, with `other_robot` or with a `person`.

    `walked_in` is True when the robot stood still and the person walked into it.
    """

    time_s: float
    robot: str
    part: Kind
    sentence: str
    person: str | None = None
    walked_in: bool = False
    other_robot: str | None = None


class CollisionCounter(Stateful, saved=("_last_touched_s", "collisions")):
    """Counts new contacts between robots and scenery, people or other robots.

    A pair that separates for less than `debounce_s` is still the same collision. Contacts in the first update do not
    count. All contacts between a robot and the same person or the same other robot are one pair.
    """

    def __init__(self, entities: Mapping[int, Entity], debounce_s: float = 0.5) -> None:
        """Starts without collisions. `entities` are all bodies by number."""
        self._entities, self._debounce_s = entities, debounce_s
        self._first_of = {entity.owner: number for number, entity in sorted(entities.items(), reverse=True)}
        self._last_touched_s: dict[Pair, float] | None = None
        self.collisions: list[Collision] = []

    def update(
        self,
        time_s: float,
        pairs: Mapping[Pair, float],
        speeds_m_s: Mapping[str, float],
        touches: Collection[Pair] = (),
    ) -> None:
        """Records the pairs in contact at time_s, with the heights of their lowest contacts.

        `speeds_m_s` are the speeds of the robots just before the contact. The `touches` are no collisions.
        """
        hits = ((pair, z) for pair, z in pairs.items() if pair not in touches)
        touching = {self._counted_as(pair): pair for pair, z in hits if self._counts(pair, z)}
        if self._last_touched_s is None:
            self._last_touched_s = dict.fromkeys(touching, time_s)
        for counted, pair in touching.items():
            if time_s - self._last_touched_s.get(counted, float("-inf")) > self._debounce_s:
                self.collisions.append(self._collision(time_s, pair, speeds_m_s))
            self._last_touched_s[counted] = time_s

    def _counted_as(self, pair: Pair) -> Pair:
        """Pair to count for a contact: whole robots with people and other robots, else the pair itself."""
        a, b = (self._entities[number] for number in pair)
        whole = Kind.PERSON in (a.kind, b.kind) or (a.kind in ROBOT_KINDS and b.kind in ROBOT_KINDS)
        return (self._first_of[a.owner], self._first_of[b.owner]) if whole else pair

    def _counts(self, pair: Pair, z: float) -> bool:
        """Returns whether a contact is a collision: not feet on the floor, a loose object, or a robot with itself."""
        kinds = {self._entities[index].kind for index in pair}
        if Kind.OBJECT in kinds or not kinds & ROBOT_KINDS:
            return False
        if self._entities[pair[0]].owner == self._entities[pair[1]].owner:
            return False
        return not (kinds == {Kind.LEG, Kind.SCENERY} and z < FLOOR_Z_M)

    def _collision(self, time_s: float, pair: Pair, speeds_m_s: Mapping[str, float]) -> Collision:
        first, second = self._entities[pair[0]], self._entities[pair[1]]
        robot, other = (first, second) if first.kind in ROBOT_KINDS else (second, first)
        person = other.owner if other.kind is Kind.PERSON else None
        walked_in = person is not None and speeds_m_s.get(robot.owner, 0.0) <= MOVES_M_S
        other_robot = other.owner if other.kind in ROBOT_KINDS else None
        event = f"{other.label} walked into {robot.label}" if walked_in else f"{robot.label} hit {other.label}"
        return Collision(time_s, robot.owner, robot.kind, f"{event} at {time_s:.2f} s.", person, walked_in, other_robot)
