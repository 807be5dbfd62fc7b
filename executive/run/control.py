"""Control of a run from outside: pause, step, cancel, stop button, breakpoints, other missions, questions.

From Python, with the run in one thread and its control in another:

    control = Control()
    threading.Thread(target=lambda: run([entry], control=control, ...)).start()
    control.pause("somebody walks by")        # the robot stands still at the next tick
    control.step()                            # until the next node changes its status
    control.resume()
    control.preempt(tree_of_another_mission)  # the present mission continues afterwards
    control.cancel("enough for today")
    control.pause("let me look at it", robot="Bob")  # one of several robots; the others continue

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
    MissionRequest,
    Mode,
    OpenQuestion,
    PendingRemark,
    RobotMode,
    Turn,
)
from executive.tree.compiler import CompiledTree
from skills.api import Asked, Question
from skills.inputs.errors import InputError
from skills.inputs.outside import LONGEST_ANSWER, plain_text
from skills.robot import Clock

_REASONS: Final = (Mode.STOPPED, Mode.LEASE_LOST, Mode.PAUSED)
"""Reasons not to move, the strongest first."""


def _locked(method: Callable[..., Any]) -> Callable[..., Any]:
    """Wraps a method so that no other thread changes the control during a call."""

    @functools.wraps(method)
    def locked(self: Control, *arguments: Any, **options: Any) -> Any:
        """Calls the method under the control's lock."""
        with self._changed:
            return method(self, *arguments, **options)

    return locked


def _for_any_thread(control: type[Control]) -> type[Control]:
    """Puts all public methods and properties of the class under its lock."""
    for name, member in [each for each in vars(control).items() if not each[0].startswith("_")]:
        is_property = isinstance(member, property)
        setattr(control, name, property(_locked(member.fget)) if is_property else _locked(member))
    return control


@_for_any_thread
class Control:
    """Controls one run from outside. With `attended`, an operator is there to answer questions.

    While a run is held, and while an attended run has an open question, simulated time passes at most `pace` times as
    fast as the wall clock (None: without a limit).
    """

    def __init__(self, *, attended: bool = False, pace: float | None = 1.0) -> None:
        self.attended = attended
        self.pace = pace
        self._changed = threading.Condition()
        self._questions: dict[str, PendingAnswer] = {}
        self._remarks: tuple[PendingRemark, ...] = ()
        self._version = 0
        self._begun = self._ended = False
        self._requests = self._lasting = ControlRequests()
        self._holds: dict[tuple[str | None, Mode], str] = {}  # reason why a robot, or all (None), stand still
        self._stride: int | None = None  # ticks left of a step; 0: until a node changes; None: no step
        self._at: str | None = None
        self._missions: dict[str, tuple[str, ...]] = {}
        self._known: frozenset[str] = frozenset()
        self._presses: Mapping[str, int] = {}
        self._buttons: tuple[str, ...] = ()

    @property
    def state(self) -> ControlState:
        """Present state of the control."""
        return ControlState(
            self._version,
            *(self._mode().mode, self._mode().reason, self._at),
            tuple(each.open for each in self._questions.values()),
            self._requests.breakpoints,
            dict(self._missions),
            self._buttons,
            {robot: self._mode(robot) for robot in self._missions},
        )

    def wait(self, version: int, timeout_s: float | None = None) -> ControlState:
        """Blocks until the state is newer than `version` or the timeout (wall clock) expires; returns the state."""
        self._changed.wait_for(lambda: self._version > version, timeout_s)
        return self.state

    def pause(self, reason: str = "paused by the operator", *, robot: str | None = None) -> None:
        """Pauses all robots, or one of them; the last reason counts. Raises ValueError for an unknown robot."""
        if robot is None:
            self._stride = None
        self._hold(robot, Mode.PAUSED, "pause", reason)

    @property
    def cancelled(self) -> bool:
        """Returns whether the run has been cancelled."""
        return self._requests.cancel is not None

    @property
    def pause_reason(self) -> str | None:
        """Reason why all robots are paused; None while they are not."""
        return self._holds.get((None, Mode.PAUSED))

    def resume(self, *, robot: str | None = None) -> None:
        """Ends a pause, a breakpoint or stepping, or one robot's own pause; a pressed stop button stays pressed."""
        if robot is None:
            self._at = self._stride = None
        self._end_hold(robot, Mode.PAUSED, "resume", "the mission goes on")

    def toggle_pause(self) -> None:
        """Pauses the run, or resumes it when it is paused."""
        if (None, Mode.PAUSED) not in self._holds:
            self.pause()
        else:
            self.resume()

    def step(self, ticks: int | None = None) -> None:
        """Runs until a node changes its status, or for the given number of ticks, and then pauses again.

        Skills in motion are suspended between steps, so a few ticks may be too short for any motion. Raises ValueError
        when `ticks` is below 1.
        """
        if ticks is not None and ticks < 1:
            raise ValueError(f"a step of {ticks} ticks: at least 1 is needed")
        self._holds.setdefault((None, Mode.PAUSED), "stepping")
        self._stride, self._at = ticks or 0, None
        self._note("step", "until a node changes" if ticks is None else f"for {ticks} ticks")

    def cancel(self, reason: str = "cancelled by the operator", *, robot: str | None = None) -> None:
        """Ends the run or one robot's mission, even if it is paused; the first of several reasons counts.

        A second call ends them at once, without the steps under `always`. Raises ValueError for an unknown robot.
        """
        if robot is not None:
            self._refuse_stranger(robot)
            self._holds.pop((robot, Mode.PAUSED), None)
            self._ask_for(cancels=(*self._requests.cancels, (robot, reason)))
            self._note("cancel", f"{robot}: {reason}")
        elif self._requests.cancel is None and not self._ended:
            self._holds = {held: why for held, why in self._holds.items() if held[1] is not Mode.PAUSED}
            self._stride = None
            self._ask_for(cancel=reason)
            self._note("cancel", reason)
        elif not self._requests.insists and not self._ended:
            self._ask_for(insists=True)
            self._note("cancel", f"once more: {reason}")

    def press(self, button: str) -> None:
        """Presses a button. Raises ValueError when no mission of the run waits for it or uses it in a condition."""
        if self._begun and button not in self._buttons:
            known = f"there are: {', '.join(self._buttons)}" if self._buttons else "there are none"
            raise ValueError(f"the run has no button '{button}'; {known}")
        self._presses = {**self._presses, button: self._presses.get(button, 0) + 1}
        self._note("button", button)

    @property
    def presses(self) -> Mapping[str, int]:
        """Number of presses of each button."""
        return self._presses

    def stop_button(self, reason: str = "the stop button is pressed", *, robot: str | None = None) -> None:
        """Stops all robots, or one, until `release_stop_button`, whatever else is requested.

        Raises ValueError when the run has no such robot.
        """
        self._hold(robot, Mode.STOPPED, "stop button", reason)

    def release_stop_button(self, *, robot: str | None = None) -> None:
        """Releases the stop button of all robots or of one robot; an earlier pause remains."""
        self._end_hold(robot, Mode.STOPPED, "stop button released", "the stop button is released")

    def stop_pressed(self, robot: str) -> str | None:
        """Reason why the stop button is pressed for a robot; None when it is released."""
        return self._holds.get((None, Mode.STOPPED)) or self._holds.get((robot, Mode.STOPPED))

    def set_breakpoint(self, path_id: str) -> None:
        """Pauses the run whenever the node is about to begin. Raises ValueError when the run has no such node."""
        self._refuse_unknown(path_id)
        self._ask_for(breakpoints=self._requests.breakpoints | {path_id})
        self._note("breakpoint set", path_id)

    def clear_breakpoint(self, path_id: str) -> None:
        """Removes a breakpoint; does nothing when there is none."""
        if path_id in self._requests.breakpoints:
            self._ask_for(breakpoints=self._requests.breakpoints - {path_id})
            self._note("breakpoint cleared", path_id)

    def preempt(self, tree: CompiledTree) -> None:
        """Begins a mission at once; the present mission is suspended and continues afterwards.

        Raises ValueError when the run has no such robot, or when the mission is already under way or requested.
        """
        self._request(MissionRequest(tree, Turn.FIRST), "preempt", f"first '{tree.mission_name}'")

    def then(self, tree: CompiledTree) -> None:
        """Appends a mission after the mission that the robot began with. Raises ValueError like `preempt`."""
        self._request(MissionRequest(tree, Turn.LATER), "then", f"afterwards '{tree.mission_name}'")

    def replace(self, tree: CompiledTree, instead_of: str | None = None) -> None:
        """Ends the present mission, or the mission `instead_of`, and begins another mission in its place.

        A mission `instead_of` that still waits never begins; one that is suspended or has ended remains so, and the
        other mission begins as with `preempt`. Raises ValueError when the run has no such robot.
        """
        self._request(MissionRequest(tree, Turn.INSTEAD, instead_of), "replace", f"instead '{tree.mission_name}'")

    def answer(self, question_id: str, text: str, *, spoken: bool = False) -> None:
        """Answers an open question. Raises ValueError when it is not open, or `text` is none of the choices.

        Words `spoken` to the robot reach it in any case; it asks again if it does not understand them.
        """
        pending = self._questions.get(question_id)
        if pending is None:
            raise ValueError(f"the question '{question_id[:80]}' is not open")
        try:
            said = plain_text(text, what="the answer", longest=LONGEST_ANSWER)
        except InputError as error:
            raise ValueError(str(error)) from error
        options = pending.open.options
        said = next((option for option in options if option.lower() == said.strip().lower()), said)
        if options and said not in options and not spoken:
            raise ValueError(f"'{said}' is no answer to '{question_id}'; choose one of: {', '.join(options)}")
        self._close_question(pending, said, "answer", text)

    def begin(self, missions: Mapping[str, CompiledTree]) -> None:
        """Records that the run begins. Raises ValueError for a breakpoint at an unknown node, and for a second run."""
        if self._begun:
            raise ValueError("a Control controls one run only; make another")
        self._begun = True
        for robot_name, tree in missions.items():
            self.mission_begun(robot_name, tree)
        for path_id in self._requests.breakpoints:
            self._refuse_unknown(path_id)

    def mission_begun(self, robot_name: str, tree: CompiledTree) -> None:
        """Records that a robot begins a mission, which interrupts the robot's other missions. Idempotent."""
        before = self._missions.get(robot_name, ())
        if before[-1:] == (tree.mission_name,):
            return
        self._known |= frozenset(tree.path_ids)
        self._buttons = tuple(dict.fromkeys((*self._buttons, *tree.buttons)))
        self._missions[robot_name] = (*before, tree.mission_name)
        self._bump()

    def mission_ended(self, robot_name: str) -> None:
        """Records that a robot's present mission has ended."""
        self._missions[robot_name] = self._missions.get(robot_name, ())[:-1]
        self._bump()

    def poll(self) -> ControlRequests:
        """Returns the present requests; each new mission and each event is returned only once."""
        if self._requests is self._lasting and not self._holds:
            return self._requests
        paused = None if self._stride is not None else self._holds.get((None, Mode.PAUSED))
        hold = self._holds.get((None, Mode.STOPPED), paused)
        holds = {robot: why for (robot, mode), why in self._holds.items() if robot and mode is not Mode.LEASE_LOST}
        requests = replace(self._requests, hold=hold, holds=holds)
        self._lasting = ControlRequests(requests.cancel, requests.insists, breakpoints=requests.breakpoints)
        self._requests = self._lasting
        return requests

    def note_tick(self, *, changed: bool) -> None:
        """Records a tick of the trees, and ends a step that is complete; with `changed`, a node changed its status."""
        if self._stride is None or (self._stride == 0 and not changed):
            return
        self._stride = self._stride - 1 if self._stride > 1 else None
        if self._stride is None:
            self._bump()

    def stop_at_breakpoint(self, path_id: str) -> None:
        """Pauses a run that has reached a breakpoint."""
        self._holds[None, Mode.PAUSED] = why = f"at the breakpoint {path_id}"
        self._at, self._stride = path_id, None
        self._note("breakpoint", why)

    def note_lease(self, robot_name: str, why: str | None) -> None:
        """Records that a robot has lost its lease, with the reason `why`, or that it has the lease again (None)."""
        self._holds.pop((robot_name, Mode.LEASE_LOST), None)
        if why is not None:
            self._holds[robot_name, Mode.LEASE_LOST] = why
        self._note("lease lost" if why else "lease back", why or f"{robot_name} has its lease again")

    def ask(self, question: Question, clock: Clock, robot: str = "") -> Asked:
        """Asks the operator a robot's question. Raises ValueError when a question of that id is open already."""
        if question.id in self._questions:
            raise ValueError(f"the question '{question.id}' is open already")
        opened = OpenQuestion(question, clock.now() + question.limit_s, robot)
        self._questions[question.id] = asked = PendingAnswer(opened, clock, self._take_default)
        self._note("question", f"{question.id}: {question.text}")
        return asked

    def listen(self, robot: str = "") -> PendingRemark:
        """Waits for a remark that ends a skill of the robot."""
        remark = PendingRemark(robot)
        self._remarks = (*(each for each in self._remarks if each.waits), remark)
        return remark

    def tell(self, text: str, *, robot: str | None = None) -> bool:
        """Passes a person's remark to the waiting skills of one robot, or of all robots.

        Returns whether a skill was waiting; each skill hears one remark and then stops waiting.
        """
        heard = [each for each in self._remarks if each.waits and robot in (None, each.robot)]
        for each in heard:
            each.text, each.waits = text, False
        if heard:
            self._note("told", text)
        return bool(heard)

    def _take_default(self, pending: PendingAnswer, why: str) -> None:
        """Answers a question by its default, and records the reason. May be called from any thread."""
        with self._changed:
            if pending.answer is None:
                self._close_question(pending, pending.open.question.default, "question closed", why)

    def _close_question(self, pending: PendingAnswer, answer: str, what: str, message: str) -> None:
        pending.answer = answer
        self._questions.pop(pending.open.id, None)
        self._note(what, f"{pending.open.id}: {message}")

    def extend_questions(self, duration_s: float) -> None:
        """Extends the time limit of all questions by the time (s, robot's clock) for which the run was held."""
        for pending in self._questions.values():
            pending.open = replace(pending.open, until_s=pending.open.until_s + duration_s)

    def rest(self, duration_s: float) -> None:
        """Waits on the wall clock for a time (s); returns earlier when somebody makes a request."""
        seen = self._version
        self._changed.wait_for(lambda: self._version > seen, duration_s)

    @property
    def slow(self) -> bool:
        """Returns whether simulated time is limited to `pace`, because the run is held or an operator has to answer."""
        held = self._mode().mode is not Mode.RUNNING or bool(self._holds)
        return held or (self.attended and bool(self._questions))

    def end(self) -> tuple[Event, ...]:
        """Records that the run has ended; returns the events that `poll` has not returned yet."""
        self._ended = True
        self._questions.clear()
        events = self._requests.events
        self._ask_for(events=())
        self._bump()
        return events

    def _mode(self, robot: str | None = None) -> RobotMode:
        """Mode of a robot, or of the whole run, from the strongest reason not to move."""
        if self._ended:
            return RobotMode(Mode.ENDED, self._requests.cancel or "")
        for mode in _REASONS:
            whose = (None, robot) if robot or mode is not Mode.LEASE_LOST else (None, *self._missions)
            for who in whose:
                if (who, mode) in self._holds:
                    steps = mode is Mode.PAUSED and who is None and self._stride is not None
                    return RobotMode(Mode.STEPPING if steps else mode, self._holds[who, mode])
        ready = not self._begun or (robot is not None and not self._missions[robot])
        return RobotMode(Mode.READY if ready else Mode.RUNNING)

    def _hold(self, robot: str | None, mode: Mode, what: str, reason: str) -> None:
        """Makes one robot or all robots stand still. Raises ValueError when the run has no such robot."""
        if robot is not None:
            self._refuse_stranger(robot)
        if self._holds.get((robot, mode)) != reason:
            self._holds[robot, mode] = reason
            self._note(what, reason if robot is None else f"{robot}: {reason}")

    def _end_hold(self, robot: str | None, mode: Mode, what: str, message: str) -> None:
        if self._holds.pop((robot, mode), None) is not None:
            self._note(what, message if robot is None else f"{robot}: {message}")

    def _refuse_stranger(self, robot: str) -> None:
        if self._begun and robot not in self._missions:
            raise ValueError(f"robot '{robot}' is not in this run; there are: {', '.join(self._missions)}")

    def _request(self, request: MissionRequest, what: str, message: str) -> None:
        """Adds a request for a mission. Raises ValueError like `preempt`, except that INSTEAD may repeat a mission."""
        robot, name = request.tree.robot_name, request.tree.mission_name
        self._refuse_stranger(robot)
        others = [each.tree for each in self._requests.missions if each.turn is not Turn.INSTEAD]
        waiting = [tree.mission_name for tree in others if tree.robot_name == robot]
        if request.turn is not Turn.INSTEAD and name in (*self._missions.get(robot, ()), *waiting):
            raise ValueError(f"the mission '{name}' is under way already")
        self._ask_for(missions=(*self._requests.missions, request))
        self._note(what, message)

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
    """Question that waits for its answer (`skills.api.Asked`); after the time limit, the default becomes the answer."""

    def __init__(self, opened: OpenQuestion, clock: Clock, take_default: Callable[[PendingAnswer, str], None]) -> None:
        self.open = opened
        self.answer: str | None = None
        self._clock, self._take_default = clock, take_default

    def done(self) -> bool:
        """Returns whether there is an answer; takes the default when the time limit has passed."""
        if self._clock.now() >= self.open.until_s - 1e-9:
            self._take_default(self, f"nobody answered in time, so '{self.open.question.default}'")
        return self.answer is not None

    def result(self) -> str:
        """Returns the answer. Raises RuntimeError before there is one."""
        if self.answer is None:
            raise RuntimeError(f"the question '{self.open.id}' is not answered yet")
        return self.answer

    def withdraw(self) -> None:
        """Withdraws the question."""
        self._take_default(self, "the robot no longer asks it")
