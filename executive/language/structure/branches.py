"""What hangs on conditions, and what is done several times: "if", "otherwise", "whatever happens", "every hour"."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace

from executive.language.amounts import seconds_of, time_of, times_of
from executive.language.clauses import ACTS, CLAUSES, Behind, Clause, Cue, cut, text_of, verb_positions
from executive.language.items import verb
from executive.language.questions import RefusalError
from executive.language.structure.conditions import suppose
from executive.language.structure.plain import State, Supposed, contrary
from executive.language.structure.requests import speech_in, wait
from executive.language.structure.row import (
    Base,
    LookedAt,
    Rounds,
    Row,
    contrary_of,
    end_of,
    one_errand,
    same,
    say,
    seconds_of_cue,
    sentence_of,
    state_behind_both,
    times_of_cue,
    unclear,
    was_not,
    where_it_is_taken,
)
from executive.words.command import Task
from executive.words.condition import ValueIs
from executive.words.leaf_steps import Awaited, Do, Wait
from executive.words.policy import OnFailure
from executive.words.steps import Choose, Group, Loop, Repeat, Steps, Together, Try


class Branches(Base):
    """Decides and repeats. Its methods raise RefusalError."""

    def always(self, row: Row, clauses: Sequence[Clause], at: int) -> int:
        """What is done at the end, whatever happens."""
        self.flush(row)
        if not row.steps:
            raise RefusalError(
                "before what is to be done in every case, say what is to be done first", [clauses[at].text]
            )
        first = clauses[at]
        ended = re.sub(rf"[, ]*{CLAUSES.whatever.pattern}$", "", first.text, flags=re.IGNORECASE)
        ended = re.sub(r"[, ]+(?:at the end|in the end)$", "", ended, flags=re.IGNORECASE)
        rest = [replace(first, joint="", text=ended), *clauses[at + 1 :]]
        always, state = self.sequence(rest, replace(row.state, goal=None, at=None))
        row.steps = [Group(steps=tuple(row.steps), always=always)]
        row.state, row.asked = state, None
        return len(clauses)

    def decided(self, row: Row, clauses: Sequence[Clause], at: int) -> int:
        """ "If" and "unless"."""
        clause, end = clauses[at], end_of(clauses, at + 1)
        follows = clauses[at + 1 : end]
        bare_and = bool(follows) and re.match(r",?\s*and\b", follows[0].joint.strip(), re.IGNORECASE) is not None
        earlier = bool(row.plain or row.steps)
        if earlier and (not follows or bare_and) and not clause.begins and self._holds(clause.text, row):
            return self.behind_if(row, clause, clauses, at)
        self.flush(row)
        asked = row.asked if row.asked is not None and row.asked.looked else None
        supposed, rest = self.split(clause.text, row.state, follows)
        if not rest and not follows:
            raise RefusalError(f"what am I to do {clause.cue.lower()} {clause.text}?", [f"{clause.cue} {clause.text}"])
        if asked is not None and same(supposed.condition, asked.supposed.condition):
            row.steps[-asked.steps :] = []
        body = [*cut(rest), *follows]
        if clause.kind is Cue.UNLESS:
            supposed = contrary_of(supposed)
        return self.choose(row, supposed, body, clauses, end)

    def _holds(self, text: str, row: Row) -> bool:
        """Whether the text is a condition as it stands."""
        state = row.state
        try:
            if row.plain:
                state = self.read_together(row.plain, state).state
            suppose(text, state, self.reader)
        except RefusalError:
            return False
        return True

    def split(self, text: str, state: State, follows: Sequence[Clause]) -> tuple[Supposed, str]:
        """A condition, and what is to be done where no comma stands between."""
        refusal: RefusalError | None = None
        supposed: Supposed | None
        for cut_at in (*([len(text)] if follows else []), *verb_positions(text), len(text)):
            condition, rest = (
                text[:cut_at].rstrip(" ,"),
                re.sub(r"^(?:then|please)\s+", "", text[cut_at:], flags=re.IGNORECASE),
            )
            condition = re.sub(r"\s+(?:then|please|and)$", "", condition, flags=re.IGNORECASE)
            supposed = None
            try:
                supposed = suppose(condition, state, self.reader)
                if rest:
                    inner = type(self)(self.reader)
                    inner.told, inner.verb = sentence_of(supposed), self.verb
                    inner.sequence([*cut(rest), *follows], supposed.holds)
            except RefusalError as error:
                better = refusal is None or (
                    refusal.question is None and (error.question is not None or supposed is not None)
                )
                refusal = error if better else refusal
                continue
            self.notes += supposed.notes
            return supposed, rest
        assert refusal is not None
        raise refusal

    def choose(self, row: Row, supposed: Supposed, body: Sequence[Clause], clauses: Sequence[Clause], end: int) -> int:
        """Put the steps of both branches; `end` is behind the first."""
        then, after = self.branch(body, supposed, supposed.holds)
        otherwise: Steps = ()
        other_state = supposed.fails
        if end < len(clauses) and clauses[end].kind in (Cue.OTHERWISE, Cue.NOT, Cue.SO):
            first = clauses[end]
            if first.kind is Cue.SO and not was_not(clauses, end):
                raise RefusalError(f"I do not understand '{first.cue}' here", [first.cue])
            stop = end_of(clauses, end + 1, branch=True)
            rest = [*cut(first.text), *clauses[end + 1 : stop]]
            if rest and rest[0].kind is Cue.IF:
                stop = len(clauses)
                rest = [rest[0], *rest[1 : len(cut(first.text))], *clauses[end + 1 : stop]]
            if not rest:
                raise RefusalError(f"what am I to do {first.cue.lower()}?", [first.cue])
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
            raise RefusalError(f"what am I to do if {supposed.said}?", [supposed.said])
        inner = type(self)(self.reader)
        inner.told, inner.verb = sentence_of(supposed), self.verb
        found = inner.sequence([replace(clauses[0], joint=""), *clauses[1:]], state)
        self.notes += inner.notes
        self.verb = inner.verb
        return found

    def attached(self, row: Row, clauses: Sequence[Clause], at: int) -> int:
        """ "If so", "otherwise", "if that fails": they go on from what was looked at or done before."""
        clause, end = clauses[at], end_of(clauses, at + 1, branch=True)
        self.flush(row)
        asked = row.asked
        if clause.kind in (Cue.SO, Cue.NOT) and asked is None and ACTS.somebody.search(clause.cue):
            supposed = suppose(re.sub(r"^if ", "", clause.cue, flags=re.IGNORECASE), row.state, self.reader)
            return self.choose(
                row,
                supposed,
                [*cut(clause.text), *clauses[at + 1 : end_of(clauses, at + 1)]],
                clauses,
                end_of(clauses, at + 1),
            )
        if not row.steps[row.begun :] and not (asked and row.steps):
            raise RefusalError(f"'{clause.cue}' goes on from nothing that was said before", [clause.cue])
        body = [*cut(clause.text), *clauses[at + 1 : end]]
        if asked is not None and asked.looked and clause.kind is not Cue.FAILED:
            row.steps[-asked.steps :] = []
            supposed = asked.supposed if clause.kind is Cue.SO else contrary_of(asked.supposed)
            end = end_of(clauses, at + 1)
            body = [*cut(clause.text), *clauses[at + 1 : end]]
            return self.choose(row, supposed, body, clauses, end)
        last = row.steps[-1] if row.steps else None
        if asked is not None and asked.decided and isinstance(last, Choose) and clause.kind is not Cue.SO:
            return self._else_of(row, last, asked.supposed, body, end)
        if isinstance(last, Choose | Repeat) and clause.kind is not Cue.FAILED:
            raise RefusalError(f"I do not understand to what '{clause.cue}' belongs", [clause.cue])
        if clause.kind is Cue.SO:
            raise RefusalError(f"'{clause.cue}' goes on from nothing that was looked at", [clause.cue])
        if not body:
            raise RefusalError(f"what am I to do {clause.cue.lower()}?", [clause.cue])
        missing = clause.kind is Cue.NOT and clause.cue.lower() not in ("if not", "if no")
        if missing and asked is not None:
            otherwise, state = self.branch(body, contrary_of(asked.supposed), asked.supposed.fails)
            done = tuple(row.steps[-asked.steps :])
            row.steps[-asked.steps :] = []
            block = Choose(condition=asked.supposed.condition, then=done, otherwise=otherwise)
            self.put(row, block, state_behind_both(row.state, state))
            return end
        if missing:
            raise RefusalError(f"'{clause.cue}' goes on from nothing that was looked at", [clause.cue])
        tried = tuple(row.steps[row.begun :])
        otherwise, state = self.sequence(
            [replace(body[0], joint=""), *body[1:]], replace(row.state, held=None, goal=None, at=None)
        )
        row.steps[row.begun :] = []
        skipped = Group(steps=tried, on_failure=OnFailure.SKIP)
        attempt = Try(steps=tried, otherwise=otherwise) if otherwise else skipped
        self.put(row, attempt, state_behind_both(row.state, state))
        return end

    def _else_of(self, row: Row, last: Choose, supposed: Supposed, body: Sequence[Clause], end: int) -> int:
        """The other branch of what was done only if something was so."""
        otherwise, state = self.branch(body, contrary_of(supposed), supposed.fails)
        row.steps[-1:] = []
        self.put(row, last.model_copy(update={"otherwise": otherwise}), state_behind_both(row.state, state))
        return end

    def soon(self, row: Row, clauses: Sequence[Clause], at: int) -> int:
        """ "As soon as Robin comes, ..." waits for that."""
        self.flush(row)
        end = end_of(clauses, at + 1)
        supposed, rest = self.split(clauses[at].text, row.state, clauses[at + 1 : end])
        if not rest and end == at + 1:
            raise RefusalError(f"what am I to do {clauses[at].cue.lower()} {supposed.said}?", [clauses[at].cue])
        self.put(row, Wait(awaited=Awaited(condition=supposed.condition)), supposed.holds)
        more, row.state = self.sequence([*cut(rest), *clauses[at + 1 :]], supposed.holds)
        row.steps += more
        return len(clauses)

    def behind_if(self, row: Row, clause: Clause, clauses: Sequence[Clause], at: int) -> int:
        """A condition behind a comma: "bring me a beer, if there is one"."""
        if not row.plain:
            raise RefusalError(f"what is to be done {clause.cue} {clause.text}? Say the condition first", [clause.text])
        main = row.plain.pop()
        self.modified(row, main, Behind(main.text, clause.kind or Cue.IF, clause.cue, clause.text))
        return at + 1

    def repeated(self, row: Row, clauses: Sequence[Clause], at: int) -> int:
        """ "Every ten minutes", "three times", "as long as ..." before what is to be done."""
        clause, end = clauses[at], end_of(clauses, at + 1, rounds=True)
        self.flush(row)
        aside = self._on_the_way(row, clause, clauses[at + 1 : end])
        if aside:
            return end
        rounds, rest = self._how_often(row, clause, clauses[at + 1 : end])
        body = [*cut(rest), *clauses[at + 1 : end]]
        if clause.kind in (Cue.WHILE, Cue.UNTIL) and len(body) == 1 and ACTS.stays.fullmatch(body[0].text):
            said = clause.text[: len(clause.text) - len(rest)].strip(" ,")
            how = "until" if clause.kind is Cue.UNTIL else "while"
            self.put_done(row, wait(body[0].text.partition(" ")[2], how, said, row.state, self.reader))
            return end
        if not body:
            raise RefusalError(f"what am I to do {clause.cue.lower()}?", [clause.cue])
        self.repeat_of(row, rounds, body)
        return end

    def repeat_of(self, row: Row, rounds: Rounds, body: Sequence[Clause]) -> None:
        """Put rounds of what the clauses ask for."""
        begun = replace(rounds.state, goal=None, at=None)
        steps, state = self.sequence([replace(body[0], joint=""), *body[1:]], begun)
        if rounds.loop.times is None and rounds.loop.every_s is None and not _worth_repeating(steps):
            raise RefusalError("I do not see what is to be repeated; say 'wait there until ...'", [text_of(body)])
        self.put(row, _one_repeat(Repeat(loop=rounds.loop, steps=_done(steps, text_of(body)))), state)

    def _how_often(self, row: Row, clause: Clause, follows: Sequence[Clause]) -> tuple[Rounds, str]:
        """How often what is behind it is to be done, and the rest of the words."""
        state = row.state
        if clause.kind is Cue.EVERY:
            return self._every(seconds_of_cue(clause.cue), clause.text, state, bool(follows))
        if clause.kind is Cue.TIMES:
            return Rounds(Loop(times=times_of_cue(clause.cue)), state), clause.text
        if clause.kind is Cue.UNTIL:
            for cut_at in (len(clause.text), *verb_positions(clause.text)):
                if time_of(clause.text[:cut_at].strip(" ,")) is not None:
                    found = Behind("", Cue.UNTIL, clause.cue, clause.text[:cut_at].strip(" ,"))
                    return self._rounds_behind(row, (), found), clause.text[cut_at:]
        supposed, rest = self.split(clause.text, state, follows)
        return _rounds_by(clause.kind, supposed), rest

    def _every(self, every_s: float, text: str, state: State, follows: bool) -> tuple[Rounds, str]:
        """Rounds at intervals; "for an hour" and "until three" may stand behind."""
        ends = [len(text), *verb_positions(text)] if follows else [*verb_positions(text)]
        if re.match(r"(?:for|until|till|as long as|while)\b", text, re.IGNORECASE):
            for cut_at in ends:
                found = self.limited(every_s, text[:cut_at].rstrip(" ,"), state)
                if found is not None:
                    return found, text[cut_at:]
            raise RefusalError(f"I do not understand for how long: '{text}'", [text])
        return Rounds(Loop(every_s=every_s), state), text

    def limited(self, every_s: float, text: str, state: State) -> Rounds | None:
        """The rounds within "for an hour", "until three o'clock", "five times"."""
        if not text:
            return Rounds(Loop(every_s=every_s), state)
        match = ACTS.for_span.fullmatch(text)
        if match is not None:
            seconds = seconds_of(match[1])
            if seconds is None or seconds < every_s:
                raise RefusalError(f"'{text}' is shorter than one round", [text])
            return Rounds(Loop(times=int(seconds // every_s), every_s=every_s), state)
        count = times_of(text)
        if count is not None:
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
        kind = Cue.UNTIL if match["how"].lower() in ("until", "till") else Cue.WHILE
        rounds = _rounds_by(kind, supposed)
        return replace(rounds, loop=rounds.loop.model_copy(update={"every_s": every_s}))

    def _on_the_way(self, row: Row, clause: Clause, follows: Sequence[Clause]) -> bool:
        """ "While driving to the kitchen, say ...": both at once, where that is simple."""
        match = ACTS.under_way.match(clause.text) if clause.kind is Cue.WHILE else None
        if match is None:
            return False
        for cut_at in (*([len(clause.text)] if follows else []), *verb_positions(clause.text)):
            going, rest = (clause.text[match.end() : cut_at].strip(" ,"), clause.text[cut_at:])
            if cut_at > match.end() and re.match(r"(?:to|into|through|from)\b", going, re.IGNORECASE):
                body = [*cut(rest), *follows]
                self.beside(row, going, body)
                return True
        raise RefusalError(f"I do not understand '{clause.cue} {clause.text}'", [clause.text])

    def beside(self, row: Row, where: str, body: Sequence[Clause]) -> None:
        """Say something while going somewhere."""
        reading = self.reader.commands_of(where, row.state, (verb("go"),))
        said = [] if len(body) != 1 else [speech_in(body[0].text, self.reader)]
        first = said[0] if said else None
        if first is None or first.text is None or first.to is not None or len(reading.commands) != 1:
            raise RefusalError("while I go somewhere I can only say something", [text_of(body)])
        self.put(row, Together(steps=(Do.of(reading.commands[0]), say(first.text))), reading.state)

    def modified(self, row: Row, clause: Clause, found: Behind) -> None:
        """What is done only if something is so, or several times."""
        scope = self._scope(row, clause, found)
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

    def _rounds_behind(self, row: Row, scope: Sequence[Clause], found: Behind) -> Rounds:
        """ "... until there are none left", "... until three o'clock"."""
        if not found.text:
            raise RefusalError(f"{found.cue.lower()} what?", [found.cue])
        if found.kind is Cue.UNTIL and (time := time_of(found.text)) is not None:
            self.notes += time.notes(found.text)
            return Rounds(Loop(until=ValueIs(text=f'clock >= "{time.text}"')), row.state)
        _, state = type(self)(self.reader).sequence(scope, row.state)
        supposed = suppose(found.text, state, self.reader)
        return replace(_rounds_by(found.kind, supposed), state=row.state)

    def _scope(self, row: Row, clause: Clause, found: Behind) -> list[Clause]:
        """The clauses that what stands behind belongs to. Raises RefusalError: that is not clear."""
        main = replace(clause, text=found.before)
        earlier = (
            [] if clause.begins or (clause.then and not ACTS.comes_back.fullmatch(found.before)) else list(row.plain)
        )
        start = max((n for n, one in enumerate(earlier) if one.begins or (one.then and n)), default=0)
        earlier = earlier[start:]
        if not earlier:
            joined = bool(row.steps[row.begun :]) and not (clause.begins or clause.then) and not row.plain
            if joined:
                raise unclear(found)
            self.flush(row)
            return [replace(main, joint="")]
        row.plain = row.plain[: len(row.plain) - len(earlier)]
        self.flush(row)
        scope = [replace(earlier[0], joint=""), *earlier[1:], main]
        if not one_errand(self.read_together(scope, row.state)):
            raise unclear(found)
        return scope

    def _guarded(self, row: Row, scope: Sequence[Clause], found: Behind) -> None:
        """What is done only if something is so."""
        if not found.text:
            raise RefusalError(f"'{found.cue}' what?", [found.cue])
        inner = type(self)(self.reader)
        inner.told = self.told
        steps, state = inner.sequence(scope, row.state)
        supposed = suppose(found.text, replace(state, goal=row.state.goal, at=row.state.at), self.reader)
        supposed = where_it_is_taken(supposed, steps, found.text)
        begun = row.state
        if found.kind is Cue.IF:
            told = supposed.holds.memory.told
            begun = replace(begun, memory=replace(begun.memory, told=told))
        again = type(self)(self.reader)
        again.told = sentence_of(supposed)
        steps, state = again.sequence(scope, replace(begun, goal=supposed.holds.goal))
        self.notes += [*again.notes, *supposed.notes]
        condition = contrary(supposed.condition) if found.kind is Cue.UNLESS else supposed.condition
        both = Supposed(condition, supposed.said, supposed.holds, supposed.fails)
        if found.kind is Cue.UNLESS:
            both = replace(both, holds=supposed.fails, fails=supposed.holds)
        steps = _done(steps, text_of(scope))
        self.put(row, Choose(condition=condition, then=steps), state_behind_both(state, row.state))
        row.asked = LookedAt(both, looked=False, decided=True)


def _done(steps: Steps, said: str) -> Steps:
    """The steps. Raises RefusalError: there are none ("do nothing twice")."""
    if not steps:
        raise RefusalError(f"'{said}' is nothing to do; leave it out", [said])
    return steps


def _worth_repeating(steps: Steps) -> bool:
    """Whether it is more than to go to one place, or to charge."""
    commands = [command for step in steps for each in step.walk() for command in each.commands]
    stays = len(commands) == 1 and commands[0].item is None and commands[0].task in (None, Task.CHARGE)
    return not stays or not all(isinstance(step, Do) for step in steps)


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
