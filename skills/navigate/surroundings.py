"""Perception of the navigate skill: obstacles, people, doors, other robots, and the robot's own footprint."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

from skills.api import ClearableCostmap, FreeSpace, SkillContext
from skills.navigate.arm_footprint import ArmFootprint
from skills.navigate.collision_guard import CollisionGuard, GuardOptions
from skills.navigate.cut_off import DoorOptions, DoorWatch
from skills.navigate.giving_way import Avoided, GivingWay, GivingWayOptions
from skills.navigate.people_space import Pace, PaceManager, SpaceOptions, with_people
from skills.navigate.sensor_watch import LowObstacleWatch, ScanHealth, ScanHealthOptions, WatchOptions
from skills.patience import PATIENCE_S
from skills.perception.doorway import Doorway
from skills.perception.people import SeenPerson
from skills.perception.people_watch import PeopleOptions, PeopleWatch
from skills.quantities import Delay, Duration, Margin, Speed, Tries, TurnRate
from skills.robot import FloatArray, Pose2D
from skills.stack import LocalController


@dataclass(frozen=True)
class NavigateOptions:
    """Patience and bounds of the skill, times in seconds of the robot's clock.

    Every `review_s` the robot checks its path `review_m` ahead, and plans again, while driving, where it is blocked.
    While people are near, and for `after_person_s` (longer than a costmap remembers them), failed plans do not count,
    up to person_patience_s.
    """

    planning_latency_s: Delay = 0.3
    localising_patience_s: Delay = 3.0
    blind_patience_s: Delay = PATIENCE_S
    blocked_patience_s: Delay = 1.5
    replan_pause_s: Delay = 2.0
    replans: Tries = 6
    stuck_s: Duration = 4.0
    review_s: Duration = 0.2
    review_m: Margin = 0.0
    settle_s: Delay = 2.0
    still_m_s: Speed = 0.03
    still_rad_s: TurnRate = 0.05
    after_person_s: Delay = 14.0
    person_patience_s: Delay = 45.0
    low_obstacles: WatchOptions = field(default_factory=WatchOptions)
    people: PeopleOptions = field(default_factory=PeopleOptions)
    space: SpaceOptions = field(default_factory=SpaceOptions)
    guard: GuardOptions = field(default_factory=GuardOptions)
    scans: ScanHealthOptions = field(default_factory=ScanHealthOptions)
    giving_way: GivingWayOptions = field(default_factory=GivingWayOptions)
    doors: DoorOptions = field(default_factory=DoorOptions)


_OUTLINE_PERIOD_S = 0.5


class Surroundings:
    """State of the robot's surroundings, by its sensors, during one trip.

    Plans and checks use `footprint`; plans keep `room_m` from people.
    """

    def __init__(self, context: SkillContext, options: NavigateOptions) -> None:
        self._context, self._space = context, options.space
        self._outline = ArmFootprint(context)
        self.footprint = self._outline.now()
        self._measured_s = -math.inf
        self.room_m = options.space.room_m
        self.scans = ScanHealth(context, options.scans)
        self.doors = DoorWatch(context, options.doors)
        self.robots = GivingWay(context, options.giving_way)
        self._low = LowObstacleWatch(context, options.low_obstacles)
        self._people = PeopleWatch(context, options.people)
        self._pace = PaceManager(self.footprint, options.space)
        self._guard = CollisionGuard(context, self.footprint, options.guard)

    def look(self, velocity: FloatArray) -> None:
        """Takes pictures for low obstacles and people; results arrive later. `velocity` (3,) is the last command."""
        self._low.step()
        self._people.step(velocity)

    def refresh(self) -> None:
        """Updates footprint and doors before a plan; restores `room_m` once nobody is near."""
        if not self.persons():
            self.room_m = self._space.room_m
        self.doors.look()
        self.footprint = self._pace.footprint = self._guard.footprint = self._outline.now()
        self._measured_s = self._context.clock.now()

    def outgrows_footprint(self) -> bool:
        """Returns whether the arm or its load now reaches beyond `footprint`; measured every _OUTLINE_PERIOD_S."""
        if self._context.clock.now() < self._measured_s + _OUTLINE_PERIOD_S:
            return False
        self._measured_s = self._context.clock.now()
        return self._outline.outgrows(self.footprint)

    def persons(self) -> tuple[SeenPerson, ...]:
        """The people near, without detections at the poses that other robots report."""
        return tuple(one for one in self._people.people() if not self.robots.is_robot(one.place_W))

    def reduce_distance_to_people(self) -> bool:
        """Lets plans pass people more closely from now on; False when nobody is near, or they do already."""
        if not self.persons() or self.room_m <= self._space.least_room_m:
            return False
        self.room_m = self._space.least_room_m
        return True

    def costmap(self, here: Pose2D, goal: Pose2D, avoided: Avoided = Avoided.BODIES) -> FreeSpace:
        """The costmap with closed doors, robots, and as much clearance around people as `here` and the goal allow."""
        costmap = self.robots.costmap(self.doors.costmap(self._context.costmap), avoided)
        return with_people(costmap, self.footprint, (here, goal), self.persons(), self.room_m)

    def danger(self, follower: LocalController, most_m_s: float) -> tuple[float, float] | None:
        """The point (x, y) of an obstacle for which the robot must stop at once; None when there is none."""
        return self._guard.danger(self._context.pose(), follower, most_m_s)

    def pace(self, follower: LocalController, most_m_s: float, goal: Pose2D) -> Pace:
        """The speed that people near the path allow, at most `most_m_s`."""
        ahead = follower.ahead(self._space.look_ahead_m)
        return self._pace.pace(self._context.clock.now(), self._context.pose(), ahead, self.persons(), most_m_s, goal)

    def closed_doors(self, goals: Sequence[Pose2D]) -> tuple[Doorway, ...]:
        """The closed doors that leave no path to any of the goals."""
        people_W = [one.place_W for one in self.persons()]
        return self.doors.blocking_doors(self.footprint, self._context.pose(), goals, people_W)

    def cut_off(self, goals: Sequence[Pose2D]) -> bool:
        """Returns whether all goals are certainly out of reach."""
        return self.doors.regions(self.footprint, self._context.pose(), goals).cut_off

    def clear_obstacles(self) -> bool:
        """Clears the obstacle layer of the costmap; returns whether a cell was cleared."""
        costmap = self._context.costmap
        return isinstance(costmap, ClearableCostmap) and bool(costmap.clear_obstacles())
