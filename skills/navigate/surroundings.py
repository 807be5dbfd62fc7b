"""Perception for the navigate skill: obstacles, people, doors, other robots, and the robot's own footprint."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from skills.api import ClearableCostmap, FreeSpace, SkillContext
from skills.doorway import Doorway
from skills.footprint import Footprint, outline_distances_m, pose_array, with_discs
from skills.navigate.arm_footprint import ArmFootprint
from skills.navigate.collision_guard import CollisionGuard, GuardOptions
from skills.navigate.cut_off import DoorOptions, DoorWatch
from skills.navigate.giving_way import Avoided, GivingWay, GivingWayOptions
from skills.navigate.sensor_watch import LowObstacleWatch, ScanHealth, ScanHealthOptions, WatchOptions
from skills.path import LocalController, progress_m
from skills.perception.people import SeenPerson
from skills.perception.people_tracking import PeopleOptions, PeopleWatch
from skills.quantities import Coordinate, Delay, Duration, Length, Margin, Speed, Tries, Turn, TurnRate
from skills.robot import FloatArray, Pose2D
from skills.routine import PATIENCE_S
from skills.world_model import Zone, ZoneKind
from skills.zone_map import KeepOut, ZoneMap


@dataclass(frozen=True)
class SpaceOptions:
    """Speeds near people, and distances from the robot's outline to a person's vertical axis.

    `far_m`, `near_m` and `near_m_s`: between these distances the speed falls from full to `near_m_s`. `away_m`: a path
    that ends this much farther from the person counts by the distance at its end. `stop_m`, `patience_s` and
    `pass_m_s`: where the path, but not the goal, is nearer than `stop_m`, the robot waits for `patience_s`, then passes
    at `pass_m_s`. `forget_s`: the patience starts again after this time without people near. `room_m` and
    `least_room_m`: clearance of plans from people, and the clearance used when no other path exists.
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
    """Distances (N, people) in metres from the outline at poses (N, 3) to the axes of people."""
    places = np.array([one.place_W for one in people], dtype=np.float64).reshape(-1, 2)
    return np.asarray(outline_distances_m(footprint.discs, np.ascontiguousarray(poses), places))


def with_people(
    costmap: FreeSpace,
    footprint: Footprint,
    fixed: Sequence[Pose2D],
    people: Sequence[SeenPerson],
    room_m: float,
    slack_m: float = 0.05,
) -> FreeSpace:
    """The costmap with discs of radius room_m about people, smaller where a pose in `fixed` is nearer to a person."""
    if not people:
        return costmap
    least = np.min(outline_distance_m(footprint, pose_array(fixed), people), axis=0) - slack_m
    radii = np.clip(least, 0.0, room_m)
    return with_discs(costmap, np.column_stack([[one.place_W for one in people], radii]))


@dataclass(frozen=True)
class Pace:
    """Speed limit (m/s) because of a person, and that person.

    `waiting` is True while the robot stands for the person; `overdue` once it should plan another path.
    """

    most_m_s: float = math.inf
    person: SeenPerson | None = None
    waiting: bool = False
    overdue: bool = False


class PaceManager:
    """Determines the pace near people at each tick; remembers how long the robot has waited."""

    def __init__(self, footprint: Footprint, options: SpaceOptions | None = None) -> None:
        self.footprint = footprint
        self._options = options or SpaceOptions()
        self._waiting_since_s: float | None = None
        self._passing = False
        self._near_s = -math.inf

    def pace(
        self, now_s: float, here: Pose2D, ahead: FloatArray, people: Sequence[SeenPerson], most_m_s: float, goal: Pose2D
    ) -> Pace:
        """The pace of a robot at `here` with the path `ahead` (N, 3); most_m_s when nobody is near.

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
        """The pace for a person too near to the path: at first the robot waits, then it passes slowly."""
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


@dataclass(frozen=True)
class NavigateInputs:
    """The goal (the body's pose in the world), tolerances and the maximum speed.

    `nearby_m` are offsets (x, y) in the goal's frame; reaching any of these poses counts too, so that a failure is
    final only if none of them is reachable.
    """

    goal: Pose2D
    position_tolerance_m: Length = 0.10
    yaw_tolerance_rad: Turn = 0.10
    max_speed_m_s: Speed = 0.8
    nearby_m: tuple[tuple[Coordinate, Coordinate], ...] = ()


@dataclass(frozen=True)
class NavigateOptions:
    """Patience and limits of the skill, times in seconds of the robot's clock.

    `review_s` and `review_m`: period at which the robot checks its path and plans again if the path is blocked, and the
    least length of path ahead that it checks. `after_person_s`: failed plans do not count while people are near and
    this long afterwards (longer than a costmap remembers them), for `person_patience_s` at most.
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
_WALKED_M = 0.5
"""Length of a track from which on it counts as a person rather than an object."""


@dataclass
class Company:
    """The person whom the robot accompanies; the robot neither avoids this person nor waits for them.

    Another skill steps the `watch`. `track` is the number of the person's track (0: nobody). `most_m_s` is the speed
    limit that keeps the distance.
    """

    watch: PeopleWatch
    track: int = 0
    most_m_s: float = math.inf

    def others(self) -> tuple[SeenPerson, ...]:
        """All other people: those detected in pictures, and tracks that walk."""
        sure = {one.track for one in self.watch.people()}
        tracks = (one for one in self.watch.tracks() if one.track in sure or one.moved_m > _WALKED_M)
        return tuple(one for one in tracks if one.track != self.track)


class Surroundings:
    """State of the robot's surroundings, as its sensors measure them, during one trip.

    Plans and checks use `footprint`; plans keep a clearance of `room_m` from people.
    """

    def __init__(self, context: SkillContext, options: NavigateOptions, company: Company | None = None) -> None:
        self._context, self._space, self._company = context, options.space, company
        self._outline = ArmFootprint(context)
        self._zones = context.zone_map() if context.zones else None
        self._keep_out = None if self._zones is None else KeepOut(self._zones)
        self.footprint = self._outline.now()
        self._measured_s = -math.inf
        self.room_m = options.space.room_m
        self.scans = ScanHealth(context, options.scans)
        self.doors = DoorWatch(context, options.doors)
        self.robots = GivingWay(context, options.giving_way)
        self._low = LowObstacleWatch(context, options.low_obstacles)
        self._people = PeopleWatch(context, options.people) if company is None else company.watch
        self._pace = PaceManager(self.footprint, options.space)
        self._guard = CollisionGuard(context, self.footprint, options.guard)

    def look(self, velocity: FloatArray) -> None:
        """Takes pictures for low obstacles and people; results arrive later. `velocity` (3,) is the last command."""
        self._low.step()
        if self._company is None:
            self._people.step(velocity)

    def refresh(self) -> None:
        """Updates footprint and doors before a plan; restores `room_m` once nobody is near."""
        if not self.persons():
            self.room_m = self._space.room_m
        if self._keep_out is not None:
            self._keep_out.reset()
        self.doors.look()
        self.footprint = self._pace.footprint = self._guard.footprint = self._outline.now()
        self._measured_s = self._context.clock.now()

    def outgrows_footprint(self) -> bool:
        """Returns whether the arm or its load now overhangs `footprint`; measured every _OUTLINE_PERIOD_S."""
        if self._context.clock.now() < self._measured_s + _OUTLINE_PERIOD_S:
            return False
        self._measured_s = self._context.clock.now()
        return self._outline.outgrows(self.footprint)

    def persons(self) -> tuple[SeenPerson, ...]:
        """The people nearby, without the accompanied person and without detections where other robots report to be."""
        people = self._people.people() if self._company is None else self._company.others()
        return tuple(one for one in people if not self.robots.is_robot(one.place_W))

    def nearest_person(self, reach_m: float, blocks: Callable[[SeenPerson], bool]) -> SeenPerson | None:
        """The nearest person who `blocks`, within reach_m; None without one, or where a door is closed."""
        here = self._context.pose()
        away_m = {math.dist(one.place_W, (here.x_m, here.y_m)): one for one in self.people_by_shape() if blocks(one)}
        nearest_m = min(away_m, default=math.inf)
        return away_m[nearest_m] if nearest_m < reach_m and not self.doors.closed else None

    def people_by_shape(self) -> Sequence[SeenPerson]:
        """The people nearby, or those too near for the cameras: what has the shape of a person in the scan."""
        people = self.persons()
        if people or self._company is not None:
            return people
        return [one for one in self._people.scanned() if not self.robots.is_robot(one.place_W)]

    def reduce_distance_to_people(self) -> bool:
        """Lets plans pass people at a smaller distance from now on; False when nobody is near or this is so already."""
        if not self.persons() or self.room_m <= self._space.least_room_m:
            return False
        self.room_m = self._space.least_room_m
        return True

    def free_space(self) -> FreeSpace:
        """The costmap with keep-out zones, without the part of a zone through which the robot may leave that zone."""
        if self._keep_out is None:
            return self._context.costmap
        return self._keep_out.space(self._context.costmap, self.footprint, self._context.pose())

    def zone_costs(self, start: Pose2D) -> Mapping[str, ZoneMap]:
        """The planner's keyword argument for zone costs; empty when no zone affects the cost."""
        return {"zones": self._zones} if self._zones is not None and self._zones.has_costs(start) else {}

    def forbidding_zones(self, goal: Pose2D) -> tuple[str, ...]:
        """Names of the keep-out zones into which the body would reach at a goal."""
        return () if self._zones is None else self._zones.names_at(ZoneKind.KEEP_OUT, goal, self.footprint)

    def zones_between(self, goals: Sequence[Pose2D]) -> tuple[str, ...]:
        """Names of the keep-out zones that make all goals unreachable: one zone that suffices alone, else all zones."""
        zones = [zone for zone in self._context.zones if zone.kind is ZoneKind.KEEP_OUT]

        def opens(left_out: Sequence[Zone]) -> bool:
            rest = tuple(zone for zone in zones if zone not in left_out)
            doors = DoorWatch(replace(self._context, zones=rest), self.doors.options)
            return not doors.regions(self.footprint, self._context.pose(), goals).cut_off

        if not zones or opens(()) or not opens(zones):
            return ()
        return next(((zone.name,) for zone in zones if opens([zone])), tuple(zone.name for zone in zones))

    def costmap(self, here: Pose2D, goal: Pose2D, avoided: Avoided = Avoided.BODIES) -> FreeSpace:
        """The costmap with zones, closed doors, robots, and discs about people, as large as `here` and `goal` allow."""
        costmap = self.robots.costmap(self.doors.costmap(self.free_space()), avoided)
        return with_people(costmap, self.footprint, (here, goal), self.persons(), self.room_m)

    def danger(self, follower: LocalController, most_m_s: float) -> tuple[float, float] | None:
        """The point (x, y) of an obstacle for which the robot must stop at once; None when there is none."""
        return self._guard.danger(self._context.pose(), follower, most_m_s)

    def pace(self, follower: LocalController, most_m_s: float, goal: Pose2D) -> Pace:
        """The speed that zones and people near the path permit, at most `most_m_s`."""
        ahead, here = follower.ahead(self._space.look_ahead_m), self._context.pose()
        pace = self._pace.pace(self._context.clock.now(), here, ahead, self.persons(), most_m_s, goal)
        if self._company is not None:
            pace = replace(pace, most_m_s=min(pace.most_m_s, self._company.most_m_s))
        if self._zones is None:
            return pace
        on_path = follower.ahead(self._zones.braking_m(most_m_s))
        poses = np.vstack([pose_array([here]), on_path[::2]])
        ahead_m = np.concatenate([[0.0], progress_m(on_path)[::2]])
        return replace(pace, most_m_s=min(pace.most_m_s, self._zones.speed_m_s(self.footprint, poses, ahead_m)))

    def closed_doors(self, goals: Sequence[Pose2D], *, on_path: bool = False) -> tuple[Doorway, ...]:
        """The closed doors that block every path to the goals, or (`on_path`) those on a possible path."""
        here = self._context.pose()
        if on_path and self.doors.closed:
            return self.doors.doors_on_path(self.footprint, here, goals)
        people_W = [one.place_W for one in self.persons()]
        return self.doors.blocking_doors(self.footprint, here, goals, people_W)

    def cut_off(self, goals: Sequence[Pose2D]) -> bool:
        """Returns whether all goals are known to be unreachable."""
        return self.doors.regions(self.footprint, self._context.pose(), goals).cut_off

    def clear_obstacles(self) -> bool:
        """Clears the obstacle layer of the costmap; returns whether a cell was cleared."""
        costmap = self._context.costmap
        return isinstance(costmap, ClearableCostmap) and bool(costmap.clear_obstacles())
