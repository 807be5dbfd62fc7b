"""The answer to a status check: an honest no is a success, a no without having looked is not."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from executive.behaviours.board import Board
from executive.behaviours.decorators import ExplainedDecorator
from executive.behaviours.explained import Explained
from skills.api import Cause, Failed, Publish

ANSWER_TOPIC: Final = "answer"


class Answer(ExplainedDecorator):
    """Turns a search into a yes or a no.

    Child RUNNING: RUNNING. Child SUCCESS: SUCCESS, answer True. Child FAILURE with every surface looked at: SUCCESS,
    answer False. Child FAILURE with a surface that could not be looked at: FAILURE with what kept the robot from it.
    `looks` names for each surface the leaves that look at it, one for each viewpoint: all of them must have looked,
    which means that they failed with POSTCONDITION. The answer is published under `ANSWER_TOPIC`; one that
    `tells` repeats what was seen where, and how many.
    """

    def __init__(
        self,
        *,
        path_id: str,
        name: str,
        child: Behaviour,
        question: str,
        looks: Mapping[str, Sequence[str]],
        key: str,
        board: Board,
        publish: Publish,
        tells: bool = False,
    ) -> None:
        super().__init__(path_id=path_id, name=name, child=child)
        self.answer: bool | None = None
        self._question, self._looks, self._key, self._board = question, looks, key, board
        self._publish, self._tells = publish, tells

    def initialise(self) -> None:
        """Forget an earlier answer."""
        self.answer = None

    def update(self) -> Status:
        """The answer, as soon as the search is over."""
        status = self.pass_on()
        if status == Status.RUNNING:
            return status
        if status == Status.FAILURE:
            nodes = {node.path_id: node for node in self.iterate() if isinstance(node, Explained)}
            unseen = [surface for surface, leaves in self._looks.items() if not _looked(leaves, nodes)]
            if unseen:
                return self.fail(Failed(_obstacle(nodes), f"could not look at {', '.join(unseen)}: {self.message}"))
        return self._answered(status == Status.SUCCESS)

    def _answered(self, answer: bool) -> Status:
        self.answer, self.cause = answer, None
        found = f"; {self.message}" if answer and self._tells else ""
        self.message = f"{'yes' if answer else 'no'}: {self._question}{found}"
        self._board.put(self._key, answer)
        told = {"node": self.path_id, "question": self._question, "answer": answer, "message": self.message}
        self._publish(ANSWER_TOPIC, told)
        return Status.SUCCESS


def _looked(leaves: Sequence[str], nodes: Mapping[str, Explained]) -> bool:
    """True when each of the leaves took a look and saw nothing."""
    return all(leaf in nodes and nodes[leaf].cause == Cause.POSTCONDITION for leaf in leaves)


def _obstacle(nodes: Mapping[str, Explained]) -> Cause:
    """The first cause in the tree that is not merely "not seen"."""
    causes = (node.cause for node in nodes.values())
    return next((cause for cause in causes if cause not in (None, Cause.POSTCONDITION)), None) or Cause.EXECUTION
