"""Questions and statements that stand for requests: where something is, what somebody needs, what happened."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import Final

from executive.language.items import Being, Chunk, Item, Row, Separator, Unknown, Verb, command_position, verb
from executive.language.lexicon import PrepositionRole, VerbKind, lexicon
from executive.language.nouns import NounKind
from executive.language.phrases import Phrase
from executive.language.tokens import Token

_FIND: Final = "find"
_AT: Final = "at"
_LOOKED_FOR: Final = frozenset({NounKind.THING, NounKind.PERSON, None})
_THERE: Final = frozenset({"there", "left"})
_WE: Final = frozenset({"we", "you", "i", "they"})
_HAVE: Final = frozenset({"have", "got"})
_DO: Final = frozenset({"do", "have"})
_WHATEVER: Final = frozenset({"what", "anything", "something"})
OBJECTS: Final = Phrase((Token(0, 0, "objects", "object", "NOUN", "NNS", 0, "obj", kind=NounKind.THING),))


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
    return verb(_FIND)


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
    be = row.tokens[end : end + 1]
    if row.tokens[row.at + 1].word != "many" or not be or be[0].lemma != "be":
        return None
    if phrase.person and (len(phrase.tokens) > 3 or phrase.head.word not in lexicon().any_person):
        return None
    if any(t.tag == "IN" and b.word in ("a", "an") for t, b in pairwise(row.tokens[end:])):
        return None
    counted = Phrase(phrase.tokens[2:])
    row.at = end + 1
    while row.at < len(row.tokens) and row.tokens[row.at].word in _THERE:
        row.at += 1
    items += [Separator(""), Being(be[0].text, existential=True, asked=True)]
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
    items += [verb(_FIND), Chunk(OBJECTS)]
    return found


def _whatever(row: Row) -> Chunk | None:
    """The place behind "what is" or "is there anything"."""
    at, asked = row.at, False
    for word in (token.word for token in row.tokens[row.at :]):
        if word not in lexicon().asked_with and (asked or word not in _WHATEVER):
            break
        asked = asked or word in _WHATEVER
        at += 1
    return _place_at(row, at) if asked else None


def _place_at(row: Row, at: int) -> Chunk | None:
    """A preposition, and behind it a place in the house."""
    longest = (tuple(t.word for t in row.tokens[at : at + n]) for n in range(3, 0, -1))
    preposition = next((words for words in longest if words in lexicon().prepositions), None)
    phrase = None if preposition is None else row.phrase_at(at + len(preposition))
    if preposition is None or phrase is None or not (phrase.known or phrase.kind is NounKind.PLACE):
        return None
    row.at = at + len(preposition) + len(phrase.tokens)
    return Chunk(phrase, " ".join(preposition), PrepositionRole.AT)


def _fullness(row: Row) -> Chunk | None:
    """The place in "is the bench empty"."""
    phrase = row.phrase_at(row.at + 1) if _is_be(row, row.at) else None
    end = row.at + 1 + (0 if phrase is None else len(phrase.tokens))
    if phrase is None or end >= len(row.tokens) or row.tokens[end].word not in lexicon().fullness:
        return None
    if not (phrase.known or phrase.kind is NounKind.PLACE) or phrase.person:
        return None
    row.at = end + 1
    return Chunk(phrase, _AT, PrepositionRole.AT)


_RELATIVE: Final = frozenset({"that", "which", "what"})
_PUT: Final = "put"
_BELONGS: Final = frozenset({"go", "goes", "belong", "belongs"})
_WHERE: Final = frozenset({"in", "on", "into", "onto", "inside", "under", "next"})
_WANTS: Final = frozenset({"need", "want", "have", "like", "love", "say", "mean"})
_NOT: Final = frozenset({"not", "n't", "nt"})
_BRING: Final = "bring"


def reported_speech(row: Row, items: list[Item]) -> Item | None:
    """ "I left it in the hall" tells where a thing is; behind a noun it tells only which one is meant."""
    subject = items[-1] if items else None
    if not isinstance(subject, Chunk) or row.tokens[row.at].word not in lexicon().told:
        return None
    phrase = subject.phrase
    if subject.role is not None or not (phrase.head.word in lexicon().subjects or phrase.person):
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
    found = row.match(lexicon().needs)
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
    items.insert(first, verb(_BRING))
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
    items.insert(first, verb(_PUT))
    return Separator("")


def goes_on(row: Row, items: list[Item]) -> Item | None:
    """ "My back hurts", which is no request by itself."""
    token = row.tokens[row.at]
    if token.tag != "VBZ" or token.pos != "VERB" or token.lemma in _WANTS or not items:
        return None
    subject = items[-1]
    if not isinstance(subject, Chunk) or subject.role is not None or not command_position(items[:-1]):
        return None
    if any(word.tag.startswith("W") for word in subject.phrase.tokens) or token.lemma in lexicon().asks:
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
    if not length or asked or row.tokens[row.at + length - 1].lemma in lexicon().asks:
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
    progressive = first.lemma == "be" and tags[1:2] == ["VBG"] and (words[1],) not in lexicon().fillers
    perfect = first.lemma == "have" and first.pos == "AUX" and tags[1:2] == ["VBN"]
    future = words[1:] == ["going", "to"] and [t.tag for t in row.tokens[row.at + 3 : row.at + 4]] == ["VB"]
    if progressive and future:
        return 4
    return 2 if progressive or perfect else 0


def _may_need(chunk: Chunk) -> bool:
    """Whether it is somebody else who can be brought what they need."""
    somebody = chunk.phrase.person or chunk.phrase.kind is NounKind.PERSON
    return chunk.role is None and somebody and chunk.phrase.head.word not in ("her", "him", "them")
