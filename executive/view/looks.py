"""How a node's state looks: one word, one symbol, one colour; told apart without colour vision."""

from __future__ import annotations

import enum
from dataclasses import dataclass

from py_trees.common import Status

from executive.snapshot import NodeState
from skills.api import Cause


@dataclass(frozen=True)
class Look:
    """A state's word, symbols (Unicode and ASCII), hex colours (line, fill), and rich style."""

    word: str
    symbol: str
    ascii: str
    line: str
    fill: str
    style: str


class Looks(enum.Enum):
    """The looks of all states."""

    IDLE = Look("not run", "○", "[ ]", "#8b949e", "#ffffff", "dim")
    RUNNING = Look("running", "▶", "[>]", "#0550ae", "#ddf0ff", "bold blue")
    SUCCESS = Look("success", "✓", "[+]", "#116329", "#e3f7e8", "green")
    FAILURE = Look("failure", "✗", "[x]", "#b3261e", "#ffe8e4", "bold red")
    CANCELLED = Look("cancelled", "⊘", "[/]", "#6b3fa0", "#f3eafc", "magenta")


def look_of(state: NodeState) -> Look:
    """The look of a state."""
    if state.status is Status.INVALID:
        looks = Looks.CANCELLED if state.cause is Cause.CANCELLED else Looks.IDLE
    else:
        looks = _BY_STATUS[state.status]
    look: Look = looks.value
    return look


_BY_STATUS = {Status.RUNNING: Looks.RUNNING, Status.SUCCESS: Looks.SUCCESS, Status.FAILURE: Looks.FAILURE}
