"""Sends progress and control state of a run to the page, and defines the actions of its buttons."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any, Final

from py_trees.common import Status

from executive.conversation.replies import Waiting
from executive.record.event_log import plain_values
from executive.run.control import Control
from executive.run.control_state import ControlState, Mode
from executive.run.visitor import Progress, RunVisitor
from executive.tree.node import NodeState
from executive.view.feed import Feed
from skills.inputs.errors import InputError
from skills.inputs.outside import plain_text

Action = Callable[[Mapping[str, Any]], str]


class RefusedError(Exception):
    """Raised by an action that cannot be carried out; the text says why and what to do."""


def control_actions(control: Control) -> Mapping[str, Action]:
    """Returns the actions of a run by name, functions that return a sentence for the page or raise RefusedError."""

    def bound(call: Callable[[Control, Mapping[str, Any]], None], said: str) -> Action:
        """Returns an action that calls the control and then returns the sentence `said`."""

        def action(values: Mapping[str, Any]) -> str:
            try:
                call(control, values)
            except ValueError as error:
                raise RefusedError(str(error)) from error
            robot = robot_of(values)
            return said if robot is None else f"{robot}: {said}"

        return action

    return MappingProxyType({name: bound(call, said) for name, (call, said) in _CALLS.items()})


def text_of(values: Mapping[str, Any], key: str) -> str:
    """Returns a text from an action's values. Raises RefusedError if it is missing, empty, too long or not plain."""
    text = values.get(key)
    if not isinstance(text, str) or not text.strip():
        raise RefusedError(f"the action needs a text under '{key}'")
    try:
        return plain_text(text, what="the text")
    except InputError as error:
        raise RefusedError(str(error)) from error


def robot_of(values: Mapping[str, Any]) -> str | None:
    """Returns the robot that an action is for; None for all robots."""
    robot = values.get("robot")
    return robot if isinstance(robot, str) and robot else None


def control_json(state: ControlState) -> dict[str, Any]:
    """Returns the state of a run's control as JSON values for the page."""
    plain = plain_values(state)
    del plain["version"]
    for each in plain["questions"]:
        each |= each.pop("question")
        del each["limit_s"]
    return {**plain, "breakpoints": sorted(state.breakpoints)}


def asked_json(waiting: Waiting | None, robot: str = "") -> dict[str, Any]:
    """Returns the question that a robot asks back as JSON values for the page; null if it asks none."""
    if waiting is None:
        return {"question": None}
    question = waiting.question
    asked = {"text": question.text, "options": list(question.candidates), "until_s": waiting.until_s}
    return {"question": {**asked, "robot": robot}}


_CALLS: Final[Mapping[str, tuple[Callable[[Control, Mapping[str, Any]], None], str]]] = {
    "pause": (lambda control, values: control.pause("paused from the page", robot=robot_of(values)), "pausing"),
    "resume": (lambda control, values: control.resume(robot=robot_of(values)), "going on"),
    "step": (lambda control, _: control.step(), "one step"),
    "cancel": (
        lambda control, values: control.cancel("cancelled from the page", robot=robot_of(values)),
        "cancelling",
    ),
    "stop": (
        lambda control, values: control.stop_button("the stop button on the page is pressed", robot=robot_of(values)),
        "stopped",
    ),
    "release": (lambda control, values: control.release_stop_button(robot=robot_of(values)), "stop button released"),
    "break": (lambda control, values: control.set_breakpoint(text_of(values, "node")), "breakpoint set"),
    "unbreak": (lambda control, values: control.clear_breakpoint(text_of(values, "node")), "breakpoint cleared"),
    "press": (lambda control, values: control.press(text_of(values, "name")), "pressed"),
    "answer": (lambda control, values: control.answer(text_of(values, "id"), text_of(values, "text")), "answered"),
}


PROGRESS_PERIOD_S: Final = 0.15
SEND_LIMIT_S: Final = 0.2
_LOOK_AGAIN_S: Final = 0.5


class ProgressWatch(RunVisitor):
    """Visitor that sends the progress to the page, a few times a second."""

    def __init__(self, feed: Feed) -> None:
        self._feed = feed
        self._sent_s = 0.0

    def tick(self, progress: Progress) -> None:
        """Sends the progress if enough time has passed; waits at most SEND_LIMIT_S until the page has all messages."""
        now = time.perf_counter()
        if now - self._sent_s >= PROGRESS_PERIOD_S:
            self._sent_s = now
            self._feed.tell("progress", progress_json(progress))
        self._feed.wait_sent(SEND_LIMIT_S)


def progress_json(progress: Progress) -> Mapping[str, Any]:
    """Returns each robot's deepest running node, with message and progress (0 to 1), as JSON values."""
    robots = dict[str, Mapping[str, Any]]()
    for name, states in progress.states.items():
        running = [(path_id, state) for path_id, state in states.items() if state.status is Status.RUNNING]
        path_id, state = running[-1] if running else (None, NodeState())
        robots[name] = {"node": path_id, "message": state.message, "progress": state.progress}
    word = {"now_s": round(progress.now_s, 3), "ticks": progress.ticks, "overruns": progress.overruns}
    return {**word, "robots": robots}


class ControlWatch:
    """Thread that sends each new state of a control to the page, until the run ends or `close`."""

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
