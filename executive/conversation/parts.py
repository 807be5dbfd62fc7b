"""Parts of a conversation: how sentences become missions, and replies."""

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
from executive.words.step import Step

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
    """Kind of a reply."""

    DONE = "done"  # the robot does it
    ANSWER = "answer"  # it was a question to the robot
    QUESTION = "question"  # the robot asks back
    REFUSED = "refused"  # the robot cannot do it; the text says why
    IGNORED = "ignored"  # the sentence was for another robot


@dataclass(frozen=True)
class Reply:
    """A reply in one line, with the commands that the robot starts or the question that it asks."""

    kind: ReplyKind
    text: str
    commands: tuple[Command, ...] = ()
    question: ClarifyingQuestion | None = None


@dataclass(frozen=True)
class Waiting:
    """A question of the robot, to what was said, that waits for an answer until `until_s` (robot's clock)."""

    question: ClarifyingQuestion
    sentence: str
    until_s: float


def answer(text: str) -> Reply:
    """A reply that answers a question."""
    return Reply(ReplyKind.ANSWER, text)


def confirmation(text: str) -> Reply:
    """A reply that says what the robot does."""
    return Reply(ReplyKind.DONE, text)


def refusal(text: str) -> Reply:
    """A reply that says why the robot cannot do it."""
    return Reply(ReplyKind.REFUSED, text)
