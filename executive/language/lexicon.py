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
    return plain_yaml(resources.files(__package__).joinpath("tables", name).read_text(encoding="utf-8"))


def plain_yaml(text: str) -> Any:
    """Reads the text of a table like this package's own; all scalars are text."""
    return yaml.load(text, Loader=getattr(yaml, "CBaseLoader", yaml.BaseLoader))


ONE_WORD: Final = {ord(mark): 0xA000 + ord(mark) for mark in " ,.;:!?'-"}
"""Letters, which English has not, for the marks in a quotation: it becomes one word."""
_MARKS: Final = {letter: mark for mark, letter in ONE_WORD.items()}


def unquoted(text: str) -> str:
    """Returns a text with the words of its quotations."""
    return text.translate(_MARKS)


@cache
def word_list(name: str) -> Set[str]:
    """Returns the words, or the phrases, of a list in the order of its table."""
    return dict.fromkeys({**read_table("verbs.yaml"), **read_table("words.yaml")}[name]).keys()


class Lexicon:
    """Dictionaries of verbs.yaml and words.yaml; phrases are tuples of lower-case words.

    `corrections` maps each phrase to True if it may be a filler; `light_nouns` maps a verb to the nouns of its light
    verb constructions ("take a picture").
    """

    def __init__(self) -> None:
        verbs, words = read_table("verbs.yaml"), read_table("words.yaml")
        self.verbs: dict[Phrase, frozenset[VerbKind]] = {}
        kinds = ((kind, tuple(text.split())) for kind in VerbKind for text in verbs[kind.value])
        for one, phrase in kinds:
            self.verbs[phrase] = self.verbs.get(phrase, frozenset()) | {one}
        names = ("fillers", "noted", "needs", "negations")
        lists = ({tuple(text.split()): None for text in words[name]}.keys() for name in names)
        self.fillers, self.noted, self.needs, self.negations = lists
        roles, softness = words["prepositions"].items(), words["corrections"].items()
        self.prepositions = {tuple(one.split()): PrepositionRole(role) for role, each in roles for one in each}
        self.corrections = {tuple(one.split()): name == "soft" for name, each in softness for one in each}
        self.light_nouns = {verb: frozenset(nouns) for verb, nouns in words["light_nouns"].items()}
        self.short_forms: Mapping[str, str] = words["short_forms"]
        self.third_persons: Mapping[str, str] = verbs["third_persons"]
        self.numbers = {word: int(number) for word, number in words["numbers"].items()}


lexicon = cache(Lexicon)
"""Returns the dictionaries that come with the package."""


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
