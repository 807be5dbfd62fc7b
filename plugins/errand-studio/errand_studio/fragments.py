"""HTML of the studio's panels. All texts of files are escaped here."""

from __future__ import annotations

import json
from collections.abc import Collection, Iterable, Mapping, Sequence
from html import escape
from typing import Any, Final

from errand_studio.checking import Insight, Judged, Message, PlanMap
from errand_studio.outline import Row
from errand_studio.palette import Example
from executive.app.report.run_report import VERDICTS
from executive.tree.node_view import NodeView
from executive.view.text import note_of, style_of

DRAWING: Final = '<p class="nothing">drawing …</p>'
_LOOKS: Final[Mapping[str, str]] = {"not run": "idle", "found nothing": "expected"}

_SHAPES: Final[Mapping[str, str]] = {
    "selector": "first of",
    "guard": "guarded",
    "retry": "retried",
    "only if holding": "if holding",
    "choose": "chosen",
    "afterwards": "tidied",
}
"""Names of the shapes of plans, by the kinds of their nodes."""
_EYES: Final = ("detect", "find people")


def _attributes(**values: Any) -> str:
    pairs = ((name.replace("_", "-"), value) for name, value in values.items() if value is not None)
    return "".join(f' {name}="{escape(str(value))}"' for name, value in pairs)


def outline_html(rows: Sequence[Row], marked: Mapping[int, bool], stops: Collection[int]) -> str:
    """Returns the outline. `marked` has the lines with messages (True: an error), `stops` those with breakpoints."""
    if not rows:
        return '<p class="nothing">no steps yet: choose one at the left, or say a sentence</p>'
    lines = []
    for row in rows:
        found = [error for line, error in marked.items() if not row.is_list and _own_line(row, rows, line)]
        classes = " ".join(
            ["step" if not row.is_list else "list", *(["bad"] if any(found) else ["warned"] if found else [])]
        )
        place = _attributes(
            data_path=json.dumps(row.path, separators=(",", ":")),
            data_line=row.line,
            data_end=row.end,
            data_list=int(row.is_list),
        )
        kind = f"<b>{escape(row.kind)}</b> " if row.kind else ""
        more = f' <span class="policy">{escape(row.more)}</span>' if row.more else ""
        dot = "" if row.is_list else _dot(row.line, row.line in stops)
        lines.append(
            f'<li class="{classes}" style="--depth:{row.depth}" role="treeitem" tabindex="-1" '
            f'draggable="{str(not row.is_list).lower()}"{place}>{dot}<span class="said">{kind}'
            f"{escape(row.text)}{more}</span></li>"
        )
    return f'<ul class="outline" role="tree" aria-label="Outline">{"".join(lines)}</ul>'


def _own_line(row: Row, rows: Sequence[Row], line: int) -> bool:
    """Returns whether a line belongs to a step itself and to no step inside."""
    inside = [each for each in rows if not each.is_list and each.line <= line <= each.end]
    return bool(inside) and inside[-1] is row


def _dot(line: int, stops: bool) -> str:
    said = "Remove the breakpoint" if stops else "Stop here in the next run"
    return f'<button class="dot" data-stop="{line}" aria-pressed="{str(stops).lower()}" title="{said}"></button>'


def messages_html(messages: Sequence[Message], summary: str) -> str:
    """Returns the messages of the check with buttons for replacements; the estimate if there are none."""
    rows = []
    for number, each in enumerate(messages):
        fix = ""
        if each.replacement is not None:
            fix = f' <button class="fix" data-fix="{number}">write {escape(each.replacement[1])}</button>'
        look = "failure" if each.is_error else "warning"
        hint = f'<span class="hint">{escape(each.hint)}</span>' if each.hint else ""
        rows.append(
            f'<li data-look="{look}" data-line="{each.line}" tabindex="0"><span class="t">{each.line}</span>'
            f'<span class="symbol">{"✗" if each.is_error else "!"}</span>'
            f'<span class="what">{escape(each.text)} {hint}{fix}</span></li>'
        )
    good = f'<li data-look="success"><span class="t"></span><span class="symbol">✓</span>{escape(summary)}</li>'
    return f'<ol class="messages">{"".join(rows)}{good if summary else ""}</ol>'


def tree_html(trees: Iterable[NodeView], *, deep: int = 3) -> str:
    """Returns trees as nested lists that fold; nodes below the depth `deep` are folded at first."""
    items = "".join(_node_html(tree, 0, deep) for tree in trees)
    return f'<ul class="tree">{items}</ul>' if items else '<p class="nothing">no tree: the mission has errors</p>'


def shape_of(node: NodeView) -> str:
    """Returns the name of the shape of `PlanBuilder` that a node has; its kind if it has none."""
    match node.kind, node.children:
        case "selector", (_, NodeView(kind="pause")):
            return "or stay"
        case "recover", (NodeView(kind="skill", name="navigate"), *_):
            return "navigate"
        case "sequence", (NodeView(kind="recover"), NodeView(kind="skill") as look) if look.name.startswith(_EYES):
            return "look from"
        case "afterwards", (_, NodeView(kind="skill", name="stow")):
            return "stow after"
    return _SHAPES.get(node.kind, node.kind)


def _node_html(node: NodeView, depth: int, deep: int) -> str:
    style = style_of(node.state)
    look = _LOOKS.get(style.word, style.word)
    line = None if node.source is None else node.source.line
    kind, name = ("", node.label) if node.kind in ("mission", "step") else (shape_of(node), node.name)
    said = f'<span class="kind">{escape(kind)}</span>' if kind and kind != name else ""
    note = note_of(node)
    told = f'<span class="note">{escape(note)}</span>' if note else ""
    policy = f' <span class="policy">{escape(node.policy)}</span>' if node.policy and not kind else ""
    name = node.name if not kind else name
    where = _attributes(data_line=line, data_node=node.path_id)
    row = f'<span class="symbol">{style.symbol}</span><span class="name">{said}{escape(name)}{policy}{told}</span>'
    if not node.children:
        return f'<li><div class="row leaf" data-look="{look}"{where} tabindex="0">{row}</div></li>'
    inner = "".join(_node_html(child, depth + 1, deep) for child in node.children)
    quiet = node.behaviour.watches or node.behaviour.plumbing or node.kind == "interrupt"
    opened = " open" if (depth < deep and not quiet) or look in ("failure", "running") else ""
    head = f'<summary class="row" data-look="{look}"{where}>{row}</summary>'
    return f"<li><details{opened}>{head}<ul>{inner}</ul></details></li>"


def judged_html(judged: Sequence[Judged]) -> str:
    """Returns the commands with what the referee judges."""
    if not judged:
        return '<p class="nothing">no commands</p>'
    rows = "".join(
        f'<tr{_attributes(data_line=each.line)} tabindex="0"><td class="t">{each.line or ""}</td>'
        f"<td><code>{escape(each.command)}</code></td><td>{escape(each.goal)}</td></tr>"
        for each in judged
    )
    return f'<table class="rows"><tr><th></th><th>command</th><th>the referee judges</th></tr>{rows}</table>'


def palette_html(examples: Sequence[Example]) -> str:
    """Returns a button for each kind of step."""
    return "".join(
        f'<button class="pick" data-pick="{number}" draggable="true" title="{escape(each.about)}&#10;'
        f'{escape(each.text)}">{escape(each.key)}</button>'
        for number, each in enumerate(examples)
    )


def map_svg(plan: PlanMap | None) -> str:
    """Returns the map with the planned drives as SVG in metres; each drive has the line of its step."""
    if plan is None:
        return '<p class="nothing">no map: the mission has errors</p>'
    world = plan.world
    width, height = world["size_m"]["x"], world["size_m"]["y"]
    left, low = world["origin_m"]["x"], world["origin_m"]["y"]

    def at(x: float, y: float) -> str:
        return f"{x - left:.2f},{height - (y - low):.2f}"

    grid = f'<image href="data:image/png;base64,{world["data"]}" width="{width}" height="{height}"/>'
    names = "".join(
        f'<text x="{each["x"] - left:.2f}" y="{height - (each["y"] - low):.2f}">{escape(each["name"])}</text>'
        for each in world["places"]
    )
    drives = []
    for number, (line, points) in enumerate(plan.paths, start=1):
        end_x, end_y = (float(value) for value in at(*points[-1]).split(","))
        path = " ".join(at(*each) for each in points)
        drives.append(
            f'<g class="drive"{_attributes(data_line=line)}><polyline points="{path}"/>'
            f'<circle cx="{end_x}" cy="{end_y}" r="0.2"/>'
            f'<text class="number" x="{end_x}" y="{end_y}">{number}</text></g>'
        )
    return f'<svg class="plan" viewBox="0 0 {width} {height}">{grid}{names}{"".join(drives)}</svg>'


def files_html(names: Sequence[str], opened: str) -> str:
    """Returns the list of files."""
    rows = "".join(
        f'<li{_attributes(data_file=name)} tabindex="0"{" class=chosen" if name == opened else ""}>{escape(name)}</li>'
        for name in names
    )
    return f'<ul class="files">{rows}</ul>' if rows else '<p class="nothing">no missions in this folder yet</p>'


def state_html(insight: Insight | None) -> str:
    """Returns the state of the check in one word, with its time."""
    if insight is None:
        return '<span class="pill" data-look="idle">checking</span>'
    warnings = len(insight.messages) - insight.errors
    look = "failure" if insight.errors else "success"
    said = f"{insight.errors} error{'s' * (insight.errors != 1)}" if insight.errors else "checked"
    said += f", {warnings} warning{'s' * (warnings != 1)}" if warnings else ""
    return f'<span class="pill" data-look="{look}">{said}</span> <span class="t">{insight.took_s * 1e3:.0f} ms</span>'


def lines_html(lines: Sequence[str], note: str) -> str:
    """Returns the last lines of a run."""
    return f'<pre class="lines">{escape(chr(10).join([*lines, *filter(None, [note])]))}</pre>' if lines or note else ""


def run_html(name: str, result: Mapping[str, Any] | None, *, goes_on: bool) -> str:
    """Returns the state of a run: that it goes on, or what was claimed and what the referee saw."""
    if result is None:
        look, said = ("running", "runs") if goes_on else ("failure", "did not begin, or was killed")
    else:
        success = (result.get("referee") or {}).get("success")
        look = "success" if result.get("outcome") == "success" and success is not False else "failure"
        said = f"{result.get('outcome')} {result.get('cause') or ''}; the referee: {VERDICTS[success]}"
    return f'<span class="pill" data-look="{look}">{escape(name)}: {escape(said)}</span>'
