"""Drive commands for skills: each one expires soon, and the last one is stopped when the skill ends."""

import math
from collections.abc import Callable
from typing import Final

import numpy as np
from numpy.typing import NDArray

from skills.api import Cause, InputsT, Running, SkillContext
from skills.footprint import SAFE_MARGIN_M, Footprint, footprint_clearance_m, pose_array
from skills.geometry import compose
from skills.robot import CommandCause, CommandId, CommandState, Pose2D
from skills.routine import Patience, Routine, RoutineSkill, SkillFailure

_LOOK_AHEAD_S, _BRAKING_M_S2 = 0.4, 2.0
_STOPPED_BY_ROBOT: Final = (CommandCause.ESTOPPED, CommandCause.UNPOWERED, CommandCause.FAULT)


class Base:
    """Sends drive commands under a context's lease.

    `accepted` becomes True once the robot accepts a command; `patience` limits how long a robot may refuse commands.
    """

    def __init__(self, context: SkillContext) -> None:
        self._context = context
        self._command: CommandId | None = None
        self._cause = CommandCause.NONE  # of the last refusal
        self._halt: Callable[[], None] | None = None  # halts another driver, to whom the base is left
        self._footprint = Footprint.of(context.robot.capabilities())
        self.accepted = False
        self.patience = Patience(context.clock)
        self.last_velocity: NDArray[np.float64] = np.zeros(3)

    def drive(self, velocity: tuple[float, float, float]) -> None:
        """Moves at a body-frame velocity (m/s, m/s, rad/s) until the next call; without a call the drive expires.

        Speed-limit zones reduce the velocity.
        """
        halt, self._halt = self._halt, None
        if halt is not None:
            halt()
        velocity = self._within_limits(velocity)
        until_s = self._context.clock.now() + self._context.robot.capabilities().drive_expiry_s
        self._command = self._context.robot.drive(*velocity, until_s=until_s, lease=self._context.lease)
        self.last_velocity = np.array(velocity)

    def drive_clear(self, wanted: NDArray[np.float64], most_change: NDArray[np.float64]) -> bool:
        """Drives towards a velocity (3,), changed by so much at most, slower near obstacles; returns whether it does.

        The ground that the body covers until it stands must be free, or its clearance grow; else the base stops.
        """
        towards = self.last_velocity + np.clip(wanted - self.last_velocity, -most_change, most_change)
        for velocity in (towards, 0.5 * towards, 0.25 * towards):
            if self._is_clear(vx := float(velocity[0]), vy := float(velocity[1]), wz := float(velocity[2])):
                self.drive((vx, vy, wz))
                return True
        self.stop()
        return False

    def _is_clear(self, vx: float, vy: float, wz: float) -> bool:
        here, until_s = self._context.pose(), _LOOK_AHEAD_S + math.hypot(vx, vy) / (2.0 * _BRAKING_M_S2)
        ahead = [compose(here, _moved(vx, vy, wz, time_s)) for time_s in np.linspace(0.0, until_s, 6)]
        clearance = footprint_clearance_m(self._context.costmap, self._footprint, pose_array(ahead))
        return bool(np.min(clearance[1:]) >= min(SAFE_MARGIN_M, float(clearance[0]) + 0.002))

    def _within_limits(self, velocity: tuple[float, float, float]) -> tuple[float, float, float]:
        """The velocity, reduced to the speed limits of the zones about the robot."""
        speed = math.hypot(velocity[0], velocity[1])
        if not self._context.zones or speed == 0.0:
            return velocity
        here = self._context.pose()
        ahead = [compose(here, Pose2D(*(_LOOK_AHEAD_S * n * v for v in velocity))) for n in range(2)]
        most = self._context.zone_map().speed_m_s(self._footprint, pose_array(ahead), np.zeros(2))
        share = min(1.0, most / speed)
        return velocity[0] * share, velocity[1] * share, velocity[2] * share

    def refusal(self) -> str | None:
        """Reason why the robot refused or stopped the last command; None when it carries it out."""
        if self._command is None:
            return None
        status = self._context.robot.command_status(self._command)
        if status.state is CommandState.REFUSED or status.cause in _STOPPED_BY_ROBOT:
            self._cause = status.cause
            return status.reason or "no reason given"
        self.accepted = True
        self.patience.reset()
        return None

    def ask_again(self) -> bool:
        """Repeats a refused request as a command to stand; returns False when patience is over or the lease is lost."""
        if self._cause is CommandCause.NO_LEASE or not self.patience.is_left():
            return False
        self.drive((0.0, 0.0, 0.0))
        return True

    def leave_to(self, halt: Callable[[], None]) -> None:
        """Leaves the base to another driver until the next command or stop, which calls `halt`."""
        if self._halt != halt:
            self.stop()
            self._halt = halt
        self.last_velocity = np.array(self._context.robot.odometry().velocity)

    def stop(self) -> None:
        """Stops the last command if it still runs, and another driver, but no other motion."""
        if self._halt is not None:
            self.drive((0.0, 0.0, 0.0))
        self.last_velocity = np.zeros(3)
        robot, command, self._command = self._context.robot, self._command, None
        if command is not None and robot.command_status(command).state is CommandState.RUNNING:
            robot.stop(lease=self._context.lease, only=command)


def _moved(vx: float, vy: float, wz: float, time_s: float) -> Pose2D:
    """Where a velocity leads in a time, along an arc (approximately)."""
    c, s = math.cos(0.5 * wz * time_s), math.sin(0.5 * wz * time_s)
    return Pose2D(time_s * (c * vx - s * vy), time_s * (s * vx + c * vy), wz * time_s)


class MovingSkill(RoutineSkill[InputsT]):
    """Routine that moves the base at a velocity for a time; `end` stops the base."""

    def __init__(self, context: SkillContext) -> None:
        super().__init__(context)
        self._base = Base(context)

    def begin(self, inputs: InputsT) -> None:
        """Starts a new attempt; see `RoutineSkill.begin`."""
        super().begin(inputs)
        self._base = Base(self.context)

    def suspend(self) -> None:
        """Stops the base at once; see `RoutineSkill.suspend`."""
        self._base.stop()
        super().suspend()

    def end(self) -> None:
        """Stops the base; see `RoutineSkill.end`."""
        self._base.stop()
        super().end()

    def move(
        self,
        velocity: tuple[float, float, float],
        for_s: float,
        message: str,
        *,
        settle_s: float = 0.5,
        enough: Callable[[], bool] = lambda: False,
    ) -> Routine[None]:
        """Moves at a body-frame velocity (m/s, m/s, rad/s) for a time, or until `enough` returns True; then rests.

        Raises SkillFailure when the robot refuses to drive.
        """
        end_s = self.context.clock.now() + for_s
        while self.context.clock.now() < end_s and not enough():
            end_s += yield from self.drive(velocity, Running(message))
        self._base.stop()
        yield from self.pause(settle_s, "coming to rest")

    def drive(self, velocity: tuple[float, float, float], running: Running) -> Routine[float]:
        """Moves at a body velocity for one tick; returns how long (s) the robot refused. Fails after patience."""
        self._base.drive(velocity)
        yield running
        begun_s = self.context.clock.now()
        while (refusal := self._base.refusal()) is not None:
            if not self._base.ask_again():
                raise SkillFailure(Cause.EXECUTION, f"The robot refused to drive: {refusal}.")
            yield Running(f"{running.message}; the robot refuses to drive: {refusal}")
        return self.context.clock.now() - begun_s
