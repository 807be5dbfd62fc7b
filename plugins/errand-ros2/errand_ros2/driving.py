"""Teleoperation of a robot by `/cmd_vel` during a run: it pauses the robot's mission and keeps clear of obstacles."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final

import numpy as np

from errand_ros2.part_actions import PartActions
from errand_ros2.readings import LIFE_S, HeardVelocity, within_limits
from executive.run.control import Control
from skills.api import SkillContext
from skills.navigate.base import Base
from skills.navigate.follower import FollowerOptions

RESUME_S: Final = 1.0  # time without velocities after which the mission goes on
_TICK_S, _LIMITS = 0.05, FollowerOptions()
_MOST: Final = np.array([_LIMITS.max_speed_m_s, _LIMITS.lateral_m_s, _LIMITS.turn_rad_s])
_MOST_CHANGE: Final = _TICK_S * np.array([*[_LIMITS.acceleration_m_s2] * 2, _LIMITS.turn_acceleration_rad_s2])


class Driving(HeardVelocity):
    """Driver of one robot by velocities, which count on the clock `now` (s). The run calls `tick`."""

    def __init__(self, robot_name: str, control: Control, now: Callable[[], float]) -> None:
        super().__init__(now)
        self._name, self._control = robot_name, control
        self._base: tuple[SkillContext, Base] | None = None
        self._driving, self._moved_s = False, -math.inf

    def tick(self, context: SkillContext, parts: PartActions) -> None:
        """Sends the command for the next tick, while velocities arrive, and does what the actions of the parts ask."""
        (asked, at_s), now_s = self.last, self._now()
        drives = now_s - at_s <= LIFE_S and any(asked)
        if (drives or parts.is_busy) and not self._driving:
            self._control.pause("moved by ROS 2", robot=self._name)
            self._driving = True  # the run stands still from its next tick on
            return
        if not self._driving:
            return
        if self._base is None or self._base[0] is not context:
            self._base = (context, Base(context))
        base = self._base[1]
        parts.work.work_for(0.0)
        parts.follow()
        self._moved_s = now_s if drives or parts.is_busy else self._moved_s
        if drives:
            base.drive_clear(np.clip(within_limits(asked, context.robot.capabilities()), -_MOST, _MOST), _MOST_CHANGE)
        else:
            base.stop()
        if now_s - max(at_s, self._moved_s) > RESUME_S:
            self._driving = False
            self._control.resume(robot=self._name)
