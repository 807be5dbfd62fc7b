"""Questions where something is and how much there is of it, which are answered by looking."""

from __future__ import annotations

from itertools import pairwise
from typing import Final

from executive.language.items import Being, Chunk, Item, Separator, Verb
from executive.language.lexicon import VerbKind
from executive.language.nouns import NounKind
from executive.language.phrases import Phrase
from executive.language.row import Row, command_position

__all__ = ["how_many", "where_is"]

_FIND: Final = "find"
_LOOKED_FOR: Final = frozenset({NounKind.THING, NounKind.PERSON, None})
_THERE: Final = frozenset({"there", "left"})


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
    if row.tokens[row.at + 1].word != "many" or not verb or verb[0].lemma != "be" or phrase.person:
        return None
    if any(t.tag == "IN" and b.word in ("a", "an") for t, b in pairwise(row.tokens[end:])):
        return None
    counted = Phrase(phrase.tokens[2:])
    row.at = end + 1
    while row.at < len(row.tokens) and row.tokens[row.at].word in _THERE:
        row.at += 1
    items += [Separator(""), Being(verb[0].text, existential=True, asked=True)]
    return Chunk(counted)
