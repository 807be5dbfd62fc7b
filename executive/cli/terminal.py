"""Asks who sits at the terminal what a sentence leaves open."""

from __future__ import annotations

import sys

import typer

from executive.language.questions import Answerer, ClarifyingQuestion
from skills.files.texts import LONGEST_ANSWER, LONGEST_TEXT, plain_text

__all__ = ["ask_at_terminal", "terminal_answerer"]


def terminal_answerer() -> Answerer | None:
    """Who answers questions at the terminal; None where nobody sits there, as in scripts."""
    somebody = sys.stdin is not None and sys.stdin.isatty() and sys.stderr.isatty()
    return ask_at_terminal if somebody else None


def ask_at_terminal(question: ClarifyingQuestion) -> str | None:
    """Put a question to who sits at the terminal; None for an empty line or the end of the input."""
    numbers = "  ".join(f"[{number}] {name}" for number, name in enumerate(question.candidates, start=1))
    typer.echo(f"? {question.text}  {numbers}".rstrip(), err=True)
    try:
        line = sys.stdin.readline(LONGEST_TEXT)
        return plain_text(line, what="the answer", longest=LONGEST_ANSWER) or None
    except (OSError, UnicodeDecodeError):
        return None
