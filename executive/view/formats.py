"""Writes the tree in formats of other programs: SVG, Mermaid, and the XML of BehaviorTree.CPP."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Final
from xml.etree.ElementTree import Element, SubElement

from executive.tree.node_view import NodeView, Port
from executive.view.html import render
from executive.view.text import NodeStyle, Styles, note_of, printable, style_of

BOX_W: Final = 430
BOX_H: Final = 40
NOTE_LINE_H: Final = 14
INDENT: Final = 26
ROW_GAP: Final = 8
MARGIN: Final = 20
TITLE_H: Final = 34
LEGEND_H: Final = 34
LEGEND_W: Final = 105
NAME_EM: Final = (BOX_W - 48) / 12.5
NOTE_EM: Final = (BOX_W - 48) / 10.5
NOTE_LINES: Final = 3
_SIZES: Final = {
    "box_w": BOX_W,
    "box_h": BOX_H,
    "note_h": NOTE_LINE_H,
    "indent": INDENT,
    "margin": MARGIN,
    "legend_w": LEGEND_W,
}
_NARROW: Final = frozenset(" !'(),-./:;I[]fijlrt|›")
_BROAD: Final = frozenset("%+<=>@MWmw~—…")


def fit_text(text: str, width_em: float, most: int = 1) -> tuple[str, ...]:
    """Wraps a text to at most `most` lines of `width_em` (in units of the font's size) of a common sans-serif font."""
    lines, words = [""], re.findall(r"\S+\s*", printable(text))
    for word in words:
        for piece in [word] if _width_em(word) <= width_em else list(word):
            if lines[-1] and _width_em(lines[-1] + piece.rstrip()) > width_em:
                lines.append("")
            lines[-1] += piece
    if len(lines) <= most:
        return tuple(line.rstrip() for line in lines if line)
    last = lines[most - 1].rstrip()
    while last and _width_em(f"{last} …") > width_em:
        last = last[:-1]
    return (*(line.rstrip() for line in lines[: most - 1]), f"{last.rstrip()} …")


def _width_em(text: str) -> float:
    """Upper bound of the width of a text, in units of the font's size."""
    return sum(
        0.42 if char in _NARROW else 1.0 if char in _BROAD or ord(char) > 0x2E7F else 0.8 if char.isupper() else 0.65
        for char in text
    )


@dataclass(frozen=True)
class _Box:
    """Box for a node: upper left corner, height, note, and the boxes of its children."""

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
        return next(iter(fit_text(self.node.name, NAME_EM)), "")

    @property
    def tooltip(self) -> list[str]:
        return [text for text in (self.node.path_id, self.node.label, self.style.word, note_of(self.node)) if text]

    def walk(self) -> Iterator[_Box]:
        yield self
        for child in self.children:
            yield from child.walk()


def to_svg(root: NodeView, *, title: str = "") -> str:
    """Draws the tree as an SVG document with a legend; notes have at most three lines, tooltips have the whole note."""
    box, bottom = _laid_out(root, MARGIN, MARGIN + TITLE_H)
    boxes = list(box.walk())
    width = max(MARGIN + len(Styles) * LEGEND_W, *(each.x + BOX_W + MARGIN for each in boxes))
    return render(
        "tree.svg",
        boxes=boxes,
        height=bottom + LEGEND_H + MARGIN,
        width=width,
        title=next(iter(fit_text(title or root.name, (width - 2 * MARGIN) / 18)), ""),
        styles=[style.value for style in Styles],
        size=_SIZES,
    )


def _laid_out(node: NodeView, x: float, y: float) -> tuple[_Box, float]:
    """Lays out a node and, indented below it, its descendants; returns its box, and the height for the next box."""
    told = ". ".join(filter(None, (node.policy, note_of(node))))
    note = fit_text(told, NOTE_EM, NOTE_LINES) if told else ()
    height = BOX_H + NOTE_LINE_H * len(note)
    children: list[_Box] = []
    below = y + height + ROW_GAP
    for child in node.children:
        box, below = _laid_out(child, x + INDENT, below)
        children.append(box)
    return _Box(node, x, y, height, note, tuple(children)), below


_SAFE: Final = frozenset("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789 .,:()-_/+'")


def to_mermaid(root: NodeView) -> str:
    """Writes the tree as a Mermaid flowchart from left to right, with the state, cause and message of each node."""
    numbers = {id(node): number for number, (_, node) in enumerate(root.walk())}
    lines = ["flowchart LR"]
    for _, node in root.walk():
        number = numbers[id(node)]
        lines.append(f'  n{number}["{_label(node)}"]:::{_class(style_of(node.state))}')
        lines += [f"  n{number} --> n{numbers[id(child)]}" for child in node.children]
    return "\n".join([*lines, *_classes(), ""])


def _label(node: NodeView) -> str:
    folded = f"({node.hidden} nodes below)" if node.hidden else ""
    rows = filter(None, (f"{style_of(node.state).symbol} {node.label}", note_of(node), folded))
    return "<br/>".join(map(mermaid_text, rows))


def mermaid_text(text: str) -> str:
    """Escapes every character that Mermaid might read as syntax by a character reference."""
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


FORMAT: Final = "4"
_RESERVED: Final = frozenset({"ID", "name"})
_BUILT_IN_NAMES: Final = """
    Root BehaviorTree TreeNodesModel SubTree Action Condition Control Decorator
    Sequence AsyncSequence SequenceWithMemory ReactiveSequence Fallback AsyncFallback ReactiveFallback
    Parallel ParallelAll IfThenElse WhileDoElse Switch2 Switch3 Switch4 Switch5 Switch6 ManualSelector
    Inverter Repeat Delay RetryUntilSuccessful KeepRunningUntilFailure ForceFailure ForceSuccess RunOnce Timeout
    Precondition LoopInt LoopBool LoopDouble LoopString SkipUnlessUpdated WaitValueUpdate ConsumeQueue
    AlwaysFailure AlwaysSuccess Script ScriptCondition SetBlackboard UnsetBlackboard Sleep TestNode WasEntryUpdated
"""
_TAKEN: Final = frozenset(re.findall(r"\w+", _BUILT_IN_NAMES))


def to_btcpp(root: NodeView) -> str:
    """Writes the tree as an XML document for Groot2.

    Sequences and selectors become `Sequence` and `Fallback`. Every other node has its own name in explicit form, and
    the `TreeNodesModel` lists its ports. Each step of the mission is a tree of its own, so that the editor can fold it.
    The description of a node has its state, cause, path id and source line.
    """
    parts = _parts(root)
    steps = {id(node): tree_id for node, tree_id in parts}
    main = _identifier(root.name)
    document = Element("root", {"BTCPP_format": FORMAT, "main_tree_to_execute": main})
    _tree(document, main, root, steps)
    for node, tree_id in parts:
        _tree(document, tree_id, node, steps)
    document.append(_models(root, list(steps.values())))
    ElementTree.indent(document)
    return ElementTree.tostring(document, encoding="unicode", xml_declaration=True) + "\n"


def _parts(root: NodeView) -> list[tuple[NodeView, str]]:
    """Returns the mission's guards and steps, each with a unique name.

    The mission is the root or the node below the guards; its path id has two parts.
    """
    missions = [node for _, node in root.walk() if node.path_id.count("/") == 1]
    parents = {id(node): node for node in (root, *missions)}
    parts: list[tuple[NodeView, str]] = []
    taken = {_identifier(root.name)}
    for child in (child for parent in parents.values() for child in parent.children):
        if child.children and id(child) not in parents:
            name = _identifier(child.path_id.rsplit("/", 1)[-1], "Step")
            names = (name, *(f"{name}{number}" for number in range(2, len(taken) + 2)))
            parts.append((child, next(each for each in names if each not in taken)))
            taken.add(parts[-1][1])
    return parts


def _tree(document: Element, tree_id: str, node: NodeView, steps: Mapping[int, str]) -> None:
    tree = SubElement(document, "BehaviorTree", {"ID": tree_id})
    tree.append(_element(node, {key: name for key, name in steps.items() if key != id(node)}))


def _element(node: NodeView, steps: Mapping[int, str]) -> Element:
    category, model = _category(node), _model_id(node)
    own = {} if node.behaviour.control else {"ID": model}
    ports = {name: _value(port) for name, port in _named(node.ports) if port.value} if own else {}
    element = Element(category, {**own, "name": printable(node.name), **ports, "_description": _description(node)})
    for child in node.children:
        if id(child) in steps:
            attributes = {"ID": steps[id(child)], "name": printable(child.name), "_autoremap": "true"}
            SubElement(element, "SubTree", {**attributes, "_description": _description(child)})
        else:
            element.append(_element(child, steps))
    return element


def _category(node: NodeView) -> str:
    """Name of the XML element for a node: a built-in control node, or the category for its number of children."""
    if node.behaviour.control and node.children:
        return node.behaviour.control
    return ("Action", "Decorator", "Control")[min(len(node.children), 2)]


def _model_id(node: NodeView) -> str:
    return _identifier(node.name if node.behaviour.runs_skill else node.kind)


def _identifier(text: str, prefix: str = "Errand") -> str:
    """Returns a name that the format allows: letters and digits, first a letter, and no built-in name."""
    words = re.findall(r"[A-Za-z0-9]+", text)
    name = "".join(word[0].upper() + word[1:] for word in words) or "Unnamed"
    return name if name[0].isalpha() and name not in _TAKEN else f"{prefix}{name}"


def _named(ports: Iterable[Port]) -> Iterator[tuple[str, Port]]:
    """Yields the ports with their names in the file; an output that shares an input's name gets another name."""
    inputs = {port.name for port in ports if not port.output}
    for port in ports:
        name = re.sub(r"[^A-Za-z0-9_]", "_", port.name)
        name = f"port_{name}" if name in _RESERVED or not name[:1].isalpha() else name
        yield f"{name}_out" if port.output and port.name in inputs else name, port


def _value(port: Port) -> str:
    """Returns the value as the file writes it: a blackboard key in braces; a text, quoted if it looks like a key."""
    text = printable(port.value)
    if port.on_board:
        return f"{{{text}}}"
    return f"'{text}'" if text.startswith("{") and text.endswith("}") else text


def _description(node: NodeView) -> str:
    place = "" if node.source is None else f"{node.source.file.name}:{node.source.line}"
    state = ": ".join(filter(None, (style_of(node.state).word, note_of(node))))
    folded = f"{node.hidden} nodes below are left out" if node.hidden else ""
    return printable(" | ".join(filter(None, (state, node.path_id, place, folded))))


def _models(root: NodeView, trees: Sequence[str]) -> Element:
    """Returns a model for each kind of node that is not built in, with all ports that its nodes have."""
    models: dict[tuple[str, str], dict[str, Port]] = {}
    for _, node in root.walk():
        if not node.behaviour.control or not node.children:
            ports = models.setdefault((_category(node), _model_id(node)), {})
            ports.update(_named(node.ports))
    section = Element("TreeNodesModel")
    for (category, model), ports in sorted(models.items(), key=lambda item: item[0]):
        entry = SubElement(section, category, {"ID": model})
        for name, port in ports.items():
            kind = {"type": printable(port.type)} if port.type else {}
            SubElement(entry, "output_port" if port.output else "input_port", {"name": name, **kind})
    for tree in trees:
        SubElement(section, "SubTree", {"ID": tree})
    return section
