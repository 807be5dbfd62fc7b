"""Commands of the scripted robot, with expiry: each part runs one at a time."""

from dataclasses import dataclass
from typing import Any

from skills.robot import CommandCause, CommandId, CommandState, CommandStatus


@dataclass(frozen=True)
class ActiveCommand:
    """Running command with its goal, start and expiry (s)."""

    id: CommandId
    goal: Any
    since_s: float
    until_s: float


class Commands:
    """Statuses of all commands, and the running command of each part ("drive", "stand", "move_arm", "set_gripper")."""

    def __init__(self) -> None:
        self._statuses: dict[CommandId, CommandStatus] = {}
        self._active: dict[str, ActiveCommand] = {}

    def add(self, status: CommandStatus) -> CommandId:
        """Adds a command with a status."""
        command = CommandId(len(self._statuses) + 1)
        self._statuses[command] = status
        return command

    def begin(self, part: str, goal: Any, now_s: float, until_s: float) -> CommandId:
        """Begins a command, which replaces the part's running one."""
        command = self.add(CommandStatus(CommandState.RUNNING))
        self.finish(part, CommandState.STOPPED, f"replaced by command {command}", CommandCause.STOPPED)
        self._active[part] = ActiveCommand(command, goal, now_s, until_s)
        return command

    def finish(self, part: str, state: CommandState, reason: str = "", cause: CommandCause = CommandCause.NONE) -> None:
        """Ends the part's running command; does nothing when none is running."""
        active = self._active.pop(part, None)
        if active is not None:
            self._statuses[active.id] = CommandStatus(state, reason, cause)

    def stop(self, only: CommandId | None, cause: CommandCause = CommandCause.STOPPED) -> None:
        """Stops all running commands, or only one."""
        for part, active in list(self._active.items()):
            if only in (None, active.id):
                self.finish(part, CommandState.STOPPED, "stopped", cause)

    def expire(self, now_s: float) -> None:
        """Ends commands at their expiry: a drive is then done, any other is stopped before its goal."""
        for part, active in list(self._active.items()):
            if now_s > active.until_s:
                if part == "drive":
                    self.finish(part, CommandState.DONE, "expired")
                else:
                    self.finish(part, CommandState.STOPPED, "expired", CommandCause.LATE)

    def active(self, part: str) -> ActiveCommand | None:
        """Running command of a part; None when there is none."""
        return self._active.get(part)

    def status(self, command: CommandId) -> CommandStatus:
        """Status of a command. Raises KeyError for an unknown id."""
        return self._statuses[command]

    @property
    def moving_parts(self) -> tuple[str, ...]:
        """Parts that have a running command."""
        return tuple(self._active)
