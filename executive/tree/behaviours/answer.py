"""The answer to a status check: an honest no is a success, a no without having looked is not."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

from py_trees.common import Status

from executive.tree.behaviour import Explained
from executive.tree.behaviours.decorators import ExplainedDecorator
from executive.tree.board import Board
from executive.tree.node import NodeKind
from skills.api import Cause, Failed, ObjectObservation, Publish
from skills.detect.words import counted, told_apart

ANSWER_TOPIC: Final = "answer"


@dataclass(kw_only=True, eq=False, repr=False)
class Answer(ExplainedDecorator):
    """Turns a search into a yes or a no.

    Child RUNNING: RUNNING. Child SUCCESS: SUCCESS, answer True. Child FAILURE with every surface looked at: SUCCESS,
    answer False. Child FAILURE with a surface that could not be looked at: FAILURE with what kept the robot from it.
    `looks` names for each surface the leaves that look at it, one for each viewpoint: all of them must have looked,
    which means that they succeeded, or failed with POSTCONDITION. The answer is published under `ANSWER_TOPIC`; one
    that `tells` repeats what was seen where. `question` is what a yes says, `denied` what a no says; without
    `yes_or_no` they stand alone, since "is it empty" and "is there anything on it" are one question.

    With `tallies` the child looks at all surfaces, and what its leaves saw, each under a blackboard key, is counted,
    each object once. As many as `needed` is SUCCESS, answer True. Too few is SUCCESS, answer False, with every surface
    looked at, and else FAILURE as above. How many were counted goes to `count_key`, where
    there is one.
    """

    question: str
    denied: str
    looks: Mapping[str, Sequence[str]]
    key: str
    board: Board
    publish: Publish
    tells: bool = False
    tallies: Mapping[str, str] = field(default_factory=dict)
    needed: int = 1
    yes_or_no: bool = True
    count_key: str = ""
    answer: bool | None = field(default=None, init=False)

    def initialise(self) -> None:
        """Forget an earlier answer."""
        self.answer = None

    def update(self) -> Status:
        """The answer, as soon as the search is over."""
        status = self.pass_on()
        if status == Status.RUNNING:
            return status
        nodes = {node.path_id: node for node in self.iterate() if isinstance(node, Explained)}
        unseen = [surface for surface, leaves in self.looks.items() if not _looked(leaves, nodes)]
        if self.tallies:
            return self._counted(nodes, unseen)
        if status == Status.FAILURE and unseen:
            return self._not_looked(nodes, unseen)
        answer = status == Status.SUCCESS
        return self._answered(answer, self.message if answer and self.tells else "")

    def _counted(self, nodes: Mapping[str, Explained], unseen: Sequence[str]) -> Status:
        seen = [key for leaf, key in self.tallies.items() if leaf in nodes and nodes[leaf].status == Status.SUCCESS]
        looks: list[tuple[ObjectObservation, ...]] = [self.board.get(key) for key in seen]
        found = told_apart(looks)
        enough = len(found) >= self.needed
        if self.count_key:
            self.board.put(self.count_key, float(len(found)))
        if unseen and not enough:
            return self._not_looked(nodes, unseen)
        limits = f", as far as was seen: not {', '.join(unseen)}" if unseen else ""
        return self._answered(enough, f"{counted(found, ())}{limits}" if found else "")

    def _not_looked(self, nodes: Mapping[str, Explained], unseen: Sequence[str]) -> Status:
        return self.fail(Failed(_obstacle(nodes), f"could not look at {', '.join(unseen)}: {self.message}"))

    def _answered(self, answer: bool, found: str) -> Status:
        self.answer, self.cause = answer, None
        told = self.question if answer else self.denied
        if self.yes_or_no:
            told = f"{'yes' if answer else 'no'}: {told}"
        self.message = told + (f"; {found}" if found else "")
        self.board.put(self.key, answer)
        note = {"node": self.path_id, "question": self.question, "answer": answer, "message": self.message}
        self.publish(ANSWER_TOPIC, note)
        return Status.SUCCESS


def _looked(leaves: Sequence[str], nodes: Mapping[str, Explained]) -> bool:
    """True when each of the leaves took a look, whether it saw something or nothing."""
    return all(leaf in nodes and _took_a_look(nodes[leaf]) for leaf in leaves)


def _took_a_look(leaf: Explained) -> bool:
    return leaf.status == Status.SUCCESS or leaf.cause == Cause.POSTCONDITION


def _obstacle(nodes: Mapping[str, Explained]) -> Cause:
    """The first cause in the tree that is not merely "not seen"."""
    causes = (node.cause for node in nodes.values())
    return next((cause for cause in causes if cause not in (None, Cause.POSTCONDITION)), None) or Cause.EXECUTION


def _writes(options: Mapping[str, Any]) -> Mapping[str, Any]:
    count = options.get("count_key")
    return {options["key"]: bool, **({count: float} if count else {})}


KINDS: Final[Mapping[str, NodeKind]] = {"answer": NodeKind(Answer, ("child", "board", "publish"), writes=_writes)}
