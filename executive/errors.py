"""The one error that a user's bad input gives: it names the place and the mend."""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from pathlib import Path

__all__ = ["InputError", "did_you_mean", "listing"]


class InputError(Exception):
    """Something that the user wrote cannot be used.

    `message` says what is wrong, `mend` what to do about it; `file` and `line` (from 1) name the place where known.
    """

    def __init__(
        self, message: str, *, mend: str = "", file: Path | str | None = None, line: int | None = None
    ) -> None:
        self.message = message
        self.mend = mend
        self.file = None if file is None else Path(file)
        self.line = line
        super().__init__(str(self))

    def __str__(self) -> str:
        """One line: "file:line: what; mend"."""
        place = "" if self.file is None else f"{self.file}: " if self.line is None else f"{self.file}:{self.line}: "
        return " ".join(f"{place}{self.message}{'; ' if self.mend else ''}{self.mend}".split())


def did_you_mean(word: str, known: Iterable[str]) -> str | None:
    """The known word that is spelled most like `word`, or None when none is near."""
    by_lower = {name.lower(): name for name in known}
    near = difflib.get_close_matches(word.lower(), by_lower, n=1, cutoff=0.7)
    return by_lower[near[0]] if near else None


def listing(words: Iterable[str], *, last: str = "and") -> str:
    """The words as a sentence lists them: "a, b and c"."""
    *head, tail = [*words] or ["nothing"]
    return f"{', '.join(head)} {last} {tail}" if head else tail
