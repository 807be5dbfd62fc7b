"""Why a sentence that was not understood is perhaps no English."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Mapping
from functools import cache
from typing import Final

from executive.language.lexicon import read_table

__all__ = ["foreign_reason"]

_SHARE: Final = 0.4
_FEWEST: Final = 2
_MOST_LETTERS: Final = 2000


def foreign_reason(text: str) -> str | None:
    """One line when the letters are of another script, or the small words of another language; None else."""
    letters = [c for c in text[:_MOST_LETTERS] if c.isalpha()]
    if letters and 2 * sum("LATIN" in unicodedata.name(c, "") for c in letters) < len(letters):
        return "I understand English only, in Latin letters"
    words = re.findall(r"[^\W\d_]+(?:'[^\W\d_]+)?", text[:_MOST_LETTERS].lower())
    counts = {language: sum(word in small for word in words) for language, small in _small_words().items()}
    language, most = max(counts.items(), key=lambda item: item[1])
    if most < _FEWEST or most < _SHARE * len(words):
        return None
    return f"I understand English only, and this looks like {language}"


@cache
def _small_words() -> Mapping[str, frozenset[str]]:
    return {language: frozenset(words) for language, words in read_table("foreign.yaml").items()}
