"""Statements that tell something or stand for a request: where things are, what somebody needs, what happened."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

from executive.language.items import Being, Chunk, Item, Separator, Unknown, Verb
from executive.language.lexicon import PrepositionRole
from executive.language.nouns import NounKind
from executive.language.row import Row, command_position

__all__ = ["belongs", "goes_on", "narrated", "needed", "told"]

_RELATIVE: Final = frozenset({"that", "which", "what"})
_PUT: Final = "put"
_BELONGS: Final = frozenset({"go", "goes", "belong", "belongs"})
_WHERE: Final = frozenset({"in", "on", "into", "onto", "inside", "under", "next"})
_WANTS: Final = frozenset({"need", "want", "have", "like", "love", "say", "mean"})
_NOT: Final = frozenset({"not", "n't", "nt"})
_BRING: Final = "bring"


def told(row: Row, items: list[Item]) -> Item | None:
    """ "I left it in the hall" tells where a thing is; behind a noun it tells only which one is meant."""
    subject = items[-1] if items else None
    if not isinstance(subject, Chunk) or row.tokens[row.at].word not in row.words.told:
        return None
    phrase = subject.phrase
    if subject.role is not None or not (phrase.head.word in row.words.subjects or phrase.person):
        return None
    items.pop()
    text = row.take(1)
    if items and isinstance(items[-1], Unknown) and items[-1].word.lower() in _RELATIVE:
        items.pop()
    relative = bool(items) and isinstance(items[-1], Chunk)
    teller = phrase if phrase.person else None
    return Separator("") if relative else Being(text, existential=True, asked=False, teller=teller)


def needed(row: Row, items: list[Item]) -> Item | None:
    """ "The patient in room four needs a blanket" asks to bring somebody something."""
    found = row.match(row.words.needs)
    first = len(items) - 1
    while found is not None and first > 0 and isinstance(item := items[first], Chunk) and item.role is not None:
        first -= 1
    who = items[first] if found is not None and first >= 0 else None
    behind = row.tokens[row.at + len(found or ()) :][:1]
    if found is None or not isinstance(who, Chunk) or not _may_need(who) or not command_position(items[:first]):
        return None
    if not behind or behind[0].tag in ("TO", "IN") or behind[0].pos in ("PUNCT", "CCONJ"):
        return None
    row.at += len(found)
    items.insert(first, Verb(_BRING, row.words.verbs[(_BRING,)]))
    return Separator("")


def belongs(row: Row, items: list[Item]) -> Item | None:
    """ "The plates go in the cupboard" asks to put them there."""
    first = len(items) - 1
    while first > 0 and isinstance(item := items[first], Chunk) and item.role is not None:
        first -= 1
    thing = items[first] if first >= 0 else None
    behind = row.tokens[row.at + 1 : row.at + 2]
    if row.tokens[row.at].word not in _BELONGS or not behind or behind[0].word not in _WHERE:
        return None
    if not isinstance(thing, Chunk) or thing.role is not None or not command_position(items[:first]):
        return None
    if thing.phrase.speaker or thing.phrase.person or thing.phrase.kind is NounKind.PERSON:
        return None
    row.at += 1
    items[first + 1 :] = [
        replace(item, role=PrepositionRole.SOURCE) if isinstance(item, Chunk) else item for item in items[first + 1 :]
    ]
    items.insert(first, Verb(_PUT, row.words.verbs[(_PUT,)]))
    return Separator("")


def goes_on(row: Row, items: list[Item]) -> Item | None:
    """ "My back hurts", which is no request by itself."""
    token = row.tokens[row.at]
    if token.tag != "VBZ" or token.pos != "VERB" or token.lemma in _WANTS or not items:
        return None
    subject = items[-1]
    if not isinstance(subject, Chunk) or subject.role is not None or not command_position(items[:-1]):
        return None
    if any(word.tag.startswith("W") for word in subject.phrase.tokens) or token.lemma in row.words.asks:
        return None
    items.pop()
    return Being(row.take(1), existential=True, asked=False, narrated=True, topic=subject.phrase)


def narrated(row: Row, items: list[Item]) -> Item | None:
    """ "Somebody spilled milk", "I can't reach the jar", "Kim is waiting for the books": a reason for what is asked."""
    adverb = (
        len(items) > 1 and isinstance(items[-1], Separator) and items[-1].word.isalpha() and items[-1].word != "and"
    )
    at = len(items) - 1 - adverb
    subject = items[at] if at >= 0 else None
    if not isinstance(subject, Chunk) or subject.role is not None or not command_position(items[:at]):
        return None
    length = _told_verb(row)
    asked = any(token.tag.startswith("W") for token in subject.phrase.tokens)
    if not length or asked or row.tokens[row.at + length - 1].lemma in row.words.asks:
        return None
    del items[at:]
    phrase = subject.phrase
    living = phrase.person or phrase.speaker or phrase.kind is NounKind.PERSON
    teller, topic = (phrase, None) if living else (None, phrase)
    teller = None if phrase.speaker else teller
    return Being(row.take(length), existential=True, asked=False, teller=teller, narrated=True, topic=topic)


def _told_verb(row: Row) -> int:
    """How many words the verb of a narration has that begins here; 0 when none does."""
    tags = [t.tag for t in row.tokens[row.at : row.at + 3]]
    first, words = row.tokens[row.at], [t.word for t in row.tokens[row.at : row.at + 3]]
    if first.tag == "VBD" and first.pos == "VERB":
        return 1
    if first.tag == "MD" and words[1:2] and words[1] in _NOT and tags[2:] == ["VB"]:
        return 3
    progressive = first.lemma == "be" and tags[1:2] == ["VBG"] and (words[1],) not in row.words.fillers
    perfect = first.lemma == "have" and first.pos == "AUX" and tags[1:2] == ["VBN"]
    future = words[1:] == ["going", "to"] and [t.tag for t in row.tokens[row.at + 3 : row.at + 4]] == ["VB"]
    if progressive and future:
        return 4
    return 2 if progressive or perfect else 0


def _may_need(chunk: Chunk) -> bool:
    """Whether it is somebody else who can be brought what they need."""
    somebody = chunk.phrase.person or chunk.phrase.kind is NounKind.PERSON
    return chunk.role is None and somebody and chunk.phrase.head.word not in ("her", "him", "them")
