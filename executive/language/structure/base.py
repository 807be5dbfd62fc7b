"""What all parts of putting steps together share: plain clauses, understood as sentences of their own."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace

from executive.language.structure.cutting import Clause, spoken
from executive.language.structure.leaves import Leaf, Leaves, State
from executive.language.structure.row import Row, Steps, asked_by, checked
from executive.language.structure.waiting import Done
from executive.words.blocks import Block
from executive.words.steps import MissionStep


class Base:
    """Puts the steps of one sentence together. Its methods raise RefusalError.

    `told` is what "tell Robin" tells, `verb` the last verb by which something was to be brought, `notes` say what was
    taken for what; `special` says that it is more than a list of commands, also where it has no block.
    """

    told: str | None = None
    verb: str | None = None

    def __init__(self, leaves: Leaves) -> None:
        self.leaves = leaves
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
        leaf, row.plain = self.plain_leaf(row.plain, row.state), []
        self.add(row, leaf)
        if row.asked is not None and row.asked.looked:
            there = re.sub(r"^(?:is|are) there ", "there is ", last, flags=re.IGNORECASE)
            said = checked(last) or (there if there != last else "")
            row.asked = replace(row.asked, supposed=replace(row.asked.supposed, said=said))

    def plain_leaf(self, clauses: Sequence[Clause], state: State) -> Leaf:
        """What clauses that are plain commands ask for together."""
        return self.leaves.leaf(spoken([replace(clauses[0], joint=""), *clauses[1:]]), state, clauses[0].lead)

    def add(self, row: Row, leaf: Leaf) -> None:
        """Put what a plain part asks for."""
        self.notes += leaf.trace.notes
        row.steps += [MissionStep(leaf.commands)] if leaf.commands else []
        before, row.state = row.state, leaf.state
        row.asked = asked_by(leaf, before, self.leaves)

    def put(self, row: Row, block: Block, state: State) -> None:
        """Put a block; `state` is what is known behind it."""
        row.steps.append(MissionStep(block=block))
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
