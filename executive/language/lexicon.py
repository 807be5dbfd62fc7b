"""The dictionaries of verbs and small words, read from their files once."""

from __future__ import annotations

import enum
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, fields
from functools import cache
from importlib import resources
from typing import Any, Final

import yaml

Phrase = tuple[str, ...]


class VerbKind(enum.Enum):
    """What a verb asks for."""

    ROUND_TRIP = "round_trip"  # go for a thing and bring it back
    SINGLE_TRIP = "single_trip"  # carry a thing somewhere
    PICK = "pick"  # take hold of a thing
    PLACE = "place"  # set a thing down
    FIND = "find"  # look for a thing
    GO = "go"  # go somewhere
    CHECK = "check"  # see whether something is so
    WAIT = "wait"  # stay for a time
    CHARGE = "charge"  # charge the battery at the dock


class PrepositionRole(enum.Enum):
    """What a preposition says of the place behind it."""

    SOURCE = "source"  # from there
    GOAL = "goal"  # to there
    AT = "at"  # there: where a thing is or belongs, as the verb has it
    BESIDE = "beside"  # where a thing is, told by what is around it
    PATH = "path"  # the way there
    FOR = "for"  # for somebody, or what is searched for


@dataclass(frozen=True)
class Lexicon:
    """All dictionaries; phrases are tuples of lower-case words.

    `corrections` says of each phrase whether it may also be a mere filler; `light_nouns` gives for a verb the nouns
    that make one act with it ("take a picture").
    """

    verbs: Mapping[Phrase, frozenset[VerbKind]]
    at_is_goal: frozenset[str]
    goal_wanted: frozenset[str]
    source_wanted: frozenset[str]
    goes_back: frozenset[str]
    prepositions: Mapping[Phrase, PrepositionRole]
    fillers: frozenset[Phrase]
    openers: tuple[str, ...]
    requests: tuple[str, ...]
    refusals: tuple[str, ...]
    searches: tuple[str, ...]
    counting: tuple[str, ...]
    short_forms: Mapping[str, str]
    asides: tuple[str, ...]
    praises: tuple[str, ...]
    hesitations: tuple[str, ...]
    speaker: frozenset[str]
    pronouns: frozenset[str]
    levels: frozenset[str]
    bare_goal: frozenset[str]
    leaves: frozenset[str]
    enters: frozenset[str]
    needs: frozenset[Phrase]
    here: frozenset[str]
    there: frozenset[str]
    people: frozenset[str]
    everyone: frozenset[str]
    anyone: frozenset[str]
    any_person: frozenset[str]
    directions: frozenset[str]
    worn: frozenset[str]
    quantities: frozenset[str]
    fixtures: frozenset[str]
    somebody: frozenset[str]
    subjects: frozenset[str]
    asks: frozenset[str]
    asked_with: frozenset[str]
    fullness: frozenset[str]
    manners: frozenset[str]
    told: frozenset[str]
    negations: frozenset[Phrase]
    corrections: Mapping[Phrase, bool]
    light_nouns: Mapping[str, frozenset[str]]
    light_whole: frozenset[str]
    written: frozenset[str]
    prepared: frozenset[str]
    gives: frozenset[str]
    hands: frozenset[str]
    calls: frozenset[str]
    titles: frozenset[str]
    units: frozenset[str]
    docks: frozenset[str]
    vague_numbers: frozenset[str]
    no_numbers: frozenset[str]
    loose_numbers: frozenset[str]
    definite: frozenset[str]
    numbers: Mapping[str, int]


@cache
def lexicon() -> Lexicon:
    """The dictionaries that come with the package."""
    verbs, words = read_table("verbs.yaml"), read_table("words.yaml")
    read = {**verbs, **words}
    plain: dict[str, Any] = {
        each.name: _KINDS[each.type](read[each.name]) for each in fields(Lexicon) if each.type in _KINDS
    }
    return Lexicon(
        **plain,
        verbs=_kinds(verbs),
        prepositions={
            tuple(phrase.split()): PrepositionRole(role)
            for role, phrases in words["prepositions"].items()
            for phrase in phrases
        },
        short_forms=words["short_forms"],
        numbers={word: int(number) for word, number in words["numbers"].items()},
        corrections={tuple(p.split()): soft for soft in (False, True) for p in words["corrections"][_SOFTNESS[soft]]},
        light_nouns={verb: frozenset(nouns) for verb, nouns in words["light_nouns"].items()},
    )


_SOFTNESS: Final = {False: "certain", True: "soft"}


def _phrases(texts: Iterable[str]) -> frozenset[Phrase]:
    return frozenset(tuple(text.split()) for text in texts)


@cache
def read_table(name: str) -> Any:
    """A table of this package: all that is no list or mapping is text, "on" and "no" among it."""
    text = resources.files(__package__).joinpath("tables", name).read_text(encoding="utf-8")
    return yaml.load(text, Loader=getattr(yaml, "CBaseLoader", yaml.BaseLoader))


def _kinds(verbs: Mapping[str, Iterable[str]]) -> dict[Phrase, frozenset[VerbKind]]:
    phrases = {phrase for kind in VerbKind for phrase in verbs[kind.value]}
    return {
        tuple(phrase.split()): frozenset(kind for kind in VerbKind if phrase in verbs[kind.value]) for phrase in phrases
    }


def _longest_first(phrases: Iterable[str]) -> tuple[str, ...]:
    return tuple(sorted(phrases, key=len, reverse=True))


_KINDS: Final[Mapping[Any, Callable[[Iterable[str]], object]]] = {
    "frozenset[str]": frozenset,
    "frozenset[Phrase]": _phrases,
    "tuple[str, ...]": _longest_first,
}
"""How the fields are read that are plain lists in the files, by their types."""


class Patterns:
    """The regular expressions of a table, or of its section, without regard to case; each is compiled when it is used.

    {name} in one stands for another one of the section, of the table, or of `words`.
    """

    def __init__(self, table: str, section: str | None = None, words: Mapping[str, str] | None = None) -> None:
        self._table, self._section, self._words = table, section, dict(words or {})

    def __getattr__(self, name: str) -> re.Pattern[str]:
        if name.startswith("__"):
            raise AttributeError(name)
        found = re.compile(self.text(name), re.IGNORECASE)
        setattr(self, name, found)
        return found

    def compiled(self, text: str) -> re.Pattern[str]:
        """An expression that stands in no table."""
        return re.compile(self._filled(text), re.IGNORECASE)

    def each(self, name: str) -> tuple[re.Pattern[str], ...]:
        """The expressions of a list."""
        return tuple(self.compiled(text) for text in self._entry(name))

    def mapping(self, name: str) -> tuple[tuple[str, re.Pattern[str]], ...]:
        """The expressions of a mapping, each with its name."""
        return tuple((key, self.compiled(text)) for key, text in self._entry(name).items())

    def text(self, name: str) -> str:
        """An expression as it is written, those that it names filled in."""
        return self._words[name] if name in self._words else self._filled(self._entry(name))

    def filled(self, **words: str) -> Patterns:
        """The same with more words to fill in."""
        return Patterns(self._table, self._section, {**self._words, **words})

    def _entry(self, name: str) -> Any:
        table = read_table(self._table)
        return {**table, **(table[self._section] if self._section else {})}[name]

    def _filled(self, text: str) -> str:
        return re.sub(r"\{([a-z_]+)\}", lambda match: self.text(match[1]), text)
