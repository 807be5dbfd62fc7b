"""Reads indirect requests: questions and statements that ask for an action."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Final

from executive.language.items import Being, Chunk, Item, Row, Separator, Unknown, Verb, may_begin_command, verb
from executive.language.lexicon import PrepositionRole, VerbKind, lexicon
from executive.language.nouns import NounKind
from executive.language.phrases import Phrase
from executive.language.tokens import Token
from skills.detect.descriptions import plural

_BELONGS: Final = frozenset({"go", "goes", "belong", "belongs"})
_WHERE: Final = frozenset({"in", "on", "into", "onto", "inside", "under", "next"})
_WANTS: Final = frozenset({"need", "want", "have", "like", "love", "say", "mean"})
OBJECTS: Final = Phrase((Token(0, 0, "objects", "object", "NOUN", "NNS", 0, "obj", kind=NounKind.THING),))

CONTENTS: Final = Phrase((replace(OBJECTS.head, relation="attr"),))
"""All objects on a surface, as a question whether it is empty asks about them."""


def _asks(items: Sequence[Item]) -> bool:
    """Returns whether the last item is a verb that asks to look for an object."""
    last = items[-1] if items else None
    return isinstance(last, Verb) and bool(last.kinds & {VerbKind.FIND, VerbKind.CHECK})


def where_is(row: Row, items: list[Item]) -> Item | None:
    """Reads "where is the hammer", "check where the hammer is" as a request to find an object or a person."""
    asks = _asks(items)
    if row.tokens[row.at].word != "where" or not (asks or may_begin_command(items)):
        return None
    inverted = _is_be(row, row.at + 1)
    start = row.at + 1 + inverted
    phrase = row.phrase_at(start)
    if phrase is None or phrase.speaker or phrase.kind not in (NounKind.THING, NounKind.PERSON, None):
        return None
    if (phrase.indefinite or phrase.pronoun) and not (phrase.named_person or phrase.known):  # a good restaurant
        return None
    end = start + len(phrase.tokens)
    if not inverted and not _is_be(row, end):
        return None
    row.at = start
    row.silent |= set() if inverted else {end}
    if asks:
        items.pop()
    return verb("find")


def _is_be(row: Row, at: int) -> bool:
    """Returns whether a form of "to be" is at a position."""
    return at < len(row.tokens) and (row.tokens[at].lemma == "be" or row.tokens[at].word == "'s")


def how_many(row: Row, items: list[Item]) -> Item | None:
    """Reads "how many chairs are in the hall" as a request to look for chairs there."""
    phrase = row.phrases.get(row.at)
    if row.tokens[row.at].word != "how" or phrase is None or len(phrase.tokens) < 3 or not may_begin_command(items):
        return None
    end = row.at + len(phrase.tokens)
    inner = row.phrase_at(end + 1) if [t.word for t in row.tokens[end : end + 1]] == ["of"] else None
    end += 0 if inner is None else 1 + len(inner.tokens)
    be = row.tokens[end : end + 1]
    if row.tokens[row.at + 1].word != "many" or not be or be[0].lemma != "be":
        return None
    if phrase.person and (len(phrase.tokens) > 3 or phrase.head.word not in lexicon().any_person):
        return None
    if any(t.tag == "IN" and b.word in ("a", "an") for t, b in pairwise(row.tokens[end:])):
        return None
    row.at = end + 1
    while row.at < len(row.tokens) and row.tokens[row.at].word in ("there", "left"):
        row.at += 1
    items += [Separator(""), Being(be[0].text, existential=True, asked=True)]
    head = phrase.head if phrase.plural else replace(phrase.head, text=plural(phrase.head.text), tag="NNS")
    counted = Phrase((*phrase.tokens[2:-1], head))
    return Chunk(counted if inner is None else counted.with_contents(inner))


def do_we_have(row: Row, items: list[Item]) -> Item | None:
    """Reads "do we have any coke left" as a question whether there is any."""
    words = [token.word for token in row.tokens[row.at : row.at + 3]]
    has = len(words) == 3 and words[0] in ("do", "have") and words[2] in ("have", "got")
    phrase = row.phrase_at(row.at + 3) if has and words[1] in ("we", "you", "i", "they") else None
    if phrase is None or not may_begin_command(items) or not (phrase.known or phrase.kind is NounKind.THING):
        return None
    row.at += 3
    return Being(" ".join(words), existential=True, asked=True)


def what_is(row: Row, items: list[Item]) -> Item | None:
    """Reads "what is on the bench" or "is the bench empty" as a request to look for all objects there."""
    asks = _asks(items)
    whatever = _whatever(row) if asks or may_begin_command(items) else None
    found = whatever or (_fullness(row) if asks or may_begin_command(items) else None)
    if found is None:
        return None
    if asks:
        items.pop()
    items += [verb("find"), Chunk(CONTENTS if whatever is None else OBJECTS)]
    return found


def _whatever(row: Row) -> Chunk | None:
    """Place, with its preposition, after "what is" or "is there anything"."""
    at, asked = row.at, False
    for word in (token.word for token in row.tokens[row.at :]):
        whatever = word in ("what", "anything", "something")
        if word not in lexicon().asked_with and (asked or not whatever):
            break
        asked = asked or whatever
        at += 1
    longest = (tuple(t.word for t in row.tokens[at : at + n]) for n in range(3, 0, -1))
    preposition = next((words for words in longest if words in lexicon().prepositions), None)
    phrase = row.phrase_at(at + len(preposition)) if asked and preposition is not None else None
    if preposition is None or phrase is None or not (phrase.known or phrase.kind is NounKind.PLACE):
        return None
    row.at = at + len(preposition) + len(phrase.tokens)
    return Chunk(phrase, " ".join(preposition), PrepositionRole.AT)


def _fullness(row: Row) -> Chunk | None:
    """Place that "is the bench empty" asks about."""
    phrase = row.phrase_at(row.at + 1) if _is_be(row, row.at) else None
    end = row.at + 1 + (0 if phrase is None else len(phrase.tokens))
    if phrase is None or end >= len(row.tokens) or row.tokens[end].word not in lexicon().fullness:
        return None
    if not (phrase.known or phrase.kind is NounKind.PLACE) or phrase.person:
        return None
    row.at = end + 1
    return Chunk(phrase, "at", PrepositionRole.AT)


def reported_speech(row: Row, items: list[Item]) -> Item | None:
    """Reads "I left it in the hall" as a statement on the place; after a noun it only identifies the object."""
    subject = items[-1] if items else None
    if not isinstance(subject, Chunk) or row.tokens[row.at].word not in lexicon().placing or subject.role is not None:
        return None
    phrase = subject.phrase
    if phrase.head.word not in lexicon().subjects and not phrase.person:
        return None
    items.pop()
    text = row.take(1)
    if items and isinstance(items[-1], Unknown) and items[-1].word.lower() in ("that", "which", "what"):
        items.pop()
    if items and isinstance(items[-1], Chunk):
        return Separator("")
    return Being(text, existential=True, asked=False, teller=phrase if phrase.person else None)


def _subject(items: Sequence[Item]) -> tuple[int, Chunk | None]:
    """Index of the last phrase without a preposition, and the phrase: "the patient" in "the patient in room four"."""
    at = len(items) - 1
    while at > 0 and isinstance(item := items[at], Chunk) and item.role is not None:
        at -= 1
    subject = items[at] if at >= 0 and may_begin_command(items[:at]) else None
    return at, subject if isinstance(subject, Chunk) and subject.role is None else None


def stated_need(row: Row, items: list[Item]) -> Item | None:
    """Reads "the patient in room four needs a blanket" as a request to bring it."""
    found, (at, who) = row.match(lexicon().needs), _subject(items)
    behind = row.tokens[row.at + len(found or ()) :][:1]
    if found is None or who is None or who.phrase.head.word in ("her", "him", "them"):
        return None
    if not (who.phrase.person or who.phrase.kind is NounKind.PERSON):
        return None
    if not behind or behind[0].tag in ("TO", "IN") or behind[0].pos in ("PUNCT", "CCONJ"):
        return None
    row.at += len(found)
    items.insert(at, verb("bring"))
    return Separator("")


def belonging(row: Row, items: list[Item]) -> Item | None:
    """Reads "the plates go in the cupboard" as a request to put them there."""
    (at, item), behind = _subject(items), row.ahead()
    if row.tokens[row.at].word not in _BELONGS or not behind or behind[0].word not in _WHERE or item is None:
        return None
    if item.phrase.speaker or item.phrase.person or item.phrase.kind is NounKind.PERSON:
        return None
    row.at += 1
    items[at + 1 :] = [
        replace(item, role=PrepositionRole.SOURCE) if isinstance(item, Chunk) else item for item in items[at + 1 :]
    ]
    items.insert(at, verb("put"))
    return Separator("")


def ongoing_event(row: Row, items: list[Item]) -> Item | None:
    """Reads "my back hurts" as an event, which asks for nothing."""
    token, subject = row.tokens[row.at], items[-1] if items else None
    if token.tag != "VBZ" or token.pos != "VERB" or token.lemma in _WANTS or token.lemma in lexicon().asks:
        return None
    if not isinstance(subject, Chunk) or subject.role is not None or not may_begin_command(items[:-1]):
        return None
    if any(word.tag.startswith("W") for word in subject.phrase.tokens):
        return None
    items.pop()
    return Being(row.take(1), existential=True, asked=False, narrated=True, topic=subject.phrase)


def narration(row: Row, items: list[Item]) -> Item | None:
    """Reads "somebody spilled milk", "I can't reach the jar" as a reason for a request."""
    last = items[-1] if len(items) > 1 else None
    at = len(items) - 1 - (isinstance(last, Separator) and last.word.isalpha() and last.word != "and")
    subject = items[at] if at >= 0 else None
    if not isinstance(subject, Chunk) or subject.role is not None or not may_begin_command(items[:at]):
        return None
    length, phrase = _told_verb(row), subject.phrase
    asked = any(token.tag.startswith("W") for token in phrase.tokens)
    if not length or asked or row.tokens[row.at + length - 1].lemma in lexicon().asks:
        return None
    del items[at:]
    living = phrase.person or phrase.speaker or phrase.kind is NounKind.PERSON
    teller, topic = (phrase if living and not phrase.speaker else None), None if living else phrase
    return Being(row.take(length), existential=True, asked=False, teller=teller, narrated=True, topic=topic)


def _told_verb(row: Row) -> int:
    """Number of words in a narrating verb that begins here; 0 if none does."""
    tags = [t.tag for t in row.tokens[row.at : row.at + 4]]
    first, words = row.tokens[row.at], [t.word for t in row.tokens[row.at : row.at + 3]]
    if first.tag == "VBD" and first.pos == "VERB":
        return 1
    if first.tag == "MD" and words[1:2] and words[1] in ("not", "n't", "nt") and tags[2:3] == ["VB"]:
        return 3
    progressive = first.lemma == "be" and tags[1:2] == ["VBG"] and words[1] not in lexicon().relative
    perfect = first.lemma == "have" and first.pos == "AUX" and tags[1:2] == ["VBN"]
    if progressive and words[1:] == ["going", "to"] and tags[3:] == ["VB"]:
        return 4
    return 2 if progressive or perfect else 0


INDIRECT: Final = (
    where_is,
    how_many,
    what_is,
    do_we_have,
    reported_speech,
    narration,
    stated_need,
    belonging,
    ongoing_event,
)
"""Readers of indirect requests, in the order of trying."""
