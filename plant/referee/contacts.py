"""Which bodies touch now, and bumps: touches of a robot with what it should keep clear of, counted once each."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from pydrake.geometry import GeometryId, PenetrationAsPointPair

from plant.referee.entities import ROBOT_KINDS, Entity, Kind
from plant.saved_state import Stateful

Pair = tuple[int, int]

FLOOR_Z_M = 0.04
MOVES_M_S = 0.05
"""A robot that was faster than this all along just before has caused a contact with a person."""


def touching(
    penetrations: Sequence[PenetrationAsPointPair], entity_of_geometry: Mapping[GeometryId, int]
) -> dict[Pair, float]:
    """Pairs of entities' numbers (lower first) in contact, and the height of their lowest contact point (m)."""
    lowest: dict[Pair, float] = {}
    for each in penetrations:
        a, b = entity_of_geometry[each.id_A], entity_of_geometry[each.id_B]
        _lower(lowest, a, b, float(each.p_WCa[2] + each.p_WCb[2]) / 2.0)
    return lowest


def _lower(lowest: dict[Pair, float], a: int, b: int, z: float) -> None:
    pair = (a, b) if a < b else (b, a)
    lowest[pair] = min(z, lowest.get(pair, z))


@dataclass(frozen=True)
class Collision:
    """A robot bumped into something, perhaps `other_robot`, or into a `person`; or that person `walked_in`: into a
    robot that stood.
    """

    time_s: float
    robot: str
    part: Kind
    sentence: str
    person: str | None = None
    walked_in: bool = False
    other_robot: str | None = None


class CollisionCounter(Stateful, saved=("_last_touched_s", "collisions")):
    """Counts rising edges of contact between robots and scenery, persons or other robots.

    A pair that parts for less than `debounce_s` is still the same bump. What touches at first does not count. With a
    person or another robot a robot is one, whatever part of it touches.
    """

    def __init__(self, entities: Mapping[int, Entity], debounce_s: float = 0.5) -> None:
        """Starts with a clean record."""
        self._entities, self._debounce_s = entities, debounce_s
        self._first_of = {entity.owner: number for number, entity in sorted(entities.items(), reverse=True)}
        self._last_touched_s: dict[Pair, float] | None = None
        self.collisions: list[Collision] = []

    def update(self, time_s: float, pairs: Mapping[Pair, float], speeds_m_s: Mapping[str, float]) -> None:
        """Takes in the pairs that touch at time_s, with the height of their lowest contact.

        `speeds_m_s` are those of the robots just before they touched.
        """
        bumps = {self._counted_as(pair): pair for pair, z in pairs.items() if self._is_bump(pair, z)}
        if self._last_touched_s is None:
            self._last_touched_s = dict.fromkeys(bumps, time_s)
        for counted, pair in bumps.items():
            if time_s - self._last_touched_s.get(counted, float("-inf")) > self._debounce_s:
                self.collisions.append(self._collision(time_s, pair, speeds_m_s))
            self._last_touched_s[counted] = time_s

    def _counted_as(self, pair: Pair) -> Pair:
        """The pair itself; with a person or another robot, one that stands for the whole robot."""
        a, b = (self._entities[number] for number in pair)
        whole = Kind.PERSON in (a.kind, b.kind) or (a.kind in ROBOT_KINDS and b.kind in ROBOT_KINDS)
        return (self._first_of[a.owner], self._first_of[b.owner]) if whole else pair

    def _is_bump(self, pair: Pair, z: float) -> bool:
        """Returns whether a touch is a collision: not feet on the floor, not loose objects, not a robot with itself."""
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
        told = f"{other.label} walked into {robot.label}" if walked_in else f"{robot.label} hit {other.label}"
        return Collision(time_s, robot.owner, robot.kind, f"{told} at {time_s:.2f} s.", person, walked_in, other_robot)
