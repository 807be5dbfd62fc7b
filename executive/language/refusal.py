"""How a sentence is turned down inside the language steps."""

from __future__ import annotations

from collections.abc import Iterable

from executive.language.questions import ClarifyingQuestion, left_open

__all__ = ["RefusalError"]


class RefusalError(Exception):
    """The sentence cannot become commands: the reason in one line, and the words that were not understood.

    `question` says that an answer from the speaker would help, or is the question itself.
    """

    def __init__(
        self, reason: str, unknown: Iterable[str] = (), *, question: bool | ClarifyingQuestion = False
    ) -> None:
        super().__init__(reason)
        self.reason = reason
        self.unknown = tuple(dict.fromkeys(unknown))
        self.question = left_open(reason, next(iter(self.unknown), None)) if question is True else question or None
