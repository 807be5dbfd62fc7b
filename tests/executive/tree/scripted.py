"""Leaves that do what a script says, and count what is done to them."""

from py_trees.behaviour import Behaviour
from py_trees.behaviours import StatusQueue
from py_trees.common import Status

from executive.tree.behaviour import Explained
from skills.api import Cause

R, S, F, N = Status.RUNNING, Status.SUCCESS, Status.FAILURE, Status.INVALID


class Leaf(Explained, Behaviour):
    """Goes through `script` ("RRS": running twice, then success), the last letter again and again.

    S: success, F: failure with EXECUTION, E: with ERROR, C: with CANCELLED. With `restarts` each start begins it
    from its beginning, else it goes on. `log` gets "+name" when it begins and "-name" when it is stopped while running.
    """

    def __init__(self, script, name="leaf", log=None, restarts=False, put=None):
        super().__init__(name)
        self.path_id, self.cause, self.message = f"alice/{name}", None, ""
        self.script, self.log, self.restarts, self.put = script, [] if log is None else log, restarts, put
        self.place = self.ticks = self.suspended = 0

    def initialise(self):
        self.clear_explanation()
        self.log.append(f"+{self.name}")
        self.place = 0 if self.restarts else self.place

    def update(self):
        letter = self.script[min(self.place, len(self.script) - 1)]
        self.place += 1
        self.ticks += 1
        self.message = f"{self.name} {letter}"
        self.cause = {"F": Cause.EXECUTION, "E": Cause.ERROR, "C": Cause.CANCELLED}.get(letter)
        if letter not in "RS":
            return F
        if letter == "S" and self.put is not None:
            self.put()
        return R if letter == "R" else S

    def suspend(self):
        self.suspended += 1

    def terminate(self, new_status):
        if new_status == N and self.status == R:
            self.log.append(f"-{self.name}")


class Queue(Explained, StatusQueue):
    """Goes through `statuses`, then succeeds; says why it fails, and counts how often it is stopped."""

    def __init__(self, *statuses: Status, name: str = "action", cause: Cause = Cause.EXECUTION) -> None:
        super().__init__(name=name, queue=list(statuses), eventually=S)
        self.path_id, self.fails_with, self.stopped = f"a/{name}", cause, 0
        self.clear_explanation()

    def update(self) -> Status:
        status = super().update()
        self.cause, self.message = (self.fails_with, "slipped") if status == F else (None, "goes on")
        return status

    def terminate(self, new_status: Status) -> None:
        self.stopped += new_status == N and self.status == R


def tick(root, times=1, clock=None, dt_s=1.0):
    """Tick the root, after dt_s of the clock each where one is given; its status after each tick."""
    found = []
    for _ in range(times):
        if clock is not None:
            clock.advance(dt_s)
        root.tick_once()
        found.append(root.status)
    return found


def letters(root, times):
    """The root's status after each tick, by its first letter."""
    return "".join(status.value[0] for status in tick(root, times))
