"""Reads the dictionaries of verbs and small words from their files, once."""

from __future__ import annotations

import enum
import re
from collections.abc import Iterable, Mapping, Set
from functools import cache
from importlib import resources
from typing import Any, Final

import yaml

Phrase = tuple[str, ...]


class VerbKind(enum.Enum):
    """Kind of work that a verb asks for."""

    ROUND_TRIP = "round_trip"  # go for an object and bring it back
    SINGLE_TRIP = "single_trip"  # carry an object somewhere
    PICK = "pick"  # take hold of an object
    PLACE = "place"  # set an object down
    FIND = "find"  # look for an object
    GO = "go"  # go somewhere
    CHECK = "check"  # see whether something is so
    WAIT = "wait"  # stay for a time
    CHARGE = "charge"  # charge the battery at the dock


class PrepositionRole(enum.Enum):
    """Role of the place after a preposition."""

    SOURCE = "source"  # from there
    GOAL = "goal"  # to there
    AT = "at"  # there: where an object is or belongs, as the verb has it
    BESIDE = "beside"  # where an object is, by the objects around it
    PATH = "path"  # the route there
    FOR = "for"  # for somebody, or what is searched for


@cache
def read_table(name: str) -> Any:
    """Reads a table in this package; all scalars are text, even "on" and "no"."""
    text = resources.files(__package__).joinpath("tables", name).read_text(encoding="utf-8")
    return yaml.load(text, Loader=getattr(yaml, "CBaseLoader", yaml.BaseLoader))


class Lexicon:
    """Word lists of verbs.yaml and words.yaml by their names; phrases are tuples of lower-case words.

    `corrections` maps each phrase to True if it may be a filler; `light_nouns` maps a verb to the nouns of its light
    verb constructions ("take a picture").
    """

    def __init__(self) -> None:
        self._lists: dict[str, Any] = {**read_table("verbs.yaml"), **read_table("words.yaml")}
        kinds: dict[Phrase, set[VerbKind]] = {}
        for kind in VerbKind:
            for phrase in self._phrases(kind.value):
                kinds.setdefault(phrase, set()).add(kind)
        self.verbs = {phrase: frozenset(each) for phrase, each in kinds.items()}
        names = ("fillers", "noted", "needs", "negations")
        self.fillers, self.noted, self.needs, self.negations = map(self._phrases, names)
        roles = self._lists["prepositions"].items()
        self.prepositions = {tuple(one.split()): PrepositionRole(role) for role, each in roles for one in each}
        softness = self._lists["corrections"].items()
        self.corrections = {tuple(one.split()): name == "soft" for name, each in softness for one in each}
        self.light_nouns: Mapping[str, frozenset[str]] = {
            verb: frozenset(nouns) for verb, nouns in self._lists["light_nouns"].items()
        }
        self.short_forms: Mapping[str, str] = self._lists["short_forms"]
        self.numbers = {word: int(number) for word, number in self._lists["numbers"].items()}

    def __getattr__(self, name: str) -> Set[str]:
        if name.startswith("__"):
            raise AttributeError(name)
        words = dict.fromkeys(self._lists[name]).keys()
        setattr(self, name, words)
        return words

    def _phrases(self, name: str) -> Set[Phrase]:
        return {tuple(text.split()): None for text in self._lists[name]}.keys()


@cache
def lexicon() -> Lexicon:
    """Dictionaries that come with the package."""
    return Lexicon()


def any_of(phrases: Iterable[str]) -> str:
    """Regular expression that matches any of the phrases, the longest first."""
    return "|".join(map(re.escape, sorted(phrases, key=len, reverse=True)))


_AROUND: Final = {
    **{"before": "(?<={})", "not_before": "(?<!{})", "not": "(?!{})"},
    **{"say": "{}", "behind": "(?={})", "not_behind": "(?!{})"},
}


def expression(entry: Any) -> str:
    """Text of a regular expression in a table: a text, pieces of it, or what is said with what stands around it."""
    if isinstance(entry, str | list):
        return "".join(entry)
    texts = {name: each if name == "not_before" else [expression(each)] for name, each in entry.items()}
    return "".join(form.format(text) for name, form in _AROUND.items() for text in texts.get(name, ()))


class Patterns:
    """Regular expressions from a table, case-insensitive; each is compiled at first use.

    {name} in an expression stands for another expression in the table, or in `words`.
    """

    def __init__(self, table: str, words: Mapping[str, str] | None = None) -> None:
        self._table, self._words = table, dict(words or {})

    def __getattr__(self, name: str) -> re.Pattern[str]:
        if name.startswith("__"):
            raise AttributeError(name)
        found = self.compiled(self.text(name))
        setattr(self, name, found)
        return found

    def compiled(self, text: str) -> re.Pattern[str]:
        """Compiles an expression that is not in any table."""
        return re.compile(re.sub(r"\{([a-z_]+)\}", lambda match: self.text(match[1]), text), re.IGNORECASE)

    def mapping(self, name: str) -> tuple[tuple[str, re.Pattern[str]], ...]:
        """Expressions in a mapping, each with its name."""
        return tuple((key, self.compiled(expression(each))) for key, each in read_table(self._table)[name].items())

    def text(self, name: str) -> str:
        """Text of an expression, with the named expressions inserted."""
        if name in self._words:
            return self._words[name]
        return self.compiled(expression(read_table(self._table)[name])).pattern

    def with_words(self, **words: str) -> Patterns:
        """Copies the patterns with more words that expressions may insert."""
        return Patterns(self._table, {**self._words, **words})
