"""Formats the tree as lines of text, plain or coloured, folded if it is large; defines the styles of node states.

Lines have the colours of Okabe and Ito, which differ for all common kinds of colour vision. Each state also has its own
symbol and line pattern. Text has a darker ink of the same hue, readable on white and on the fill.
"""

from __future__ import annotations

import enum
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Final

from py_trees.common import Status
from rich.text import Text

from executive.tree.node import NodeState
from executive.tree.node_view import NodeView, outline
from skills.api import Cause

MANY_NODES = 80
DRAWN_NODES = 40
_BRANCHES = ("├─ ", "└─ ", "│  ", "   ")
_ASCII_BRANCHES = ("|-- ", "`-- ", "|   ", "    ")


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


def to_text(root: NodeView, *, ascii_only: bool = False) -> str:
    """Formats the tree as plain lines."""
    text = to_rich(root, collapsed=False, ascii_only=ascii_only).plain
    return text.encode("ascii", "replace").decode() if ascii_only else text


def to_rich(root: NodeView, *, collapsed: bool = True, ascii_only: bool = False) -> Text:
    """Formats the tree with colours; `collapsed` hides the nodes below a node that succeeded or has not begun."""
    text = Text(no_wrap=True, overflow="ellipsis")
    pieces = _ASCII_BRANCHES if ascii_only else _BRANCHES
    for n, (branches, style, label, note) in enumerate(_lines(root, "", "", pieces, collapsed)):
        text.append("\n" if n else "")
        text.append(branches, style="dim")
        text.append(f"{style.ascii if ascii_only else style.symbol} {label}", style=style.rich)
        text.append(note, style="italic")
    return text


def _lines(
    node: NodeView, own: str, below: str, pieces: Sequence[str], collapsed: bool
) -> Iterator[tuple[str, NodeStyle, str, str]]:
    """Yields a line for each node, parents first: branches, style, label, and note."""
    branch, last_branch, bar, blank = pieces
    hidden = collapsed and is_closed(node)
    unseen = node.below if hidden else node.hidden
    more = "more " if node.children and not hidden else ""
    note = " ".join(filter(None, (note_of(node), f"({unseen} {more}nodes)" if unseen else "")))
    yield own, style_of(node.state), printable(node.label), f" - {printable(note)}" if note else ""
    for child in () if hidden else node.children:
        last = child is node.children[-1]
        yield from _lines(
            child, below + (last_branch if last else branch), below + (blank if last else bar), pieces, collapsed
        )


def note_of(node: NodeView) -> str:
    """Returns cause and message of a node; omits a message that a child has too."""
    state = node.state
    is_own = state.message and all(state.message != child.state.message for child in node.children)
    counts = state.cause is not None or not node.children or node.behaviour.counts
    sentence = state.message if is_own and counts else ""
    return ": ".join(filter(None, (state.cause_text, sentence)))


def is_closed(node: NodeView) -> bool:
    """Returns whether a node succeeded or has not begun, so that the nodes below it can be hidden."""
    return node.state.status in (Status.SUCCESS, Status.INVALID) and node.state.cause is None


def printable(text: str) -> str:
    """Returns the text on one line without control characters, which XML forbids and terminals obey."""
    return "".join(" " if char in "\n\r\t" else char if char.isprintable() else "\ufffd" for char in text)


def fold_below(root: NodeView, depth: int) -> NodeView:
    """Cuts the tree at `depth` levels below the root; `hidden` counts the deeper nodes.

    Raises ValueError for a negative depth.
    """
    if depth < 0:
        raise ValueError(f"a depth is at least 0, not {depth}")
    if depth == 0:
        return replace(root, children=(), hidden=root.below)
    return replace(root, children=tuple(fold_below(child, depth - 1) for child in root.children))


def fold_to(root: NodeView, most: int = MANY_NODES) -> NodeView:
    """Folds the tree to at most about `most` visible nodes.

    Subtrees that have not begun are folded first, then those that succeeded, in both cases the deepest first. The root,
    its children, and the path to each running, failed or cancelled node stay visible.
    """
    deepest = max(depth for depth, _ in root.walk())
    shown = root
    for foldable in (_idle, is_closed):
        for level in range(deepest, 0, -1):
            if sum(1 for _ in shown.walk()) <= most:
                return shown
            shown = _folded(shown, foldable, level, 0)
    return shown


def readable(root: NodeView, most: int = MANY_NODES) -> NodeView:
    """Returns the outline of a tree with at most about `most` rows.

    The mission's guards are folded. Then nodes inside steps are folded, the deepest first, before whole steps. Running,
    failed and cancelled nodes stay visible.
    """
    shown = outline(root)
    deepest = max(depth for depth, _ in shown.walk())
    for level in range(deepest, -1, -1):
        shown = _fold_below_steps(shown, level, level)
        if sum(1 for _ in shown.walk()) <= most:
            return shown
    return fold_to(shown, most)


def _fold_below_steps(row: NodeView, level: int, left: int) -> NodeView:
    """Folds guards, and closed rows over `level` levels below their step; `left` counts the levels left here."""
    shown, hidden = [], row.hidden
    for child in row.children:
        guard = child.behaviour.watches or child.behaviour.plumbing
        if not child.step and (left == 0 or guard) and all(is_closed(n) for _, n in child.walk()):
            hidden += 1 + child.below
        else:
            shown.append(_fold_below_steps(child, level, level if child.step else max(0, left - 1)))
    return replace(row, children=tuple(shown), hidden=hidden)


def executed_tree(node: NodeView, above: NodeView | None = None) -> NodeView:
    """Returns the executed nodes under their actions' names, without nodes that only pass on one child's result.

    Conditions that held and stored poses are omitted too, but no failed or cancelled node. `above` is the parent.
    """
    below = tuple(executed_tree(child, node) for child in node.children if not _is_plumbing(child))
    if len(below) == 1 and not node.step and (node.state.cause is None or node.state.message == below[0].state.message):
        return below[0]
    return replace(node, name=node.title(above), children=below, ports=())


def _is_plumbing(node: NodeView) -> bool:
    return node.state.cause is None and (node.state.status is Status.INVALID or node.behaviour.plumbing)


def _folded(node: NodeView, foldable: Callable[[NodeView], bool], level: int, depth: int) -> NodeView:
    """Folds every subtree at `level` or deeper whose nodes are all foldable."""
    if depth >= level and all(foldable(below) for _, below in node.walk()):
        return replace(node, children=(), hidden=node.below)
    return replace(node, children=tuple(_folded(child, foldable, level, depth + 1) for child in node.children))


def _idle(node: NodeView) -> bool:
    return is_closed(node) and node.state.status is Status.INVALID
