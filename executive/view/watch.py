"""Tells the page what a run does between its log entries: how far it is, and what its control says."""

from __future__ import annotations

import threading
import time
from collections.abc import Mapping
from typing import Any, Final

from py_trees.common import Status

from executive.run.control import Control, Mode
from executive.run.visitor import Progress, RunVisitor
from executive.tree.snapshot import NodeState, Snapshot
from executive.view.actions import control_json
from executive.view.feed import Feed

PROGRESS_PERIOD_S: Final = 0.15
SEND_LIMIT_S: Final = 0.2
_LOOK_AGAIN_S: Final = 0.5


class ProgressWatch(RunVisitor):
    """Tells a few times a second what is done just now, and lets the page keep up."""

    def __init__(self, feed: Feed) -> None:
        self._feed = feed
        self._told_s = 0.0

    def tick(self, progress: Progress) -> None:
        """Tell it when it is time again; wait a moment for what was logged to be sent."""
        now = time.perf_counter()
        if now - self._told_s >= PROGRESS_PERIOD_S:
            self._told_s = now
            self._feed.tell("progress", progress_word(progress))
        self._feed.wait_sent(SEND_LIMIT_S)


def progress_word(progress: Progress) -> Mapping[str, Any]:
    """For each robot what runs: its deepest running node, the sentence, and how far it is (0 to 1) where known."""
    robots = {name: _doing(states) for name, states in progress.states.items()}
    word = {"now_s": round(progress.now_s, 3), "ticks": progress.ticks, "overruns": progress.overruns}
    return {**word, "robots": robots}


def _doing(states: Snapshot) -> Mapping[str, Any]:
    running = [(path_id, state) for path_id, state in states.items() if state.status is Status.RUNNING]
    path_id, state = running[-1] if running else (None, NodeState())
    return {"node": path_id, "message": state.message, "progress": state.progress}


class ControlWatch:
    """Tells each new state of a control, from a thread of its own, until the run has ended or `close`."""

    def __init__(self, control: Control, feed: Feed) -> None:
        self._control, self._feed = control, feed
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._watch, name="errand-control-watch", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Tell no more; idempotent."""
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
