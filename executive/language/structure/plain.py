"""Reads plain parts of a sentence, from their words or items to commands, with the state of the mission around them."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Sequence
from copy import copy
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Final, TypeVar

from executive.language.clauses import CLAUSES
from executive.language.items import Adverb, Chunk, Item, Whether, verb
from executive.language.lexicon import VerbKind, lexicon, unquoted, word_list
from executive.language.nouns import NounKind
from executive.language.phrases import Phrase
from executive.language.pipeline import Pipeline, Trace
from executive.language.questions import RefusalError, RefusalKind
from executive.language.reference import Memory
from executive.language.roles import HERE, Location
from executive.language.templates import Page, page
from executive.language.tokens import Token
from executive.words.command import START, Command
from executive.words.condition import AllOf, Condition, DoorOpen, Look, Not
from executive.words.knowledge import Knowledge
from executive.words.leaf_steps import Do, steps_of_commands
from executive.words.outlines import inside
from executive.words.steps import Steps
from executive.words.task import basic
from skills.api import ObjectKind

_LEFT_OUT: Final = frozenset({"not", "n't", "but", "except", "instead", "rather", "neither", "nor"})
_DENIALS: Final = page("denials")
_SEES: Final = "I can see whether something or somebody is somewhere"
T = TypeVar("T")


def attempt(read: Callable[..., T], *inputs: Any) -> T | RefusalError:
    """Returns what a function reads from inputs, or its refusal."""
    try:
        return read(*inputs)
    except RefusalError as refusal:
        return refusal


def require(given: T | None, reason: str, *unknown: str, **how: Any) -> T:
    """Returns what must be given, or must hold. Raises RefusalError when it is nothing, or does not hold."""
    if not given:
        raise RefusalError(reason, unknown, **how)
    return given


def words_to_say(text: str) -> str:
    """Words of a text, with those of a quotation. Raises RefusalError for other words beside a quotation."""
    said, whole = unquoted(text), " " not in text.strip()
    require(whole or said == text, f"there are words beside the quotation in '{said}'; leave them out", said)
    return said


@dataclass(frozen=True)
class State:
    """State of the mission where a part of the sentence begins.

    `memory` has the referents, `held` the object in the gripper, `goal` the robot's last destination, `at` its room
    (None: unknown), `door` the last door, `recipient` the default recipient of objects. `somebody` is True after a
    condition has found anybody in the remembered place. `notes` list words that were interpreted as others, `carried`
    are the commands that have put an object somewhere.
    """

    memory: Memory = field(default_factory=Memory)
    held: ObjectKind | None = None
    goal: str | None = START
    at: str | None = None
    door: DoorOpen | None = None
    recipient: Location | None = None
    somebody: bool = False
    notes: tuple[str, ...] = ()
    carried: tuple[Command, ...] = ()

    @classmethod
    def initial(cls, knowledge: Knowledge, memory: Memory) -> State:
        """State where a sentence begins."""
        start = (knowledge.start.x, knowledge.start.y)
        room = next((name for name, outline in knowledge.rooms.items() if inside(outline, start)), None)
        return cls(memory=memory, at=room)

    def common(self, other: State) -> State:
        """State after two branches: what both branches have in common, and the notes of both."""
        return replace(
            self.noting(other.notes),
            held=self.held if self.held == other.held else None,
            goal=self.goal if self.goal == other.goal else None,
            at=self.at if self.at == other.at else None,
            carried=tuple(one for one in self.carried if one in other.carried),
        )

    def noting(self, notes: Iterable[str]) -> State:
        """State with more notes."""
        return replace(self, notes=tuple(dict.fromkeys((*self.notes, *notes))))

    def recalling(self, **referents: Any) -> State:
        """State with other referents."""
        return replace(self, memory=replace(self.memory, **referents))

    @property
    def elsewhere(self) -> State:
        """State in which the robot may be anywhere."""
        return replace(self, goal=None, at=None)


@dataclass(frozen=True)
class SpokenCondition:
    """Condition with its words, and the state of the mission after true and after false.

    The words of a `quotable` condition may be repeated as a statement. The last `steps` check the condition (`looked`),
    or need it to succeed.
    """

    condition: Condition
    said: str
    holds: State
    fails: State
    quotable: bool = True
    steps: int = 1
    looked: bool = False

    def negate(self, said: str) -> SpokenCondition:
        """Negated condition, with its words."""
        return SpokenCondition(negate(self.condition), said, self.fails, self.holds)

    @property
    def opposite(self) -> SpokenCondition:
        """Negated condition, whose words may not be repeated."""
        return replace(self.negate(f"not {self.said}"), quotable=False)

    @property
    def statement(self) -> str | None:
        """Words of the condition as a statement; None if they cannot be repeated."""
        plain = self.quotable and not CLAUSES["deictic"].search(self.said)
        return self.said if plain and self.said and not re.match(r"it\b|there is one", self.said) else None

    def at_source(self, steps: Steps, text: str) -> SpokenCondition:
        """Adds to a condition without a place ("if there is one") the place from which the object is taken."""
        taken = next((c for step in steps for c in step.commands if c.takes), None)
        look = self.condition.part if isinstance(self.condition, Not) else self.condition
        placed = re.search(r"\b(?:in|on|at|inside|near)\b", text, re.IGNORECASE)
        if taken is None or placed or not isinstance(look, Look) or look.command.object != taken.object:
            return self
        there = Look.from_command(replace(look.command, goal=taken.goal))
        return replace(self, condition=Not(part=there) if isinstance(self.condition, Not) else there)


@dataclass(frozen=True)
class PlainReading:
    """Reading of a plain part: its commands, the state after it, and the trace of its understanding."""

    commands: tuple[Command, ...]
    state: State
    trace: Trace

    @property
    def steps(self) -> tuple[Do, ...]:
        """Steps of the commands."""
        return steps_of_commands(self.commands)

    @property
    def one_errand(self) -> bool:
        """Returns whether all commands are about one object, or only go to a place and back."""
        objects = {str(thing) for command in self.commands for thing in (command.item, command.object) if thing}
        going = [action for action in self.trace.resolved if action.kind is VerbKind.GO]
        bare = sum(command.item is None and command.task is None for command in self.commands)
        return len(objects) == 1 if not bare else not objects and bare <= 2 and bool(going) and going[-1].goal == HERE


def negate(condition: Condition) -> Condition:
    """Negation of a condition."""
    return condition.part if isinstance(condition, Not) else Not(part=condition)


def named(name: str, kind: NounKind = NounKind.PERSON) -> Location:
    """Person to go to, or place, with a name in the world."""
    person = kind is NounKind.PERSON
    entity, pos, tag = ("PERSON", "PROPN", "NNP") if person else ("", "NOUN", "NN")
    token = Token(0, 0, name, name.lower(), pos, tag, 0, "obl", entity, kind, known=True)
    return Location(Phrase((token,)), "to" if person else "in")


def with_preposition(items: Sequence[Item], preposition: str) -> tuple[Item, ...]:
    """Adds a preposition to the first noun phrase of some items; "there" needs none."""
    at, first = next(((n, item) for n, item in enumerate(items) if isinstance(item, Chunk | Adverb)), (0, None))
    if not isinstance(first, Chunk) or first.role is not None:
        return tuple(items)
    role = lexicon().prepositions[tuple(preposition.split())]
    return (*items[:at], replace(first, preposition=preposition, role=role), *items[at + 1 :])


@dataclass(frozen=True)
class PlainReader:
    """Reads plain parts in one world. Its methods raise RefusalError for words that they cannot understand."""

    pipeline: Pipeline
    knowledge: Knowledge
    _traces: dict[tuple[Trace, str | None, str | None], Trace] = field(default_factory=dict, compare=False, repr=False)

    def forms(self, name: str, file: Path | None = None) -> Page:
        """Templates of a page that leaves open the names of people and places; the longest names come first.

        The page is in a `file` of a plug-in, or this package's own by its name.
        """
        names = {"names": self.knowledge.people, "around": self.knowledge.place_names()}
        spelt = {key: self.knowledge.spellings(each) for key, each in names.items()}
        return page(name, file=file, **{key: tuple(sorted(each, key=len, reverse=True)) for key, each in spelt.items()})

    def read(
        self, state: State, text: str = "", *, behind: str | None = None, upto: str | None = None, **inputs: Any
    ) -> PlainReading:
        """Understands a part as far as a step of the pipeline, from its text, or from `inputs` that a step gives."""
        key = (Trace(text, state.memory, **inputs), behind, upto)
        if key not in self._traces:  # clauses are attempted before they are built
            self._traces[key] = self.pipeline.run(key[0], behind=behind, upto=upto)
        if (trace := self._traces[key]).refusal is not None:
            raise copy(trace.refusal)
        commands = trace.commands
        if commands and state.held is not None and commands[0].takes and commands[0].object == state.held:
            commands = commands[1:]
        return PlainReading(commands, self.state_after(commands, trace.memory, state).noting(trace.notes), trace)

    def read_commands(self, text: str, state: State, lead: Sequence[Item] = ()) -> PlainReading:
        """Understands a plain part after the items `lead`."""
        return self.read(state, text, lead=tuple(lead), elliptic=True, recipient=state.recipient)

    def commands_from_items(self, items: Sequence[Item], state: State, tokens: Sequence[Token] = ()) -> PlainReading:
        """Understands items and the words that they were read from."""
        return self.read(state, behind="reading", items=tuple(items), tokens=tuple(tokens))

    def read_items(self, text: str) -> tuple[Item, ...]:
        """Reads words as items."""
        return self.read(State(), text, upto="reading").trace.items

    def go_to(self, text: str, state: State, *, by: str = "go") -> PlainReading:
        """Understands going to a place, which a noun phrase, "here" or "there" names."""
        if text.lower() in ("here", "there"):
            return self.commands_from_items((verb(by), Adverb(here=text.lower() == "here")), state)
        if re.match(r"(?:every|each|all) ", text, re.IGNORECASE):  # perhaps "but the hall"
            read = self.read(State(), f"to {text}", lead=(verb(by),), upto="reading").trace
            return self.read(state, behind="reading", items=read.items, unwanted=read.unwanted)
        return self.commands_from_items((verb(by), *with_preposition(self.read_items(text), "to")), state)

    def check(self, text: str, state: State, said: str = "") -> SpokenCondition:
        """Condition that the statement in a text holds; `said` are the full words of the speaker."""
        denied, said = _DENIALS["statement"].fullmatch(text), said or text
        affirmed = text if denied is None else denied.instead
        read = self.read(state, affirmed, lead=(verb("check"), Whether()), upto="reading").trace
        if (left_out := next((token.word for token in read.tokens if token.word in _LEFT_OUT), None)) is not None:
            raise RefusalError(f"I cannot see whether '{said}'; say it without '{left_out}'", [said])
        found = self.looks(read.items, said, state, read.tokens)
        return found if denied is None else found.negate(said)

    def looks(self, items: Sequence[Item], text: str, state: State, tokens: Sequence[Token] = ()) -> SpokenCondition:
        """Condition of the looks that given items ask for; `text` is the full text."""
        reading = attempt(self.commands_from_items, [self._by_name(item, state) for item in items], state, tokens)
        unseen = RefusalError(f"I cannot see whether '{text}'; {_SEES}", [text])
        if isinstance(reading, RefusalError):
            raise unseen if reading.kind is RefusalKind.NOT_UNDERSTOOD else reading
        if not reading.commands or not all(command.looks for command in reading.commands):
            raise unseen
        one = not any(action.choices for action in reading.trace.actions)
        require(one, f"I cannot tell which one '{text}' means; name one", text)
        there = replace(state, goal=reading.state.goal, at=reading.state.at)
        return self._condition_of_looks(reading, there, state, text)

    def _by_name(self, item: Item, state: State) -> Item:
        """Replaces "he" by the name of the last person."""
        person = state.memory.person
        if person is None or person.phrase is None or self.knowledge.person(person.name) is None:
            return item
        he = isinstance(item, Chunk) and item.role is None and item.phrase.head.word in ("he", "she")
        return replace(item, phrase=person.phrase) if isinstance(item, Chunk) and he else item

    def place(self, said: str, state: State, kind: str = "place") -> str:
        """World's name for a place that words name."""
        first, *more = self.go_to(said, state).commands
        if more or first.item or first.task or first.goal is None or not self.is_place(first.goal):
            raise RefusalError(f"'{said}' is no {kind}", [said])
        return first.goal

    def is_place(self, name: str | None) -> bool:
        """Returns whether a goal is a place in the world."""
        return name is not None and self.knowledge.place(name) is not None

    def room(self, place: str, state: State) -> str:
        """Room that contains a place."""
        return self.knowledge.room(self.place(place, state, "room"))

    def is_somebody(self, who: str, state: State) -> bool:
        """Returns whether the words mean a known person, an earlier person, or anybody."""
        words = who.lower().removeprefix("a ").removeprefix("any ")
        if words in word_list("anyone") | word_list("any_person") or words in ("guest", "they"):
            return True
        spoken_of = words in word_list("somebody") and state.memory.person is not None
        return spoken_of or self.knowledge.person(who) is not None

    def _condition_of_looks(self, reading: PlainReading, state: State, before: State, text: str) -> SpokenCondition:
        """Condition that the looks in a reading succeed; `text` is the full text."""
        looks = tuple(Look.from_command(command) for command in reading.commands if command.looks)
        known = self._state_if_seen(reading, state).noting(reading.trace.notes)
        fails = known.recalling(where=None, locations=before.memory.locations)
        return SpokenCondition(looks[0] if len(looks) == 1 else AllOf(parts=looks), text, known, fails)

    def last_check(self, reading: PlainReading, before: State, said: str = "") -> SpokenCondition | None:
        """Look or fetch that the last command of a reading stands for; `said` is the statement of the look."""
        commands = reading.commands
        if commands and commands[-1].looks:
            looks = sum(command.looks for command in commands)
            return replace(self._condition_of_looks(reading, reading.state, before, said), looked=True, steps=looks)
        taken = next((command for command in reversed(commands) if command.takes), None)
        if taken is None:
            return None
        found = Look.from_command(replace(taken, task=basic().look, verb="find"))
        fails = replace(reading.state.elsewhere, held=None).recalling(where=None, locations=before.memory.locations)
        return SpokenCondition(found, "", reading.state, fails, steps=len(commands))

    def _state_if_seen(self, reading: PlainReading, state: State) -> State:
        """State if the look succeeds."""
        action, memory = reading.trace.resolved[-1], reading.trace.memory
        target, where = action.target, action.source
        if target is None:
            return replace(state, memory=memory)
        sought, place = reading.commands[-1].object, where or memory.place
        name = "" if sought is None else sought.name
        if self.knowledge.somebody(name) is None and not target.person:
            locations = memory.locations if where is None else (*memory.locations, (target, where))
            seen = replace(memory, objects=(target,), where=where, place=place, locations=locations)
            return replace(state, memory=seen)
        known = self.knowledge.person(name) is not None
        person, before = Location(target) if known else state.memory.person, state.memory
        met = replace(memory, objects=before.objects, where=before.where, person=person, place=place)
        return replace(state, memory=met, somebody=not known)

    def state_after(self, commands: Sequence[Command], memory: Memory, state: State) -> State:
        """State after some commands."""
        held, goal, carried = state.held, state.goal, state.carried
        for command in commands:
            if command.takes:
                held = command.object
            elif command.item is not None and command.goal is not None:
                held, carried = None, (*carried, command)
            goal = command.goal if command.goal is not None else goal
        at = self._room_after(commands[-1]) if commands else state.at
        return replace(state, memory=memory, held=held, goal=goal, at=at, carried=carried)

    def _room_after(self, command: Command) -> str | None:
        """Room of the robot after a command; None if it is unknown."""
        place = command.goal_at or command.goal
        if place == START:
            return State.initial(self.knowledge, Memory()).at
        if place in self.knowledge.people and command.goal_at is None:
            return self.knowledge.room(self.knowledge.people[place].at)
        return self.knowledge.room(place) if place is not None and self.is_place(place) else None
