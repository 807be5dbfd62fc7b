"""Tells sentences of plain commands from those that need the rest of this package, which is loaded only for them."""

from __future__ import annotations

import re
from typing import Final

__all__ = ["mentions_structure"]

_MENTIONED: Final = re.compile(
    r"\b(?:is it|are you|house|whole|everywhere|all over|move|if|unless|in case|otherwise|else|every|each|all"
    r"|everyone|everybody|twice|times|once|while|as long as|until"
    r"|till|soon|when|wait|stay|say|tell|announce|ask|greet|know|inform|remind|whatever|matter|regardless|failing|fail"
    r"|fails|door|battery|charge|percent|repeat|holding|report|provided)\b",
    re.IGNORECASE,
)


def mentions_structure(text: str) -> bool:
    """Whether anything in it may decide, repeat, wait, say or ask; else it is a sentence of plain commands."""
    return _MENTIONED.search(text) is not None
