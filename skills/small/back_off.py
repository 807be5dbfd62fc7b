"""Skills that make room: back_off drives to where there is more clearance, step_aside out of a reserved path."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, Final

import numpy as np

from skills.api import Cause, Failed, Part, Running, Skill, SkillContext, Step, Succeeded
from skills.footprint import SAFE_MARGIN_M, Footprint, footprint_clearance_m, pose_array
from skills.geometry import compose, relative_pose
from skills.navigate.arm_footprint import ArmFootprint
from skills.navigate.base import MovingSkill
from skills.navigate.giving_way import GivingWay
from skills.navigate.sensor_watch import ScanHealth
from skills.navigate.skill import Navigate
from skills.navigate.surroundings import NavigateInputs
from skills.quantities import Delay, Length, Speed
from skills.robot import BaseKind, Pose2D
from skills.routine import PATIENCE_S, Routine, SkillFailure

DIRECTIONS_RAD = tuple(math.radians(degrees) for degrees in (180, 150, -150, 90, -90, 30, -30, 0))
"""Directions in the body frame, backwards first; a base that cannot go sideways uses the first and the last."""
_STAYS: Final = Succeeded("stands in nobody's way")
_STEP_M = 0.05
"""Distance between the checks of a direction."""


@dataclass(frozen=True)
class BackOffInputs:
    """Distance (m) to drive, and the least distance (m) that counts as success."""

    distance_m: Length = 0.4
    least_m: Length = 0.15


@dataclass(frozen=True)
class BackOffOptions:
    """Speed of the robot, distance from the goal at which it brakes (m), and time to come to rest (s)."""

    speed_m_s: Speed = 0.25
    arrived_m: Length = 0.03
    settle_s: Delay = 0.4


class BackOff(MovingSkill[BackOffInputs]):
    """Drives a short distance out of a tight place: straight, slowly, in the first direction with enough clearance."""

    name: ClassVar[str] = "back_off"
    Inputs: ClassVar[type] = BackOffInputs
    uses: ClassVar[frozenset[Part]] = frozenset({Part.BASE})
    causes: ClassVar[Mapping[Cause, str]] = {
        Cause.PRECONDITION: "the LiDAR does not work",
        Cause.PLANNING: "there is no clearance in any direction",
        Cause.EXECUTION: "the robot refuses to drive or makes no progress",
    }
    default_timeout_s: ClassVar[float] = 15.0
    max_data_age_s: ClassVar[Mapping[str, float]] = {"odometry": 0.5}
    Options: ClassVar[type] = BackOffOptions
    options: BackOffOptions

    def __init__(self, context: SkillContext) -> None:
        super().__init__(context)
        self._scans = ScanHealth(context)

    def trouble(self) -> SkillFailure | None:
        """Returns a failure when the LiDAR does not work."""
        trouble = self._scans.trouble()
        if trouble is None:
            return None
        self._base.stop()
        return SkillFailure(Cause.PRECONDITION, f"{trouble} The robot does not back off blindly.")

    def run(self, inputs: BackOffInputs) -> Routine[Succeeded]:
        """Chooses a direction, drives until the costmap shows something ahead, and comes to rest.

        Raises SkillFailure when there is no clearance, or the robot makes no progress.
        """
        clock, odometry = self.context.clock, self.context.robot.odometry
        footprint = ArmFootprint(self.context).now()
        sideways = footprint.base_kind is not BaseKind.DIFFERENTIAL
        goal_O = compose(odometry().pose, self._chosen(inputs, footprint, sideways))
        least_m, best_s = math.inf, clock.now()
        while True:
            off = relative_pose(odometry().pose, goal_O)
            left_m = math.hypot(off.x_m, off.y_m) if sideways else abs(off.x_m)
            if left_m < least_m - 0.02:
                least_m, best_s = left_m, clock.now()
            if left_m < self.options.arrived_m:
                break
            if clock.now() - best_s > PATIENCE_S:
                text = f"The robot is stuck {left_m:.2f} m before the place to which it backs off."
                raise SkillFailure(Cause.EXECUTION, text)
            speed = min(self.options.speed_m_s, max(0.08, 1.5 * left_m))
            velocity = speed * off.x_m / left_m, speed * off.y_m / left_m if sideways else 0.0, 0.5 * off.yaw_rad
            best_s += yield from self.drive(velocity, Running(f"backing off, {left_m:.2f} m to go"))
        yield from self.move((0.0, 0.0, 0.0), self.options.settle_s, "coming to rest", settle_s=0.0)
        return Succeeded("backed off a little")

    def _chosen(self, inputs: BackOffInputs, footprint: Footprint, sideways: bool) -> Pose2D:
        """Returns the goal in the body frame: the first direction that is entirely clear, else the longest one.

        Raises SkillFailure when no direction is clear for `least_m`.
        """
        directions = DIRECTIONS_RAD if sideways else (DIRECTIONS_RAD[0], DIRECTIONS_RAD[-1])
        lengths = [(self._free_m(inputs.distance_m, footprint, direction), direction) for direction in directions]
        longest = max(lengths, key=lambda each: each[0])
        length, direction = next((each for each in lengths if each[0] >= inputs.distance_m - 1e-6), longest)
        if length < inputs.least_m:
            raise SkillFailure(Cause.PLANNING, "There is no clearance to back off in any direction.")
        return Pose2D(length * math.cos(direction), length * math.sin(direction), 0.0)

    def _free_m(self, most_m: float, footprint: Footprint, direction_rad: float) -> float:
        """Returns how far (m) the body can move in a direction, at most `most_m`.

        A body in contact may move out of the contact but not further into it.
        """
        steps = np.arange(1, max(1, round(most_m / _STEP_M)) + 1) * _STEP_M
        here = self.context.pose()
        poses = [compose(here, Pose2D(s * math.cos(direction_rad), s * math.sin(direction_rad), 0.0)) for s in steps]
        clearances = footprint_clearance_m(self.context.free_space(), footprint, pose_array([here, *poses]))
        allowed = np.minimum(SAFE_MARGIN_M, np.maximum.accumulate(clearances)[:-1] + 1e-3)
        blocked = np.flatnonzero(clearances[1:] < allowed)
        return float(steps[-1] if len(blocked) == 0 else (steps[blocked[0] - 1] if blocked[0] > 0 else 0.0))


@dataclass(frozen=True)
class StepAsideInputs:
    """No inputs."""


class StepAside(Skill[StepAsideInputs]):
    """Drives to a place off all reserved paths when the robot stands in the path of one with the right of way.

    Succeeds at once when it stands in nobody's way. Uses navigate.
    """

    name = "step_aside"
    Inputs = StepAsideInputs
    uses: ClassVar[frozenset[Part]] = frozenset({Part.BASE})
    causes: ClassVar[Mapping[Cause, str]] = {
        **Navigate.causes,
        Cause.PLANNING: "it stands in the way, and no other place is free, or no path leads there",
    }
    max_data_age_s: ClassVar[Mapping[str, float]] = {"odometry": 0.5}

    def __init__(self, context: SkillContext) -> None:
        super().__init__(context)
        self._navigate = Navigate(context)
        self._stays: Succeeded | Failed | None = _STAYS
        self._giving = GivingWay(context, self._navigate.options.giving_way)

    def begin(self, inputs: StepAsideInputs) -> None:
        """Begins to drive away if a robot needs the space and another place is free."""
        self._stays = self._begun()

    def _begun(self) -> Succeeded | Failed | None:
        """Begins the drive; returns why the robot stays, or None."""
        context = self.context
        if not context.localiser.estimate().localised:
            return Failed(Cause.PRECONDITION, "the robot does not know where it is")
        here, footprint = context.pose(), self._navigate.outline()
        if not self._giving.blocked_robots(here, footprint):
            return _STAYS
        place = self._giving.waiting_pose(context.free_space(), footprint, here)
        if place is None:
            return Failed(Cause.PLANNING, "stands in the way of another robot, and no other place is free")
        self._navigate.begin(NavigateInputs(place))
        return None

    def step(self) -> Step:
        """Drives on, or says why the robot stays."""
        return self._stays or self._navigate.step()

    def end(self) -> None:
        """Ends the drive."""
        if self._stays is None:
            self._stays = _STAYS
            self._navigate.end()
