"""The skill that drives a short distance to where there is more clearance."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from skills.api import Cause, Failed, Running, SkillContext, Step, Succeeded
from skills.back_off.ports import BackOffInputs, BackOffPorts
from skills.geometry import compose, relative
from skills.navigate.arm_footprint import ArmFootprint
from skills.navigate.base import Base
from skills.navigate.footprint import SAFE_MARGIN_M, footprint_clearance_m, pose_array
from skills.navigate.scan_health import ScanHealth
from skills.patience import PATIENCE_S
from skills.quantities import Delay, Length, Speed
from skills.robot import BaseKind, Pose2D

DIRECTIONS_RAD = tuple(math.radians(degrees) for degrees in (180, 150, -150, 90, -90, 30, -30, 0))
"""Ways to go, in the body frame; backwards is tried first. A base that cannot go sideways takes the first and the last.
"""
_STEP_M = 0.05


@dataclass(frozen=True)
class BackOffOptions:
    """How fast the robot goes, how near the goal it stops (m), and how long it takes to come to rest (s)."""

    speed_m_s: Speed = 0.25
    arrived_m: Length = 0.03
    settle_s: Delay = 0.4


class BackOff(BackOffPorts):
    """The skill that `BackOffPorts` declares."""

    Options: ClassVar[type] = BackOffOptions
    options: BackOffOptions

    def __init__(self, context: SkillContext) -> None:
        super().__init__(context)
        self._base = Base(context)

    def begin(self, inputs: BackOffInputs) -> None:
        """Start anew."""
        self._base.stop()
        self._base = Base(self.context)
        self._inputs = inputs
        self._footprint = ArmFootprint(self.context).now()
        self._sideways = self._footprint.base_kind is not BaseKind.DIFFERENTIAL
        self._scans = ScanHealth(self.context)
        self._goal_O: Pose2D | None = None
        self._least_left_m, self._best_s = math.inf, self.context.clock.now()
        self._settled_s: float | None = None

    def step(self) -> Step:
        """Choose a direction at the first step, then go."""
        refusal = self._base.refusal()
        if refusal is not None and self._base.asks_again():
            self._best_s = self.context.clock.now()
            return Running(f"standing: the robot refuses to drive: {refusal}")
        if refusal is not None:
            return Failed(Cause.EXECUTION, f"The robot refused to drive: {refusal}.")
        trouble = self._scans.trouble()
        if trouble is not None:
            self._base.stop()
            return Failed(Cause.PRECONDITION, f"{trouble} The robot does not back off blindly.")
        if self._goal_O is None:
            chosen = self._choose()
            if chosen is None:
                return Failed(Cause.PLANNING, "There is no clearance to back off in any direction.")
            self._goal_O = compose(self.context.robot.odometry().pose, chosen)
        return self._settling() if self._settled_s is not None else self._going(self._goal_O)

    def end(self) -> None:
        """Stop what this skill set in motion."""
        self._base.stop()

    def _choose(self) -> Pose2D | None:
        """Where to go, in the body frame: the first direction that is clear all along, else the longest."""
        directions = DIRECTIONS_RAD if self._sideways else (DIRECTIONS_RAD[0], DIRECTIONS_RAD[-1])
        lengths = [(self._free_m(direction), direction) for direction in directions]
        longest = max(lengths, key=lambda each: each[0])
        length, direction = next((each for each in lengths if each[0] >= self._inputs.distance_m - 1e-6), longest)
        if length < self._inputs.least_m:
            return None
        return Pose2D(length * math.cos(direction), length * math.sin(direction), 0.0)

    def _free_m(self, direction_rad: float) -> float:
        """How far the body can go in a direction, at most `distance_m`; out of what it touches, but not further in."""
        steps = np.arange(1, max(1, round(self._inputs.distance_m / _STEP_M)) + 1) * _STEP_M
        here = self.context.pose()
        poses = [compose(here, Pose2D(s * math.cos(direction_rad), s * math.sin(direction_rad), 0.0)) for s in steps]
        clearances = footprint_clearance_m(self.context.costmap, self._footprint, pose_array([here, *poses]))
        allowed = np.minimum(SAFE_MARGIN_M, np.maximum.accumulate(clearances)[:-1] + 1e-3)
        blocked = np.flatnonzero(clearances[1:] < allowed)
        return float(steps[-1] if len(blocked) == 0 else (steps[blocked[0] - 1] if blocked[0] > 0 else 0.0))

    def _going(self, goal_O: Pose2D) -> Step:
        """Drive on; stop before what the costmap shows."""
        now_s = self.context.clock.now()
        off = relative(self.context.robot.odometry().pose, goal_O)
        left_m = math.hypot(off.x_m, off.y_m) if self._sideways else abs(off.x_m)
        if left_m < self._least_left_m - 0.02:
            self._least_left_m, self._best_s = left_m, now_s
        if left_m < self.options.arrived_m:
            self._settled_s = now_s + self.options.settle_s
            return self._settling()
        if now_s - self._best_s > PATIENCE_S:
            return Failed(Cause.EXECUTION, f"The robot does not get on; {left_m:.2f} m are left of backing off.")
        speed = min(self.options.speed_m_s, max(0.08, 1.5 * left_m))
        aside = speed * off.y_m / left_m if self._sideways else 0.0
        self._base.drive((speed * off.x_m / left_m, aside, 0.5 * off.yaw_rad))
        return Running(f"backing off, {left_m:.2f} m to go")

    def _settling(self) -> Step:
        """Come to rest."""
        assert self._settled_s is not None
        self._base.drive((0.0, 0.0, 0.0))
        if self.context.clock.now() < self._settled_s:
            return Running("coming to rest")
        self._base.stop()
        return Succeeded("backed off a little")
