"""Builds the steps of a mission from the clauses of a sentence."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Final

from executive.language.amounts import parse_seconds, parse_time, parse_times
from executive.language.clauses import (
    CHECKS,
    Clause,
    Cue,
    cut,
    end_of_scope,
    join_clauses,
    leading_cue,
    verb_positions,
)
from executive.language.items import verb
from executive.language.questions import RefusalError
from executive.language.structure.conditions import parse_condition, parse_wait, statement_of_check
from executive.language.structure.plain import (
    PlainReader,
    PlainReading,
    SpokenCondition,
    State,
    attempt,
    negate,
)
from executive.language.templates import Match, words_of
from executive.words.command import Task
from executive.words.leaf_steps import Awaited, Do, Speak, Wait, steps_of_commands
from executive.words.step import OnFailure, Step
from executive.words.steps import Choose, Group, Loop, Repeat, Steps, Together, Try

_ROUNDS: Final = (Cue.EVERY, Cue.TIMES, Cue.WHILE, Cue.UNTIL)
"""Cues of repeated actions."""


@dataclass(frozen=True)
class Rounds:
    """Number or condition of an action's rounds, and the state where a round begins."""

    loop: Loop
    holds: State
    statement: str | None = None


@dataclass
class Builder:
    """Builder of the steps for clauses. Its methods raise RefusalError for a clause that they cannot build.

    `state` is the state after the steps built so far, `at` the index of the next clause. `plain` are pending clauses,
    which will be understood together; `asked` is the last look or fetch; `begun` is the index of the present sentence's
    first step. `statement` is what "tell Robin" refers to, `given` the last clause with an object. `special` marks
    steps of more than plain words.
    """

    reader: PlainReader
    act: Callable[[Builder, Clause], None]
    clauses: list[Clause]
    state: State
    statement: str | None = None
    given: str | None = None
    steps: list[Step] = field(default_factory=list)
    plain: list[Clause] = field(default_factory=list)
    asked: SpokenCondition | None = None
    at: int = 0
    begun: int = 0
    special: bool = False

    def build(self) -> tuple[Steps, State]:
        """Builds the steps of all clauses, in order."""
        while self.at < len(self.clauses):
            clause = self.clauses[self.at]
            last = self.steps[-1] if self.steps and not self.plain else None
            if isinstance(last, Repeat) and last.loop.is_endless:
                raise RefusalError("nothing can follow an endless repetition; say how often", [clause.text])
            self.at += 1
            match clause.kind:
                case None if clause.anyway:
                    self._always(clause)
                case None:
                    self.act(self, clause)
                case Cue.SO | Cue.NOT | Cue.OTHERWISE | Cue.FAILED:
                    self._attach(clause)
                case _:
                    self._lead(clause)
        self.flush()
        return tuple(self.steps), self.state

    def _inner(self, clauses: Sequence[Clause], state: State, statement: str | None) -> Builder:
        clauses = [replace(one, joint="" if n == 0 else one.joint) for n, one in enumerate(clauses)]
        return Builder(self.reader, self.act, clauses, state, statement, self.given)

    def nest(
        self, clauses: Sequence[Clause], state: State, supposed: SpokenCondition | None = None
    ) -> tuple[Steps, State]:
        """Builds the steps of clauses inside others; in the branch of a condition, "tell Robin" refers to it."""
        inner = self._inner(clauses, state, self.statement if supposed is None else supposed.statement)
        inner.special = self.special and supposed is None
        found = inner.build()
        self.given, self.special = inner.given, self.special or inner.special
        return found

    def flush(self) -> None:
        """Understands the pending clauses, and adds their steps."""
        if not self.plain:
            return
        try:
            reading = self._read_together(self.plain, self.state)
        except RefusalError:
            for n in range(1, len(self.plain)):  # the first clause that cannot be understood
                self._read_together(self.plain[:n], self.state)
            raise
        last, self.plain = self.plain[-1].text, []
        there = CHECKS["asks_there"].fullmatch(last)
        self.add(reading, statement_of_check(last) or ("" if there is None else there.instead))

    def _read_together(self, clauses: Sequence[Clause], state: State) -> PlainReading:
        """Understands several plain clauses together."""
        text = join_clauses([replace(clauses[0], joint=""), *clauses[1:]])
        reading = attempt(self.reader.read_commands, text, state, clauses[0].lead)
        if isinstance(reading, RefusalError):
            reading.plain = not self.special
            raise reading
        return reading

    def known(self) -> State:
        """State after the pending clauses."""
        return self._read_together(self.plain, self.state).state if self.plain else self.state

    def add(self, reading: PlainReading, said: str = "") -> None:
        """Adds the commands of a plain part of the sentence; `said` is the statement of its last look."""
        self.steps += steps_of_commands(reading.commands)
        self.asked = self.reader.last_check(reading, self.state, said)
        self.state = reading.state

    def put(self, steps: Steps, state: State) -> None:
        """Adds steps behind those of the pending clauses, with the state after them."""
        self.flush()
        self.steps += steps
        self.state, self.asked, self.special = state, None, True

    def take(self, text: str, end: int) -> list[Clause]:
        """Takes the clauses in a text and those up to an index."""
        found, self.at = [*cut(text), *self.clauses[self.at : end]], end
        return found

    def ahead(self) -> str:
        """Words of the next clause; empty if it begins with a cue."""
        following = self.clauses[self.at] if self.at < len(self.clauses) else None
        return following.text if following is not None and following.kind is None else ""

    def _always(self, clause: Clause) -> None:
        """Adds steps that run at the end, whatever happens."""
        self.flush()
        if not self.steps:
            raise RefusalError("say what I am to do first, before what I am to do in any case", [clause.text])
        ended = re.sub(r"[, ]+(?:at the end|in the end)$", "", clause.without_whatever, flags=re.IGNORECASE)
        rest = [replace(clause, text=ended), *self.take("", len(self.clauses))]
        always, state = self.nest(rest, self.state.elsewhere)
        self.steps = [Group(steps=tuple(self.steps), always=always)]
        self.state, self.asked = state, None

    def _lead(self, clause: Clause) -> None:
        """Builds a clause with a cue before its action: "if", "as soon as", "every ten minutes"."""
        end = end_of_scope(self.clauses, self.at, rounds=clause.kind in _ROUNDS)
        follows = self.clauses[self.at : end]
        if clause.kind in (Cue.IF, Cue.UNLESS) and self._stands_behind(clause, follows):
            return
        self.flush()
        if (under_way := self._under_way(clause)) is not None:
            at = next((one for one in _places_to_cut(clause.text, follows) if one > under_way.end), len(clause.text))
            self._put_together(clause.text[under_way.end : at], self.take(clause.text[at:], end))
            return
        head, rest = self._split(clause, follows)
        body = self.take(rest, end)
        if not body:
            raise clause.missing_action(clause.text)
        if isinstance(head, Rounds):
            said = clause.text[: len(clause.text) - len(rest)].strip(" ,")
            self._put_rounds(head, body, f"{body[0].text} {clause.cue} {said}")
        elif clause.kind is Cue.SOON:
            self.put((Wait(awaited=Awaited(condition=head.condition)),), head.holds)
            self.clauses[self.at : self.at] = body
            self.begun = len(self.steps)
        else:
            self._decide(clause, head, body)

    def _stands_behind(self, clause: Clause, follows: Sequence[Clause]) -> bool:
        """Adds the pending action with a whole condition that stands behind it: "bring me a beer, if there is one"."""
        bare_and = bool(follows) and re.match(r",?\s*and\b", follows[0].joint.strip(), re.IGNORECASE) is not None
        if not (self.plain or self.steps) or clause.begins or (follows and not bare_and):
            return False
        if isinstance(attempt(parse_condition, clause.text, self.known(), self.reader), RefusalError):
            return False
        if not self.plain:
            raise RefusalError(f"what am I to do {clause.cue} {clause.text}? Say the condition first", [clause.text])
        main = self.plain.pop()
        self.modify(main, replace(clause, before=main.text))
        return True

    def _under_way(self, cue: Clause) -> Match | None:
        """Match of "while driving to the kitchen"."""
        return CHECKS["under_way"].match(cue.text) if cue.kind is Cue.WHILE else None

    def _split(self, clause: Clause, follows: Sequence[Clause]) -> tuple[SpokenCondition | Rounds, str]:
        """Splits a condition or rounds from an action that follows without a comma."""
        text, refusals = clause.text, list[RefusalError]()
        if clause.kind is Cue.TIMES or (clause.kind is Cue.EVERY and not CHECKS["limited"].match(text)):
            return self._read(replace(clause, text=""), self.state), text
        begins = [start for start, _ in words_of(text).spans[1:]] if self.given is not None else []
        objects = [start for start in begins if CHECKS["no_verb"].fullmatch(text[start:])]
        for cut_at in (*_places_to_cut(text, follows), *objects, len(text)):
            rest = re.sub(r"^(?:then|please)\s+", "", text[cut_at:], flags=re.IGNORECASE)
            said = re.sub(r"\s+(?:then|please|and)$", "", text[:cut_at].rstrip(" ,"), flags=re.IGNORECASE)
            head = attempt(self._read, replace(clause, text=said), self.state)
            if isinstance(head, RefusalError):
                refusals.append(head)
                continue
            body = [*cut(rest), *follows] if rest else []
            done = attempt(self._inner(body, head.holds, head.statement).build)
            if not isinstance(done, RefusalError):
                return head, rest
            refusals.insert(0, done)  # the refusal of the action says more
        raise next((refusal for refusal in refusals if refusal.question is not None), refusals[0])

    def _decide(self, clause: Clause, supposed: SpokenCondition, body: Sequence[Clause]) -> None:
        """Builds a choice for "if" and "unless"; a look or fetch before it may belong to the choice."""
        asked = self.asked
        if asked is not None and asked.looked:
            if supposed.condition in (asked.condition, negate(asked.condition)):
                del self.steps[-asked.steps :]
        elif asked is not None and clause.kind is Cue.IF:
            there = supposed.at_source(tuple(self.steps[-asked.steps :]), clause.text).condition
            if there == negate(asked.condition):  # get a coke; if there is no coke, get a beer
                self._replace_missing(asked, supposed.said, body)
                return
        self._choose(supposed.opposite if clause.kind is Cue.UNLESS else supposed, body)

    def _choose(self, supposed: SpokenCondition, body: Sequence[Clause], more: tuple[Cue, ...] = ()) -> None:
        """Adds a choice of two branches, of which the next clause may begin the second, also with one of the cues."""
        then, after = self.nest(body, supposed.holds, supposed)
        otherwise: Steps = ()
        other = supposed.fails
        second = self.clauses[self.at] if self.at < len(self.clauses) else None
        if second is not None and second.kind in (Cue.OTHERWISE, Cue.NOT, Cue.SO, *more):
            if second.kind is Cue.SO and all(one.kind is not Cue.NOT for one in self.clauses[: self.at]):
                raise RefusalError(f"I do not understand '{second.cue}' here", [second.cue])
            self.at += 1
            decides = [one.kind for one in cut(second.text)[:1]] == [Cue.IF]
            rest = self.take(
                second.text, len(self.clauses) if decides else end_of_scope(self.clauses, self.at, branch=True)
            )
            if not rest:
                raise second.missing_action()
            if other.memory.objects == () or other.memory.objects[-1].person:
                other = replace(other, memory=replace(other.memory, objects=after.memory.objects))
            otherwise, other = self.nest(rest, other, supposed.opposite)
        if not (then or otherwise):
            raise RefusalError("no action is said for either case; name one", [supposed.said])
        condition = supposed.condition if then else negate(supposed.condition)
        block = Choose(condition=condition, then=then or otherwise, otherwise=otherwise if then else ())
        self.put((block,), after.common(other))

    def _attach(self, clause: Clause) -> None:
        """Builds a branch for "if so", "otherwise" or "if that fails", which refers to the last look or action."""
        self.flush()
        cue, words, asked = clause.kind, [clause.cue], self.asked
        if cue in (Cue.SO, Cue.NOT) and asked is None and CHECKS["somebody"].search(clause.cue):
            said = re.sub(r"^if ", "", clause.cue, flags=re.IGNORECASE)
            self._lead(replace(clause, kind=Cue.IF, text=f"{said} {clause.text}".strip()))
            return
        if not self.steps[self.begun :] and not (asked and self.steps):
            raise RefusalError(f"'{clause.cue}' refers to nothing that was said before", words)
        looked = asked is not None and asked.looked and cue is not Cue.FAILED
        body = self.take(clause.text, end_of_scope(self.clauses, self.at, branch=not looked))
        if not body:
            raise clause.missing_action()
        if asked is not None and looked:
            del self.steps[-asked.steps :]
            self._choose(asked if cue is Cue.SO else asked.opposite, body)
            return
        last = self.steps[-1] if self.steps else None
        if cue is Cue.SO or (isinstance(last, Choose | Repeat) and cue is not Cue.FAILED):
            raise RefusalError(f"I do not understand what '{clause.cue}' refers to; say the whole condition", words)
        if cue is Cue.NOT and clause.cue.lower() not in ("if not", "if no"):
            if asked is None:
                raise RefusalError(f"'{clause.cue}' refers to no earlier look", words)
            self._replace_missing(asked, clause.cue, body)
        else:
            otherwise, state = self.nest(body, replace(self.state.elsewhere, held=None))
            tried = tuple(self.steps[self.begun :])
            skipped = Group(steps=tried, on_failure=OnFailure.SKIP)
            self._wrap(len(tried), Try(steps=tried, otherwise=otherwise) if otherwise else skipped, state)

    def _wrap(self, count: int, block: Step, state: State) -> None:
        """Replaces the last steps by a block that contains them; `state` is the state after its other branch."""
        del self.steps[len(self.steps) - count :]
        self.put((block,), self.state.common(state))

    def _replace_missing(self, asked: SpokenCondition, said: str, body: Sequence[Clause]) -> None:
        """Builds a choice: the last steps if their object is found, otherwise the steps of the body.

        Raises RefusalError when "there" could be the object's source or its destination.
        """
        done = tuple(self.steps[-asked.steps :])
        puts = any(command.task is Task.PLACE for step in done for command in step.commands)
        if puts and re.search(r"\bthere$", said, re.IGNORECASE):
            raise RefusalError(f"'{said}' could mean two places; name the place", [said])
        otherwise, state = self.nest(body, asked.fails, asked.opposite)
        self._wrap(len(done), Choose(condition=asked.condition, then=done, otherwise=otherwise), state)

    def _read(self, cue: Clause, state: State) -> SpokenCondition | Rounds:
        """Condition, or rounds, of a cue and its words: "three times", "every hour for a day", "until it is open"."""
        if cue.kind not in _ROUNDS:
            return parse_condition(cue.text, state, self.reader)
        every_s, times = parse_seconds(cue.amount), parse_times(cue.amount)
        if cue.amount and every_s is None and times is None:
            what = "number of times" if cue.kind is Cue.TIMES else "time"
            raise RefusalError(f"'{cue.cue}' is no {what} that I understand", [cue.cue])
        if cue.kind is Cue.EVERY and every_s:  # "for an hour" and "until three" may stand behind
            times = parse_times(cue.text)
            if (match := CHECKS["for_span"].fullmatch(cue.text)) is not None:
                times = int((parse_seconds(match["span"]) or 0.0) // every_s)
                if times < 1:
                    raise RefusalError(f"'{cue.text}' is shorter than one round", [cue.text])
        if times is not None or (every_s is not None and not cue.text):
            return Rounds(Loop(times=times, every_s=every_s), state)
        ends = leading_cue(cue.text) if cue.kind is Cue.EVERY else cue
        if ends is None or ends.kind not in (Cue.UNTIL, Cue.WHILE):
            raise RefusalError(f"I do not understand how often: '{cue.cue} {cue.text}'", [cue.cue])
        if ends.kind is Cue.UNTIL and (time := parse_time(ends.text)) is not None:
            return Rounds(Loop(until_clock=time.text, every_s=every_s), state.noting(time.notes(ends.text)))
        supposed = parse_condition(ends.text, state, self.reader)
        if ends.kind is Cue.UNTIL:
            return Rounds(Loop(until=supposed.condition, every_s=every_s), supposed.fails)
        return Rounds(Loop(while_=supposed.condition, every_s=every_s), supposed.holds)

    def _put_rounds(self, rounds: Rounds, body: Sequence[Clause], waits: str = "") -> None:
        """Adds rounds that repeat given clauses, or a wait if the text `waits` asks for one."""
        ends = rounds.loop.times is None and rounds.loop.every_s is None
        stays = ends and len(body) == 1 and CHECKS["stays"].fullmatch(body[0].text) is not None
        if stays and (done := parse_wait(waits, self.known, self.reader)) is not None:
            self.put(*done)
            return
        loop, (steps, state) = rounds.loop, self.nest(body, rounds.holds.elsewhere)
        commands = [command for step in steps for each in step.walk() for command in each.commands]
        stays = len(commands) == 1 and commands[0].item is None and commands[0].task in (None, Task.CHARGE)
        if ends and stays and all(isinstance(step, Do) for step in steps):  # only goes to one place, or charges
            raise RefusalError("I see no action to repeat; say 'wait there until ...'", [join_clauses(body)])
        if not steps:
            what = join_clauses(body)
            raise RefusalError(f"'{what}' is nothing to do; leave it out", [what])
        behind: Steps = ()
        if isinstance(inner := steps[0], Repeat):  # every hour .. until noon: one loop with both
            ends_inside = inner.loop.times is None and inner.loop.every_s is None
            if len(steps) == 1 and inner.loop.is_endless and not ends:
                raise RefusalError("an endless repetition cannot be repeated again; say how often", [])
            if len(steps) == 1 and inner.loop.is_endless:
                loop, steps = loop.model_copy(update={"every_s": inner.loop.every_s}), inner.steps
            elif loop.is_endless and ends_inside:
                loop, behind = inner.loop.model_copy(update={"every_s": loop.every_s}), steps[1:]
                steps = inner.steps
        self.put((Repeat(loop=loop, steps=steps), *behind), state)

    def _put_together(self, where: str, body: Sequence[Clause]) -> None:
        """Adds speech in parallel to a drive."""
        reading = self.reader.read_commands(where.strip(" ,"), self.state, (verb("go"),))
        said, _ = self.nest(body, reading.state) if body else ((), None)
        if [type(step) for step in said] != [Speak] or len(reading.commands) != 1:
            raise RefusalError("while I go somewhere I can only say something", [join_clauses(body)])
        self.put((Together(steps=(Do.from_command(reading.commands[0]), *said)),), reading.state)

    def modify(self, clause: Clause, cue: Clause) -> None:
        """Adds an action that a trailing condition or number of rounds modifies."""
        if cue.kind is Cue.TIMES and cue.text:
            raise RefusalError(f"I do not understand how often: '{cue.cue} {cue.text}'", [cue.cue])
        if not cue.text and cue.kind not in (Cue.EVERY, Cue.TIMES):
            raise RefusalError(f"{cue.cue.lower()} what?", [cue.cue])
        scope, before = self._scope(clause, cue), self.state
        if (under_way := self._under_way(cue)) is not None:
            self._put_together(cue.text[under_way.end :], scope)
            return
        steps, state = self._inner(scope, before, self.statement).build()  # "if there is one", "until there are none"
        head = self._read(cue, state if cue.kind in _ROUNDS else replace(state, goal=before.goal, at=before.at))
        noted = before.noting(head.holds.notes)
        if isinstance(head, Rounds):
            self._put_rounds(replace(head, holds=noted), scope)
            return
        supposed = head.at_source(steps, cue.text)
        begun = replace(noted, goal=supposed.holds.goal)
        if cue.kind is Cue.IF:
            begun = replace(begun, memory=replace(begun.memory, locations=supposed.holds.memory.locations))
        both = supposed.negate(supposed.said) if cue.kind is Cue.UNLESS else supposed
        self._choose(replace(both, holds=begun), scope, (Cue.FAILED,))

    def _scope(self, clause: Clause, cue: Clause) -> list[Clause]:
        """Clauses that a trailing cue applies to. Raises RefusalError when these are ambiguous."""
        alone = clause.begins or (clause.then and not CHECKS["comes_back"].fullmatch(cue.before))
        starts = (n for n, one in enumerate(self.plain) if one.begins or (one.then and n))
        start = len(self.plain) if alone else max(starts, default=0)
        earlier, self.plain = self.plain[start:], self.plain[:start]
        first = not (earlier or self.plain or clause.begins or clause.then)
        unclear = first and bool(self.steps[self.begun :])
        self.flush()
        scope = [*earlier, replace(clause, text=cue.before)]
        scope[0] = replace(scope[0], joint="")
        if unclear or (earlier and not self._read_together(scope, self.state).one_errand):
            said = f"{cue.cue} {cue.text}".strip()
            raise RefusalError(f"it is not clear which action '{said}' belongs to; say it first", [said])
        return scope


def _places_to_cut(text: str, follows: Sequence[Clause]) -> Iterator[int]:
    """Yields where an action may begin: behind the text if clauses follow, and at verbs in it."""
    if follows:
        yield len(text)
    yield from verb_positions(text)
