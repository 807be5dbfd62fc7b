"""Commands of the scripted robot, with expiry: each part runs one at a time."""

from skills.command_table import CommandTable
from skills.robot import CommandCause, CommandId, CommandState


class Commands(CommandTable[str]):
    """Commands of the parts "drive", "stand", "move_arm", "point_head" and "set_gripper"."""

    def stop(self, only: CommandId | None, cause: CommandCause = CommandCause.STOPPED) -> None:
        """Stops all running commands, or only one."""
        for part, active in list(self._running.items()):
            if only in (None, active.id):
                self.finish(part, CommandState.STOPPED, "stopped", cause)

    def expire(self, now_s: float) -> None:
        """Ends commands at their expiry: a drive is then done, any other is stopped before its goal."""
        for part, active in list(self._running.items()):
            if now_s > active.until_s:
                if part == "drive":
                    self.finish(part, CommandState.DONE, "expired")
                else:
                    self.finish(part, CommandState.STOPPED, "expired", CommandCause.LATE)

    @property
    def moving_parts(self) -> tuple[str, ...]:
        """Parts that have a running command."""
        return tuple(self._running)
