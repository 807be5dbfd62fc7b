"""Actions of the page's buttons, by name, on the control of the run."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any, Final

from executive.conversation.parts import Waiting
from executive.run.control import Control
from executive.run.control_state import ControlState
from skills.files.errors import InputError
from skills.files.texts import plain_text

Action = Callable[[Mapping[str, Any]], str]


class RefusedError(Exception):
    """An action cannot be done; the text says why and what to do."""


def control_actions(control: Control) -> Mapping[str, Action]:
    """The actions of a run by name. Each takes the page's values and returns a sentence, or raises RefusedError."""

    def bound(call: Callable[[Control, Mapping[str, Any]], None], said: str) -> Action:
        """An action that calls the control and returns the sentence `said`."""

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
    """A text among an action's values. Raises RefusedError if it is missing, empty, too long or no plain text."""
    text = values.get(key)
    if not isinstance(text, str) or not text.strip():
        raise RefusedError(f"the action needs a text under '{key}'")
    try:
        return plain_text(text, what="the text")
    except InputError as error:
        raise RefusedError(str(error)) from error


def robot_of(values: Mapping[str, Any]) -> str | None:
    """Name of the robot that an action is for; None for all robots."""
    robot = values.get("robot")
    return robot if isinstance(robot, str) and robot else None


def control_json(state: ControlState) -> dict[str, Any]:
    """State of a run's control as JSON values for the page."""
    return {
        "mode": state.mode.value,
        "reason": state.reason,
        "at": state.at,
        "buttons": list(state.buttons),
        "breakpoints": sorted(state.breakpoints),
        "missions": {robot: list(names) for robot, names in state.missions.items()},
        "questions": [
            {
                "id": each.id,
                "text": each.question.text,
                "options": list(each.options),
                "default": each.question.default,
                "until_s": each.until_s,
                "robot": each.robot,
            }
            for each in state.questions
        ],
        "robots": {name: {"mode": each.mode.value, "reason": each.reason} for name, each in state.robots.items()},
    }


def asked_json(waiting: Waiting | None, robot: str = "") -> dict[str, Any]:
    """The question that a robot asks back as JSON values for the page; null if none waits."""
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
