"""The referee's record: histories of loose objects and paths of robots and people.

An object's history contains its resting places, lifts and drops.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from pydrake.math import RigidTransform, RollPitchYaw

from executive.words.goal import GoalCondition
from plant.saved_state import Stateful
from skills.inputs.errors import definite
from skills.robot import FloatArray, Intrinsics

if TYPE_CHECKING:
    from plant.worlds.seeding import Placement

LIFT_M = 0.03
AWAY_M = 0.3
FALL_M = 0.05
STILL_M_S = 0.05
WITH_HAND_M_S = 0.2
REST_S = 0.2
FLICKER_S = 0.15
SETTLE_S = 1.0
HIDES_M = 0.3
"""Depth before a point from which on something hides the point in a picture."""
GONE_BELOW_M, GONE_BEYOND_M = 1.0, 500.0
"""Depth below the floor, and distance from its first place, at which an object has left the world."""
SET_DOWN_S = 0.3
"""Longest time from contact with the floor to the release of an object that was set down, not dropped."""


@dataclass(frozen=True)
class ObjectSample:
    """An object at one time: its position and its contacts.

    `gripper` names the robot whose gripper touches it, with the hand's pose `X_WH`. `supported` means contact with
    a body that is no part of a robot, `on_floor` contact with the floor. `tray_of` names the person whose tray
    touches it.
    """

    time_s: float
    p_WO: FloatArray
    gripper: str | None
    X_WH: RigidTransform | None
    supported: bool
    on_floor: bool
    tray_of: str | None = None


@dataclass(frozen=True)
class Lift:
    """Lift of an object off its resting place `from_W`."""

    time_s: float
    robot: str
    from_W: FloatArray


@dataclass(eq=False)
class ObjectHistory(Stateful):
    """History of one object; `add` is called with every sample.

    `rests_W` are its resting places, `rested_s` the times at which it came to rest there, `dropped_s` the times of its
    drops. `sides_m` are its length, width and height, `mass_kg` is its mass. `lost_s` is when it left the world, a
    fault of the simulation.
    """

    name: str
    class_name: str
    sides_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    mass_kg: float = 0.0
    lifts: list[Lift] = field(default_factory=list)
    rests_W: list[FloatArray] = field(default_factory=list)
    rested_s: list[float] = field(default_factory=list)
    events: list[str] = field(default_factory=list)
    dropped_s: list[float] = field(default_factory=list)
    touches: int = 0
    lost_s: float | None = None
    speed_m_s: float = 0.0
    _last: ObjectSample | None = None
    _grip_s: float = float("-inf")
    _grip_robot: str | None = None
    _grip_z_m: float = 0.0
    _supported_s: float = float("-inf")
    _set_down_s: float = float("-inf")
    _still_since_s: float | None = None
    _carried: bool = False
    _left_z_m: float | None = None
    _dropped: bool = False
    _tray_s: float = float("-inf")
    _tray_of: str | None = None
    _by_others: list[int] = field(default_factory=list)

    def own_rests_W(self, from_s: float, until_s: float = math.inf) -> list[FloatArray]:
        """Places where the object came to rest in an interval, without its first place and moves by people."""
        rests = enumerate(zip(self.rested_s, self.rests_W, strict=True))
        own = [(when_s, p_W) for number, (when_s, p_W) in rests if number > 0 and number not in self._by_others]
        return [p_W for when_s, p_W in own if from_s <= when_s <= until_s]

    def lifts_since(self, since_s: float) -> list[Lift]:
        """Lifts since a time."""
        return [lift for lift in self.lifts if lift.time_s >= since_s]

    @property
    def drops(self) -> int:
        """Number of drops."""
        return len(self.dropped_s)

    @property
    def placed_by_person(self) -> bool:
        """Returns whether the last move of the object was by a person."""
        return len(self.rests_W) - 1 in self._by_others and not self._carried

    @property
    def last(self) -> ObjectSample:
        """Latest sample. Raises ValueError when there is none yet."""
        if self._last is None:
            raise ValueError("the referee has not observed anything yet")
        return self._last

    @property
    def resting(self) -> bool:
        """Returns whether the object is still, supported, and in no gripper."""
        return self.holder is None and self._supported and self.speed_m_s < STILL_M_S

    @property
    def holder(self) -> str | None:
        """Robot that holds the object, or held it a moment ago; None when there is none."""
        return self._grip_robot if self.last.time_s - self._grip_s <= FLICKER_S else None

    @property
    def on_tray_of(self) -> str | None:
        """Person on whose tray the object rests; None when it rests on no tray."""
        return self._tray_of if self.resting and self.last.time_s - self._tray_s <= FLICKER_S else None

    @property
    def _supported(self) -> bool:
        """Returns whether a body other than a robot supports the object, or did a moment ago."""
        return self.last.time_s - self._supported_s <= FLICKER_S

    def place_at(self, time_s: float) -> FloatArray | None:
        """Resting place of the object at a time; None while it was carried or moved."""
        places = [(since_s, p_W) for since_s, p_W in zip(self.rested_s, self.rests_W, strict=True) if since_s <= time_s]
        since_s, p_W = places[-1] if places else (self.rested_s[0], self.rests_W[0])
        lifted = any(since_s < lift.time_s <= time_s for lift in self.lifts)
        return None if lifted else p_W

    def rest_at(self, time_s: float) -> tuple[float, FloatArray] | None:
        """Time and place of the rest at a time, or of a rest that began within SETTLE_S after it; None without a rest.

        The object's first place and placements by people do not count.
        """
        lifted_s = max((lift.time_s for lift in self.lifts if lift.time_s <= time_s), default=-math.inf)
        again_s = min((lift.time_s for lift in self.lifts if lift.time_s > time_s), default=math.inf)
        rests = [
            (number, when_s)
            for number, when_s in enumerate(self.rested_s)
            if lifted_s < when_s <= min(time_s + SETTLE_S, again_s)
        ]
        if not rests and again_s == math.inf and self.resting and self.last.time_s <= time_s + SETTLE_S:
            return self.last.time_s, self.last.p_WO
        before = [rest for rest in rests if rest[1] <= time_s]
        number, when_s = before[-1] if before else rests[0] if rests else (0, 0.0)
        if number == 0 or number in self._by_others:
            return None
        return when_s, self.rests_W[number]

    def holder_at(self, time_s: float) -> str | None:
        """Robot that held the object at a time, or lifted it within SETTLE_S afterwards; None when no robot did."""
        before = [lift for lift in self.lifts if lift.time_s <= time_s]
        after = [lift for lift in self.lifts if time_s < lift.time_s <= time_s + SETTLE_S]
        held = [lift for lift in before[-1:] if not self._ended_between(lift.time_s, time_s)]
        return next((lift.robot for lift in (*held, *after)), None)

    def holder_during(self, from_s: float, until_s: float) -> str | None:
        """Robot that held the object during a whole interval; None when no robot did."""
        before = [lift for lift in self.lifts if lift.time_s <= from_s + SETTLE_S]
        held = (lift.robot for lift in before[-1:] if not self._ended_between(lift.time_s, until_s))
        return next(held, None)

    def _ended_between(self, from_s: float, until_s: float) -> bool:
        """Returns whether the object came to rest or was dropped in an interval."""
        return any(from_s < when_s <= until_s for when_s in (*self.rested_s, *self.dropped_s))

    def add(self, sample: ObjectSample) -> None:
        """Adds a sample to the history."""
        with_hand, last = self._moves_with_hand(sample), self._last
        if last is not None and sample.time_s > last.time_s:
            moved_m = float(np.linalg.norm(sample.p_WO - last.p_WO))
            self.speed_m_s = moved_m / (sample.time_s - last.time_s)
        if sample.gripper is not None:
            self.touches += self._last is None or sample.time_s - self._grip_s > 0.5
            self._grip_s, self._grip_robot = sample.time_s, sample.gripper
            if sample.on_floor:
                self._set_down_s = sample.time_s
        if sample.supported:
            self._supported_s = sample.time_s
        if sample.tray_of is not None:
            self._tray_s, self._tray_of = sample.time_s, sample.tray_of
        self._last = sample
        if not self.rests_W:
            self._rests(sample)
        self._note_lift(sample, with_hand)
        self._note_leaving(sample, with_hand)
        self._note_fall(sample)
        self._note_rest(sample)
        self._note_loss(sample)

    def stay(self, time_s: float) -> None:
        """Adds a sample at time_s that equals the last one."""
        last, since_s = self.last, self._still_since_s
        rests = since_s is not None and time_s - since_s > 2.0 * REST_S and self.speed_m_s == 0.0
        if not (rests and last.supported and last.gripper is None and last.tray_of is None and not self._carried):
            self.add(replace(last, time_s=time_s))
            return
        self._last = ObjectSample(time_s, last.p_WO, None, last.X_WH, supported=True, on_floor=last.on_floor)
        self._supported_s = time_s

    def record_move(self, p_WO: FloatArray, time_s: float) -> None:
        """Records that a person moved the object to p_WO; this is neither a drop nor a placement by a robot."""
        self._last = replace(self.last, time_s=time_s, p_WO=p_WO, gripper=None, X_WH=None, tray_of=None)
        self._grip_s = self._tray_s = float("-inf")
        self._carried, self._left_z_m, self._dropped, self._still_since_s = False, None, False, None
        self._by_others.append(len(self.rests_W))
        self.rests_W.append(p_WO)
        self.rested_s.append(time_s)
        self.events.append(f"Somebody moved {definite(self.name)} at {time_s:.2f} s.")

    def forget_past(self) -> None:
        """Clears the history for the next mission; only a held object keeps its lifts and rests.

        The time at which the object left the world stays, so that it excuses no later mission.
        """
        if self._last is not None and self.holder is None:
            self.lifts, self.rests_W, self.rested_s, self._by_others = [], [], [], []
            self._rests(self._last)
        self.events, self.dropped_s, self.touches = [], [], 0

    def _moves_with_hand(self, sample: ObjectSample) -> bool:
        """Returns whether the object has not moved in the hand since the last sample."""
        last = self._last
        if last is None or sample.X_WH is None or last.X_WH is None or sample.time_s <= last.time_s:
            return False
        slip = sample.X_WH.inverse() @ sample.p_WO - last.X_WH.inverse() @ last.p_WO
        return float(np.linalg.norm(slip)) / (sample.time_s - last.time_s) < WITH_HAND_M_S

    def _note_lift(self, sample: ObjectSample, with_hand: bool) -> None:
        """Starts a carry once the gripper has raised the object or moved it well away from its place."""
        if sample.gripper is None or sample.supported or not with_hand:
            return
        moved_W = sample.p_WO - self.rests_W[-1]
        if not self._carried and (moved_W[2] >= LIFT_M or float(np.linalg.norm(moved_W[:2])) >= AWAY_M):
            self.lifts.append(Lift(sample.time_s, sample.gripper, self.rests_W[-1]))
            self.events.append(f"{sample.gripper} lifted {definite(self.name)} at {sample.time_s:.2f} s.")
            self._carried = True

    def _note_leaving(self, sample: ObjectSample, with_hand: bool) -> None:
        """Records the height at which a carried object left the gripper or lies on a tray; a fall begins there."""
        if sample.gripper is not None and with_hand:
            self._left_z_m, self._dropped = None, False
            self._grip_z_m = float(sample.p_WO[2])
        elif self._carried and self._left_z_m is None:
            self._left_z_m = self._grip_z_m
        if self._left_z_m is not None and sample.tray_of is not None:
            self._left_z_m = float(sample.p_WO[2])

    def _note_fall(self, sample: ObjectSample) -> None:
        """Counts a drop once the object has fallen, or lies on the floor without having been set down there."""
        if self._left_z_m is None or self._dropped:
            return
        set_down = self._grip_s - self._set_down_s <= SET_DOWN_S
        if self._left_z_m - sample.p_WO[2] > FALL_M or (sample.on_floor and not set_down):
            self._dropped = True
            self.dropped_s.append(sample.time_s)
            self.events.append(f"{self._grip_robot} let {definite(self.name)} fall at {sample.time_s:.2f} s.")

    def _note_rest(self, sample: ObjectSample) -> None:
        """Ends a carry and records the place, once the object has rested for a while."""
        if not self.resting:
            self._still_since_s = None
            return
        if self._still_since_s is None:
            self._still_since_s = sample.time_s
        if sample.time_s - self._still_since_s < REST_S:
            return
        if not self._carried and self.rests_W[-1][2] - sample.p_WO[2] > FALL_M:
            name = definite(self.name)
            self.events.append(f"{name[0].upper()}{name[1:]} was knocked down before {sample.time_s:.2f} s.")
        if self._carried or float(np.linalg.norm(sample.p_WO - self.rests_W[-1])) > 0.02:
            self._rests(sample)
        self._carried, self._left_z_m, self._dropped = False, None, False

    def _note_loss(self, sample: ObjectSample) -> None:
        """Records that the object left the world; its last drop is then no fault of the robot."""
        apart_m = float(np.linalg.norm(sample.p_WO - self.rests_W[0]))
        if self.lost_s is not None or (sample.p_WO[2] > -GONE_BELOW_M and apart_m < GONE_BEYOND_M):
            return
        self.lost_s = sample.time_s
        lifted_s = self.lifts[-1].time_s if self.lifts else 0.0
        self.dropped_s = [when_s for when_s in self.dropped_s if when_s < lifted_s]
        self.events.append(f"The simulation lost {definite(self.name)} at {sample.time_s:.2f} s: it left the world.")

    def _rests(self, sample: ObjectSample) -> None:
        self.rests_W.append(sample.p_WO)
        self.rested_s.append(sample.time_s)


PATH_STEP_M = 0.02
Point = tuple[float, float]
ON_TRAY_GAP_S = 0.5


@dataclass(frozen=True)
class TimedPath:
    """Path of a robot or a person: points (m, world) with the times (s) at which they were reached, (N, 4)."""

    points: FloatArray

    def position_at(self, time_s: float) -> FloatArray:
        """Position (3,) at a time."""
        return self.points[self._index(time_s), :3]

    def positions_at(self, times_s: FloatArray) -> FloatArray:
        """Positions (N, 3) at `times_s`."""
        return self.points[np.maximum(0, np.searchsorted(self.points[:, 3], times_s, side="right") - 1), :3]

    def positions_between(self, from_s: float, until_s: float) -> FloatArray:
        """Positions (N, 3) from just before one time up to another."""
        first = max(0, int(np.searchsorted(self.points[:, 3], from_s)) - 1)
        return self.points[first : self._index(until_s) + 1, :3]

    def _index(self, time_s: float) -> int:
        return max(0, int(np.searchsorted(self.points[:, 3], time_s, side="right")) - 1)


@dataclass(frozen=True)
class TimedPoses:
    """Poses X_WH of a hand: its positions (m, world), and its roll, pitch and yaw (rad) at the same times."""

    positions: TimedPath
    turns: TimedPath

    def pose_at(self, time_s: float) -> RigidTransform:
        """Pose at a time."""
        return RigidTransform(RollPitchYaw(self.turns.position_at(time_s)), self.positions.position_at(time_s))


@dataclass(frozen=True)
class TakenPicture:
    """Picture that a robot took: true pose, lens and depth (m; 0: unknown) of the camera, and the objects `seen` in it.

    `depth_m` has every `step`-th pixel of the lens.
    """

    robot: str
    time_s: float
    X_WC: RigidTransform
    lens: Intrinsics
    depth_m: NDArray[np.float32]
    step: int = 1
    seen: frozenset[str] = frozenset()

    def shows(self, p_W: FloatArray, hides_m: float = HIDES_M) -> bool:
        """Returns whether a point is in the picture, with nothing more than `hides_m` before it."""
        (x, y, z), k = self.X_WC.inverse() @ p_W, self.lens
        column, row = (round(k.fx * x / z + k.cx), round(k.fy * y / z + k.cy)) if z > 0.0 else (-1, -1)
        if not (0 <= column < k.width and 0 <= row < k.height):
            return False
        return not 0.0 < self.depth_m[row // self.step, column // self.step] < z - hides_m


@dataclass(frozen=True)
class Truth:
    """Record up to `now_s`: histories of the objects, and the paths of robots and people by name.

    `given` are the intervals (s) in which an object rested on a person's tray, by object and person. `doors` are the
    times (s) and states of each sliding door by its position (x, y): 0 open, 1 closed, between while it moves. Any
    other door is open. `hands` are the poses of the robots' hands by robot, and `people` says what each person looks
    like and answers.
    """

    now_s: float
    histories: tuple[ObjectHistory, ...]
    robots: Mapping[str, TimedPath]
    persons: Mapping[str, TimedPath]
    given: Mapping[tuple[str, str], Sequence[tuple[float, float]]]
    doors: Mapping[Point, Sequence[tuple[float, float]]] = field(default_factory=dict)
    pictures: Sequence[TakenPicture] = ()
    hands: Mapping[str, TimedPoses] = field(default_factory=dict)
    people: Mapping[str, Placement] = field(default_factory=dict)

    def ended_s(self, condition: GoalCondition) -> float:
        """Time at which the step that belongs to a condition ended; the present time while it runs."""
        return self.now_s if condition.ended_s is None else min(condition.ended_s, self.now_s)

    def robots_of(self, condition: GoalCondition) -> Mapping[str, TimedPath]:
        """Paths of the robots that a condition is about, by name."""
        return {name: path for name, path in self.robots.items() if condition.robot in (None, name)}

    def persons_of(self, condition: GoalCondition) -> Mapping[str, TimedPath]:
        """Paths of the people whom a condition is about, by name."""
        return {name: path for name, path in self.persons.items() if condition.person in (None, name)}


def extend_path(path: list[FloatArray], p_W: FloatArray, time_s: float, most: float = math.inf) -> None:
    """Appends a point with its time to a path when it is `PATH_STEP_M` from the last point.

    Beyond `most` points, every other point in the older half of the path is removed.
    """
    if not path or float(np.linalg.norm(p_W[:2] - path[-1][:2])) >= PATH_STEP_M:
        path.append(np.append(p_W, time_s))
    if len(path) > most:
        del path[1 : len(path) // 2 : 2]


def extend_stays(stays: list[tuple[float, float]], time_s: float) -> None:
    """Extends the last interval on a tray to time_s, or starts another one after an interruption."""
    goes_on = bool(stays) and time_s - stays[-1][1] <= ON_TRAY_GAP_S
    first_s = stays.pop()[0] if goes_on else time_s
    stays.append((first_s, time_s))
