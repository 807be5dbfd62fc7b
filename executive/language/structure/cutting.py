"""A sentence in clauses, each with the word that says how it goes on from the one before: "if", "otherwise"."""

from __future__ import annotations

import enum
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Any, Final

from executive.language.items import Item
from executive.language.lexicon import Patterns, lexicon, read_table
from executive.language.structure.amounts import AMOUNTS, SPAN, TIMES

__all__ = [
    "ACTS",
    "CLAUSES",
    "Behind",
    "Clause",
    "Kind",
    "behind",
    "cut",
    "opens",
    "reworded",
    "spoken",
    "verb_positions",
]


CLAUSES: Final = Patterns("structures.yaml", words=AMOUNTS)
ACTS: Final = Patterns("structures.yaml", "acts", AMOUNTS)


class Kind(enum.Enum):
    """How a clause goes on from the one before."""

    FAILED = "failed"  # "if that fails"
    SO = "so"  # "if so"
    NOT = "not"  # "if not"
    OTHERWISE = "otherwise"
    UNLESS = "unless"
    SOON = "soon"  # "as soon as"
    IF = "if"
    EVERY = "every"  # "every ten minutes"
    TIMES = "times"  # "three times"
    WHILE = "while"  # "as long as"
    UNTIL = "until"


@dataclass(frozen=True)
class Clause:
    """A clause: what joins it to the one before, its first words where those have a kind, and the others.

    `lead` are items that were left out before it, its verb among them.
    """

    joint: str
    text: str
    kind: Kind | None = None
    cue: str = ""
    lead: tuple[Item, ...] = ()

    @property
    def begins(self) -> bool:
        """Whether a sentence begins with it."""
        return re.search(r"[.!?;]", self.joint) is not None

    @property
    def outer(self) -> bool:
        """Whether it is done after all of the clauses before."""
        return CLAUSES.outer.search(self.joint) is not None

    @property
    def anyway(self) -> bool:
        """Whether it is done at the end whatever happens."""
        return CLAUSES.whatever.search(self.joint) is not None

    @property
    def then(self) -> bool:
        """Whether "then" stands before it."""
        return re.search(r"\bthen\b", self.joint, re.IGNORECASE) is not None


@dataclass(frozen=True)
class Behind:
    """What stands behind what is to be done (`before`): its kind, its first words and the others."""

    before: str
    kind: Kind
    cue: str
    text: str


@cache
def _table() -> Mapping[str, Any]:
    return read_table("structures.yaml")


def _filled(text: str) -> str:
    return text.replace("{span}", SPAN).replace("{times}", TIMES)


@cache
def _joint() -> re.Pattern[str]:
    polite = "|".join(map(re.escape, lexicon().openers))
    words = "|".join((_table()["outer"], _table()["whatever"], _table()["joints"], polite))
    return re.compile(rf"(?:[\s,;.!?:]+|(?<![\w'])(?:{words})(?![\w']))+", re.IGNORECASE)


@cache
def _verbs() -> frozenset[str]:
    return frozenset({first for first, *_ in lexicon().verbs} | set(_table()["openers"]))


@cache
def _kinds() -> tuple[tuple[Kind, re.Pattern[str]], ...]:
    verbs = "|".join(sorted(_verbs(), key=len, reverse=True))
    ends = rf"(?=\s*(?:$|[,;:]|\b(?:then|please|just|{verbs})\b))"
    closed = {Kind.FAILED, Kind.SO, Kind.NOT}
    return tuple(
        (kind, re.compile(rf"{_filled(text)}(?![\w']){ends if kind in closed else ''}", re.IGNORECASE))
        for kind in Kind
        for text in _table()["kinds"][kind.value]
    )


@cache
def _behind() -> tuple[tuple[Kind, re.Pattern[str]], ...]:
    return tuple(
        (Kind(kind), re.compile(rf"(?<![\w'])(?:{_filled(text)})(?![\w'])", re.IGNORECASE))
        for kind, text in _table()["behind"].items()
    )


_ONE_VERB: Final = re.compile(r"(?:^|[\s,])(?:go|come|run|say)$", re.IGNORECASE)
"""Behind these "and" and "please" join no other clause: "go and charge"."""
_ELSE: Final = re.compile(r"(?:or )?(?:else|otherwise)\b", re.IGNORECASE)
_SOME: Final = re.compile(r"(?:some|any|every|no|body|thing|one|where|what|who)$", re.IGNORECASE)


def reworded(text: str) -> str:
    """The sentence in words that its clauses can be told by."""
    for spoken_so, meant in _table()["reworded"]:
        text = re.sub(_filled(spoken_so), meant, text, flags=re.IGNORECASE)
    return text


def opens(text: str) -> bool:
    """Whether a clause begins with these words."""
    word = re.match(r"[\w']+", text)
    return word is not None and (word[0].lower() in _verbs() or _kind(text) is not None)


def _kind(text: str) -> tuple[Kind, str] | None:
    found = ((kind, match) for kind, each in _kinds() if (match := each.match(text)) is not None)
    return next(((kind, match[0]) for kind, match in found), None)


def cut(text: str) -> tuple[Clause, ...]:
    """The clauses of a sentence, or of several, in order."""
    cuts = list(_cuts(text))
    found = [_clause(text, joint, next_start) for joint, next_start in zip(cuts, _ends(cuts, text), strict=True)]
    return tuple(clause for clause in found if clause.text or clause.cue)


def _cuts(text: str) -> Iterator[tuple[int, int]]:
    """Where what joins two clauses begins and ends."""
    first = _joint().match(text)
    yield (0, first.end() if first is not None else 0)
    for match in _joint().finditer(text, first.end() if first is not None else 0):
        joined = match[0].strip() != "" or (_ELSE.match(text, match.end()) and not _SOME.search(text[: match.start()]))
        sentence = re.search(r"[.!?;](?:\s|$)", match[0]) is not None
        if match[0].strip().lower() in ("and", "please") and _ONE_VERB.search(text[: match.start()]):
            continue
        if joined and (sentence or opens(text[match.end() :])):
            yield match.span()


def _ends(cuts: Sequence[tuple[int, int]], text: str) -> Iterable[int]:
    return [*(start for start, _ in cuts[1:]), len(text)]


def _clause(text: str, joint: tuple[int, int], end: int) -> Clause:
    start = joint[1]
    clause = Clause(text[joint[0] : start], text[start:end].strip(" ,;.!?:"))
    kind = _kind(clause.text)
    if kind is None:
        return clause
    rest = clause.text[len(kind[1]) :].strip(" ,;:")
    return replace(clause, kind=kind[0], cue=kind[1], text=re.sub(r"^then\s+", "", rest, flags=re.IGNORECASE))


def behind(text: str) -> Behind | None:
    """The first thing that stands behind what is to be done in a clause, so that it decides or repeats that."""
    found = [(match.start(), kind, match) for kind, each in _behind() for match in each.finditer(text, 1)]
    found = [one for one in found if not _asked(text[: one[0]], one[1])]
    if not found:
        return None
    start, kind, match = min(found, key=lambda one: one[0])
    return Behind(text[:start].strip(" ,"), kind, match[0], text[match.end() :].strip(" ,"))


def _asked(before: str, kind: Kind) -> bool:
    """Whether "if" behind these words asks how something stands: "check if", "ask Robin if"."""
    checks = re.compile(rf"(?:^|\b){_table()['checks']}(?: \w+)?\s*$|\bask\b[\w ]*$", re.IGNORECASE)
    return kind is Kind.IF and checks.search(before) is not None


def verb_positions(text: str) -> Iterator[int]:
    """Where, behind its first words, a clause may begin without a comma before it."""
    for match in re.finditer(r"[\w']+", text):
        if match.start() and match[0].lower() in _verbs():
            yield match.start()


def spoken(clauses: Iterable[Clause]) -> str:
    """The clauses as one text."""
    return " ".join(f"{clause.joint}{clause.cue} {clause.text}".strip() for clause in clauses).strip(" ,;.")
