"""Sends the page what a run does not log: its progress, and the state of its control."""

from __future__ import annotations

import threading
import time
from collections.abc import Mapping
from typing import Any, Final

from py_trees.common import Status

from executive.run.control import Control
from executive.run.control_state import Mode
from executive.run.visitor import Progress, RunVisitor
from executive.tree.snapshot import NodeState, Snapshot
from executive.view.actions import control_json
from executive.view.feed import Feed

PROGRESS_PERIOD_S: Final = 0.15
SEND_LIMIT_S: Final = 0.2
_LOOK_AGAIN_S: Final = 0.5


class ProgressWatch(RunVisitor):
    """Sends the progress a few times a second, and lets the page keep up."""

    def __init__(self, feed: Feed) -> None:
        self._feed = feed
        self._sent_s = 0.0

    def tick(self, progress: Progress) -> None:
        """Sends the progress if it is time again; waits a moment until the page has all messages."""
        now = time.perf_counter()
        if now - self._sent_s >= PROGRESS_PERIOD_S:
            self._sent_s = now
            self._feed.tell("progress", progress_json(progress))
        self._feed.wait_sent(SEND_LIMIT_S)


def progress_json(progress: Progress) -> Mapping[str, Any]:
    """For each robot its deepest running node, with message and progress (0 to 1)."""
    robots = {name: _doing(states) for name, states in progress.states.items()}
    word = {"now_s": round(progress.now_s, 3), "ticks": progress.ticks, "overruns": progress.overruns}
    return {**word, "robots": robots}


def _doing(states: Snapshot) -> Mapping[str, Any]:
    running = [(path_id, state) for path_id, state in states.items() if state.status is Status.RUNNING]
    path_id, state = running[-1] if running else (None, NodeState())
    return {"node": path_id, "message": state.message, "progress": state.progress}


class ControlWatch:
    """Sends each new state of a control, in a thread of its own, until the run ends or `close`."""

    def __init__(self, control: Control, feed: Feed) -> None:
        self._control, self._feed = control, feed
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._watch, name="errand-control-watch", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Stops sending; idempotent."""
        self._closing.set()
        self._thread.join(2 * _LOOK_AGAIN_S)

    def _watch(self) -> None:
        version = -1
        while not self._closing.is_set():
            state = self._control.wait(version, _LOOK_AGAIN_S)
            if state.version != version:
                version = state.version
                self._feed.tell("control", control_json(state))
            if state.mode is Mode.ENDED:
                return
