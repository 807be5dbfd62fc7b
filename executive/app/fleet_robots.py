"""The robots of a fleet as work is given out to them, and what they offer for it."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from executive.app.auction import Bid
from executive.app.feasibility import route_planner_of
from executive.app.fleet_missions import FleetMission, RobotNow, bid_for, is_way
from executive.app.fleet_progress import Progress, ProgressJournal
from executive.app.prepared import Prepared
from executive.app.robots import PlacedRobot
from executive.run.visitor import RunEntry
from executive.tree.estimate import RoutePlanner
from executive.words.knowledge import BatteryFacts, SurfaceFacts
from plant.kinds import robot_kind
from skills.api import Surface
from skills.geometry import wrap
from skills.place.free_spot import spots
from skills.robot import Pose2D

__all__ = ["FleetRobot", "Offers"]

_HEADINGS: Final = 16


@dataclass
class FleetRobot:
    """A robot of the fleet: where it is free next, and from when (s on the robots' clock).

    Its mission to `dock` is None where it cannot charge.
    """

    placed: PlacedRobot
    pose: Pose2D
    charge: float = 1.0
    free_at_s: float = 0.0
    entry: RunEntry | None = None
    journal: ProgressJournal | None = None
    dock: Prepared | None = None
    planner: RoutePlanner | None = None
    faults: tuple[str, ...] = ()

    def ready_s(self, now_s: float, *, busy: bool) -> float:
        """In how long it is free (s). What is late is expected to be as late again."""
        left_s = self.free_at_s - now_s
        return abs(left_s) if busy else max(0.0, left_s)

    @property
    def progress(self) -> Progress:
        """How far the mission is that it has."""
        return Progress(0) if self.journal is None else self.journal.progress


class Offers:
    """What robots offer for missions; each route is planned once for each place that it is offered from."""

    def __init__(self, robots: Mapping[str, FleetRobot], battery: BatteryFacts, now: Callable[[], float]) -> None:
        """`now` is the robots' clock (s)."""
        self._robots, self._battery, self._now = robots, battery, now
        self._known: dict[tuple[int, str, int, Pose2D, float, bool], Bid] = {}

    def known(self, wanted: FleetMission, name: str, *, busy: bool, resting: bool) -> Bid:
        """What a robot offers for a mission of the queue."""
        robot = self._robots[name]
        if (tried := wanted.tried.get(name)) is not None:
            return Bid(wanted.stored.id, name, 0.0, 0.0, problems=(tried,))
        key = (wanted.stored.id, name, wanted.done, robot.pose, robot.charge, resting)
        if key not in self._known:
            self._known[key] = self.new(wanted, name, busy=busy, resting=resting)
        return replace(self._known[key], ready_s=robot.ready_s(self._now(), busy=busy))

    def new(self, wanted: FleetMission, name: str, *, busy: bool, resting: bool) -> Bid:
        """What a robot offers from where it is free next; one that is `resting` from its dock, and is `busy` as one is
        that has a mission."""
        robot = self._robots[name]
        if robot.planner is None:
            some = wanted.options.get(name, next(iter(wanted.options.values())))
            robot.planner = route_planner_of(some.world, robot.placed, kept=False)
        now = RobotNow(robot.pose, robot.charge, self._battery.low, robot.planner, robot.dock)
        if resting and robot.dock is not None:
            now = replace(now, pose=robot.dock.world.dock or robot.pose, charge=self._battery.charged)
        return replace(bid_for(wanted, name, now), ready_s=robot.ready_s(self._now(), busy=busy))

    def takes_from(self, name: str, table: SurfaceFacts) -> bool:
        """Whether a robot that has offered something has a way to where it reaches what another one puts on a table.

        That is nearest to the first viewpoint, from which it is put down.
        """
        robot, arm = self._robots[name], robot_kind(self._robots[name].placed.kind).capabilities().arm
        view, planner = table.viewpoints[0], robot.planner
        if arm is None or planner is None:
            return False
        there = spots(Surface("table", table.polygon, table.height))
        x, y = min(there, key=lambda spot: float(np.hypot(*(spot - [view.x, view.y]))))
        yaws = [wrap(2.0 * math.pi * n / _HEADINGS) for n in range(_HEADINGS)]
        return any(
            is_way(planner, robot.pose, Pose2D(x - d_m * math.cos(yaw), y - d_m * math.sin(yaw), yaw))
            for d_m in arm.standing_m
            for yaw in yaws
        )
