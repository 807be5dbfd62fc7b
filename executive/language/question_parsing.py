"""Questions where something is and how much there is of it, which are answered by looking."""

from __future__ import annotations

from itertools import pairwise
from typing import Final

from executive.language.items import Being, Chunk, Item, Separator, Verb
from executive.language.lexicon import PrepositionRole, VerbKind
from executive.language.nouns import NounKind
from executive.language.phrases import Phrase
from executive.language.row import Row, command_position
from executive.language.tokens import Token

__all__ = ["do_we_have", "how_many", "what_is", "where_is"]

_FIND: Final = "find"
_AT: Final = "at"
_LOOKED_FOR: Final = frozenset({NounKind.THING, NounKind.PERSON, None})
_THERE: Final = frozenset({"there", "left"})
_WE: Final = frozenset({"we", "you", "i", "they"})
_HAVE: Final = frozenset({"have", "got"})
_DO: Final = frozenset({"do", "have"})
_WHATEVER: Final = frozenset({"what", "anything", "something"})
_OBJECTS: Final = Phrase((Token(0, 0, "objects", "object", "NOUN", "NNS", 0, "obj", kind=NounKind.THING),))


def where_is(row: Row, items: list[Item]) -> Item | None:
    """ "Where is the hammer", "check where the hammer is" ask to find it."""
    last = items[-1] if items else None
    asks = isinstance(last, Verb) and bool(last.kinds & {VerbKind.FIND, VerbKind.CHECK})
    if row.tokens[row.at].word != "where" or not (asks or command_position(items)):
        return None
    inverted = _is_be(row, row.at + 1)
    start = row.at + 1 + inverted
    phrase = row.phrase_at(start)
    if phrase is None or not _one_of_ours(phrase):
        return None
    end = start + len(phrase.tokens)
    if not inverted and not _is_be(row, end):
        return None
    row.at = start
    row.silent |= set() if inverted else {end}
    if asks:
        items.pop()
    return Verb(_FIND, row.words.verbs[(_FIND,)])


def _is_be(row: Row, at: int) -> bool:
    """Whether a form of "to be" stands there."""
    return at < len(row.tokens) and (row.tokens[at].lemma == "be" or row.tokens[at].word == "'s")


def _one_of_ours(phrase: Phrase) -> bool:
    """Whether it is something or somebody in the house: "the hammer", "Anna", not "a good restaurant"."""
    told = (not phrase.indefinite and not phrase.pronoun) or phrase.named_person or phrase.known
    return told and not phrase.speaker and phrase.kind in _LOOKED_FOR


def how_many(row: Row, items: list[Item]) -> Item | None:
    """ "How many chairs are in the hall" asks to look for chairs there."""
    phrase = row.phrases.get(row.at)
    if row.tokens[row.at].word != "how" or phrase is None or len(phrase.tokens) < 3 or not command_position(items):
        return None
    end = row.at + len(phrase.tokens)
    verb = row.tokens[end : end + 1]
    if row.tokens[row.at + 1].word != "many" or not verb or verb[0].lemma != "be":
        return None
    if phrase.person and (len(phrase.tokens) > 3 or phrase.head.word not in row.words.any_person):
        return None
    if any(t.tag == "IN" and b.word in ("a", "an") for t, b in pairwise(row.tokens[end:])):
        return None
    counted = Phrase(phrase.tokens[2:])
    row.at = end + 1
    while row.at < len(row.tokens) and row.tokens[row.at].word in _THERE:
        row.at += 1
    items += [Separator(""), Being(verb[0].text, existential=True, asked=True)]
    return Chunk(counted)


def do_we_have(row: Row, items: list[Item]) -> Item | None:
    """ "Do we have any coke left" asks whether there is any."""
    words = [token.word for token in row.tokens[row.at : row.at + 3]]
    if len(words) < 3 or words[0] not in _DO or words[1] not in _WE or words[2] not in _HAVE:
        return None
    start = row.at + 3
    phrase = row.phrase_at(start)
    if phrase is None or not command_position(items) or not (phrase.known or phrase.kind is NounKind.THING):
        return None
    row.at = start
    return Being(" ".join(words), existential=True, asked=True)


def what_is(row: Row, items: list[Item]) -> Item | None:
    """ "What is on the bench", "is there anything on it", "is the bench empty" ask to look for whatever lies there."""
    last = items[-1] if items else None
    asks = isinstance(last, Verb) and bool(last.kinds & {VerbKind.FIND, VerbKind.CHECK})
    found = _whatever(row) or _fullness(row) if asks or command_position(items) else None
    if found is None:
        return None
    if asks:
        items.pop()
    items += [Verb(_FIND, row.words.verbs[(_FIND,)]), Chunk(_OBJECTS)]
    return found


def _whatever(row: Row) -> Chunk | None:
    """The place behind "what is" or "is there anything"."""
    at, asked = row.at, False
    for word in (token.word for token in row.tokens[row.at :]):
        if word not in row.words.asked_with and (asked or word not in _WHATEVER):
            break
        asked = asked or word in _WHATEVER
        at += 1
    return _place_at(row, at) if asked else None


def _place_at(row: Row, at: int) -> Chunk | None:
    """A preposition, and behind it a place in the house."""
    longest = (tuple(t.word for t in row.tokens[at : at + n]) for n in range(3, 0, -1))
    preposition = next((words for words in longest if words in row.words.prepositions), None)
    phrase = None if preposition is None else row.phrase_at(at + len(preposition))
    if preposition is None or phrase is None or not (phrase.known or phrase.kind is NounKind.PLACE):
        return None
    row.at = at + len(preposition) + len(phrase.tokens)
    return Chunk(phrase, " ".join(preposition), PrepositionRole.AT)


def _fullness(row: Row) -> Chunk | None:
    """The place in "is the bench empty"."""
    phrase = row.phrase_at(row.at + 1) if _is_be(row, row.at) else None
    end = row.at + 1 + (0 if phrase is None else len(phrase.tokens))
    if phrase is None or end >= len(row.tokens) or row.tokens[end].word not in row.words.fullness:
        return None
    if not (phrase.known or phrase.kind is NounKind.PLACE) or phrase.person:
        return None
    row.at = end + 1
    return Chunk(phrase, _AT, PrepositionRole.AT)
