"""Distance to people: speed limits near them, and clearance in plans."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from skills.api import FreeSpace
from skills.navigate.footprint import Footprint, disc_centres, pose_array
from skills.navigate.obstacles import with_discs
from skills.perception.people import SeenPerson
from skills.quantities import Delay, Length, Margin, Speed
from skills.robot import FloatArray, Pose2D


@dataclass(frozen=True)
class SpaceOptions:
    """Speeds near people, and distances from the robot's outline to a person's upright axis.

    From `far_m` to `near_m` the speed falls from full to near_m_s, less so where the path leads away by `away_m`. Where
    the path comes nearer than `stop_m`, and the goal does not, the robot waits for `patience_s`, then passes at
    `pass_m_s`; the patience starts again after `forget_s` without anybody near. Plans keep `room_m` where start and
    goal leave so much, and `least_room_m` where no other path exists.
    """

    far_m: Length = 2.5
    near_m: Length = 1.0
    near_m_s: Speed = 0.3
    stop_m: Margin = 0.7
    look_ahead_m: Length = 1.2
    patience_s: Delay = 3.0
    pass_m_s: Speed = 0.15
    forget_s: Delay = 3.0
    room_m: Margin = 0.65
    least_room_m: Margin = 0.2
    slack_m: Margin = 0.05
    away_m: Length = 0.3


def outline_distance_m(footprint: Footprint, poses: FloatArray, people: Sequence[SeenPerson]) -> FloatArray:
    """Distances (N, people) in metres from the outline at poses (N, 3) to people's axes."""
    places = np.array([one.place_W for one in people], dtype=np.float64).reshape(-1, 2)
    centres = disc_centres(footprint.discs, poses)
    offsets = np.linalg.norm(centres[:, :, None, :] - places[None, None, :, :], axis=3)
    return np.asarray(np.min(offsets - footprint.discs[None, :, 2:3], axis=1))


def with_people(
    costmap: FreeSpace,
    footprint: Footprint,
    fixed: Sequence[Pose2D],
    people: Sequence[SeenPerson],
    room_m: float,
    slack_m: float = 0.05,
) -> FreeSpace:
    """The costmap with discs of room_m about people, smaller where a `fixed` pose of the robot is nearer."""
    if not people:
        return costmap
    least = np.min(outline_distance_m(footprint, pose_array(fixed), people), axis=0) - slack_m
    radii = np.clip(least, 0.0, room_m)
    return with_discs(costmap, np.column_stack([[one.place_W for one in people], radii]))


@dataclass(frozen=True)
class Pace:
    """Speed limit (m/s) because of a person, and that person.

    `waiting` while the robot stands for the person; `overdue` once it should plan another path.
    """

    most_m_s: float = math.inf
    person: SeenPerson | None = None
    waiting: bool = False
    overdue: bool = False


class PaceManager:
    """Pace near people at each tick; remembers how long the robot has waited."""

    def __init__(self, footprint: Footprint, options: SpaceOptions | None = None) -> None:
        self.footprint = footprint
        self._options = options or SpaceOptions()
        self._waiting_since_s: float | None = None
        self._passing = False
        self._near_s = -math.inf

    def pace(
        self, now_s: float, here: Pose2D, ahead: FloatArray, people: Sequence[SeenPerson], most_m_s: float, goal: Pose2D
    ) -> Pace:
        """The pace of a robot `here` with the path `ahead` (N, 3), most_m_s when nobody is near.

        The robot does not wait for people who are as near to the `goal` as to the path.
        """
        if not people:
            return self._nobody(now_s)
        now_m = outline_distance_m(self.footprint, pose_array([here]), people)[0]
        on_path_m = outline_distance_m(self.footprint, ahead, people)
        then_m = np.min(on_path_m, axis=0)
        leads_away = on_path_m[-1] > now_m + self._options.away_m
        least_m = np.where(leads_away, on_path_m[-1], np.minimum(now_m, then_m))
        nearest = int(np.argmin(least_m))
        if least_m[nearest] >= self._options.far_m:
            return self._nobody(now_s)
        self._near_s = now_s
        at_goal_m = outline_distance_m(self.footprint, pose_array([goal]), people)[0]
        leads_nearer = then_m < np.minimum(self._options.stop_m, np.minimum(now_m, at_goal_m) - self._options.slack_m)
        if np.any(leads_nearer):
            return self._close(now_s, people[int(np.argmin(np.where(leads_nearer, then_m, np.inf)))])
        self._waiting_since_s = None
        return Pace(self._by_distance(float(least_m[nearest]), most_m_s), people[nearest])

    def _close(self, now_s: float, person: SeenPerson) -> Pace:
        """The pace for a person too near to the path: first standing, then slow."""
        if self._passing:
            return Pace(self._options.pass_m_s, person)
        self._waiting_since_s = now_s if self._waiting_since_s is None else self._waiting_since_s
        if now_s - self._waiting_since_s < self._options.patience_s:
            return Pace(0.0, person, waiting=True)
        self._passing = True
        return Pace(0.0, person, waiting=True, overdue=True)

    def _nobody(self, now_s: float) -> Pace:
        self._waiting_since_s = None
        if now_s - self._near_s > self._options.forget_s:
            self._passing = False
        return Pace()

    def _by_distance(self, distance_m: float, most_m_s: float) -> float:
        options = self._options
        share = (distance_m - options.near_m) / (options.far_m - options.near_m)
        slow = min(options.near_m_s, most_m_s)
        return slow + min(1.0, max(0.0, share)) * (most_m_s - slow)
