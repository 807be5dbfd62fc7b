"""How many sentences that decide, repeat, wait and go on become the right mission.

    python -m tests.benchmarks.structured_sentences [--show]

The sentences stand in `structured_sentences.yaml` and the tables beside it, with their expected missions in short
forms. Each table was written before anything of it was tried; docs/language.md has the figures at first sight.
A sentence that is to be refused counts as right when it is refused or asked back about; an accepted one when its
mission is the expected one, how plain commands are grouped into steps aside.
"""

import re
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

import yaml

from executive.language.parser import load_parser
from executive.language.understand import Status, understand
from executive.words.knowledge import load_knowledge
from plant.worlds.world import load_world
from tests.benchmarks.harness import command
from tests.executive.language.notation import as_noted, noted

TABLES = tuple(
    Path(__file__).with_name(f"structured_sentences{name}.yaml")
    for name in ("", "_later", "_last", "_forms", "_people", "_people_later", "_people_last")
)
_SHORT = re.compile(r"\b(fetch|carry|put|take|give|go|find|charge|follow|guide|greet)\(([^()]*)\)")
_FORMS = {
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
class Judged:
    """A sentence: whether it was accepted, whether that and its mission are right, and what was understood."""

    accepted: bool
    right: bool
    line: str


@dataclass(frozen=True)
class Score:
    """Sentences, how many of them are right, which were accepted wrongly, and which became no or another mission."""

    sentences: int
    right: int
    wrongly_accepted: tuple[str, ...]
    missed: tuple[str, ...]

    @staticmethod
    def of(judged: Iterable[Judged]) -> "Score":
        """Counts judged sentences."""
        every = list(judged)
        wrong = [each for each in every if not each.right]
        taken, missed = (tuple(e.line for e in wrong if e.accepted is accepted) for accepted in (True, False))
        return Score(len(every), len(every) - len(wrong), taken, missed)

    def __str__(self) -> str:
        share = 100.0 * self.right / self.sentences
        return f"{self.right} of {self.sentences} right ({share:.1f} %), {len(self.wrongly_accepted)} wrongly accepted"


def print_scores(measured: Callable[[Path], Score], tables: Iterable[Path], *, show: bool) -> None:
    """Prints the score of each table, and with `show` the sentences that are not right."""
    for table in tables:
        score = measured(table)
        print(f"{table.name}: {score}")
        for title, rows in (("wrongly accepted", score.wrongly_accepted), ("missed", score.missed)):
            for row in rows if show else ():
                print(f"  {title}: {row}")


def measured(table: Path) -> Score:
    """Score of a table's sentences."""
    return Score.of(_judged(table))


def _judged(table: Path) -> Iterator[Judged]:
    parser = load_parser()
    for world, rows in yaml.safe_load(table.read_text(encoding="utf-8")).items():
        knowledge = load_knowledge(load_world(world).knowledge_path)
        for text, expected in rows.items():
            answer = understand(text, parser=parser, knowledge=knowledge, require_wake=False)
            accepted, refuse = answer.status is Status.OK, isinstance(expected, str)
            found = noted(answer.all_steps) if accepted else answer.reason
            right = accepted is not refuse and (refuse or found == as_noted(map(in_full, expected)))
            yield Judged(accepted, right, f"{text}\n      {found}")


def in_full(text: str) -> str:
    """Commands in full for a short form such as `go(kitchen)`."""
    return _SHORT.sub(lambda match: _FORMS[match[1]].format(*re.split(r", ", match[2]), "Nothing"), text)


def main(show: bool = False) -> None:
    """Prints the scores; `--show` shows the sentences that are not right."""
    print_scores(measured, TABLES, show=show)


if __name__ == "__main__":
    command(main)
