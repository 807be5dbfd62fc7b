"""Steps as they are put together from clauses, and what is asked of clauses, conditions and commands on the way."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

from executive.language.amounts import seconds_of, times_of
from executive.language.clauses import ACTS, CLAUSES, Behind, Clause, Cue, text_of
from executive.language.lexicon import VerbKind
from executive.language.questions import RefusalError
from executive.language.roles import HERE
from executive.language.structure.plain import PlainReader, PlainReading, State, Supposed, contrary
from executive.language.structure.requests import Done, template
from executive.words.command import Command, Task
from executive.words.condition import AllOf, Condition, Look, Not
from executive.words.leaf_steps import Speak, steps_of_commands
from executive.words.step import Step
from executive.words.steps import Loop, Steps


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

    `branch` says that it is a second branch, behind which "then" goes on with what is done in either case.
    """
    attached = (Cue.SO, Cue.NOT, Cue.OTHERWISE, Cue.FAILED)
    first = any(re.search(r"\bfirst\b", one.joint, re.IGNORECASE) for one in clauses[at : at + 1])
    for n in range(at, len(clauses)):
        one = clauses[n]
        if rounds:
            goes_on = one.kind in attached or (one.kind is Cue.IF and ACTS.pronoun.match(one.text) is not None)
            if (one.begins and n > at and not goes_on) or (n > at and (_after_all(one, first) or one.anyway)):
                return n
            continue
        if one.kind in attached or one.kind in (Cue.IF, Cue.UNLESS, Cue.SOON):
            return n
        if n > at and (one.begins or _after_all(one, first) or one.anyway or (branch and one.then)):
            return n
        if n == at and one.begins:
            return n
    return len(clauses)


def _after_all(clause: Clause, first: bool) -> bool:
    """Whether a clause is done after the whole; in "first ..., finally ..." it is one of the row."""
    return clause.outer and not first


def same(one: Condition, other: Condition) -> bool:
    """Whether they look at the same, whatever the verb was."""
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
    held = one.held if one.held == other.held else None
    goal = one.goal if one.goal == other.goal else None
    at = one.at if one.at == other.at else None
    return replace(one, held=held, goal=goal, at=at)


def one_errand(reading: PlainReading) -> bool:
    """Whether the commands are all about one thing, or only go somewhere and back."""
    things = {
        str(thing) for command in reading.commands for thing in (command.item, command.object) if thing is not None
    }
    going = [action for action in reading.trace.resolved if action.kind is VerbKind.GO]
    bare_goes = [command for command in reading.commands if command.item is None and command.task is None]
    if not bare_goes:
        return len(things) == 1
    back = going[-1].goal == HERE if going else False
    return not things and len(bare_goes) <= 2 and back


def looked_at_by(reading: PlainReading, before: State, reader: PlainReader) -> LookedAt | None:
    """What the last command looked at, or takes."""
    last = reading.commands[-1] if reading.commands else None
    taken = next((c for c in reversed(reading.commands) if c.task is Task.GRASP), None)
    memory = reading.state.memory
    if last is not None and last.task is Task.FIND:
        looks = [c for c in reading.commands if c.task is Task.FIND]
        conditions = tuple(map(Look.of, looks))
        known = reader.state_if_seen(reading, reading.state)
        fails = replace(known, memory=replace(known.memory, where=None, told=before.memory.told))
        condition: Condition = conditions[0] if len(conditions) == 1 else AllOf(parts=conditions)
        return LookedAt(Supposed(condition, "", known, fails), looked=True, steps=len(looks))
    if taken is None:
        return None
    look = Look.of(
        Command(goal=taken.goal, task=Task.FIND, object=taken.object, object_count=taken.object_count, verb="find")
    )
    fails = replace(
        reading.state, memory=replace(memory, where=None, told=before.memory.told), held=None, goal=None, at=None
    )
    return LookedAt(Supposed(look, "", reading.state, fails), looked=False, steps=len(reading.commands))


def where_it_is_taken(supposed: Supposed, steps: Steps, text: str) -> Supposed:
    """The condition at the place from where the thing is taken, when it says none of its own ("if there is one")."""
    taken = next((c for step in steps for c in step.commands if c.task is Task.GRASP), None)
    condition = supposed.condition
    look = condition.part if isinstance(condition, Not) else condition
    placed = re.search(r"\b(?:in|on|at|inside|near)\b", text, re.IGNORECASE)
    if taken is None or placed or not isinstance(look, Look) or look.command.object != taken.object:
        return supposed
    there = Look.of(replace(look.command, goal=taken.goal))
    return replace(supposed, condition=Not(part=there) if isinstance(condition, Not) else there)


def checked_statement(text: str) -> str | None:
    """What is checked, as a statement: "is the door open" becomes "the door is open"."""
    match = ACTS.checked.fullmatch(text)
    if match is None:
        return None
    if match["what"] is not None:
        return match["what"]
    asked = match["asked"]
    for form in (
        r"((?:the|that) (?:.*? )?door(?: .+?)?) (open|closed|shut|locked)",
        r"((?:the|your) (?:battery|charge).*?) (low|full|charged|below .+|above .+|over .+|under .+|at .+)",
    ):
        if (found := re.fullmatch(form, asked, re.IGNORECASE)) is not None:
            return f"{found[1]} is {found[2]}"
    found = re.fullmatch(
        r"(you) ((?:holding|carrying|lost|low on).*)|(it) ((?:after|before|past) .+)", asked, re.IGNORECASE
    )
    if found is not None:
        return f"{found[1] or found[3]} {'are' if found[1] else 'is'} {found[2] or found[4]}"
    return None


def say(text: str) -> Speak:
    """A step that says a text."""
    return Speak(speak=template(text))


def unclear(found: Behind) -> RefusalError:
    """The refusal of what could belong to more than one thing."""
    said = f"{found.cue} {found.text}".strip()
    return RefusalError(f"it is not clear to what '{said}' belongs; say it first", [said])


def was_not(clauses: Sequence[Clause], at: int) -> bool:
    """Whether "if not" stood before."""
    return any(one.kind is Cue.NOT for one in clauses[:at])


class Base:
    """Puts the steps of one sentence together. Its methods raise RefusalError.

    `told` is what "tell Robin" tells, `verb` the last verb by which something was to be brought, `notes` say what was
    taken for what; `special` says that it is more than a list of commands, also where it has no block.
    """

    told: str | None = None
    verb: str | None = None

    def __init__(self, reader: PlainReader) -> None:
        self.reader = reader
        self.notes: list[str] = []
        self.special = False

    def sequence(self, clauses: Sequence[Clause], state: State) -> tuple[Steps, State]:
        """The steps of clauses, one after the other."""
        raise NotImplementedError

    def flush(self, row: Row) -> None:
        """Understand the clauses that are still to be understood."""
        if not row.plain:
            return
        last = row.plain[-1].text
        reading, row.plain = self.read_together(row.plain, row.state), []
        self.add(row, reading)
        if row.asked is not None and row.asked.looked:
            there = re.sub(r"^(?:is|are) there ", "there is ", last, flags=re.IGNORECASE)
            said = checked_statement(last) or (there if there != last else "")
            row.asked = replace(row.asked, supposed=replace(row.asked.supposed, said=said))

    def read_together(self, clauses: Sequence[Clause], state: State) -> PlainReading:
        """What clauses that are plain commands ask for together."""
        return self.reader.commands_of(text_of([replace(clauses[0], joint=""), *clauses[1:]]), state, clauses[0].lead)

    def add(self, row: Row, reading: PlainReading) -> None:
        """Put what a plain part asks for."""
        self.notes += reading.trace.notes
        row.steps += steps_of_commands(reading.commands)
        before, row.state = row.state, reading.state
        row.asked = looked_at_by(reading, before, self.reader)

    def put(self, row: Row, block: Step, state: State) -> None:
        """Put a block; `state` is what is known behind it."""
        row.steps.append(block)
        row.state, row.asked = state, None

    def put_done(self, row: Row, done: Done) -> None:
        """Put steps with what is known behind them, and notes."""
        steps, row.state, notes = done
        row.steps += steps
        row.asked = None
        self.notes += notes

    def settle(self, row: Row) -> None:
        """A new sentence begins: what was said before stands for itself, where it is a request."""
        self.flush(row)
        row.begun = len(row.steps)


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
