"""How many sentences that are said to several robots become the right parts.

    python -m tests.benchmarks.robots_sentences [--show]

The sentences stand in `robots_sentences.yaml`, by which the rules were made, and `robots_sentences_later.yaml`, which
was written before anything of it was tried; docs/language.md has the figures at first sight. A sentence that is to be
refused counts as right when it is refused or asked back about.
"""

from __future__ import annotations

import argparse
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Final

import yaml

from executive.language.addressees import RobotChoice
from executive.language.parser import load_parser
from executive.language.several_robots import understand_for_robots
from executive.language.understand import Part, Status, Understanding
from executive.words.knowledge import load_knowledge
from plant.worlds.world import load_world
from tests.benchmarks.structured_sentences import Score, in_full
from tests.executive.language.notation import as_noted, noted

__all__ = ["TABLES", "measured"]

TABLES: Final = tuple(Path(__file__).with_name(f"robots_sentences{name}.yaml") for name in ("", "_later"))
_PART: Final = re.compile(r"(?P<who>\w+)(?: after (?P<after>[\d, ]+))?: (?P<steps>.+)", re.DOTALL)


def measured(table: Path) -> Score:
    """The score of a table's sentences."""
    rows = list(_answers(table))
    right = [_right(expected, answer) for _, expected, answer in rows]
    wrong = [row for row, fits in zip(rows, right, strict=True) if not fits]
    taken = tuple(_line(text, answer) for text, _, answer in wrong if answer.status is Status.OK)
    missed = tuple(_line(text, answer) for text, _, answer in wrong if answer.status is not Status.OK)
    return Score(len(rows), sum(right), taken, missed)


def _answers(table: Path) -> Iterator[tuple[str, list[str] | str, Understanding]]:
    """Each sentence with what is expected of it, and the answer."""
    parser, knowledge = load_parser(), load_knowledge(load_world("flat").knowledge_path)
    for names, rows in yaml.safe_load(table.read_text(encoding="utf-8")).items():
        robots = names.split(", ")
        for text, expected in rows.items():
            yield text, expected, understand_for_robots(text, robots=robots, parser=parser, knowledge=knowledge)


def _right(expected: list[str] | str, answer: Understanding) -> bool:
    if isinstance(expected, str):
        return answer.status is not Status.OK
    return answer.status is Status.OK and [_said(part) for part in answer.parts] == [_wanted(text) for text in expected]


def _wanted(text: str) -> tuple[str, tuple[int, ...], str]:
    match = _PART.fullmatch(text)
    assert match is not None, text
    after = tuple(int(number) - 1 for number in (match["after"] or "").split(",") if number.strip())
    return match["who"], after, as_noted(in_full(step) for step in match["steps"].split(" | "))


def _said(part: Part) -> tuple[str, tuple[int, ...], str]:
    who = part.robot.value if isinstance(part.robot, RobotChoice) else part.robot
    return who, part.after, noted(part.meaning.all_steps)


def _line(text: str, answer: Understanding) -> str:
    if answer.status is not Status.OK:
        return f"{text}\n      {answer.reason}"
    parts = (
        f"{who}{f' after {[n + 1 for n in after]}' if after else ''}: {steps}"
        for who, after, steps in map(_said, answer.parts)
    )
    return "\n      ".join((text, *parts))


def main() -> None:
    """Print the score."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--show", action="store_true", help="show the sentences that are not right")
    options.add_argument("tables", nargs="*", type=Path, default=TABLES, help="tables; by default all")
    given = options.parse_args()
    for table in given.tables:
        score = measured(table)
        print(f"{table.name}: {score}")
        for title, rows in (("wrongly accepted", score.wrongly_accepted), ("missed", score.missed)):
            for row in rows if given.show else ():
                print(f"  {title}: {row}")


if __name__ == "__main__":
    main()
