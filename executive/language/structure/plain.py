"""Plain parts of a sentence: from their items to commands, with the state before and behind each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Final

from executive.language.actions import Action
from executive.language.items import Adverb, Being, Chunk, Item, Whether, verb
from executive.language.lexicon import PrepositionRole, lexicon
from executive.language.nouns import NounKind
from executive.language.phrases import Phrase
from executive.language.pipeline import Pipeline, Trace
from executive.language.questions import RefusalError, RefusalKind
from executive.language.reference import Memory
from executive.language.roles import Location
from executive.language.tokens import Token
from executive.words.command import START, Command, Task
from executive.words.condition import AllOf, Condition, DoorOpen, Look, Not
from executive.words.knowledge import Knowledge
from executive.words.outlines import inside
from skills.api import ObjectKind

_LEFT_OUT: Final = frozenset({"not", "n't", "but", "except", "instead", "rather", "neither", "nor"})
SEES: Final = "I can see whether something or somebody is somewhere"


@dataclass(frozen=True)
class State:
    """State of the mission where a part of the sentence begins.

    `memory` has the referents, `held` the object in the gripper, `goal` the robot's last destination, `at` its room
    (None: unknown), `door` the last door, `recipient` the person who receives objects where nobody is named.
    """

    memory: Memory = field(default_factory=Memory)
    held: ObjectKind | None = None
    goal: str | None = START
    at: str | None = None
    door: DoorOpen | None = None
    recipient: Location | None = None


@dataclass(frozen=True)
class SpokenCondition:
    """Condition with its words, and the states where it holds and where it does not.

    `quotable` says that the words may be repeated as a statement, `items` are those of a look, which another condition
    may omit.
    """

    condition: Condition
    said: str
    holds: State
    fails: State
    notes: tuple[str, ...] = ()
    quotable: bool = True
    items: tuple[Item, ...] = field(default=(), repr=False)

    def negate(self, said: str) -> SpokenCondition:
        """Negation, with its words."""
        return SpokenCondition(negate(self.condition), said, self.fails, self.holds, self.notes, items=self.items)


@dataclass(frozen=True)
class PlainReading:
    """Plain part: its commands, the state behind it, and the trace of its understanding."""

    commands: tuple[Command, ...]
    state: State
    trace: Trace


def negate(condition: Condition) -> Condition:
    """Negation of a condition."""
    return condition.part if isinstance(condition, Not) else Not(part=condition)


def initial_state(knowledge: Knowledge, memory: Memory) -> State:
    """State at the beginning of a sentence."""
    start = (knowledge.start.x, knowledge.start.y)
    room = next((name for name, place in knowledge.places.items() if inside(place.polygon, start)), None)
    return State(memory=memory, at=room)


def phrase_of_name(name: str, kind: NounKind) -> Phrase:
    """Noun phrase of a name that the world knows."""
    entity = "PERSON" if kind is NounKind.PERSON else ""
    pos, tag = ("PROPN", "NNP") if entity else ("NOUN", "NN")
    return Phrase((Token(0, 0, name, name.lower(), pos, tag, 0, "obl", entity, kind, known=True),))


def with_preposition(items: Sequence[Item], preposition: str) -> tuple[Item, ...]:
    """Adds a preposition to the first noun phrase of some items; "there" needs none."""
    at = next((n for n, item in enumerate(items) if isinstance(item, Chunk | Adverb)), None)
    first = None if at is None else items[at]
    if at is None or not isinstance(first, Chunk) or first.role is not None:
        return tuple(items)
    role = lexicon().prepositions[tuple(preposition.split())]
    return (*items[:at], replace(first, preposition=preposition, role=role), *items[at + 1 :])


IT: Final = Chunk(Phrase((Token(0, 0, "it", "it", "PRON", "PRP", 0, "obj"),)))
IS: Final = Being("is", existential=False, asked=False)
_THERE_IS: Final = Being("there is", existential=True, asked=False)


@dataclass(frozen=True)
class PlainReader:
    """Reader of plain parts in one world. Its methods raise RefusalError."""

    pipeline: Pipeline
    knowledge: Knowledge

    def _run(self, trace: Trace, *, behind: str | None = None, upto: str | None = None) -> Trace:
        found = self.pipeline.run(trace, behind=behind, upto=upto)
        if found.refusal is not None:
            raise found.refusal
        return found

    def commands_of(self, text: str, state: State, lead: Sequence[Item] = ()) -> PlainReading:
        """Understands a plain part behind the items `lead`."""
        trace = Trace(text, state.memory, tuple(lead), elliptic=True, recipient=state.recipient)
        return self._reading(self._run(trace), state)

    def commands_of_items(self, items: Sequence[Item], state: State, tokens: Sequence[Token] = ()) -> PlainReading:
        """Understands items, and the words from which they were read."""
        trace = Trace("", state.memory, tokens=tuple(tokens), items=tuple(items))
        return self._reading(self._run(trace, behind="reading"), state)

    def commands_of_actions(self, trace: Trace, actions: Sequence[Action], state: State) -> PlainReading:
        """Understands actions in place of those of a trace."""
        trace = replace(trace, actions=tuple(actions), memory=state.memory)
        return self._reading(self._run(trace, behind="understanding"), state)

    def actions_of(self, text: str, state: State) -> Trace:
        """Understands a plain part up to its actions."""
        return self._run(Trace(text, state.memory, elliptic=True), upto="understanding")

    def _reading(self, trace: Trace, state: State) -> PlainReading:
        commands = trace.commands
        first = commands[0] if commands else None
        if first is not None and state.held is not None and first.task is Task.GRASP and first.object == state.held:
            commands = commands[1:]
        return PlainReading(commands, self._after(commands, trace.memory, state), trace)

    def items_of(self, text: str) -> tuple[Item, ...]:
        """Reads the items of some words."""
        return self._run(Trace(text), upto="reading").items

    def go_to(self, text: str, state: State) -> PlainReading:
        """Understands going to a place, given by a noun phrase or "there"."""
        items = (Adverb(here=False),) if text.lower() == "there" else self.items_of(text)
        return self.commands_of_items((verb("go"), *with_preposition(items, "to")), state)

    def check(self, text: str, state: State, lead: Sequence[Item] = (), *, said: str | None = None) -> SpokenCondition:
        """Condition that the statement in the text holds; `said` is its full text."""
        read = self._run(Trace(text, lead=(verb("check"), Whether(), *lead), asked=True), upto="reading")
        assert read.affirmed is not None
        words = [token.word for token in read.tokens if token.index not in read.affirmed.silent]
        if (left_out := next((word for word in words if word in _LEFT_OUT), None)) is not None:
            raise RefusalError(f"I cannot see whether '{said or text}'; say it without '{left_out}'", [said or text])
        found = self.look_by_items(read.items, said or text, state, read.tokens)
        return found.negate(said or text) if read.affirmed.denied else found

    def exists(self, what: str, text: str, state: State) -> SpokenCondition:
        """Condition that an object exists, or does not ("no beer in the hall"); `text` is its full text."""
        return self.check(what, state, (_THERE_IS,), said=text)

    def look(self, who: str, room: str, text: str, state: State) -> SpokenCondition:
        """Condition that somebody is in a room."""
        where = Chunk(phrase_of_name(room, NounKind.PLACE), "in", PrepositionRole.AT)
        return self.look_by_items((verb("check"), Whether(), *self.items_of(who), IS, where), text, state)

    def look_by_items(
        self, items: Sequence[Item], text: str, state: State, tokens: Sequence[Token] = ()
    ) -> SpokenCondition:
        """Condition of the looks of some items; `text` is its full text."""
        try:
            reading = self.commands_of_items([self._by_name(item, state) for item in items], state, tokens)
        except RefusalError as refusal:
            if refusal.kind is not RefusalKind.NOT_UNDERSTOOD:
                raise
            raise RefusalError(f"I cannot see whether '{text}'; {SEES}", [text]) from None
        if any(action.choices for action in reading.trace.actions):
            raise RefusalError(f"I cannot tell which of them is meant in '{text}'", [text])
        if not reading.commands or any(command.task is not Task.FIND for command in reading.commands):
            raise RefusalError(f"I cannot see whether '{text}'; {SEES}", [text])
        there = replace(state, goal=reading.state.goal, at=reading.state.at)
        return replace(self.condition_of_looks(reading, there, state, text), items=tuple(items))

    def _by_name(self, item: Item, state: State) -> Item:
        """Replaces "he" by the last person."""
        person = state.memory.person
        if person is None or person.phrase is None or self.knowledge.person(person.name) is None:
            return item
        he = isinstance(item, Chunk) and item.role is None and item.phrase.head.word in ("he", "she")
        return replace(item, phrase=person.phrase) if isinstance(item, Chunk) and he else item

    def room(self, place: Location | str, state: State) -> str:
        """Room of a place, given as a location or in words."""
        text = place if isinstance(place, str) else place.text
        if isinstance(place, str):
            reading = self.go_to(place, state)
        else:
            assert place.phrase is not None
            to = Chunk(place.phrase, "to", PrepositionRole.GOAL)
            reading = self.commands_of_items((verb("go"), to), state)
        first, *more = reading.commands
        goal = first.goal
        if more or first.item or first.task or goal is None or self.knowledge.place(goal) is None:
            raise RefusalError(f"'{text}' is no room", [text])
        return self.knowledge.room(goal)

    def is_somebody(self, who: str, state: State) -> bool:
        """Returns whether the words mean a known person, an earlier one, or anybody."""
        words = who.lower().removeprefix("a ").removeprefix("any ")
        if words in lexicon().anyone | lexicon().any_person or words in ("guest", "they"):
            return True
        spoken_of = words in lexicon().somebody and state.memory.person is not None
        return spoken_of or self.knowledge.person(who) is not None

    def condition_of_looks(self, reading: PlainReading, state: State, before: State, text: str) -> SpokenCondition:
        """Condition that the looks of a reading succeed; `text` is its full text."""
        looks = tuple(Look.from_command(command) for command in reading.commands if command.task is Task.FIND)
        known = self._state_if_seen(reading, state)
        fails = replace(known, memory=replace(known.memory, where=None, locations=before.memory.locations))
        condition = looks[0] if len(looks) == 1 else AllOf(parts=looks)
        return SpokenCondition(condition, text, known, fails, reading.trace.notes)

    def _state_if_seen(self, reading: PlainReading, state: State) -> State:
        """State when the look succeeds."""
        action = reading.trace.resolved[-1]
        memory = reading.trace.memory
        target, where = action.target, action.source
        if target is None:
            return replace(state, memory=memory)
        locations = memory.locations if where is None else (*memory.locations, (target, where))
        sought = reading.commands[-1].object
        somebody = sought is not None and self.knowledge.somebody(sought.name) is not None
        if somebody or target.person:
            known = sought is not None and self.knowledge.person(sought.name) is not None
            person = Location(target) if known else state.memory.person
            met = replace(memory, objects=state.memory.objects, where=state.memory.where, person=person)
            return replace(state, memory=replace(met, place=where or memory.place))
        memory = replace(memory, objects=(target,), where=where, place=where or memory.place, locations=locations)
        return replace(state, memory=memory)

    def _after(self, commands: tuple[Command, ...], memory: Memory, state: State) -> State:
        """State behind some commands."""
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
            return initial_state(self.knowledge, state.memory).at
        if place is not None and place in self.knowledge.people and command.goal_at is None:
            return self.knowledge.room(self.knowledge.people[place].at)
        return None if place is None or self.knowledge.place(place) is None else self.knowledge.room(place)
