"""The report of an evaluation as one HTML file that needs nothing else."""

from __future__ import annotations

import base64
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from html import escape
from typing import Final

from executive.app.evaluate.outcome import Evidence, Standing
from executive.app.evaluate.summary import (
    COLUMNS,
    STANDING_HEAD,
    Case,
    Comparison,
    causes_of,
    compared,
    groups_of,
    mean_work,
    standing_texts,
    time_rows,
    to_look_at,
)
from executive.view.page_files import PAGE_FOLDER
from executive.view.text import printable

__all__ = ["EvaluationPage", "to_page"]

MOST_PICTURE_BYTES: Final = 40_000_000
SIGNIFICANT: Final = 0.05
_STYLE: Final = """
.bar { display: block; position: relative; top: .35rem; height: .55rem; min-width: 8rem; }
.bar { background: var(--line); border-radius: 4px; }
.bar i { position: absolute; top: 0; bottom: 0; background: var(--success-line); opacity: .4; border-radius: 4px; }
.bar b { position: absolute; top: -2px; bottom: -2px; width: 3px; background: var(--success-line); }
.failure > summary { overflow-wrap: anywhere; } pre { overflow-x: auto; font-size: .85rem; }
.pictures { margin: .6rem 0; }
"""


@dataclass(frozen=True)
class EvaluationPage:
    """What the page is of: all cases, how the evidence of a run and the commands that repeat and show it are found.

    `facts` are pairs of a name and a value; `against` are the cases of another results file, `other` its name.
    """

    title: str
    facts: Sequence[tuple[str, str]]
    cases: Sequence[Case]
    evidence: Callable[[str], Evidence]
    commands: Callable[[Case], Sequence[str]]
    against: Sequence[Case] | None = None
    other: str = ""


def to_page(page: EvaluationPage) -> str:
    """The page as a whole HTML document."""
    style = (PAGE_FOLDER / "report.css").read_text(encoding="utf-8")
    facts = "".join(f"<div><dt>{_safe(name)}</dt><dd>{_safe(value)}</dd></div>" for name, value in page.facts)
    parts = (
        f'<header><h1>{_safe(page.title)}</h1></header>\n<dl class="facts">{facts}</dl>\n',
        _section("Success", _groups(page.cases)),
        _section("Claims against verdicts", _standings(page.cases)),
        "" if page.against is None else _section(f"Against {_safe(page.other)}", _against(page.cases, page.against)),
        _section("Causes", _causes(page.cases)),
        _section("Where the time goes", _times(page.cases)),
        _section("Runs to look at", "".join(_failures(page))),
    )
    return (
        '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f'<title>{_safe(page.title)} – Errand</title>\n<link rel="icon" href="data:,">\n'
        f"<style>\n{style}{_STYLE}</style>\n</head>\n<body>\n<main>\n{''.join(parts)}</main>\n</body>\n</html>\n"
    )


def _safe(text: str) -> str:
    return escape(printable(text))


def _section(title: str, body: str) -> str:
    return f"<section>\n<h2>{title}</h2>\n{body}</section>\n" if body else ""


def _table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table; the cells are HTML."""
    top = "".join(f"<th>{name}</th>" for name in head)
    body = "".join("<tr>" + "".join(f"<td>{cell}</td>" for cell in row) + "</tr>\n" for row in rows)
    return f'<div class="scroll"><table>\n<thead><tr>{top}</tr></thead>\n<tbody>\n{body}</tbody></table></div>\n'


def _groups(cases: Sequence[Case]) -> str:
    rows = []
    for group in groups_of(cases):
        low, high = group.rate.interval()
        bar = (
            f'<span class="bar"><i style="left:{100 * low:.1f}%;right:{100 * (1 - high):.1f}%"></i>'
            f'<b style="left:{100 * group.rate.value:.1f}%"></b></span>'
        )
        share, interval = f"{group.achieved} ({group.rate.value:.1%})", f"{low:.1%} to {high:.1%}"
        name = "" if group.dimension == "all" else group.dimension
        counts = (str(group.standings[standing]) for standing in Standing)
        rows.append((_safe(name), _safe(group.name), str(group.runs), share, interval, bar, *counts))
    heads = (COLUMNS[standing] for standing in Standing)
    return _table(("", "", "runs", "success", "95 % (Wilson)", "", *heads), rows)


def _standings(cases: Sequence[Case]) -> str:
    return _table(STANDING_HEAD, (tuple(map(_safe, row)) for row in standing_texts(cases)))


def _against(cases: Sequence[Case], other: Sequence[Case]) -> str:
    return _table(("", "", "here", "there", "only here", "only there", "p", ""), map(_row, compared(cases, other)))


def _row(found: Comparison) -> Sequence[str]:
    rates = (f"{rate.successes} of {rate.total} ({rate.value:.1%})" for rate in (found.first, found.second))
    alone = (str(found.only_first), str(found.only_second)) if found.paired else ("", "")
    verdict = "differs" if found.p < SIGNIFICANT else "may be chance"
    test = "McNemar, exact, paired" if found.paired else "Fisher, exact"
    dimension = "" if found.dimension == "all" else _safe(found.dimension)
    return dimension, _safe(found.name), *rates, *alone, f"{found.p:.3g}", f"{verdict} ({test})"


def _causes(cases: Sequence[Case]) -> str:
    found = causes_of(cases)
    if not found:
        return "<p>No run failed.</p>\n"
    sentences = ("<br>".join(f"{number} × {_safe(text)}" for text, number in row.sentences) for row in found)
    rows = ((_safe(row.cause), str(row.runs), told) for row, told in zip(found, sentences, strict=True))
    return _table(("cause", "runs", "most frequent"), rows)


def _times(cases: Sequence[Case]) -> str:
    rows = (
        (_safe(row.skill), str(row.runs), f"{row.total_s / max(1, row.runs):.1f} s", f"{row.share:.1%}")
        for row in time_rows(cases)
    )
    work = ((_safe(name), f"{mean:,.0f}") for name, mean in mean_work(cases))
    times = _table(("skill", "runs", "mean, simulated", "share of all time"), rows)
    counters = _table(("counter", "mean of a run"), work)
    return f"{times}<details><summary>Work: counters that no machine changes</summary>{counters}</details>\n"


def _failures(page: EvaluationPage) -> Iterator[str]:
    """Each run that is not claimed and fulfilled, its pictures as long as there is room."""
    room = MOST_PICTURE_BYTES
    for case in to_look_at(page.cases):
        evidence = page.evidence(case.outcome.run_id)
        size = sum(len(jpeg) for _, jpeg in evidence.pictures)
        shown = evidence.pictures if size <= room else ()
        room -= size if shown else 0
        yield _failure(case, evidence, shown, page.commands(case))


def _failure(case: Case, evidence: Evidence, pictures: Sequence[tuple[str, bytes]], commands: Sequence[str]) -> str:
    varied = f", {case.run.variation_words}" if case.run.varied else ""
    title = f"{case.asked}, {case.outcome.report.get('world')}, seed {case.run.seed}{varied}"
    told = "\n".join(map(_safe, commands))
    lines = "\n".join(f"{t_s:8.2f} s  {about}  {text}" for t_s, about, text in evidence.timeline)
    images = "".join(
        f'<figure><img src="data:image/jpeg;base64,{base64.b64encode(jpeg).decode()}" alt="{_safe(caption)}">'
        f"<figcaption>{_safe(caption)}</figcaption></figure>"
        for caption, jpeg in pictures
    )
    left_out = "<p>Its pictures are in the results file; this page has no room for more.</p>" if not pictures else ""
    return (
        f'<details class="failure"><summary><b>{_safe(case.label)}</b> {_safe(title)}: {_safe(case.why)}</summary>'
        f"<pre>{told}</pre>"
        + (f'<div class="pictures">{images}</div>' if images else left_out if evidence.pictures else "")
        + (f"<pre>{escape(lines)}</pre>" if lines else "")
        + "</details>\n"
    )
