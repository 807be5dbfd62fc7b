"""What is done to a sentence before it is parsed: plain characters, and plain commands for other ways of speaking."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Callable, Mapping
from functools import cache
from typing import Final

from executive.language.lexicon import lexicon, read_table
from skills.detect.words import plural

__all__ = ["MAX_CHARACTERS", "MAX_WORDS", "clean", "foreign_reason", "placeholder", "rephrased", "smoothed"]

_Rule = tuple[re.Pattern[str], str | Callable[[re.Match[str]], str]]
_SMOOTHED: Final = "smoothed"
_TABLES: Final = tuple("short_forms asides hesitations praises refusals searches requests counting openers".split())  # noqa: SIM905


def rephrased(text: str) -> str:
    """The sentence as a plain command, in single blanks: "could you please get it" becomes "get it".

    Hesitations and words said twice are left out. Where a polite form stands inside the sentence, a comma takes its
    place. "I would like something to drink" becomes "bring me a drink".
    """
    for pattern, instead in _rules():
        text = pattern.sub(instead, text)
    return " ".join(text.split()).strip(" ,;:-.")


def smoothed(text: str) -> str:
    """The sentence in full forms, without hesitations, asides and words said twice; else as it was spoken."""
    for pattern, instead in _rules(_SMOOTHED):
        text = pattern.sub(instead, text)
    text = re.sub(r"\b([ap])\.\s?m\.?(?![\w'])", r"\1m", text, flags=re.IGNORECASE)
    return " ".join(text.split()).strip(" ,;:-.")


@cache
def _rules(family: str | None = None) -> tuple[_Rule, ...]:
    tables = {f"<{name}>": getattr(lexicon(), name) for name in _TABLES}
    tables["<verbs>"] = [first for first, *rest in lexicon().verbs if not rest]
    phrases = {mark: "|".join(map(re.escape, table)) for mark, table in tables.items()}
    filled = re.compile("|".join(phrases))
    return tuple(
        (
            re.compile(filled.sub(lambda mark: phrases[mark[0]], pattern), re.IGNORECASE),
            _FUNCTIONS.get(instead, instead),
        )
        for name, rules in read_table("rephrasing.yaml").items()
        if family in (None, name)
        for pattern, instead in rules
    )


def _full(match: re.Match[str]) -> str:
    return lexicon().short_forms[match[0].lower()]


def _are(match: re.Match[str]) -> str:
    return "they are " if match[1].lower() == "them" else "it is "


def _bring(match: re.Match[str]) -> str:
    """A bare wish with "please"; it may say for whom."""
    whom = re.search(r"\b(?:for|to)\b", match[0], re.IGNORECASE)
    return f"bring {match[0]}" if whom else f"bring me {match[0]}"


def _all(match: re.Match[str]) -> str:
    """Each of a kind, one after the other, is all of that kind."""
    what = match["what"].strip()
    return f"{match['act']} all the {what if what.endswith('s') and not what.endswith('ss') else plural(what)} "


def _break(match: re.Match[str]) -> str:
    """What stands in an opener's place: a comma, unless there is one or the sentence ends."""
    return ", " if match.string[: match.start()].strip() and match.string[match.end() :].strip(" .!?") else " "


_FUNCTIONS: Final[Mapping[str, Callable[[re.Match[str]], str]]] = {
    "$full": _full,
    "$are": _are,
    "$bring": _bring,
    "$all": _all,
    "$break": _break,
}


MAX_WORDS: Final = 60
MAX_CHARACTERS: Final = 800
_APART: Final = re.compile(r" ((?:n't|'(?:m|s|d|re|ve|ll))\b)", re.IGNORECASE)
_ALLOWED: Final = re.compile(r"[^\w\s,.;:!?'\-]|_")
_AND: Final = re.compile(r"(?<=\s)[&+](?=\s)")
_PERCENT: Final = re.compile(r"(?<=\d)\s?%")
_SIGNS: Final = r"$€£%#@&+=|\\/^~_{}<>\[\]"
_PLACEHOLDER: Final = re.compile(
    rf"\$?(?:(?<!\{{)\{{++[^{{}}]*+\}}+|<[^<>]*+>|\[[^\[\]]*+\])|(?<!\S)[^\s{_SIGNS}]*+[{_SIGNS}]\S*"
)  # possessive, so that the time grows with the length of a sentence and not with its square


def clean(text: str) -> str:
    """The sentence in plain characters: no control characters, brackets or pictures, and single blanks.

    Quotes become plain, and short forms stand in one piece ("i 'm" becomes "i'm").
    """
    plain = unicodedata.normalize("NFKC", _PERCENT.sub(" percent", _AND.sub("and", text)))
    plain = plain.replace("\u2019", "'").replace("\u2018", "'").replace("...", ",")
    printable = "".join(" " if unicodedata.category(c).startswith(("C", "S", "Z")) else c for c in plain)
    spaced = " ".join(_ALLOWED.sub(" ", printable).split())
    return _APART.sub(r"\1", spaced)


def placeholder(text: str) -> str | None:
    """The first piece that stands for a word which is not filled in ("${room}", "[object]", "ROOM_NAME"), or another
    piece with a sign that is no part of a sentence; None when there is none."""
    found = _PLACEHOLDER.search(_PERCENT.sub(" percent", _AND.sub("and", text)))
    return None if found is None else found[0]


_SHARE: Final = 0.4
_FEWEST: Final = 2
_MOST_LETTERS: Final = 2000


def foreign_reason(text: str) -> str | None:
    """One line when the letters are of another script, or the small words of another language; None else."""
    letters = [c for c in text[:_MOST_LETTERS] if c.isalpha()]
    if letters and 2 * sum("LATIN" in unicodedata.name(c, "") for c in letters) < len(letters):
        return "I understand English only, in Latin letters"
    words = re.findall(r"[^\W\d_]+(?:'[^\W\d_]+)?", text[:_MOST_LETTERS].lower())
    counts = {language: sum(word in small for word in words) for language, small in _small_words().items()}
    language, most = max(counts.items(), key=lambda item: item[1])
    if most < _FEWEST or most < _SHARE * len(words):
        return None
    return f"I understand English only, and this looks like {language}"


@cache
def _small_words() -> Mapping[str, frozenset[str]]:
    return {language: frozenset(words) for language, words in read_table("foreign.yaml").items()}
