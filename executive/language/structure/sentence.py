"""Sentences that decide, repeat, wait and go on: from clauses to the steps of a mission."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from executive.language.cleaning import smoothed
from executive.language.parser import DependencyParser
from executive.language.questions import RefusalError
from executive.language.reference import Memory
from executive.language.structure.acts import Acts
from executive.language.structure.branches import ends_anyway
from executive.language.structure.cutting import Clause, Kind, behind, cut, reworded
from executive.language.structure.leaves import Leaves, State, at_start
from executive.language.structure.row import Row, Steps
from executive.words.blocks import Ask, Choose, Repeat, Together, Try, steps_of
from executive.words.knowledge import Knowledge
from executive.words.steps import MissionStep

__all__ = ["Structured", "structured"]


MOST_NESTED: Final = 2

MOST_CLAUSES: Final = 24


@dataclass(frozen=True)
class Structured:
    """The steps of a sentence, its clauses, notes on what was taken for what, and what was spoken of."""

    steps: Steps
    parts: tuple[str, ...]
    notes: tuple[str, ...]
    memory: Memory


def structured(
    text: str, *, parser: DependencyParser, knowledge: Knowledge, memory: Memory | None, plain: bool = False
) -> Structured | None:
    """The steps of a sentence that `mentions_structure`; None where it lists plain commands nevertheless.

    `plain` says that it could be read as such a list, too: then only what certainly decides or repeats is read
    otherwise.

    Raises:
        RefusalError: it decides, repeats, waits, says or asks something that is not surely understood; the message
            names the words.
    """
    clauses = cut(reworded(smoothed(text)))
    if plain and not any(one.kind is not None or behind(one.text) is not None for one in clauses):
        return None
    if len(clauses) > MOST_CLAUSES:
        raise RefusalError(f"{len(clauses)} parts are too many for one sentence; say it in {MOST_CLAUSES} at most")
    builder = Builder(Leaves(parser, knowledge))
    steps, state = builder.sequence(clauses, at_start(knowledge, memory or Memory()))
    if all(step.block is None for step in steps) and not builder.special:
        return None
    if max(map(_depth, steps), default=0) > MOST_NESTED:
        raise RefusalError("one thing inside another inside a third is too much; say it in two sentences")
    parts = tuple(" | ".join(filter(None, (each.joint.strip(" ,;."), each.cue, each.text))) for each in clauses)
    return Structured(steps, parts, tuple(dict.fromkeys(builder.notes)), state.memory)


def _depth(step: MissionStep) -> int:
    """How deeply blocks stand within blocks; what is done at the end does not count."""
    inner = max(map(_depth, () if step.block is None else steps_of(step.block)), default=0)
    holds = isinstance(step.block, Choose | Repeat | Try | Together | Ask)
    return inner + holds


class Builder(Acts):
    """Puts the steps of one sentence together. Its methods raise RefusalError."""

    def sequence(self, clauses: Sequence[Clause], state: State) -> tuple[Steps, State]:
        """The steps of clauses, one after the other."""
        row, at = Row(state), 0
        while at < len(clauses):
            last = row.steps[-1].block if row.steps and not row.plain else None
            if isinstance(last, Repeat) and last.times is None and last.until is None and last.while_ is None:
                raise RefusalError(
                    "nothing can come after what is repeated without end; say how often", [clauses[at].text]
                )
            at = self._next(row, clauses, at)
        self.flush(row)
        return tuple(row.steps), row.state

    def _next(self, row: Row, clauses: Sequence[Clause], at: int) -> int:
        """Take the clause at `at`, and those that belong to it; the index of the one behind."""
        clause = clauses[at]
        if clause.anyway or ends_anyway(clause):
            return self.always(row, clauses, at)
        if clause.kind in (Kind.IF, Kind.UNLESS):
            return self.decided(row, clauses, at)
        if clause.kind in (Kind.SO, Kind.NOT, Kind.OTHERWISE, Kind.FAILED):
            return self.attached(row, clauses, at)
        if clause.kind is Kind.SOON:
            return self.soon(row, clauses, at)
        if clause.kind is not None:
            return self.repeated(row, clauses, at)
        return self.one_clause(row, clauses, at)
