"""Robots of any number on a floor, kinematic only: they know where they are, and see nothing but what is surveyed.

What they do is what `navigate` makes of the others' ways; so a meeting takes a few seconds instead of minutes.
"""

import math
from dataclasses import dataclass, field, replace
from itertools import combinations

import numpy as np

from executive.run.traffic_table import TrafficTable
from executive.run.worker import LockStepWorker
from skills.api import Failed, Running, SkillContext, Step, Succeeded
from skills.footprint import Footprint, disc_centres, pose_array
from skills.grid_map import GridMap
from skills.navigate.skill import Navigate, NavigateInputs
from skills.robot import BaseKind, Pose2D
from skills.small.back_off import StepAside, StepAsideInputs
from skills.testing.clock import VirtualClock
from skills.testing.estimators import BlockCostmap, KnownPlace
from skills.testing.robot import BASE_ONLY, ScriptedRobot, Start

ROUND = tuple((0.28 * math.cos(a), 0.28 * math.sin(a)) for a in np.arange(12) * math.tau / 12)
TICK_S = 0.05
ATTEMPTS = 3


def capabilities_of(base_kind):
    """An oblong that can go sideways, or a round one that cannot; no arm, no camera."""
    outline = ROUND if base_kind is BaseKind.DIFFERENTIAL else BASE_ONLY.footprint_m
    return replace(BASE_ONLY, footprint_m=outline, base_kind=base_kind, cameras=())


class Surveyed(BlockCostmap):
    """A costmap of what was surveyed."""

    def __init__(self, grid):
        super().__init__()
        self.clearance_m = grid.distance_m


@dataclass
class Trip:
    """One robot's way to a goal: it begins after some time, and is tried again when it fails."""

    context: SkillContext
    goal: Pose2D
    after_s: float = 0.0
    skill: Navigate | None = None
    attempts: int = 0
    ended: Step | None = None
    aside: StepAside | None = None
    aside_due_s: float = 0.0
    last: Step | None = None

    def step(self, table):
        """One tick; before and after its trip a robot steps aside where it is asked to."""
        rests = self.ended is not None or self.context.clock.now() < self.after_s
        table.rest(self.context.robot.name, idle=rests)
        if rests:
            self.step_aside()
            return
        if self.aside is not None:
            self.aside.end()
            self.aside = None
        if self.skill is None:
            self.skill, self.attempts = Navigate(self.context), self.attempts + 1
            self.skill.begin(NavigateInputs(self.goal))
        step = self.last = self.skill.step()
        if isinstance(step, Succeeded | Failed):
            self.skill.end()
            self.skill = None
            if isinstance(step, Succeeded) or self.attempts >= ATTEMPTS:
                self.ended = step

    def step_aside(self):
        """One tick without a trip: looks twice a second whether somebody needs the space."""
        now_s = self.context.clock.now()
        if self.aside is None and now_s >= self.aside_due_s:
            self.aside = StepAside(self.context)
            self.aside.begin(StepAsideInputs())
        if self.aside is not None and not isinstance(self.aside.step(), Running):
            self.aside.end()
            self.aside, self.aside_due_s = None, now_s + 0.5


@dataclass
class Floor:
    """Robots on a surveyed floor. `apart_m` is the least distance between two outlines so far."""

    grid: GridMap
    clock: VirtualClock = field(default_factory=VirtualClock)
    robots: dict[str, ScriptedRobot] = field(default_factory=dict)
    trips: dict[str, Trip] = field(default_factory=dict)
    apart_m: float = math.inf
    discs: dict[str, np.ndarray] = field(default_factory=dict)

    def __post_init__(self):
        self.table = TrafficTable({}, self.clock.now)
        self.worker = LockStepWorker(self.clock)

    def add(self, name, start, base_kind=BaseKind.OMNIDIRECTIONAL):
        """One more robot; what its skills may use."""
        robot = ScriptedRobot(self.clock, name=name, capabilities=capabilities_of(base_kind), start=Start(start))
        self.robots[name] = robot
        self.discs[name] = Footprint.of(robot.capabilities()).discs
        self.table.join(name, self.discs[name])
        self.table.report(name, start)
        return SkillContext(
            robot,
            robot.acquire_lease("test"),
            self.clock,
            self.worker,
            KnownPlace(start),
            Surveyed(self.grid),
            lambda topic, message: None,
            seed=0,
            traffic=self.table.view_of(name),
        )

    def send(self, name, start, goal, *, base_kind=BaseKind.OMNIDIRECTIONAL, after_s=0.0):
        """One more robot that goes somewhere."""
        self.trips[name] = Trip(self.add(name, start, base_kind), goal, after_s)

    def tick(self):
        """One tick, robots in the order of their names."""
        self.clock.advance(TICK_S)
        for name, robot in sorted(self.robots.items()):
            self.table.report(name, robot.pose)
        for _, trip in sorted(self.trips.items()):
            trip.step(self.table)
        self.apart_m = min(self.apart_m, self.least_apart_m())

    def run(self, until_s):
        """Tick until all have ended; whether all are there within the time."""
        while self.clock.now() < until_s and any(trip.ended is None for trip in self.trips.values()):
            self.tick()
        return all(isinstance(trip.ended, Succeeded) for trip in self.trips.values())

    def least_apart_m(self):
        """The least distance between the outlines of two robots; negative where they overlap."""
        least, outlines = math.inf, [(self.discs[name], robot.pose) for name, robot in self.robots.items()]
        placed = [(disc_centres(discs, pose_array([pose]))[0], discs[:, 2]) for discs, pose in outlines]
        for (centres, radii), (others, other_radii) in combinations(placed, 2):
            apart = np.linalg.norm(centres[:, None] - others[None], axis=2) - radii[:, None] - other_radii[None]
            least = min(least, float(apart.min()))
        return least
