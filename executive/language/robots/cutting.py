"""Cuts a sentence into what is said to, or of, each robot: "Alice, go to the hall and let Bob bring a coke"."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache, cached_property
from typing import Final

from executive.language.questions import RefusalError
from executive.language.robots.calls import GREETING, VERBS, Calls, Whom, calls_of, imperative
from executive.language.wake import addressed_to

__all__ = ["Cut", "Piece", "Who", "cut_by_robot", "narrates"]

Who = tuple[str, ...] | Whom
"""Robots by their names, or all of them, or any."""


@dataclass(frozen=True)
class Piece:
    """What one robot, or several, are to do: `who` is None where nobody was named.

    `then` says that it comes after the piece before it; `behind` names the robots whose pieces before it have to be
    done first. `otherwise` says that it hangs on the condition of the piece before it. `deed` says that `text` tells
    what the robot has done by then, which is what it is to do.
    """

    who: Who | None
    text: str
    then: bool = False
    behind: Who | None = None
    otherwise: bool = False
    deed: bool = False


@dataclass(frozen=True)
class Cut:
    """The pieces of a sentence, and the robot or robots that it is said to first."""

    pieces: tuple[Piece, ...]
    listener: Who | None = None


@dataclass(frozen=True)
class _Found:
    """A place where another robot's part begins: from `start` on, with its text behind `end`."""

    who: str
    end: int
    kind: str
    lead: str = ""


def cut_by_robot(text: str, names: tuple[str, ...]) -> Cut:
    """The pieces of a sentence. Raises RefusalError: it is not clear which robots are meant."""
    return _Cutter(calls_of(names), _patterns(names)).cut(text)


def narrates(text: str, names: tuple[str, ...]) -> bool:
    """Whether all that a text says of robots is how they are: "Bob can't reach the shelf"."""
    told = re.sub(rf"\b{calls_of(names).one}\s+{_HOW_THEY_ARE}", "", text, flags=re.IGNORECASE)
    return re.search(rf"\b{calls_of(names).one}", told, re.IGNORECASE) is None


@cache
def _patterns(names: tuple[str, ...]) -> _Patterns:
    return _Patterns(calls_of(names))


@dataclass(frozen=True)
class _Patterns:
    """How a robot is given something to do, by the names of the ways."""

    calls: Calls

    @cached_property
    def begins(self) -> tuple[tuple[str, re.Pattern[str]], ...]:
        """What begins another robot's part, in the order of trying."""
        who, called = rf"(?P<who>{self.calls.who})", rf"(?P<who>{self.calls.called})"
        you = rf"(?P<who>{self.calls.who}|you|yourself)"
        ways = {
            "not": rf"(?:(?:do not|don't|never) (?:let|have|make|send|tell|ask) |neither |not ){who}"
            rf"|{who}\s+(?:{_BARE_MODAL}\s+(?:not|never)|{_MODAL_NOT}|(?:can|could) not)\b(?!\s+reach)",
            "or": rf"(?:either )?{who}\s*,?\s*or\s+(?:{self.calls.one})",
            "after": rf"(?:when|once|as soon as|after)\s+{_WHOEVER.format(self.calls.who)}\s*{_IS_DONE}",
            "wait": rf"(?:wait|pause) (?:for {who}(?: to {_DONE})?|(?:until|till) "
            rf"{_WHOEVER_ELSE.format(self.calls.who)}\s*{_IS_DONE})\s*(?:and\b|then\b|before you|,|\.)*",
            "deed": rf"(?:when|once|as soon as|after)\s+{who}\s+(?P<has>(?:has|have)\s+)?(?=[a-z]+)",
            "whether": rf"{_POLITE}ask {who} (?:if|whether) (?:he|she|it|they) (?:can|could|would|will|may)\s+",
            "check": rf"{_POLITE}ask {who} (?=(?:if|whether)\b)",
            "told": rf"{_POLITE}(?:tell|inform) {who} (?:that )?(?:he|she|it|they) {_MODAL}\s+",
            "to": rf"{_POLITE}{_HAVING_DONE} {who}\s*,?\s+to (?:please )?(?={_VERBISH})(?!{_DETERMINER})",
            "wish": rf"(?:i|we)(?:'d| would)?\s+(?:want|need|like|love|prefer) {who} to\s+",
            "let": rf"{_POLITE}(?:let|have|make) {who} (?:please |also |then |now )*(?={_VERBISH})(?!{_DETERMINER})",
            "send": rf"{_POLITE}send {who}\s+(?=(?:over |back |in)?to\b|back\b|home\b|here\b|there\b|upstairs\b)",
            "should": rf"{you}\s+{_MODAL}\s+{_SMALL}",
            "can": rf"(?:can|could|will|would|should|shall|may) {who}\s+{_SMALL}(?={_VERBISH})",
            "call": rf"(?:{GREETING}[\s,]*{called}\s*[,:!.-]*\s+|{called}\s*[,:!-]+\s*|{called}\s+(?={_ASKS}))"
            rf"(?={_ASKS}|{VERBS}|{_REQUESTS})",
            "does": rf"{you}\s+{_SMALL}(?={VERBS})",
        }
        return tuple((way, re.compile(_numbered(pattern), re.IGNORECASE)) for way, pattern in ways.items())

    @cached_property
    def gap(self) -> re.Pattern[str]:
        """A name with a place or thing, where the verb is that of the one before: "and Bob to the office"."""
        return re.compile(
            rf"(?P<who>{self.calls.one})\s+(?=(?:to|into|in|at|on|from|a|an|the|two|some)\b)", re.IGNORECASE
        )

    @cached_property
    def called_back(self) -> re.Pattern[str]:
        """A name behind what its bearer is to do: ", Alice, and"."""
        return re.compile(
            rf"\s*,\s*(?P<who>{self.calls.called})\s*(?P<mark>,\s*(?=(?:and|then|but|while)\b)|[.!?;])", re.IGNORECASE
        )

    @cached_property
    def first(self) -> re.Pattern[str]:
        """Several robots that are called at the beginning."""
        greets = rf"(?:{_BEFORE_CALL}[\s,]*)?{GREETING}[\s,]*(?P<who>{self.calls.called_together})\W*"
        bare = rf"(?:{_BEFORE_CALL}[\s,]*)?(?P<who>{self.calls.called_together})(?:\s*[,:!.-]+\s*|\s+(?={_ASKS}))"
        return re.compile(_numbered(rf"\W*(?:{greets}|{bare})"), re.IGNORECASE)

    @cached_property
    def last(self) -> re.Pattern[str]:
        """Several robots that are called at the end."""
        return re.compile(rf"\s*,\s*(?:{GREETING}[\s,]*)?(?P<who>{self.calls.called_together})\W*$", re.IGNORECASE)


def _numbered(pattern: str) -> str:
    """The pattern with each group "who" under a name of its own."""
    for number in range(pattern.count("(?P<who>")):
        pattern = pattern.replace("(?P<who>", f"(?P<who{number}>", 1)
    return pattern


@dataclass
class _Cutter:
    """Cuts one sentence."""

    calls: Calls
    patterns: _Patterns
    pieces: list[Piece] = field(default_factory=list)
    address: Who | None = None

    def cut(self, text: str) -> Cut:
        """The pieces of the sentence."""
        listener, text = self._called(text)
        self.address, self.pieces, at = listener, [Piece(listener, "")], 0
        for start in _clause_starts(text):
            if start < at:
                continue
            if (found := self._begins(text, start, at)) is not None:
                listener = listener or (self.calls.meant(found.who) if found.kind == "call" else None)
                self._take(found, text[at:start])
                at = found.end
            elif self.pieces[-1].deed and text[:start].rstrip().endswith(","):
                self._add(text[at:start])
                self.pieces.append(Piece(self.address, "", then=True))
                at = start
        self._add(text[at:])
        if len(self.pieces) > 1 and not _says(self.pieces[-1]) and self.pieces[-1].behind is not None:
            behind = self.pieces.pop().behind
            self.pieces[-1] = replace(self.pieces[-1], behind=behind)
        return Cut(tuple(_sentences(self.pieces, self.address)), listener)

    def _take(self, found: _Found, before: str) -> None:
        """End the piece that `before` belongs to, and begin the one that was found."""
        said, joint = _split_joint(before)
        if found.kind in _WAITS:
            self._add(said)
            now = self.pieces[-1].who
            who = now if found.kind == "wait" or self.address is None else self.address
            self.pieces.append(Piece(who, "", behind=self._behind(found)))
            return
        who = self._who(found)
        said, opener = (said, "") if found.kind == "deed" else _split_opener(said)
        self._add(said)
        last = self.pieces[-1]
        begun = Piece(
            who,
            f"{opener}, {found.lead}" if opener else found.lead,
            then=last.deed or re.search(_THEN, joint, re.IGNORECASE) is not None or (last.then and not last.text),
            behind=None if last.text else last.behind,
            otherwise=re.search(_OTHERWISE, joint, re.IGNORECASE) is not None,
            deed=found.kind == "deed",
        )
        self.pieces.append(begun)
        self.address = who if found.kind == "call" else self.address

    def _add(self, more: str) -> None:
        """Add to the text of the last piece."""
        last = self.pieces[-1]
        self.pieces[-1] = replace(last, text=_tidy(f"{last.text}{more}"))

    def _called(self, text: str) -> tuple[Who | None, str]:
        """Who the sentence is said to, and the rest of it."""
        if (match := self.patterns.first.match(text)) is not None:
            return self.calls.meant(_who(match)), text[match.end() :]
        if (match := self.patterns.last.search(text)) is not None and not _lists(text[: match.start()]):
            return self.calls.meant(_who(match)), text[: match.start()]
        address = addressed_to(text, self.calls.names)
        if address.name is not None:
            return (address.name,), address.text
        if (match := self.patterns.called_back.search(text)) is not None:
            return self.calls.meant(_who(match)), f"{text[: match.start()]}{match['mark']}{text[match.end() :]}"
        return None, text

    def _begins(self, text: str, start: int, at: int) -> _Found | None:
        """The part of another robot that begins here. Raises RefusalError: it is said what a robot is not to do."""
        current = self.pieces[-1]
        for kind, pattern in self.patterns.begins:
            match = pattern.match(text, start)
            if match is None or (_who(match).lower() in _YOU and (current.who is None or not start)):
                continue
            if kind in _REFUSED:
                raise RefusalError(f"{_REFUSED[kind]}: '{match[0].strip()}'", [match[0].strip()])
            return _Found(_who(match), match.end(), kind, _LEADS.get(kind, ""))
        match = self.patterns.gap.match(text, start)
        if match is None or current.who is None or not text[:start].strip():
            return None
        verb = re.match(
            rf"\W*({VERBS}(?: me| us)?)", imperative(_tidy(f"{current.text}{text[at:start]}")), re.IGNORECASE
        )
        return None if verb is None else _Found(match["who"], match.end(), "gap", f"{verb[1]} ")

    def _who(self, found: _Found) -> Who:
        """Who is meant by a name, "you" or "the other robot"."""
        named = [name for piece in self.pieces if isinstance(piece.who, tuple) for name in piece.who]
        if found.who.lower() in _YOU:
            return self.calls.meant("the other robot", named) if self.address is None else self.address
        return self.calls.meant(found.who, self.address if isinstance(self.address, tuple) else named[-1:])

    def _behind(self, found: _Found) -> Who:
        """Whose pieces are to be done before."""
        if found.who.lower() not in _SOMEBODY:
            return self.calls.meant(found.who)
        last = next((piece.who for piece in reversed(self.pieces) if piece.who is not None), None)
        if last is None:
            raise RefusalError(f"who is '{found.who}'? say the robot's name", [found.who])
        return last


def _who(match: re.Match[str]) -> str:
    """The words of who is meant."""
    return next(words for key, words in match.groupdict().items() if key.startswith("who") and words)


def _says(piece: Piece) -> bool:
    return re.search(r"\w", piece.text) is not None


def _tidy(text: str) -> str:
    return re.sub(rf"^{_JOINT_WORDS}", "", text.strip(" ,;:-"), flags=re.IGNORECASE).strip(" ,;:-")


def _clause_starts(text: str) -> Iterator[int]:
    """Where a clause can begin."""
    yield 0
    for match in re.finditer(_BOUNDARY, text, re.IGNORECASE):
        yield match.end()


def _split_joint(text: str) -> tuple[str, str]:
    """The text, and the small words at its end that join it with what follows."""
    match = re.search(rf"(?:(?:^|(?<=[\s,.;:!?-]))(?:{_JOINTS})(?=[\s,.;:!?-]|$)|[\s,;:-])*$", text, re.IGNORECASE)
    at = len(text) if match is None else match.start()
    return text[:at], text[at:]


def _split_opener(text: str) -> tuple[str, str]:
    """The text, and the condition at its end that is for what follows: "if there is a coke,"."""
    match = re.search(rf"(?:^|[,.;]\s*(?:and\s+)?|\band\s+)({_OPENERS}[^.;]*)$", text.strip(" ,"), re.IGNORECASE)
    if match is None or re.search(rf"(?:,|\bthen)\s*{VERBS}", match[1], re.IGNORECASE):
        return text, ""
    return text.strip(" ,")[: match.start()], match[1]


def _sentences(pieces: Sequence[Piece], address: Who | None) -> Iterator[Piece]:
    """The pieces that say something; a sentence behind a robot's part is again for the one that is spoken to."""
    for piece in pieces:
        parts = re.split(r"(?<=[.!?])\s+", piece.text) if address not in (None, piece.who) else [piece.text]
        first, *rest = parts
        if _says(replace(piece, text=first)):
            yield replace(piece, text=_tidy(first) if piece.deed else imperative(_tidy(first)))
        if rest:
            yield Piece(address, imperative(_tidy(" ".join(rest))))


def _lists(before: str) -> bool:
    """Whether names at the end go on with a list: "a beer for Robin, Alice and Bob"."""
    return re.search(r"\b[A-Z]\w*$", before) is not None and before[:1].islower()


_MODAL: Final = (
    r"(?:should|must|shall|can|could|will|would|may|might|(?:need|ha)s to|(?:need|have) to|has got to"
    r"|(?:is|are) (?:supposed |meant |going )?to|ought to)(?!n't|\s*not\b)"
)
_BARE_MODAL: Final = r"(?:should|must|shall|will|would|may|might|need)"
_MODAL_NOT: Final = r"(?:shouldn't|mustn't|won't|wouldn't|need not|needn't)"
_HOW_THEY_ARE: Final = (
    r"(?:can't|cannot|can not|couldn't|could not|is|isn't|was|wasn't|has|hasn't|doesn't|didn't|did|does not|had"
    r"|failed)\b"
)
_SMALL: Final = r"(?:(?:please|also|then|now|just|first|afterwards|go and)\s+)*"
_POLITE: Final = (
    r"(?:(?:please|just|now|then|also)\s+)*(?:(?:can|could|would|will)\s+you\s+(?:please\s+)?)?(?:please\s+)?"
)
_HAVING_DONE: Final = r"(?:get|tell|ask|order|instruct|command|send|allow|remind|want|need|call on|arrange for|use)"
_DETERMINER: Final = r"(?:a|an|the|my|your|his|her|some|any|this|that|these|those|two|three|one|no|in|on|to|at|know)\b"
_VERBISH: Final = rf"(?:{VERBS}|[a-z]{{3,}}\b)"
_ASKS: Final = r"(?:please|(?:can|could|would|will)\s+you)\b"
_REQUESTS: Final = (
    r"(?:if|when|then|is|are|how many|what|where|let|have|i|there|you|after|once|as soon as|wait|do|the|my|a|an|every"
    r"|first)\b"
)
_DONE: Final = r"(?:finish|be done|be ready|be finished|complete (?:it|that)|get done|be there|arrive)"
_IS_DONE: Final = (
    r"(?:is|are|has|have|'s|'re|gets|get|got)?\s*(?:all )?(?:done|finished|ready|through|arrived|there|back|finishes"
    r"|completed (?:it|that|this))(?:\s+(?:with )?(?:it|that|this))?\b\s*,?\s*(?:then\b|and\b)?\s*"
)
_WHOEVER: Final = r"(?P<who>{}|he|she|it|they|that|this|you)"
_WHOEVER_ELSE: Final = r"(?P<who>{}|he|she|they)"
_YOU: Final = frozenset({"you", "yourself"})
_WAITS: Final = frozenset({"after", "wait"})
_LEADS: Final[Mapping[str, str]] = {"check": "check ", "send": "go "}
_REFUSED: Final[Mapping[str, str]] = {
    "not": "say what a robot is to do, and not what it is not to do",
    "or": "say which of the robots is meant",
}
_SOMEBODY: Final = frozenset({"he", "she", "it", "they", "that", "this", "you"})
_BEFORE_CALL: Final = r"(?:please|oh|um|uh|er|so|well|right|now|and|but|listen|sorry|excuse me|good \w+)"
_THEN: Final = r"\b(?:then|after(?:wards?)?(?: that| this| which)?|next|later|finally|subsequently|only then)\b"
_OTHERWISE: Final = r"\b(?:otherwise|else|if not|if so)\b"
_JOINTS: Final = (
    r"and|but|so|also|plus|then|next|after (?:that|this|which)|afterwards?|later|finally|subsequently|meanwhile"
    r"|in the meantime|at the same time|while|whereas|whilst|first|please|otherwise|or else|else|if not|if so|only|now"
    r"|too"
)
_JOINT_WORDS: Final = r"(?:(?:and|but|so|then|while|meanwhile|first|also)\b[\s,]*)*"
_BOUNDARY: Final = (
    r"[,.;:!?]\s*|\b(?:and|then|but|so|while|whilst|whereas|meanwhile|also|plus|afterwards?|next|first|finally|please"
    r"|otherwise|after that|that|or|now|there|too|ready|done|finished)\s+"
    r"|(?=\b(?:wait|pause|if|when|once|as soon as|after)\b)|(?=\b(?:let|have|tell|ask|send|get) )"
)
_OPENERS: Final = (
    r"(?:if|unless|in case|when(?:ever)?|as soon as|once|every|as long as|at \w+ o'?clock|twice|until|by)\b"
)
