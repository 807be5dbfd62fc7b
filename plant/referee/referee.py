"""The referee: observes the true state while the plant runs, and judges goal conditions afterwards."""

from __future__ import annotations

import math
from collections import ChainMap, deque
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np
from pydrake.geometry import GeometryId
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.math import SpatialVelocity
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import BodyIndex
from pydrake.systems.framework import Context

from executive.words.goal import GoalCondition, RefereeReport
from plant.referee.entities import FLOOR_Z_M, Collision, CollisionCounter, Entities, Kind, Pair, contact_heights
from plant.referee.judge import judge
from plant.referee.object_history import (
    Lift,
    ObjectHistory,
    ObjectSample,
    TakenPicture,
    TimedPath,
    TimedPoses,
    Truth,
    extend_path,
    extend_stays,
)
from plant.saved_state import State, Stateful
from skills.robot import FloatArray

if TYPE_CHECKING:
    from plant.robots.robot_kind import RobotKind
    from plant.worlds.seeding import Placement

PATH_VALUES = 4
MOST_COLUMNS = 64
"""Columns of the depth of a picture that is kept."""
BEFORE_SAMPLES = 3
HAND, HAND_TURN, HAND_STEP = "hand of {}", "turn of the hand of {}", 0.02
"""Names of a hand's paths (positions; roll, pitch and yaw), and its least motion (m, rad) that they record."""
TOUCH_M_S, TOUCH_N, TIPS_M = 0.05, 20.0, 0.04
"""Most speed and force of an expected touch, and the length of the fingertips, which alone may touch."""
MOST_POINTS = 20_000
"""Most points of a person's path, to bound the memory of a long run with a crowd."""


DoorHistories = Callable[[], Mapping[tuple[float, float], Sequence[tuple[float, float]]]]
"""Returns the changes of each door by its position, as in `Truth.doors`."""


class Referee(Stateful, saved=("_counter", "_histories", "_given", "_now_s", "_bases", "_persons", "_pictures")):
    """Referee of one plant: call `observe` at about 20 Hz while it runs, and `judge` at any time.

    Its saved state is the whole record without the paths; `points` returns these growing arrays by name.
    """

    def __init__(
        self,
        plant: MultibodyPlant,
        placements: Iterable[Placement],
        *,
        robots: Mapping[str, RobotKind],
        persons: Sequence[str] = (),
        scenery: Mapping[GeometryId, str] = MappingProxyType({}),
        doors: DoorHistories = dict,
    ) -> None:
        """`plant` is finalized; `scenery` maps each collision shape on the world body to its piece of furniture.

        `placements` are the loose objects and the people; `persons` names the people. `robots` maps the name of each
        robot's model instance to its kind. Raises ValueError, with the name, for a model that the plant lacks.
        """
        self._plant, self._geometry = plant, plant.get_geometry_query_input_port()
        self._people = {each.name: each for each in placements if each.name in persons}
        self._entities = Entities.from_plant(plant, placements, robots, persons, scenery)
        self._doors = doors
        self._counter = CollisionCounter(self._entities.all)
        classes, sides_m = self._entities.classes, self._entities.sides_m
        self._histories = {
            name: ObjectHistory(name, classes[name], sides_m[name], body.default_mass())
            for name, body in self._entities.objects.items()
        }
        self._paths: dict[str, list[FloatArray]] = {name: [] for name in robots}
        hand_paths = [path.format(name) for name in self._entities.hands for path in (HAND, HAND_TURN)]
        self._hand_paths: dict[str, list[FloatArray]] = {name: [] for name in hand_paths}
        self._given: dict[tuple[str, str], list[tuple[float, float]]] = {}
        self.contact_points = 0
        self._bases: dict[str, FloatArray] = {}
        self._persons: dict[str, FloatArray] = {}
        self._person_paths: dict[str, list[FloatArray]] = {name: [] for name in self._entities.persons}
        self._now_s = 0.0
        self._pictures: tuple[TakenPicture, ...] = ()
        self._speeds_m_s: deque[Mapping[str, float]] = deque(maxlen=BEFORE_SAMPLES)
        grippers = ((name, kind.capabilities().gripper) for name, kind in robots.items())
        self._tips_m = {name: each.fixed_tip_x_m - TIPS_M for name, each in grippers if each is not None}
        self._touches_until_s: dict[str, float] = {}
        links = [number for number, entity in self._entities.all.items() if entity.kind is Kind.GRIPPER]
        self._gripper_links = {number: plant.get_body(BodyIndex(number)) for number in links}
        self._before: dict[int, SpatialVelocity] = {}
        """Velocities of the grippers' links at the last sample, while a touch was expected."""
        self._touching: set[Pair] = set()

    @property
    def collisions(self) -> tuple[Collision, ...]:
        """All collisions so far, including those in which a person walked into a robot."""
        return tuple(self._counter.collisions)

    @property
    def drops(self) -> int:
        """Number of drops so far."""
        return sum(history.drops for history in self._histories.values())

    @property
    def objects(self) -> Mapping[str, ObjectHistory]:
        """History of each loose object, by name."""
        return dict(self._histories)

    @property
    def events(self) -> tuple[str, ...]:
        """Sentences about the events so far: lifts, drops and collisions."""
        events = [event for history in self._histories.values() for event in history.events]
        return (*events, *(collision.sentence for collision in self._counter.collisions))

    def lifts(self, robot: str) -> tuple[Lift, ...]:
        """Lifts by a robot so far, sorted by time."""
        all_lifts = (lift for history in self._histories.values() for lift in history.lifts if lift.robot == robot)
        return tuple(sorted(all_lifts, key=lambda lift: lift.time_s))

    def path(self, robot: str) -> FloatArray:
        """Path of a robot's body so far, (N, 3) in the world, a point every few centimetres. Raises KeyError."""
        return _timed(self._paths[robot])[:, :3]

    def observe(self, plant_context: Context, time_s: float, *, asleep: Collection[str] = ()) -> None:
        """Records the plant's state at time_s; the objects in `asleep` have not moved since the last call."""
        penetrations = self._geometry.Eval(plant_context).ComputePointPairPenetration()
        self.contact_points += len(penetrations)
        pairs = contact_heights(penetrations, self._entities.of_geometry)
        expects = any(until_s >= time_s for until_s in self._touches_until_s.values())
        gentle = self._touches(plant_context, pairs, time_s) if expects else set[Pair]()
        links = self._gripper_links.items() if expects else ()
        self._before = {n: self._plant.EvalBodySpatialVelocityInWorld(plant_context, link) for n, link in links}
        self._touching = set(pairs)
        self._counter.update(time_s, pairs, self._speeds_before(), gentle)
        self._speeds_m_s.append(self._speeds(plant_context))
        self._bases = {name: self._position(plant_context, body) for name, body in self._entities.bases.items()}
        self._persons = {name: self._position(plant_context, body) for name, body in self._entities.persons.items()}
        for name, p_WB in self._bases.items():
            extend_path(self._paths[name], p_WB, time_s)
        for name, p_W in self._persons.items():
            extend_path(self._person_paths[name], p_W, time_s, MOST_POINTS)
        for name, body in self._entities.hands.items():
            self._extend_hand(name, self._plant.EvalBodyPoseInWorld(plant_context, body), time_s)
        self._now_s = time_s
        neighbours = self._neighbours(pairs)
        for name, body in self._entities.objects.items():
            history, touches = self._histories[name], neighbours.get(int(body.index()), {})
            if name in asleep:
                history.stay(time_s)
            else:
                history.add(self._sample(plant_context, time_s, self._position(plant_context, body), touches))
        for history in self._histories.values():
            if history.on_tray_of is not None:
                extend_stays(self._given.setdefault((history.name, history.on_tray_of), []), time_s)

    def _hand(self, robot: str) -> tuple[list[FloatArray], list[FloatArray]]:
        return self._hand_paths[HAND.format(robot)], self._hand_paths[HAND_TURN.format(robot)]

    def _extend_hand(self, robot: str, X_WH: RigidTransform, time_s: float) -> None:
        """Appends the pose of a hand to its two paths when the hand has moved or turned."""
        paths, pose = self._hand(robot), (X_WH.translation(), RollPitchYaw(X_WH.rotation()).vector())
        last = [path[-1][:3] for path in paths if path]
        if not last or float(np.max(np.abs(np.subtract(pose, last)))) >= HAND_STEP:
            for path, values in zip(paths, pose, strict=True):
                path.append(np.append(values, time_s))

    def expect_touch(self, robot: str, until_s: float) -> None:
        """Records that a robot says that its fingertips may touch a surface until a time."""
        self._touches_until_s[robot] = until_s

    def _touches(self, plant_context: Context, pairs: Mapping[Pair, float], time_s: float) -> set[Pair]:
        """Pairs that touch as a robot expects it: only with its fingertips, slowly, and with little force."""
        entities, speeds_m_s, forces_n = self._entities, dict[Pair, float](), dict[Pair, float]()
        expecting = {name for name, until_s in self._touches_until_s.items() if until_s >= time_s}
        for pair in pairs:
            kinds = {entities.all[number].kind: entities.all[number] for number in pair}
            if kinds.keys() == {Kind.GRIPPER, Kind.SCENERY} and kinds[Kind.GRIPPER].owner in expecting:
                forces_n[pair] = speeds_m_s[pair] = 0.0
        if not forces_n:
            return set()
        results = self._plant.get_contact_results_output_port().Eval(plant_context)
        for each in map(results.point_pair_contact_info, range(results.num_point_pair_contacts())):
            a, b = (entities.of_geometry[number] for number in (each.point_pair().id_A, each.point_pair().id_B))
            pair = (a, b) if a < b else (b, a)
            if pair not in forces_n:
                continue
            link = next(number for number in pair if entities.all[number].kind is Kind.GRIPPER)
            speed_m_s, ahead_m = self._motion(plant_context, link, each.contact_point(), pair in self._touching)
            beyond = ahead_m < self._tips_m[entities.all[link].owner]
            speeds_m_s[pair] = math.inf if beyond else max(speeds_m_s[pair], speed_m_s)
            forces_n[pair] += float(np.linalg.norm(each.contact_force()))
        return {pair for pair in forces_n if speeds_m_s[pair] < TOUCH_M_S and forces_n[pair] < TOUCH_N}

    def _motion(self, plant_context: Context, link: int, p_W: FloatArray, touched: bool) -> tuple[float, float]:
        """Speed (m/s) of a gripper's link at a point, and how far the point is ahead of the hand's origin (m).

        A link that had not `touched` at the last sample may have been faster then than after the contact.
        """
        body, hand = self._gripper_links[link], self._entities.hands[self._entities.all[link].owner]
        now = self._plant.EvalBodySpatialVelocityInWorld(plant_context, body)
        off_W = p_W - self._plant.EvalBodyPoseInWorld(plant_context, body).translation()
        p_H = self._plant.EvalBodyPoseInWorld(plant_context, hand).inverse() @ p_W
        moved = [now] if touched else [now, self._before.get(link, now)]
        return max(float(np.linalg.norm(V_WB.Shift(off_W).translational())) for V_WB in moved), float(p_H[0])

    def judge(self, conditions: Sequence[GoalCondition]) -> RefereeReport:
        """Judges all conditions at the times at which they must hold. Raises ValueError before the first sample."""
        if not self._bases:
            raise ValueError("the referee has not observed anything yet")
        truth = Truth(
            now_s=self._now_s,
            histories=tuple(self._histories.values()),
            robots={name: TimedPath(_timed(path)) for name, path in self._paths.items()},
            persons={name: TimedPath(_timed(path)) for name, path in self._person_paths.items()},
            given=dict(self._given),
            doors=self._doors(),
            pictures=self._pictures,
            hands={name: TimedPoses(*map(TimedPath, map(_timed, self._hand(name)))) for name in self._entities.hands},
            people=self._people,
        )
        return judge(conditions, truth, collisions=self._counter.collisions)

    def resume(self, state: State, paths: Mapping[str, FloatArray]) -> None:
        """Restores a record with the paths of robots and people, (N, 4) like `points`.

        Raises KeyError when a name is unknown, and ValueError when a shape is wrong.
        """
        if any(path.shape[1:] != (PATH_VALUES,) for path in paths.values()):
            raise ValueError("the paths have no times")
        self.restore(state)
        for name, path in paths.items():
            self._path(name)[:] = path

    def forget_past(self) -> None:
        """Clears the record, so that only later events count for the next mission."""
        self._counter.collisions, self._given, self._pictures = [], {}, ()
        self._paths = {name: [] for name in self._paths}
        self._person_paths = {name: [] for name in self._person_paths}
        self._hand_paths = {name: [] for name in self._hand_paths}
        for history in self._histories.values():
            history.forget_past()

    def record_move(self, name: str, plant_context: Context, time_s: float) -> None:
        """Records a person's move of an object to its present pose. Raises KeyError for an unknown object."""
        self._histories[name].record_move(self._position(plant_context, self._entities.objects[name]), time_s)

    def record_picture(self, taken: TakenPicture) -> None:
        """Records a picture that a robot has just taken, with the objects that it shows."""
        seen = frozenset(name for name, each in self._histories.items() if taken.shows(each.last.p_WO))
        step = max(1, taken.lens.width // MOST_COLUMNS)
        coarse = replace(taken, depth_m=taken.depth_m[::step, ::step], step=step, seen=seen)
        self._pictures = (*self._pictures, coarse)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the paths: of robots, people and hands."""
        return (*sorted(self._paths), *sorted(self._person_paths), *sorted(self._hand_paths))

    def points(self, name: str) -> Sequence[FloatArray]:
        """Points of a path with their times (s); do not change them. Raises KeyError.

        The paths of a robot and its hand only grow; a long path of a person loses some of its older points.
        """
        return self._path(name)

    def _path(self, name: str) -> list[FloatArray]:
        return ChainMap(self._paths, self._person_paths, self._hand_paths)[name]

    def _speeds_before(self) -> dict[str, float]:
        """Lowest recent speed of each robot, so that a push that has just begun does not count as its own motion."""
        names = self._speeds_m_s[-1] if self._speeds_m_s else ()
        return {name: min(speeds[name] for speeds in self._speeds_m_s) for name in names}

    def _speeds(self, plant_context: Context) -> dict[str, float]:
        """Speed (m/s) of each robot, the higher of its body's and its hand's; empty when the world has no people."""
        if not self._entities.persons:
            return {}
        speeds: dict[str, float] = {}
        for name, body in (*self._entities.bases.items(), *self._entities.hands.items()):
            v_W = self._plant.EvalBodySpatialVelocityInWorld(plant_context, body).translational()
            speeds[name] = max(speeds.get(name, 0.0), math.hypot(*v_W.tolist()))
        return speeds

    def _position(self, plant_context: Context, body: object) -> FloatArray:
        """Position (3,) of a body's origin in the world."""
        return np.array(self._plant.EvalBodyPoseInWorld(plant_context, body).translation())

    def _neighbours(self, pairs: Mapping[Pair, float]) -> dict[int, dict[int, float]]:
        """Bodies in contact with each object, with the height of their lowest contact, by the object's number."""
        found: dict[int, dict[int, float]] = {}
        for (a, b), z in pairs.items():
            for this, other in ((a, b), (b, a)):
                if self._entities.all[this].kind is Kind.OBJECT:
                    found.setdefault(this, {})[other] = z
        return found

    def _sample(
        self, plant_context: Context, time_s: float, p_WO: FloatArray, touches: Mapping[int, float]
    ) -> ObjectSample:
        """Present sample of an object, with the bodies that touch it."""
        entities = {index: self._entities.all[index] for index in touches}
        gripper = next((entity.owner for entity in entities.values() if entity.kind is Kind.GRIPPER), None)
        hand = None if gripper is None else self._entities.hands.get(gripper)
        still = (Kind.SCENERY, Kind.PERSON, Kind.TRAY, Kind.OBJECT)
        return ObjectSample(
            time_s=time_s,
            p_WO=p_WO,
            gripper=gripper,
            X_WH=None if hand is None else self._plant.EvalBodyPoseInWorld(plant_context, hand),
            supported=any(entity.kind in still for entity in entities.values()),
            on_floor=any(entities[i].kind is Kind.SCENERY and z < FLOOR_Z_M for i, z in touches.items()),
            tray_of=next((entity.owner for entity in entities.values() if entity.kind is Kind.TRAY), None),
        )


def _timed(path: Sequence[FloatArray]) -> FloatArray:
    return np.array(path, dtype=np.float64).reshape(-1, PATH_VALUES)
