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
class Active(Generic[PayloadT]):
    """A command that runs: what it asks for, since when and until when (robot's clock, s)."""

    id: CommandId
    payload: PayloadT
    since_s: float
    until_s: float


class CommandTable:
    """The running command of each part, and the last that are over.

    Of one that was over long ago it is only known that it is over.
    """

    def __init__(self) -> None:
        self._statuses: dict[CommandId, CommandStatus] = {}
        self._running: dict[Part, Active[object]] = {}
        self._given = 0

    def begin(self, part: Part, payload: object, now_s: float, until_s: float) -> CommandId:
        """Start a command in place of the part's running one."""
        command = self._new_id()
        self.finish(part, CommandState.STOPPED, f"replaced by command {command}")
        self._statuses[command] = CommandStatus(CommandState.RUNNING)
        self._running[part] = Active(command, payload, now_s, until_s)
        return command

    def refuse(self, reason: str) -> CommandId:
        """A command that never started."""
        command = self._new_id()
        self._statuses[command] = CommandStatus(CommandState.REFUSED, reason)
        return command

    def note(self, state: CommandState, reason: str = "") -> CommandId:
        """A command that is over as soon as it is given."""
        command = self._new_id()
        self._statuses[command] = CommandStatus(state, reason)
        return command

    def finish(self, part: Part, state: CommandState, reason: str = "") -> None:
        """End the part's running command, if any."""
        active = self._running.pop(part, None)
        if active is not None:
            self._statuses[active.id] = CommandStatus(state, reason)

    def running(self, part: Part) -> Active[object] | None:
        """The part's running command."""
        return self._running.get(part)

    def part_of(self, command: CommandId) -> Part | None:
        """The part that runs `command` now, or None."""
        return next((part for part, active in self._running.items() if active.id == command), None)

    def status(self, command: CommandId) -> CommandStatus:
        """State of a command. Raises KeyError for an id never given."""
        known = self._statuses.get(command)
        if known is None and not 0 < command <= self._given:
            raise KeyError(command)
        return known or CommandStatus(CommandState.STOPPED, "it was over long ago")

    def _new_id(self) -> CommandId:
        self._given += 1
        if len(self._statuses) > MOST_KEPT:
            running = {active.id for active in self._running.values()}
            old = [each for each in list(self._statuses)[: MOST_KEPT // 2] if each not in running]
            for each in old:
                del self._statuses[each]
        return CommandId(self._given)
