"""Reads indirect requests: questions and statements that ask for an action."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Final

from executive.language.items import Being, Chunk, Item, Row, Separator, Unknown, Verb, may_begin_command, verb
from executive.language.lexicon import PrepositionRole, VerbKind, lexicon, word_list
from executive.language.nouns import NounKind
from executive.language.phrases import Phrase
from executive.language.tokens import Token
from skills.detect.descriptions import plural

OBJECTS: Final = Phrase((Token(0, 0, "objects", "object", "NOUN", "NNS", 0, "obj", kind=NounKind.THING),))

CONTENTS: Final = Phrase((replace(OBJECTS.head, relation="attr"),))
"""All objects on a surface, as a question whether it is empty asks about them."""


def _looks(items: Sequence[Item]) -> bool:
    """Returns whether the last item is a verb that asks to look for an object."""
    last = items[-1] if items else None
    return isinstance(last, Verb) and bool(last.kinds & {VerbKind.FIND, VerbKind.CHECK})


def where_is(row: Row, items: list[Item]) -> Item | None:
    """Reads "where is the hammer", "check where the hammer is" as a request to find an object or a person."""
    asks, inverted = _looks(items), _is_be(row.token(1))
    if row.word() != "where" or not (asks or may_begin_command(items)):
        return None
    phrase = row.phrase_at(row.at + 1 + inverted)
    if phrase is None or phrase.speaker or phrase.kind not in (NounKind.THING, NounKind.PERSON, None):
        return None
    if (phrase.indefinite or phrase.pronoun) and not (phrase.named_person or phrase.known):  # a good restaurant
        return None
    end = 1 + inverted + len(phrase.tokens)
    if not inverted and not _is_be(row.token(end)):
        return None
    row.silent |= set() if inverted else {row.at + end}
    row.at += 1 + inverted
    if asks:
        items.pop()
    return verb("find")


def _is_be(token: Token) -> bool:
    """Returns whether a word is a form of "to be"."""
    return token.lemma == "be" or token.word == "'s"


def how_many(row: Row, items: list[Item]) -> Item | None:
    """Reads "how many chairs are in the hall" as a request to look for chairs there."""
    phrase = row.phrases.get(row.at)
    if row.word() != "how" or phrase is None or len(phrase.tokens) < 3 or not may_begin_command(items):
        return None
    end = len(phrase.tokens)
    inner = row.phrase_at(row.at + end + 1) if row.word(end) == "of" else None
    end += 0 if inner is None else 1 + len(inner.tokens)
    be = row.token(end)
    if row.word(1) != "many" or be.lemma != "be":
        return None
    if phrase.person and (len(phrase.tokens) > 3 or phrase.head.word not in word_list("any_person")):
        return None
    if any(t.tag == "IN" and b.word in ("a", "an") for t, b in pairwise(row.tokens[row.at + end :])):
        return None
    row.at += end + 1
    while row.word() in ("there", "left"):
        row.at += 1
    items += [Separator(""), Being(be.text, existential=True, asked=True)]
    head = phrase.head if phrase.plural else replace(phrase.head, text=plural(phrase.head.text), tag="NNS")
    counted = Phrase((*phrase.tokens[2:-1], head))
    return Chunk(counted if inner is None else counted.with_contents(inner))


def do_we_have(row: Row, items: list[Item]) -> Item | None:
    """Reads "do we have any coke left" as a question whether there is any."""
    do, who, have = (row.word(ahead) for ahead in range(3))
    has = do in ("do", "have") and who in ("we", "you", "i", "they") and have in ("have", "got")
    phrase = row.phrase_at(row.at + 3) if has else None
    if phrase is None or not may_begin_command(items) or not (phrase.known or phrase.kind is NounKind.THING):
        return None
    row.at += 3
    return Being(f"{do} {who} {have}", existential=True, asked=True)


def what_is(row: Row, items: list[Item]) -> Item | None:
    """Reads "what is on the bench" or "is the bench empty" as a request to look for all objects there."""
    asks = _looks(items)
    if not (asks or may_begin_command(items)):
        return None
    for contents, read in ((OBJECTS, _whatever), (CONTENTS, _fullness)):
        if (place := read(row)) is not None:
            items[len(items) - asks :] = [verb("find"), Chunk(contents)]
            return place
    return None


def _whatever(row: Row) -> Chunk | None:
    """Place, with its preposition, after "what is" or "is there anything"."""
    ahead, asked = 0, False
    while (word := row.word(ahead)) in word_list("asked_with") or (word in word_list("whatever") and not asked):
        asked = asked or word in word_list("whatever")
        ahead += 1
    preposition = row.match(lexicon().prepositions, ahead) if asked else ()
    ahead += len(preposition)
    phrase = row.phrase_at(row.at + ahead) if preposition else None
    if phrase is None or not (phrase.known or phrase.kind is NounKind.PLACE):
        return None
    row.at += ahead + len(phrase.tokens)
    return Chunk(phrase, " ".join(preposition), PrepositionRole.AT)


def _fullness(row: Row) -> Chunk | None:
    """Place that "is the bench empty" asks about."""
    phrase = row.phrase_at(row.at + 1) if _is_be(row.token()) else None
    if phrase is None or row.token(1 + len(phrase.tokens)).word not in word_list("fullness"):
        return None
    if not (phrase.known or phrase.kind is NounKind.PLACE) or phrase.person:
        return None
    row.at += 2 + len(phrase.tokens)
    return Chunk(phrase, "at", PrepositionRole.AT)


def reported_speech(row: Row, items: list[Item]) -> Item | None:
    """Reads "I left it in the hall" as a statement on the place; after a noun it only identifies the object."""
    subject = items[-1] if items else None
    if not isinstance(subject, Chunk) or subject.role is not None or row.word() not in word_list("placing"):
        return None
    phrase = subject.phrase
    if phrase.head.word not in word_list("subjects") and not phrase.person:
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
    behind = row.token(len(found))
    if not found or who is None or not who.phrase.living or who.phrase.head.word in ("her", "him", "them"):
        return None
    if behind.tag in ("", "TO", "IN") or behind.pos in ("PUNCT", "CCONJ"):
        return None
    row.at += len(found)
    items.insert(at, verb("bring"))
    return Separator("")


def belonging(row: Row, items: list[Item]) -> Item | None:
    """Reads "the plates go in the cupboard" as a request to put them there."""
    at, item = _subject(items)
    belongs = row.word() in word_list("belongs") and row.word(1) in word_list("belongs_where")
    if not belongs or item is None or item.phrase.speaker or item.phrase.living:
        return None
    row.at += 1
    items[at + 1 :] = [
        replace(item, role=PrepositionRole.SOURCE) if isinstance(item, Chunk) else item for item in items[at + 1 :]
    ]
    items.insert(at, verb("put"))
    return Separator("")


def ongoing_event(row: Row, items: list[Item]) -> Item | None:
    """Reads "my back hurts" as an event, which asks for nothing."""
    token, subject = row.token(), items[-1] if items else None
    if token.tag != "VBZ" or token.pos != "VERB" or token.lemma in word_list("wants") | word_list("asks"):
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
    if not length or asked or row.tokens[row.at + length - 1].lemma in word_list("asks"):
        return None
    del items[at:]
    living = phrase.living or phrase.speaker
    teller, topic = (phrase if living and not phrase.speaker else None), None if living else phrase
    return Being(row.take(length), existential=True, asked=False, teller=teller, narrated=True, topic=topic)


def _told_verb(row: Row) -> int:
    """Number of words in a narrating verb that begins here; 0 if none does."""
    first, second, third, fourth = map(row.token, range(4))
    if first.tag == "VBD" and first.pos == "VERB":
        return 1
    if first.tag == "MD" and second.word in ("not", "n't", "nt") and third.tag == "VB":
        return 3
    progressive = first.lemma == "be" and second.tag == "VBG" and second.word not in word_list("relative")
    perfect = first.lemma == "have" and first.pos == "AUX" and second.tag == "VBN"
    if progressive and (second.word, third.word, fourth.tag) == ("going", "to", "VB"):
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
