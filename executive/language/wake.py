"""The wake phrase: "Hey Alice", or the bare name set off by a comma, and who of several robots it calls.

A greeting right before the name calls at the beginning and at the end of a sentence, and after a pause; the bare name
calls at the beginning or the end, set off by a comma. A name in a story ("Hey, Alice told me ...", "my sister, Alice")
does not.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from functools import lru_cache
from typing import Final

from executive.language.lexicon import Patterns, lexicon
from executive.language.spelling import sound_distance

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
