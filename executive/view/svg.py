"""The tree as an SVG picture: from left to right, one row for each leaf, states by colour, symbol and line."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

from executive.tree.node_view import NodeView
from executive.view.html import render
from executive.view.styles import NodeStyle, Styles, style_of
from executive.view.text import note_of, printable

BOX_W: Final = 232
BOX_H: Final = 40
NOTE_LINE_H: Final = 13
COLUMN_GAP: Final = 34
ROW_GAP: Final = 10
MARGIN: Final = 20
TITLE_H: Final = 34
LEGEND_H: Final = 34
LEGEND_W: Final = 105
NOTE_CHARS: Final = 33
NOTE_LINES: Final = 3
NAME_CHARS: Final = 30
_SIZES: Final = {
    "box_w": BOX_W,
    "box_h": BOX_H,
    "note_h": NOTE_LINE_H,
    "gap": COLUMN_GAP,
    "margin": MARGIN,
    "legend_w": LEGEND_W,
}


@dataclass(frozen=True)
class _Box:
    """A node with its place: the left upper corner, height, and the boxes of its children."""

    node: NodeView
    x: float
    y: float
    height: float
    note: tuple[str, ...]
    children: tuple[_Box, ...]

    @property
    def middle(self) -> float:
        return self.y + self.height / 2

    @property
    def style(self) -> NodeStyle:
        return style_of(self.node.state)

    @property
    def name(self) -> str:
        return textwrap.shorten(printable(self.node.name), NAME_CHARS, placeholder="…")

    @property
    def tooltip(self) -> list[str]:
        return [text for text in (self.node.path_id, self.style.word, note_of(self.node)) if text]

    def walk(self) -> Iterator[_Box]:
        yield self
        for child in self.children:
            yield from child.walk()


def to_svg(root: NodeView, *, title: str = "") -> str:
    """The tree as a whole SVG document, with a legend; notes are cut to three lines and stand whole in the tooltip."""
    box, bottom = _laid_out(root, MARGIN, MARGIN + TITLE_H)
    boxes = list(box.walk())
    return render(
        "tree.svg",
        boxes=boxes,
        height=bottom + LEGEND_H + MARGIN,
        width=max(MARGIN + len(Styles) * LEGEND_W, *(each.x + BOX_W + MARGIN for each in boxes)),
        title=title or root.name,
        styles=[style.value for style in Styles],
        size=_SIZES,
    )


def _laid_out(node: NodeView, x: float, y: float) -> tuple[_Box, float]:
    """The box of a node and of all nodes below it from height y on, and the height at which the next one may begin."""
    note = _wrapped(note_of(node))
    height = BOX_H + NOTE_LINE_H * len(note) + (4 if note else 0)
    children: list[_Box] = []
    below = y
    for child in node.children:
        box, below = _laid_out(child, x + BOX_W + COLUMN_GAP, below)
        children.append(box)
    if not children:
        return _Box(node, x, y, height, note, ()), y + height + ROW_GAP
    middle = (children[0].middle + children[-1].middle) / 2
    top = max(y, middle - height / 2)
    return _Box(node, x, top, height, note, tuple(children)), max(below, top + height + ROW_GAP)


def _wrapped(note: str) -> tuple[str, ...]:
    return tuple(textwrap.wrap(printable(note), NOTE_CHARS, max_lines=NOTE_LINES, placeholder=" …"))
