"""The report of an evaluation as one HTML file that needs nothing else."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Final

from executive.app.evaluate.outcome import Evidence
from executive.app.evaluate.summary import (
    COLUMNS,
    STANDING_HEAD,
    Case,
    causes_of,
    compared,
    groups_of,
    mean_work,
    standing_texts,
    time_rows,
    to_look_at,
)
from executive.view.html import render

__all__ = ["EvaluationPage", "to_page"]

MOST_PICTURE_BYTES: Final = 40_000_000


@dataclass(frozen=True)
class EvaluationPage:
    """The content of the page: all cases, and functions that find the evidence and the commands of a run.

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
    cases = page.cases
    return render(
        "evaluation.html",
        page=page,
        columns=COLUMNS,
        groups=groups_of(cases),
        standing_head=STANDING_HEAD,
        standings=list(standing_texts(cases)),
        comparisons=None if page.against is None else compared(cases, page.against),
        causes=causes_of(cases),
        times=time_rows(cases),
        work=mean_work(cases),
        to_look_at=list(_with_evidence(page)),
    )


def _with_evidence(page: EvaluationPage) -> Iterator[tuple[Case, Evidence, bool]]:
    """Each run that is not claimed and fulfilled, its evidence, and whether there is room for its pictures."""
    room = MOST_PICTURE_BYTES
    for case in to_look_at(page.cases):
        evidence = page.evidence(case.outcome.run_id)
        size = sum(len(jpeg) for _, jpeg in evidence.pictures)
        has_room = size <= room
        room -= size if has_room else 0
        yield case, replace(evidence, pictures=evidence.pictures if has_room else ()), has_room
