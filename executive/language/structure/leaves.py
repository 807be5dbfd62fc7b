"""The plain parts of a sentence: understood as sentences of their own, each knowing what was spoken of before it."""

from __future__ import annotations

import re
from dataclasses import dataclass, field, replace
from typing import Final

from executive.language.lexicon import lexicon
from executive.language.parser import DependencyParser
from executive.language.questions import RefusalError, RefusalKind
from executive.language.reference import Memory
from executive.language.roles import Location
from executive.language.steps import Trace, trace_sentence
from executive.words.command import START, Command, Task, Thing
from executive.words.condition import AllOf, Condition, DoorOpen, Look
from executive.words.geometry import inside
from executive.words.knowledge import Knowledge

__all__ = ["Leaf", "Leaves", "State", "Supposed", "at_start"]

_LEFT_OUT: Final = re.compile(r"\b(?:not|but|except|instead|rather|neither|nor)\b|n't\b", re.IGNORECASE)
SEES: Final = "I can see whether something or somebody is somewhere"


@dataclass(frozen=True)
class State:
    """What is known where a part of the sentence begins.

    `memory` is what was spoken of, `held` what is in the gripper, `goal` where the robot was sent last, `at` the room
    of that (None: unknown), `door` the door that was spoken of.
    """

    memory: Memory = field(default_factory=Memory)
    held: Thing | None = None
    goal: str | None = START
    at: str | None = None
    door: DoorOpen | None = None


@dataclass(frozen=True)
class Supposed:
    """A condition, the words that tell it, and what is known where it holds and where it does not."""

    condition: Condition
    said: str
    holds: State
    fails: State
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class Leaf:
    """A plain part: its commands, what is known behind it, and how it was understood."""

    commands: tuple[Command, ...]
    state: State
    trace: Trace


def at_start(knowledge: Knowledge, memory: Memory) -> State:
    """What is known where a sentence begins."""
    start = (knowledge.start.x, knowledge.start.y)
    room = next((name for name, place in knowledge.places.items() if inside(place.polygon, start)), None)
    return State(memory=memory, at=room)


@dataclass(frozen=True)
class Leaves:
    """Understands plain parts in one world."""

    parser: DependencyParser
    knowledge: Knowledge

    def leaf(self, text: str, state: State) -> Leaf:
        """What a plain part asks for. Raises RefusalError: it is none, or leaves something open."""
        trace = trace_sentence(text, parser=self.parser, knowledge=self.knowledge, memory=state.memory)
        if trace.refusal is not None:
            raise trace.refusal
        commands = _without_taking(trace.commands, state.held)
        return Leaf(commands, self._after(commands, trace.memory, state), trace)

    def check(self, text: str, state: State, *, asked: bool = False) -> Supposed:
        """The status check "check if TEXT", or TEXT where it is `asked` so, as a condition. Raises RefusalError."""
        text = self._named(text, state)
        if (left_out := _LEFT_OUT.search(text)) is not None:
            raise RefusalError(f"I cannot see whether '{text}'; say it without '{left_out[0]}'", [text])
        try:
            leaf = self.leaf(text if asked else f"check if {text}", state)
        except RefusalError as refusal:
            if refusal.kind is not RefusalKind.NOT_UNDERSTOOD:
                raise
            raise RefusalError(f"I cannot see whether '{text}'; {SEES}", [text]) from None
        if any(action.choices for action in leaf.trace.actions):
            raise RefusalError(f"I cannot tell which of them is meant in '{text}'", [text])
        looks = tuple(Look(command) for command in leaf.commands if command.task is Task.FIND)
        if not looks or len(looks) != len(leaf.commands):
            raise RefusalError(f"I cannot see whether '{text}'; {SEES}", [text])
        known = self.seen(leaf, replace(state, goal=leaf.state.goal, at=leaf.state.at))
        fails = replace(known, memory=replace(known.memory, where=None, told=state.memory.told))
        return Supposed(looks[0] if len(looks) == 1 else AllOf(looks), text, known, fails, leaf.trace.notes)

    def _named(self, text: str, state: State) -> str:
        """The text with the name of the person who was spoken of in place of "he"."""
        person = state.memory.person
        known = person is not None and self.knowledge.person(person.name) is not None
        return re.sub(r"^(?:he|she)\b", person.name, text, flags=re.IGNORECASE) if person and known else text

    def look(self, who: str, room: str, state: State) -> Supposed:
        """That somebody is in a room. Raises RefusalError."""
        return self.check(f"{who} is in the {room}", state)

    def room(self, text: str, state: State) -> str:
        """The room of a place as it is spoken. Raises RefusalError."""
        first, *more = self.leaf("go there" if text.lower() == "there" else f"go to {text}", state).commands
        goal = first.goal
        if more or first.item or first.task or goal is None or self.knowledge.place(goal) is None:
            raise RefusalError(f"'{text}' is no room", [text])
        return self.knowledge.room(goal)

    def somebody(self, who: str, state: State) -> bool:
        """Whether it is a known person, somebody who was spoken of, or anybody at all."""
        words = who.lower().removeprefix("a ").removeprefix("any ")
        if words in lexicon().anyone | lexicon().any_person or words in ("guest", "they"):
            return True
        spoken_of = words in lexicon().somebody and state.memory.person is not None
        return spoken_of or self.knowledge.person(who) is not None

    def seen(self, leaf: Leaf, state: State) -> State:
        """What is known when what was looked for is there."""
        action = leaf.trace.resolved[-1]
        memory = leaf.trace.memory
        target, where = action.target, action.source
        if target is None:
            return replace(state, memory=memory)
        told = memory.told if where is None else (*memory.told, (target, where))
        sought = leaf.commands[-1].object
        somebody = sought is not None and self.knowledge.somebody(sought.name) is not None
        if somebody or target.person:
            named = sought is not None and self.knowledge.person(sought.name) is not None
            person = Location(target) if named else state.memory.person
            met = replace(memory, things=state.memory.things, where=state.memory.where, person=person)
            return replace(state, memory=replace(met, place=where or memory.place))
        memory = replace(memory, things=(target,), where=where, place=where or memory.place, told=told)
        return replace(state, memory=memory)

    def _after(self, commands: tuple[Command, ...], memory: Memory, state: State) -> State:
        """What is known when commands are done."""
        held, goal = state.held, state.goal
        for command in commands:
            if command.task is Task.GRASP:
                held = command.object
            elif command.item is not None and command.goal is not None:
                held = None
            goal = command.goal if command.goal is not None else goal
        if not commands:
            return replace(state, memory=memory)
        return replace(state, memory=memory, held=held, goal=goal, at=self._room_of(commands[-1], state))

    def _room_of(self, command: Command, state: State) -> str | None:
        place = command.goal_at or command.goal
        if place == START:
            return at_start(self.knowledge, state.memory).at
        if place is not None and place in self.knowledge.people and command.goal_at is None:
            return self.knowledge.room(self.knowledge.people[place].at)
        return None if place is None or self.knowledge.place(place) is None else self.knowledge.room(place)


def _without_taking(commands: tuple[Command, ...], held: Thing | None) -> tuple[Command, ...]:
    """The commands without that to take what is in the gripper already."""
    first = commands[0] if commands else None
    taken = first is not None and held is not None and first.task is Task.GRASP and first.object == held
    return commands[1:] if taken else commands
