"""Styles of node states, which people without colour vision can distinguish.

Lines have the colours of Okabe and Ito, which differ for all common kinds of colour vision. Each state also has its own
symbol and line pattern. Text has a darker ink of the same hue, readable on white and on the fill.
"""

from __future__ import annotations

import enum
from dataclasses import dataclass
from typing import Final

from py_trees.common import Status

from executive.tree.node import NodeState
from skills.api import Cause


@dataclass(frozen=True)
class NodeStyle:
    """Style of a state: word, symbols (Unicode and ASCII), hex colours (line, text, fill), rich style, SVG dashes."""

    word: str
    symbol: str
    ascii: str
    line: str
    ink: str
    fill: str
    rich: str
    dashes: str = ""


class Styles(enum.Enum):
    """Styles of all states."""

    IDLE = NodeStyle("not run", "○", "[ ]", "#c4cad1", "#57606a", "#ffffff", "dim", "2 3")
    RUNNING = NodeStyle("running", "▶", "[>]", "#0072b2", "#00537f", "#e5f3fb", "bold blue", "7 3")
    SUCCESS = NodeStyle("success", "✓", "[+]", "#009e73", "#00573f", "#e6f6f1", "green")
    FAILURE = NodeStyle("failure", "✗", "[x]", "#d55e00", "#8f3f00", "#fdeee3", "bold red")
    EXPECTED = NodeStyle("found nothing", "–", "[-]", "#57606a", "#424a53", "#f1f3f5", "dim", "5 4")
    CANCELLED = NodeStyle("cancelled", "⊘", "[/]", "#cc79a7", "#84305d", "#faeef5", "magenta", "9 3 2 3")


ROBOT_COLOURS: Final = ("#0072b2", "#e69f00", "#009e73", "#cc79a7", "#56b4e9", "#d55e00")
"""Colours of several robots, in the order of their names; the name always stands beside the colour."""


def rgb_of(colour: str) -> tuple[int, int, int]:
    """Converts a hex colour to red, green and blue, 0 to 255."""
    red, green, blue = bytes.fromhex(colour.removeprefix("#"))
    return red, green, blue


def style_of(state: NodeState) -> NodeStyle:
    """Returns the style of a state."""
    if state.status is Status.INVALID:
        styles = Styles.CANCELLED if state.cause is Cause.CANCELLED else Styles.IDLE
    else:
        styles = Styles.EXPECTED if state.expected else _BY_STATUS[state.status]
    style: NodeStyle = styles.value
    return style


_BY_STATUS = {Status.RUNNING: Styles.RUNNING, Status.SUCCESS: Styles.SUCCESS, Status.FAILURE: Styles.FAILURE}
