"""The wake phrase: "Hey Alice", or the bare name set off by a comma, and who of several robots it calls.

A greeting right before the name calls at the beginning and at the end of a sentence, and after a pause; the bare name
calls at the beginning or the end, set off by a comma. A name in a story ("Hey, Alice told me ...", "my sister, Alice")
does not.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from typing import Final

from executive.language.lexicon import lexicon
from executive.language.spelling import sound_distance

__all__ = ["Address", "WakeResult", "addressed_to", "heard_wake", "strip_wake"]

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
    other = re.match(rf"\s*(?i:{_GREETING})\b[\s,]+([A-Z][\w'-]*)\s*,", text)
    bare = re.sub(rf"^\W*{re.escape(name)}\s+(?!{_TOLD_OF})(?=\w)", "", text, count=1, flags=re.IGNORECASE)
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


def _calls(text: str, name: str) -> Iterator[_Call]:
    own = rf"{re.escape(name)}\b"
    for match in re.finditer(rf"\b{_GREETING}\b(?:\s+there\b)?[\s,]*{own}(?!['’]\w)", text, re.IGNORECASE):
        if _greets(text[: match.start()], text[match.end() :]):
            yield _whole(match, text, name)
    first = re.match(rf"\W*(?:(?:{_POLITE})\b[\s,]*)?({own})(?=\s*[,.!:;-]+\s|\s+{_ASKS}|\W*$)", text, re.IGNORECASE)
    if first and _calls_bare(text[first.end() :]):
        yield _Call(name, first.start(1), first.end() + _pause(text[first.end() :]))
    last = re.search(rf",\s*{own}(?=\W*$)", text, re.IGNORECASE)
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
    if _matches(rf".*\b(?:{_SAYING})\b[\s\S]{{0,24}}", before) or _story(after):
        return False
    begins = not before.strip(" ,.!?;:-'\"") or before.rstrip().endswith((",", ".", "!", "?", ";", ":"))
    return begins or _matches(rf"\W*(?:{_POLITE})\W*", before) or not after.strip(" .!?,")


def _story(after: str) -> bool:
    """Whether what stands behind the name tells something of its bearer."""
    return _matches(rf"\s*(?:{_TOLD_OF})[\s\S]*", after) or _matches(r"\s*,?\s*(?:and|or)\s+[A-Z][\s\S]*", after, 0)


def _calls_bare(after: str) -> bool:
    """Whether the name at the beginning calls: no apposition, list or relative clause follows."""
    if _matches(rf"\s*,?\s*(?:{_RELATIVE}|and\b|or\b)[\s\S]*", after) or _story(after):
        return False
    apposition = rf"\s*,[^,]*,\s*(?:{_TOLD_OF})[\s\S]*"
    listed = r"\s*,\s*[A-Z]\w*\s*(?:,|and|or)\b[\s\S]*"
    return not (_matches(apposition, after) or _matches(listed, after, 0))


def _may_end_with_name(before: str) -> bool:
    """Whether a sentence that ends with ", NAME" is said to them: it neither tells of them nor lists them."""
    last = re.sub(r"\W+$", "", before).rpartition(" ")[2].lower()
    if last in lexicon().people or re.search(r",\s*[A-Z]\w*\s*$", before):
        return False
    return not _matches(rf"\W*(?:{_TELLS})\b[\s\S]*", before)


def _matches(pattern: str, text: str, flags: int = re.IGNORECASE) -> bool:
    return re.fullmatch(pattern, text, flags | re.DOTALL) is not None


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


_GREETING: Final = r"(?:hey|hi|ok|okay|hello)"
_HEARD_GREETINGS: Final = frozenset({"hey", "hay", "hei", "hi", "high", "ok", "okay", "hello", "he", "ay", "eh", "a"})
_HEARD_WORDS: Final = 6
_LATEST_GREETING: Final = 3
_POLITE: Final = r"please|oh|um|uh|er|so|well|right|now|and|but|listen|sorry|excuse me|thanks|thank you|good \w+"
_ASKS: Final = r"(?:please|(?:can|could|would|will)\s+you)\b"
_SAYING: Final = (
    r"say|says|said|saying|shout(?:s|ed)?|yell(?:s|ed)?|whisper(?:s|ed)?|answer(?:s|ed)|repl(?:ies|ied)|call(?:s|ed)|hear"
    r"|heard|sings?|sang|wrote|writes?|song|phrase|words?|named|titled|film|movie|book|episode"
)
_TOLD_OF: Final = (
    r"['’]s\b|(?:is|was)\b(?!\s+(?:there|the|a|an|my|any|anyone|it|this|that|everything)\b)"
    r"|(?:is|was)\s+(?:the|a|an|my|it)\s+(?:\w+\s+)?(?:of|who|friend|girl|boy|woman|man|person|one|robot|name|kind|very)\b"
    r"|(?:is|was)\s+(?:an?|the|my)\s+(?:\w+\s+)?\w+\W*$"
    r"|(?:can|could|will|would|should|might|may|must)\s+(?!you\b|i\b|we\b|u\b)\w+"
    r"|(?:has|had|does|did|told|said|says|asked|asks|likes|liked|loves|loved|wants|wanted|needs|needed|knows|knew|thinks"
    r"|thought|goes|went|comes|came|gets|got|gives|gave|takes|took|brings|brought|fetched|fetches|makes|made|lives|lived"
    r"|works|worked|looks|looked|seems|seemed|sees|saw|called|calls|sent|sends|bought|buys|left|leaves|keeps|kept|found"
    r"|finds|helps|helped|plays|played|writes|wrote|isn't|wasn't|doesn't|didn't|won't|can't|never|always|also|who|whose"
    r"|whom|which|in wonderland)\b"
)
_RELATIVE: Final = r"(?:who|whose|whom|which)\b"
_TELLS: Final = (
    r"this is|that is|that's|it is|it's|it was|this was|meet|he|she|they|his|her name|my name|the name"
    r"|i (?:am|was|went|met|saw|told|asked|know|knew|love|like|think|have|had|spoke|talked|gave|sent|called|live|work)"
    r"|i'm|i've|we (?:are|were|have|had|met|saw|went|know|love|like|asked|told|live|work)|have you|has|did|do you know"
    r"|who is|who's|there (?:is|was) (?:a|my) (?:girl|woman|person|friend)"
)
