"""How many sentences that are said to several robots become the right parts.

    python -m tests.benchmarks.robots_sentences [--show] [--tables FILE,FILE]

The sentences stand in `robots_sentences.yaml`, by which the rules were made, and `robots_sentences_later.yaml`, which
was written before anything of it was tried; docs/language.md has the figures at first sight. A sentence that is to be
refused counts as right when it is refused or asked back about.
"""

import re
from collections.abc import Iterator
from pathlib import Path

import yaml

from executive.language.addressees import RobotChoice
from executive.language.parser import load_parser
from executive.language.several_robots import understand_for_robots
from executive.language.understand import Part, Status
from executive.words.knowledge import load_knowledge
from plant.worlds.world import load_world
from tests.benchmarks.harness import command
from tests.benchmarks.structured_sentences import Judged, Score, in_full, print_scores
from tests.executive.language.notation import as_noted, noted

TABLES = tuple(Path(__file__).with_name(f"robots_sentences{name}.yaml") for name in ("", "_later"))
_PART = re.compile(r"(?P<who>\w+)(?: after (?P<after>[\d, ]+))?: (?P<steps>.+)", re.DOTALL)


def measured(table: Path) -> Score:
    """Score of a table's sentences."""
    return Score.of(_judged(table))


def _judged(table: Path) -> Iterator[Judged]:
    parser, knowledge = load_parser(), load_knowledge(load_world("flat").knowledge_path)
    for names, rows in yaml.safe_load(table.read_text(encoding="utf-8")).items():
        for text, expected in rows.items():
            answer = understand_for_robots(text, robots=names.split(", "), parser=parser, knowledge=knowledge)
            accepted, refuse = answer.status is Status.OK, isinstance(expected, str)
            found = [_said(part) for part in answer.parts] if accepted else [answer.reason]
            right = accepted is not refuse and (refuse or found == [_wanted(part) for part in expected])
            yield Judged(accepted, right, "\n      ".join([text, *map(str, found)]))


def _wanted(text: str) -> tuple[str, tuple[int, ...], str]:
    """Robot, parts that come before, and steps of a part as the table has it."""
    match = _PART.fullmatch(text)
    assert match is not None, text
    after = tuple(int(number) - 1 for number in (match["after"] or "").split(",") if number.strip())
    return match["who"], after, as_noted(in_full(step) for step in match["steps"].split(" | "))


def _said(part: Part) -> tuple[str, tuple[int, ...], str]:
    """The same of a part that was understood."""
    who = part.robot.value if isinstance(part.robot, RobotChoice) else part.robot
    return who, part.after, noted(part.meaning.all_steps)


def main(show: bool = False, tables: tuple[Path, ...] = TABLES) -> None:
    """Prints the scores; `--show` shows the sentences that are not right."""
    print_scores(measured, tables, show=show)


if __name__ == "__main__":
    command(main)
