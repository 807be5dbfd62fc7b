"""Remarks about the run itself: stop, wait, go on, cancel, where are you, what are you doing."""

from __future__ import annotations

import enum
import re
from collections.abc import Mapping
from functools import cache
from typing import Final

from executive.language.lexicon import read_table

__all__ = ["Remark", "remark_of"]


class Remark(enum.Enum):
    """What such a remark asks for."""

    STOP = "stop"  # stand still at once
    WAIT = "wait"  # pause
    GO_ON = "go_on"  # go on after a pause or a stop
    CANCEL = "cancel"  # give the mission up
    WHERE = "where"  # where the robot is
    DOING = "doing"  # what it is doing, and why
    ABLE = "able"  # what it can do
    THANKS = "thanks"  # nothing


def remark_of(text: str) -> Remark | None:
    """The remark that a whole sentence is; None when it is something else, such as a request."""
    words = _plain(text[:_MOST_LETTERS])
    return _remarks().get(words) or _remarks().get(_POLITE.sub("", words).strip())


def _plain(text: str) -> str:
    """Lower case, without punctuation."""
    return " ".join(re.sub(r"[^\w\s']", " ", text.lower().replace("’", "'")).split())


@cache
def _remarks() -> Mapping[str, Remark]:
    remarks = read_table("remarks.yaml").items()
    return {" ".join(phrase.split()): Remark(name) for name, phrases in remarks for phrase in phrases}


_MOST_LETTERS: Final = 200
_POLITE: Final = re.compile(
    r"^(?:(?:please|ok|okay|hey|now|so|well|and|but|no|oh|right|just|robot|can you|could you|would you|will you"
    r"|can you tell me|could you tell me|i want you to|i'd like you to|tell me|say)\b\s*)+(?=\w)"
    r"|\s+(?:please|now|robot|then|again|for now|right now|at once|immediately|thank you|thanks|for a moment)$"
)
