"""Second, independent look at a sentence: each word that forbids, limits or shares must be carried by its mission.

It knows no grammar: something of the mission's own text must carry each such word of the sentence (see `cues.yaml`), or
the clause of the word names only objects and places with which the mission does nothing.
"""

import re
from collections.abc import Iterable, Iterator, Sequence
from functools import cache, reduce
from itertools import pairwise
from pathlib import Path
from typing import Any, Final

from executive.words.command import NUMBERS, START, Command
from executive.words.knowledge import Knowledge
from executive.words.leaf_steps import Dock, Picture, Speak, Wait
from executive.words.step import Step
from executive.words.steps import steps_to_yaml
from executive.words.task import basic, installed_tasks
from skills.inputs.yaml_source import read_yaml

_CLAUSE: Final = re.compile(r"[,;.!?:]|\b(?:and|but|then|so)\b", re.IGNORECASE)


def second_look(text: str, steps: Sequence[Step], knowledge: Knowledge, *, robots: bool = False) -> str | None:
    """First word of a sentence, or words in a row, that nothing of its mission carries; None if all are carried."""
    walked = [each for step in steps for each in step.walk()]
    commands = [command for each in walked for command in each.commands]
    spoken = [each.speak for each in walked if isinstance(each, Speak)]
    raw = heard = text.replace("\u2019", "'")
    for silent in (_any_of(spoken), *_table()["harmless"]):
        heard = re.sub(rf"\b(?:{silent})", lambda match: " " * len(match[0]), heard, flags=re.IGNORECASE)
    marks = (*_marks(walked, knowledge), *["<robots>"] * robots)
    mission = "\n".join((*steps_to_yaml(steps), *map(str, commands), *marks))
    named = {"people": knowledge.people, "things": (*knowledge.object_names(), "thing", "object")}
    spelled = {f"<{key}>": f"(?:{_any_of(knowledge.spellings(each))})" for key, each in named.items()} | _tasks()
    for row in _table()["rows"]:
        form = reduce(lambda text, key: text.replace(key, spelled[key]), spelled, row["cue"])
        cues = rf"(?<!\w)(?:{form})\b"
        left = 0
        for cue in re.finditer(cues, raw if row.get("raw") else heard, re.IGNORECASE):
            parts = (*_tasks().items(), *_parts(cue, knowledge))
            carried = reduce(lambda text, part: text.replace(*part), parts, row["carried"])
            following = "<next apart>" in row["carried"]
            looks = following or "<apart>" in row["carried"]
            if looks and _is_apart(heard, cue, commands, knowledge, following=following):
                continue
            left += 1
            if len(re.findall(carried, mission)) < (left if row.get("each") else 1):
                return cue[0]
        if row.get("settles"):
            heard = re.sub(cues, lambda match: " " * len(match[0]), heard, flags=re.IGNORECASE)
    return None


def _parts(cue: re.Match[str], knowledge: Knowledge) -> Iterator[tuple[str, str]]:
    """Yields the parts that a carrier takes over from its cue, with their texts."""
    for name, said in cue.groupdict(default="").items():
        text = {"who": f"{re.escape(knowledge.person(said) or START)}|speak", "act": said.upper()}.get(name, said)
        number = NUMBERS.index(text.lower()) if text.lower() in NUMBERS else text
        yield f"<{name}>", str(number)


@cache
def _table() -> Any:
    return read_yaml(Path(__file__).with_name("cues.yaml")).data


def _tasks() -> dict[str, str]:
    """Words of tasks for the table, by their marks."""
    tasks = installed_tasks().values()
    other = [task.word for task in tasks if not (task.takes or task.puts or task.looks)]
    return {"<tasks>": _any_of(other), "<moving>": _any_of(task.word for task in tasks if task.moves)}


def _any_of(phrases: Iterable[str]) -> str:
    return "|".join(map(re.escape, sorted(phrases, key=len, reverse=True))) or "(?!)"


def _marks(walked: Sequence[Step], knowledge: Knowledge) -> Iterator[str]:
    """Yields what the table says of a mission in angle brackets: what is done, what is not, and how many are taken."""
    commands = [command for each in walked for command in each.commands]
    taken = [command for command in commands if command.item is not None]
    own = {command for command in commands if command.task is not None and command.task.sentences}
    visits = {command.goal for command in commands if command.item is None and not command.takes and command not in own}
    acts = sum(isinstance(each, Speak | Picture | Dock) for each in walked) + len(taken) + len(own) + len(visits)
    if acts > 1:
        yield "<several>"
    if taken:
        yield "<takes>"
    if all(command.goal in knowledge.tops for command in commands if command.takes):
        yield "<from a surface>"
    if not any(gets.takes and gets.goal == brings.goal for gets, brings in pairwise(commands)):
        yield "<moves>"
    yield from (f"<{n} taken>" for n in range(1, 1 + sum(command.item_count for command in taken)))
    done = {command.task.word for command in commands if command.task is not None}
    done |= {basic().take.word} if taken else set()
    kinds = {Speak: "speak", Wait: basic().wait.word, Dock: basic().charge.word}
    done |= {act for kind, act in kinds.items() if any(isinstance(each, kind) for each in walked)}
    yield from (f"<NO {act.upper()}>" for act in ({*installed_tasks()} | {"speak"}) - done)


def _is_apart(
    text: str, cue: re.Match[str], commands: Sequence[Command], knowledge: Knowledge, *, following: bool
) -> bool:
    """Returns whether the commands do nothing with what is named behind a cue, or else before it, in its clause.

    With `following`, only the name that follows the cue counts.
    """
    begin = max((each.end() for each in _CLAUSE.finditer(text, 0, cue.start())), default=0)
    end = next((each.start() for each in _CLAUSE.finditer(text, cue.end())), len(text))
    names = rf"\b(?:{_any_of(knowledge.spellings((*knowledge.object_names(), *knowledge.place_names())))})(?=e?s?\b)"
    parts = (text[cue.end() : end], text[begin : cue.start()])
    said = next(filter(None, (re.findall(names, part.lower(), re.IGNORECASE) for part in parts)), [])
    said = said[:1] if following else said
    used = [each for command in commands for each in (command.item, command.object) if each is not None]
    taken = {kind for each in used if not each.attributes for kind in knowledge.classes(each.name)}
    goals = {command.goal.lower() for command in commands if command.goal is not None}
    return bool(said) and goals.isdisjoint(said) and taken.isdisjoint(k for one in said for k in knowledge.classes(one))
