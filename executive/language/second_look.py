"""A second, independent look at a sentence: words that forbid, limit or share must be carried by the mission.

It knows no grammar. For each such word of the raw text, something of the mission's own text must carry it, and no
object that a clause excludes may be one that the mission takes.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from functools import cache
from typing import TYPE_CHECKING, Final

from executive.language.lexicon import any_of, read_table
from executive.language.questions import RefusalError
from executive.words.command import Command
from executive.words.knowledge import Knowledge
from executive.words.leaf_steps import Speak
from executive.words.steps import steps_to_yaml

if TYPE_CHECKING:
    from executive.language.understand import Understanding

_CLAUSE: Final = re.compile(r"[,;.!?:]|\b(?:and|but|then|so)\b", re.IGNORECASE)


def second_look(text: str, found: Understanding, knowledge: Knowledge) -> RefusalError | None:
    """Refusal that quotes the first word of the text that nothing of the mission carries; None if all are carried."""
    meanings = [part.meaning for part in found.parts] or [found]
    steps = [step for meaning in meanings for step in meaning.all_steps]
    walked = [each for step in steps for each in step.walk()]
    spoken = [each.speak for each in walked if isinstance(each, Speak)]
    heard = re.sub(any_of(spoken) or "(?!)", " ", text.replace("\u2019", "'"), flags=re.IGNORECASE)
    heard = _harmless().sub(lambda match: " " * len(match[0]), heard)
    commands = [command for each in walked for command in each.commands]
    mission = "\n".join((*steps_to_yaml(steps), *map(str, commands), *_marks(commands, found)))
    for cue, carried in _rows():
        for match in cue.finditer(heard):
            apart = "<apart>" in carried.pattern and _apart(_clause(heard, match), commands, knowledge)
            if not (carried.search(mission) or apart):
                said = _clause(text, match).strip()
                return RefusalError(f"I cannot follow '{match[0]}' in '{said}'; say only what I am to do", [match[0]])
    return None


def _marks(commands: Sequence[Command], found: Understanding) -> Iterable[str]:
    """Yields what the rows of the table call several errands, a thing that is taken, and several robots."""
    taken = [command for command in commands if command.item is not None]
    if len(taken) > 1 or len({command.goal for command in commands}) > 1:
        yield "<several>"
    if taken:
        yield "<takes>"
    if found.parts:
        yield "<robots>"


def _clause(text: str, cue: re.Match[str]) -> str:
    """Clause around a word: up to the next mark, or the next word that joins."""
    begin = max((each.end() for each in _CLAUSE.finditer(text, 0, cue.start())), default=0)
    end = next((each.start() for each in _CLAUSE.finditer(text, cue.end())), len(text))
    return text[begin:end]


def _apart(clause: str, commands: Sequence[Command], knowledge: Knowledge) -> bool:
    """Returns whether a clause names something, and the commands do nothing with it: "the wrench, not the hammer"."""
    things = {name: knowledge.object_name(name) for name in knowledge.spellings(knowledge.object_names())}
    places = {name: knowledge.place(name) for name in knowledge.spellings(knowledge.place_names())}
    said = {one.lower() for one in re.findall(rf"\b(?:{any_of([*things, *places])})(?=e?s?\b)", clause, re.IGNORECASE)}
    kinds = {kind for name in said for kind in knowledge.classes(name)}
    used = [each for command in commands for each in (command.item, command.object) if each is not None]
    taken = {kind for each in used if not each.attributes for kind in knowledge.classes(each.name)}
    goals = {command.goal.lower() for command in commands if command.goal is not None}
    return bool(said) and not kinds & taken and not said & goals


@cache
def _harmless() -> re.Pattern[str]:
    return re.compile("|".join(rf"\b(?:{each})" for each in read_table("cues.yaml")["harmless"]), re.IGNORECASE)


@cache
def _rows() -> tuple[tuple[re.Pattern[str], re.Pattern[str]], ...]:
    rows = read_table("cues.yaml")["rows"]
    return tuple((re.compile(rf"\b(?:{row['cue']})\b", re.IGNORECASE), re.compile(row["carried"])) for row in rows)
