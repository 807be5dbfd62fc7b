"""Conditions and what hangs on them: "if", "unless", "otherwise", "if that fails", "whatever happens"."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from typing import Final

from executive.language.questions import RefusalError
from executive.language.structure.base import Base
from executive.language.structure.conditions import suppose
from executive.language.structure.cutting import Behind, Clause, Kind, cut, pattern, verb_positions
from executive.language.structure.leaves import State, Supposed
from executive.language.structure.row import Row, Steps, end_of, merged, same, sentence_of, turned, was_not
from executive.words.blocks import Choose, Group, Repeat, Try, Wait
from executive.words.steps import MissionStep


class Branches(Base):
    """Decides. Its methods raise RefusalError."""

    def modified(self, row: Row, clause: Clause, found: Behind) -> None:
        """What is done only if something is so, or several times."""
        raise NotImplementedError

    def always(self, row: Row, clauses: Sequence[Clause], at: int) -> int:
        """What is done at the end, whatever happens."""
        self.flush(row)
        if not row.steps:
            raise RefusalError(
                "before what is to be done in every case, say what is to be done first", [clauses[at].text]
            )
        first = clauses[at]
        ended = re.sub(rf"[, ]*{pattern('whatever').pattern}$", "", first.text, flags=re.IGNORECASE)
        ended = re.sub(r"[, ]+(?:at the end|in the end)$", "", ended, flags=re.IGNORECASE)
        rest = [replace(first, joint="", text=ended), *clauses[at + 1 :]]
        always, state = self.sequence(rest, replace(row.state, goal=None, at=None))
        row.steps = [MissionStep(block=Group(tuple(row.steps), always=always))]
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
            row.steps[-1:] = asked.before
        body = [*cut(rest), *follows]
        if clause.kind is Kind.UNLESS:
            supposed = turned(supposed)
        return self.choose(row, supposed, body, clauses, end)

    def _holds(self, text: str, row: Row) -> bool:
        """Whether the text is a condition as it stands."""
        state = row.state
        try:
            if row.plain:
                state = self.plain_leaf(row.plain, state).state
            suppose(text, state, self.leaves)
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
                supposed = suppose(condition, state, self.leaves)
                if rest:
                    inner = type(self)(self.leaves)
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
        if end < len(clauses) and clauses[end].kind in (Kind.OTHERWISE, Kind.NOT, Kind.SO):
            first = clauses[end]
            if first.kind is Kind.SO and not was_not(clauses, end):
                raise RefusalError(f"I do not understand '{first.cue}' here", [first.cue])
            stop = end_of(clauses, end + 1, branch=True)
            rest = [*cut(first.text), *clauses[end + 1 : stop]]
            if rest and rest[0].kind is Kind.IF:
                stop = len(clauses)
                rest = [rest[0], *rest[1 : len(cut(first.text))], *clauses[end + 1 : stop]]
            if not rest:
                raise RefusalError(f"what am I to do {first.cue.lower()}?", [first.cue])
            begun = supposed.fails
            if begun.memory.things == () or begun.memory.things[-1].person:
                begun = replace(begun, memory=replace(begun.memory, things=after.memory.things))
            otherwise, other_state = self.branch(rest, turned(supposed), begun)
            end = stop
        if not (then or otherwise):
            raise RefusalError("then there is nothing to do", [supposed.said])
        self.put(row, Choose(supposed.condition, then, otherwise), merged(after, other_state))
        return end

    def branch(self, clauses: Sequence[Clause], supposed: Supposed, state: State) -> tuple[Steps, State]:
        """The steps of a branch; "tell Robin" tells what was found."""
        if not clauses:
            raise RefusalError(f"what am I to do if {supposed.said}?", [supposed.said])
        inner = type(self)(self.leaves)
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
        if clause.kind in (Kind.SO, Kind.NOT) and asked is None and _SOMEBODY.search(clause.cue):
            supposed = suppose(re.sub(r"^if ", "", clause.cue, flags=re.IGNORECASE), row.state, self.leaves)
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
        if asked is not None and asked.looked and clause.kind is not Kind.FAILED:
            row.steps[-1:] = asked.before
            supposed = asked.supposed if clause.kind is Kind.SO else turned(asked.supposed)
            end = end_of(clauses, at + 1)
            body = [*cut(clause.text), *clauses[at + 1 : end]]
            return self.choose(row, supposed, body, clauses, end)
        last = row.steps[-1].block if row.steps else None
        if asked is not None and asked.decided and isinstance(last, Choose) and clause.kind is not Kind.SO:
            return self._else_of(row, last, asked.supposed, body, end)
        if isinstance(last, Choose | Repeat) and clause.kind is not Kind.FAILED:
            raise RefusalError(f"I do not understand to what '{clause.cue}' belongs", [clause.cue])
        if clause.kind is Kind.SO:
            raise RefusalError(f"'{clause.cue}' goes on from nothing that was looked at", [clause.cue])
        if not body:
            raise RefusalError(f"what am I to do {clause.cue.lower()}?", [clause.cue])
        missing = clause.kind is Kind.NOT and clause.cue.lower() not in ("if not", "if no")
        if missing and asked is not None:
            otherwise, state = self.branch(body, turned(asked.supposed), asked.supposed.fails)
            done = tuple(row.steps[-1:])
            row.steps[-1:] = []
            self.put(row, Choose(asked.supposed.condition, done, otherwise), merged(row.state, state))
            return end
        if missing:
            raise RefusalError(f"'{clause.cue}' goes on from nothing that was looked at", [clause.cue])
        tried = tuple(row.steps[row.begun :])
        otherwise, state = self.sequence(
            [replace(body[0], joint=""), *body[1:]], replace(row.state, held=None, goal=None, at=None)
        )
        row.steps[row.begun :] = []
        self.put(row, Try(tried, otherwise), merged(row.state, state))
        return end

    def _else_of(self, row: Row, last: Choose, supposed: Supposed, body: Sequence[Clause], end: int) -> int:
        """The other branch of what was done only if something was so."""
        otherwise, state = self.branch(body, turned(supposed), supposed.fails)
        row.steps[-1:] = []
        self.put(row, replace(last, otherwise=otherwise), merged(row.state, state))
        return end

    def soon(self, row: Row, clauses: Sequence[Clause], at: int) -> int:
        """ "As soon as Robin comes, ..." waits for that."""
        self.flush(row)
        end = end_of(clauses, at + 1)
        supposed, rest = self.split(clauses[at].text, row.state, clauses[at + 1 : end])
        if not rest and end == at + 1:
            raise RefusalError(f"what am I to do {clauses[at].cue.lower()} {supposed.said}?", [clauses[at].cue])
        self.put(row, Wait(supposed.condition), supposed.holds)
        more, row.state = self.sequence([*cut(rest), *clauses[at + 1 :]], supposed.holds)
        row.steps += more
        return len(clauses)

    def behind_if(self, row: Row, clause: Clause, clauses: Sequence[Clause], at: int) -> int:
        """A condition behind a comma: "bring me a beer, if there is one"."""
        if not row.plain:
            raise RefusalError(f"what is to be done {clause.cue} {clause.text}? Say the condition first", [clause.text])
        main = row.plain.pop()
        self.modified(row, main, Behind(main.text, clause.kind or Kind.IF, clause.cue, clause.text))
        return at + 1


_SOMEBODY: Final = re.compile(r"\b(?:nobody|no one|somebody|someone|anybody|anyone)\b", re.IGNORECASE)


def ends_anyway(clause: Clause) -> bool:
    """Whether "whatever happens" stands at the end of a clause."""
    return clause.kind is None and re.search(rf"{pattern('whatever').pattern}$", clause.text, re.IGNORECASE) is not None
