"""Teleoperation of a robot by `/cmd_vel` during a run: it pauses the robot's mission and keeps clear of obstacles."""

from __future__ import annotations

import math
import time
from typing import Final

import numpy as np

from errand_ros2.readings import LIFE_S, TOPIC, HeardVelocity
from executive.run.control import Control
from skills.api import SkillContext
from skills.navigate.base import Base
from skills.navigate.follower import FollowerOptions
from skills.navigate.footprint import SAFE_MARGIN_M, Footprint, footprint_clearance_m
from skills.robot import FloatArray

RESUME_S: Final = 1.0  # time (wall clock) without velocities after which the mission goes on
_REACTION_S, _BRAKING_M_S2, _SAMPLES = 0.4, 2.0, 6
_TICK_S: Final = 0.05


class Driving(HeardVelocity):
    """Driver of one robot by velocities, which count on the wall clock. The run calls `tick`."""

    def __init__(self, robot_name: str, control: Control) -> None:
        super().__init__(time.monotonic)
        self._name, self._control = robot_name, control
        self._base: tuple[SkillContext, Base] | None = None
        self._driving, self._moved_s = False, -math.inf

    def tick(self, context: SkillContext) -> None:
        """Sends the command for the next tick, while velocities arrive."""
        (asked, at_s), now_s = self.last, time.monotonic()
        alive = now_s - at_s <= LIFE_S
        if alive and any(asked) and not self._driving:
            self._control.pause(f"driven by {TOPIC}", robot=self._name)
            self._driving = True  # the run stands still from its next tick on
            return
        if not self._driving:
            return
        if self._base is None or self._base[0] is not context:
            self._base = (context, Base(context))
        base = self._base[1]
        if alive and any(asked):
            self._moved_s = now_s
            self._drive(base, context, np.array(asked))
        else:
            base.stop()
        if now_s - max(at_s, self._moved_s) > RESUME_S:
            self._driving = False
            self._control.resume(robot=self._name)

    def _drive(self, base: Base, context: SkillContext, wanted: FloatArray) -> None:
        """Drives towards a velocity within the base's limits, slower or not at all near obstacles."""
        limits, abilities = FollowerOptions(), context.robot.capabilities()
        most = np.array([limits.max_speed_m_s, limits.lateral_m_s, limits.turn_rad_s])
        wanted = np.clip(wanted, -most, most)
        wanted *= min(1.0, abilities.max_speed_m_s / max(float(np.hypot(*wanted[:2])), 1e-9))
        change = _TICK_S * np.array([limits.acceleration_m_s2] * 2 + [limits.turn_acceleration_rad_s2])
        towards = base.last_velocity + np.clip(wanted - base.last_velocity, -change, change)
        for share in (1.0, 0.5, 0.25):
            if is_clear(context, share * towards):
                base.drive(tuple((share * towards).tolist()))
                return
        base.stop()


def is_clear(context: SkillContext, moving: FloatArray) -> bool:
    """Returns whether the ground that the body covers until it stands is free, or its clearance grows."""
    here, footprint = context.pose(), Footprint.of(context.robot.capabilities())
    until_s = _REACTION_S + float(np.hypot(*moving[:2])) / (2.0 * _BRAKING_M_S2)
    times = np.linspace(0.0, until_s, _SAMPLES)
    halfway = here.yaw_rad + 0.5 * moving[2] * times
    x = here.x_m + times * (np.cos(halfway) * moving[0] - np.sin(halfway) * moving[1])
    y = here.y_m + times * (np.sin(halfway) * moving[0] + np.cos(halfway) * moving[1])
    poses = np.stack([x, y, here.yaw_rad + moving[2] * times], axis=1)
    clearance = footprint_clearance_m(context.costmap, footprint, poses)
    return bool(np.min(clearance[1:]) >= min(SAFE_MARGIN_M, float(clearance[0]) + 0.002))
