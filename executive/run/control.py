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
from collections.abc import Callable, Collection, Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import Any, Concatenate, ParamSpec, TypeVar

from executive.run.control_state import ControlRequests, ControlState, Event, Mode, Replacement, RobotMode
from executive.run.questions import QuestionManager
from executive.tree.compiler import CompiledTree
from skills.api import Asked, Question
from skills.robot import Clock

__all__ = ["Control", "ControlRequests", "ControlState", "Event", "Mode", "Replacement", "RobotMode"]

P = ParamSpec("P")
ResultT = TypeVar("ResultT")


def _locked(method: Callable[Concatenate[Control, P], ResultT]) -> Callable[Concatenate[Control, P], ResultT]:
    """The method, called while no other thread changes the control."""

    @functools.wraps(method)
    def locked(self: Control, /, *arguments: P.args, **options: P.kwargs) -> ResultT:
        """The method under the control's lock."""
        with self._changed:
            return method(self, *arguments, **options)

    return locked


class Control:
    """The control of one run. `attended` says that somebody is there to answer questions.

    While a run is held, and while an attended one asks, simulated time passes `pace` times as fast as the wall's at
    most (None: as fast as can be).
    """

    def __init__(self, *, attended: bool = False, pace: float | None = 1.0) -> None:
        self.attended = attended
        self.pace = pace
        self._changed = threading.Condition()
        self._questions = QuestionManager()
        self._version = 0
        self._begun = self._ended = False
        self._requests = self._lasting = ControlRequests()
        self._pressed: str | None = None
        self._holds: Mapping[tuple[str, Mode], str] = MappingProxyType({})  # of single robots
        self._paused: str | None = None
        self._stride: int | None = None  # ticks to go while paused; 0: until a node changes; None: none
        self._at: str | None = None
        self._lost: Mapping[str, str] = MappingProxyType({})
        self._missions: Mapping[str, tuple[str, ...]] = MappingProxyType({})
        self._known: frozenset[str] = frozenset()
        self._presses: Mapping[str, int] = MappingProxyType({})
        self._buttons: tuple[str, ...] = ()

    @property
    @_locked
    def state(self) -> ControlState:
        """The present state."""
        (mode, reason), asked = self._mode(), self._requests
        return ControlState(
            self._version,
            mode,
            reason,
            self._at,
            self._questions.open,
            asked.breakpoints,
            self._missions,
            self._buttons,
            MappingProxyType({robot: self._robot_mode(robot) for robot in self._missions}),
        )

    @_locked
    def wait(self, version: int, timeout_s: float | None = None) -> ControlState:
        """Block (on the wall's clock) until the state is newer than `version`, or time is over; the state then."""
        self._changed.wait_for(lambda: self._version > version, timeout_s)
        return self.state

    @_locked
    def pause(self, reason: str = "paused by the operator", *, robot: str | None = None) -> None:
        """Hold all robots still, or one of them; the trees keep their state. Idempotent.

        Raises ValueError: no such robot in the run.
        """
        if robot is not None:
            self._hold(robot, Mode.PAUSED, "pause", reason)
            return
        self._stride = None
        if self._paused is None:
            self._paused = reason
            self._note("pause", reason)

    @_locked
    def resume(self, *, robot: str | None = None) -> None:
        """Continue after a pause, a breakpoint or steps, or after one robot's own pause; the stop button stays."""
        if robot is not None:
            self._let_go(robot, Mode.PAUSED, "resume", "the mission goes on")
        elif self._paused is not None:
            self._paused = self._at = self._stride = None
            self._note("resume", "the mission goes on")

    @_locked
    def toggle_pause(self) -> None:
        """Pause, or resume when paused."""
        if self._paused is None:
            self.pause()
        else:
            self.resume()

    @_locked
    def step(self, ticks: int | None = None) -> None:
        """Go on until a node changes its status, or for some ticks, and pause again.

        Skills in motion are suspended between steps, so that few ticks may not suffice for a motion to get anywhere.
        Raises ValueError: ticks below 1.
        """
        if ticks is not None and ticks < 1:
            raise ValueError(f"a step of {ticks} ticks: at least 1 is needed")
        self._paused = self._paused or "stepping"
        self._stride, self._at = ticks or 0, None
        self._note("step", "until a node changes" if ticks is None else f"for {ticks} ticks")

    @_locked
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

    @_locked
    def press(self, button: str) -> None:
        """Press a button that missions wait for or decide by. Raises ValueError: no mission of the run has it."""
        if self._begun and button not in self._buttons:
            known = f"there are: {', '.join(self._buttons)}" if self._buttons else "there are none"
            raise ValueError(f"the run has no button '{button}'; {known}")
        self._presses = MappingProxyType({**self._presses, button: self._presses.get(button, 0) + 1})
        self._note("button", button)

    @property
    @_locked
    def presses(self) -> Mapping[str, int]:
        """How often each button was pressed."""
        return self._presses

    @_locked
    def stop_button(self, reason: str = "the stop button is pressed", *, robot: str | None = None) -> None:
        """Stop all robots, or one, until `release_stop_button`, whatever else is asked for.

        Raises ValueError: no such robot in the run.
        """
        if robot is not None:
            self._hold(robot, Mode.STOPPED, "stop button", reason)
        elif self._pressed is None:
            self._pressed = reason
            self._note("stop button", reason)

    @_locked
    def release_stop_button(self, *, robot: str | None = None) -> None:
        """Continue as it was when the button was pressed, for all robots or for one."""
        if robot is not None:
            self._let_go(robot, Mode.STOPPED, "stop button released", "the stop button is released")
        elif self._pressed is not None:
            self._pressed = None
            self._note("stop button released", "the stop button is released")

    @_locked
    def stop_pressed(self, robot: str) -> str | None:
        """Why the stop button is pressed for a robot; None when it is not."""
        return self._pressed or self._holds.get((robot, Mode.STOPPED))

    @_locked
    def set_breakpoint(self, path_id: str) -> None:
        """Pause before the node begins, each time. Raises ValueError for a node that the run does not have."""
        self._refuse_unknown(path_id)
        self._ask_for(breakpoints=self._requests.breakpoints | {path_id})
        self._note("breakpoint set", path_id)

    @_locked
    def clear_breakpoint(self, path_id: str) -> None:
        """Remove a breakpoint; does nothing when there is none."""
        if path_id in self._requests.breakpoints:
            self._ask_for(breakpoints=self._requests.breakpoints - {path_id})
            self._note("breakpoint cleared", path_id)

    @_locked
    def preempt(self, tree: CompiledTree) -> None:
        """Do another mission first; the one under way is suspended and taken up again afterwards.

        Raises ValueError: no such robot in the run, or the mission is under way already.
        """
        self._refuse_mission(tree)
        self._ask_for(preempts=(*self._requests.preempts, tree))
        self._note("preempt", f"first '{tree.mission_name}'")

    @_locked
    def then(self, tree: CompiledTree) -> None:
        """Do another mission when the one that the robot began with is done. Raises ValueError as `preempt`."""
        self._refuse_mission(tree)
        self._ask_for(later=(*self._requests.later, tree))
        self._note("then", f"afterwards '{tree.mission_name}'")

    @_locked
    def replace(self, tree: CompiledTree, instead_of: str | None = None) -> None:
        """Do another mission instead of the one under way, which is given up.

        With `instead_of` it takes the place of the mission of that name: one that waits is not begun, and one that is
        not under way just now is left alone, as by `preempt`. Raises ValueError: no such robot in the run.
        """
        self._refuse_stranger(tree.robot_name)
        self._ask_for(instead=(*self._requests.instead, Replacement(tree, instead_of)))
        self._note("replace", f"instead '{tree.mission_name}'")

    @_locked
    def answer(self, question_id: str, text: str) -> None:
        """Answer an open question. Raises ValueError when it is not open or `text` is none of its options."""
        self._questions.answer(question_id, text)
        self._note("answer", f"{question_id}: {text}")

    @_locked
    def begin(self, missions: Mapping[str, CompiledTree]) -> None:
        """The run begins. Raises ValueError for a breakpoint at a node that it does not have, or at a second run."""
        if self._begun:
            raise ValueError("a Control controls one run only; make another")
        self._begun = True
        for robot_name, tree in missions.items():
            self.mission_begun(robot_name, tree)
        for path_id in self._requests.breakpoints:
            self._refuse_unknown(path_id)

    @_locked
    def mission_begun(self, robot_name: str, tree: CompiledTree) -> None:
        """A mission begins, on top of those that a robot has begun. Idempotent."""
        before = self._missions.get(robot_name, ())
        if before[-1:] == (tree.mission_name,):
            return
        self._known |= frozenset(tree.path_ids)
        self._buttons = tuple(dict.fromkeys((*self._buttons, *tree.buttons)))
        stack = (*before, tree.mission_name)
        self._missions = MappingProxyType({**self._missions, robot_name: stack})
        self._bump()

    @_locked
    def mission_ended(self, robot_name: str) -> None:
        """A robot's topmost mission is over."""
        self._missions = MappingProxyType({**self._missions, robot_name: self._missions.get(robot_name, ())[:-1]})
        self._bump()

    @_locked
    def poll(self) -> ControlRequests:
        """What is asked for now; new missions and events are handed out once."""
        if self._requests is self._lasting and self._pressed is None and self._paused is None and not self._holds:
            return self._requests
        mode, reason = self._mode()
        held = mode is Mode.STOPPED or (mode is Mode.PAUSED and self._stride is None)
        holds = {robot: why for (robot, _), why in self._holds.items()}
        requests = replace(self._requests, hold=reason if held else None, holds=holds)
        self._lasting = ControlRequests(requests.cancel, requests.insists, breakpoints=requests.breakpoints)
        self._requests = self._lasting
        return requests

    @_locked
    def ticked(self, *, changed: bool) -> None:
        """The trees were ticked; `changed` says whether a node changed its status. Ends a step that is done."""
        if self._stride is None or (self._stride == 0 and not changed):
            return
        self._stride = self._stride - 1 if self._stride > 1 else None
        if self._stride is None:
            self._bump()

    @_locked
    def arrived_at(self, path_id: str) -> None:
        """The run stands at a breakpoint."""
        self._paused, self._at, self._stride = f"at the breakpoint {path_id}", path_id, None
        self._note("breakpoint", self._paused)

    @_locked
    def lease_lost(self, robot_name: str, why: str | None) -> None:
        """A robot's lease was lost (why), or is there again (None)."""
        others = {name: reason for name, reason in self._lost.items() if name != robot_name}
        self._lost = MappingProxyType(others if why is None else {**others, robot_name: why})
        self._note("lease lost" if why else "lease back", why or f"{robot_name} has its lease again")

    @_locked
    def ask(self, question: Question, clock: Clock, robot: str = "") -> Asked:
        """Put a robot's question to the operator. Raises ValueError when one of that id is open already."""
        over = functools.partial(self._note, "question over")
        asked = self._questions.ask(question, clock, self._changed, over, robot)
        self._note("question", f"{question.id}: {question.text}")
        return asked

    @_locked
    def held(self, duration_s: float) -> None:
        """The run was held so long (robot's clock); that does not count against the time of questions."""
        self._questions.postpone(duration_s)

    @_locked
    def rest(self, duration_s: float) -> None:
        """Let the wall's clock run on, less long when something is asked for meanwhile."""
        seen = self._version
        self._changed.wait_for(lambda: self._version > seen, duration_s)

    @property
    @_locked
    def slow(self) -> bool:
        """True while simulated time should not run ahead of the people who watch."""
        held = self._mode()[0] is not Mode.RUNNING or bool(self._holds)
        return held or (self.attended and bool(self._questions.open))

    @_locked
    def end(self) -> tuple[Event, ...]:
        """The run is over; the events that were not handed out yet."""
        self._ended = True
        self._questions.close()
        events = self._requests.events
        self._ask_for(events=())
        self._bump()
        return events

    def _mode(self) -> tuple[Mode, str]:
        lost = next(iter(self._lost.values()), None)
        order: Collection[tuple[bool, Mode, str | None]] = (
            (self._ended, Mode.ENDED, self._requests.cancel),
            (self._pressed is not None, Mode.STOPPED, self._pressed),
            (lost is not None, Mode.LEASE_LOST, lost),
            (self._paused is not None, Mode.PAUSED, self._paused),
            (not self._begun, Mode.READY, ""),
        )
        return next(((mode, reason or "") for holds, mode, reason in order if holds), (Mode.RUNNING, ""))

    def _robot_mode(self, robot: str) -> RobotMode:
        """What one robot does: the strongest reason not to move counts, its own or that of all."""
        run, reason = self._mode()
        order: Collection[tuple[bool, Mode, str | None]] = (
            (run in (Mode.ENDED, Mode.STOPPED), run, reason),
            ((robot, Mode.STOPPED) in self._holds, Mode.STOPPED, self._holds.get((robot, Mode.STOPPED))),
            (robot in self._lost, Mode.LEASE_LOST, self._lost.get(robot)),
            (self._paused is not None, Mode.PAUSED, self._paused),
            ((robot, Mode.PAUSED) in self._holds, Mode.PAUSED, self._holds.get((robot, Mode.PAUSED))),
            (not self._begun or not self._missions[robot], Mode.READY, ""),
        )
        return next((RobotMode(mode, why or "") for holds, mode, why in order if holds), RobotMode(Mode.RUNNING))

    def _hold(self, robot: str, mode: Mode, what: str, reason: str) -> None:
        self._refuse_stranger(robot)
        if (robot, mode) not in self._holds:
            self._holds = MappingProxyType({**self._holds, (robot, mode): reason})
            self._note(what, f"{robot}: {reason}")

    def _let_go(self, robot: str, mode: Mode, what: str, message: str) -> None:
        if (robot, mode) in self._holds:
            self._holds = MappingProxyType({key: why for key, why in self._holds.items() if key != (robot, mode)})
            self._note(what, f"{robot}: {message}")

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
