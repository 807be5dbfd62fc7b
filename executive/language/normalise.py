"""Cleaning of what was typed or heard, before it is parsed."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterator, Sequence
from typing import Final

from executive.language.lexicon import lexicon

__all__ = ["MAX_CHARACTERS", "MAX_WORDS", "clean", "open_commands"]

MAX_WORDS: Final = 60
MAX_CHARACTERS: Final = 800
_APART: Final = re.compile(r" ((?:n't|'(?:m|s|d|re|ve|ll))\b)", re.IGNORECASE)
_SOMETHING: Final = {r"\b(?:something|anything) to drink\b": "a drink", r"\b(?:something|anything) to eat\b": "food"}
_LEISURE: Final = re.compile(
    r"\b(?:if|when|whenever|once|as soon as) you(?:'ve)? (?:have|get|got|find|can spare)? ?(?:a|an|the|some|any)? ?"
    r"(?:free |spare )?(?:minute|second|moment|sec|time|chance|opportunity)\b,?",
    re.IGNORECASE,
)
_FAVOUR: Final = re.compile(
    r"\b(?:i'd|i would|it would|it'd|that would|that'd|i'm|i am|we'd|we would)\s+(?:\w+\s+){1,4}if you\b"
    r"(?:\s+(?:could|can|would|might))?",
    re.IGNORECASE,
)
_WISH: Final = re.compile(
    r"^\W*(?:a|an|one|two|three|four|five|six|some|another|\d{1,2})\s+\w+.*\bplease\W*$", re.IGNORECASE
)
_ALLOWED: Final = re.compile(r"[^\w\s,.;:!?'\-]|_")


def clean(text: str) -> str:
    """The sentence in plain characters: no control characters, brackets or pictures, and single blanks.

    Quotes become plain, and short forms stand in one piece ("i 'm" becomes "i'm").
    """
    plain = unicodedata.normalize("NFKC", text).replace("\u2019", "'").replace("\u2018", "'").replace("...", ",")
    printable = "".join(" " if unicodedata.category(c).startswith(("C", "S", "Z")) else c for c in plain)
    spaced = " ".join(_ALLOWED.sub(" ", printable).split())
    return _APART.sub(r"\1", spaced)


def open_commands(text: str) -> str:
    """Turn polite forms into plain commands: "could you please get it" becomes "get it".

    Hesitations and words said twice are left out. Where a polite form stands inside the sentence, a comma takes its
    place. "I would like something to drink" becomes "bring me a drink".
    """
    text = _wished(_said_once(text))
    text = re.sub(r"^\W*(please\s+)?robot\b[\s,]*", r"\1", text, flags=re.IGNORECASE)
    for words, command in _wishes():
        text = re.sub(rf"\b(?:{_any(words)})\s+(?!you\b|to\b)", f", {command} ", text, flags=re.IGNORECASE)
    for something, thing in _SOMETHING.items():
        text = re.sub(something, thing, text, flags=re.IGNORECASE)
    text = re.sub(rf"(?:(?:\b(?:{_any(lexicon().openers)}))\b[\s,]*)+", _break, text, flags=re.IGNORECASE)
    return text.strip(" ,;:-.")


def _wishes() -> Iterator[tuple[Sequence[str], str]]:
    """The ways to say what one wants, does not want or looks for, with the command that each means."""
    yield lexicon().refusals, "do not bring"
    yield lexicon().searches, "find"
    yield lexicon().requests, "bring me"


def _said_once(text: str) -> str:
    """The text in full forms, without hesitations, and with what was said twice ("the the") said once."""
    full = lexicon().short_forms
    text = re.sub(
        rf"(?<![\w'])(?:{_any(list(full))})(?![\w'])", lambda m: full[m[0].lower()], text, flags=re.IGNORECASE
    )
    text = _FAVOUR.sub("please", _LEISURE.sub("", text))
    verbs = [" ".join(words) for words in lexicon().verbs if len(words) == 1]
    text = re.sub(rf"(?<!\bi )(?<!d )\blike,?\s+(?=(?:{_any(verbs)})\b)", "", text, flags=re.IGNORECASE)
    asides = (*lexicon().asides, *lexicon().hesitations)
    text = re.sub(rf"(?<![\w'])(?<!\d )(?:{_any(asides)})(?![\w'])[,.\s]*", " ", text, flags=re.IGNORECASE)
    return re.sub(
        r"\b(?!her her\b)(\w+(?:\s\w+){0,2})(?:[\s,]+\1\b)+", r"\1", " ".join(text.split()), flags=re.IGNORECASE
    )


def _wished(text: str) -> str:
    """A bare wish with "please" as a request: "two beers please"."""
    if not _WISH.match(text):
        return text
    return f"bring {text}" if re.search(r"\b(?:for|to)\b", text, re.IGNORECASE) else f"bring me {text}"


def _any(phrases: Sequence[str]) -> str:
    return "|".join(map(re.escape, phrases))


def _break(match: re.Match[str]) -> str:
    """What stands in an opener's place: a comma, unless there is one or the sentence ends."""
    return ", " if match.string[: match.start()].strip() and match.string[match.end() :].strip(" .!?") else " "
