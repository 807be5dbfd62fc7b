"""Pages of the board: all runs in a table, and two runs side by side."""

from __future__ import annotations

from html import escape
from typing import Any, Final
from urllib.parse import quote

from nicegui import events, run, ui
from starlette.responses import FileResponse, PlainTextResponse, Response

from errand_studio import fragments
from errand_studio.layout import frame, head, panel, refused, tool
from errand_studio.runs_table import PICTURES, RunRow, RunsTable, Visit, causes, chosen, first_difference, visit
from executive.record.history import Entry
from skills.inputs.errors import InputError

MOST_ROWS: Final = 200
_HEADS: Final = ("", "claim", "mission", "world", "seed", "begun", "referee", "s", "contacts", "cause", "message", "")
_NUMBERS: Final = ("seed", "begun", "s", "contacts")
_MOST_STRIP: Final = 120
_BESIDE: Final = 12
"""Entries of the logs that are shown before and behind the first difference."""


class BoardPage:
    """Board of one browser: filters, chosen mission, ticked runs."""

    def __init__(self, table: RunsTable, mission: str) -> None:
        self._table, self._mission = table, mission
        self._rows: list[RunRow] = []
        self._ticked: list[str] = []
        self._most = MOST_ROWS

    async def build(self) -> None:
        """Builds the page, and reads the runs."""
        with panel():
            with head():
                self._words = ui.input(placeholder="filter: mission, world, seed, cause", on_change=self._draw)
                self._words.props("dense outlined clearable").style("min-width:240px")
                self._only = ui.select(["all", "failures", "successes"], value="all", on_change=self._draw)
                self._only.props("dense outlined")
                self._first = ui.checkbox("failures first", value=True, on_change=self._draw).props("dense size=xs")
                ui.element("span").classes("spring")
                self._count = ui.label("").classes("t")
                self._compare = tool("Compare", self._open_comparison, hint="Tick two runs", kind="main")
                tool("Read again", self._read)
            self._strip = ui.html("", sanitize=False)
            self._body = ui.html("", sanitize=False).classes("body wide")
        ui.on("studio", self._event)
        await self._read()

    async def _read(self) -> None:
        self._rows = await run.io_bound(self._table.rows) or []
        self._draw()

    def _draw(self) -> None:
        found = chosen(
            self._rows,
            text=str(self._words.value or ""),
            mission=self._mission,
            failures_first=bool(self._first.value),
            only=str(self._only.value),
        )
        good = sum(row.is_good for row in found)
        self._count.text = f"{len(found)} run{'s' * (len(found) != 1)}, {good} good"
        self._strip.content = strip_html(found, self._rows, self._mission)
        self._body.content = rows_html(found[: self._most], self._ticked, len(found) - self._most)
        self._compare.set_enabled(len(self._ticked) == 2)

    def _open_comparison(self) -> None:
        one, other = self._ticked
        ui.navigate.to(f"/compare?a={quote(one)}&b={quote(other)}")

    def _event(self, event: events.GenericEventArguments) -> None:
        values = event.args if isinstance(event.args, dict) else {}
        if values.get("what") == "mission":
            self._mission = "" if values.get("name") == self._mission else str(values.get("name"))
        elif values.get("what") == "tick":
            name = str(values.get("run"))
            self._ticked = [each for each in self._ticked if each != name]
            self._ticked = [*self._ticked, name][-2:] if values.get("ticked") else self._ticked
        elif values.get("what") == "more rows":
            self._most += 5 * MOST_ROWS
        else:
            return
        self._draw()


def strip_html(found: list[RunRow], rows: list[RunRow], mission: str) -> str:
    """Returns the history of a mission, the oldest run first, or the failures of all runs by cause."""
    if mission:
        history = [row for row in rows if row.mission == mission][:_MOST_STRIP]
        marks = "".join(
            f'<i data-look="{row.look}" title="{escape(f"{row.id}: {row.outcome}, {row.verdict} {row.cause}")}"></i>'
            for row in reversed(history)
        )
        back = f'<button data-mission="{escape(mission)}">all missions</button>'
        return f'<div class="strip"><b>{escape(mission)}</b>&nbsp;{marks}{back}</div>'
    counted = causes(found)
    said = "".join(f'<span class="pill" data-look="failure">{escape(cause)} {n}</span>' for cause, n in counted.items())
    return f'<div class="strip"><span class="t">failures by cause</span>{said}</div>' if said else ""


def rows_html(rows: list[RunRow], ticked: list[str], left: int) -> str:
    """Returns the table of runs."""
    if not rows:
        return '<p class="nothing">no runs here: run a mission, or change the filter</p>'
    lines = []
    for row in rows:
        begun = "" if row.begun is None else f"{row.begun:%Y-%m-%d %H:%M}"
        box = (
            f'<input type="checkbox" data-run="{escape(row.id)}" aria-label="compare"{" checked" * (row.id in ticked)}>'
        )
        state = {"success": "✓", "failure": "✗", "running": "▶", "cancelled": "⊘"}[row.look]
        lines.append(
            f'<tr data-look="{row.look}"><td>{box if row.begun else ""}</td>'
            f'<td class="state">{state} {escape(row.outcome)}</td>'
            f'<td><button data-mission="{escape(row.mission)}">{escape(row.mission)}</button></td>'
            f'<td>{escape(row.world)}</td><td class="n">{row.seed}</td><td class="n">{begun}</td>'
            f'<td>{escape(row.verdict)}</td><td class="n">{row.time_s:.1f}</td><td class="n">{row.contacts or ""}</td>'
            f'<td>{escape(row.cause)}</td><td class="dim">{escape(row.message[:160])}</td>'
            f'<td class="dim">{escape(row.source)}</td></tr>'
        )
    head = "".join(f"<th{' class=n' * (name in _NUMBERS)}>{name}</th>" for name in _HEADS)
    more = f'<p class="nothing"><button class="fix" data-do="more rows">{left} more</button></p>' if left > 0 else ""
    return f'<table class="rows"><tr>{head}</tr>{"".join(lines)}</table>{more}'


async def board_page(table: RunsTable, mission: str) -> None:
    """Builds the board."""
    frame("errand studio: board", "Board")
    await BoardPage(table, mission).build()


async def compare_page(table: RunsTable, one: str, other: str) -> None:
    """Builds the page with two runs side by side."""
    frame("errand studio: two runs", "Board")
    try:
        left, right = [await run.io_bound(visit, table, each) for each in (one, other)]
    except InputError as error:
        refused(error)
        return
    if left is not None and right is not None:
        ui.html(comparison_html(left, right), sanitize=False).classes("scroll")


def comparison_html(left: Visit, right: Visit) -> str:
    """Returns two runs side by side: results, first difference of the logs, times of the steps, trees, pictures."""
    both = (left, right)
    parts = [
        _sides("Runs", (_facts(each.row) for each in both)),
        _panel("First difference of the logs", _difference(left.entries, right.entries)),
        _panel("Time of each step, s", _times(left, right)),
        _sides("Trees", (fragments.tree_html(each.trees, deep=2) for each in both)),
    ]
    names = dict.fromkeys((*left.pictures, *right.pictures))
    parts += [
        _sides(name.partition(".")[0].replace("_", " "), (_picture(each, name) for each in both)) for name in names
    ]
    return "".join(parts)


def _panel(title: str, body: str) -> str:
    head = f'<div class="head"><h2>{escape(title)}</h2></div>'
    return f'<section class="panel" style="flex:none">{head}<div class="wide">{body}</div></section>'


def _sides(title: str, bodies: Any) -> str:
    return _panel(title, f'<div class="sides">{"".join(f"<div>{body}</div>" for body in bodies)}</div>')


def _facts(row: RunRow) -> str:
    said = f"{row.mission}, {row.world}, seed {row.seed}, {row.time_s:.1f} s"
    return (
        f'<p class="lines" data-look="{row.look}"><span class="pill">{escape(row.outcome)} {escape(row.cause)}</span> '
        f"{escape(row.verdict)}\n{escape(said)}\n{escape(row.id)}\n{escape(row.message)}</p>"
    )


def _difference(left: tuple[Entry, ...], right: tuple[Entry, ...]) -> str:
    at = first_difference(left, right)
    if at is None:
        return f'<p class="nothing">none: both logs have the same {len(left)} entries</p>'
    rows = []
    for number in range(max(0, at - _BESIDE // 2), min(max(len(left), len(right)), at + _BESIDE)):
        cells = "".join(_entry(side[number] if number < len(side) else None) for side in (left, right))
        rows.append(f"<tr{' class=differs' * (number == at)}>{cells}</tr>")
    return f'<table class="rows">{"".join(rows)}</table>'


def _entry(entry: Entry | None) -> str:
    if entry is None:
        return '<td></td><td colspan="2" class="dim">no more entries</td>'
    status = "" if entry.state is None else entry.state.status.value.lower()
    about = entry.about.rpartition("/")[2]
    return (
        f'<td class="n">{entry.t:.1f}</td><td>{escape(about)}</td><td>{escape(status)} {escape(entry.text[:200])}</td>'
    )


def _times(left: Visit, right: Visit) -> str:
    names = dict.fromkeys((*left.steps_s, *right.steps_s))
    rows = []
    for name in names:
        one, other = left.steps_s.get(name), right.steps_s.get(name)
        change = "" if one is None or other is None else f"{other - one:+.1f}"
        cells = "".join(f'<td class="n">{"" if each is None else f"{each:.1f}"}</td>' for each in (one, other))
        rows.append(f'<tr><td>{escape(name)}</td>{cells}<td class="n">{change}</td></tr>')
    head = "".join(f'<th class="n">{name}</th>' for name in ("left", "right", "change"))
    return f'<table class="rows"><tr><th>step</th>{head}</tr>{"".join(rows)}</table>'


def _picture(side: Visit, name: str) -> str:
    if name not in side.pictures:
        return '<p class="nothing">no such picture</p>'
    address = f"/picture?run={quote(side.row.id)}&name={quote(name)}"
    return f'<figure><img loading="lazy" src="{escape(address)}" alt="{escape(name)}"></figure>'


def picture(table: RunsTable, run_id: str, name: str) -> Response:
    """Sends a picture of a run."""
    try:
        file = table.folder(run_id) / name
    except InputError as error:
        return PlainTextResponse(str(error), 404)
    if not PICTURES.fullmatch(name) or not file.is_file():
        return PlainTextResponse("there is no such picture", 404)
    return FileResponse(file)
