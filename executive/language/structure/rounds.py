"""What is done several times, and what stands behind what is to be done."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from typing import Final

from executive.language.questions import RefusalError
from executive.language.structure.amounts import SPAN, seconds_of, time_of, times_of
from executive.language.structure.branches import Branches
from executive.language.structure.conditions import suppose
from executive.language.structure.cutting import Behind, Clause, Kind, cut, spoken, verb_positions
from executive.language.structure.leaves import State, Supposed, negated, verb
from executive.language.structure.row import (
    LookedAt,
    Rounds,
    Row,
    Steps,
    end_of,
    merged,
    one_errand,
    say,
    sentence_of,
    unclear,
    where_it_is_taken,
)
from executive.language.structure.telling import said_by
from executive.language.structure.waiting import wait
from executive.words.blocks import Choose, Repeat, Together
from executive.words.command import Task
from executive.words.condition import ValueIs
from executive.words.expression import Expression
from executive.words.steps import MissionStep


class Repeats(Branches):
    """Repeats. Its methods raise RefusalError."""

    def repeated(self, row: Row, clauses: Sequence[Clause], at: int) -> int:
        """ "Every ten minutes", "three times", "as long as ..." before what is to be done."""
        clause, end = clauses[at], end_of(clauses, at + 1, rounds=True)
        self.flush(row)
        aside = self._on_the_way(row, clause, clauses[at + 1 : end])
        if aside:
            return end
        rounds, rest = self._how_often(row, clause, clauses[at + 1 : end])
        body = [*cut(rest), *clauses[at + 1 : end]]
        if clause.kind in (Kind.WHILE, Kind.UNTIL) and len(body) == 1 and _STAYS.fullmatch(body[0].text):
            said = clause.text[: len(clause.text) - len(rest)].strip(" ,")
            how = "until" if clause.kind is Kind.UNTIL else "while"
            self.put_done(row, wait(body[0].text.partition(" ")[2], how, said, row.state, self.leaves))
            return end
        if not body:
            raise RefusalError(f"what am I to do {clause.cue.lower()}?", [clause.cue])
        self.repeat_of(row, rounds, body)
        return end

    def repeat_of(self, row: Row, rounds: Rounds, body: Sequence[Clause]) -> None:
        """Put rounds of what the clauses ask for."""
        begun = replace(rounds.state, goal=None, at=None)
        steps, state = self.sequence([replace(body[0], joint=""), *body[1:]], begun)
        if rounds.block.times is None and rounds.block.every_s is None and not _worth_repeating(steps):
            raise RefusalError("I do not see what is to be repeated; say 'wait there until ...'", [spoken(body)])
        self.put(row, _one_repeat(replace(rounds.block, steps=steps)), state)

    def _how_often(self, row: Row, clause: Clause, follows: Sequence[Clause]) -> tuple[Rounds, str]:
        """How often what is behind it is to be done, and the rest of the words."""
        state = row.state
        if clause.kind is Kind.EVERY:
            return self._every(_span(clause.cue), clause.text, state, bool(follows))
        if clause.kind is Kind.TIMES:
            return Rounds(Repeat((), times=_times(clause.cue)), state), clause.text
        if clause.kind is Kind.UNTIL:
            for cut_at in (len(clause.text), *verb_positions(clause.text)):
                if time_of(clause.text[:cut_at].strip(" ,")) is not None:
                    found = Behind("", Kind.UNTIL, clause.cue, clause.text[:cut_at].strip(" ,"))
                    return self._rounds_behind(row, (), found) or Rounds(Repeat(()), state), clause.text[cut_at:]
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
        return Rounds(Repeat((), every_s=every_s), state), text

    def limited(self, every_s: float, text: str, state: State) -> Rounds | None:
        """The rounds within "for an hour", "until three o'clock", "five times"."""
        if not text:
            return Rounds(Repeat((), every_s=every_s), state)
        match = re.fullmatch(rf"for (?:the next )?({SPAN})", text, re.IGNORECASE)
        if match is not None:
            seconds = seconds_of(match[1])
            if seconds is None or seconds < every_s:
                raise RefusalError(f"'{text}' is shorter than one round", [text])
            return Rounds(Repeat((), times=int(seconds // every_s), every_s=every_s), state)
        count = times_of(text)
        if count is not None:
            return Rounds(Repeat((), times=count, every_s=every_s), state)
        match = re.fullmatch(r"(?P<how>until|till|as long as|while) (?P<what>.+)", text, re.IGNORECASE)
        if match is None:
            return None
        if (time := time_of(match["what"])) is not None:
            self.notes += [f"I take '{match['what']}' as {time.text}"] if time.taken else []
            until = ValueIs(Expression(f'clock >= "{time.text}"'))
            return Rounds(Repeat((), until=until, every_s=every_s), state)
        try:
            supposed = suppose(match["what"], state, self.leaves)
        except RefusalError:
            return None
        kind = Kind.UNTIL if match["how"].lower() in ("until", "till") else Kind.WHILE
        rounds = _rounds_by(kind, supposed)
        return replace(rounds, block=replace(rounds.block, every_s=every_s))

    def _on_the_way(self, row: Row, clause: Clause, follows: Sequence[Clause]) -> bool:
        """ "While driving to the kitchen, say ...": both at once, where that is simple."""
        match = _UNDER_WAY.match(clause.text) if clause.kind is Kind.WHILE else None
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
        leaf = self.leaves.leaf(where, row.state, (verb("go"),))
        said = [] if len(body) != 1 else [said_by(body[0].text, self.leaves.knowledge, self.leaves.parser)]
        first = said[0] if said else None
        if first is None or first.text is None or first.to is not None or len(leaf.commands) != 1:
            raise RefusalError("while I go somewhere I can only say something", [spoken(body)])
        self.put(row, Together((MissionStep(leaf.commands), say(first.text))), leaf.state)

    def modified(self, row: Row, clause: Clause, found: Behind) -> None:
        """What is done only if something is so, or several times."""
        scope = self._scope(row, clause, found)
        if found.kind in (Kind.IF, Kind.UNLESS):
            self._guarded(row, scope, found)
            return
        if found.kind is Kind.WHILE and (match := _UNDER_WAY.match(found.text)) is not None:
            self.beside(row, found.text[match.end() :].strip(), scope)
            return
        if found.kind is Kind.EVERY:
            rounds = self.limited(_span(found.cue), found.text, row.state)
        elif found.kind is Kind.TIMES:
            rounds = Rounds(Repeat((), times=_times(found.cue)), row.state) if not found.text else None
        else:
            rounds = self._rounds_behind(row, scope, found)
        if rounds is None:
            raise RefusalError(f"I do not understand how often: '{found.cue} {found.text}'".strip(), [found.cue])
        self.repeat_of(row, rounds, scope)

    def _rounds_behind(self, row: Row, scope: Sequence[Clause], found: Behind) -> Rounds | None:
        """ "... until there are none left", "... until three o'clock"."""
        if not found.text:
            raise RefusalError(f"{found.cue.lower()} what?", [found.cue])
        if found.kind is Kind.UNTIL and (time := time_of(found.text)) is not None:
            self.notes += [f"I take '{found.text}' as {time.text}"] if time.taken else []
            return Rounds(Repeat((), until=ValueIs(Expression(f'clock >= "{time.text}"'))), row.state)
        _, state = type(self)(self.leaves).sequence(scope, row.state)
        supposed = suppose(found.text, state, self.leaves)
        return replace(_rounds_by(found.kind, supposed), state=row.state)

    def _scope(self, row: Row, clause: Clause, found: Behind) -> list[Clause]:
        """The clauses that what stands behind belongs to. Raises RefusalError: that is not clear."""
        main = replace(clause, text=found.before)
        earlier = [] if clause.begins or (clause.then and not _COMES_BACK.fullmatch(found.before)) else list(row.plain)
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
        if not one_errand(self.plain_leaf(scope, row.state)):
            raise unclear(found)
        return scope

    def _guarded(self, row: Row, scope: Sequence[Clause], found: Behind) -> None:
        """What is done only if something is so."""
        if not found.text:
            raise RefusalError(f"'{found.cue}' what?", [found.cue])
        inner = type(self)(self.leaves)
        inner.told = self.told
        steps, state = inner.sequence(scope, row.state)
        supposed = suppose(found.text, replace(state, goal=row.state.goal, at=row.state.at), self.leaves)
        supposed = where_it_is_taken(supposed, steps, found.text)
        begun = row.state
        if found.kind is Kind.IF:
            told = supposed.holds.memory.told
            begun = replace(begun, memory=replace(begun.memory, told=told))
        again = type(self)(self.leaves)
        again.told = sentence_of(supposed)
        steps, state = again.sequence(scope, replace(begun, goal=supposed.holds.goal))
        self.notes += [*again.notes, *supposed.notes]
        condition = negated(supposed.condition) if found.kind is Kind.UNLESS else supposed.condition
        both = Supposed(condition, supposed.said, supposed.holds, supposed.fails)
        if found.kind is Kind.UNLESS:
            both = replace(both, holds=supposed.fails, fails=supposed.holds)
        self.put(row, Choose(condition, steps), merged(state, row.state))
        row.asked = LookedAt(both, looked=False, decided=True)


_STAYS: Final = re.compile(r"(?:wait|stay|remain|stand)(?: (?:here|there|(?:in|at|by|near) .+))?", re.IGNORECASE)


_UNDER_WAY: Final = re.compile(
    r"(?:driving|going|moving|walking|heading|you (?:are |'re )?(?:drive|driving|go|going|move|moving|walk"
    r"|walking|head|heading)|on the way)\b ?",
    re.IGNORECASE,
)


_COMES_BACK: Final = re.compile(r"(?:come|go|return|drive|and) ?(?:back)?(?: again| here| to me)?", re.IGNORECASE)


def _worth_repeating(steps: Steps) -> bool:
    """Whether it is more than to go to one place, or to charge."""
    commands = [command for step in steps for each in step.walk() for command in each.commands]
    stays = len(commands) == 1 and commands[0].item is None and commands[0].task in (None, Task.CHARGE)
    return not stays or any(step.block is not None for step in steps)


def _one_repeat(block: Repeat) -> Repeat:
    """Rounds that hold only rounds without an end become one, which ends as the outer ones."""
    inner = block.steps[0].block if len(block.steps) == 1 else None
    endless = isinstance(inner, Repeat) and inner.times is None and inner.until is None and inner.while_ is None
    if not (isinstance(inner, Repeat) and endless):
        return block
    if block.every_s is not None or block.times is not None:
        raise RefusalError("what is repeated without end cannot be repeated again", [])
    return replace(inner, until=block.until, while_=block.while_)


def _rounds_by(kind: Kind | None, supposed: Supposed) -> Rounds:
    if kind is Kind.UNTIL:
        return Rounds(Repeat((), until=supposed.condition), supposed.fails)
    return Rounds(Repeat((), while_=supposed.condition), supposed.holds)


def _span(cue: str) -> float:
    """The seconds of "every ten minutes"."""
    words = re.sub(r"^(?:once )?(?:every|each|per) |^once (?=an? )|^once per ", "", cue, flags=re.IGNORECASE)
    seconds = seconds_of(words if words not in ("hour", "minute") else f"a {words}")
    if seconds is None:
        raise RefusalError(f"'{cue}' is no time that I understand", [cue])
    return seconds


def _times(cue: str) -> int:
    words = re.sub(r"^(?:do|repeat) (?:this |that |the following |it )?|^for ", "", cue, flags=re.IGNORECASE)
    count = times_of(words)
    if count is None:
        raise RefusalError(f"'{cue}' is no number of times that I understand", [cue])
    return count
