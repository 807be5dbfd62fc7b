"""Guarded reading of texts from outside: what somebody types, says, or sends as JSON."""

from __future__ import annotations

import json
import unicodedata
from typing import Any, Final

from skills.files.errors import InputError

__all__ = ["LONGEST_ANSWER", "LONGEST_TEXT", "json_object", "plain_text"]

LONGEST_TEXT: Final = 2000
LONGEST_ANSWER: Final = 300
"""Letters of an answer, so that a sentence with it can still be said."""
_BLANKS: Final = frozenset("\t\n\r")
_SHOWN: Final = 40


def plain_text(text: str, *, what: str, longest: int = LONGEST_TEXT) -> str:
    """A text without blanks around it; `what` names it in the error, as in "the answer".

    Raises:
        InputError: it is too long, or holds control characters or halves of characters.
    """
    if len(text) > longest:
        hint = f"{longest} letters at most"
        raise InputError(f"{what} has {len(text)} letters", hint=hint)
    wrong = next(
        (letter for letter in text if letter not in _BLANKS and unicodedata.category(letter) in ("Cc", "Cs")), None
    )
    if wrong is not None:
        kind = "half of a character" if unicodedata.category(wrong) == "Cs" else "a control character"
        shown = "".join(letter if letter.isprintable() else "?" for letter in text[:_SHOWN])
        raise InputError(f"{what} '{shown}' holds {kind} (U+{ord(wrong):04X})", hint="leave it out")
    return text.strip()


def json_object(content: bytes, *, what: str, hint: str) -> dict[str, Any]:
    """The object of a JSON text; an empty one of no text. `what` names it in the error, as in "the values".

    Raises:
        InputError: it is none, is nested too deep, or holds a number or a text that cannot be used.
    """
    try:
        values = json.loads(content) if content.strip() else {}
        json.dumps(values, ensure_ascii=False).encode()  # halves of characters cannot be sent back
    except (ValueError, RecursionError):
        values = None
    if not isinstance(values, dict):
        raise InputError(f"{what} are no JSON object", hint=hint)
    return values
