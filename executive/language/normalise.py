"""Cleaning of what was typed or heard, before it is parsed."""

from __future__ import annotations

import re
import unicodedata
from typing import Final

from executive.language.lexicon import lexicon

__all__ = ["MAX_WORDS", "clean", "open_commands"]

MAX_WORDS: Final = 60
_APART: Final = re.compile(r" ((?:n't|'(?:m|s|d|re|ve|ll))\b)", re.IGNORECASE)
_ALLOWED: Final = re.compile(r"[^\w\s,.;:!?'\-]|_")


def clean(text: str) -> str:
    """The sentence in plain characters: no control characters, brackets or pictures, and single blanks.

    Quotes become plain, and short forms stand in one piece ("i 'm" becomes "i'm").
    """
    plain = unicodedata.normalize("NFKC", text).replace("\u2019", "'").replace("\u2018", "'")
    printable = "".join(" " if unicodedata.category(c).startswith(("C", "S", "Z")) else c for c in plain)
    spaced = " ".join(_ALLOWED.sub(" ", printable).split())
    return _APART.sub(r"\1", spaced)


def open_commands(text: str) -> str:
    """Turn polite forms into plain commands: "could you please get it" becomes "get it".

    Where such a form stands inside the sentence, a comma takes its place. "I would like something to drink" becomes
    "bring me a drink".
    """
    requests = "|".join(map(re.escape, lexicon().requests))
    text = re.sub(r"^\W*(please\s+)?robot\b[\s,]*", r"\1", text, flags=re.IGNORECASE)
    text = re.sub(rf"\b(?:{requests})\s+(?!you\b|to\b)", ", bring me ", text, flags=re.IGNORECASE)
    text = re.sub(r"\b(?:something|anything) to (?=\w)", "a ", text, flags=re.IGNORECASE)
    openers = "|".join(map(re.escape, lexicon().openers))
    text = re.sub(rf"(?:(?:\b(?:{openers}))\b[\s,]*)+", _break, text, flags=re.IGNORECASE)
    return text.strip(" ,;:-.")


def _break(match: re.Match[str]) -> str:
    """What stands in an opener's place: a comma, unless there is one or the sentence ends."""
    return ", " if match.string[: match.start()].strip() and match.string[match.end() :].strip(" .!?") else " "
