"""Requests about objects of a household: which is the biggest, the heaviest, the thinnest."""

from pathlib import Path
from typing import Final

from errand_home.tasks import Compare
from executive.language.amounts import number_of_words
from executive.language.clauses import Clause
from executive.language.structure.builder import Builder
from executive.language.structure.plain import require
from executive.words.command import Command
from executive.words.knowledge import ANYTHING, Knowledge
from executive.words.leaf_steps import steps_of_commands
from executive.words.task import task_named
from skills.api import ObjectKind
from skills.descriptions import plural

_TABLE: Final = Path(__file__).with_name("home.yaml")


def about_objects(row: Builder, clause: Clause) -> bool:
    """Adds a request to compare objects at a place."""
    found = row.reader.forms("home", _TABLE)["compares"].fullmatch(clause.text)
    if found is None:
        return False
    row.flush()
    kind = require(_kind(found["kind"], row.reader.knowledge), f"I know no '{found['kind']}'", found["kind"])
    number = number_of_words(found["number"].split()) if found["number"] else 1
    count = require(number, f"'{found['number']}' is no number of objects", found["number"])
    place = row.reader.place(found["place"], row.state)
    what = ObjectKind(kind, (found["order"].lower(),))
    verb = clause.text.split()[0].lower()
    command = Command(goal=place, task=task_named(Compare.word), object=what, object_count=count, verb=verb)
    row.put(steps_of_commands((command,)), row.reader.state_after((command,), row.state.memory, row.state))
    return True


def _kind(said: str, knowledge: Knowledge) -> str | None:
    """Name of the class or category that words mean in the singular or the plural; None for an unknown one."""
    names = (*knowledge.object_names(), ANYTHING)
    return knowledge.object_name(said) or next((name for name in names if said.lower() == plural(name)), None)
