"""Ways of speaking that mean a plain command: each rule is a pattern and what stands in its place.

The rules are tried in their order, each on what the one before has left.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator
from functools import cache
from typing import Final

from executive.language.lexicon import lexicon

__all__ = ["rephrased"]

_Rule = tuple[re.Pattern[str], str | Callable[[re.Match[str]], str]]
_AT: Final = r"(?=in|on|at|under|next|by|near)"


def rephrased(text: str) -> str:
    """The sentence as a plain command, in single blanks: "could you please get it" becomes "get it".

    Hesitations and words said twice are left out. Where a polite form stands inside the sentence, a comma takes its
    place. "I would like something to drink" becomes "bring me a drink".
    """
    for pattern, instead in _rules():
        text = pattern.sub(instead, text)
    return " ".join(text.split()).strip(" ,;:-.")


@cache
def _rules() -> tuple[_Rule, ...]:
    steps = (_smoothed(), _plain(), _ordered(), _wished(), _opened())
    return tuple((re.compile(pattern, re.IGNORECASE), instead) for step in steps for pattern, instead in step)


_Written = Iterator[tuple[str, str | Callable[[re.Match[str]], str]]]


def _smoothed() -> _Written:
    """Full forms, no hesitations, and what was said twice ("the the", "take the take this") said once."""
    full = lexicon().short_forms
    yield rf"(?<![\w'])(?:{_any(full)})(?![\w'])", lambda match: full[match[0].lower()]
    yield r"\b((?:i|we|you) \w+) to (?=\1\b)", ""
    small = "the|a|an|my|this|that|it|them|in|on|to|into|from|at"
    yield rf"\b(\w+)(?: (?:{small})){{1,3}} (?=\1 (?:{small})\b)", ""
    yield (
        (
            r"\b(?:when|once|whenever|as soon as) you(?:'re| are)(?: not)? "
            r"(?:free|ready|done|finished|available|busy|back|at it)\b,?"
        ),
        "",
    )
    yield (
        (
            r"\b(?:if|when|whenever|once|as soon as) you(?:'ve)? (?:have|get|got|find|can spare)? ?"
            r"(?:a|an|the|some|any)? ?"
            r"(?:free |spare )?(?:minute|second|moment|sec|time|chance|opportunity)\b,?"
        ),
        "",
    )
    yield (
        (
            r"\b(?:i'd|i would|it would|it'd|that would|that'd|i'm|i am|we'd|we would|would)\s+(?:\w+\s+){1,4}"
            r"(?:if|when) you\b(?:\s+(?:could|can|would|might))?"
        ),
        "please",
    )
    yield rf"(?<!\bi )(?<!d )\blike,?\s+(?=(?:{_any(_verbs())})\b)", ""
    around = (*lexicon().asides, *lexicon().hesitations)
    yield rf"(?<![\w'])(?<!\d )(?<!\bdo )(?:{_any(around)})(?![\w'])[,.\s]*", " "
    yield r"\s+", " "
    yield r"\b(?!her her\b)([\w']+(?:\s[\w']+){0,2})(?:[\s,]+\1\b)+", r"\1"


def _plain() -> _Written:
    """Without praise, titles of tasks and names of endearment; what is told of a place in short."""
    praise = rf"(?:(?:almost|nearly|all|very|so|really)\s+)?(?:{_any(lexicon().praises)})"
    behind = r"(?=\s*[,.!;]|\s+(?:now|then|next|so|please)\b)\W*"
    yield r"^\W*(?:(?:right|okay|ok|alright|so|well|now|yeah|yes)\b[\s,]+)+(?=\w)", ""
    yield rf",\s*(?:wait|hold on),?\s+(?=(?:{_any(_verbs())})\b)", ", no, "
    yield rf"(?:^|(?<=[,.!?;])\s*)\W*{praise}(?:[\s,]+{praise})*{behind}", ""
    yield (
        (
            r"^\W*(?:so )?(?:the|your|our|my)\s+(?:(?:last|next|first|other|only)\s+)?"
            r"(?:thing|one|item|step|task|job)\b[^,.]{0,30}?\bis(?: to)?\s+(?!in\b|on\b|at\b|not\b)"
        ),
        "",
    )
    yield r"^\W*(?:and |now |so )*(?:the )?(?:last|next|first|final) (?:thing|one|step|task),", ""
    yield r"(?:,|\bplease\b)\s*(?:mate|buddy|pal|dude|love|dear|darling|sweetie|honey|bro)\W*$", ""
    yield r"^\W*(?:mate|buddy|pal|dude|bro),", ""
    yield rf"\b(?:which|that)\s+you(?:'ll| will| can| should)?\s+find\s+{_AT}", "that is "
    yield r"\b(?:to )?where (?:i am|we are|i'm|we're|you (?:started|were|came|began)(?: from)?)\b", "here"
    yield (
        (
            r"\b(?:do you (?:happen to )?know|tell me|show me|i wonder|i need to know|i want to know|any idea)\s+"
            r"(?=where\b)"
        ),
        "",
    )
    yield rf"\byou(?:'ll| will| can| should| may| could)?\s+find\s+(it|them)\s+{_AT}", _are
    yield r"\b(from|in|on|to|at|into) like (?=(?:the|a|an|my|that|this)\b)", r"\1 "


def _ordered() -> _Written:
    """What is to be done first stands first; "while you're in the hall" is a place, "you go" is "go"."""
    first_then = r"\g<first>, then \g<then>"
    yield r"^(?P<then>.*?),?\s+but (?:first|before that),?\s+(?P<first>.*)$", first_then
    yield r"^before (?:you )?(?P<then>.*?), (?P<first>.*)$", first_then
    later = r"(?P<then>(?:go|going|leave|leaving|return|returning)\b.*)"
    yield rf"^(?P<first>.*),? before (?:you )?{later}$", first_then
    yield r"\b(?:while|when|as|since|if|once) you(?:'re| are)(?=\s+(?:in|at|on|near|by)\s+the\b)", ""
    yield r"^\W*(?:how|what) about\s+(?=\w+ing\b)", ""
    yield r"^\W*(?:do you |would you |you )?(?:want|like|care) to\s+", ""
    yield r"^\W*mind\s+(?=\w+ing\b)|\bbe\s+(?:an?\s+)?(?:(?:so|as)\s+)?\w+\s+and\s+(?=\w)", ""
    yield rf"(^\W*|[,.;]\s*|\b(?:please|and|then|now)\s+)you\s+(?=(?:{_any(_verbs())})\b)", r"\1"


def _wished() -> _Written:
    """Wishes and searches as commands: "two beers please", "I would like a tea", "I'm looking for my pen"."""
    yield r"^\W*(?:a|an|one|two|three|four|five|six|some|another|\d{1,2})\s+\w+.*\bplease\W*$", _bring
    said = r"please|alright|ok|okay|hey|hi|hello|so|now|well|yes|right"
    yield rf"^\W*((?:(?:{said})\b[\s,]*)*)robot\b[\s,]*", r"\1"
    behind = r"\s+(?!(?:you|to|that (?:you|the|a|my|this)|if|whether|what|who|how|where)\b)"
    yield rf"\b(?:{_any(lexicon().refusals)}){behind}", ", do not bring "
    yield rf"\b(?:{_any(lexicon().searches)}){behind}", ", find "
    yield rf"\b(?:{_any(lexicon().requests)}){behind}", ", bring me "
    yield r"\b(?:something|anything) to drink\b", "a drink"
    yield r"\b(?:something|anything) to eat\b", "food"


def _opened() -> _Written:
    """Polite forms leave a comma; so does a "to" behind them where none belongs ("could you to bring it")."""
    infinitive = rf"(?:to\s+(?=(?:{_any(_verbs())})\b))?"
    yield rf"(?:(?:\b(?:{_any(lexicon().openers)}))\b[\s,]*)+{infinitive}", _break


def _verbs() -> Iterator[str]:
    return (first for first, *rest in lexicon().verbs if not rest)


def _any(phrases: Iterable[str]) -> str:
    return "|".join(map(re.escape, phrases))


def _are(match: re.Match[str]) -> str:
    return "they are " if match[1].lower() == "them" else "it is "


def _bring(match: re.Match[str]) -> str:
    """A bare wish with "please"; it may say for whom."""
    whom = re.search(r"\b(?:for|to)\b", match[0], re.IGNORECASE)
    return f"bring {match[0]}" if whom else f"bring me {match[0]}"


def _break(match: re.Match[str]) -> str:
    """What stands in an opener's place: a comma, unless there is one or the sentence ends."""
    return ", " if match.string[: match.start()].strip() and match.string[match.end() :].strip(" .!?") else " "
