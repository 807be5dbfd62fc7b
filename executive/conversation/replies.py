"""Parts of a conversation: understanding of sentences, replies, and open questions."""

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
    """Understanding of sentences for one robot.

    `understand` takes a sentence without wake phrase and the memory of earlier ones; `compile` makes a mission of
    steps, with a name that is none of the given ones, and raises InputError.
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
    """Reply in one line, with the commands that the robot starts or the question that it asks."""

    kind: ReplyKind
    text: str
    commands: tuple[Command, ...] = ()
    question: ClarifyingQuestion | None = None


@dataclass(frozen=True)
class Waiting:
    """Open question of the robot about a sentence, which waits for an answer until `until_s` (robot's clock)."""

    question: ClarifyingQuestion
    sentence: str
    until_s: float


def answer(text: str) -> Reply:
    """Reply that answers a question."""
    return Reply(ReplyKind.ANSWER, text)


def confirmation(text: str) -> Reply:
    """Reply that says what the robot does."""
    return Reply(ReplyKind.DONE, text)


def refusal(text: str) -> Reply:
    """Reply that says why the robot refuses."""
    return Reply(ReplyKind.REFUSED, text)
