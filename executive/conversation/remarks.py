"""What remarks about the run do: they act at once, through its control."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Final

from executive.conversation.parts import OVER, Reply, Speech, answer, done, refused
from executive.conversation.status_words import doing_in_words, place_in_words
from executive.language.followups import Remark
from executive.language.grounding import known_line
from executive.run.control import Control, Mode, RobotMode
from executive.run.visitor import Progress

__all__ = ["RemarkAnswers"]

_TOLD_TO_STOP: Final = "told to stop"


class RemarkAnswers:
    """Stops, holds, goes on, cancels, and tells where the robot is and what it does. `progress` is the latest.

    In a run with several robots, only the one that is spoken to.
    """

    def __init__(self, speech: Speech, control: Control) -> None:
        self._speech, self._control = speech, control
        self.progress: Progress | None = None
        self._answers: Mapping[Remark, Callable[[], Reply]] = MappingProxyType(
            {
                Remark.STOP: self._stop,
                Remark.WAIT: self._wait,
                Remark.GO_ON: self._go_on,
                Remark.CANCEL: self._cancel,
                Remark.WHERE: self._where,
                Remark.DOING: lambda: answer(doing_in_words(self.progress, control.state, speech.robot_name)),
                Remark.ABLE: lambda: answer(known_line(speech.knowledge)),
                Remark.THANKS: lambda: answer("you are welcome"),
            }
        )

    def to(self, remark: Remark) -> Reply:
        """Do what a remark asks for."""
        acts = remark in (Remark.STOP, Remark.WAIT, Remark.GO_ON, Remark.CANCEL)
        if acts and self._control.state.mode is Mode.ENDED:
            return refused(OVER)
        return self._answers[remark]()

    def _stop(self) -> Reply:
        self._control.stop_button(_TOLD_TO_STOP, robot=self._one)
        return done("I stand still; say 'go on' when I may move again")

    def _wait(self) -> Reply:
        self._control.pause("told to wait", robot=self._one)
        return done("I wait; say 'go on' when I may go on")

    def _go_on(self) -> Reply:
        state, one = self._control.state, self._one
        now = RobotMode(state.mode, state.reason) if one is None else state.robots[one]
        if now.mode is Mode.STOPPED and now.reason != _TOLD_TO_STOP:
            return refused(f"{now.reason}; release it where it was pressed")
        held = now.mode in (Mode.STOPPED, Mode.PAUSED)
        self._control.release_stop_button(robot=one)
        self._control.resume(robot=one)
        if one is not None and (still := self._control.state.robots[one]).mode in (Mode.STOPPED, Mode.PAUSED):
            return refused(f"{still.reason}, as all robots are; say so to all of them")
        return done("I go on" if held else "I am under way")

    def _cancel(self) -> Reply:
        self._control.cancel("told to cancel", robot=self._one)
        return done("I give it up and stop")

    @property
    def _one(self) -> str | None:
        """The robot, where there are several; None: all that there are."""
        return self._speech.robot_name if len(self._control.state.missions) > 1 else None

    def _where(self) -> Reply:
        status = None if self.progress is None else self.progress.robots.get(self._speech.robot_name)
        if status is None:
            return answer("I do not know yet; the run has not begun")
        return answer(place_in_words(status.pose, self._speech.knowledge))
