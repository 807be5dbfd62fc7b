"""Control of a run from outside: pause, step, cancel, stop button, breakpoints, other missions, questions.

From Python, with the run in one thread and its control in another:

    control = Control()
    threading.Thread(target=lambda: run([entry], control=control, ...)).start()
    control.pause("somebody walks by")        # the robot stands still at the next tick
    control.step()                            # until the next node changes its status
    control.resume()
    control.preempt(tree_of_another_mission)  # the present one is taken up again afterwards
    control.cancel("enough for today")
    control.pause("let me look at it", robot="Bob")  # one of several robots; the others go on

All methods may be called from any thread and from signal handlers. They return at once; the run polls at each tick.
"""

from __future__ import annotations

import difflib
import functools
import threading
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, Final

from executive.run.control_state import (
    ControlRequests,
    ControlState,
    Event,
    Mode,
    OpenQuestion,
    Replacement,
    RobotMode,
)
from executive.tree.compiler import CompiledTree
from skills.api import Asked, Question
from skills.files.errors import InputError
from skills.files.outside import LONGEST_ANSWER, plain_text
from skills.robot import Clock

_REASONS: Final = (Mode.STOPPED, Mode.LEASE_LOST, Mode.PAUSED)
"""The reasons not to move, the strongest first."""


def _locked(method: Callable[..., Any]) -> Callable[..., Any]:
    """The method, called while no other thread changes the control."""

    @functools.wraps(method)
    def locked(self: Control, *arguments: Any, **options: Any) -> Any:
        """The method under the control's lock."""
        with self._changed:
            return method(self, *arguments, **options)

    return locked


def _for_any_thread(control: type[Control]) -> type[Control]:
    """The class, each of whose public methods and properties holds its lock."""
    for name, member in [each for each in vars(control).items() if not each[0].startswith("_")]:
        is_property = isinstance(member, property)
        setattr(control, name, property(_locked(member.fget)) if is_property else _locked(member))
    return control


@_for_any_thread
class Control:
    """The control of one run. `attended` says that somebody is there to answer questions.

    While a run is held, and while an attended one asks, simulated time passes `pace` times as fast as the wall's at
    most (None: as fast as can be).
    """

    def __init__(self, *, attended: bool = False, pace: float | None = 1.0) -> None:
        self.attended = attended
        self.pace = pace
        self._changed = threading.Condition()
        self._questions: dict[str, PendingAnswer] = {}
        self._version = 0
        self._begun = self._ended = False
        self._requests = self._lasting = ControlRequests()
        self._holds: dict[tuple[str | None, Mode], str] = {}  # why a robot, or all of them (None), stand still
        self._stride: int | None = None  # ticks to go while paused; 0: until a node changes; None: none
        self._at: str | None = None
        self._missions: dict[str, tuple[str, ...]] = {}
        self._known: frozenset[str] = frozenset()
        self._presses: Mapping[str, int] = {}
        self._buttons: tuple[str, ...] = ()

    @property
    def state(self) -> ControlState:
        """The present state."""
        present = self._mode()
        return ControlState(
            self._version,
            present.mode,
            present.reason,
            self._at,
            tuple(each.open for each in self._questions.values()),
            self._requests.breakpoints,
            dict(self._missions),
            self._buttons,
            {robot: self._mode(robot) for robot in self._missions},
        )

    def wait(self, version: int, timeout_s: float | None = None) -> ControlState:
        """Block (on the wall's clock) until the state is newer than `version`, or time is over; the state then."""
        self._changed.wait_for(lambda: self._version > version, timeout_s)
        return self.state

    def pause(self, reason: str = "paused by the operator", *, robot: str | None = None) -> None:
        """Holds all robots still, or one of them; the trees keep their state. Idempotent.

        Raises ValueError: no such robot in the run.
        """
        if robot is None:
            self._stride = None
        self._hold(robot, Mode.PAUSED, "pause", reason)

    def resume(self, *, robot: str | None = None) -> None:
        """Continues after a pause, a breakpoint or steps, or after one robot's own pause; the stop button stays."""
        if robot is None:
            self._at = self._stride = None
        self._let_go(robot, Mode.PAUSED, "resume", "the mission goes on")

    def toggle_pause(self) -> None:
        """Pause, or resume when paused."""
        if (None, Mode.PAUSED) not in self._holds:
            self.pause()
        else:
            self.resume()

    def step(self, ticks: int | None = None) -> None:
        """Goes on until a node changes its status, or for some ticks, and pauses again.

        Skills in motion are suspended between steps, so that few ticks may not suffice for a motion to get anywhere.
        Raises ValueError: ticks below 1.
        """
        if ticks is not None and ticks < 1:
            raise ValueError(f"a step of {ticks} ticks: at least 1 is needed")
        self._holds.setdefault((None, Mode.PAUSED), "stepping")
        self._stride, self._at = ticks or 0, None
        self._note("step", "until a node changes" if ticks is None else f"for {ticks} ticks")

    def cancel(self, reason: str = "cancelled by the operator", *, robot: str | None = None) -> None:
        """End the run, or one robot's mission; the first reason stays. Once more: at once, without what missions always
        do in the end. Raises ValueError: no such robot in the run.
        """
        if robot is not None:
            self._refuse_stranger(robot)
            self._ask_for(cancels=(*self._requests.cancels, (robot, reason)))
            self._note("cancel", f"{robot}: {reason}")
        elif self._requests.cancel is None and not self._ended:
            self._ask_for(cancel=reason)
            self._note("cancel", reason)
        elif not self._requests.insists and not self._ended:
            self._ask_for(insists=True)
            self._note("cancel", f"once more: {reason}")

    def press(self, button: str) -> None:
        """Presses a button that missions wait for or decides by. Raises ValueError: no mission of the run has it."""
        if self._begun and button not in self._buttons:
            known = f"there are: {', '.join(self._buttons)}" if self._buttons else "there are none"
            raise ValueError(f"the run has no button '{button}'; {known}")
        self._presses = {**self._presses, button: self._presses.get(button, 0) + 1}
        self._note("button", button)

    @property
    def presses(self) -> Mapping[str, int]:
        """How often each button was pressed."""
        return self._presses

    def stop_button(self, reason: str = "the stop button is pressed", *, robot: str | None = None) -> None:
        """Stops all robots, or one, until `release_stop_button`, whatever else is asked for.

        Raises ValueError: no such robot in the run.
        """
        self._hold(robot, Mode.STOPPED, "stop button", reason)

    def release_stop_button(self, *, robot: str | None = None) -> None:
        """Continues as it was when the button was pressed, for all robots or for one."""
        self._let_go(robot, Mode.STOPPED, "stop button released", "the stop button is released")

    def stop_pressed(self, robot: str) -> str | None:
        """Why the stop button is pressed for a robot; None when it is not."""
        return self._holds.get((None, Mode.STOPPED)) or self._holds.get((robot, Mode.STOPPED))

    def set_breakpoint(self, path_id: str) -> None:
        """Pause before the node begins, each time. Raises ValueError for a node that the run does not have."""
        self._refuse_unknown(path_id)
        self._ask_for(breakpoints=self._requests.breakpoints | {path_id})
        self._note("breakpoint set", path_id)

    def clear_breakpoint(self, path_id: str) -> None:
        """Removes a breakpoint; does nothing when there is none."""
        if path_id in self._requests.breakpoints:
            self._ask_for(breakpoints=self._requests.breakpoints - {path_id})
            self._note("breakpoint cleared", path_id)

    def preempt(self, tree: CompiledTree) -> None:
        """Does another mission first; the one under way is suspended and taken up again afterwards.

        Raises ValueError: no such robot in the run, or the mission is under way already.
        """
        self._refuse_mission(tree)
        self._ask_for(preempts=(*self._requests.preempts, tree))
        self._note("preempt", f"first '{tree.mission_name}'")

    def then(self, tree: CompiledTree) -> None:
        """Does another mission when the one that the robot began with is done. Raises ValueError as `preempt`."""
        self._refuse_mission(tree)
        self._ask_for(later=(*self._requests.later, tree))
        self._note("then", f"afterwards '{tree.mission_name}'")

    def replace(self, tree: CompiledTree, instead_of: str | None = None) -> None:
        """Does another mission instead of the one under way, which is given up.

        With `instead_of` it takes the place of the mission of that name: one that waits is not begun, and one that is
        not under way just now is left alone, as by `preempt`. Raises ValueError: no such robot in the run.
        """
        self._refuse_stranger(tree.robot_name)
        self._ask_for(instead=(*self._requests.instead, Replacement(tree, instead_of)))
        self._note("replace", f"instead '{tree.mission_name}'")

    def answer(self, question_id: str, text: str) -> None:
        """Answers an open question. Raises ValueError when it is not open or `text` is none of its options."""
        pending = self._questions.get(question_id)
        if pending is None:
            raise ValueError(f"the question '{question_id[:80]}' is not open (any more)")
        try:
            said = plain_text(text, what="the answer", longest=LONGEST_ANSWER)
        except InputError as error:
            raise ValueError(str(error)) from error
        options = pending.open.options
        said = next((option for option in options if option.lower() == said.strip().lower()), said)
        if options and said not in options:
            raise ValueError(f"'{said}' is no answer to '{question_id}'; choose one of: {', '.join(options)}")
        self._close_question(pending, said, "answer", text)

    def begin(self, missions: Mapping[str, CompiledTree]) -> None:
        """The run begins. Raises ValueError for a breakpoint at a node that it does not have, or at a second run."""
        if self._begun:
            raise ValueError("a Control controls one run only; make another")
        self._begun = True
        for robot_name, tree in missions.items():
            self.mission_begun(robot_name, tree)
        for path_id in self._requests.breakpoints:
            self._refuse_unknown(path_id)

    def mission_begun(self, robot_name: str, tree: CompiledTree) -> None:
        """A mission begins, on top of those that a robot has begun. Idempotent."""
        before = self._missions.get(robot_name, ())
        if before[-1:] == (tree.mission_name,):
            return
        self._known |= frozenset(tree.path_ids)
        self._buttons = tuple(dict.fromkeys((*self._buttons, *tree.buttons)))
        self._missions[robot_name] = (*before, tree.mission_name)
        self._bump()

    def mission_ended(self, robot_name: str) -> None:
        """A robot's topmost mission is over."""
        self._missions[robot_name] = self._missions.get(robot_name, ())[:-1]
        self._bump()

    def poll(self) -> ControlRequests:
        """What is asked for now; new missions and events are handed out once."""
        if self._requests is self._lasting and not self._holds:
            return self._requests
        paused = None if self._stride is not None else self._holds.get((None, Mode.PAUSED))
        hold = self._holds.get((None, Mode.STOPPED), paused)
        holds = {robot: why for (robot, mode), why in self._holds.items() if robot and mode is not Mode.LEASE_LOST}
        requests = replace(self._requests, hold=hold, holds=holds)
        self._lasting = ControlRequests(requests.cancel, requests.insists, breakpoints=requests.breakpoints)
        self._requests = self._lasting
        return requests

    def ticked(self, *, changed: bool) -> None:
        """The trees were ticked; `changed` says whether a node changed its status. Ends a step that is done."""
        if self._stride is None or (self._stride == 0 and not changed):
            return
        self._stride = self._stride - 1 if self._stride > 1 else None
        if self._stride is None:
            self._bump()

    def arrived_at(self, path_id: str) -> None:
        """The run stands at a breakpoint."""
        self._holds[None, Mode.PAUSED] = why = f"at the breakpoint {path_id}"
        self._at, self._stride = path_id, None
        self._note("breakpoint", why)

    def lease_lost(self, robot_name: str, why: str | None) -> None:
        """A robot's lease was lost (why), or is there again (None)."""
        self._holds.pop((robot_name, Mode.LEASE_LOST), None)
        if why is not None:
            self._holds[robot_name, Mode.LEASE_LOST] = why
        self._note("lease lost" if why else "lease back", why or f"{robot_name} has its lease again")

    def ask(self, question: Question, clock: Clock, robot: str = "") -> Asked:
        """Puts a robot's question to the operator. Raises ValueError when one of that id is open already."""
        if question.id in self._questions:
            raise ValueError(f"the question '{question.id}' is open already")
        opened = OpenQuestion(question, clock.now() + question.limit_s, robot)
        self._questions[question.id] = asked = PendingAnswer(opened, clock, self._take_default)
        self._note("question", f"{question.id}: {question.text}")
        return asked

    def _take_default(self, pending: PendingAnswer, why: str) -> None:
        """Nobody answers a question, for a reason: its default is the answer. From any thread."""
        with self._changed:
            if pending.answer is None:
                self._close_question(pending, pending.open.question.default, "question over", why)

    def _close_question(self, pending: PendingAnswer, answer: str, what: str, message: str) -> None:
        pending.answer = answer
        self._questions.pop(pending.open.id, None)
        self._note(what, f"{pending.open.id}: {message}")

    def held(self, duration_s: float) -> None:
        """The run was held so long (robot's clock); that does not count against the time of questions."""
        for pending in self._questions.values():
            pending.open = replace(pending.open, until_s=pending.open.until_s + duration_s)

    def rest(self, duration_s: float) -> None:
        """Lets the wall's clock run on, less long when something is asked for meanwhile."""
        seen = self._version
        self._changed.wait_for(lambda: self._version > seen, duration_s)

    @property
    def slow(self) -> bool:
        """True while simulated time should not run ahead of the people who watch."""
        held = self._mode().mode is not Mode.RUNNING or bool(self._holds)
        return held or (self.attended and bool(self._questions))

    def end(self) -> tuple[Event, ...]:
        """The run is over; the events that were not handed out yet."""
        self._ended = True
        self._questions.clear()
        events = self._requests.events
        self._ask_for(events=())
        self._bump()
        return events

    def _mode(self, robot: str | None = None) -> RobotMode:
        """What a robot does, or the whole run: the strongest reason not to move counts, its own or that of all."""
        if self._ended:
            return RobotMode(Mode.ENDED, self._requests.cancel or "")
        for mode in _REASONS:
            whose = (None, robot) if robot or mode is not Mode.LEASE_LOST else (None, *self._missions)
            for who in whose:
                if (who, mode) in self._holds:
                    return RobotMode(mode, self._holds[who, mode])
        ready = not self._begun or (robot is not None and not self._missions[robot])
        return RobotMode(Mode.READY if ready else Mode.RUNNING)

    def _hold(self, robot: str | None, mode: Mode, what: str, reason: str) -> None:
        """Has a robot, or all, stands still. Raises ValueError: no such robot in the run."""
        if robot is not None:
            self._refuse_stranger(robot)
        if (robot, mode) not in self._holds:
            self._holds[robot, mode] = reason
            self._note(what, reason if robot is None else f"{robot}: {reason}")

    def _let_go(self, robot: str | None, mode: Mode, what: str, message: str) -> None:
        if self._holds.pop((robot, mode), None) is not None:
            self._note(what, message if robot is None else f"{robot}: {message}")

    def _refuse_stranger(self, robot: str) -> None:
        if self._begun and robot not in self._missions:
            raise ValueError(f"robot '{robot}' is not in this run; there are: {', '.join(self._missions)}")

    def _refuse_mission(self, tree: CompiledTree) -> None:
        self._refuse_stranger(tree.robot_name)
        others = (*self._requests.preempts, *self._requests.later)
        waiting = [other.mission_name for other in others if other.robot_name == tree.robot_name]
        if tree.mission_name in (*self._missions.get(tree.robot_name, ()), *waiting):
            raise ValueError(f"the mission '{tree.mission_name}' is under way already")

    def _ask_for(self, **requests: Any) -> None:
        self._requests = replace(self._requests, **requests)

    def _note(self, what: str, message: str) -> None:
        self._ask_for(events=(*self._requests.events, Event(what, message)))
        self._bump()

    def _bump(self) -> None:
        self._version += 1
        self._changed.notify_all()

    def _refuse_unknown(self, path_id: str) -> None:
        if self._begun and path_id not in self._known:
            near = difflib.get_close_matches(path_id, self._known, n=1)
            hint = f"; did you mean '{near[0]}'?" if near else ""
            raise ValueError(f"the run has no node '{path_id}'{hint}")


class PendingAnswer:
    """A `skills.api.Asked`: done when answered or when its time is over, which makes the default the answer."""

    def __init__(self, opened: OpenQuestion, clock: Clock, take_default: Callable[[PendingAnswer, str], None]) -> None:
        self.open = opened
        self.answer: str | None = None
        self._clock, self._take_default = clock, take_default

    def done(self) -> bool:
        """True when answered; the default is taken when the time is over."""
        if self._clock.now() >= self.open.until_s - 1e-9:
            self._take_default(self, f"nobody answered in time, so '{self.open.question.default}'")
        return self.answer is not None

    def result(self) -> str:
        """The answer. Raises RuntimeError before there is one."""
        if self.answer is None:
            raise RuntimeError(f"the question '{self.open.id}' is not answered yet")
        return self.answer

    def withdraw(self) -> None:
        """Takes the question back."""
        self._take_default(self, "taken back")
