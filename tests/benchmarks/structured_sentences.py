"""How many sentences that decide, repeat, wait and go on become the right mission.

    python -m tests.benchmarks.structured_sentences [--show]

The sentences stand in `structured_sentences.yaml` and the tables beside it, with their expected missions in short
forms. Each table was written before anything of it was tried; docs/language.md has the figures at first sight.
A sentence that is to be refused counts as right when it is refused or asked back about; an accepted one when its
mission is the expected one, how plain commands are grouped into steps aside.
"""

from __future__ import annotations

import argparse
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import yaml

from executive.language.parser import load_parser
from executive.language.understand import Status, Understanding, understand
from executive.words.knowledge import load_knowledge
from plant.worlds.world import load_world
from tests.executive.language.notation import as_noted, noted

__all__ = ["TABLES", "Score", "in_full", "measured"]

TABLES: Final = tuple(
    Path(__file__).with_name(f"structured_sentences{name}.yaml")
    for name in ("", "_later", "_last", "_forms", "_people", "_people_later", "_people_last")
)
_SHORT: Final = re.compile(r"\b(fetch|carry|put|take|give|go|find|charge|follow|guide|greet)\(([^()]*)\)")
_FORMS: Final = {
    "fetch": "Take [Nothing] to [{1}] and do [grasp] to [{0}] then Take [{0}] to [start] and do [Nothing] to [Nothing]",
    "carry": "Take [Nothing] to [{1}] and do [grasp] to [{0}] then Take [{0}] to [{2}] and do [Nothing] to [Nothing]",
    "put": "Take [Nothing] to [{1}] and do [grasp] to [{0}] then Take [{0}] to [{2}] and do [place] to [{0}]",
    "take": "Take [Nothing] to [{1}] and do [grasp] to [{0}]",
    "give": "Take [{0}] to [{1}] and do [Nothing] to [Nothing]",
    "go": "Take [Nothing] to [{0}] and do [Nothing] to [Nothing]",
    "find": "Take [Nothing] to [{1}] and do [find] to [{0}]",
    "follow": "Take [Nothing] to [{1}] and do [follow] to [{0}]",
    "guide": "Take [Nothing] to [{1}] and do [guide] to [{0}]",
    "greet": "Take [Nothing] to [{1}] and do [greet] to [{0}]",
    "charge": "Take [Nothing] to [Nothing] and do [charge] to [Nothing]",
}


@dataclass(frozen=True)
class Score:
    """Sentences, how many of them are right, which were accepted wrongly, and which became no or another mission."""

    sentences: int
    right: int
    wrongly_accepted: tuple[str, ...]
    missed: tuple[str, ...]

    def __str__(self) -> str:
        share = 100.0 * self.right / self.sentences
        return f"{self.right} of {self.sentences} right ({share:.1f} %), {len(self.wrongly_accepted)} wrongly accepted"


def measured(table: Path) -> Score:
    """The score of a table's sentences."""
    rows = list(_answers(table))
    wrong = tuple(_line(text, answer) for text, expected, answer in rows if _wrongly_accepted(expected, answer))
    missed = tuple(
        _line(text, answer)
        for text, expected, answer in rows
        if not _right(expected, answer) and not _wrongly_accepted(expected, answer)
    )
    return Score(len(rows), len(rows) - len(wrong) - len(missed), wrong, missed)


def _answers(table: Path) -> Iterator[tuple[str, list[str] | str, Understanding]]:
    """Each sentence with what is expected of it, and the answer."""
    parser = load_parser()
    for world, rows in yaml.safe_load(table.read_text(encoding="utf-8")).items():
        knowledge = load_knowledge(load_world(world).knowledge_path)
        for text, expected in rows.items():
            yield text, expected, understand(text, parser=parser, knowledge=knowledge, require_wake=False)


def _right(expected: list[str] | str, answer: Understanding) -> bool:
    if isinstance(expected, str):
        return answer.status is not Status.OK
    return answer.status is Status.OK and noted(answer.all_steps) == as_noted(map(in_full, expected))


def _wrongly_accepted(expected: list[str] | str, answer: Understanding) -> bool:
    return answer.status is Status.OK and not _right(expected, answer)


def in_full(text: str) -> str:
    return _SHORT.sub(lambda match: _FORMS[match[1]].format(*re.split(r", ", match[2]), "Nothing"), text)


def _line(text: str, answer: Understanding) -> str:
    found = noted(answer.all_steps) if answer.status is Status.OK else answer.reason
    return f"{text}\n      {found}"


def main() -> None:
    """Print the score."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--show", action="store_true", help="show the sentences that are not right")
    shown = options.parse_args().show
    for table in TABLES:
        score = measured(table)
        print(f"{table.name}: {score}")
        for title, rows in (("wrongly accepted", score.wrongly_accepted), ("missed", score.missed)):
            for row in rows if shown else ():
                print(f"  {title}: {row}")


if __name__ == "__main__":
    main()
