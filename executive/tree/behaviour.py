"""What every node of ours carries beside its status: a stable path id, a cause and one sentence."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

from py_trees.behaviour import Behaviour
from py_trees.common import Status

from skills.api import Cause


class Explained:
    """Mixin for behaviours, which have the `status`.

    `cause` is None unless the node failed or was cancelled; `message` is one sentence, `progress` from 0 to 1 or None.
    A failure is `final` where another attempt would end the same way.
    """

    path_id: str
    cause: Cause | None
    message: str
    status: Status
    progress: float | None = None
    final: bool = False

    def clear_explanation(self) -> None:
        """Forget cause and message."""
        self.cause, self.message, self.final = None, "", False

    def explain_cancelled(self) -> None:
        """Say that the node was stopped from outside, and while doing what."""
        self.cause = Cause.CANCELLED
        self.message = f"stopped while: {self.message}" if self.message else "stopped"


@dataclass(kw_only=True, eq=False, repr=False)
class ExplainedNode(Explained):
    """An explained node of ours: it takes what its spec says by keywords."""

    path_id: str
    name: str
    cause: Cause | None = field(default=None, init=False)
    message: str = field(default="", init=False)


@dataclass(kw_only=True, eq=False, repr=False)
class ExplainedLeaf(ExplainedNode, Behaviour):
    """One without children."""

    def __post_init__(self) -> None:
        Behaviour.__init__(self, self.name)

    def tick(self) -> Iterator[Behaviour]:
        """Do the work of a tick. As the library's, which also writes debug texts and checks the status' type."""
        if self.status != Status.RUNNING:
            self.initialise()
        status = self.update()
        if status != Status.RUNNING:
            self.stop(status)
        self.status = status
        yield self


def cause_of(node: Behaviour) -> Cause:
    """The node's cause; EXECUTION for a foreign node that carries none."""
    cause = node.cause if isinstance(node, Explained) else None
    return cause or Cause.EXECUTION


def failed_for_good(node: Behaviour) -> bool:
    """Whether the node, or one below it, failed and another attempt would end the same way."""
    return any(isinstance(one, Explained) and one.status == Status.FAILURE and one.final for one in node.iterate())


def message_of(node: Behaviour) -> str:
    """The node's sentence; for a foreign node its feedback message, else its name and status."""
    message = node.message if isinstance(node, Explained) else node.feedback_message
    return message or f"{node.name} {'failed' if node.status == Status.FAILURE else 'goes on'}"
