"""The error for bad user input, with its location and a hint, and phrases for its messages."""

from __future__ import annotations

import errno
import os
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

NEAREST: Final = 3
FEW: Final = 5
MOST_LISTED: Final = 8
MOST_LETTERS: Final = 1000
FEW_LETTERS: Final = 60
_USED_BY: Final = "used by"
_MOST_USERS: Final = 3
_LONGEST_CHAIN: Final = 20


@dataclass(frozen=True)
class SourceLine:
    """A line (from 1) in a user's file."""

    file: Path
    line: int


class InputError(Exception):
    """Error of user input that cannot be used.

    `message` says what is wrong, `hint` what to do; `file` and `line` (from 1) are the location, if known. A very long
    message is truncated. `others` are further errors found at the same time.
    """

    def __init__(
        self,
        message: str,
        *,
        hint: str = "",
        file: Path | str | None = None,
        line: int | None = None,
        others: Iterable[InputError] = (),
    ) -> None:
        self.message = message if len(message) <= MOST_LETTERS else f"{message[:MOST_LETTERS]}..."
        self.others = tuple(others)
        self.hint = hint
        self.file = None if file is None else Path(file)
        self.line = line
        super().__init__(str(self))

    @classmethod
    def at(cls, source: SourceLine | None, message: str, *, hint: str = "") -> InputError:
        """Creates an error with its location, if the line is known."""
        if source is None:
            return cls(message, hint=hint)
        return cls(message, hint=hint, file=source.file, line=source.line)

    def __str__(self) -> str:
        """Formats one line: "file:line: message; hint"; truncates a very long file name."""
        file = str(self.file) if len(str(self.file)) <= MOST_LETTERS else f"{str(self.file)[:FEW_LETTERS]}..."
        place = "" if self.file is None else f"{file}: " if self.line is None else f"{file}:{self.line}: "
        hint = self.hint if len(self.hint) <= MOST_LETTERS else f"{self.hint[:MOST_LETTERS]}..."
        return one_line(f"{place}{self.message}{'; ' if hint else ''}{hint}")

    def within(self, file: Path, line: int) -> InputError:
        """Adds the line in the file that refers to the erroneous file.

        An error without a location gets that line as its own; a long chain names only its first files.
        """
        others = [other.within(file, line) for other in self.others]
        if self.file is None:
            return InputError(self.message, hint=self.hint, file=file, line=line, others=others)
        if self.message.count(_USED_BY) >= _MOST_USERS:
            return self
        text = f"{self.message} ({_USED_BY} {file}:{line})"
        return InputError(text, hint=self.hint, file=self.file, line=self.line, others=others)


def one_line(text: str) -> str:
    """Joins a text to one line and escapes control characters, as in "\\x1b"."""
    line = " ".join(text.split())
    return line if line.isprintable() else "".join(one if one.isprintable() else ascii(one)[1:-1] for one in line)


_SHORTAGES: Final = {
    "the disk is full": (errno.ENOSPC, errno.EDQUOT, "SQLITE_FULL"),
    "a file may not grow further (ulimit -f)": (errno.EFBIG,),
    "too many files are open": (errno.EMFILE, errno.ENFILE),
    "there is too little memory": (errno.ENOMEM, MemoryError, "SQLITE_NOMEM"),
}


def shortage(error: BaseException | None) -> str | None:
    """Returns what this machine lacks, as in "the disk is full", if a lack of disk, files or memory caused an error."""
    for _ in range(_LONGEST_CHAIN if error else 0):
        marks = {
            isinstance(error, MemoryError) and MemoryError,
            getattr(error, "errno", None),
            getattr(error, "sqlite_errorname", None),
        }
        if found := [lack for lack, signs in _SHORTAGES.items() if marks.intersection(signs)]:
            return found[0]
        error = error and (error.__cause__ or error.__context__)
    return None


def shortage_of_files(count: int) -> str | None:
    """Returns what this machine lacks if `count` more files cannot be opened now."""
    try:
        SpareFiles(count).close()
    except OSError as error:
        return shortage(error)
    return None


class SpareFiles:
    """Open files that a program reserves for later; `close` frees them. Raises OSError if there are too few."""

    def __init__(self, count: int) -> None:
        self._files: list[int] = []
        try:
            while len(self._files) < count:
                self._files.append(os.open(os.devnull, os.O_RDONLY))
        except OSError:
            self.close()
            raise

    def close(self) -> None:
        """Frees the files; idempotent."""
        while self._files:
            os.close(self._files.pop())


class Problems:
    """Collects errors, so that a user sees all of them at once."""

    def __init__(self) -> None:
        self._errors: list[InputError] = []

    def __enter__(self) -> Problems:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, _trace: object) -> bool:
        """Adds an InputError and suppresses it; other errors propagate."""
        if isinstance(error, InputError):
            self.add(error)
            return True
        return False

    def add(self, error: InputError) -> None:
        """Adds an error and its `others`."""
        self._errors += [error, *error.others]

    def raise_any(self) -> None:
        """Raises the first error with the others, if there are any."""
        if self._errors:
            first, *others = self._errors
            raise InputError(first.message, hint=first.hint, file=first.file, line=first.line, others=others)


def nearest_name(word: str, known: Iterable[str]) -> str | None:
    """Returns the known word whose spelling is nearest to `word`; None when none is near."""
    from rapidfuzz import fuzz, process

    by_lower = {name.lower(): name for name in known}
    near = process.extractOne(word.lower(), by_lower.keys(), scorer=fuzz.ratio, score_cutoff=70.0)
    return by_lower[near[0]] if near else None


def suggestion(word: str, known: Iterable[str], otherwise: str | None = None, *, shown: Iterable[str] = ()) -> str:
    """Hint for an unknown word: the word that was probably meant, else `otherwise`, else the nearest known names.

    `shown` are the names to list when `known` also contains other spellings. The word itself is no hint.
    """
    names = [name for name in known if name != word]
    near = nearest_name(word, names)
    return f"did you mean '{near}'?" if near else otherwise or known_names(word, list(shown) or names)


def known_names(word: str, known: Iterable[str]) -> str:
    """Lists the known names if they are few, else those whose spelling is nearest to `word`."""
    from rapidfuzz import fuzz, process

    names = list(dict.fromkeys(known))
    if len(names) <= FEW:
        return f"known are {listing(names)}" if names else "none is known"
    near = process.extract(word.lower(), {name: name.lower() for name in names}, scorer=fuzz.WRatio, limit=NEAREST)
    return f"known are {', '.join(name for _, _, name in near)} and {len(names) - len(near)} more"


def short_list(words: Iterable[str]) -> str:
    """Lists the first words and counts the others: "a, b, c and 12 more (see docs/reference)"."""
    names = list(words)
    if len(names) <= MOST_LISTED:
        return listing(names)
    return f"{', '.join(names[:MOST_LISTED])} and {len(names) - MOST_LISTED} more (see docs/reference)"


def count_text(count: int, noun: str) -> str:
    """Formats a count with its noun: "1 door", "2 doors"."""
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"


def with_article(noun: str) -> str:
    """Noun with its indefinite article: "a hammer", "an extinguisher"."""
    return f"{'an' if _VOWEL.match(noun) else 'a'} {noun}"


def requote(reason: str, text: str) -> str:
    """Replaces each quotation in a reason by the part of the speaker's text that has its words in their order.

    Words that the speaker did not say are left out of a quotation that has others.
    """
    said = list(_SAID.finditer(text[:_MOST_QUOTED]))
    spoken = [match[0].lower() for match in said]

    def own(part: re.Match[str]) -> str:
        words = [] if part[1].lower() in text.lower() else _SAID.findall(part[1].lower())
        for first in range(len(said)) if words else ():
            last = first if spoken[first] == words[0] else -1
            for word in words[1:] if last >= 0 else ():
                near = range(last + 1, min(last + _APART, len(said)))
                last = next((at for at in near if spoken[at] == word), -1)
                if last < 0:
                    break
            if last >= 0:
                return f"'{text[said[first].start() : said[last].end()]}'"
        if reason[: part.start()].endswith(_HINTS):
            return part[0]
        runs = [_near(words[start:], spoken) for start in range(len(words))]
        best = max(runs, key=len, default=[])
        return f"'{text[said[best[0]].start() : said[best[-1]].end()]}'" if best else part[0]

    return _QUOTED.sub(own, reason)


def _near(words: Sequence[str], spoken: Sequence[str]) -> list[int]:
    """Indices of spoken words that are some words in their order, each near the one before."""
    found = list[int]()
    for word in words:
        ahead = range(found[-1] + 1, min(found[-1] + _APART + 2, len(spoken))) if found else range(len(spoken))
        found += [at for at in ahead if spoken[at] == word][:1]
    return found


_HINTS: Final = ("say ", "as in ", "begin ", "write ", "mean ", "known are ", "or ")
"""Words before what the speaker did not say."""
_QUOTED: Final = re.compile(r"(?<!\w)'((?:[^']|(?<=\w)'(?=\w))+)'(?!\w)")
_SAID: Final = re.compile(r"[\w'-]+")
_MOST_QUOTED: Final = 800
"""Number of characters of the text in which a quotation is looked for."""
_APART: Final = 5
"""Number of words between two words of a quotation, and one more."""


def definite(noun: str) -> str:
    """Noun with its definite article, if it needs one: "the hammer", "my mug"."""
    return noun if _DETERMINED.match(noun) else f"the {noun}"


_VOWEL: Final = re.compile(r"[aeio](?!ne\b)|u(?!ni|s[aeiu]|ti)|h(?:our|onest)", re.IGNORECASE)
_DETERMINED: Final = re.compile(r"(?:the|a|an|my|your|our|his|her|their|this|that)\b|[\w ]+'s\b", re.IGNORECASE)


def listing(words: Iterable[str], *, last: str = "and") -> str:
    """Lists words as a sentence does: "a, b and c"."""
    *head, tail = [*words] or ["nothing"]
    return f"{', '.join(head)} {last} {tail}" if head else tail
