"""What the robot is to say and to ask, and to whom."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

from executive.language.parser import DependencyParser
from executive.language.questions import RefusalError
from executive.language.structure.cutting import pattern
from executive.words.knowledge import Knowledge

__all__ = ["Asked", "Listener", "Said", "asked_of", "bare", "said_by", "said_to", "template"]


@dataclass(frozen=True)
class Listener:
    """To whom something is said: the speaker, or somebody to go to, by words (`who`), and where they are.

    `name` is that of a known person. Without `who` and `where` it is said on the spot.
    """

    who: str | None = None
    where: str | None = None
    name: str | None = None
    speaker: bool = False


@dataclass(frozen=True)
class Said:
    """What is to be said, and to whom; `text` is None where that was not said ("tell Robin")."""

    text: str | None
    to: Listener | None


@dataclass(frozen=True)
class Asked:
    """A question to somebody, the things to choose from (with their articles), and whether it is yes or no."""

    text: str
    of: Listener
    choices: tuple[str, ...]
    yes_or_no: bool = False


_SAY: Final = re.compile(r"say (?P<text>.+)", re.IGNORECASE)
_ANNOUNCE: Final = re.compile(r"announce (?:(?:in|at) (?P<place>the [\w ]+?) )?(?:that )?(?P<text>.+)", re.IGNORECASE)
_QUESTION: Final = re.compile(r"(?:where|what|whether|if|how|who|why|when|which)\b", re.IGNORECASE)
_NOTHING: Final = re.compile(
    r"(?:to|something|anything|nothing|it|that|so|this|them|one|a word|a few words|a joke|a story|something \w+)",
    re.IGNORECASE,
)
_INNER: Final = re.compile(r"\b(?:if|unless|until|whether|otherwise)\b", re.IGNORECASE)


def said_by(text: str, knowledge: Knowledge, parser: DependencyParser) -> Said | None:
    """What a clause asks to say; None where it asks for nothing of that kind.

    Raises RefusalError: what it asks to say cannot be said for somebody else, or to nobody who is known.
    """
    who = _who(knowledge)
    for spoken in (r"say (?P<text>.+?) to {who}", r"say to {who} (?:that )?(?P<text>.+)"):
        match = re.fullmatch(spoken.format(who=who), text, re.IGNORECASE)
        if match is not None:
            return Said(_words(match["text"], parser), _listener(match))
    if re.search(rf"\bto (?:{_names(knowledge)})(?![\w'])", text, re.IGNORECASE) and re.match(
        r"say\b", text, re.IGNORECASE
    ):
        raise RefusalError(f"I do not understand to whom to say '{text}'; name one person at the end", [text])
    if (match := _SAY.fullmatch(text)) is not None:
        return Said(_words(re.sub(r"^that ", "", match["text"], flags=re.IGNORECASE), parser), None)
    if (match := re.fullmatch(rf"(?:greet|say hello to) {who}", text, re.IGNORECASE)) is not None:
        return Said("hello", _listener(match))
    if (match := re.fullmatch(rf"announce to {who} (?:that )?(?P<text>.+)", text, re.IGNORECASE)) is not None:
        return Said(_told(match["text"]), _listener(match))
    if (match := _ANNOUNCE.fullmatch(text)) is not None:
        to = None if match["place"] is None else Listener(where=match["place"])
        return Said(_told(match["text"]), to)
    return _relayed(text, who, parser)


def said_to(who: str, text: str, knowledge: Knowledge) -> Said:
    """Telling somebody something. Raises RefusalError: nobody of that name is known, or it cannot be said for them."""
    match = re.fullmatch(_who(knowledge), who, re.IGNORECASE)
    if match is None:
        raise RefusalError(f"I do not know to whom to say it: '{who}'", [who])
    return Said(_told(text), _listener(match))


def _relayed(text: str, who: str, parser: DependencyParser) -> Said | None:
    """ "Tell Robin that dinner is ready", "let Robin know it", "ask Robin to come"."""
    forms = (
        rf"(?:tell|inform|remind) {who} that (?P<text>.+)",
        rf"let {who} know that (?P<text>.+)",
        rf"(?:tell|ask) {who} to (?P<act>.+)",
    )
    for spoken in forms:
        match = re.fullmatch(spoken, text, re.IGNORECASE)
        if match is not None and not _QUESTION.match(match.groupdict().get("text") or ""):
            act = match.groupdict().get("act")
            return Said(_told(match["text"] if act is None else f"please {act}"), _listener(match))
    match = re.fullmatch(rf"(?:tell|inform) {who}(?: (?P<text>.+))?", text, re.IGNORECASE)
    match = match or re.fullmatch(rf"let {who} know(?: (?P<text>.+))?", text, re.IGNORECASE)
    if match is None:
        return None
    said = match["text"]
    if said is not None and re.match(r"(?:and|or)\b", said, re.IGNORECASE):
        raise RefusalError(f"I tell it to one person at a time, not '{text}'", [text])
    if said is None or re.fullmatch(r"so|it|that|about it|about that", said, re.IGNORECASE):
        return Said(None, _listener(match))
    if pattern("greetings").fullmatch(said) or (not _QUESTION.match(said) and _clause(said, parser)):
        return Said(_told(said), _listener(match))
    raise RefusalError(f"I do not understand what to tell in '{text}'; say 'tell ... that ...'", [text])


def _clause(text: str, parser: DependencyParser) -> bool:
    """Whether it is a whole statement: a finite verb with its subject before it."""
    tokens = parser.parse(text)
    verbs = {t.index for t in tokens if t.tag in ("VBZ", "VBP", "VBD", "MD") or t.relation == "root"}
    finite = any(t.tag in ("VBZ", "VBP", "VBD", "MD") for t in tokens)
    return finite and any(t.relation in ("nsubj", "nsubjpass", "expl") and t.head in verbs for t in tokens)


def _words(text: str, parser: DependencyParser) -> str:
    """Words that are to be said. Raises RefusalError: they name what to say, or somebody who is not known."""
    clause = _clause(text, parser)
    whom = re.search(r" to (?:the|a|an|my|our|all|every|each|some|any|somebody|someone)\b.*$", text, re.IGNORECASE)
    if whom is not None and not clause:
        raise RefusalError(f"I do not know to whom to say it: '{whom[0].strip()}'", [whom[0].strip()])
    if _NAMED.match(text) and not clause:
        raise RefusalError(f"what are the words of '{text}'?", [text])
    return _literal(text)


_NAMED: Final = re.compile(r"(?:the|a|an|my|your|our|this|these|his|her|some|all|every)\b", re.IGNORECASE)


def _literal(text: str) -> str:
    """Words that are said as they are. Raises RefusalError: they only stand for some."""
    if _NOTHING.fullmatch(text) or _QUESTION.match(text) or re.match(r"to\b", text, re.IGNORECASE):
        raise RefusalError(f"what am I to say? '{text}' says nothing", [text])
    return text.strip(" ,.'\"")


def _told(text: str) -> str:
    """What is told in the speaker's name. Raises RefusalError: another voice would change what it means."""
    word = pattern("deictic").search(text) or _INNER.search(text)
    if word is not None:
        raise RefusalError(f"I cannot say '{text}' for you: '{word[0]}' would mean somebody or something else", [text])
    return _literal(text)


def template(text: str) -> str:
    """The text with its braces kept."""
    return text.replace("{", "{{").replace("}", "}}")


def _who(knowledge: Knowledge) -> str:
    """The pattern of who can be spoken to, and where they are."""
    people = [*knowledge.spellings(knowledge.people)]
    places = sorted(knowledge.spellings(knowledge.place_names()), key=len, reverse=True)
    words = "me|us|him|her|them|everyone|everybody|all the people|all people|the people|the guests|the others"
    names = "|".join([*map(re.escape, sorted(people, key=len, reverse=True)), words])
    around = "|".join(map(re.escape, places)) or "(?!)"
    where = rf"(?: (?:who is |who are |that are |that is )?(?:in|at) (?P<where>(?:the )?(?:{around})))?"
    return rf"(?P<who>{names}){where}(?![\w'])"


_SPEAKER: Final = frozenset({"me", "us"})
_SOMEBODY: Final = frozenset({"him", "her"})


def _listener(match: re.Match[str]) -> Listener:
    who, where = match["who"], match["where"]
    word = who.lower()
    if word in _SPEAKER:
        return Listener(who, speaker=True)
    if word in _SOMEBODY:
        return Listener(who)
    if word in ("them", "the others", "everyone", "everybody") or " " in word:
        return Listener(where=where)
    return Listener(who, where, name=who)


_WANTS: Final = (
    r"(?:wants?|would like|'d like|would prefer|prefers?|likes|needs?|would rather have)"
    r"(?: to (?:have|drink|eat|get))?(?: either)?"
)
_NOUN: Final = r"(?:(?:a|an|some|the|any|another) )?[\w-]+(?: [\w-]+)?"


def asked_of(text: str, knowledge: Knowledge) -> Asked | None:
    """The question that a clause asks to put to somebody; None where it is none.

    Raises RefusalError: it is none that the robot can put.
    """
    if not re.match(r"ask\b", text, re.IGNORECASE) or re.fullmatch(
        rf"ask {_who(knowledge)} to .+", text, re.IGNORECASE
    ):
        return None
    text = re.sub(r" or not$", "", text, flags=re.IGNORECASE)
    match = re.fullmatch(
        rf"ask {_who(knowledge)} (?:if|whether) (?:he|she|they|{_names(knowledge)}) {_WANTS} (?P<what>{_NOUN}"
        rf"(?:(?:,? or |, ){_NOUN})*)",
        text,
        re.IGNORECASE,
    )
    open_one = re.fullmatch(
        rf"ask {_who(knowledge)} (?:what|which (?P<kind>\w+)) (?:he|she|they) {_WANTS}(?: (?P<to>to drink))?",
        text,
        re.IGNORECASE,
    )
    found = match or open_one
    if found is None or _listener(found).name is None:
        raise RefusalError(
            f"I do not understand the question in '{text}'; I can ask somebody by name whether they want this or that",
            [text],
        )
    if match is None and open_one is not None:
        return _what(open_one, text, knowledge)
    assert match is not None
    if (word := pattern("deictic").search(match["what"])) is not None:
        raise RefusalError(f"I cannot ask that for you: '{word[0]}' would mean somebody else", [text])
    choices = tuple(re.split(r",? or |, ", match["what"], flags=re.IGNORECASE))
    return Asked(f"Do you want {match['what']}?", _listener(match), choices, yes_or_no=len(choices) == 1)


def _what(match: re.Match[str], text: str, knowledge: Knowledge) -> Asked:
    """ "What he wants to drink": all that is known of that kind."""
    kind = (match["kind"] or ("drink" if "drink" in text.lower() else "")).lower()
    names = knowledge.classes(kind.removesuffix("s")) if kind else ()
    if not names:
        raise RefusalError(f"I do not know what there is to choose from in '{text}'; name it", [text])
    spoken = f"What {'do you want to drink' if match['kind'] is None else f'{kind} do you want'}?"
    if match["kind"] is not None:
        spoken = f"Which {kind} do you want?"
    return Asked(spoken, _listener(match), tuple(f"a {name}" for name in names))


def _names(knowledge: Knowledge) -> str:
    return "|".join(map(re.escape, _longest(knowledge.spellings(knowledge.people)))) or "(?!)"


def _longest(names: Iterable[str]) -> list[str]:
    return sorted(names, key=len, reverse=True)


def bare(choice: str) -> str:
    """The choice without its article."""
    return re.sub(r"^(?:a|an|some|the|any|another) ", "", choice, flags=re.IGNORECASE)
