"""What a robot brings into a run, and how its mission is opened there."""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from typing import Final, cast

from executive.record.profile import Profile
from executive.record.work import Work
from executive.run.control import Control
from executive.run.guarded_robot import GuardedRobot
from executive.run.journal import Journal
from executive.run.resting import HOLDER, Spare
from executive.run.session import Session
from executive.run.traffic import TrafficTable
from executive.run.watchdog import IMAGE_LIMIT_S, TICK_LIMIT_S, VERB_LIMIT_S, Watchdog
from executive.tree.behaviours.board import Board
from executive.tree.behaviours.context import RunContext
from executive.tree.compiler import CompiledTree
from executive.words.slug import slug
from skills.api import Costmap, Detector, Localiser, Publish, Worker
from skills.detection import NO_DETECTOR
from skills.navigate.footprint import Footprint
from skills.robot import Clock, Lease, Pose2D, Robot
from skills.stack import RobotStack, default_stack
from skills.traffic import NO_TRAFFIC

__all__ = ["Opening", "RunEntry", "RunSettings"]

_NO_LEASE: Final = Lease("", "", 0)


@dataclass(frozen=True)
class RunEntry:
    """One robot with its tree, estimators, detector, stack, and the journal of its mission.

    The mission begins when the robots `after` have done theirs, and cannot when one of them fails; whoever asked for it
    stands at `speaker_W` (world frame; None: where the robot begins).
    """

    tree: CompiledTree
    robot: Robot
    localiser: Localiser
    costmap: Costmap
    journal: Journal | None = None
    detector: Detector = NO_DETECTOR
    stack: RobotStack = field(default_factory=default_stack)
    after: tuple[str, ...] = ()
    speaker_W: Pose2D | None = None


@dataclass(frozen=True)
class RunSettings:
    """Seed, tick period and limits. `time_limit_s` counts the robots' clock for the whole run, without pauses, and
    `endings_limit_s` what missions that were cancelled always do in the end. `time_of_day_s` is the time of day (s
    after midnight) at which the run begins; None: what it is on this machine.

    The other limits are the watchdog's, on the wall clock: for one verb, for taking a picture, for one robot's tick.
    """

    seed: int = 0
    tick_period_s: float = 0.05
    time_limit_s: float = 1200.0
    endings_limit_s: float = 120.0
    time_of_day_s: float | None = None
    verb_limit_s: float = VERB_LIMIT_S
    image_limit_s: float = IMAGE_LIMIT_S
    tick_limit_s: float = TICK_LIMIT_S


@dataclass
class Opening:
    """What all robots of a run share, from which each mission is opened. `traffic` is None where one robot is alone.

    `watchdog` watches all of them; `day_began_s` is the time of day (s after midnight) at the clock's zero.
    """

    clock: Clock
    worker: Worker
    publish: Publish
    settings: RunSettings
    control: Control
    work: Work
    profile: Profile | None
    traffic: TrafficTable | None
    watchdog: Watchdog = field(init=False)
    day_began_s: float = field(init=False)

    def __post_init__(self) -> None:
        limits, told_s = self.settings, self.settings.time_of_day_s
        self.watchdog = Watchdog(min(limits.verb_limit_s, limits.image_limit_s, limits.tick_limit_s))
        self.day_began_s = (_time_of_day_s() if told_s is None else told_s) - self.clock.now()

    def _guarded(self, entry: RunEntry) -> GuardedRobot:
        """The robot under the watchdog, known to the others."""
        settings = self.settings
        if self.traffic is not None:
            self.traffic.join(entry.robot.name, Footprint.of(entry.robot.capabilities()).discs)
        return GuardedRobot(
            entry.robot, self.watchdog, limit_s=settings.verb_limit_s, image_limit_s=settings.image_limit_s
        )

    def _context(self, entry: RunEntry, robot: GuardedRobot, lease: Lease) -> RunContext:
        return RunContext(
            robot=cast(Robot, robot),
            lease=lease,
            clock=self.clock,
            worker=self.worker,
            localiser=entry.localiser,
            costmap=entry.costmap,
            publish=_named(self.publish, entry.robot.name),
            seed=self.settings.seed,
            board=Board(slug(entry.tree.robot_name)),
            ask=lambda question: self.control.ask(question, self.clock, entry.robot.name),
            stop_pressed=lambda: self.control.stop_pressed(entry.robot.name),
            presses=lambda: self.control.presses,
            day_began_s=self.day_began_s,
            detector=entry.detector,
            work=self.work,
            stack=entry.stack,
            doors=entry.tree.doors,
            traffic=NO_TRAFFIC if self.traffic is None else self.traffic.view_of(entry.robot.name),
        )

    def spare(self, entry: RunEntry) -> Spare:
        """A robot without a mission."""
        robot = self._guarded(entry)
        return Spare(self._context(entry, robot, _NO_LEASE), robot)

    def session(self, entry: RunEntry) -> Session:
        """The robot's mission, opened with its lease. Raises LeaseError, and what its verbs raise."""
        robot = self._guarded(entry)
        context = self._context(entry, robot, robot.claim(HOLDER))
        try:
            return Session(
                entry.tree, context, robot, self.control, entry.journal, self.profile, speaker_W=entry.speaker_W
            )
        except BaseException:
            robot.give_lease_back()
            raise


def _named(publish: Publish, robot_name: str) -> Publish:
    """Every message of a robot carries its name."""
    return lambda topic, message: publish(topic, {"robot": robot_name, **message})


def _time_of_day_s() -> float:
    """The time of day on this machine (s after midnight)."""
    now = time.localtime()
    return 3600.0 * now.tm_hour + 60.0 * now.tm_min + now.tm_sec
