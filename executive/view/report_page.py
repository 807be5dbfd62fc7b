"""The report of one run as an HTML file that needs nothing else: no scripts, pictures inside, everything escaped."""

from __future__ import annotations

import base64
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from html import escape
from typing import Final

from executive.view.page_files import PAGE_FOLDER
from executive.view.styles import NodeStyle, Styles
from executive.view.text import printable

__all__ = [
    "AnswerRow",
    "MissionRow",
    "PagePicture",
    "ReportPage",
    "ReportPart",
    "SeenRow",
    "StepRow",
    "Verdict",
    "to_report",
]

_STYLE_FILE: Final = "report.css"
_GOOD: Final = {True: Styles.SUCCESS.value, False: Styles.FAILURE.value, None: Styles.CANCELLED.value}
_UNKNOWN: Final = "?"


@dataclass(frozen=True)
class PagePicture:
    """A JPEG file and what it shows."""

    caption: str
    jpeg: bytes


@dataclass(frozen=True)
class Verdict:
    """What somebody says of the run: who, whether it is good (None: not judged), in one word, and why."""

    who: str
    good: bool | None
    word: str
    text: str


@dataclass(frozen=True)
class AnswerRow:
    """An answer: when (s), the question, the place, yes, no or what else was answered, the sentence, its picture."""

    t_s: float
    question: str
    place: str
    answer: bool | str | float | None
    sentence: str
    picture: bytes | None = None


@dataclass(frozen=True)
class SeenRow:
    """An object that was seen: when last (s), what, and where."""

    t_s: float
    name: str
    where: str


@dataclass(frozen=True)
class StepRow:
    """A step, `depth` levels in: its name, style and word, its span (s; None: not begun), and what came of it."""

    name: str
    style: NodeStyle
    word: str
    depth: int = 0
    span_s: tuple[float, float] | None = None
    message: str = ""


@dataclass(frozen=True)
class MissionRow:
    """A mission that was given out: its number, what was asked for, whose it was, how it ended (`good`: None while it
    has not), how often it was given to another robot, and the sentence of its end.
    """

    number: int
    request: str
    robot: str
    good: bool | None
    word: str
    reassigned: int
    message: str


@dataclass(frozen=True)
class ReportPart:
    """What one of several robots did, or one mission of a fleet; `colour` is the robot's (hex)."""

    title: str
    colour: str
    commands: Sequence[str]
    verdicts: Sequence[Verdict]
    steps: Sequence[StepRow]
    pictures: Sequence[PagePicture] = ()
    tree_svg: str = ""


@dataclass(frozen=True)
class ReportPage:
    """All that the page says. `request` is the sentence or the file, `facts` are pairs of a name and a value.

    With several robots, `parts` has what each did, and `missions` what was given out to them.
    """

    title: str
    request: str
    commands: Sequence[str]
    verdicts: Sequence[Verdict]
    facts: Sequence[tuple[str, str]]
    answers: Sequence[AnswerRow] = ()
    said: Sequence[tuple[float, str]] = ()
    seen: Sequence[SeenRow] = ()
    steps: Sequence[StepRow] = ()
    events: Sequence[str] = ()
    map: PagePicture | None = None
    pictures: Sequence[PagePicture] = ()
    tree_svg: str = ""
    parts: Sequence[ReportPart] = ()
    missions: Sequence[MissionRow] = ()


def to_report(page: ReportPage) -> str:
    """The page as a whole HTML document."""
    style = (PAGE_FOLDER / _STYLE_FILE).read_text(encoding="utf-8")
    parts = (
        _head(page),
        _section("Missions", _missions(page.missions)),
        *(_part(part) for part in page.parts),
        _section("Answers", _answers(page.answers)),
        _section("Said", _said(page.said)),
        _section("Seen on the way", _seen(page.seen)),
        _section("Steps", _steps(page.steps)),
        _section("What the referee noted", _list(page.events)),
        _section("Pictures", _pictures(page)),
        _tree(page.tree_svg),
    )
    return (
        '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f'<title>{_safe(page.title)} – Errand</title>\n<link rel="icon" href="data:,">\n'
        f"<style>\n{style}</style>\n</head>\n<body>\n<main>\n{''.join(parts)}</main>\n</body>\n</html>\n"
    )


def _safe(text: str) -> str:
    return escape(printable(text))


def _section(title: str, body: str) -> str:
    return f"<section>\n<h2>{title}</h2>\n{body}</section>\n" if body else ""


def _head(page: ReportPage) -> str:
    facts = "".join(f"<div><dt>{_safe(name)}</dt><dd>{_safe(value)}</dd></div>" for name, value in page.facts)
    return (
        f'<header>\n<h1>{_safe(page.title)}</h1>\n<p class="request">{_safe(page.request)}</p>\n</header>\n'
        f'{_verdicts(page.verdicts)}<dl class="facts">{facts}</dl>\n{_commands(page.commands)}'
    )


def _part(part: ReportPart) -> str:
    """What one robot did, one below another."""
    return (
        f'<section class="part" style="border-color:{part.colour}">\n<h2>{_safe(part.title)}</h2>\n'
        f"{_verdicts(part.verdicts)}{_commands(part.commands)}{_steps(part.steps)}"
        f"{_gallery(part.pictures)}{_tree(part.tree_svg)}</section>\n"
    )


def _missions(rows: Sequence[MissionRow]) -> str:
    cells = (
        f'<td class="t">{row.number}</td><td>{_safe(row.request)}</td><td>{_safe(row.robot)}</td>'
        f'<td><span class="pill {_look(row.good)}">{_safe(row.word)}</span></td>'
        f'<td class="t">{row.reassigned or ""}</td><td class="why">{_safe(row.message)}</td>'
        for row in rows
    )
    return _table(
        "<th></th><th>mission</th><th>robot</th><th>outcome</th><th>given anew</th><th>what came of it</th>", cells
    )


def _verdicts(verdicts: Sequence[Verdict]) -> str:
    return f'<div class="verdicts">\n{"".join(map(_verdict, verdicts))}</div>\n' if verdicts else ""


def _commands(commands: Sequence[str]) -> str:
    items = "".join(f"<li>{_safe(command)}</li>" for command in commands)
    return f'<details class="commands"><summary>Commands</summary><ul>{items}</ul></details>\n' if items else ""


def _verdict(verdict: Verdict) -> str:
    style = _GOOD[verdict.good]
    symbol = _UNKNOWN if verdict.good is None else style.symbol
    return (
        f'<div class="verdict {_look(verdict.good)}"><h2>{_safe(verdict.who)}</h2>'
        f'<p class="word"><span aria-hidden="true">{symbol}</span> {_safe(verdict.word)}</p>'
        f"<p>{_safe(verdict.text)}</p></div>\n"
    )


def _look(good: bool | None) -> str:
    return {True: "success", False: "failure", None: "open"}[good]


def _answers(rows: Sequence[AnswerRow]) -> str:
    if not rows:
        return ""
    return f'<div class="answers">\n{"".join(map(_answer, rows))}</div>\n'


def _answer(row: AnswerRow) -> str:
    place = f'<span class="place">{_safe(row.place)}</span>' if row.place else ""
    picture = "" if row.picture is None else _image(PagePicture(row.sentence, row.picture))
    return (
        f'<article class="answer"><div><p class="when">{_when(row.t_s)} {place}</p>'
        f'<h3>{_safe(_question(row.question))}</h3>{_answer_word(row.answer)}<p class="told">{_safe(row.sentence)}</p>'
        f"</div>{picture}</article>\n"
    )


def _question(text: str) -> str:
    return text if text.endswith("?") else f"{text}?"


def _answer_word(answer: bool | str | float | None) -> str:
    if isinstance(answer, bool):
        return f'<p class="pill {"success" if answer else "open"}">{"yes" if answer else "no"}</p>'
    return '<p class="pill open">no answer</p>' if answer is None else f'<p class="pill open">{_safe(str(answer))}</p>'


def _said(rows: Sequence[tuple[float, str]]) -> str:
    return _table("", (f'<td class="t">{_when(t_s)}</td><td>“{_safe(text)}”</td>' for t_s, text in rows))


def _seen(rows: Sequence[SeenRow]) -> str:
    cells = (
        f'<td class="t">{_when(row.t_s)}</td><td>{_safe(row.name)}</td><td>{_safe(row.where)}</td>' for row in rows
    )
    return _table("<th>time</th><th>object</th><th>where</th>", cells)


def _steps(rows: Sequence[StepRow]) -> str:
    cells = (
        f'<td class="step" style="padding-left:{0.6 + 1.4 * row.depth:.1f}em">'
        f'<span class="mark" style="color:{row.style.line}" aria-hidden="true">{row.style.symbol}</span> '
        f"{_safe(row.name)}</td><td>{_safe(row.word)}</td>"
        f'<td class="t">{_span(row.span_s)}</td><td class="why">{_safe(row.message)}</td>'
        for row in rows
    )
    return _table('<th>step</th><th>status</th><th class="t">time</th><th>what came of it</th>', cells)


def _table(head: str, rows: Iterable[str]) -> str:
    body = "".join(f"<tr>{row}</tr>\n" for row in rows)
    top = f"<thead><tr>{head}</tr></thead>\n" if head else ""
    return f'<div class="scroll"><table>\n{top}<tbody>\n{body}</tbody></table></div>\n' if body else ""


def _list(texts: Sequence[str]) -> str:
    items = "".join(f"<li>{_safe(text)}</li>\n" for text in texts)
    return f"<ul>\n{items}</ul>\n" if items else ""


def _pictures(page: ReportPage) -> str:
    whole = "" if page.map is None else f'<div class="map">{_image(page.map, caption=True)}</div>\n'
    return whole + _gallery(page.pictures)


def _gallery(pictures: Sequence[PagePicture]) -> str:
    images = "".join(_image(picture, caption=True) for picture in pictures)
    return f'<div class="pictures">{images}</div>\n' if images else ""


def _image(picture: PagePicture, *, caption: bool = False) -> str:
    data = base64.b64encode(picture.jpeg).decode()
    image = f'<img src="data:image/jpeg;base64,{data}" alt="{_safe(picture.caption)}">'
    return f"<figure>{image}<figcaption>{_safe(picture.caption)}</figcaption></figure>" if caption else image


def _tree(svg: str) -> str:
    """The tree's picture, as `executive.view.svg` draws it, which escapes all texts itself."""
    return (
        f'<details class="tree"><summary>Behaviour tree</summary><div class="scroll">{svg}</div></details>\n'
        if svg
        else ""
    )


def _when(t_s: float) -> str:
    minutes, seconds = divmod(max(0.0, t_s), 60.0)
    return f"{int(minutes)}:{seconds:04.1f}"


def _span(span_s: tuple[float, float] | None) -> str:
    return "" if span_s is None else f"{_when(span_s[0])}–{_when(span_s[1])}"
