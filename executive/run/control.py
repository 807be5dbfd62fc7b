"""Control of a run from outside: pause, step, cancel, stop button, breakpoints, other missions first, questions.

From Python, with the run in one thread and the hands in another:

    control = Control()
    thread = threading.Thread(target=lambda: run([entry], control=control, ...))
    thread.start()
    control.pause("somebody walks by")       # the robot stands still at the next tick
    control.step()                           # until the next node changes its status
    control.resume()
    control.set_breakpoint("alice/fetch-drink/1-kitchen/grasp")
    for question in control.state.questions:
        control.answer(question.id, question.options[0])
    control.preempt(tree_of_another_mission)  # the present one is taken up again afterwards
    control.then(tree_of_another_mission)  # when the present one is done
    control.replace(tree_of_another_mission)  # the present one is given up
    control.cancel("enough for today")

All methods may be called from any thread and from signal handlers; they return at once, and the run heeds them
before it lets more time pass: within one tick.
"""

from __future__ import annotations

import difflib
import enum
import threading
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

from executive.run.questions import OpenQuestion, QuestionDesk
from executive.tree.compiler import CompiledTree
from skills.api import Asked, Question
from skills.robot import Clock


class Mode(enum.Enum):
    """What a run does just now; the strongest reason not to move counts."""

    READY = "ready"  # it has not begun
    RUNNING = "running"  # trees are ticked
    PAUSED = "paused"  # by the operator or at a breakpoint
    LEASE_LOST = "lease lost"  # another moves the robot
    STOPPED = "stopped"  # the stop button is pressed
    ENDED = "ended"  # it is over


@dataclass(frozen=True)
class ControlState:
    """What can be seen of a run's control at one moment.

    `version` grows with every change. `missions` gives for each robot the missions begun and not ended, the one under
    way last. `at` is the path id of the breakpoint that the run waits at.
    """

    version: int = 0
    mode: Mode = Mode.READY
    reason: str = ""
    at: str | None = None
    questions: tuple[OpenQuestion, ...] = ()
    breakpoints: frozenset[str] = frozenset()
    missions: Mapping[str, tuple[str, ...]] = field(default_factory=dict)


@dataclass(frozen=True)
class Event:
    """Something done through or told by the control, for the log."""

    what: str
    message: str


@dataclass(frozen=True)
class Replacement:
    """A mission, and the name of the one whose place it takes; None is the one under way."""

    tree: CompiledTree
    instead_of: str | None = None


@dataclass(frozen=True)
class Wishes:
    """What the runner is to heed now; `preempts` are missions to do first, `instead` and `later` as they say."""

    cancel: str | None
    hold: str | None
    preempts: tuple[CompiledTree, ...]
    breakpoints: frozenset[str]
    events: tuple[Event, ...]
    instead: tuple[Replacement, ...] = ()
    later: tuple[CompiledTree, ...] = ()


class Control:
    """The hands on one run. `attended` says that somebody is there to answer questions.

    While a run is held, and while an attended one asks, simulated time passes `pace` times as fast as the wall's at
    most (None: as fast as can be).
    """

    def __init__(self, *, attended: bool = False, pace: float | None = 1.0) -> None:
        self.attended = attended
        self.pace = pace
        self._changed = threading.Condition()
        self._desk = QuestionDesk()
        self._version = 0
        self._begun = self._ended = False
        self._cancel: str | None = None
        self._pressed: str | None = None
        self._paused: str | None = None
        self._stride: int | None = None  # ticks to go while paused; 0: until a node changes; None: none
        self._at: str | None = None
        self._lost: Mapping[str, str] = MappingProxyType({})
        self._missions: Mapping[str, tuple[str, ...]] = MappingProxyType({})
        self._known: frozenset[str] = frozenset()
        self._breakpoints: frozenset[str] = frozenset()
        self._preempts: tuple[CompiledTree, ...] = ()
        self._instead: tuple[Replacement, ...] = ()
        self._later: tuple[CompiledTree, ...] = ()
        self._events: tuple[Event, ...] = ()

    # -- for people and programs ------------------------------------------------------------------------------------

    @property
    def state(self) -> ControlState:
        """What can be seen now."""
        with self._changed:
            mode, reason = self._mode()
            return ControlState(
                self._version, mode, reason, self._at, self._desk.open, self._breakpoints, self._missions
            )

    def wait(self, version: int, timeout_s: float | None = None) -> ControlState:
        """Block (on the wall's clock) until the state is newer than `version`, or time is over; the state then."""
        with self._changed:
            self._changed.wait_for(lambda: self._version > version, timeout_s)
            return self.state

    def pause(self, reason: str = "paused by the operator") -> None:
        """Hold the robot still and keep the place of everything. Pausing twice is pausing once."""
        with self._changed:
            self._stride = None
            if self._paused is None:
                self._paused = reason
                self._note("pause", reason)

    def resume(self) -> None:
        """Go on after a pause, a breakpoint or steps; a pressed stop button stays pressed."""
        with self._changed:
            if self._paused is not None:
                self._paused = self._at = self._stride = None
                self._note("resume", "the mission goes on")

    def toggle_pause(self) -> None:
        """Pause, or resume when paused."""
        with self._changed:
            if self._paused is None:
                self.pause()
            else:
                self.resume()

    def step(self, ticks: int | None = None) -> None:
        """Go on until a node changes its status, or for some ticks, and pause again.

        Skills in motion are suspended between steps, so that few ticks may not suffice for a motion to get anywhere.

        Raises:
            ValueError: ticks below 1.
        """
        if ticks is not None and ticks < 1:
            raise ValueError(f"a step of {ticks} ticks: at least 1 is needed")
        with self._changed:
            self._paused = self._paused or "stepping"
            self._stride, self._at = ticks or 0, None
            self._note("step", "until a node changes" if ticks is None else f"for {ticks} ticks")

    def cancel(self, reason: str = "cancelled by the operator") -> None:
        """End the run; the first reason stays."""
        with self._changed:
            if self._cancel is None and not self._ended:
                self._cancel = reason
                self._note("cancel", reason)

    def stop_button(self, reason: str = "the stop button is pressed") -> None:
        """Stop all robots until `release_stop_button`, whatever else is wished."""
        with self._changed:
            if self._pressed is None:
                self._pressed = reason
                self._note("stop button", reason)

    def release_stop_button(self) -> None:
        """Let the run go on as it was when the button was pressed."""
        with self._changed:
            if self._pressed is not None:
                self._pressed = None
                self._note("stop button released", "the stop button is released")

    @property
    def stop_pressed(self) -> str | None:
        """Why nothing may move while the stop button is pressed; None when it is not."""
        with self._changed:
            return self._pressed

    def set_breakpoint(self, path_id: str) -> None:
        """Pause before the node begins, each time. Raises ValueError for a node that the run does not have."""
        with self._changed:
            self._refuse_unknown(path_id)
            self._breakpoints |= {path_id}
            self._note("breakpoint set", path_id)

    def clear_breakpoint(self, path_id: str) -> None:
        """Pause there no more; does nothing when there is none."""
        with self._changed:
            if path_id in self._breakpoints:
                self._breakpoints -= {path_id}
                self._note("breakpoint cleared", path_id)

    def preempt(self, tree: CompiledTree) -> None:
        """Do another mission first; the one under way is suspended and taken up again afterwards.

        Raises:
            ValueError: no such robot in the run, or the mission is under way already.
        """
        with self._changed:
            self._refuse_mission(tree)
            self._preempts += (tree,)
            self._note("preempt", f"first '{tree.mission_name}'")

    def then(self, tree: CompiledTree) -> None:
        """Do another mission when the one that the robot began with is done. Raises ValueError as `preempt`."""
        with self._changed:
            self._refuse_mission(tree)
            self._later += (tree,)
            self._note("then", f"afterwards '{tree.mission_name}'")

    def replace(self, tree: CompiledTree, instead_of: str | None = None) -> None:
        """Do another mission instead of the one under way, which is given up.

        With `instead_of` it takes the place of the mission of that name: one that waits is not begun, and one that is
        not under way just now is left alone, as by `preempt`.

        Raises:
            ValueError: no such robot in the run.
        """
        with self._changed:
            self._refuse_robot(tree)
            self._instead += (Replacement(tree, instead_of),)
            self._note("replace", f"instead '{tree.mission_name}'")

    def answer(self, question_id: str, text: str) -> None:
        """Answer an open question. Raises ValueError when it is not open or `text` is none of its options."""
        with self._changed:
            self._desk.answer(question_id, text)
            self._note("answer", f"{question_id}: {text}")

    # -- for the runner -----------------------------------------------------------------------------------------------

    def begin(self, missions: Mapping[str, CompiledTree]) -> None:
        """The run begins. Raises ValueError for a breakpoint at a node that it does not have, or at a second run."""
        with self._changed:
            if self._begun:
                raise ValueError("a Control has its hands on one run only; make another")
            self._begun = True
            for robot_name, tree in missions.items():
                self.mission_begun(robot_name, tree)
            for path_id in self._breakpoints:
                self._refuse_unknown(path_id)

    def mission_begun(self, robot_name: str, tree: CompiledTree) -> None:
        """A mission begins, on top of those that a robot has begun."""
        with self._changed:
            self._known |= frozenset(tree.path_ids)
            stack = (*self._missions.get(robot_name, ()), tree.mission_name)
            self._missions = MappingProxyType({**self._missions, robot_name: stack})
            self._bump()

    def mission_ended(self, robot_name: str) -> None:
        """A robot's topmost mission is over."""
        with self._changed:
            self._missions = MappingProxyType({**self._missions, robot_name: self._missions[robot_name][:-1]})
            self._bump()

    def heed(self) -> Wishes:
        """What is wished now; new missions and events are handed out once."""
        with self._changed:
            mode, reason = self._mode()
            held = reason if mode is Mode.STOPPED or (mode is Mode.PAUSED and self._stride is None) else None
            wishes = Wishes(
                self._cancel, held, self._preempts, self._breakpoints, self._events, self._instead, self._later
            )
            self._preempts, self._instead, self._later, self._events = (), (), (), ()
            return wishes

    def ticked(self, *, changed: bool) -> None:
        """The trees were ticked; `changed` says whether a node changed its status. Ends a step that is done."""
        with self._changed:
            if self._stride is None or (self._stride == 0 and not changed):
                return
            self._stride = self._stride - 1 if self._stride > 1 else None
            if self._stride is None:
                self._bump()

    def arrived_at(self, path_id: str) -> None:
        """The run stands at a breakpoint."""
        with self._changed:
            self._paused, self._at, self._stride = f"at the breakpoint {path_id}", path_id, None
            self._note("breakpoint", self._paused)

    def lease_lost(self, robot_name: str, why: str | None) -> None:
        """A robot's lease was lost (why), or is there again (None)."""
        with self._changed:
            others = {name: reason for name, reason in self._lost.items() if name != robot_name}
            self._lost = MappingProxyType(others if why is None else {**others, robot_name: why})
            self._note("lease lost" if why else "lease back", why or f"{robot_name} has its lease again")

    def ask(self, question: Question, clock: Clock) -> Asked:
        """Put a question to the operator. Raises ValueError when one of that id is open already."""
        with self._changed:
            asked = self._desk.ask(question, clock, self._changed, lambda said: self._note("question over", said))
            self._note("question", f"{question.id}: {question.text}")
            return asked

    def held(self, duration_s: float) -> None:
        """The run was held so long (robot's clock); that does not count against the time of questions."""
        with self._changed:
            self._desk.postpone(duration_s)

    def rest(self, duration_s: float) -> None:
        """Let the wall's clock run on, less long when something is wished meanwhile."""
        with self._changed:
            seen = self._version
            self._changed.wait_for(lambda: self._version > seen, duration_s)

    @property
    def slow(self) -> bool:
        """True while simulated time should not run ahead of the people who watch."""
        with self._changed:
            return self._mode()[0] is not Mode.RUNNING or (self.attended and bool(self._desk.open))

    def end(self) -> tuple[Event, ...]:
        """The run is over; the events that were not handed out yet."""
        with self._changed:
            self._ended = True
            self._desk.close()
            events, self._events = self._events, ()
            self._bump()
            return events

    # -- inside -------------------------------------------------------------------------------------------------------

    def _mode(self) -> tuple[Mode, str]:
        lost = next(iter(self._lost.values()), None)
        order: Collection[tuple[bool, Mode, str | None]] = (
            (self._ended, Mode.ENDED, self._cancel),
            (self._pressed is not None, Mode.STOPPED, self._pressed),
            (lost is not None, Mode.LEASE_LOST, lost),
            (self._paused is not None, Mode.PAUSED, self._paused),
            (not self._begun, Mode.READY, ""),
        )
        return next(((mode, reason or "") for holds, mode, reason in order if holds), (Mode.RUNNING, ""))

    def _refuse_robot(self, tree: CompiledTree) -> None:
        if self._begun and tree.robot_name not in self._missions:
            raise ValueError(f"robot '{tree.robot_name}' is not in this run; there are: {', '.join(self._missions)}")

    def _refuse_mission(self, tree: CompiledTree) -> None:
        self._refuse_robot(tree)
        waiting = [other.mission_name for other in (*self._preempts, *self._later)]
        if tree.mission_name in (*self._missions.get(tree.robot_name, ()), *waiting):
            raise ValueError(f"the mission '{tree.mission_name}' is under way already")

    def _note(self, what: str, message: str) -> None:
        self._events += (Event(what, message),)
        self._bump()

    def _bump(self) -> None:
        self._version += 1
        self._changed.notify_all()

    def _refuse_unknown(self, path_id: str) -> None:
        if self._begun and path_id not in self._known:
            near = difflib.get_close_matches(path_id, self._known, n=1)
            mend = f"; did you mean '{near[0]}'?" if near else ""
            raise ValueError(f"the run has no node '{path_id}'{mend}")
