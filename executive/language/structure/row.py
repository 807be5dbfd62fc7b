"""Intermediate results of building steps, and helpers on clauses, conditions and commands."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

from executive.language.amounts import parse_seconds, parse_times
from executive.language.clauses import ACTS, CLAUSES, Clause, Cue
from executive.language.lexicon import VerbKind
from executive.language.questions import RefusalError
from executive.language.roles import HERE
from executive.language.structure.plain import PlainReader, PlainReading, SpokenCondition, State, negate
from executive.words.command import Command, Task
from executive.words.condition import Condition, Look, Not
from executive.words.step import Step
from executive.words.steps import Loop, Steps

ATTACHED = (Cue.SO, Cue.NOT, Cue.OTHERWISE, Cue.FAILED)
"""Cues of clauses that refer to the last look or action."""


@dataclass
class Row:
    """Steps built so far, and pending clauses, which are understood together.

    `asked` is the last look or fetch; `begun` is the index of the step where the present sentence begins.
    """

    state: State
    steps: list[Step] = field(default_factory=list)
    plain: list[Clause] = field(default_factory=list)
    asked: LastCheck | None = None
    begun: int = 0


@dataclass(frozen=True)
class LastCheck:
    """Condition of the last steps: they look at it (`looked`), or need it to succeed; `steps` is their number.

    `decided` says that the last step depends on the condition.
    """

    supposed: SpokenCondition
    looked: bool
    decided: bool = False
    steps: int = 1


@dataclass(frozen=True)
class Rounds:
    """Rounds of an action, and the state at the beginning of a round."""

    loop: Loop
    state: State


def end_of_scope(clauses: Sequence[Clause], at: int, *, branch: bool = False, rounds: bool = False) -> int:
    """Index behind the clauses that belong to a condition or to rounds before `at`.

    `branch` marks a second branch, where "then" goes on behind both branches. Clauses that follow the whole end it; in
    "first ..., finally ..." they belong to it.
    """
    first = any(re.search(r"\bfirst\b", one.joint, re.IGNORECASE) for one in clauses[at : at + 1])
    for n, one in enumerate(clauses[at:], at):
        after_all = n > at and ((one.outer and not first) or one.anyway)
        then = n > at and branch and one.then
        if rounds:
            goes_on = one.kind in ATTACHED or (one.kind is Cue.IF and ACTS.pronoun.match(one.text) is not None)
            if after_all or (one.begins and n > at and not goes_on):
                return n
        elif one.kind in (*ATTACHED, Cue.IF, Cue.UNLESS, Cue.SOON) or one.begins or after_all or then:
            return n
    return len(clauses)


def same_check(one: Condition, other: Condition) -> bool:
    """Returns whether both conditions check the same, or the opposite."""
    return one in (other, negate(other))


def negate_supposed(supposed: SpokenCondition) -> SpokenCondition:
    """Negation of a condition, with the state behind it."""
    return replace(supposed.negate(f"not {supposed.said}"), quotable=False)


def statement_of(supposed: SpokenCondition) -> str | None:
    """Words of a condition as a statement; None where they cannot be repeated."""
    said = supposed.said
    plain = supposed.quotable and not CLAUSES.deictic.search(said) and not re.match(r"it\b|there is one", said)
    return said if said and plain else None


def state_behind_both(one: State, other: State) -> State:
    """State behind two branches."""
    return replace(
        one,
        held=one.held if one.held == other.held else None,
        goal=one.goal if one.goal == other.goal else None,
        at=one.at if one.at == other.at else None,
    )


def one_errand(reading: PlainReading) -> bool:
    """Returns whether all commands are about one object, or only go somewhere and back."""
    objects = {str(thing) for command in reading.commands for thing in (command.item, command.object) if thing}
    going = [action for action in reading.trace.resolved if action.kind is VerbKind.GO]
    bare = sum(command.item is None and command.task is None for command in reading.commands)
    return len(objects) == 1 if not bare else not objects and bare <= 2 and bool(going) and going[-1].goal == HERE


def find_last_check(reading: PlainReading, before: State, reader: PlainReader) -> LastCheck | None:
    """Look or fetch of the last command."""
    commands = reading.commands
    if commands and commands[-1].task is Task.FIND:
        looks = sum(command.task is Task.FIND for command in commands)
        return LastCheck(reader.condition_of_looks(reading, reading.state, before, ""), looked=True, steps=looks)
    taken = next((command for command in reversed(commands) if command.task is Task.GRASP), None)
    if taken is None:
        return None
    found = Command(goal=taken.goal, task=Task.FIND, object=taken.object, object_count=taken.object_count, verb="find")
    memory = replace(reading.state.memory, where=None, locations=before.memory.locations)
    fails = replace(reading.state, memory=memory, held=None, goal=None, at=None)
    return LastCheck(
        SpokenCondition(Look.from_command(found), "", reading.state, fails), looked=False, steps=len(commands)
    )


def condition_at_source(supposed: SpokenCondition, steps: Steps, text: str) -> SpokenCondition:
    """Adds the place where the object is taken to a condition without a place ("if there is one")."""
    taken = next((c for step in steps for c in step.commands if c.task is Task.GRASP), None)
    condition = supposed.condition
    look = condition.part if isinstance(condition, Not) else condition
    placed = re.search(r"\b(?:in|on|at|inside|near)\b", text, re.IGNORECASE)
    if taken is None or placed or not isinstance(look, Look) or look.command.object != taken.object:
        return supposed
    there = Look.from_command(replace(look.command, goal=taken.goal))
    return replace(supposed, condition=Not(part=there) if isinstance(condition, Not) else there)


def statement_of_check(text: str) -> str | None:
    """Turns a check into a statement: "is the door open" becomes "the door is open"."""
    match = ACTS.checked.fullmatch(text)
    if match is None or match["what"] is not None:
        return None if match is None else match["what"]
    found = next((found for form in ACTS.each("asked") if (found := form.fullmatch(match["asked"]))), None)
    return None if found is None else f"{found[1]} {'are' if found[1].lower() == 'you' else 'is'} {found[2]}"


def ambiguous_cue(found: Clause) -> RefusalError:
    """Refusal of a cue that could belong to several actions."""
    said = f"{found.cue} {found.text}".strip()
    return RefusalError(f"it is not clear to what '{said}' belongs; say it first", [said])


def missing_action(cue: str, text: str = "") -> RefusalError:
    """Refusal of a condition without an action."""
    return RefusalError(f"what am I to do {f'{cue.lower()} {text}'.strip()}?", [f"{cue} {text}".strip()])


def seconds_of_cue(cue: str) -> float:
    """Parses the interval in "every ten minutes", in seconds. Raises RefusalError for another text."""
    words = re.sub(r"^(?:once )?(?:every|each|per) |^once (?=an? )|^once per ", "", cue, flags=re.IGNORECASE)
    seconds = parse_seconds(words if words not in ("hour", "minute") else f"a {words}")
    if seconds is None:
        raise RefusalError(f"'{cue}' is no time that I understand", [cue])
    return seconds


def times_of_cue(cue: str) -> int:
    """Parses the number of rounds in "do this three times". Raises RefusalError for another text."""
    words = re.sub(r"^(?:do|repeat) (?:this |that |the following |it )?|^for ", "", cue, flags=re.IGNORECASE)
    count = parse_times(words)
    if count is None:
        raise RefusalError(f"'{cue}' is no number of times that I understand", [cue])
    return count
