"""Contacts between bodies, and collisions: contacts of a robot with an obstacle, each counted once."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from pydrake.geometry import GeometryId, PenetrationAsPointPair

from plant.referee.entities import ROBOT_KINDS, Entity, Kind
from plant.saved_state import Stateful

Pair = tuple[int, int]

FLOOR_Z_M = 0.04
MOVES_M_S = 0.05
"""A robot that was faster than this just before a contact with a person has caused the contact."""


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

    The person has `walked_in` when the robot stood still.
    """

    time_s: float
    robot: str
    part: Kind
    sentence: str
    person: str | None = None
    walked_in: bool = False
    other_robot: str | None = None


class CollisionCounter(Stateful, saved=("_last_touched_s", "collisions")):
    """Counter of new contacts between robots and scenery, people or other robots.

    A pair that parts for less than `debounce_s` is still the same collision. Contacts of the first update do not count.
    All contacts of a robot with the same person or the same other robot are one pair, whichever parts touch.
    """

    def __init__(self, entities: Mapping[int, Entity], debounce_s: float = 0.5) -> None:
        """Starts without collisions. `entities` are all bodies by number."""
        self._entities, self._debounce_s = entities, debounce_s
        self._first_of = {entity.owner: number for number, entity in sorted(entities.items(), reverse=True)}
        self._last_touched_s: dict[Pair, float] | None = None
        self.collisions: list[Collision] = []

    def update(self, time_s: float, pairs: Mapping[Pair, float], speeds_m_s: Mapping[str, float]) -> None:
        """Records the pairs in contact at time_s, with the heights of their lowest contacts.

        `speeds_m_s` has the speed of each robot just before the contact.
        """
        touching = {self._counted_as(pair): pair for pair, z in pairs.items() if self._counts(pair, z)}
        if self._last_touched_s is None:
            self._last_touched_s = dict.fromkeys(touching, time_s)
        for counted, pair in touching.items():
            if time_s - self._last_touched_s.get(counted, float("-inf")) > self._debounce_s:
                self.collisions.append(self._collision(time_s, pair, speeds_m_s))
            self._last_touched_s[counted] = time_s

    def _counted_as(self, pair: Pair) -> Pair:
        """Pair that stands for a contact: whole robots with people and other robots, else the pair itself."""
        a, b = (self._entities[number] for number in pair)
        whole = Kind.PERSON in (a.kind, b.kind) or (a.kind in ROBOT_KINDS and b.kind in ROBOT_KINDS)
        return (self._first_of[a.owner], self._first_of[b.owner]) if whole else pair

    def _counts(self, pair: Pair, z: float) -> bool:
        """Returns whether a contact is a collision: no feet on the floor, no loose object, no robot with itself."""
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
