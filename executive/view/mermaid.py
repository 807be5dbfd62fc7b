"""The tree as a Mermaid flowchart, which many documentation systems draw."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from executive.tree.node_view import NodeView
from executive.view.styles import NodeStyle, Styles, style_of
from executive.view.text import note_of, printable

_SAFE: Final = frozenset("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789 .,:()-_/+'")


def to_mermaid(root: NodeView) -> str:
    """The tree from left to right: a box for each node, with its state as symbol, colour and line, and its cause."""
    return "\n".join(["flowchart LR", *_nodes(root), *_classes(), ""])


def _nodes(root: NodeView) -> Iterator[str]:
    numbers = {id(node): number for number, (_, node) in enumerate(root.walk())}
    for _, node in root.walk():
        number = numbers[id(node)]
        yield f'  n{number}["{_label(node)}"]:::{_class(style_of(node.state))}'
        for child in node.children:
            yield f"  n{number} --> n{numbers[id(child)]}"


def _label(node: NodeView) -> str:
    title = node.name if node.kind == "skill" else f"{node.kind} {node.name}"
    folded = f"({node.hidden} nodes below)" if node.hidden else ""
    rows = filter(None, (f"{style_of(node.state).symbol} {title}", note_of(node), folded))
    return "<br/>".join(map(escaped, rows))


def escaped(text: str) -> str:
    """The text, with a character reference for every character that Mermaid might read as syntax."""
    return "".join(char if char in _SAFE else f"#{ord(char)};" for char in printable(text))


def _classes() -> Iterator[str]:
    for member in Styles:
        style: NodeStyle = member.value
        dashes = f",stroke-dasharray:{style.dashes}" if style.dashes else ""
        width = 3 if member is Styles.FAILURE else 2
        colours = f"fill:{style.fill},stroke:{style.line},color:{style.ink}"
        yield f"  classDef {_class(style)} {colours},stroke-width:{width}px{dashes}"


def _class(style: NodeStyle) -> str:
    return style.word.replace(" ", "")
