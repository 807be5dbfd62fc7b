"""Who of several robots is meant: by name, several names, "everyone", "you two", "the other robot"."""

from __future__ import annotations

import enum
import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Final

from executive.language.lexicon import lexicon
from executive.language.questions import RefusalError
from executive.words.robots import display_name, robot_called
from skills.files.errors import listing

__all__ = ["GREETING", "VERBS", "Calls", "Whom", "calls_of", "imperative"]

GREETING: Final = r"(?:hey|hi|ok|okay|hello)(?:\s+there)?"
_NUMBERS: Final = {"two": 2, "three": 3, "four": 4, "five": 5, "six": 6, "both": 2}
_NUMBER: Final = r"(?:two|three|four|five|six)"
_ALL: Final = (
    rf"all {_NUMBER} of you|{_NUMBER} of you|(?:all|both|each|every one) of you|you {_NUMBER}|you (?:all|both|guys)"
    rf"|everyone|everybody|(?:all|both)(?: of)?(?: the)?(?: {_NUMBER})? robots|(?:the|dear) robots|(?:every|each) robot"
)
_CALLED: Final = rf"{_ALL}|robots|team|folks|all|both"
_OTHER: Final = r"the other (?:one|robot)"
_MORE_VERBS: Final = (
    "say|tell|ask|greet|announce|check|see|count|stop|report|welcome|let|show|answer|follow|do|help|clean"
)
_ODD: Final = {"goes": "go", "does": "do", "has": "have", "carries": "carry", "ferries": "ferry", "conveys": "convey"}


class Whom(enum.Enum):
    """Who does a part of a sentence, where it is no one robot by its name."""

    ALL = "all"  # each of the robots
    ANY = "any"  # whichever of them does it best: none was named


@cache
def _verbs() -> dict[str, str]:
    """The verbs by their forms: "bring" and "brings" are bring."""
    bases = {verb[0] for verb in lexicon().verbs} | set(_MORE_VERBS.split("|"))
    forms = {f"{base}{'es' if re.search('(?:s|x|z|ch|sh)$', base) else 's'}": base for base in bases}
    return {**forms, **_ODD, **{base: base for base in bases}}


def _verb_pattern() -> str:
    return rf"(?:{'|'.join(sorted(map(re.escape, _verbs()), key=len, reverse=True))})(?![\w'])"


VERBS: Final = _verb_pattern()
"""A verb in its base form, or in the third person."""


def imperative(text: str) -> str:
    """What somebody does as what is to be done: "goes to the hall and brings a coke" -> "go to the hall and bring"."""
    at_start = re.compile(rf"(^|[,.;]\s*|\b(?:and|then|or|also)\s+)(?:to\s+)?({VERBS})", re.IGNORECASE)
    return at_start.sub(lambda match: f"{match[1]}{_verbs()[match[2].lower()]}", text)


@dataclass(frozen=True)
class Calls:
    """Finds the robots `names` where they are called. `who` matches those that are to do something."""

    names: tuple[str, ...]

    @property
    def one(self) -> str:
        """A robot's name; not "Bob's"."""
        words = sorted((re.escape(name) for name in self.names), key=len, reverse=True)
        return rf"(?:{'|'.join(words)})(?![\w'-])"

    @property
    def several(self) -> str:
        """Several names: "Alice and Bob", "Alice, Bob and Eve"."""
        return rf"(?:{self.one}(?:\s*,\s*{self.one})*\s*,?\s*and\s+{self.one})"

    @property
    def who(self) -> str:
        """Who is to do something."""
        return rf"(?:{self.several}|{self.one}|(?:{_ALL})(?![\w'])|{_OTHER})"

    @property
    def called(self) -> str:
        """Who is called, set off by a comma or a greeting."""
        return rf"(?:{self.several}|{self.one}(?:\s*,\s*{self.one})+(?=\s*[,:!])|{self.one}|(?:{_CALLED})(?![\w']))"

    @property
    def called_together(self) -> str:
        """More than one, called."""
        return rf"(?:{self.several}|{self.one}(?:\s*,\s*{self.one})+(?=\s*[,:!])|(?:{_CALLED})(?![\w']))"

    def meant(self, said: str, but: Sequence[str] = ()) -> tuple[str, ...] | Whom:
        """Which robots `said` names; "the other robot" is the one that is none of `but`.

        Raises RefusalError: as many robots as it says are not there.
        """
        words = " ".join(said.lower().split())
        if re.fullmatch(_OTHER, words):
            others = tuple(name for name in self.names if name not in but)
            if len(others) != 1:
                raise RefusalError(f"which robot is '{said}'? say its name", [said])
            return others
        if re.fullmatch(_CALLED, words):
            number = next((_NUMBERS[word] for word in words.split() if word in _NUMBERS), None)
            if number is not None and number != len(self.names):
                known = listing(map(display_name, self.names))
                raise RefusalError(f"there are {len(self.names)} robots, {known}: which are '{said}'?", [said])
            return Whom.ALL
        found = re.findall(self.one, said, re.IGNORECASE)
        return tuple(dict.fromkeys(filter(None, (robot_called(name, self.names) for name in found))))


@cache
def calls_of(names: tuple[str, ...]) -> Calls:
    """The calls of these robots."""
    return Calls(names)
