"""Builds the steps of a mission from the clauses of a sentence."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import Final

from executive.language.amounts import parse_seconds, parse_time, parse_times
from executive.language.clauses import CHECKS, Clause, Cue, cut, end_of_scope, join_clauses, leading_cue, verb_positions
from executive.language.items import verb
from executive.language.questions import RefusalError
from executive.language.structure.conditions import Done, parse_condition, parse_wait, statement_of_check
from executive.language.structure.plain import PlainReader, PlainReading, SpokenCondition, State, attempt, require
from executive.language.templates import Match, words_of
from executive.words.leaf_steps import Awaited, Do, Speak, Wait
from executive.words.step import OnFailure, Step
from executive.words.steps import Choose, Group, Loop, Repeat, Steps, Together, Try

ROUNDS: Final = (Cue.EVERY, Cue.TIMES, Cue.WHILE, Cue.UNTIL)
"""Cues of repeated actions."""
_HOW_OFTEN: Final = "I do not understand how often: '{} {}'"


def is_paced(loop: Loop) -> bool:
    """Returns whether rounds have a number or an interval."""
    return loop.times is not None or loop.every_s is not None


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

    def build(self) -> Done:
        """Builds the steps of all clauses, in order."""
        while self.at < len(self.clauses):
            clause = self.clauses[self.at]
            last = self.steps[-1] if self.steps and not self.plain else None
            endless = isinstance(last, Repeat) and last.loop.is_endless
            require(not endless, "nothing can follow an endless repetition; say how often", clause.text)
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

    def nest(self, clauses: Sequence[Clause], state: State, supposed: SpokenCondition | None = None) -> Done:
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
        try:
            return self.reader.read_commands(text, state, clauses[0].lead)
        except RefusalError as refusal:
            refusal.plain = not self.special
            raise

    def known(self) -> State:
        """State after the pending clauses."""
        return self._read_together(self.plain, self.state).state if self.plain else self.state

    def add(self, reading: PlainReading, said: str = "") -> None:
        """Adds the commands of a plain part of the sentence; `said` is the statement of its last look."""
        self.steps += reading.steps
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

    def body(self, clause: Clause, text: str, end: int, said: str = "") -> list[Clause]:
        """Takes the clauses that a cue decides about. Raises RefusalError when there are none."""
        what = f"what am I to do {f'{clause.cue.lower()} {said}'.strip()}?"
        return require(self.take(text, end), what, f"{clause.cue} {said}".strip())

    def insert(self, clauses: Iterable[Clause]) -> None:
        """Inserts clauses before the next one."""
        self.clauses[self.at : self.at] = clauses

    @property
    def following(self) -> Clause | None:
        """Next clause; None behind the last."""
        return self.clauses[self.at] if self.at < len(self.clauses) else None

    def ahead(self) -> str:
        """Words of the next clause; empty if it begins with a cue."""
        return self.following.text if self.following is not None and self.following.kind is None else ""

    def _always(self, clause: Clause) -> None:
        """Adds steps that run at the end, whatever happens."""
        self.flush()
        require(self.steps, "say what I am to do first, before what I am to do in any case", clause.text)
        ended = re.sub(r"[, ]+(?:at the end|in the end)$", "", clause.without_whatever, flags=re.IGNORECASE)
        rest = [replace(clause, text=ended), *self.take("", len(self.clauses))]
        always, state = self.nest(rest, self.state.elsewhere)
        self.steps = [Group(steps=tuple(self.steps), always=always)]
        self.state, self.asked = state, None

    def _lead(self, clause: Clause) -> None:
        """Builds a clause with a cue before its action: "if", "as soon as", "every ten minutes"."""
        end = end_of_scope(self.clauses, self.at, rounds=clause.kind in ROUNDS)
        follows = self.clauses[self.at : end]
        if clause.kind in (Cue.IF, Cue.UNLESS) and self._stands_behind(clause, follows):
            return
        self.flush()
        if (under_way := _under_way(clause)) is not None:
            at = next((one for one in _places_to_cut(clause.text, follows) if one > under_way.end), len(clause.text))
            self._put_together(clause.text[under_way.end : at], self.take(clause.text[at:], end))
            return
        head, rest = self._split(clause, follows)
        body = self.body(clause, rest, end, clause.text)
        if isinstance(head, Rounds):
            said = clause.text[: len(clause.text) - len(rest)].strip(" ,")
            self._put_rounds(head, body, f"{body[0].text} {clause.cue} {said}")
        elif clause.kind is Cue.SOON:
            self.put((Wait(awaited=Awaited(condition=head.condition)),), head.holds)
            self.insert(body)
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
        what = f"what am I to do {clause.cue} {clause.text}? Say the condition first"
        main = require(self.plain, what, clause.text).pop()
        self.modify(main, replace(clause, before=main.text))
        return True

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
            if supposed.condition in (asked.condition, asked.opposite.condition):
                del self.steps[-asked.steps :]
        elif asked is not None and clause.kind is Cue.IF:
            there = supposed.at_source(tuple(self.steps[-asked.steps :]), clause.text).condition
            if there == asked.opposite.condition:  # get a coke; if there is no coke, get a beer
                self._replace_missing(asked, supposed.said, body)
                return
        self._choose(supposed.opposite if clause.kind is Cue.UNLESS else supposed, body)

    def _choose(self, supposed: SpokenCondition, body: Sequence[Clause], more: tuple[Cue, ...] = ()) -> None:
        """Adds a choice of two branches, of which the next clause may begin the second, also with one of the cues."""
        then, after = self.nest(body, supposed.holds, supposed)
        otherwise, other = self._second_branch(supposed, after, more)
        require(then or otherwise, "no action is said for either case; name one", supposed.said)
        condition = (supposed if then else supposed.opposite).condition
        block = Choose(condition=condition, then=then or otherwise, otherwise=otherwise if then else ())
        self.put((block,), after.common(other))

    def _second_branch(self, supposed: SpokenCondition, after: State, more: tuple[Cue, ...]) -> Done:
        """Builds the second branch of a choice; no steps unless the next clause begins it."""
        second, other = self.following, supposed.fails
        if second is None or second.kind not in (Cue.OTHERWISE, Cue.NOT, Cue.SO, *more):
            return (), other
        clear = second.kind is not Cue.SO or any(one.kind is Cue.NOT for one in self.clauses[: self.at])
        require(clear, f"I do not understand '{second.cue}' here", second.cue)
        self.at += 1
        decides = [one.kind for one in cut(second.text)[:1]] == [Cue.IF]
        end = len(self.clauses) if decides else end_of_scope(self.clauses, self.at, branch=True)
        body = self.body(second, second.text, end)
        if other.memory.objects == () or other.memory.objects[-1].person:
            other = other.recalling(objects=after.memory.objects)
        return self.nest(body, other, supposed.opposite)

    def _attach(self, clause: Clause) -> None:
        """Builds a branch for "if so", "otherwise" or "if that fails", which refers to the last look or action."""
        self.flush()
        asked, nothing = self.asked, f"'{clause.cue}' refers to nothing that was said before"
        if clause.kind in (Cue.SO, Cue.NOT) and asked is None and CHECKS["somebody"].search(clause.cue):
            said = re.sub(r"^if ", "", clause.cue, flags=re.IGNORECASE)
            self._lead(replace(clause, kind=Cue.IF, text=f"{said} {clause.text}".strip()))
            return
        require(self.steps[self.begun :] or (asked and self.steps), nothing, clause.cue)
        looked = asked if asked is not None and asked.looked and clause.kind is not Cue.FAILED else None
        body = self.body(clause, clause.text, end_of_scope(self.clauses, self.at, branch=looked is None))
        if looked is not None:
            del self.steps[-looked.steps :]
            self._choose(looked if clause.kind is Cue.SO else looked.opposite, body)
        else:
            self._attach_to_action(clause, body)

    def _attach_to_action(self, clause: Clause, body: Sequence[Clause]) -> None:
        """Builds what is done when the last action fails, or its object is missing."""
        block = isinstance(self.steps[-1], Choose | Repeat) and clause.kind is not Cue.FAILED
        unclear = f"I do not understand what '{clause.cue}' refers to; say the whole condition"
        require(clause.kind is not Cue.SO and not block, unclear, clause.cue)
        if clause.kind is Cue.NOT and clause.cue.lower() not in ("if not", "if no"):
            asked = require(self.asked, f"'{clause.cue}' refers to no earlier look", clause.cue)
            self._replace_missing(asked, clause.cue, body)
            return
        otherwise, state = self.nest(body, replace(self.state.elsewhere, held=None))
        tried = tuple(self.steps[self.begun :])
        skipped = Group(steps=tried, on_failure=OnFailure.SKIP)
        self._wrap(len(tried), Try(steps=tried, otherwise=otherwise) if otherwise else skipped, state)

    def _wrap(self, count: int, block: Step, state: State) -> None:
        """Replaces the last steps by a block that contains them; `state` is the state after its other branch."""
        del self.steps[len(self.steps) - count :]
        self.put((block,), self.state.common(state))

    def _replace_missing(self, asked: SpokenCondition, said: str, body: Sequence[Clause]) -> None:
        """Builds a choice: the last steps if their object is found (at its source), otherwise the steps of the body."""
        done = tuple(self.steps[-asked.steps :])
        puts = any(command.puts for step in done for command in step.commands)
        two_places = puts and re.search(r"\bthere$", said, re.IGNORECASE) is not None
        require(not two_places, f"'{said}' could mean two places; name the place", said)
        otherwise, state = self.nest(body, asked.fails, asked.opposite)
        self._wrap(len(done), Choose(condition=asked.condition, then=done, otherwise=otherwise), state)

    def _read(self, cue: Clause, state: State) -> SpokenCondition | Rounds:
        """Condition, or rounds, of a cue and its words: "three times", "every hour for a day", "until it is open"."""
        if cue.kind not in ROUNDS:
            return parse_condition(cue.text, state, self.reader)
        every_s = parse_seconds(cue.amount)
        times, what = _times(cue, every_s), "number of times" if cue.kind is Cue.TIMES else "time"
        require(not cue.amount or every_s or times, f"'{cue.cue}' is no {what} that I understand", cue.cue)
        if times is not None or (every_s is not None and not cue.text):
            return Rounds(Loop(times=times, every_s=every_s), state)
        ends = leading_cue(cue.text) if cue.kind is Cue.EVERY else cue
        if ends is None or ends.kind not in (Cue.UNTIL, Cue.WHILE):
            raise RefusalError(_HOW_OFTEN.format(cue.cue, cue.text), [cue.cue])
        if ends.kind is Cue.UNTIL and (time := parse_time(ends.text)) is not None:
            return Rounds(Loop(until_clock=time.text, every_s=every_s), state.noting(time.notes(ends.text)))
        supposed = parse_condition(ends.text, state, self.reader)
        if ends.kind is Cue.UNTIL:
            return Rounds(Loop(until=supposed.condition, every_s=every_s), supposed.fails)
        return Rounds(Loop(while_=supposed.condition, every_s=every_s), supposed.holds)

    def _put_rounds(self, rounds: Rounds, body: Sequence[Clause], waits: str = "") -> None:
        """Adds rounds that repeat given clauses, or a wait if the text `waits` asks for one."""
        ends, what = not is_paced(rounds.loop), join_clauses(body)
        stays = ends and len(body) == 1 and CHECKS["stays"].fullmatch(body[0].text) is not None
        if stays and (done := parse_wait(waits, self.known, self.reader)) is not None:
            self.put(*done)
            return
        steps, state = self.nest(body, rounds.holds.elsewhere)
        require(not (ends and _only_goes(steps)), "I see no action to repeat; say 'wait there until ...'", what)
        self.put(_repeat(rounds.loop, require(steps, f"'{what}' is nothing to do; leave it out", what)), state)

    def _put_together(self, where: str, body: Sequence[Clause]) -> None:
        """Adds speech in parallel to a drive."""
        reading = self.reader.read_commands(where.strip(" ,"), self.state, (verb("go"),))
        said, _ = self.nest(body, reading.state) if body else ((), None)
        speaks = [type(step) for step in said] == [Speak] and len(reading.commands) == 1
        require(speaks, "while I go somewhere I can only say something", join_clauses(body))
        self.put((Together(steps=(*reading.steps, *said)),), reading.state)

    def modify(self, clause: Clause, cue: Clause) -> None:
        """Adds an action that a trailing condition or number of rounds modifies."""
        require(cue.kind is not Cue.TIMES or not cue.text, _HOW_OFTEN.format(cue.cue, cue.text), cue.cue)
        require(cue.kind in (Cue.EVERY, Cue.TIMES) or cue.text, f"{cue.cue.lower()} what?", cue.cue)
        scope, before = self._scope(clause, cue), self.state
        if (under_way := _under_way(cue)) is not None:
            self._put_together(cue.text[under_way.end :], scope)
            return
        steps, state = self._inner(scope, before, self.statement).build()  # "if there is one", "until there are none"
        head = self._read(cue, state if cue.kind in ROUNDS else replace(state, goal=before.goal, at=before.at))
        noted = before.noting(head.holds.notes)
        if isinstance(head, Rounds):
            self._put_rounds(replace(head, holds=noted), scope)
            return
        supposed = head.at_source(steps, cue.text)
        begun = replace(noted, goal=supposed.holds.goal)
        if cue.kind is Cue.IF:
            begun = begun.recalling(locations=supposed.holds.memory.locations)
        both = supposed.negate(supposed.said) if cue.kind is Cue.UNLESS else supposed
        self._choose(replace(both, holds=begun), scope, (Cue.FAILED,))

    def _scope(self, clause: Clause, cue: Clause) -> list[Clause]:
        """Clauses that a trailing cue applies to. Raises RefusalError when these are ambiguous."""
        alone = clause.begins or (clause.then and not CHECKS["comes_back"].fullmatch(cue.before))
        starts = (n for n, one in enumerate(self.plain) if one.begins or (one.then and n))
        start = len(self.plain) if alone else max(starts, default=0)
        earlier, self.plain = self.plain[start:], self.plain[:start]
        first = not (earlier or self.plain or clause.begins or clause.then)
        own = cue.kind in ROUNDS and any(isinstance(one, Repeat) for one in self.steps[-1:])  # each has its rounds
        unclear = first and not own and bool(self.steps[self.begun :])
        self.flush()
        scope = [*earlier, replace(clause, text=cue.before)]
        scope[0] = replace(scope[0], joint="")
        clear = not unclear and (not earlier or self._read_together(scope, self.state).one_errand)
        said = f"{cue.cue} {cue.text}".strip()
        require(clear, f"it is not clear which action '{said}' belongs to; say it first", said)
        return scope


def _times(cue: Clause, every_s: float | None) -> int | None:
    """Number of rounds, which "for an hour" behind an interval also says."""
    if cue.kind is not Cue.EVERY or every_s is None:
        return parse_times(cue.amount)
    if (match := CHECKS["for_span"].fullmatch(cue.text)) is None:
        return parse_times(cue.text)
    times = int((parse_seconds(match["span"]) or 0.0) // every_s)
    return require(times, f"'{cue.text}' is shorter than one round", cue.text)


def _only_goes(steps: Steps) -> bool:
    """Returns whether steps only go to one place, or charge."""
    commands = [command for step in steps for command in step.commands if isinstance(step, Do)]
    only = commands[0] if len(steps) == len(commands) == 1 else None
    return only is not None and not only.item and (only.task is None or only.task.docks)


def _repeat(loop: Loop, steps: Steps) -> Steps:
    """Repeats steps; "every hour" and "until noon", one inside the other, become one loop."""
    inner = steps[0]
    if isinstance(inner, Repeat) and len(steps) == 1 and inner.loop.is_endless:
        require(not is_paced(loop), "an endless repetition cannot be repeated again; say how often")
        return (Repeat(loop=loop.model_copy(update={"every_s": inner.loop.every_s}), steps=inner.steps),)
    if isinstance(inner, Repeat) and loop.is_endless and not is_paced(inner.loop):
        return Repeat(loop=inner.loop.model_copy(update={"every_s": loop.every_s}), steps=inner.steps), *steps[1:]
    return (Repeat(loop=loop, steps=steps),)


def _under_way(cue: Clause) -> Match | None:
    """Match of "while driving to the kitchen"."""
    return CHECKS["under_way"].match(cue.text) if cue.kind is Cue.WHILE else None


def _places_to_cut(text: str, follows: Sequence[Clause]) -> list[int]:
    """Positions where an action may begin: behind the text if clauses follow, and at verbs in it."""
    return [*([len(text)] if follows else []), *verb_positions(text)]
