"""Idle robots in a run with several robots: each stands still, and clears paths that other robots reserve."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from typing import Any, Final

from executive.run.session import RunRobot
from executive.run.traffic_table import TrafficTable
from executive.run.watchdog import Watchdog
from executive.tree.registry import installed_skills, missing_skill
from skills.api import Running, Skill, SkillContext
from skills.inputs.errors import InputError

_LOOK_S = 0.5
_STEP_ASIDE: Final = "step_aside"


@dataclass
class _Robot:
    who: RunRobot
    aside: Skill[Any]
    own_lease: bool
    drives: bool = False
    moved: bool = False
    sense_due_s: float = -math.inf
    aside_due_s: float = -math.inf

    def step_aside(self) -> None:
        """Clears the path of another robot, for one tick. Raises the errors of the robot's verbs."""
        now_s = self.who.context.clock.now()
        if not self.drives and now_s >= self.aside_due_s:
            self.aside_due_s = now_s + _LOOK_S
            self.aside.begin(self.aside.Inputs())
            self.drives = True
        if self.drives and not isinstance(self.aside.step(), Running):
            self.stand()
        self.moved = self.moved or self.drives

    def stand(self) -> None:
        """Ends the drive. Idempotent; raises the errors of the robot's verbs."""
        if self.drives:
            self.drives = False
            self.aside_due_s = self.who.context.clock.now() + _LOOK_S
            self.aside.end()


@dataclass
class Resting:
    """Robots in a run that have no work now: they wait for their turn, have finished, or never had a mission.

    A robot whose verb fails is not used any more. The constructor raises InputError without the skill `step_aside`.
    """

    table: TrafficTable
    watchdog: Watchdog
    tick_limit_s: float
    stepped_aside: set[str] = field(default_factory=set)
    _robots: dict[str, _Robot] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if _STEP_ASIDE not in (registry := installed_skills()).names:
            raise InputError(missing_skill(_STEP_ASIDE, registry)[0], hint="install this project again: make env")

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
        if robot.moved and robot.own_lease:
            self.stepped_aside.add(name)
        robot.who.attempt("resting", robot.stand)
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
        self._robots[who.name] = _Robot(who, installed_skills()[_STEP_ASIDE](context), own_lease)
        self.table.rest(who.name, idle=True)

    def _step(self, robot: _Robot, *, hold: bool) -> None:
        if robot.own_lease:
            now_s = robot.who.context.clock.now()
            if robot.drives or now_s >= robot.sense_due_s:  # a robot that stands senses seldom
                robot.sense_due_s = now_s + _LOOK_S
                robot.who.sense()
            else:
                self.table.report(robot.who.name, robot.who.context.known_pose())
        if hold:
            robot.stand()
        else:
            robot.step_aside()
