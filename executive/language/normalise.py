"""Cleaning of what was typed or heard, before it is parsed."""

from __future__ import annotations

import re
import unicodedata
from typing import Final

__all__ = ["MAX_CHARACTERS", "MAX_WORDS", "clean", "placeholder"]

MAX_WORDS: Final = 60
MAX_CHARACTERS: Final = 800
_APART: Final = re.compile(r" ((?:n't|'(?:m|s|d|re|ve|ll))\b)", re.IGNORECASE)
_ALLOWED: Final = re.compile(r"[^\w\s,.;:!?'\-]|_")
_AND: Final = re.compile(r"(?<=\s)[&+](?=\s)")
_PERCENT: Final = re.compile(r"(?<=\d)\s?%")
_SIGNS: Final = r"$€£%#@&+=|\\/^~_{}<>\[\]"
_PLACEHOLDER: Final = re.compile(
    rf"\$?(?:(?<!\{{)\{{++[^{{}}]*+\}}+|<[^<>]*+>|\[[^\[\]]*+\])|(?<!\S)[^\s{_SIGNS}]*+[{_SIGNS}]\S*"
)  # possessive, so that the time grows with the length of a sentence and not with its square


def clean(text: str) -> str:
    """The sentence in plain characters: no control characters, brackets or pictures, and single blanks.

    Quotes become plain, and short forms stand in one piece ("i 'm" becomes "i'm").
    """
    plain = unicodedata.normalize("NFKC", _PERCENT.sub(" percent", _AND.sub("and", text)))
    plain = plain.replace("\u2019", "'").replace("\u2018", "'").replace("...", ",")
    printable = "".join(" " if unicodedata.category(c).startswith(("C", "S", "Z")) else c for c in plain)
    spaced = " ".join(_ALLOWED.sub(" ", printable).split())
    return _APART.sub(r"\1", spaced)


def placeholder(text: str) -> str | None:
    """The first piece that stands for a word which is not filled in ("${room}", "[object]", "ROOM_NAME"), or another
    piece with a sign that is no part of a sentence; None when there is none."""
    found = _PLACEHOLDER.search(_PERCENT.sub(" percent", _AND.sub("and", text)))
    return None if found is None else found[0]
