"""Cleaning of what was typed or heard, before it is parsed."""

from __future__ import annotations

import re
import unicodedata
from typing import Final

from executive.language.rephrasing import rephrased

__all__ = ["MAX_CHARACTERS", "MAX_WORDS", "clean", "open_commands"]

MAX_WORDS: Final = 60
MAX_CHARACTERS: Final = 800
_APART: Final = re.compile(r" ((?:n't|'(?:m|s|d|re|ve|ll))\b)", re.IGNORECASE)
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
    return rephrased(text)
