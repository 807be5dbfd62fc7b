"""Which bodies touch now, and bumps: touches of a robot with what it should keep clear of, counted once each."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from pydrake.geometry import GeometryId, PenetrationAsPointPair

from plant.referee.entities import ROBOT_KINDS, Entity, Kind
from plant.snapshot.values import State

Pair = tuple[int, int]

FLOOR_Z_M = 0.04


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
    """A robot bumped into something."""

    time_s: float
    robot: str
    part: Kind
    sentence: str


class CollisionCounter:
    """Counts rising edges of contact between robots and scenery, persons or other robots.

    A pair that parts for less than `debounce_s` is still the same bump. What touches at first does not count.
    """

    def __init__(self, entities: Mapping[int, Entity], debounce_s: float = 0.5) -> None:
        """Start with a clean record."""
        self._entities, self._debounce_s = entities, debounce_s
        self._last_touched_s: dict[Pair, float] | None = None
        self.collisions: list[Collision] = []

    def update(self, time_s: float, pairs: Mapping[Pair, float]) -> None:
        """Take in the pairs that touch at time_s, with the height of their lowest contact."""
        bumps = [pair for pair, z in pairs.items() if self._is_bump(pair, z)]
        if self._last_touched_s is None:
            self._last_touched_s = dict.fromkeys(bumps, time_s)
        for pair in bumps:
            if time_s - self._last_touched_s.get(pair, float("-inf")) > self._debounce_s:
                self.collisions.append(self._collision(time_s, pair))
            self._last_touched_s[pair] = time_s

    def state(self) -> State:
        """The record so far."""
        touched = None if self._last_touched_s is None else [[*pair, t] for pair, t in self._last_touched_s.items()]
        bumps = [[bump.time_s, bump.robot, bump.part.value, bump.sentence] for bump in self.collisions]
        return {"touched": touched, "bumps": bumps}

    def restore(self, state: State) -> None:
        """Go on with such a record."""
        touched = state["touched"]
        self._last_touched_s = None if touched is None else {(a, b): time_s for a, b, time_s in touched}
        self.collisions = [Collision(time_s, robot, Kind(part), told) for time_s, robot, part, told in state["bumps"]]

    def _is_bump(self, pair: Pair, z: float) -> bool:
        """Whether a touch is a collision: not feet on the floor, not loose objects, not a robot with itself."""
        kinds = {self._entities[index].kind for index in pair}
        if Kind.OBJECT in kinds or not kinds & ROBOT_KINDS:
            return False
        if self._entities[pair[0]].owner == self._entities[pair[1]].owner:
            return False
        return not (kinds == {Kind.LEG, Kind.SCENERY} and z < FLOOR_Z_M)

    def _collision(self, time_s: float, pair: Pair) -> Collision:
        first, second = self._entities[pair[0]], self._entities[pair[1]]
        robot, other = (first, second) if first.kind in ROBOT_KINDS else (second, first)
        sentence = f"{robot.label} hit {other.label} at {time_s:.2f} s."
        return Collision(time_s, robot.owner, robot.kind, sentence)
