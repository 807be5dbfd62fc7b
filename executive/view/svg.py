"""The tree as an SVG picture: from left to right, one row for each leaf, states by colour, symbol and line."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from html import escape
from typing import Final

from executive.tree.node_view import NodeView
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
FONT: Final = "DejaVu Sans, Helvetica, Arial, sans-serif"
SYMBOLS: Final[Mapping[str, str]] = {
    "not run": '<circle r="5" fill="none"/>',
    "running": '<path d="M-4,-6 L6,0 L-4,6 Z" fill="currentColor"/>',
    "success": '<path d="M-6,0 L-2,5 L6,-5" fill="none" stroke-width="2.6"/>',
    "failure": '<path d="M-5,-5 L5,5 M-5,5 L5,-5" fill="none" stroke-width="2.6"/>',
    "cancelled": '<circle r="6" fill="none"/><path d="M-4,4 L4,-4" fill="none"/>',
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

    def walk(self) -> Iterator[_Box]:
        yield self
        for child in self.children:
            yield from child.walk()


def to_svg(root: NodeView, *, title: str = "") -> str:
    """The tree as a whole SVG document, with a legend; notes are cut to three lines and stand whole in the tooltip."""
    box, bottom = _laid_out(root, MARGIN, MARGIN + TITLE_H)
    boxes = list(box.walk())
    width = max(MARGIN + len(Styles) * LEGEND_W, *(b.x + BOX_W + MARGIN for b in boxes))
    height = bottom + LEGEND_H + MARGIN
    body = [*(edge for b in boxes for edge in _edges(b)), *map(_drawn, boxes)]
    head = (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width:g}" height="{height:g}" '
        f'viewBox="0 0 {width:g} {height:g}" font-family="{FONT}">'
        f'<rect width="100%" height="100%" fill="#ffffff"/>'
        f'<text x="{MARGIN}" y="{MARGIN + 14}" font-size="16" font-weight="bold">{_safe(title or root.name)}</text>'
    )
    return "\n".join([head, *body, _legend(height - MARGIN - 6), "</svg>", ""])


def _laid_out(node: NodeView, x: float, y: float) -> tuple[_Box, float]:
    """The node's box with all below it, beginning at height y, and where the next one may begin."""
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


def _edges(box: _Box) -> Iterator[str]:
    start, bend = box.x + BOX_W, box.x + BOX_W + COLUMN_GAP / 2
    for child in box.children:
        yield (
            f'<path d="M{start:g},{box.middle:g} H{bend:g} V{child.middle:g} H{child.x:g}" fill="none" '
            f'stroke="#8c959f" stroke-width="1.4"/>'
        )


def _drawn(box: _Box) -> str:
    node, style = box.node, style_of(box.node.state)
    tooltip = "\n".join(map(printable, filter(None, (node.path_id, style.word, note_of(node)))))
    name = textwrap.shorten(printable(node.name), NAME_CHARS, placeholder="…")
    rows = "".join(
        f'<text x="12" y="{BOX_H + 8 + n * NOTE_LINE_H}" font-size="10.5" fill="{style.ink}">{escape(row)}</text>'
        for n, row in enumerate(box.note)
    )
    below = f"+ {node.hidden} nodes" if node.hidden else ""
    return (
        f'<g transform="translate({box.x:g},{box.y:g})" data-id="{_safe(node.path_id)}">'
        f"<title>{escape(tooltip)}</title>{_frame(style, box.height)}{_symbol(style, 20, 20)}"
        f'<text x="38" y="15" font-size="9" letter-spacing="0.8" fill="#57606a">{_safe(node.kind.upper())}</text>'
        f'<text x="38" y="31" font-size="12.5" fill="#1f2328">{escape(name)}</text>'
        f'<text x="{BOX_W - 10}" y="15" font-size="9" text-anchor="end" fill="#57606a">{below}</text>{rows}</g>'
    )


def _safe(text: str) -> str:
    return escape(printable(text))


def _frame(style: NodeStyle, height: float) -> str:
    dash = f' stroke-dasharray="{style.dashes}"' if style.dashes else ""
    thickness = 2.4 if style.word == "failure" else 1.4
    return (
        f'<rect width="{BOX_W}" height="{height:g}" rx="6" fill="{style.fill}" stroke="{style.line}" '
        f'stroke-width="{thickness}"{dash}/>'
    )


def _symbol(style: NodeStyle, x: float, y: float) -> str:
    return (
        f'<g transform="translate({x:g},{y:g})" stroke="{style.ink}" color="{style.ink}" stroke-width="1.8" '
        f'stroke-linecap="round" stroke-linejoin="round">{SYMBOLS[style.word]}</g>'
    )


def _legend(y: float) -> str:
    entries = [style.value for style in Styles]
    return "".join(
        f'{_symbol(style, MARGIN + 8 + n * LEGEND_W, y - 4)}<text x="{MARGIN + 22 + n * LEGEND_W}" y="{y:g}" '
        f'font-size="11" fill="#57606a">{style.word}</text>'
        for n, style in enumerate(entries)
    )
