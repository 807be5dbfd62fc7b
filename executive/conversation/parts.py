"""What a conversation is made of: how sentences become missions, and replies."""

from __future__ import annotations

import enum
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

from executive.language.questions import ClarifyingQuestion
from executive.language.reference import Memory
from executive.language.understand import Understanding
from executive.tree.compiler import CompiledTree
from executive.words.command import Command
from executive.words.knowledge import Knowledge
from executive.words.steps import Step

__all__ = ["NEVER_MIND", "OVER", "Reply", "ReplyKind", "Speech", "Waiting", "answer", "done", "refused"]

OVER: Final = "the run is over; begin another with 'errand run'"
NEVER_MIND: Final = "all right, never mind"


@dataclass(frozen=True)
class Speech:
    """How sentences become missions of one robot.

    `understand` takes a sentence without wake phrase and what was spoken of before; `compile` makes a mission of
    steps under a name that is none of those given, and raises InputError.
    """

    knowledge: Knowledge
    robot_name: str
    understand: Callable[[str, Memory | None], Understanding]
    compile: Callable[[Sequence[Step], frozenset[str]], CompiledTree]


class ReplyKind(enum.Enum):
    """What became of what was said."""

    DONE = "done"  # it is done, or begun
    ANSWER = "answer"  # it was a question to the robot
    QUESTION = "question"  # the robot asks back
    REFUSED = "refused"  # it cannot be done; the text says why
    IGNORED = "ignored"  # it was not said to this robot


@dataclass(frozen=True)
class Reply:
    """What the robot says, in one line, and the commands that it begins with or the question that it asks."""

    kind: ReplyKind
    text: str
    commands: tuple[Command, ...] = ()
    question: ClarifyingQuestion | None = None


@dataclass(frozen=True)
class Waiting:
    """A question of the robot that waits for its answer until `until_s` (robot's clock)."""

    question: ClarifyingQuestion
    until_s: float


def answer(text: str) -> Reply:
    """An answer to what was asked."""
    return Reply(ReplyKind.ANSWER, text)


def done(text: str) -> Reply:
    """It is done."""
    return Reply(ReplyKind.DONE, text)


def refused(text: str) -> Reply:
    """It cannot be done."""
    return Reply(ReplyKind.REFUSED, text)
