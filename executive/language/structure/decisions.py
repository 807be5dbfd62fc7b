"""Builds conditional and repeated steps: "if", "otherwise", "whatever happens", "every hour"."""

import re
from collections.abc import Sequence
from dataclasses import replace

from executive.language.amounts import parse_seconds, parse_time, parse_times
from executive.language.clauses import (
    CHECKS,
    Clause,
    Cue,
    cut,
    join_clauses,
    leading_cue,
    verb_positions,
)
from executive.language.items import verb
from executive.language.questions import RefusalError
from executive.language.structure.conditions import parse_condition
from executive.language.structure.plain import (
    LastCheck,
    PlainReader,
    PlainReading,
    Rounds,
    SpokenCondition,
    State,
    StepRow,
    end_of_scope,
    merge_repeats,
    negate,
    statement_of_check,
)
from executive.language.structure.requests import escape_braces, parse_speech, wait_steps
from executive.language.templates import words_of
from executive.words.command import Task
from executive.words.leaf_steps import Awaited, Do, Speak, Wait, steps_of_commands
from executive.words.step import OnFailure
from executive.words.steps import Choose, Group, Loop, Repeat, Steps, Together, Try


class DecisionBuilder:
    """Builder of steps that decide and repeat. Its methods raise RefusalError for a clause that they cannot build.

    `statement` is what "tell Robin" refers to, `given` is the last clause with an object, `notes` list words that were
    interpreted as others; `special` marks a mission without blocks that is more than a list of commands, `built` that
    steps were built of more than plain words.
    """

    def __init__(self, reader: PlainReader, statement: str | None = None, given: str | None = None) -> None:
        self.reader, self.statement, self.given = reader, statement, given
        self.notes: list[str] = []
        self.special = self.built = False

    def sequence(self, clauses: Sequence[Clause], state: State) -> tuple[Steps, State]:
        """Builds the steps of clauses, in order."""
        raise NotImplementedError

    def nest(self, clauses: Sequence[Clause], state: State) -> tuple[Steps, State]:
        """Builds the steps of clauses that are inside others."""
        return self.sequence([replace(clauses[0], joint=""), *clauses[1:]], state)

    def flush(self, row: StepRow) -> None:
        """Understands the pending clauses, and adds their steps."""
        if not row.plain:
            return
        last = row.plain[-1].text
        try:
            reading = self.read_together(row.plain, row.state)
        except RefusalError:
            for n in range(1, len(row.plain)):  # the first clause that cannot be understood
                self.read_together(row.plain[:n], row.state)
            raise
        row.plain = []
        self.add(row, reading)
        if row.asked is not None and row.asked.looked:
            there = re.sub(r"^(?:is|are) there ", "there is ", last, flags=re.IGNORECASE)
            said = statement_of_check(last) or (there if there != last else "")
            row.asked = replace(row.asked, supposed=replace(row.asked.supposed, said=said))

    def read_together(self, clauses: Sequence[Clause], state: State) -> PlainReading:
        """Understands several plain clauses together."""
        text = join_clauses([replace(clauses[0], joint=""), *clauses[1:]])
        try:
            return self.reader.read_commands(text, state, clauses[0].lead)
        except RefusalError as refusal:
            refusal.plain = not (self.special or self.built)
            raise

    def add(self, row: StepRow, reading: PlainReading) -> None:
        """Adds the commands of a plain part of the sentence."""
        self.notes += reading.trace.notes
        row.steps += steps_of_commands(reading.commands)
        before, row.state = row.state, reading.state
        row.asked = self.reader.last_check(reading, before)

    def put(self, row: StepRow, steps: Steps, state: State, notes: Sequence[str] = ()) -> None:
        """Adds steps behind those of the pending clauses, with the state after them, and notes."""
        self.flush(row)
        row.steps += steps
        row.state, row.asked, self.built = state, None, True
        self.notes += notes

    def decide(self, row: StepRow, clauses: Sequence[Clause], at: int) -> int:
        """Builds a choice for "if" and "unless"."""
        clause, end = clauses[at], end_of_scope(clauses, at + 1)
        follows = clauses[at + 1 : end]
        bare_and = bool(follows) and re.match(r",?\s*and\b", follows[0].joint.strip(), re.IGNORECASE) is not None
        earlier = bool(row.plain or row.steps) and not clause.begins
        if earlier and (not follows or bare_and) and self._holds(clause.text, row):
            if not row.plain:
                what = f"what am I to do {clause.cue} {clause.text}? Say the condition first"
                raise RefusalError(what, [clause.text])
            main = row.plain.pop()  # bring me a beer, if there is one
            self.modify(row, main, replace(clause, before=main.text))
            return at + 1
        self.flush(row)
        asked = row.asked if row.asked is not None and row.asked.looked else None
        supposed, rest = self.split(clause.text, row.state, follows)
        if not rest and not follows:
            raise clause.missing_action(clause.text)
        if asked is not None and supposed.condition in (asked.supposed.condition, negate(asked.supposed.condition)):
            row.steps[-asked.steps :] = []
        body = [*cut(rest), *follows]
        if row.asked is not None and not (asked or row.asked.decided) and clause.kind is Cue.IF:
            there = supposed.at_source(tuple(row.steps[-row.asked.steps :]), clause.text).condition
            if there == negate(row.asked.supposed.condition):  # get a coke; if there is no coke, get a beer
                self._replace_missing(row, row.asked, supposed.said, body)
                return end
        return self.choose(row, supposed.opposite if clause.kind is Cue.UNLESS else supposed, body, clauses, end)

    def known(self, row: StepRow) -> State:
        """State after the pending clauses."""
        return self.read_together(row.plain, row.state).state if row.plain else row.state

    def _holds(self, text: str, row: StepRow) -> bool:
        """Returns whether the text is a complete condition."""
        try:
            parse_condition(text, self.known(row), self.reader)
        except RefusalError:
            return False
        return True

    def split(self, text: str, state: State, follows: Sequence[Clause]) -> tuple[SpokenCondition, str]:
        """Splits a condition from an action that follows without a comma."""
        refusal: RefusalError | None = None
        begins = [start for start, _ in words_of(text).spans[1:]] if self.given is not None else []
        objects = [start for start in begins if CHECKS["no_verb"].fullmatch(text[start:])]
        for cut_at in (*([len(text)] if follows else []), *verb_positions(text), *objects, len(text)):
            rest = re.sub(r"^(?:then|please)\s+", "", text[cut_at:], flags=re.IGNORECASE)
            condition = re.sub(r"\s+(?:then|please|and)$", "", text[:cut_at].rstrip(" ,"), flags=re.IGNORECASE)
            supposed: SpokenCondition | None = None
            try:
                supposed = parse_condition(condition, state, self.reader)
                if rest:
                    inner = type(self)(self.reader, supposed.statement, self.given)
                    inner.sequence([*cut(rest), *follows], supposed.holds)
            except RefusalError as error:
                asks = error.question is not None or supposed is not None
                refusal = error if refusal is None or (refusal.question is None and asks) else refusal
                continue
            self.notes += supposed.notes
            return supposed, rest
        assert refusal is not None
        raise refusal

    def choose(
        self, row: StepRow, supposed: SpokenCondition, body: Sequence[Clause], clauses: Sequence[Clause], end: int
    ) -> int:
        """Adds a choice of two branches; `end` is after the first branch, and the returned index after the second."""
        then, after = self.branch(body, supposed, supposed.holds)
        otherwise: Steps = ()
        other_state = supposed.fails
        if end < len(clauses) and clauses[end].kind in (Cue.OTHERWISE, Cue.NOT, Cue.SO):
            first = clauses[end]
            if first.kind is Cue.SO and all(one.kind is not Cue.NOT for one in clauses[:end]):
                raise RefusalError(f"I do not understand '{first.cue}' here", [first.cue])
            stop = end_of_scope(clauses, end + 1, branch=True)
            rest = [*cut(first.text), *clauses[end + 1 : stop]]
            if rest and rest[0].kind is Cue.IF:
                stop = len(clauses)
                rest = [rest[0], *rest[1 : len(cut(first.text))], *clauses[end + 1 : stop]]
            if not rest:
                raise first.missing_action()
            begun = supposed.fails
            if begun.memory.objects == () or begun.memory.objects[-1].person:
                begun = replace(begun, memory=replace(begun.memory, objects=after.memory.objects))
            otherwise, other_state = self.branch(rest, supposed.opposite, begun)
            end = stop
        if not (then or otherwise):
            raise RefusalError("no action is said for either case; name one", [supposed.said])
        condition = supposed.condition if then else negate(supposed.condition)
        block = Choose(condition=condition, then=then or otherwise, otherwise=otherwise if then else ())
        self.put(row, (block,), after.common(other_state))
        return end

    def branch(self, clauses: Sequence[Clause], supposed: SpokenCondition, state: State) -> tuple[Steps, State]:
        """Builds the steps of a branch, in which "tell Robin" refers to the condition."""
        if not clauses:
            raise Clause("", "", cue="if").missing_action(supposed.said)
        inner = type(self)(self.reader, supposed.statement, self.given)
        found = inner.nest(clauses, state)
        self.notes += inner.notes
        self.given = inner.given
        return found

    def attach(self, row: StepRow, clauses: Sequence[Clause], at: int) -> int:
        """Builds a branch for "if so", "otherwise" or "if that fails", which refers to the last look or action."""
        clause, end, both = clauses[at], end_of_scope(clauses, at + 1, branch=True), end_of_scope(clauses, at + 1)
        cue, words = clause.kind, [clause.cue]
        self.flush(row)
        asked, last = row.asked, row.steps[-1] if row.steps else None
        if cue in (Cue.SO, Cue.NOT) and asked is None and CHECKS["somebody"].search(clause.cue):
            supposed = parse_condition(re.sub(r"^if ", "", clause.cue, flags=re.IGNORECASE), row.state, self.reader)
            return self.choose(row, supposed, [*cut(clause.text), *clauses[at + 1 : both]], clauses, both)
        if not row.steps[row.begun :] and not (asked and row.steps):
            raise RefusalError(f"'{clause.cue}' refers to nothing that was said before", words)
        if asked is not None and asked.looked and cue is not Cue.FAILED:
            row.steps[-asked.steps :] = []
            supposed = asked.supposed if cue is Cue.SO else asked.supposed.opposite
            return self.choose(row, supposed, [*cut(clause.text), *clauses[at + 1 : both]], clauses, both)
        body = [*cut(clause.text), *clauses[at + 1 : end]]
        if asked is not None and asked.decided and isinstance(last, Choose) and cue is not Cue.SO:
            otherwise, state = self.branch(body, asked.supposed.opposite, asked.supposed.fails)
            row.steps[-1:] = []
            self.put(row, (last.model_copy(update={"otherwise": otherwise}),), row.state.common(state))
            return end
        if isinstance(last, Choose | Repeat) and cue is not Cue.FAILED:
            raise RefusalError(f"I do not understand what '{clause.cue}' refers to; say the whole condition", words)
        missing = cue is Cue.NOT and clause.cue.lower() not in ("if not", "if no")
        if cue is not Cue.SO and not body:
            raise clause.missing_action()
        if cue is Cue.SO or (missing and asked is None):
            raise RefusalError(f"'{clause.cue}' refers to no earlier look", words)
        if missing and asked is not None:
            self._replace_missing(row, asked, clause.cue, body)
            return end
        tried = tuple(row.steps[row.begun :])
        otherwise, state = self.nest(body, replace(row.state, held=None, goal=None, at=None))
        row.steps[row.begun :] = []
        skipped = Group(steps=tried, on_failure=OnFailure.SKIP)
        attempt = Try(steps=tried, otherwise=otherwise) if otherwise else skipped
        self.put(row, (attempt,), row.state.common(state))
        return end

    def _replace_missing(self, row: StepRow, asked: LastCheck, said: str, body: Sequence[Clause]) -> None:
        """Builds a choice: the last steps if their object is found, otherwise the steps of the body.

        Raises RefusalError when "there" could be the object's source or its destination.
        """
        puts = any(command.task is Task.PLACE for step in row.steps[-asked.steps :] for command in step.commands)
        if puts and re.search(r"\bthere$", said, re.IGNORECASE):
            raise RefusalError(f"'{said}' could mean two places; name the place", [said])
        otherwise, state = self.branch(body, asked.supposed.opposite, asked.supposed.fails)
        done = tuple(row.steps[-asked.steps :])
        row.steps[-asked.steps :] = []
        block = Choose(condition=asked.supposed.condition, then=done, otherwise=otherwise)
        self.put(row, (block,), row.state.common(state))

    def wait_for(self, row: StepRow, clauses: Sequence[Clause], at: int) -> int:
        """Builds a wait for "as soon as Robin comes, ..."."""
        self.flush(row)
        end = end_of_scope(clauses, at + 1)
        supposed, rest = self.split(clauses[at].text, row.state, clauses[at + 1 : end])
        if not rest and end == at + 1:
            raise clauses[at].missing_action(supposed.said)
        self.put(row, (Wait(awaited=Awaited(condition=supposed.condition)),), supposed.holds)
        more, row.state = self.sequence([*cut(rest), *clauses[at + 1 :]], supposed.holds)
        row.steps += more
        return len(clauses)

    def repeat(self, row: StepRow, clauses: Sequence[Clause], at: int) -> int:
        """Builds rounds for "every ten minutes", "three times" or "as long as ..." before an action."""
        clause, end = clauses[at], end_of_scope(clauses, at + 1, rounds=True)
        self.flush(row)
        if self._on_the_way(row, clause, clauses[at + 1 : end]):
            return end
        rounds, rest = self._how_often(row, clause, clauses[at + 1 : end])
        body = [*cut(rest), *clauses[at + 1 : end]]
        if clause.kind in (Cue.WHILE, Cue.UNTIL) and len(body) == 1 and CHECKS["stays"].fullmatch(body[0].text):
            said = clause.text[: len(clause.text) - len(rest)].strip(" ,")
            where = body[0].text.partition(" ")[2]
            self.put(row, *wait_steps(where, clause.kind.value, said, row.state, self.reader))
            return end
        if not body:
            raise clause.missing_action()
        self.put_rounds(row, rounds, body)
        return end

    def put_rounds(self, row: StepRow, rounds: Rounds, body: Sequence[Clause]) -> None:
        """Adds rounds that repeat given clauses."""
        steps, state = self.nest(body, replace(rounds.state, goal=None, at=None))
        commands = [command for step in steps for each in step.walk() for command in each.commands]
        stays = len(commands) == 1 and commands[0].item is None and commands[0].task in (None, Task.CHARGE)
        idle = stays and all(isinstance(step, Do) for step in steps)  # only goes to one place, or charges
        if rounds.loop.times is None and rounds.loop.every_s is None and idle:
            raise RefusalError("I see no action to repeat; say 'wait there until ...'", [join_clauses(body)])
        self.put(row, (merge_repeats(Repeat(loop=rounds.loop, steps=_done(steps, join_clauses(body)))),), state)

    def _how_often(self, row: StepRow, clause: Clause, follows: Sequence[Clause]) -> tuple[Rounds, str]:
        """Splits the number or interval of rounds from the action that follows."""
        text, state = clause.text, row.state
        if clause.kind is Cue.TIMES:
            return Rounds(Loop(times=int(clause.parse_amount(parse_times, "number of times"))), state), text
        if clause.kind is Cue.EVERY:  # "for an hour" and "until three" may stand behind
            every_s = clause.parse_amount(parse_seconds, "time")
            if not re.match(r"(?:for|until|till|as long as|while)\b", text, re.IGNORECASE):
                return Rounds(Loop(every_s=every_s), state), text
            for cut_at in (*([len(text)] if follows else []), *verb_positions(text)):
                if (found := self.limit_rounds(every_s, text[:cut_at].rstrip(" ,"), state)) is not None:
                    return found, text[cut_at:]
            raise RefusalError(f"I do not understand for how long: '{text}'", [text])
        for cut_at in (len(text), *verb_positions(text)) if clause.kind is Cue.UNTIL else ():
            if parse_time(said := text[:cut_at].strip(" ,")) is not None:
                return self._rounds_up_to(replace(clause, text=said), state), text[cut_at:]
        supposed, rest = self.split(text, state, follows)
        return supposed.rounds(clause.kind), rest

    def limit_rounds(self, every_s: float, text: str, state: State) -> Rounds | None:
        """Parses the end of rounds in "for an hour", "until three o'clock" or "five times"; None for other texts."""
        if not text:
            return Rounds(Loop(every_s=every_s), state)
        if (match := CHECKS["for_span"].fullmatch(text)) is not None:
            seconds = parse_seconds(match["span"])
            if seconds is None or seconds < every_s:
                raise RefusalError(f"'{text}' is shorter than one round", [text])
            return Rounds(Loop(times=int(seconds // every_s), every_s=every_s), state)
        if (count := parse_times(text)) is not None:
            return Rounds(Loop(times=count, every_s=every_s), state)
        cue = leading_cue(text)
        if cue is None or cue.kind not in (Cue.UNTIL, Cue.WHILE):
            return None
        try:
            return self._rounds_up_to(cue, state, every_s)
        except RefusalError:
            return None

    def _rounds_up_to(self, cue: Clause, state: State, every_s: float | None = None) -> Rounds:
        """Rounds that a time of day or a condition ends."""
        if cue.kind is Cue.UNTIL and (time := parse_time(cue.text)) is not None:
            self.notes += time.notes(cue.text)
            return Rounds(Loop(until_clock=time.text, every_s=every_s), state)
        rounds = parse_condition(cue.text, state, self.reader).rounds(cue.kind)
        return replace(rounds, loop=rounds.loop.model_copy(update={"every_s": every_s}))

    def _on_the_way(self, row: StepRow, clause: Clause, follows: Sequence[Clause]) -> bool:
        """Builds parallel steps for a simple "while driving to the kitchen, say ..."."""
        text = clause.text
        match = CHECKS["under_way"].match(text) if clause.kind is Cue.WHILE else None
        if match is None:
            return False
        for cut_at in (*([len(text)] if follows else []), *verb_positions(text)):
            going = text[match.end : cut_at].strip(" ,")
            if cut_at > match.end and re.match(r"(?:to|into|through|from)\b", going, re.IGNORECASE):
                self.put_together(row, going, [*cut(text[cut_at:]), *follows])
                return True
        raise RefusalError(f"I do not understand '{clause.cue} {text}'", [text])

    def put_together(self, row: StepRow, where: str, body: Sequence[Clause]) -> None:
        """Adds speech in parallel to a drive."""
        reading = self.reader.read_commands(where, row.state, (verb("go"),))
        said = parse_speech(body[0].text, self.reader) if len(body) == 1 else None
        if said is None or not said[0] or said[1].slots.keys() - {"text", "says"} or len(reading.commands) != 1:
            raise RefusalError("while I go somewhere I can only say something", [join_clauses(body)])
        both = (Do.from_command(reading.commands[0]), Speak(speak=escape_braces(said[0])))
        self.put(row, (Together(steps=both),), reading.state)

    def modify(self, row: StepRow, clause: Clause, found: Clause) -> None:
        """Adds an action that a trailing condition or number of rounds modifies."""
        scope = self._scope(row, clause, found)
        rounds: Rounds | None
        if found.kind in (Cue.IF, Cue.UNLESS):
            self._guarded(row, scope, found)
            return
        if found.kind is Cue.WHILE and (match := CHECKS["under_way"].match(found.text)) is not None:
            self.put_together(row, found.text[match.end :].strip(), scope)
            return
        if found.kind is Cue.EVERY:
            rounds = self.limit_rounds(found.parse_amount(parse_seconds, "time"), found.text, row.state)
        elif found.kind is Cue.TIMES:
            rounds = None if found.text else self._how_often(row, found, ())[0]
        else:
            rounds = self._rounds_behind(row, scope, found)
        if rounds is None:
            raise RefusalError(f"I do not understand how often: '{found.cue} {found.text}'".strip(), [found.cue])
        self.put_rounds(row, rounds, scope)

    def _rounds_behind(self, row: StepRow, scope: Sequence[Clause], found: Clause) -> Rounds:
        """Builds rounds for "... until there are none left" or "... until three o'clock"."""
        if not found.text:
            raise RefusalError(f"{found.cue.lower()} what?", [found.cue])
        _, state = type(self)(self.reader).sequence(scope, row.state)
        return replace(self._rounds_up_to(found, state), state=row.state)

    def _scope(self, row: StepRow, clause: Clause, found: Clause) -> list[Clause]:
        """Clauses that a trailing cue applies to. Raises RefusalError when these are ambiguous."""
        main = replace(clause, text=found.before)
        alone = clause.begins or (clause.then and not CHECKS["comes_back"].fullmatch(found.before))
        earlier = [] if alone else list(row.plain)
        start = max((n for n, one in enumerate(earlier) if one.begins or (one.then and n)), default=0)
        earlier = earlier[start:]
        if not earlier:
            if row.steps[row.begun :] and not (clause.begins or clause.then) and not row.plain:
                raise found.ambiguous
            self.flush(row)
            return [replace(main, joint="")]
        row.plain = row.plain[: len(row.plain) - len(earlier)]
        self.flush(row)
        scope = [replace(earlier[0], joint=""), *earlier[1:], main]
        if not self.read_together(scope, row.state).one_errand:
            raise found.ambiguous
        return scope

    def _guarded(self, row: StepRow, scope: Sequence[Clause], found: Clause) -> None:
        """Adds an action with a trailing condition."""
        if not found.text:
            raise RefusalError(f"'{found.cue}' what?", [found.cue])
        steps, state = type(self)(self.reader, self.statement).sequence(scope, row.state)
        supposed = parse_condition(found.text, replace(state, goal=row.state.goal, at=row.state.at), self.reader)
        supposed = supposed.at_source(steps, found.text)
        begun = replace(row.state, goal=supposed.holds.goal)
        if found.kind is Cue.IF:
            begun = replace(begun, memory=replace(begun.memory, locations=supposed.holds.memory.locations))
        again = type(self)(self.reader, supposed.statement)
        steps, state = again.sequence(scope, begun)
        self.notes += [*again.notes, *supposed.notes]
        both = supposed.negate(supposed.said) if found.kind is Cue.UNLESS else replace(supposed, quotable=True)
        block = Choose(condition=both.condition, then=_done(steps, join_clauses(scope)))
        self.put(row, (block,), state.common(row.state))
        row.asked = LastCheck(both, looked=False, decided=True)


def _done(steps: Steps, said: str) -> Steps:
    """Returns the steps. Raises RefusalError when there are no steps ("do nothing twice")."""
    if not steps:
        raise RefusalError(f"'{said}' is nothing to do; leave it out", [said])
    return steps
