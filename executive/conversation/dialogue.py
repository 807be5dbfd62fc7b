"""Conversation with a robot during a run: address, follow-ups, questions, and missions."""

import enum
import re
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from types import MappingProxyType
from typing import Final

from py_trees.common import Status as NodeStatus

from executive.conversation.replies import (
    NEVER_MIND,
    OVER,
    RemarkAnswers,
    Reply,
    ReplyKind,
    Speech,
    Waiting,
    answer,
    confirmation,
    refusal,
)
from executive.language.cleaning import find_heard_wake, strip_wake
from executive.language.followups import (
    Amendment,
    FollowUp,
    FollowUpKind,
    Remark,
    amend,
    parse_follow_up,
    parse_recall,
    parse_remark,
    skip_fetching,
)
from executive.language.questions import insert_answer
from executive.language.reference import Memory
from executive.language.understand import Status, Understanding
from executive.run.control import Control
from executive.run.control_state import Mode
from executive.run.visitor import Progress, RunVisitor
from executive.tree.compiler import CompiledTree
from executive.words.command import Command
from executive.words.leaf_steps import steps_of_commands
from executive.words.steps import Group
from skills.api import ObjectKind
from skills.inputs.errors import InputError

REMEMBERED_S: Final = 60.0
"""Time (robot's clock) after which the robot forgets the last request and its own open question."""


@dataclass(frozen=True)
class _Spoken:
    """Remembered request: what it means, the time (s), and the name of the mission that it started."""

    meant: Understanding
    at_s: float
    mission: str


class _When(enum.Enum):
    """Time at which a mission runs, in a word for the reply."""

    FIRST = "first"
    INSTEAD = "instead"
    AFTERWARDS = "afterwards"


class Conversation(RunVisitor):
    """Conversation with one robot during a run. All methods may be called from any thread.

    With `require_wake` the robot hears only sentences that contain its name, and answers to its own questions.
    """

    def __init__(
        self, speech: Speech, control: Control, *, require_wake: bool = False, others: Sequence[str] = ()
    ) -> None:
        self._speech, self._control = speech, control
        self._require_wake, self._others = require_wake, tuple(others)
        self._lock = threading.Lock()
        self._progress: Progress | None = None
        self._last: _Spoken | None = None
        self._open: Waiting | None = None
        self._names: frozenset[str] = frozenset()
        self._seen: frozenset[str] = frozenset()  # missions that have begun
        self._done: frozenset[str] = frozenset()
        self._remarks = RemarkAnswers(speech, control)
        self._listeners: tuple[Callable[[Waiting | None], None], ...] = ()

    def listen(self, listener: Callable[[Waiting | None], None]) -> None:
        """Calls `listener` after each sentence, with the question that is then open, or None."""
        self._listeners = (*self._listeners, listener)

    def set_mission(self, tree: CompiledTree, *, memory: Memory | None = None, now_s: float = 0.0) -> None:
        """Sets the mission that the run begins with. Later sentences may refer to this mission and correct it."""
        with self._lock:
            self._names |= {tree.mission_name}
            steps = tree.steps if any(step.is_block for step in tree.steps) else ()
            meant = Understanding("", Status.OK, tree.commands, memory=memory, steps=steps)
            self._last = _Spoken(meant, now_s, tree.mission_name)

    def tick(self, progress: Progress) -> None:
        """Stores the progress of the run."""
        self._progress = self._remarks.progress = progress
        tree = progress.trees.get(self._speech.robot_name)
        if tree is not None:
            self._seen |= {tree.mission_name}
            states = progress.states[self._speech.robot_name].items()
            done = {path_id for path_id, node in states if node.status is NodeStatus.SUCCESS}
            self._done |= {str(each.command) for each in tree.parts if {each.path_id, each.node} & done}

    def hear(self, text: str, now_s: float | None = None) -> Reply:
        """Carries out a sentence and returns the reply. `now_s` is the robot's clock, by default that of the run.

        Never raises, whatever the text.
        """
        with self._lock:
            seen_s = 0.0 if self._progress is None else self._progress.now_s
            now_s = seen_s if now_s is None else now_s
            said, ignored = self._addressed(text, now_s)
            reply = ignored or self._reply(said, now_s)
            waiting = self._waiting(now_s)
        for listener in self._listeners:
            listener(waiting)
        return reply

    # -- to whom -----------------------------------------------------------------------------------------------------

    def _addressed(self, text: str, now_s: float) -> tuple[str, Reply | None]:
        """Text without the wake phrase, and a reply if the text is not for this robot."""
        name = self._speech.robot_name
        short = text[:_MOST_LETTERS]
        if not self._require_wake:
            wake = strip_wake(short, name)
            if wake.name in (None, name):
                return wake.text, None
            return short, Reply(ReplyKind.IGNORED, f"it is said to {wake.name}, and I am {name}")
        address = find_heard_wake(short, name, others=self._others)
        if address.name is None and self._waiting(now_s) is None:
            return short, Reply(ReplyKind.IGNORED, f'my name was not said; begin with "Hey {name}"')
        return address.text, None

    def _reply(self, text: str, now_s: float) -> Reply:
        if not text.strip(" .,!?"):
            return answer("yes?")
        remark = parse_remark(text)
        if remark is Remark.CANCEL and self._waiting(now_s) is not None:
            self._open = None
            return confirmation(NEVER_MIND)
        if remark is not None:
            return self._remarks.answer_to(remark, text)
        for step in (self._answer_mission, self._answer_own, self._recall, self._follow_up):
            reply = step(text, now_s)
            if reply is not None:
                return reply
        return self._request(text, now_s)

    # -- answers -----------------------------------------------------------------------------------------------------

    def _answer_mission(self, text: str, now_s: float) -> Reply | None:
        """Answers a question of the mission with a sentence; returns None if the sentence answers none."""
        said = text.strip(" .,!?").lower()
        begun = said.replace(",", " ").split()[:1]  # "yes, I am" begins with the answer
        for each in self._control.state.questions:
            plain = begun[0] if begun and {o.lower() for o in each.options} == {"yes", "no"} else said
            fitting = (o for n, o in enumerate(each.options, 1) if o.lower() in (said, plain) or said == str(n))
            chosen = next(fitting, None if each.options else text)
            if chosen is not None:
                return self._tried(partial(self._control.answer, each.id, chosen), f"{chosen}, then")
        return None

    def _answer_own(self, text: str, now_s: float) -> Reply | None:
        """Answers the robot's own open question with a sentence; returns None if the sentence does not answer it."""
        waiting, self._open = self._waiting(now_s), None
        if waiting is None:
            return None
        if text.strip(" .,!?").lower() in _NONE_OF_THEM:
            return confirmation(NEVER_MIND)
        whole = insert_answer(waiting.sentence, waiting.question, text)
        reply = self._follow_up(whole, now_s) or self._request(whole, now_s)
        if reply.kind is not ReplyKind.REFUSED:
            return reply
        if parse_follow_up(text) is not None or self._understood(text, now_s).status is Status.OK:
            return None
        self._open = waiting
        return Reply(ReplyKind.QUESTION, f"I did not understand. {waiting.question.text}", question=waiting.question)

    def _recall(self, text: str, now_s: float) -> Reply | None:
        """Answers whether this run has done what a sentence asks about; returns None for other sentences."""
        request = parse_recall(text)
        if request is None or self._understood(text, now_s).status is Status.OK:
            return None
        meant = self._understood(request, now_s)
        if meant.status is not Status.OK or any(step.is_block for step in meant.all_steps):
            return refusal(meant.reason or "I know of single steps only whether they are done")
        asked = {str(command) for step in meant.all_steps for command in step.commands}
        return answer("yes, I have done that" if asked and asked <= self._done else "no, not so far")

    def _waiting(self, now_s: float) -> Waiting | None:
        return self._open if self._open is not None and now_s <= self._open.until_s else None

    # -- requests ----------------------------------------------------------------------------------------------------

    def _remembered(self, now_s: float) -> _Spoken | None:
        """Last request, as long as the robot remembers it, or holds its object."""
        recent = self._last is not None and (now_s - self._last.at_s <= REMEMBERED_S or self._held() is not None)
        return self._last if recent else None

    def _understood(self, text: str, now_s: float) -> Understanding:
        last = self._remembered(now_s)
        return self._speech.understand(
            text, None if last is None else last.meant.memory or self._memory_of(last.meant.commands)
        )

    def _memory_of(self, commands: Sequence[Command]) -> Memory | None:
        """Memory for follow-ups to commands from a file, as if a user had said the commands."""
        item = next((c.object or c.item for c in commands if c.object or c.item), None)
        goal = next((c.goal for c in reversed(commands) if c.goal not in (None, _START)), None)
        said = f"find the {item}" if item is not None else f"go to {goal}" if goal is not None else ""
        return self._speech.understand(said, None).memory if said else None

    def _request(self, text: str, now_s: float) -> Reply:
        """Carries out a request that does not refer to an earlier one."""
        meant = self._understood(text, now_s)
        if meant.status is not Status.OK:
            return self._not_ok(meant, text, now_s)
        when, refers = _When.FIRST, re.search(_PRONOUN, text, re.IGNORECASE)
        if re.match(_LATER, text, re.IGNORECASE):
            when = _When.AFTERWARDS
        elif refers and self._can_be_changed(now_s):
            last = () if self._last is None else self._last.meant.commands
            before, now = ({each.object or each.item for each in commands} for commands in (last, meant.commands))
            when = _When.INSTEAD if before & now - {None} else when
        return self._begin(meant, when, now_s)

    def _not_ok(self, meant: Understanding, text: str, now_s: float) -> Reply:
        if meant.question is not None:
            self._open = Waiting(meant.question, text, now_s + REMEMBERED_S)
            return Reply(ReplyKind.QUESTION, meant.question.text, question=meant.question)
        return refusal(meant.reason or "I did not understand")

    def _follow_up(self, text: str, now_s: float) -> Reply | None:
        """Carries out a follow-up to the last request, as long as the robot remembers that request."""
        last, follow_up = self._remembered(now_s), parse_follow_up(text)
        if follow_up is None or last is None or self._understood(text, now_s).steps:
            return None
        when = _When.AFTERWARDS
        if follow_up.kind is FollowUpKind.AGAIN:
            return self._begin(last.meant, when, now_s)
        if follow_up.kind is FollowUpKind.CORRECTION:
            when = _When.INSTEAD if self._can_be_changed(now_s) else _When.FIRST
        whole = self._understood(follow_up.whole, now_s)
        if whole.status is Status.OK:
            return self._begin(whole, when, now_s)
        if last.meant.steps:
            return refusal("I cannot change a part of what decides, repeats or waits; say it again")
        named = self._named(follow_up, now_s)
        if isinstance(named, Understanding):
            return self._not_ok(named, text, now_s)
        changed = amend(last.meant.commands, named, self._speech.knowledge)
        if changed == last.meant.commands:
            return refusal(f"I do not see what '{follow_up.whole}' changes")
        return self._begin(Understanding("", Status.OK, changed), when, now_s)

    def _named(self, follow_up: FollowUp, now_s: float) -> Amendment | Understanding:
        """Grounds the names in a short follow-up; returns an Understanding with the reason if that fails."""
        if follow_up.said.lower() in _COUNTS:
            return Amendment(count=_COUNTS[follow_up.said.lower()])
        said = follow_up.said if re.match(_DETERMINED, follow_up.said, re.IGNORECASE) else f"the {follow_up.said}"
        place = self._understood(f"go to {said}", now_s)
        found = self._understood(f"find {said}", now_s)
        old = self._old_name(follow_up.instead_of, now_s)
        if found.status is Status.OK and not follow_up.preposition and found.commands[0].object is not None:
            first = found.commands[0]
            count = first.object_count if re.match(_COUNTED, said, re.IGNORECASE) else None
            return Amendment(kind=first.object, count=count, old=old)
        if place.status is Status.OK:
            goal = place.commands[0]
            source = follow_up.preposition in _SOURCES
            return Amendment(goal=goal.goal, goal_at=goal.goal_at, source=source, old=old)
        both = (place, found) if follow_up.preposition else (found, place)
        return next((each for each in both if each.status is Status.QUESTION), both[0])

    def _old_name(self, said: str, now_s: float) -> str | None:
        """Known name that the follow-up replaces by another."""
        if not said:
            return None
        bare = re.sub(r"^(?:the|a|an|my|some)\s+", "", said, flags=re.IGNORECASE)
        knowledge = self._speech.knowledge
        return knowledge.object_name(bare) or knowledge.place(bare) or knowledge.person(bare)

    # -- missions ----------------------------------------------------------------------------------------------------

    def _begin(self, meant: Understanding, when: _When, now_s: float) -> Reply:
        """Starts a mission from what is understood, and remembers it."""
        state = self._control.state
        if state.mode is Mode.ENDED:
            return refusal(OVER)
        todo, steps = meant.commands, meant.steps
        if when is _When.INSTEAD and not steps:
            todo = skip_fetching(todo, self._held(), self._speech.knowledge)
        whole = steps or steps_of_commands(todo)
        try:
            tree = self._speech.compile(whole, self._names)
        except InputError as error:
            return refusal(str(error))
        before = None if self._last is None else self._last.mission
        instead = partial(self._control.replace, instead_of=before)
        give = {_When.FIRST: self._control.preempt, _When.AFTERWARDS: self._control.then}.get(when, instead)
        mode = state.robots.get(self._speech.robot_name, state).mode
        still = "; I stand still until you say 'go on'" if mode in (Mode.PAUSED, Mode.STOPPED) else ""
        shown = [inner for step in whole for inner in (step.steps if isinstance(step, Group) else (step,))]
        listed = "; ".join("; ".join(map(str, step.commands)) or step.words for step in shown)
        text = "; ".join((*meant.notes, f"{when.value}: {listed}{still}"))
        reply = self._tried(partial(give, tree), text, todo)
        if reply.kind is ReplyKind.DONE:
            self._names |= {tree.mission_name}
            self._last = _Spoken(replace(meant, notes=()), now_s, tree.mission_name)
        return reply

    def _tried(self, act: Callable[[], None], text: str, commands: tuple[Command, ...] = ()) -> Reply:
        try:
            act()
        except ValueError as error:
            return refusal(str(error))
        return Reply(ReplyKind.DONE, text, commands)

    def _can_be_changed(self, now_s: float) -> bool:
        """Returns whether the last request is still running, waiting, or about to begin."""
        last, missions = self._remembered(now_s), self._control.state.missions.get(self._speech.robot_name, ())
        return last is not None and (last.mission in missions or last.mission not in self._seen)

    def _held(self) -> ObjectKind | None:
        """Object in the gripper, as known from the last request; None if that is unknown."""
        status = None if self._progress is None else self._progress.robots.get(self._speech.robot_name)
        missions = self._control.state.missions.get(self._speech.robot_name, ())
        if status is None or not status.holding or self._last is None or self._last.mission not in missions[-1:]:
            return None
        return next((command.object for command in self._last.meant.commands if command.takes), None)


_START: Final = "start"
_MOST_LETTERS: Final = 2000
_LATER: Final = r"\W*(?:then|and then|after that|afterwards|when you are done|when that is done|later)\b"
_PRONOUN: Final = r"\b(?:it|them|that one|this one)\b"
_DETERMINED: Final = r"(?:the|a|an|my|your|some|any|this|that|\d+|two|three|four|five|another)\b|[A-Z]|me$"
_COUNTED: Final = r"(?:\d+|two|three|four|five|six)\b"
_SOURCES: Final = frozenset({"from", "out of", "off", "in", "on", "at"})
_NONE_OF_THEM: Final = frozenset({"no", "none", "neither", "none of them", "nothing", "neither of them", "no thanks"})
_COUNTS: Final = MappingProxyType({"two": 2, "2": 2, "three": 3, "3": 3, "four": 4, "4": 4})
