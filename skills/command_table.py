"""Commands and lease of a robot in software: ids, statuses and expiry of commands."""

from __future__ import annotations

import math
from collections.abc import Hashable, Iterable
from dataclasses import dataclass
from typing import Any, Final, Generic, TypeVar
from uuid import uuid4

from skills.robot import CommandCause, CommandId, CommandState, CommandStatus, Lease, LeaseError

PartT = TypeVar("PartT", bound=Hashable)

MOST_STATUSES: Final = 2000
"""Number of stored statuses, enough for the commands of ten seconds."""


@dataclass(frozen=True)
class Active:
    """A running command: its goal, and its start and expiry on the robot's clock (s)."""

    id: CommandId
    goal: Any
    since_s: float
    until_s: float


class CommandStatuses:
    """Statuses of the latest commands; any older command is reported as stopped."""

    def __init__(self) -> None:
        self._statuses: dict[CommandId, CommandStatus] = {}
        self._given = 0

    def status(self, command: CommandId) -> CommandStatus:
        """Returns the status of a command. Raises KeyError for an unknown id."""
        known = self._statuses.get(command)
        if known is None and not 0 < command <= self._given:
            raise KeyError(command)
        return known or CommandStatus(CommandState.STOPPED, "it was over long ago", CommandCause.STOPPED)

    def add(self, status: CommandStatus) -> CommandId:
        """Adds a command with a status and returns its id."""
        self._given += 1
        if len(self._statuses) > MOST_STATUSES:
            for each in list(self._statuses)[: MOST_STATUSES // 2]:
                if self._statuses[each].state is not CommandState.RUNNING:
                    del self._statuses[each]
        self._statuses[CommandId(self._given)] = status
        return CommandId(self._given)

    def change(self, command: CommandId, status: CommandStatus) -> None:
        """Changes the status of a command."""
        self._statuses[command] = status


class CommandTable(CommandStatuses, Generic[PartT]):
    """Running command of each part of a robot, and the statuses of the latest commands."""

    def __init__(self) -> None:
        super().__init__()
        self._running: dict[PartT, Active] = {}

    def begin(self, part: PartT, goal: Any, now_s: float, until_s: float) -> CommandId:
        """Begins a command, which replaces the running command of the part."""
        command = self.add(CommandStatus(CommandState.RUNNING))
        self.finish(part, CommandState.STOPPED, f"replaced by command {command}", CommandCause.STOPPED)
        self._running[part] = Active(command, goal, now_s, until_s)
        return command

    def refuse(self, reason: str, cause: CommandCause = CommandCause.INVALID) -> CommandId:
        """Adds a refused command with its reason."""
        return self.add(CommandStatus(CommandState.REFUSED, reason, cause))

    def note(self, state: CommandState) -> CommandId:
        """Adds a command that has already ended."""
        return self.add(CommandStatus(state))

    def finish(
        self, part: PartT, state: CommandState, reason: str = "", cause: CommandCause = CommandCause.NONE
    ) -> None:
        """Ends the running command of a part; does nothing when none is running."""
        active = self._running.pop(part, None)
        if active is not None:
            self.change(active.id, CommandStatus(state, reason, cause))

    def running(self, part: PartT) -> Active | None:
        """Running command of a part; None when there is none."""
        return self._running.get(part)


def refusal_of(
    what: str, lost: str | None, values: Iterable[float], *, until_s: float, now_s: float
) -> tuple[str, CommandCause] | None:
    """Reason and cause for which every robot refuses a command; None when it may begin.

    `lost` is why the lease does not count (None: it does), `values` are the numbers of the command.
    """
    if lost is not None:
        return f"{what}: {lost}", CommandCause.NO_LEASE
    if not all(map(math.isfinite, values)) or math.isnan(until_s):
        return f"{what}: a value is not finite", CommandCause.INVALID
    if until_s <= now_s:
        return f"{what}: expires at {until_s:.2f} s, and it is {now_s:.2f} s already", CommandCause.LATE
    return None


class LeaseManager:
    """Manages one robot's lease; only the lease with the highest number is valid."""

    def __init__(self, robot_name: str) -> None:
        self._robot_name, self._epoch = robot_name, uuid4().hex
        self._number = 0
        self._current: Lease | None = None

    @property
    def current(self) -> Lease | None:
        """Valid lease; None while nobody holds one."""
        return self._current

    def acquire(self, holder: str) -> Lease:
        """Gives a free lease to `holder`. Raises LeaseError while another holder has it."""
        if self._current is not None:
            held = f"{self._robot_name}: the lease is held by {self._current.holder!r}"
            raise LeaseError(f"{held}; ask for its return, or take it")
        return self.take(holder)

    def take(self, holder: str) -> Lease:
        """Gives the lease to `holder`, also while another holder has it."""
        self._number += 1
        self._current = Lease(self._robot_name, holder, self._number, self._epoch)
        return self._current

    def give_back(self, lease: Lease) -> bool:
        """Frees the lease; returns False when `lease` was not valid."""
        if lease != self._current:
            return False
        self._current = None
        return True

    def refusal(self, lease: Lease) -> str | None:
        """Reason why `lease` does not allow motion; None when it does."""
        if lease == self._current:
            return None
        holder = self._current.holder if self._current else "nobody"
        return f"lease {lease.number} of {lease.holder!r} no longer counts; the lease is held by {holder!r}"


class ScriptedCommands(CommandTable[str]):
    """Commands of the scripted robot's parts "drive", "stand", "move_arm", "point_head" and "set_gripper"."""

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
