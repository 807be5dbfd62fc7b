"""Steps as they are put together from clauses, and what is asked of clauses, conditions and commands on the way."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

from executive.language.amounts import seconds_of, times_of
from executive.language.clauses import ACTS, CLAUSES, Clause, Cue
from executive.language.lexicon import VerbKind
from executive.language.questions import RefusalError
from executive.language.roles import HERE
from executive.language.structure.plain import PlainReader, PlainReading, State, Supposed, contrary
from executive.words.command import Command, Task
from executive.words.condition import Condition, Look, Not
from executive.words.step import Step
from executive.words.steps import Loop, Steps

ATTACHED = (Cue.SO, Cue.NOT, Cue.OTHERWISE, Cue.FAILED)
"""Clauses with these cues go on from what was looked at or done before."""


@dataclass
class Row:
    """Steps as they are put together: those that are done, and clauses that are still to be understood as one.

    `asked` is what was looked at or fetched last; `begun` is where in the steps the present sentence begins.
    """

    state: State
    steps: list[Step] = field(default_factory=list)
    plain: list[Clause] = field(default_factory=list)
    asked: LookedAt | None = None
    begun: int = 0


@dataclass(frozen=True)
class LookedAt:
    """A condition that the last steps looked at (`looked`), or that must hold for them; `steps` is how many they are.

    `decided` says that the last step is done only if it holds.
    """

    supposed: Supposed
    looked: bool
    decided: bool = False
    steps: int = 1


@dataclass(frozen=True)
class Rounds:
    """How often something is done, and what is known where a round begins."""

    loop: Loop
    state: State


def end_of(clauses: Sequence[Clause], at: int, *, branch: bool = False, rounds: bool = False) -> int:
    """Where the clauses end that belong to a condition or to rounds which begin before `at`.

    `branch` says that it is a second branch, behind which "then" goes on with what is done in either case. What is done
    after the whole ends them; in "first ..., finally ..." it is one of the row.
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


def same(one: Condition, other: Condition) -> bool:
    """Returns whether they look at the same, whatever the verb was."""
    return one in (other, contrary(other))


def contrary_of(supposed: Supposed) -> Supposed:
    """The contrary, with what is known then."""
    return replace(supposed.denied(f"not {supposed.said}"), told=False)


def sentence_of(supposed: Supposed) -> str | None:
    """What was found, as it is told; None where it was said otherwise."""
    said = supposed.said
    plain = supposed.told and not CLAUSES.deictic.search(said) and not re.match(r"it\b|there is one", said)
    return said if said and plain else None


def state_behind_both(one: State, other: State) -> State:
    """What is known behind two branches."""
    return replace(
        one,
        held=one.held if one.held == other.held else None,
        goal=one.goal if one.goal == other.goal else None,
        at=one.at if one.at == other.at else None,
    )


def one_errand(reading: PlainReading) -> bool:
    """Returns whether the commands are all about one thing, or only go somewhere and back."""
    things = {str(thing) for command in reading.commands for thing in (command.item, command.object) if thing}
    going = [action for action in reading.trace.resolved if action.kind is VerbKind.GO]
    bare = sum(command.item is None and command.task is None for command in reading.commands)
    return len(things) == 1 if not bare else not things and bare <= 2 and bool(going) and going[-1].goal == HERE


def looked_at_by(reading: PlainReading, before: State, reader: PlainReader) -> LookedAt | None:
    """What the last command looked at, or takes."""
    commands = reading.commands
    if commands and commands[-1].task is Task.FIND:
        looks = sum(command.task is Task.FIND for command in commands)
        return LookedAt(reader.seen(reading, reading.state, before, ""), looked=True, steps=looks)
    taken = next((command for command in reversed(commands) if command.task is Task.GRASP), None)
    if taken is None:
        return None
    found = Command(goal=taken.goal, task=Task.FIND, object=taken.object, object_count=taken.object_count, verb="find")
    memory = replace(reading.state.memory, where=None, told=before.memory.told)
    fails = replace(reading.state, memory=memory, held=None, goal=None, at=None)
    return LookedAt(Supposed(Look.from_command(found), "", reading.state, fails), looked=False, steps=len(commands))


def where_it_is_taken(supposed: Supposed, steps: Steps, text: str) -> Supposed:
    """The condition at the place from where the thing is taken, when it says none of its own ("if there is one")."""
    taken = next((c for step in steps for c in step.commands if c.task is Task.GRASP), None)
    condition = supposed.condition
    look = condition.part if isinstance(condition, Not) else condition
    placed = re.search(r"\b(?:in|on|at|inside|near)\b", text, re.IGNORECASE)
    if taken is None or placed or not isinstance(look, Look) or look.command.object != taken.object:
        return supposed
    there = Look.from_command(replace(look.command, goal=taken.goal))
    return replace(supposed, condition=Not(part=there) if isinstance(condition, Not) else there)


def checked_statement(text: str) -> str | None:
    """What is checked, as a statement: "is the door open" becomes "the door is open"."""
    match = ACTS.checked.fullmatch(text)
    if match is None or match["what"] is not None:
        return None if match is None else match["what"]
    found = next((found for form in ACTS.each("asked") if (found := form.fullmatch(match["asked"]))), None)
    return None if found is None else f"{found[1]} {'are' if found[1].lower() == 'you' else 'is'} {found[2]}"


def unclear(found: Clause) -> RefusalError:
    """The refusal of what could belong to more than one thing."""
    said = f"{found.cue} {found.text}".strip()
    return RefusalError(f"it is not clear to what '{said}' belongs; say it first", [said])


def nothing_said(cue: str, text: str = "") -> RefusalError:
    """The refusal of a condition behind which it is not said what is to be done."""
    return RefusalError(f"what am I to do {f'{cue.lower()} {text}'.strip()}?", [f"{cue} {text}".strip()])


def seconds_of_cue(cue: str) -> float:
    """The seconds of "every ten minutes"."""
    words = re.sub(r"^(?:once )?(?:every|each|per) |^once (?=an? )|^once per ", "", cue, flags=re.IGNORECASE)
    seconds = seconds_of(words if words not in ("hour", "minute") else f"a {words}")
    if seconds is None:
        raise RefusalError(f"'{cue}' is no time that I understand", [cue])
    return seconds


def times_of_cue(cue: str) -> int:
    """How often "do this three times" is. Raises RefusalError: it is no number of times."""
    words = re.sub(r"^(?:do|repeat) (?:this |that |the following |it )?|^for ", "", cue, flags=re.IGNORECASE)
    count = times_of(words)
    if count is None:
        raise RefusalError(f"'{cue}' is no number of times that I understand", [cue])
    return count
