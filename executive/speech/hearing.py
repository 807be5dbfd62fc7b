"""From recognised sound to commands: who is called, what is asked for, and which words were misheard."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Final, Protocol

from executive.language.clauses import split
from executive.language.cleaning import SAME_NAME, Address, addressed_to, clean, heard_wake
from executive.language.lexicon import lexicon
from executive.language.parser import DependencyParser
from executive.language.questions import RefusalError
from executive.language.robots import Part, understand_for_robots
from executive.language.roles import HERE
from executive.language.spelling import SoundAlikes, sound_distance
from executive.language.understand import Status, Understanding, understand
from executive.speech.interpret import Reading
from executive.speech.recogniser import Vocabulary
from executive.words.command import Command, is_attribute
from executive.words.knowledge import Knowledge
from skills.files.errors import InputError

__all__ = ["Meant", "Reader", "SpeechReader", "TeamReader", "refuse_alike", "spoken_phrases"]

_GREETINGS: Final = ("Hey", "Hi", "OK")
_EVERYBODY: Final = ("everyone", "everybody")
_ARTICLES: Final = ("the", "a", "an", "my", "from the", "to the", "on the", "in the")
_NUMBERS: Final = ("two", "three", "four", "five")
_BEINGS: Final = ("it's", "they're", "there's", "it is", "they are", "there is", "there are", "he is", "she is")
_UNRESOLVED: Final = frozenset({"her", "him"})


@dataclass(frozen=True)
class Meant:
    """What a heard sentence means, and whether the robot was called by its name.

    The text of `understanding` is the sentence with the robot's name spelled right, so that it can be typed instead.
    `parts` say which of several robots does what.
    """

    understanding: Understanding
    addressed: bool
    parts: tuple[Part, ...] = ()


class Reader(Protocol):
    """Reads heard sentences."""

    @property
    def vocabulary(self) -> Vocabulary:
        """The names that are listened for."""

    @property
    def require_wake(self) -> bool:
        """Whether a robot must be called."""

    @property
    def robots(self) -> tuple[str, ...]:
        """The robots that can be called."""

    def read(self, text: str) -> Reading[Meant]:
        """What a text means."""

    def calls(self, text: str) -> bool:
        """Whether a robot is called in a text."""


@dataclass(frozen=True)
class SpeechReader:
    """Reads heard sentences for one robot.

    `knowledge` None keeps names as spoken; then names outside the vocabulary, where there is one, do not fit.
    """

    parser: DependencyParser
    knowledge: Knowledge | None
    vocabulary: Vocabulary
    robot_name: str
    require_wake: bool
    other_robots: Collection[str] = ()

    @property
    def robots(self) -> tuple[str, ...]:
        """The robot."""
        return (self.robot_name,)

    def read(self, text: str) -> Reading[Meant]:
        """What `text` means; it fits when it becomes commands in known names."""
        address = self._address(text)
        addressed = address.name is not None
        understood = understand(
            address.text if addressed else text,
            parser=self.parser,
            knowledge=self.knowledge,
            require_wake=self.require_wake and not addressed,
            robot_name=self.robot_name,
        )
        typed = f"Hey {self.robot_name}, {address.text}" if addressed else text
        meant = Meant(replace(understood, text=typed), addressed)
        if understood.status is Status.NOT_ADDRESSED:
            return Reading(meant, fits=False, correctable=False)
        if understood.status is not Status.OK:
            return Reading(meant, fits=False, suspects=understood.unknown_words)
        strange = () if self.knowledge else tuple(self._strange(understood.commands))
        return Reading(meant, fits=not strange, suspects=strange)

    def calls(self, text: str) -> bool:
        """Whether the robot is called in `text`, its name perhaps misspelled."""
        return self._address(text).name is not None

    def _address(self, text: str) -> Address:
        return heard_wake(_with_pause(text, self.robot_name), self.robot_name, others=self.other_robots)

    def _strange(self, commands: tuple[Command, ...]) -> Iterator[str]:
        """Names in the commands that the vocabulary does not know; none is strange where there is no vocabulary."""
        known = {_plain(name) for name in self.vocabulary.names}
        spoken = (name for command in commands for name in _names(command))
        yield from (name for name in dict.fromkeys(spoken) if known and not _knows(known, name))


@dataclass(frozen=True)
class TeamReader:
    """Reads heard sentences for several robots: one, some or all of them may be called."""

    parser: DependencyParser
    knowledge: Knowledge
    vocabulary: Vocabulary
    robots: tuple[str, ...]
    require_wake: bool

    def read(self, text: str) -> Reading[Meant]:
        """What `text` means for each; it fits when it becomes commands."""
        said = self._as_called(text)
        asked = understand_for_robots(
            said, robots=self.robots, parser=self.parser, knowledge=self.knowledge, require_wake=self.require_wake
        )
        commands = tuple(command for part in asked.parts for command in part.meaning.commands)
        rest = (commands, asked.reason, asked.unknown_words, asked.question, asked.notes, asked.memory)
        meant = Meant(Understanding(said, asked.status, *rest), self.calls(said), asked.parts)
        if asked.status is Status.NOT_ADDRESSED:
            return Reading(meant, fits=False, correctable=False)
        return Reading(meant, fits=asked.status is Status.OK, suspects=asked.unknown_words)

    def calls(self, text: str) -> bool:
        """Whether robots are called in `text`, a name perhaps misspelled."""
        try:
            return split(clean(self._as_called(text)), self.robots).listener is not None
        except RefusalError:
            return True

    def _as_called(self, text: str) -> str:
        """The text with the name of the robot that it begins with spelled right."""
        for name in self.robots:
            text = _with_pause(text, name)
        if addressed_to(text, self.robots).name is not None:
            return text
        others = {name: [other for other in self.robots if other != name] for name in self.robots}
        heard = (heard_wake(text, name, others=others[name]) for name in self.robots)
        return next((f"Hey {one.name}, {one.text}" for one in heard if one.name is not None), text)


def refuse_alike(robots: Sequence[str]) -> None:
    """Raise InputError where robots cannot be told apart by voice, or a name cannot be said."""
    for number, name in enumerate(robots):
        if not re.fullmatch(r"[^\W\d_]+(?:[ '-][^\W\d_]+)*", name):
            hint = "give it a name of letters, or write what it is to do"
            raise InputError(f"'{name[:60]}' cannot be called by voice", hint=hint)
        alike = next((other for other in robots[:number] if sound_distance(other, name) <= SAME_NAME), None)
        if alike is not None:
            what = f"{alike} and {name} sound alike, and cannot be told apart by voice"
            raise InputError(what, hint="give one of them another name")


def spoken_phrases(vocabulary: Vocabulary) -> SoundAlikes:
    """All that a misheard word may have been: the names, also in the plural, and the words of requests."""
    words = lexicon()
    verbs = [" ".join(verb) for verb in words.verbs]
    prepositions = [" ".join(preposition) for preposition in words.prepositions]
    called = (*vocabulary.robots, *(_EVERYBODY if vocabulary.other_robots else ()))
    calls = [f"{greeting} {name}" for name in called for greeting in _GREETINGS]
    names = [form for name in vocabulary.names for form in (name, f"{name}s")]
    told = [f"{being} {where}" for being in _BEINGS for where in ("at", "by", "in", "on")]
    goals = [f"to {name}" for name in vocabulary.names]
    small = [*goals, *told, *_BEINGS, *words.pronouns, *words.here, *words.there, *words.speaker, *_ARTICLES, *_NUMBERS]
    return SoundAlikes(names, [*calls, *verbs, *prepositions, *words.openers, *words.requests, *small])


def _with_pause(text: str, name: str) -> str:
    """The text with a comma between the name at its beginning and a verb that asks: a pause is not always heard."""
    call = re.match(rf"({re.escape(name)})\s+(\w+)", text, re.IGNORECASE)
    asks = call is not None and any(verb[0] == call.group(2).lower() for verb in lexicon().verbs)
    return f"{name}, {text[len(name) :].lstrip()}" if asks else text


def _names(command: Command) -> Iterator[str]:
    """The names in a command, with the adjectives before them."""
    things = (" ".join((*thing.attributes, thing.name)) for thing in (command.item, command.object) if thing)
    goals = (goal for goal in (command.goal, command.goal_at) if goal is not None and goal != HERE.name)
    yield from (*things, *goals)


def _knows(known: Collection[str], name: str) -> bool:
    """Whether a name is known as a whole, or without the adjectives before it, or is a word for a person.

    Pronouns that stand for nobody are no names.
    """
    words = _plain(name).split()
    while words and " ".join(words) not in known and is_attribute(words[0]):
        words = words[1:]
    people = lexicon().people - _UNRESOLVED
    return bool(words) and (" ".join(words) in known or people.issuperset(words))


def _plain(name: str) -> str:
    """A name by which singular and plural are the same, without case and signs."""
    return re.sub(r"(?:(?<=[sxz])es|(?<=ch)es|(?<=sh)es|(?<!s)s)$", "", re.sub(r"[^\w ]", "", name.lower()))
