"""Ways of speaking that mean a plain command: each rule is a pattern and what replaces it (`rephrasing.yaml`)."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from functools import cache
from typing import Final

from executive.language.lexicon import lexicon, read_table
from skills.detect.words import plural

__all__ = ["rephrased", "smoothed"]

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
