"""Driving the base for a skill: one command after another, each short-lived, and all of them ended at the end."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from skills.api import SkillContext
from skills.patience import Patience
from skills.robot import CommandId, CommandState

EXPIRY_S = 0.3
"""A drive command lives so long (s) unless the next one replaces it."""


class Base:
    """Sends drive commands under a context's lease and remembers the last; `accepted` once the robot took one.

    `patience` is with a robot that refuses them.
    """

    def __init__(self, context: SkillContext) -> None:
        self._context = context
        self._command: CommandId | None = None
        self.accepted = False
        self.patience = Patience(context.clock)
        self.last_velocity: NDArray[np.float64] = np.zeros(3)

    def drive(self, velocity: tuple[float, float, float]) -> None:
        """Moves at a body-frame velocity (m/s, m/s, rad/s) until the next call, EXPIRY_S at the longest."""
        until_s = self._context.clock.now() + EXPIRY_S
        self._command = self._context.robot.drive(*velocity, until_s=until_s, lease=self._context.lease)
        self.last_velocity = np.array(velocity)

    def refusal(self) -> str | None:
        """Why the robot refused the last command, None when it did not."""
        if self._command is None:
            return None
        status = self._context.robot.command_status(self._command)
        if status.state is CommandState.REFUSED:
            return status.reason or "no reason given"
        self.accepted = True
        self.patience.over()
        return None

    def asks_again(self) -> bool:
        """Asks a robot that refused once more, by a command to stand; False when patience or the lease is gone."""
        if self._context.robot.lease_holder() != self._context.lease or not self.patience.is_left():
            return False
        self.drive((0.0, 0.0, 0.0))
        return True

    def stop(self) -> None:
        """Stops the last command, if it still runs, and nothing else."""
        self.last_velocity = np.zeros(3)
        if self._command is None:
            return
        if self._context.robot.command_status(self._command).state is CommandState.RUNNING:
            self._context.robot.stop(lease=self._context.lease, only=self._command)
        self._command = None
