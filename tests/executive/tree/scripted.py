"""Leaves and conditions that do what a script says, and note what is done to them."""

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from executive.tree.behaviour import Explained, Hook, suspend
from skills.api import Cause

R, S, F, N = Status.RUNNING, Status.SUCCESS, Status.FAILURE, Status.INVALID
CAUSES = {
    "B": Cause.PRECONDITION, "C": Cause.CANCELLED, "E": Cause.ERROR, "F": Cause.EXECUTION, "O": Cause.POSTCONDITION,
    "P": Cause.PLANNING, "T": Cause.TIMEOUT,
}  # fmt: skip


class Leaf(Explained, Behaviour):
    """Goes through `script` ("RRS": running twice, then success), the last letter again and again.

    S: success; the letters of CAUSES: a failure. With `restarts` each start begins it from its beginning, else it goes
    on. `log` gets "+name" when it begins, "~name" when it is suspended, and "-name" when it is stopped while running.
    """

    def __init__(self, script, name="leaf", log=None, restarts=False, put=None, hook=None):
        super().__init__(name)
        self.hook = hook or Hook()
        self.path_id, self.cause, self.message = f"alice/{name}", None, ""
        self.script, self.log, self.restarts, self.put = script, [] if log is None else log, restarts, put
        self.place = self.ticks = self.begun = 0

    def initialise(self):
        self.clear_explanation()
        self.begun += 1
        self.log.append(f"+{self.name}")
        self.place = 0 if self.restarts else self.place

    def update(self):
        letter = self.script[min(self.place, len(self.script) - 1)]
        self.place += 1
        self.ticks += 1
        self.message = f"{self.name} {letter}"
        self.cause = CAUSES.get(letter)
        if letter not in "RS":
            return F
        if letter == "S" and self.put is not None:
            self.put()
        return R if letter == "R" else S

    def suspend(self):
        self.log.append(f"~{self.name}")

    def stop(self, new_status):
        self.hook.note_stop(self, new_status)
        super().stop(new_status)

    def terminate(self, new_status):
        if new_status == N and self.status == R:
            self.log.append(f"-{self.name}")


class Switch:
    """A condition whose verdict is set by hand; counts how often it begins."""

    def __init__(self):
        self.verdict, self.begun = None, 0

    def for_run(self, context):
        return self

    def begin(self, context):
        self.begun += 1

    def note_call(self):
        pass

    def check(self, context):
        return self.verdict


def tick(root, times=1, clock=None, dt_s=1.0):
    """Tick the root, after dt_s of the clock each where one is given; its status after each tick."""
    found = []
    for _ in range(times):
        if clock is not None:
            clock.advance(dt_s)
        root.tick_once()
        found.append(root.status)
    return found


def play(root, expected, clock=None):
    """Ticks the root for each letter of `expected`, suspends it at "|" and stops it at "I"; its status after each.

    The clock, if one is given, advances by a second after each.
    """
    found = ""
    for letter in expected:
        if letter == "|":
            suspend(root)
        elif letter == "I":
            root.stop(N)
        else:
            root.tick_once()
        found += "|" if letter == "|" else root.status.value[0]
        if clock is not None:
            clock.advance(1.0)
    return found


def table(root, ticks):
    """First letters of the statuses of the root and its children after each tick."""
    rows = []
    for _ in range(ticks):
        root.tick_once()
        rows.append("".join(node.status.value[0] for node in (root, *root.children)))
    return rows


def told(published, topic="transitions"):
    """Messages of one topic."""
    return [message["message"] for each, message in published if each == topic]
