"""The robot's command book: ids, states and expiry."""

from __future__ import annotations

import enum
from dataclasses import dataclass
from typing import Final, Generic, TypeVar

from skills.robot import CommandId, CommandState, CommandStatus

PayloadT = TypeVar("PayloadT")

MOST_KEPT: Final = 2000
"""So many commands are kept: those of ten seconds and more."""


class Part(enum.Enum):
    """What a command moves; one command at a time each."""

    VELOCITY = "velocity"
    POSTURE = "posture"
    ARM = "arm"
    GRIPPER = "gripper"
    HEAD = "head"


@dataclass(frozen=True)
class Velocity:
    """A planar velocity in the body frame: m/s, m/s, rad/s."""

    vx: float = 0.0
    vy: float = 0.0
    wz: float = 0.0


@dataclass(frozen=True)
class HeadGoal:
    """Angles that a head turns to: pan and tilt (rad)."""

    angles_rad: tuple[float, float]


@dataclass(frozen=True)
class Active(Generic[PayloadT]):
    """A command that runs: what it asks for, since when and until when (robot's clock, s)."""

    id: CommandId
    payload: PayloadT
    since_s: float
    until_s: float


class CommandStatuses:
    """The statuses of the last commands. Of one that was over long ago it is only known that it is over."""

    def __init__(self) -> None:
        self._statuses: dict[CommandId, CommandStatus] = {}
        self._given = 0

    def status(self, command: CommandId) -> CommandStatus:
        """State of a command. Raises KeyError for an id never given."""
        known = self._statuses.get(command)
        if known is None and not 0 < command <= self._given:
            raise KeyError(command)
        return known or CommandStatus(CommandState.STOPPED, "it was over long ago")

    def add(self, status: CommandStatus) -> CommandId:
        """A new command in this state."""
        self._given += 1
        if len(self._statuses) > MOST_KEPT:
            for each in list(self._statuses)[: MOST_KEPT // 2]:
                if self._statuses[each].state is not CommandState.RUNNING:
                    del self._statuses[each]
        self._statuses[CommandId(self._given)] = status
        return CommandId(self._given)

    def change(self, command: CommandId, status: CommandStatus) -> None:
        """The state of a command is another now."""
        self._statuses[command] = status


class CommandTable(CommandStatuses):
    """The running command of each part, and the last that are over."""

    def __init__(self) -> None:
        super().__init__()
        self._running: dict[Part, Active[object]] = {}

    def begin(self, part: Part, payload: object, now_s: float, until_s: float) -> CommandId:
        """Starts a command in place of the part's running one."""
        command = self.add(CommandStatus(CommandState.RUNNING))
        self.finish(part, CommandState.STOPPED, f"replaced by command {command}")
        self._running[part] = Active(command, payload, now_s, until_s)
        return command

    def refuse(self, reason: str) -> CommandId:
        """A command that never started."""
        return self.add(CommandStatus(CommandState.REFUSED, reason))

    def note(self, state: CommandState, reason: str = "") -> CommandId:
        """A command that is over as soon as it is given."""
        return self.add(CommandStatus(state, reason))

    def finish(self, part: Part, state: CommandState, reason: str = "") -> None:
        """Ends the part's running command, if any."""
        active = self._running.pop(part, None)
        if active is not None:
            self.change(active.id, CommandStatus(state, reason))

    def running(self, part: Part) -> Active[object] | None:
        """The part's running command."""
        return self._running.get(part)

    def part_of(self, command: CommandId) -> Part | None:
        """The part that runs `command` now, or None."""
        return next((part for part, active in self._running.items() if active.id == command), None)
