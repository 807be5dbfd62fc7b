"""Idle robots in a run with several robots: each stands still, and clears paths that other robots reserve."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial

from executive.run.session import RunRobot
from executive.run.traffic_table import TrafficTable
from executive.run.watchdog import Watchdog
from skills.api import Running, SkillContext
from skills.navigate.giving_way import GivingWay
from skills.navigate.skill import Navigate
from skills.navigate.surroundings import NavigateInputs

_LOOK_S = 0.5


class SteppingAside:
    """Drives an idle robot to a waiting place whenever it stands in a path that another robot has reserved."""

    def __init__(self, context: SkillContext) -> None:
        self._context, self._skill = context, Navigate(context)
        self._giving = GivingWay(context, self._skill.options.giving_way)
        self._due_s = context.clock.now()
        self.drives = False
        self.moved = False

    def step(self) -> None:
        """Runs one tick. Raises the errors of the robot's verbs."""
        if not self.drives:
            self._clear_path()
        elif not isinstance(self._skill.step(), Running):
            self.end()

    def end(self) -> None:
        """Ends the drive. Idempotent; raises the errors of the robot's verbs."""
        if self.drives:
            self.drives = False
            self._due_s = self._context.clock.now() + _LOOK_S
            self._skill.end()

    def _clear_path(self) -> None:
        """Begins to drive away if a robot with the right of way needs the space and another place is free."""
        if self._context.clock.now() < self._due_s or not self._context.localiser.estimate().localised:
            return
        self._due_s = self._context.clock.now() + _LOOK_S
        here, footprint = self._context.pose(), self._skill.outline()
        if not self._giving.blocked_robots(here, footprint):
            return
        place = self._giving.waiting_pose(self._context.free_space(), footprint, here)
        if place is not None:
            self._skill = Navigate(self._context)
            self._skill.begin(NavigateInputs(place))
            self.drives = self.moved = True


@dataclass
class _Robot:
    who: RunRobot
    aside: SteppingAside
    own_lease: bool
    sense_due_s: float = -math.inf


@dataclass
class Resting:
    """Robots in a run that have no work now: they wait for their turn, have finished, or never had a mission.

    A robot whose verb fails is not used any more.
    """

    table: TrafficTable
    watchdog: Watchdog
    tick_limit_s: float
    stepped_aside: set[str] = field(default_factory=set)
    _robots: dict[str, _Robot] = field(default_factory=dict)

    def wait(self, who: RunRobot) -> None:
        """Adds a robot whose mission waits for other missions; the run updates the robot's estimators."""
        if who.name not in self._robots:
            self._begin(who, who.context, own_lease=False)

    def rest(self, who: RunRobot) -> None:
        """Adds a robot without a mission, claims its lease if it is free, and updates its estimators from now on."""
        who.attempt("resting", lambda: self._begin(who, who.claim(), own_lease=True))

    def leave(self, name: str) -> None:
        """Removes a robot that has work again or whose run has ended. Idempotent; raises nothing."""
        robot = self._robots.pop(name, None)
        if robot is None:
            return
        self.table.rest(name, idle=False)
        if robot.aside.moved and robot.own_lease:
            self.stepped_aside.add(name)
        robot.who.attempt("resting", robot.aside.end)
        if robot.own_lease:
            robot.who.context.traffic.release()
            robot.who.stop_and_leave()

    def close(self) -> None:
        """Removes all robots."""
        for name in tuple(self._robots):
            self.leave(name)

    def tick(self, held: Callable[[str], bool]) -> None:
        """Runs one tick of all robots in the order of their names; robots that are held stand still."""
        for name, robot in sorted(self._robots.items()):
            step = partial(self._step, robot, hold=held(name))
            with self.watchdog.over_tick(name, self.tick_limit_s):
                if not robot.who.attempt("resting", step):
                    self.leave(name)

    def _begin(self, who: RunRobot, context: SkillContext, *, own_lease: bool) -> None:
        self._robots[who.name] = _Robot(who, SteppingAside(context), own_lease)
        self.table.rest(who.name, idle=True)

    def _step(self, robot: _Robot, *, hold: bool) -> None:
        if robot.own_lease:
            now_s = robot.who.context.clock.now()
            if robot.aside.drives or now_s >= robot.sense_due_s:  # a robot that stands senses seldom
                robot.sense_due_s = now_s + _LOOK_S
                robot.who.sense()
            else:
                self.table.report(robot.who.name, robot.who.context.known_pose())
        if hold:
            robot.aside.end()
        else:
            robot.aside.step()
