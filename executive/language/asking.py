"""Sentences understood with somebody to ask: each question is answered, and the sentence understood anew."""

from __future__ import annotations

from typing import Final

from executive.language.parser import DependencyParser
from executive.language.questions import Answerer, with_answer
from executive.language.understand import Understanding, understand
from executive.mission.knowledge import Knowledge

__all__ = ["understand_asking"]

_MOST_QUESTIONS: Final = 3


def understand_asking(
    sentence: str,
    *,
    answer: Answerer,
    parser: DependencyParser,
    knowledge: Knowledge,
    require_wake: bool,
    robot_name: str | None = None,
    correct: bool = True,
) -> Understanding:
    """What a sentence means once its questions are answered; `text` is the sentence with the answers in their places.

    The arguments are those of `understand`. A question that is left open, or whose answer is not understood, is what
    comes back.
    """

    def meaning(text: str) -> Understanding:
        return understand(
            text, parser=parser, knowledge=knowledge, require_wake=require_wake, robot_name=robot_name, correct=correct
        )

    meant = meaning(sentence)
    for _ in range(_MOST_QUESTIONS):
        said = None if meant.question is None else answer(meant.question)
        if meant.question is None or said is None:
            break
        sentence = with_answer(sentence, meant.question, said)
        meant = meaning(sentence)
    return meant
