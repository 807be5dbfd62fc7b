"""Cleaning of what was typed or heard, before it is parsed."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterator, Sequence
from functools import cache
from typing import Final

from executive.language.lexicon import lexicon

__all__ = ["MAX_CHARACTERS", "MAX_WORDS", "clean", "open_commands"]

MAX_WORDS: Final = 60
MAX_CHARACTERS: Final = 800
_APART: Final = re.compile(r" ((?:n't|'(?:m|s|d|re|ve|ll))\b)", re.IGNORECASE)
_SOMETHING: Final = {r"\b(?:something|anything) to drink\b": "a drink", r"\b(?:something|anything) to eat\b": "food"}
_RESTART: Final = re.compile(
    r"\b((?:i|we|you) \w+) to (?=\1\b)|\b(\w+) (?:the|a|an|my|this|that) (?=\2 (?:the|a|an|my|this|that|it)\b)",
    re.IGNORECASE,
)
_LEISURE: Final = re.compile(
    r"\b(?:if|when|whenever|once|as soon as) you(?:'ve)? (?:have|get|got|find|can spare)? ?(?:a|an|the|some|any)? ?"
    r"(?:free |spare )?(?:minute|second|moment|sec|time|chance|opportunity)\b,?",
    re.IGNORECASE,
)
_FAVOUR: Final = re.compile(
    r"\b(?:i'd|i would|it would|it'd|that would|that'd|i'm|i am|we'd|we would|would)\s+(?:\w+\s+){1,4}(?:if|when) you\b"
    r"(?:\s+(?:could|can|would|might))?",
    re.IGNORECASE,
)
_WHILE: Final = re.compile(
    r"\b(?:while|when|as|since|if|once) you(?:'re| are)(?=\s+(?:in|at|on|near|by)\s+the\b)", re.IGNORECASE
)
_KNOWN: Final = re.compile(
    r"\b(?:do you (?:happen to )?know|tell me|show me|i wonder|i need to know|i want to know|any idea)\s+(?=where\b)",
    re.IGNORECASE,
)
_RELATIVE: Final = re.compile(
    r"\b(?:which|that)\s+you(?:'ll| will| can| should)?\s+find\s+(?=in|on|at|under|next|by|near)", re.IGNORECASE
)
_BACK: Final = re.compile(
    r"\b(?:to )?where (?:i am|we are|i'm|we're|you (?:started|were|came|began)(?: from)?)\b", re.IGNORECASE
)
_TASK: Final = re.compile(
    r"^\W*(?:so )?(?:the|your|our|my)\s+(?:(?:last|next|first|other|only)\s+)?(?:thing|one|item|step|task|job)\b"
    r"[^,.]{0,30}?\bis(?: to)?\s+(?!in\b|on\b|at\b|not\b)",
    re.IGNORECASE,
)
_CALLED: Final = re.compile(
    r"(?:,|\bplease\b)\s*(?:mate|buddy|pal|dude|love|dear|darling|sweetie|honey|bro)\W*$|^\W*(?:mate|buddy|pal|dude|bro),",
    re.IGNORECASE,
)
_FOUND: Final = re.compile(
    r"\byou(?:'ll| will| can| should| may| could)?\s+find\s+(it|them)\s+(?=in|on|at|under|next|by|near)", re.IGNORECASE
)
_LIKE: Final = re.compile(r"\b(from|in|on|to|at|into) like (?=(?:the|a|an|my|that|this)\b)", re.IGNORECASE)
_ORDERS: Final = (
    re.compile(r"^(?P<then>.*?),?\s+but (?:first|before that),?\s+(?P<first>.*)$", re.IGNORECASE),
    re.compile(r"^before (?:you )?(?P<then>.*?), (?P<first>.*)$", re.IGNORECASE),
    re.compile(
        r"^(?P<first>.*),? before (?:you )?(?P<then>(?:go|going|leave|leaving|return|returning)\b.*)$", re.IGNORECASE
    ),
)
_MIND: Final = re.compile(
    r"^\W*mind\s+(?=\w+ing\b)|\bbe\s+(?:an?\s+)?(?:(?:so|as)\s+)?\w+\s+and\s+(?=\w)", re.IGNORECASE
)
_TOLD_TO: Final = re.compile(r"(^\W*|[,.;]\s*|\b(?:please|and|then|now)\s+)you\s+(?=(\w+)\b)", re.IGNORECASE)
_WISH: Final = re.compile(
    r"^\W*(?:a|an|one|two|three|four|five|six|some|another|\d{1,2})\s+\w+.*\bplease\W*$", re.IGNORECASE
)
_ALLOWED: Final = re.compile(r"[^\w\s,.;:!?'\-]|_")


def clean(text: str) -> str:
    """The sentence in plain characters: no control characters, brackets or pictures, and single blanks.

    Quotes become plain, and short forms stand in one piece ("i 'm" becomes "i'm").
    """
    plain = unicodedata.normalize("NFKC", text).replace("\u2019", "'").replace("\u2018", "'").replace("...", ",")
    printable = "".join(" " if unicodedata.category(c).startswith(("C", "S", "Z")) else c for c in plain)
    spaced = " ".join(_ALLOWED.sub(" ", printable).split())
    return _APART.sub(r"\1", spaced)


def open_commands(text: str) -> str:
    """Turn polite forms into plain commands: "could you please get it" becomes "get it".

    Hesitations and words said twice are left out. Where a polite form stands inside the sentence, a comma takes its
    place. "I would like something to drink" becomes "bring me a drink".
    """
    text = _wished(_plainly(_said_once(text)))
    text = re.sub(
        r"^\W*((?:(?:please|alright|ok|okay|hey|hi|hello|so|now|well|yes|right)\b[\s,]*)*)robot\b[\s,]*",
        r"\1",
        text,
        flags=re.IGNORECASE,
    )
    for words, command in _wishes():
        text = re.sub(
            rf"\b(?:{_any(words)})\s+(?!(?:you|to|that you|if|whether|what|who|how|where)\b)",
            f", {command} ",
            text,
            flags=re.IGNORECASE,
        )
    for something, thing in _SOMETHING.items():
        text = re.sub(something, thing, text, flags=re.IGNORECASE)
    text = re.sub(
        rf"(?:(?:\b(?:{_any(lexicon().openers)}))\b[\s,]*)+{_infinitive()}", _break, text, flags=re.IGNORECASE
    )
    return " ".join(text.split()).strip(" ,;:-.")


def _plainly(text: str) -> str:
    """The text without praise for what was done before, and with "you go to the hall" as "go to the hall"."""
    praise = rf"(?:(?:almost|nearly|all|very|so|really)\s+)?(?:{_any(lexicon().praises)})"
    praised = rf"(?:^|(?<=[,.!?;])\s*)\W*{praise}(?=\s*[,.!;]|\s+(?:now|then|next|so|please)\b)\W*"
    text = re.sub(praised, "", text, flags=re.IGNORECASE)
    text = _CALLED.sub("", _TASK.sub("", text))
    text = _BACK.sub("here", _RELATIVE.sub("that is ", text))
    text = _LIKE.sub(r"\1 ", _FOUND.sub(_are, _KNOWN.sub("", text)))
    for order in _ORDERS:
        text = order.sub(r"\g<first>, then \g<then>", text)
    text = _MIND.sub("", _WHILE.sub("", text))
    return _TOLD_TO.sub(lambda m: m[1] if (m[2].lower(),) in lexicon().verbs else m[0], text)


def _are(match: re.Match[str]) -> str:
    return "they are " if match[1].lower() == "them" else "it is "


def _wishes() -> Iterator[tuple[Sequence[str], str]]:
    """The ways to say what one wants, does not want or looks for, with the command that each means."""
    yield lexicon().refusals, "do not bring"
    yield lexicon().searches, "find"
    yield lexicon().requests, "bring me"


def _said_once(text: str) -> str:
    """The text in full forms, without hesitations, and with what was said twice ("the the") said once."""
    full = lexicon().short_forms
    text = re.sub(
        rf"(?<![\w'])(?:{_any(list(full))})(?![\w'])", lambda m: full[m[0].lower()], text, flags=re.IGNORECASE
    )
    text = _RESTART.sub("", text)
    text = _FAVOUR.sub("please", _LEISURE.sub("", text))
    verbs = [" ".join(words) for words in lexicon().verbs if len(words) == 1]
    text = re.sub(rf"(?<!\bi )(?<!d )\blike,?\s+(?=(?:{_any(verbs)})\b)", "", text, flags=re.IGNORECASE)
    asides = (*lexicon().asides, *lexicon().hesitations)
    text = re.sub(rf"(?<![\w'])(?<!\d )(?:{_any(asides)})(?![\w'])[,.\s]*", " ", text, flags=re.IGNORECASE)
    return re.sub(
        r"\b(?!her her\b)(\w+(?:\s\w+){0,2})(?:[\s,]+\1\b)+", r"\1", " ".join(text.split()), flags=re.IGNORECASE
    )


@cache
def _infinitive() -> str:
    """A "to" that may stand before a verb where none belongs ("could you to bring it")."""
    return rf"(?:to\s+(?=(?:{_any([w for (w, *rest) in lexicon().verbs if not rest])})\b))?"


def _wished(text: str) -> str:
    """A bare wish with "please" as a request: "two beers please"."""
    if not _WISH.match(text):
        return text
    return f"bring {text}" if re.search(r"\b(?:for|to)\b", text, re.IGNORECASE) else f"bring me {text}"


def _any(phrases: Sequence[str]) -> str:
    return "|".join(map(re.escape, phrases))


def _break(match: re.Match[str]) -> str:
    """What stands in an opener's place: a comma, unless there is one or the sentence ends."""
    return ", " if match.string[: match.start()].strip() and match.string[match.end() :].strip(" .!?") else " "
