"""How many sentences that decide, repeat, wait and go on, or that several robots hear, become the right mission.

    python -m tests.benchmarks.structured_sentences [--show] [--tables FILE,FILE]

The sentences stand in `structured_sentences.yaml`, `robots_sentences.yaml` and the tables beside them, with their
expected missions, or parts of robots, in short forms. All tables but `robots_sentences.yaml`, by which the rules were
made, were written before anything of them was tried; docs/language.md has the figures at first sight. A sentence that
is to be refused counts as right when it is refused or asked back about; an accepted one when its mission is the
expected one, how plain commands are grouped into steps aside.
"""

import re
from functools import cache
from pathlib import Path
from types import SimpleNamespace

import yaml

from executive.language.addressees import RobotChoice
from executive.language.parser import load_parser
from executive.language.several_robots import understand_for_robots
from executive.language.understand import Status, understand
from executive.words.knowledge import load_knowledge
from plant.worlds.world import load_world
from tests.benchmarks.harness import command
from tests.executive.language.notation import as_noted, noted

TABLES = tuple(sorted(Path(__file__).parent.glob("*_sentences*.yaml")))
_PART = re.compile(r"(?P<who>\w+)(?: after (?P<after>[\d, ]+))?: (?P<steps>.+)", re.DOTALL)
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


def measured(table):
    """Numbers of a table's sentences and of the right ones, those accepted wrongly, and those that got no mission."""
    answer_of, said, wanted = _ROBOTS if table.stem.startswith("robots") else _MISSION
    sentences, wrongly_accepted, missed = 0, [], []
    for where, rows in yaml.safe_load(table.read_text(encoding="utf-8")).items():
        sentences += len(rows)
        for text, expected in rows.items():
            answer, refuse = answer_of(text, where), isinstance(expected, str)
            accepted = answer.status is Status.OK
            found = said(answer) if accepted else answer.reason
            if accepted is refuse or not (refuse or found == wanted(expected)):
                (wrongly_accepted if accepted else missed).append(f"{text}\n      {found}")
    right = sentences - len(wrongly_accepted) - len(missed)
    return SimpleNamespace(sentences=sentences, right=right, wrongly_accepted=wrongly_accepted, missed=missed)


@cache
def _world(name):
    return {"parser": load_parser(), "knowledge": load_knowledge(load_world(name).knowledge_path)}


def _part_said(part):
    who = part.robot.value if isinstance(part.robot, RobotChoice) else part.robot
    return who, part.after, noted(part.meaning.all_steps)


def _part_wanted(text):
    """Robot, parts that come before, and steps of a part as the table has it."""
    match = _PART.fullmatch(text)
    assert match is not None, text
    after = tuple(int(number) - 1 for number in (match["after"] or "").split(",") if number.strip())
    return match["who"], after, as_noted(in_full(step) for step in match["steps"].split(" | "))


_MISSION = (
    lambda text, world: understand(text, **_world(world), require_wake=False),
    lambda answer: noted(answer.all_steps),
    lambda expected: as_noted(map(in_full, expected)),
)
_ROBOTS = (
    lambda text, names: understand_for_robots(text, robots=names.split(", "), **_world("flat")),
    lambda answer: [_part_said(part) for part in answer.parts],
    lambda expected: [_part_wanted(part) for part in expected],
)
"""What becomes of a sentence; what was understood, and what the table expects, in one form."""


def in_full(text):
    """Commands in full for a short form such as `go(kitchen)`."""
    return _SHORT.sub(lambda match: _FORMS[match[1]].format(*re.split(r", ", match[2]), "Nothing"), text)


def main(show: bool = False, tables: tuple[Path, ...] = TABLES):
    """Prints the score of each table, and with `--show` the sentences that are not right."""
    for table in tables:
        score = measured(table)
        share = f"{100.0 * score.right / score.sentences:.1f} %"
        wrong = len(score.wrongly_accepted)
        print(f"{table.name}: {score.right} of {score.sentences} right ({share}), {wrong} wrongly accepted")
        for title, rows in (("wrongly accepted", score.wrongly_accepted), ("missed", score.missed)):
            for row in rows if show else ():
                print(f"  {title}: {row}")


if __name__ == "__main__":
    command(main)
