"""Tasks of the whole robot that take several steps, such as walking to an object or docking."""

from __future__ import annotations

import logging
import math
from collections.abc import Generator
from itertools import pairwise
from typing import Final

from bosdyn.api import arm_command_pb2

from errand_spot.server.arm import Named
from errand_spot.server.computer import Computer
from errand_spot.server.leases import ARM, GRIPPER, MOBILITY
from errand_spot.server.mobility import Status, way_to
from skills.robot import Pose2D

_LOG: Final = logging.getLogger(__name__)
WHOLE: Final = (MOBILITY, ARM, GRIPPER)
"""Parts of a task."""
_LEAST_WALK_S, _WALK_S_PER_M = 10.0, 3.0
_Positions: Final = arm_command_pb2.NamedArmPositionsCommand
Steps = Generator[None, None, int]
"""Steps of a task, one in each period; returns its last state."""


class Task:
    """Stepwise motion of all parts, with a state of the API. Other threads read `state`."""

    broken: int
    """State of a task that another command has ended."""

    def __init__(self, state: int) -> None:
        self.state, self._steps = state, None

    _steps: Steps | None

    def begin(self, computer: Computer) -> None:
        """Starts it."""
        self._steps = self._run(computer)
        self.tick(computer)

    def tick(self, _computer: Computer) -> None:
        """Goes on with it."""
        if self._steps is not None:
            try:
                next(self._steps)
            except StopIteration as done:
                self.state, self._steps = done.value, None
            except Exception:  # a defect of a task ends it, and not the robot
                _LOG.exception("a task failed")
                self.state, self._steps = self.broken, None

    def end(self, _status: int) -> None:
        """Ends what is not finished."""
        if self._steps is not None:
            self._steps.close()
            self.state, self._steps = self.broken, None

    def _run(self, computer: Computer) -> Steps:
        """Does the task; returns its last state."""
        raise NotImplementedError


def stow(computer: Computer) -> Generator[None, None, None]:
    """Stows the arm, unless it holds an item or there is none."""
    if computer.capabilities.arm is None:
        return
    motion = Named(_Positions.Request(position=_Positions.POSITIONS_STOW))
    motion.begin(computer)
    while motion.feedback.named_arm_position_feedback.status == motion.going:
        yield
        motion.tick(computer)


def walk(computer: Computer, *poses_O: Pose2D, padding_m: float | None = None) -> Generator[None, None, bool]:
    """Walks straight to each pose in `odom`, standing up before; returns whether the robot came there in time.

    It stops in front of obstacles, at `padding_m`; with None only before no-go regions.
    """
    legs = pairwise([computer.snapshot.odometry.pose, *poses_O])
    far_m = sum(math.hypot(b.x_m - a.x_m, b.y_m - a.y_m) for a, b in legs)
    end_s = computer.now_s() + _LEAST_WALK_S + _WALK_S_PER_M * far_m
    motion = way_to(poses_O, end_s, computer.snapshot, padding_m=padding_m)
    motion.begin(computer)
    while motion.status == Status.STATUS_PROCESSING:
        yield
        motion.tick(computer)
        if motion.status == Status.STATUS_PROCESSING and not motion.moving:
            return motion.arrived
    return False
