"""A leaf that does what a script says, and counts what is done to it."""

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from executive.tree.behaviour import Explained
from skills.api import Cause

R, S, F, N = Status.RUNNING, Status.SUCCESS, Status.FAILURE, Status.INVALID


class Leaf(Explained, Behaviour):
    """Goes through `script` ("RRS": running twice, then success), the last letter again and again.

    S: success, F: failure with EXECUTION, E: with ERROR, C: with CANCELLED. With `anew` each start begins the script
    from its beginning, else it goes on. `log` gets "+name" when it begins and "-name" when it is stopped while running.
    """

    def __init__(self, script, name="leaf", log=None, anew=False, put=None):
        super().__init__(name)
        self.path_id, self.cause, self.message = f"alice/{name}", None, ""
        self.script, self.log, self.anew, self.put = script, [] if log is None else log, anew, put
        self.place = self.ticks = self.suspended = 0

    def initialise(self):
        self.clear_explanation()
        self.log.append(f"+{self.name}")
        self.place = 0 if self.anew else self.place

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


def tick(root, times=1):
    """Tick the root, and give its status after each."""
    found = []
    for _ in range(times):
        root.tick_once()
        found.append(root.status)
    return found


def letters(root, times):
    """The root's status after each tick, by its first letter."""
    return "".join(status.value[0] for status in tick(root, times))
