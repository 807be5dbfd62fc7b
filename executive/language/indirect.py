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

OBJECTS: Final = Phrase((Token(0, 0, "objects", "object", "NOUN", "NNS", 0, "obj", kind=NounKind.THING),))

CONTENTS: Final = Phrase((replace(OBJECTS.head, relation="attr"),))
"""All objects on a surface, as a question whether it is empty asks about them."""


def _looks(items: Sequence[Item]) -> bool:
    """Returns whether the last item is a verb that asks to look for an object."""
    last = items[-1] if items else None
    return isinstance(last, Verb) and bool(last.kinds & {VerbKind.FIND, VerbKind.CHECK})


def _is_be(token: Token) -> bool:
    """Returns whether a word is a form of "to be"."""
    return token.lemma == "be" or token.word == "'s"


def where_is(row: Row, items: list[Item]) -> Item | None:
    """Reads "where is the hammer", "check where the hammer is" as a request to find an object or a person."""
    asks, inverted = _looks(items), _is_be(row.token(1))
    begins = row.word() == "where" and (asks or may_begin_command(items))
    phrase = row.phrase_at(row.at + 1 + inverted) if begins else None
    if phrase is None or phrase.speaker or phrase.kind not in (NounKind.THING, NounKind.PERSON, None):
        return None
    if (phrase.indefinite or phrase.pronoun) and not (phrase.named_person or phrase.known):  # a good restaurant
        return None
    end = 1 + inverted + len(phrase.tokens)
    if not inverted and not _is_be(row.token(end)):
        return None
    row.silent |= set() if inverted else {row.at + end}
    row.at += 1 + inverted
    del items[len(items) - asks :]
    return verb("find")


def how_many(row: Row, items: list[Item]) -> Item | None:
    """Reads "how many chairs are in the hall" as a request to look for chairs there."""
    phrase = row.phrases.get(row.at)
    asks = (row.word(), row.word(1)) == ("how", "many") and may_begin_command(items)
    if not asks or phrase is None or len(phrase.tokens) < 3:
        return None
    counted, end = Phrase((*phrase.tokens[2:-1], phrase.plural_head)), len(phrase.tokens)
    if row.word(end) == "of" and (inner := row.phrase_at(row.at + end + 1)) is not None:
        counted, end = counted.with_contents(inner), end + 1 + len(inner.tokens)
    be, behind = row.token(end), row.tokens[row.at + end :]
    anybody = " ".join(token.word for token in phrase.tokens[2:]) in word_list("any_person")
    one_place = any(one.tag == "IN" and other.word in ("a", "an") for one, other in pairwise(behind))
    if be.lemma != "be" or one_place or (phrase.person and not anybody):
        return None
    row.at += end + 1
    while row.word() in ("there", "left"):
        row.at += 1
    items += [Separator(""), Being(be.text, existential=True, asked=True)]
    return Chunk(counted)


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
    for contents, ahead, preposition in ((OBJECTS, *_whatever(row)), (CONTENTS, 1, _is_be(row.token()) * "at")):
        phrase = row.phrase_at(row.at + ahead) if preposition else None
        if phrase is None or not (phrase.known or phrase.kind is NounKind.PLACE):
            continue
        behind, of_fullness = ahead + len(phrase.tokens), contents is CONTENTS
        if not of_fullness or (row.word(behind) in word_list("fullness") and not phrase.person):
            row.at += behind + of_fullness
            items[len(items) - asks :] = [verb("find"), Chunk(contents)]
            return Chunk(phrase, preposition, PrepositionRole.AT)
    return None


def _whatever(row: Row) -> tuple[int, str]:
    """Number of words in "what is on" or "is there anything in", and the preposition; without one, they do not ask."""
    ahead, asked = 0, False
    while (word := row.word(ahead)) in word_list("asked_with") or (word in word_list("whatever") and not asked):
        asked = asked or word in word_list("whatever")
        ahead += 1
    preposition = row.match(lexicon().prepositions, ahead) if asked else ()
    return ahead + len(preposition), " ".join(preposition)


def _bare(items: Sequence[Item]) -> Chunk | None:
    """Last item, if it is a phrase without a preposition."""
    last = items[-1] if items else None
    return last if isinstance(last, Chunk) and last.role is None else None


def reported_speech(row: Row, items: list[Item]) -> Item | None:
    """Reads "I left it in the hall" as a statement on the place; after a noun it only identifies the object."""
    subject = _bare(items)
    if subject is None or row.word() not in word_list("placing"):
        return None
    phrase = subject.phrase
    if phrase.head.word not in word_list("subjects") and not phrase.person:
        return None
    items.pop()
    if items and isinstance(items[-1], Unknown) and items[-1].word.lower() in ("that", "which", "what"):
        items.pop()
    being = Being(row.take(1), existential=True, asked=False, teller=phrase if phrase.person else None)
    return Separator("") if items and isinstance(items[-1], Chunk) else being


def _subject(items: Sequence[Item]) -> tuple[int, Chunk | None]:
    """Index of the last phrase without a preposition, and the phrase: "the patient" in "the patient in room four"."""
    at = len(items) - 1
    while at > 0 and isinstance(item := items[at], Chunk) and item.role is not None:
        at -= 1
    return at, _bare(items[: at + 1]) if may_begin_command(items[:at]) else None


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
    sources = [replace(place, role=PrepositionRole.SOURCE) for place in items[at + 1 :] if isinstance(place, Chunk)]
    items[at:] = [verb("put"), item, *sources]
    return Separator("")


def event(row: Row, items: list[Item]) -> Item | None:
    """Reads "my back hurts" as an event, which asks for nothing."""
    token, subject = row.token(), _bare(items)
    if token.tag != "VBZ" or token.pos != "VERB" or token.lemma in word_list("wants") | word_list("asks"):
        return None
    if subject is None or not may_begin_command(items[:-1]) or _asks(subject.phrase):
        return None
    items.pop()
    return Being(row.take(1), existential=True, asked=False, narrated=True, topic=subject.phrase)


def _asks(phrase: Phrase) -> bool:
    """Returns whether a phrase has a word such as "what" or "whose"."""
    return any(token.tag.startswith("W") for token in phrase.tokens)


def narration(row: Row, items: list[Item]) -> Item | None:
    """Reads "somebody spilled milk", "I can't reach the jar" as a reason for a request."""
    last = items[-1] if len(items) > 1 else None
    at = len(items) - 1 - (isinstance(last, Separator) and last.word.isalpha() and last.word != "and")
    subject, length = _bare(items[: at + 1]), _told_verb(row)
    if subject is None or not length or not may_begin_command(items[:at]) or _asks(subject.phrase):
        return None
    if row.token(length - 1).lemma in word_list("asks"):
        return None
    del items[at:]
    phrase, living = subject.phrase, subject.phrase.living or subject.phrase.speaker
    teller, topic = (phrase if living and not phrase.speaker else None), None if living else phrase
    return Being(row.take(length), existential=True, asked=False, teller=teller, narrated=True, topic=topic)


def _told_verb(row: Row) -> int:
    """Number of words in a narrating verb that begins here; 0 if none does."""
    first, second, third, fourth = map(row.token, range(4))
    progressive = first.lemma == "be" and second.tag == "VBG" and second.word not in word_list("relative")
    forms = (
        (1, first.tag == "VBD" and first.pos == "VERB"),  # spilled
        (3, first.tag == "MD" and second.word in ("not", "n't", "nt") and third.tag == "VB"),  # can't reach
        (4, progressive and (second.word, third.word, fourth.tag) == ("going", "to", "VB")),
        (2, progressive or (first.lemma == "have" and first.pos == "AUX" and second.tag == "VBN")),  # has fallen
    )
    return next((length for length, fits in forms if fits), 0)


INDIRECT: Final = (where_is, how_many, what_is, do_we_have, reported_speech, narration, stated_need, belonging, event)
"""Readers of indirect requests, in the order of trying."""
