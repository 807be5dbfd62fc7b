"""What hangs on conditions, and what is done several times: "if", "otherwise", "whatever happens", "every hour"."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace

from executive.language.amounts import seconds_of, time_of, times_of
from executive.language.clauses import ACTS, CLAUSES, Clause, Cue, cut, text_of, verb_positions
from executive.language.items import verb
from executive.language.questions import RefusalError
from executive.language.structure.conditions import suppose
from executive.language.structure.plain import PlainReader, PlainReading, State, Supposed, contrary
from executive.language.structure.requests import Done, speech_in, template, wait
from executive.language.structure.row import (
    LookedAt,
    Rounds,
    Row,
    checked_statement,
    contrary_of,
    end_of,
    looked_at_by,
    nothing_said,
    one_errand,
    same,
    seconds_of_cue,
    sentence_of,
    state_behind_both,
    times_of_cue,
    unclear,
    where_it_is_taken,
)
from executive.words.command import Task
from executive.words.condition import ValueIs
from executive.words.leaf_steps import Awaited, Do, Speak, Wait, steps_of_commands
from executive.words.policy import OnFailure
from executive.words.step import Step
from executive.words.steps import Choose, Group, Loop, Repeat, Steps, Together, Try


class DecisionBuilder:
    """Builder of steps that decide and repeat. Its methods raise RefusalError.

    `told` is what "tell Robin" tells, `verb` the last verb by which something was to be brought, `notes` say what was
    taken for what; `special` says that it is more than a list of commands, also where it has no block.
    """

    def __init__(self, reader: PlainReader, told: str | None = None, verb: str | None = None) -> None:
        self.reader, self.told, self.verb = reader, told, verb
        self.notes: list[str] = []
        self.special = False

    def sequence(self, clauses: Sequence[Clause], state: State) -> tuple[Steps, State]:
        """The steps of clauses, one after the other."""
        raise NotImplementedError

    def nested(self, clauses: Sequence[Clause], state: State) -> tuple[Steps, State]:
        """The same of clauses within others."""
        return self.sequence([replace(clauses[0], joint=""), *clauses[1:]], state)

    def flush(self, row: Row) -> None:
        """Understands the clauses that are still to be understood."""
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
        """Puts what a plain part asks for."""
        self.notes += reading.trace.notes
        row.steps += steps_of_commands(reading.commands)
        before, row.state = row.state, reading.state
        row.asked = looked_at_by(reading, before, self.reader)

    def put(self, row: Row, block: Step, state: State) -> None:
        """Puts a block; `state` is what is known behind it."""
        self.put_done(row, ((block,), state, ()))

    def put_done(self, row: Row, done: Done) -> None:
        """Puts steps with what is known behind them, and notes."""
        steps, row.state, notes = done
        row.steps += steps
        row.asked = None
        self.notes += notes

    def always(self, row: Row, clauses: Sequence[Clause], at: int) -> int:
        """What is done at the end, whatever happens."""
        self.flush(row)
        first = clauses[at]
        if not row.steps:
            raise RefusalError("before what is to be done in every case, say what is to be done first", [first.text])
        ended = re.sub(rf"[, ]*{CLAUSES.whatever.pattern}$", "", first.text, flags=re.IGNORECASE)
        ended = re.sub(r"[, ]+(?:at the end|in the end)$", "", ended, flags=re.IGNORECASE)
        rest = [replace(first, text=ended), *clauses[at + 1 :]]
        always, state = self.nested(rest, replace(row.state, goal=None, at=None))
        row.steps = [Group(steps=tuple(row.steps), always=always)]
        row.state, row.asked = state, None
        return len(clauses)

    def decided(self, row: Row, clauses: Sequence[Clause], at: int) -> int:
        """ "If" and "unless"."""
        clause, end = clauses[at], end_of(clauses, at + 1)
        follows = clauses[at + 1 : end]
        bare_and = bool(follows) and re.match(r",?\s*and\b", follows[0].joint.strip(), re.IGNORECASE) is not None
        earlier = bool(row.plain or row.steps) and not clause.begins
        if earlier and (not follows or bare_and) and self._holds(clause.text, row):
            if not row.plain:
                what = f"what is to be done {clause.cue} {clause.text}? Say the condition first"
                raise RefusalError(what, [clause.text])
            main = row.plain.pop()  # bring me a beer, if there is one
            self.modified(row, main, replace(clause, before=main.text))
            return at + 1
        self.flush(row)
        asked = row.asked if row.asked is not None and row.asked.looked else None
        supposed, rest = self.split(clause.text, row.state, follows)
        if not rest and not follows:
            raise nothing_said(clause.cue, clause.text)
        if asked is not None and same(supposed.condition, asked.supposed.condition):
            row.steps[-asked.steps :] = []
        body = [*cut(rest), *follows]
        return self.choose(row, contrary_of(supposed) if clause.kind is Cue.UNLESS else supposed, body, clauses, end)

    def _holds(self, text: str, row: Row) -> bool:
        """Returns whether the text is a condition as it stands."""
        try:
            state = self.read_together(row.plain, row.state).state if row.plain else row.state
            suppose(text, state, self.reader)
        except RefusalError:
            return False
        return True

    def split(self, text: str, state: State, follows: Sequence[Clause]) -> tuple[Supposed, str]:
        """A condition, and what is to be done where no comma stands between."""
        refusal: RefusalError | None = None
        for cut_at in (*([len(text)] if follows else []), *verb_positions(text), len(text)):
            rest = re.sub(r"^(?:then|please)\s+", "", text[cut_at:], flags=re.IGNORECASE)
            condition = re.sub(r"\s+(?:then|please|and)$", "", text[:cut_at].rstrip(" ,"), flags=re.IGNORECASE)
            supposed: Supposed | None = None
            try:
                supposed = suppose(condition, state, self.reader)
                if rest:
                    inner = type(self)(self.reader, sentence_of(supposed), self.verb)
                    inner.sequence([*cut(rest), *follows], supposed.holds)
            except RefusalError as error:
                asks = error.question is not None or supposed is not None
                refusal = error if refusal is None or (refusal.question is None and asks) else refusal
                continue
            self.notes += supposed.notes
            return supposed, rest
        assert refusal is not None
        raise refusal

    def choose(self, row: Row, supposed: Supposed, body: Sequence[Clause], clauses: Sequence[Clause], end: int) -> int:
        """Puts the steps of both branches; `end` is behind the first."""
        then, after = self.branch(body, supposed, supposed.holds)
        otherwise: Steps = ()
        other_state = supposed.fails
        if end < len(clauses) and clauses[end].kind in (Cue.OTHERWISE, Cue.NOT, Cue.SO):
            first = clauses[end]
            if first.kind is Cue.SO and all(one.kind is not Cue.NOT for one in clauses[:end]):
                raise RefusalError(f"I do not understand '{first.cue}' here", [first.cue])
            stop = end_of(clauses, end + 1, branch=True)
            rest = [*cut(first.text), *clauses[end + 1 : stop]]
            if rest and rest[0].kind is Cue.IF:
                stop = len(clauses)
                rest = [rest[0], *rest[1 : len(cut(first.text))], *clauses[end + 1 : stop]]
            if not rest:
                raise nothing_said(first.cue)
            begun = supposed.fails
            if begun.memory.things == () or begun.memory.things[-1].person:
                begun = replace(begun, memory=replace(begun.memory, things=after.memory.things))
            otherwise, other_state = self.branch(rest, contrary_of(supposed), begun)
            end = stop
        if not (then or otherwise):
            raise RefusalError("then there is nothing to do", [supposed.said])
        condition = supposed.condition if then else contrary(supposed.condition)
        block = Choose(condition=condition, then=then or otherwise, otherwise=otherwise if then else ())
        self.put(row, block, state_behind_both(after, other_state))
        return end

    def branch(self, clauses: Sequence[Clause], supposed: Supposed, state: State) -> tuple[Steps, State]:
        """The steps of a branch; "tell Robin" tells what was found."""
        if not clauses:
            raise nothing_said("if", supposed.said)
        inner = type(self)(self.reader, sentence_of(supposed), self.verb)
        found = inner.nested(clauses, state)
        self.notes += inner.notes
        self.verb = inner.verb
        return found

    def attached(self, row: Row, clauses: Sequence[Clause], at: int) -> int:
        """ "If so", "otherwise", "if that fails": they go on from what was looked at or done before."""
        clause, end, both = clauses[at], end_of(clauses, at + 1, branch=True), end_of(clauses, at + 1)
        cue, words = clause.kind, [clause.cue]
        self.flush(row)
        asked, last = row.asked, row.steps[-1] if row.steps else None
        if cue in (Cue.SO, Cue.NOT) and asked is None and ACTS.somebody.search(clause.cue):
            supposed = suppose(re.sub(r"^if ", "", clause.cue, flags=re.IGNORECASE), row.state, self.reader)
            return self.choose(row, supposed, [*cut(clause.text), *clauses[at + 1 : both]], clauses, both)
        if not row.steps[row.begun :] and not (asked and row.steps):
            raise RefusalError(f"'{clause.cue}' goes on from nothing that was said before", words)
        if asked is not None and asked.looked and cue is not Cue.FAILED:
            row.steps[-asked.steps :] = []
            supposed = asked.supposed if cue is Cue.SO else contrary_of(asked.supposed)
            return self.choose(row, supposed, [*cut(clause.text), *clauses[at + 1 : both]], clauses, both)
        body = [*cut(clause.text), *clauses[at + 1 : end]]
        if asked is not None and asked.decided and isinstance(last, Choose) and cue is not Cue.SO:
            otherwise, state = self.branch(body, contrary_of(asked.supposed), asked.supposed.fails)
            row.steps[-1:] = []
            self.put(row, last.model_copy(update={"otherwise": otherwise}), state_behind_both(row.state, state))
            return end
        if isinstance(last, Choose | Repeat) and cue is not Cue.FAILED:
            raise RefusalError(f"I do not understand to what '{clause.cue}' belongs", words)
        missing = cue is Cue.NOT and clause.cue.lower() not in ("if not", "if no")
        if cue is not Cue.SO and not body:
            raise nothing_said(clause.cue)
        if cue is Cue.SO or (missing and asked is None):
            raise RefusalError(f"'{clause.cue}' goes on from nothing that was looked at", words)
        if missing and asked is not None:
            otherwise, state = self.branch(body, contrary_of(asked.supposed), asked.supposed.fails)
            done = tuple(row.steps[-asked.steps :])
            row.steps[-asked.steps :] = []
            block = Choose(condition=asked.supposed.condition, then=done, otherwise=otherwise)
            self.put(row, block, state_behind_both(row.state, state))
            return end
        tried = tuple(row.steps[row.begun :])
        otherwise, state = self.nested(body, replace(row.state, held=None, goal=None, at=None))
        row.steps[row.begun :] = []
        skipped = Group(steps=tried, on_failure=OnFailure.SKIP)
        attempt = Try(steps=tried, otherwise=otherwise) if otherwise else skipped
        self.put(row, attempt, state_behind_both(row.state, state))
        return end

    def soon(self, row: Row, clauses: Sequence[Clause], at: int) -> int:
        """ "As soon as Robin comes, ..." waits for that."""
        self.flush(row)
        end = end_of(clauses, at + 1)
        supposed, rest = self.split(clauses[at].text, row.state, clauses[at + 1 : end])
        if not rest and end == at + 1:
            raise nothing_said(clauses[at].cue, supposed.said)
        self.put(row, Wait(awaited=Awaited(condition=supposed.condition)), supposed.holds)
        more, row.state = self.sequence([*cut(rest), *clauses[at + 1 :]], supposed.holds)
        row.steps += more
        return len(clauses)

    def repeated(self, row: Row, clauses: Sequence[Clause], at: int) -> int:
        """ "Every ten minutes", "three times", "as long as ..." before what is to be done."""
        clause, end = clauses[at], end_of(clauses, at + 1, rounds=True)
        self.flush(row)
        if self._on_the_way(row, clause, clauses[at + 1 : end]):
            return end
        rounds, rest = self._how_often(row, clause, clauses[at + 1 : end])
        body = [*cut(rest), *clauses[at + 1 : end]]
        if clause.kind in (Cue.WHILE, Cue.UNTIL) and len(body) == 1 and ACTS.stays.fullmatch(body[0].text):
            said = clause.text[: len(clause.text) - len(rest)].strip(" ,")
            where = body[0].text.partition(" ")[2]
            self.put_done(row, wait(where, clause.kind.value, said, row.state, self.reader))
            return end
        if not body:
            raise nothing_said(clause.cue)
        self.repeat_of(row, rounds, body)
        return end

    def repeat_of(self, row: Row, rounds: Rounds, body: Sequence[Clause]) -> None:
        """Puts rounds of what the clauses ask for."""
        steps, state = self.nested(body, replace(rounds.state, goal=None, at=None))
        commands = [command for step in steps for each in step.walk() for command in each.commands]
        stays = len(commands) == 1 and commands[0].item is None and commands[0].task in (None, Task.CHARGE)
        idle = stays and all(isinstance(step, Do) for step in steps)  # only goes to one place, or charges
        if rounds.loop.times is None and rounds.loop.every_s is None and idle:
            raise RefusalError("I do not see what is to be repeated; say 'wait there until ...'", [text_of(body)])
        self.put(row, _one_repeat(Repeat(loop=rounds.loop, steps=_done(steps, text_of(body)))), state)

    def _how_often(self, row: Row, clause: Clause, follows: Sequence[Clause]) -> tuple[Rounds, str]:
        """How often what is behind it is to be done, and the rest of the words."""
        text, state = clause.text, row.state
        if clause.kind is Cue.TIMES:
            return Rounds(Loop(times=times_of_cue(clause.cue)), state), text
        if clause.kind is Cue.EVERY:  # "for an hour" and "until three" may stand behind
            every_s = seconds_of_cue(clause.cue)
            if not re.match(r"(?:for|until|till|as long as|while)\b", text, re.IGNORECASE):
                return Rounds(Loop(every_s=every_s), state), text
            for cut_at in (*([len(text)] if follows else []), *verb_positions(text)):
                if (found := self.limited(every_s, text[:cut_at].rstrip(" ,"), state)) is not None:
                    return found, text[cut_at:]
            raise RefusalError(f"I do not understand for how long: '{text}'", [text])
        for cut_at in (len(text), *verb_positions(text)) if clause.kind is Cue.UNTIL else ():
            if time_of(said := text[:cut_at].strip(" ,")) is not None:
                return self._rounds_behind(row, (), replace(clause, text=said)), text[cut_at:]
        supposed, rest = self.split(text, state, follows)
        return _rounds_by(clause.kind, supposed), rest

    def limited(self, every_s: float, text: str, state: State) -> Rounds | None:
        """The rounds within "for an hour", "until three o'clock", "five times"."""
        if not text:
            return Rounds(Loop(every_s=every_s), state)
        if (match := ACTS.for_span.fullmatch(text)) is not None:
            seconds = seconds_of(match[1])
            if seconds is None or seconds < every_s:
                raise RefusalError(f"'{text}' is shorter than one round", [text])
            return Rounds(Loop(times=int(seconds // every_s), every_s=every_s), state)
        if (count := times_of(text)) is not None:
            return Rounds(Loop(times=count, every_s=every_s), state)
        match = re.fullmatch(r"(?P<how>until|till|as long as|while) (?P<what>.+)", text, re.IGNORECASE)
        if match is None:
            return None
        if (time := time_of(match["what"])) is not None:
            self.notes += time.notes(match["what"])
            return Rounds(Loop(until=ValueIs(text=f'clock >= "{time.text}"'), every_s=every_s), state)
        try:
            supposed = suppose(match["what"], state, self.reader)
        except RefusalError:
            return None
        rounds = _rounds_by(Cue.UNTIL if match["how"].lower() in ("until", "till") else Cue.WHILE, supposed)
        return replace(rounds, loop=rounds.loop.model_copy(update={"every_s": every_s}))

    def _on_the_way(self, row: Row, clause: Clause, follows: Sequence[Clause]) -> bool:
        """ "While driving to the kitchen, say ...": both at once, where that is simple."""
        text = clause.text
        match = ACTS.under_way.match(text) if clause.kind is Cue.WHILE else None
        if match is None:
            return False
        for cut_at in (*([len(text)] if follows else []), *verb_positions(text)):
            going = text[match.end() : cut_at].strip(" ,")
            if cut_at > match.end() and re.match(r"(?:to|into|through|from)\b", going, re.IGNORECASE):
                self.beside(row, going, [*cut(text[cut_at:]), *follows])
                return True
        raise RefusalError(f"I do not understand '{clause.cue} {text}'", [text])

    def beside(self, row: Row, where: str, body: Sequence[Clause]) -> None:
        """Says something while going somewhere."""
        reading = self.reader.commands_of(where, row.state, (verb("go"),))
        said = speech_in(body[0].text, self.reader) if len(body) == 1 else None
        if said is None or said.text is None or said.to is not None or len(reading.commands) != 1:
            raise RefusalError("while I go somewhere I can only say something", [text_of(body)])
        both = (Do.from_command(reading.commands[0]), Speak(speak=template(said.text)))
        self.put(row, Together(steps=both), reading.state)

    def modified(self, row: Row, clause: Clause, found: Clause) -> None:
        """What is done only if something is so, or several times."""
        scope = self._scope(row, clause, found)
        rounds: Rounds | None
        if found.kind in (Cue.IF, Cue.UNLESS):
            self._guarded(row, scope, found)
            return
        if found.kind is Cue.WHILE and (match := ACTS.under_way.match(found.text)) is not None:
            self.beside(row, found.text[match.end() :].strip(), scope)
            return
        if found.kind is Cue.EVERY:
            rounds = self.limited(seconds_of_cue(found.cue), found.text, row.state)
        elif found.kind is Cue.TIMES:
            rounds = None if found.text else Rounds(Loop(times=times_of_cue(found.cue)), row.state)
        else:
            rounds = self._rounds_behind(row, scope, found)
        if rounds is None:
            raise RefusalError(f"I do not understand how often: '{found.cue} {found.text}'".strip(), [found.cue])
        self.repeat_of(row, rounds, scope)

    def _rounds_behind(self, row: Row, scope: Sequence[Clause], found: Clause) -> Rounds:
        """ "... until there are none left", "... until three o'clock"."""
        if not found.text:
            raise RefusalError(f"{found.cue.lower()} what?", [found.cue])
        if found.kind is Cue.UNTIL and (time := time_of(found.text)) is not None:
            self.notes += time.notes(found.text)
            return Rounds(Loop(until=ValueIs(text=f'clock >= "{time.text}"')), row.state)
        _, state = type(self)(self.reader).sequence(scope, row.state)
        return replace(_rounds_by(found.kind, suppose(found.text, state, self.reader)), state=row.state)

    def _scope(self, row: Row, clause: Clause, found: Clause) -> list[Clause]:
        """The clauses that what stands behind belongs to. Raises RefusalError: that is not clear."""
        main = replace(clause, text=found.before)
        alone = clause.begins or (clause.then and not ACTS.comes_back.fullmatch(found.before))
        earlier = [] if alone else list(row.plain)
        start = max((n for n, one in enumerate(earlier) if one.begins or (one.then and n)), default=0)
        earlier = earlier[start:]
        if not earlier:
            if row.steps[row.begun :] and not (clause.begins or clause.then) and not row.plain:
                raise unclear(found)
            self.flush(row)
            return [replace(main, joint="")]
        row.plain = row.plain[: len(row.plain) - len(earlier)]
        self.flush(row)
        scope = [replace(earlier[0], joint=""), *earlier[1:], main]
        if not one_errand(self.read_together(scope, row.state)):
            raise unclear(found)
        return scope

    def _guarded(self, row: Row, scope: Sequence[Clause], found: Clause) -> None:
        """What is done only if something is so."""
        if not found.text:
            raise RefusalError(f"'{found.cue}' what?", [found.cue])
        steps, state = type(self)(self.reader, self.told).sequence(scope, row.state)
        supposed = suppose(found.text, replace(state, goal=row.state.goal, at=row.state.at), self.reader)
        supposed = where_it_is_taken(supposed, steps, found.text)
        begun = replace(row.state, goal=supposed.holds.goal)
        if found.kind is Cue.IF:
            begun = replace(begun, memory=replace(begun.memory, told=supposed.holds.memory.told))
        again = type(self)(self.reader, sentence_of(supposed))
        steps, state = again.sequence(scope, begun)
        self.notes += [*again.notes, *supposed.notes]
        both = supposed.denied(supposed.said) if found.kind is Cue.UNLESS else replace(supposed, told=True)
        block = Choose(condition=both.condition, then=_done(steps, text_of(scope)))
        self.put(row, block, state_behind_both(state, row.state))
        row.asked = LookedAt(both, looked=False, decided=True)


def _done(steps: Steps, said: str) -> Steps:
    """The steps. Raises RefusalError: there are none ("do nothing twice")."""
    if not steps:
        raise RefusalError(f"'{said}' is nothing to do; leave it out", [said])
    return steps


def _one_repeat(block: Repeat) -> Repeat:
    """Rounds that hold only rounds without an end become one, which ends as the outer ones."""
    inner, outer = block.steps[0], block.loop
    if len(block.steps) > 1 or not isinstance(inner, Repeat) or not inner.loop.is_endless:
        return block
    if outer.every_s is not None or outer.times is not None:
        raise RefusalError("what is repeated without end cannot be repeated again", [])
    loop = inner.loop.model_copy(update={"until": outer.until, "while_": outer.while_})
    return inner.model_copy(update={"loop": loop})


def _rounds_by(kind: Cue | None, supposed: Supposed) -> Rounds:
    if kind is Cue.UNTIL:
        return Rounds(Loop(until=supposed.condition), supposed.fails)
    return Rounds(Loop(while_=supposed.condition), supposed.holds)
