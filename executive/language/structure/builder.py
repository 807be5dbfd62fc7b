"""Builds the steps of a mission from the clauses of a sentence."""

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

from executive.language.amounts import parse_seconds, parse_time, parse_times
from executive.language.clauses import (
    ATTACHED,
    CHECKS,
    Clause,
    Cue,
    cut,
    end_of_scope,
    join_clauses,
    leading_cue,
    verb_positions,
    without_whatever,
)
from executive.language.items import verb
from executive.language.questions import RefusalError
from executive.language.structure.conditions import Done, parse_condition, parse_wait, statement_of_check
from executive.language.structure.plain import (
    PlainReader,
    PlainReading,
    SpokenCondition,
    State,
    attempt,
    negate,
)
from executive.language.templates import words_of
from executive.words.command import Task
from executive.words.leaf_steps import Awaited, Do, Speak, Wait, steps_of_commands
from executive.words.step import OnFailure, Step
from executive.words.steps import Choose, Group, Loop, Repeat, Steps, Together, Try


@dataclass(frozen=True)
class Rounds:
    """Number or condition of an action's rounds, and the state where a round begins."""

    loop: Loop
    holds: State
    statement: str | None = None


_Head = TypeVar("_Head", bound=SpokenCondition | Rounds)


class Builder:
    """Builder of the steps for clauses. Its methods raise RefusalError for a clause that they cannot build.

    `state` is the state after the steps built so far, `at` the index of the next clause. `plain` are pending clauses,
    which will be understood together; `asked` is the last look or fetch; `begun` is the index of the present sentence's
    first step. `statement` is what "tell Robin" refers to, `given` the last clause with an object. `special` marks
    steps of more than plain words.
    """

    def __init__(
        self,
        reader: PlainReader,
        act: Callable[["Builder", Clause], None],
        clauses: Sequence[Clause],
        state: State,
        statement: str | None = None,
        given: str | None = None,
    ) -> None:
        self.reader, self.act, self.state, self.statement, self.given = reader, act, state, statement, given
        self.clauses, self.steps, self.plain = [*clauses], list[Step](), list[Clause]()
        self.asked: SpokenCondition | None = None
        self.at = self.begun = 0
        self.special = False

    def build(self) -> tuple[Steps, State]:
        """Builds the steps of all clauses, in order."""
        while self.at < len(self.clauses):
            clause = self.clauses[self.at]
            last = self.steps[-1] if self.steps and not self.plain else None
            if isinstance(last, Repeat) and last.loop.is_endless:
                raise RefusalError("nothing can follow an endless repetition; say how often", [clause.text])
            self.at += 1
            if clause.anyway:
                self._always(clause)
            elif clause.kind is None:
                self.act(self, clause)
            elif clause.kind in (Cue.IF, Cue.UNLESS):
                self._decide(clause)
            elif clause.kind in ATTACHED:
                self._attach(clause)
            elif clause.kind is Cue.SOON:
                self._wait(clause)
            else:
                self._repeat(clause)
        self.flush()
        return tuple(self.steps), self.state

    def _inner(self, clauses: Sequence[Clause], state: State, statement: str | None) -> "Builder":
        clauses = [replace(clauses[0], joint=""), *clauses[1:]]
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
        there = re.sub(r"^(?:is|are) there ", "there is ", last, flags=re.IGNORECASE)
        self.add(reading, statement_of_check(last) or (there if there != last else ""))

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
        ended = re.sub(r"[, ]+(?:at the end|in the end)$", "", without_whatever(clause.text), flags=re.IGNORECASE)
        rest = [replace(clause, text=ended), *self.take("", len(self.clauses))]
        always, state = self.nest(rest, self.state.elsewhere)
        self.steps = [Group(steps=tuple(self.steps), always=always)]
        self.state, self.asked = state, None

    def _decide(self, clause: Clause) -> None:
        """Builds a choice for "if" and "unless"."""
        end = end_of_scope(self.clauses, self.at)
        follows = self.clauses[self.at : end]
        bare_and = bool(follows) and re.match(r",?\s*and\b", follows[0].joint.strip(), re.IGNORECASE) is not None
        if (self.plain or self.steps) and not clause.begins and (not follows or bare_and):
            alone = attempt(parse_condition, clause.text, self.known(), self.reader)
            if not isinstance(alone, RefusalError):
                if not self.plain:
                    what = f"what am I to do {clause.cue} {clause.text}? Say the condition first"
                    raise RefusalError(what, [clause.text])
                main = self.plain.pop()  # bring me a beer, if there is one
                self.modify(main, replace(clause, before=main.text))
                return
        self.flush()
        asked = self.asked
        supposed, rest = self._split(clause.text, follows, self._condition)
        if not rest and not follows:
            raise clause.missing_action(clause.text)
        body = self.take(rest, end)
        if asked is not None and asked.looked:
            if supposed.condition in (asked.condition, negate(asked.condition)):
                del self.steps[-asked.steps :]
        elif asked is not None and clause.kind is Cue.IF:
            there = supposed.at_source(tuple(self.steps[-asked.steps :]), clause.text).condition
            if there == negate(asked.condition):  # get a coke; if there is no coke, get a beer
                self._replace_missing(asked, supposed.said, body)
                return
        self._choose(supposed.opposite if clause.kind is Cue.UNLESS else supposed, body)

    def _condition(self, text: str) -> SpokenCondition:
        return parse_condition(text, self.state, self.reader)

    def _split(self, text: str, follows: Sequence[Clause], read: Callable[[str], _Head]) -> tuple[_Head, str]:
        """Splits a condition or rounds from an action that follows without a comma."""
        refusal: RefusalError | None = None
        begins = [start for start, _ in words_of(text).spans[1:]] if self.given is not None else []
        objects = [start for start in begins if CHECKS["no_verb"].fullmatch(text[start:])]
        for cut_at in (*_places_to_cut(text, follows), *objects, len(text)):
            rest = re.sub(r"^(?:then|please)\s+", "", text[cut_at:], flags=re.IGNORECASE)
            said = re.sub(r"\s+(?:then|please|and)$", "", text[:cut_at].rstrip(" ,"), flags=re.IGNORECASE)
            found = head = attempt(read, said)
            if rest and not isinstance(head, RefusalError):
                body = self._inner([*cut(rest), *follows], head.holds, head.statement)
                done = attempt(body.build)
                found = done if isinstance(done, RefusalError) else head
            if not isinstance(head, RefusalError) and not isinstance(found, RefusalError):
                return head, rest
            assert isinstance(found, RefusalError)
            asks = found.question is not None or found is not head
            refusal = found if refusal is None or (refusal.question is None and asks) else refusal
        assert refusal is not None
        raise refusal

    def _choose(self, supposed: SpokenCondition, body: Sequence[Clause]) -> None:
        """Adds a choice of two branches, of which the next clause may begin the second."""
        if not body:
            raise Clause("", "", cue="if").missing_action(supposed.said)
        then, after = self.nest(body, supposed.holds, supposed)
        otherwise: Steps = ()
        other = supposed.fails
        second = self.clauses[self.at] if self.at < len(self.clauses) else None
        if second is not None and second.kind in (Cue.OTHERWISE, Cue.NOT, Cue.SO):
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
            self._choose(self._condition(said), self.take(clause.text, end_of_scope(self.clauses, self.at)))
            return
        if not self.steps[self.begun :] and not (asked and self.steps):
            raise RefusalError(f"'{clause.cue}' refers to nothing that was said before", words)
        if asked is not None and asked.looked and cue is not Cue.FAILED:
            del self.steps[-asked.steps :]
            supposed = asked if cue is Cue.SO else asked.opposite
            self._choose(supposed, self.take(clause.text, end_of_scope(self.clauses, self.at)))
            return
        last = self.steps[-1] if self.steps else None
        if cue is Cue.SO or (isinstance(last, Choose | Repeat) and cue is not Cue.FAILED):
            raise RefusalError(f"I do not understand what '{clause.cue}' refers to; say the whole condition", words)
        body = self.take(clause.text, end_of_scope(self.clauses, self.at, branch=True))
        if not body:
            raise clause.missing_action()
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

    def _wait(self, clause: Clause) -> None:
        """Builds a wait for "as soon as Robin comes, ..."."""
        self.flush()
        follows = self.clauses[self.at : end_of_scope(self.clauses, self.at)]
        supposed, rest = self._split(clause.text, follows, self._condition)
        if not rest and not follows:
            raise clause.missing_action(supposed.said)
        self.put((Wait(awaited=Awaited(condition=supposed.condition)),), supposed.holds)
        self.clauses[self.at : self.at] = cut(rest)
        self.begun = len(self.steps)

    def _repeat(self, clause: Clause) -> None:
        """Builds rounds for "every ten minutes", "three times" or "as long as ..." before an action."""
        self.flush()
        end, text = end_of_scope(self.clauses, self.at, rounds=True), clause.text
        follows = self.clauses[self.at : end]
        if clause.kind is Cue.WHILE and (under_way := CHECKS["under_way"].match(text)) is not None:
            at = next((one for one in _places_to_cut(text, follows) if one > under_way.end), len(text))
            self._put_together(text[under_way.end : at], self.take(text[at:], end))
            return
        limited = re.match(r"(?:for|until|till|as long as|while)\b", text, re.IGNORECASE) is not None
        if clause.kind is Cue.TIMES or (clause.kind is Cue.EVERY and not limited):
            rounds, rest = self._rounds(replace(clause, text=""), self.state), text
        else:
            rounds, rest = self._split(text, follows, lambda said: self._rounds(replace(clause, text=said), self.state))
        body = self.take(rest, end)
        if not body:
            raise clause.missing_action()
        done: Done | None = None
        if clause.kind in (Cue.WHILE, Cue.UNTIL) and len(body) == 1 and CHECKS["stays"].fullmatch(body[0].text):
            said = text[: len(text) - len(rest)].strip(" ,")  # until Robin comes, wait in the hall
            done = parse_wait(f"{body[0].text} {clause.kind.value} {said}", self.known, self.reader)
        if done is not None:
            self.put(*done)
        else:
            self._put_rounds(rounds, body)

    def _rounds(self, cue: Clause, state: State) -> Rounds:
        """Rounds of a cue and its words: "three times", "every hour for a day", "until there are none left"."""
        every_s: float | None = None
        if cue.kind is Cue.TIMES:
            return Rounds(Loop(times=int(cue.parse_amount(parse_times, "number of times"))), state)
        if cue.kind is Cue.EVERY:  # "for an hour" and "until three" may stand behind
            every_s, times = cue.parse_amount(parse_seconds, "time"), parse_times(cue.text)
            if (match := CHECKS["for_span"].fullmatch(cue.text)) is not None:
                times = int((parse_seconds(match["span"]) or 0.0) // every_s)
                if times < 1:
                    raise RefusalError(f"'{cue.text}' is shorter than one round", [cue.text])
            if times is not None or not cue.text:
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

    def _put_rounds(self, rounds: Rounds, body: Sequence[Clause]) -> None:
        """Adds rounds that repeat given clauses."""
        steps, state = self.nest(body, rounds.holds.elsewhere)
        commands = [command for step in steps for each in step.walk() for command in each.commands]
        stays = len(commands) == 1 and commands[0].item is None and commands[0].task in (None, Task.CHARGE)
        idle = stays and all(isinstance(step, Do) for step in steps)  # only goes to one place, or charges
        if rounds.loop.times is None and rounds.loop.every_s is None and idle:
            raise RefusalError("I see no action to repeat; say 'wait there until ...'", [join_clauses(body)])
        self.put((_merge_repeats(Repeat(loop=rounds.loop, steps=_done(steps, join_clauses(body)))),), state)

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
        scope = self._scope(clause, cue)
        if cue.kind in (Cue.IF, Cue.UNLESS):
            self._guard(scope, cue)
        elif cue.kind is Cue.WHILE and (under_way := CHECKS["under_way"].match(cue.text)) is not None:
            self._put_together(cue.text[under_way.end :], scope)
        else:
            _, state = self._inner(scope, self.state, None).build()  # "until there are none left"
            rounds = self._rounds(cue, state)
            self._put_rounds(replace(rounds, holds=self.state.noting(rounds.holds.notes)), scope)

    def _scope(self, clause: Clause, cue: Clause) -> list[Clause]:
        """Clauses that a trailing cue applies to. Raises RefusalError when these are ambiguous."""
        main = replace(clause, text=cue.before)
        alone = clause.begins or (clause.then and not CHECKS["comes_back"].fullmatch(cue.before))
        earlier = [] if alone else list(self.plain)
        start = max((n for n, one in enumerate(earlier) if one.begins or (one.then and n)), default=0)
        earlier = earlier[start:]
        if not earlier:
            if self.steps[self.begun :] and not (clause.begins or clause.then) and not self.plain:
                raise cue.ambiguous
            self.flush()
            return [replace(main, joint="")]
        self.plain = self.plain[: len(self.plain) - len(earlier)]
        self.flush()
        scope = [replace(earlier[0], joint=""), *earlier[1:], main]
        if not self._read_together(scope, self.state).one_errand:
            raise cue.ambiguous
        return scope

    def _guard(self, scope: Sequence[Clause], cue: Clause) -> None:
        """Adds an action with a trailing condition."""
        steps, state = self._inner(scope, self.state, self.statement).build()
        supposed = parse_condition(cue.text, replace(state, goal=self.state.goal, at=self.state.at), self.reader)
        supposed = supposed.at_source(steps, cue.text)
        begun = replace(self.state, goal=supposed.holds.goal)
        if cue.kind is Cue.IF:
            begun = replace(begun, memory=replace(begun.memory, locations=supposed.holds.memory.locations))
        both = supposed.negate(supposed.said) if cue.kind is Cue.UNLESS else supposed
        self._choose(replace(both, holds=begun.noting(supposed.holds.notes)), scope)


def _places_to_cut(text: str, follows: Sequence[Clause]) -> Iterator[int]:
    """Yields where an action may begin: behind the text if clauses follow, and at verbs in it."""
    if follows:
        yield len(text)
    yield from verb_positions(text)


def _done(steps: Steps, said: str) -> Steps:
    """Returns the steps. Raises RefusalError when there are no steps ("do nothing twice")."""
    if not steps:
        raise RefusalError(f"'{said}' is nothing to do; leave it out", [said])
    return steps


def _merge_repeats(block: Repeat) -> Repeat:
    """Merges rounds that contain endless rounds; the merged rounds end as the outer rounds do."""
    inner, outer = block.steps[0], block.loop
    if len(block.steps) > 1 or not isinstance(inner, Repeat) or not inner.loop.is_endless:
        return block
    if outer.every_s is not None or outer.times is not None:
        raise RefusalError("an endless repetition cannot be repeated again; say how often", [])
    ends = {"until": outer.until, "while_": outer.while_, "until_clock": outer.until_clock}
    return inner.model_copy(update={"loop": inner.loop.model_copy(update=ends)})
