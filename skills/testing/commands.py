"""The scripted robot's commands: one at a time for each part, with expiry."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from skills.robot import CommandId, CommandState, CommandStatus


@dataclass(frozen=True)
class ActiveCommand:
    """A command that runs: what it asks for, since when and until when (s)."""

    id: CommandId
    goal: Any
    since_s: float
    until_s: float


class Commands:
    """All commands ever given, and for each part ("drive", "stand", "move_arm", "set_gripper") the one that runs."""

    def __init__(self) -> None:
        self._statuses: dict[CommandId, CommandStatus] = {}
        self._active: dict[str, ActiveCommand] = {}

    def note(self, status: CommandStatus) -> CommandId:
        """A command that is over as soon as it is given."""
        command = CommandId(len(self._statuses) + 1)
        self._statuses[command] = status
        return command

    def begin(self, part: str, goal: Any, now_s: float, until_s: float) -> CommandId:
        """Begins a command in place of the part's running one."""
        command = self.note(CommandStatus(CommandState.RUNNING))
        self.finish(part, CommandState.STOPPED, f"replaced by command {command}")
        self._active[part] = ActiveCommand(command, goal, now_s, until_s)
        return command

    def finish(self, part: str, state: CommandState, reason: str = "") -> None:
        """Ends the part's running command, if any."""
        active = self._active.pop(part, None)
        if active is not None:
            self._statuses[active.id] = CommandStatus(state, reason)

    def stop(self, only: CommandId | None) -> None:
        """Stops all running commands, or only one."""
        for part, active in list(self._active.items()):
            if only in (None, active.id):
                self.finish(part, CommandState.STOPPED, "stopped")

    def expire(self, now_s: float) -> None:
        """Ends what has run out of time: a drive is done then, all else has not got there."""
        for part, active in list(self._active.items()):
            if now_s > active.until_s:
                late = (CommandState.DONE, "expired") if part == "drive" else (CommandState.STOPPED, "expired")
                self.finish(part, *late)

    def active(self, part: str) -> ActiveCommand | None:
        """The part's running command."""
        return self._active.get(part)

    def status(self, command: CommandId) -> CommandStatus:
        """What became of a command. Raises KeyError for an id never given."""
        return self._statuses[command]

    @property
    def moving_parts(self) -> tuple[str, ...]:
        """The parts that have a running command."""
        return tuple(self._active)
