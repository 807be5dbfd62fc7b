"""Understands recognised speech: which robot is called, the commands, and misheard words."""

import re
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Final

from executive.language.cleaning import SAME_NAME, Address, find_heard_wake
from executive.language.lexicon import lexicon, word_list
from executive.language.parser import DependencyParser
from executive.language.roles import HERE
from executive.language.several_robots import understand_for_robots
from executive.language.spelling import SoundAlikes, sound_distance
from executive.language.understand import Status, Understanding
from executive.speech.interpret import Reading
from executive.speech.recogniser import Vocabulary
from executive.words.command import Command, is_attribute
from executive.words.knowledge import Knowledge
from skills.inputs.errors import InputError

_GREETINGS: Final = ("Hey", "Hi", "OK")
_EVERYBODY: Final = ("everyone", "everybody")
_ARTICLES: Final = ("the", "a", "an", "my", "from the", "to the", "on the", "in the")
_NUMBERS: Final = ("two", "three", "four", "five")
_BEINGS: Final = ("it's", "they're", "there's", "it is", "they are", "there is", "there are", "he is", "she is")
_UNRESOLVED: Final = frozenset({"her", "him"})


@dataclass(frozen=True)
class Reader:
    """Reader of heard sentences for one robot, or for several robots, any of which the speaker may call.

    For one robot `knowledge` may be None: names stay as spoken, and must be in the vocabulary unless it is empty.
    `other_robots` may be called as well, but do not listen.
    """

    parser: DependencyParser
    knowledge: Knowledge | None
    vocabulary: Vocabulary
    robots: tuple[str, ...]
    require_wake: bool
    other_robots: tuple[str, ...] = ()

    def read(self, text: str) -> Reading[Understanding]:
        """Understands `text`; the hypothesis fits if it gives commands in which all names are known.

        The text in the meaning spells the called robot's name correctly, so that a user could type the text instead.
        """
        called, alone = self._called(text), len(self.robots) == 1
        typed = called.text if called.name is None else f"Hey {called.name}, {called.text}"
        meant = understand_for_robots(
            called.text if alone else typed,
            robots=self.robots,
            parser=self.parser,
            knowledge=self.knowledge,
            require_wake=self.require_wake and not (alone and called.name),
        )
        if alone:
            meant = replace(meant, text=typed, parts=(), addressed=called.name is not None)
        else:
            meant = replace(meant, commands=tuple(each for part in meant.parts for each in part.meaning.commands))
        if meant.status is Status.NOT_ADDRESSED:
            return Reading(meant, fits=False, correctable=False)
        if meant.status is not Status.OK:
            return Reading(meant, fits=False, suspects=meant.unknown_words)
        known = {_plain(name) for name in self.vocabulary.names} if self.knowledge is None else set()
        spoken = dict.fromkeys(name for command in meant.commands for name in _names(command))
        strange = tuple(name for name in spoken if known and not _knows(known, name))
        return Reading(meant, fits=not strange, suspects=strange)

    def calls(self, text: str) -> bool:
        """Returns whether `text` calls one of the robots."""
        return self.read(text).meaning.addressed

    def _called(self, text: str) -> Address:
        """Finds the robot that `text` calls, even by a misspelled name, and the rest of the text."""
        for name in self.robots:
            text = _with_pause(text, name)
        others = {name: {*self.robots, *self.other_robots} - {name} for name in self.robots}
        heard = (find_heard_wake(text, name, others=others[name]) for name in self.robots)
        return next((one for one in heard if one.name is not None), Address(None, text))


def refuse_similar_names(robots: Sequence[str]) -> None:
    """Raises InputError when two names sound alike, or a name cannot be spoken."""
    for number, name in enumerate(robots):
        if not re.fullmatch(r"[^\W\d_]+(?:[ '-][^\W\d_]+)*", name):
            hint = "give it a name of letters, or write what it is to do"
            raise InputError(f"'{name[:60]}' cannot be called by voice", hint=hint)
        alike = next((other for other in robots[:number] if sound_distance(other, name) <= SAME_NAME), None)
        if alike is not None:
            what = f"{alike} and {name} sound alike, and cannot be told apart by voice"
            raise InputError(what, hint="give one of them another name")


def spoken_phrases(vocabulary: Vocabulary) -> SoundAlikes:
    """Phrases that a misheard word may stand for: the names, their plurals, and the words that requests use."""
    words = lexicon()
    verbs = [" ".join(verb) for verb in words.verbs]
    prepositions = [" ".join(preposition) for preposition in words.prepositions]
    called = (*vocabulary.robots, *(_EVERYBODY if vocabulary.other_robots else ()))
    calls = [f"{greeting} {name}" for name in called for greeting in _GREETINGS]
    names = [form for name in vocabulary.names for form in (name, f"{name}s")]
    statements = [f"{being} {where}" for being in _BEINGS for where in ("at", "by", "in", "on")]
    goals = [f"to {name}" for name in vocabulary.names]
    small = [
        *goals,
        *statements,
        *_BEINGS,
        *word_list("pronouns"),
        *word_list("here"),
        *word_list("there"),
        *word_list("speaker"),
        *_ARTICLES,
        *_NUMBERS,
    ]
    return SoundAlikes(names, [*calls, *verbs, *prepositions, *word_list("openers"), *word_list("requests"), *small])


def _with_pause(text: str, name: str) -> str:
    """Adds a comma between a name at the beginning and a verb, because the recogniser may miss a pause."""
    call = re.match(rf"({re.escape(name)})\s+(\w+)", text, re.IGNORECASE)
    asks = call is not None and any(verb[0] == call.group(2).lower() for verb in lexicon().verbs)
    return f"{name}, {text[len(name) :].lstrip()}" if asks else text


def _names(command: Command) -> Iterator[str]:
    """Names in a command, each with its adjectives."""
    objects = (" ".join((*one.attributes, one.name)) for one in (command.item, command.object) if one)
    goals = (goal for goal in (command.goal, command.goal_at) if goal is not None and goal != HERE.name)
    yield from (*objects, *goals)


def _knows(known: Collection[str], name: str) -> bool:
    """Returns whether a name is known, with or without its adjectives, or is a common word for people.

    Pronouns that refer to nobody do not count.
    """
    words = _plain(name).split()
    while words and " ".join(words) not in known and is_attribute(words[0]):
        words = words[1:]
    people = word_list("people") - _UNRESOLVED
    return bool(words) and (" ".join(words) in known or set(words) <= people)


def _plain(name: str) -> str:
    """Normal form of a name, without case and punctuation, equal for singular and plural."""
    return re.sub(r"(?:(?<=[sxz])es|(?<=ch)es|(?<=sh)es|(?<!s)s)$", "", re.sub(r"[^\w ]", "", name.lower()))
