"""Answers to the questions that a sentence leaves open: given beforehand, asked at the terminal, or by a policy."""

from __future__ import annotations

import sys
from collections.abc import Iterable

import typer

from executive.language.questions import Answerer, ClarifyingQuestion, QuestionPolicy, answer_by
from skills.files.texts import LONGEST_ANSWER, LONGEST_TEXT, plain_text

__all__ = ["answerer", "ask_at_terminal"]


def answerer(given: Iterable[str], policy: QuestionPolicy | None, ask: Answerer | None) -> Answerer:
    """Who answers: `given` are answers to the questions in their order; the policy says what becomes of further ones.

    Unless it does, `ask` is called where somebody sits at the terminal, while in scripts the sentence is refused.
    Raises InputError: an answer that was given is too long or no plain text.
    """
    left = iter([plain_text(text, what="--answer", longest=LONGEST_ANSWER) for text in given])
    further = answer_by(policy or QuestionPolicy.ASK, ask if _somebody_is_there() else None)

    def answer(question: ClarifyingQuestion) -> str | None:
        return next(left, None) or further(question)

    return answer


def ask_at_terminal(question: ClarifyingQuestion) -> str | None:
    """Put a question to who sits at the terminal; None for an empty line or the end of the input."""
    numbers = "  ".join(f"[{number}] {name}" for number, name in enumerate(question.candidates, start=1))
    typer.echo(f"? {question.text}  {numbers}".rstrip(), err=True)
    try:
        line = sys.stdin.readline(LONGEST_TEXT)
        return plain_text(line, what="the answer", longest=LONGEST_ANSWER) or None
    except (OSError, UnicodeDecodeError):
        return None


def _somebody_is_there() -> bool:
    return sys.stdin is not None and sys.stdin.isatty() and sys.stderr.isatty()
