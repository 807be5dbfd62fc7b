"""How a sentence is turned down inside the language steps."""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import Final

from executive.language.questions import ClarifyingQuestion, left_open

__all__ = ["RefusalError"]


_LONG_WORD: Final = re.compile(r"(\S{40})\S{20,}")


class RefusalError(Exception):
    """The sentence cannot become commands: the reason in one line, and the words that were not understood.

    `question` says that an answer from the speaker would help, or is the question itself.
    """

    def __init__(
        self, reason: str, unknown: Iterable[str] = (), *, question: bool | ClarifyingQuestion = False
    ) -> None:
        self.reason = _LONG_WORD.sub(r"\1…", reason)
        super().__init__(self.reason)
        self.unknown = tuple(dict.fromkeys(_LONG_WORD.sub(r"\1…", word) for word in unknown))
        self.question = left_open(self.reason, next(iter(self.unknown), None)) if question is True else question or None
