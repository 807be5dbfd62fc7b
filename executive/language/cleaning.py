"""What is done to a sentence before it is parsed: plain characters, and plain commands for other ways of speaking."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass
from functools import cache, lru_cache
from typing import Final

from executive.language.lexicon import Patterns, lexicon, read_table
from executive.language.spelling import sound_distance
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


__all__ = ["Address", "WakeResult", "addressed_to", "heard_wake", "strip_wake"]

_FORMS: Final = Patterns("wake.yaml")
SAME_NAME: Final = 0.13
"""How far a misheard name may sound from the name, behind a greeting (see `sound_distance`)."""
SAME_NAME_ALONE: Final = 0.05
"""The same for a bare name."""


@dataclass(frozen=True)
class Address:
    """Who of the robots is called (None: nobody), and the sentence without the wake phrase."""

    name: str | None
    text: str


@dataclass(frozen=True)
class WakeResult:
    """The sentence without its wake phrase, whether that was there, and who else was called instead."""

    text: str
    addressed: bool
    other_name: str | None = None


def addressed_to(text: str, names: Collection[str]) -> Address:
    """Which of the robots called `names` a sentence is said to; the wake phrase that comes first counts."""
    calls = [call for name in names for call in _calls(text, name)]
    if not calls:
        return Address(None, text)
    first = min(calls, key=lambda call: (call.start, -call.end))
    return Address(first.name, first.rest(text))


def heard_wake(transcript: str, name: str, *, others: Collection[str] = ()) -> Address:
    """The same for what was heard, where the name may be misspelled ("Hey Ellis"): whether the robot `name` is called.

    `others` are the names of other robots: what sounds more like one of those is not for this one.
    """
    exact = addressed_to(transcript, (name, *others))
    if exact.name is not None:
        return exact if exact.name == name else Address(None, transcript)
    for corrected in _corrected(transcript, name, others):
        address = addressed_to(corrected, (name, *others))
        if address.name == name:
            return address
    return Address(None, transcript)


def strip_wake(text: str, name: str, others: Collection[str] = ()) -> WakeResult:
    """Take the wake phrase for the robot called `name` out of `text`, where it stands; `others` are other robots.

    A bare name at the beginning without a comma is taken out, too, but does not count as addressing.
    """
    address = addressed_to(text, (name, *others))
    if address.name is not None:
        own = address.name == name
        return WakeResult(address.text if own else text, addressed=own, other_name=None if own else address.name)
    other, bare = _FORMS.other.match(text), _forms(name).bare.sub("", text, count=1)
    return WakeResult(bare, addressed=False, other_name=other.group(1) if other else None)


@dataclass(frozen=True)
class _Call:
    """Where in a sentence a robot is called."""

    name: str
    start: int
    end: int

    def rest(self, text: str) -> str:
        """The sentence without the call."""
        return " ".join(f"{text[: self.start].rstrip()} {text[self.end :]}".split()).strip(" ,")


@lru_cache(maxsize=64)
def _forms(name: str) -> Patterns:
    """The ways of calling a robot of that name."""
    return _FORMS.filled(own=rf"{re.escape(name)}\b")


def _calls(text: str, name: str) -> Iterator[_Call]:
    forms = _forms(name)
    for match in forms.greets.finditer(text):
        if _greets(text[: match.start()], text[match.end() :]):
            yield _whole(match, text, name)
    first = forms.begins.match(text)
    if first and _calls_bare(text[first.end() :]):
        yield _Call(name, first.start("name"), first.end() + _pause(text[first.end() :]))
    last = forms.ends.search(text)
    if last and _may_end_with_name(text[: last.start()]):
        yield _whole(last, text, name)


def _whole(match: re.Match[str], text: str, name: str) -> _Call:
    return _Call(name, match.start(), match.end() + _pause(text[match.end() :]))


def _pause(after: str) -> int:
    """How many signs set the call off from what comes after it."""
    match = re.match(r"[\s,.!:;-]*", after)
    return match.end() if match else 0


def _greets(before: str, after: str) -> bool:
    """Whether a greeting with the name calls, and is not told of ("I said hi Alice", "hey, Alice is my friend")."""
    if _FORMS.says_before.fullmatch(before) or _story(after):
        return False
    begins = not before.strip(" ,.!?;:-'\"") or before.rstrip().endswith((",", ".", "!", "?", ";", ":"))
    return begins or _FORMS.politely.fullmatch(before) is not None or not after.strip(" .!?,")


def _story(after: str) -> bool:
    """Whether what stands behind the name tells something of its bearer."""
    return (_FORMS.story.fullmatch(after) or _FORMS.listed.fullmatch(after)) is not None


def _calls_bare(after: str) -> bool:
    """Whether the name at the beginning calls: no apposition, list or relative clause follows."""
    if _FORMS.relates.fullmatch(after) or _story(after):
        return False
    return not (_FORMS.apposition.fullmatch(after) or _FORMS.listed_bare.fullmatch(after))


def _may_end_with_name(before: str) -> bool:
    """Whether a sentence that ends with ", NAME" is said to them: it neither tells of them nor lists them."""
    last = re.sub(r"\W+$", "", before).rpartition(" ")[2].lower()
    if last in lexicon().people or re.search(r",\s*[A-Z]\w*\s*$", before):
        return False
    return _FORMS.tells_of.fullmatch(before) is None


def _corrected(transcript: str, name: str, others: Collection[str]) -> Iterator[str]:
    """The transcript with what sounds like the wake phrase, or the name, at its beginning written as that."""
    words = list(re.finditer(r"[^\W\d_][\w'’-]*", transcript))[:_HEARD_WORDS]
    for at, word in enumerate(words[:_LATEST_GREETING]):
        for count in (1, 2):
            behind = words[at + 1 : at + 1 + count]
            greets = word.group().lower() in _HEARD_GREETINGS and len(behind) == count
            if greets and _sounds_like(transcript[behind[0].start() : behind[-1].end()], name, others, SAME_NAME):
                yield f"{transcript[: word.start()]}Hey {name}{transcript[behind[-1].end() :]}"
        if sound_distance(word.group(), f"hey{name}") <= SAME_NAME and len(word.group()) > len(name):
            yield f"{transcript[: word.start()]}Hey {name}{transcript[word.end() :]}"
    if words and _sounds_like(words[0].group(), name, others, SAME_NAME_ALONE):
        yield f"{name}{transcript[words[0].end() :]}"


def _sounds_like(heard: str, name: str, others: Collection[str], limit: float) -> bool:
    distance = sound_distance(heard, name)
    return distance <= limit and all(distance < sound_distance(heard, other) for other in others)


_HEARD_GREETINGS: Final = frozenset({"hey", "hay", "hei", "hi", "high", "ok", "okay", "hello", "he", "ay", "eh", "a"})
_HEARD_WORDS: Final = 6
_LATEST_GREETING: Final = 3
