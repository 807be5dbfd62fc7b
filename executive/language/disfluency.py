"""Repairs disfluencies: corrections ("the wrench, no, the hammer") and negations ("not the coke")."""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from itertools import takewhile
from typing import Final

from executive.language.items import (
    Adverb,
    Being,
    Chunk,
    Correction,
    Item,
    Negation,
    Separator,
    Unknown,
    Verb,
    spoken_words,
)
from executive.language.lexicon import PrepositionRole, VerbKind, word_list
from executive.language.nouns import NounKind
from executive.language.phrases import Phrase
from executive.language.questions import RefusalError

_WHERE_FROM: Final = frozenset({PrepositionRole.SOURCE, PrepositionRole.AT, PrepositionRole.BESIDE})
_WHERE_TO: Final = frozenset({PrepositionRole.GOAL, PrepositionRole.AT, PrepositionRole.BESIDE, PrepositionRole.FOR})


def repair_disfluencies(items: Iterable[Item]) -> tuple[Item, ...]:
    """Applies the speaker's corrections and negations to the items.

    A correction or negation that fits nothing becomes an unknown word.

    Raises RefusalError when the speaker forbids an action.
    """
    rest, done = list(items), list[Item]()
    while rest:
        item = rest.pop(0)
        if isinstance(item, Negation):
            done, rest = _negated(done, rest, item)
        elif isinstance(item, Correction):
            done, rest = _corrected(done, rest, item)
        else:
            done.append(item)
    return tuple(done)


def unwanted_phrases(items: Sequence[Item]) -> tuple[Phrase, ...]:
    """Noun phrases directly after "not" or "except", and the objects of a verb directly after "not"."""
    found = list[Phrase]()
    for n, mark in enumerate(items):
        behind = items[n + 1 :] if isinstance(mark, Negation) else []
        words = [item for item in behind if not isinstance(item, Separator)]
        if words and isinstance(words[0], Verb):
            acted = takewhile(lambda item: isinstance(item, Chunk), words[1:])
            named = [item for item in acted if isinstance(item, Chunk) and item.role is None]
            if any(isinstance(item, Chunk) and item.phrase.head.word in ("it", "them") for item in behind):
                continue  # what is forbidden is the act, not the object: "don't drop the beer, put it down"
            found += [item.phrase for item in named if not item.phrase.receiver]
        elif words and isinstance(words[0], Chunk):
            found += [item.phrase for item in _listed(mark, behind) if isinstance(item, Chunk)]
    return tuple(phrase for phrase in found if not phrase.pronoun)


def _listed(mark: Item, behind: Sequence[Item]) -> list[Item]:
    """Items from a noun phrase on that are negated together: "not the beer or the coke", "except beer and coke"."""
    end = next((n for n, item in enumerate(behind) if not isinstance(item, Separator)), len(behind)) + 1
    joints = ("or", "and", ",") if isinstance(mark, Negation) and mark.word in word_list("exceptions") else ("or",)
    while True:
        at = next((n for n in range(end, len(behind)) if getattr(behind[n], "word", None) not in joints), len(behind))
        item = behind[at] if end < at < len(behind) else None
        if not isinstance(item, Chunk) or (item.role is not None and joints != ("or",)):
            return [*behind[:end]]
        end = at + 1


def _negated(done: list[Item], rest: list[Item], mark: Negation) -> tuple[list[Item], list[Item]]:
    """Removes a negated clause or noun phrase that only distinguishes the requested one.

    Raises RefusalError when the negation forbids an action ("but don't go to the kitchen").
    """
    ahead = _without_separators(rest)
    first = ahead[0] if ahead else None
    if done and isinstance(done[-1], Being):
        first = None
    if isinstance(first, Verb):
        end = next((n for n in range(1, len(ahead)) if isinstance(ahead[n], Verb | Being | Correction)), len(ahead))
        clause, rest = ahead[1:end], ahead[end:]
        turns = (n for n, item in enumerate(clause) if isinstance(item, Separator) and item.word == "but")
        turn = next(turns, len(clause))
        instead = [first, *clause[turn + 1 :]] if clause[turn + 1 :] else []  # not to the hall but to the kitchen
        rest = [Separator(","), *instead, *rest]
        if not _done_instead(first, done, rest):
            raise _forbidden(mark, ahead[:end])
        phrase = next((item.phrase for item in ahead if isinstance(item, Chunk) and item.role is None), None)
        return done, rest if phrase is None or phrase.pronoun or phrase.speaker else _one_of_them(rest, phrase)
    if isinstance(first, Chunk):
        rest = ahead[len(_listed(mark, ahead)) :]
        at = next((n for n, item in enumerate(rest) if not isinstance(item, Separator)), len(rest))
        new = rest[at] if at < len(rest) else None
        if isinstance(new, Chunk) and new.phrase.stands_for_one:  # not the red cup but the blue one
            rest = [*rest[:at], replace(new, phrase=new.phrase.replace_one(first.phrase)), *rest[at + 1 :]]
        if not _meant_instead(first, mark, done, rest):
            raise _forbidden(mark, ahead[:1])
        return done, rest
    return [*done, Unknown(mark.word)], rest


def _forbidden(mark: Negation, ahead: Sequence[Item]) -> RefusalError:
    """Refusal because the speaker forbids an action."""
    said = spoken_words([mark, *ahead]).replace(" n't", "n't")
    return RefusalError(f"I cannot follow {said!r}; say only what I am to do", [said])


def _done_instead(negated: Verb, done: Sequence[Item], rest: Sequence[Item]) -> bool:
    """Returns whether the next verb replaces the negated verb: both go somewhere, or both handle objects.

    If no action comes before it, a negated verb that handles objects is replaced by any verb.
    """
    after = next((item for item in rest if isinstance(item, Verb)), None)
    goes = negated.kinds == {VerbKind.GO}
    first = not goes and not any(isinstance(item, Verb) for item in done)
    return after is not None and (first or goes == (after.kinds == {VerbKind.GO}))


def _meant_instead(negated: Chunk, mark: Negation, done: Sequence[Item], rest: Sequence[Item]) -> bool:
    """Returns whether another phrase replaces the negated one ("the milk, not the juice"), or it is to be left out."""
    if negated.role is not None and mark.word.startswith("but"):
        return False
    phrase, place = negated.phrase, negated.phrase.kind is NounKind.PLACE
    every = any(isinstance(item, Chunk) and item.phrase.universal for item in done)
    thing = not (place or phrase.person or phrase.receiver or phrase.stands_for_one)
    if negated.role is None and any(isinstance(item, Verb) for item in done) and (every if place else thing):
        return True
    before = next((n for n in range(len(done) - 1, -1, -1) if isinstance(done[n], Verb)), 0)
    meant = [item for item in (*done[before:], *rest) if _corrects(negated, item)]
    contents = (item.phrase.content for item in meant if isinstance(item, Chunk))
    return bool(meant) and (not negated.phrase.stands_for_one or any(len(words) > 1 for words in contents))


def _one_of_them(rest: list[Item], negated: Phrase) -> list[Item]:
    """Replaces "one" or "it" by the negated phrase: "don't take the red cup, take the blue one"."""
    at = next((n for n, item in enumerate(rest) if isinstance(item, Chunk) and item.role is None), None)
    new = None if at is None else rest[at]
    one = isinstance(new, Chunk) and new.phrase.stands_for_one
    if at is None or not isinstance(new, Chunk) or not (one or new.phrase.head.word in ("it", "them")):
        return rest
    phrase = new.phrase.replace_one(negated) if one else negated
    return [*rest[:at], replace(new, phrase=phrase), *rest[at + 1 :]]


def _corrected(done: list[Item], rest: list[Item], mark: Correction) -> tuple[list[Item], list[Item]]:
    """Replaces the corrected item by the item that follows it."""
    ahead = _without_separators(rest)
    verb = next((n for n in range(len(done) - 1, -1, -1) if isinstance(done[n], Verb)), None)
    if all(isinstance(item, Separator) for item in done):
        return done, ahead
    if ahead and isinstance(ahead[0], Verb):
        return done[: verb or 0], ahead
    if verb is not None and not ahead and not mark.soft:  # the bag to the hall, the trunk I mean
        last = next((n for n in range(len(done) - 1, verb, -1) if not isinstance(done[n], Separator)), verb)
        new = done[last]
        fits = isinstance(new, Chunk) and _corrected_index(done[verb:last], new) is not None
        return [*done[:verb], *_replaced(done[verb:last], new)] if fits else [*done, Unknown(mark.word)], rest
    if verb is None or not ahead or not isinstance(ahead[0], Chunk | Adverb):
        return (done, rest) if mark.soft else ([*done, Unknown(mark.word)], rest)
    while ahead and isinstance(ahead[0], Chunk | Adverb):
        done = [*done[:verb], *_replaced(done[verb:], ahead[0])]
        ahead = ahead[1:]
    return done, ahead


def _without_separators(items: list[Item]) -> list[Item]:
    first = (n for n, item in enumerate(items) if not isinstance(item, Separator | Correction))
    return items[next(first, len(items)) :]


def _replaced(clause: Sequence[Item], new: Item) -> list[Item]:
    """Replaces the noun phrase that `new` corrects, or appends `new` when there is none."""
    at = _corrected_index(clause, new)
    if at is None:
        return [*clause, new]
    old = clause[at]
    if isinstance(new, Chunk) and new.role is None and isinstance(old, Chunk):
        phrase = new.phrase  # "two" and "the red one" take their noun from the old one
        if phrase.stands_for_one:
            phrase = phrase.replace_one(old.phrase)
        elif phrase.counts:
            phrase = replace(old.phrase, numbered=phrase.count)
        new = replace(old, phrase=phrase)
    return [*clause[:at], new, *clause[at + 1 :]]


def _corrected_index(clause: Sequence[Item], new: Item) -> int | None:
    """Index of the last item that `new` can replace; None if there is none."""
    return next((n for n in range(len(clause) - 1, -1, -1) if _corrects(new, clause[n])), None)


def _corrects(new: Item, old: Item) -> bool:
    if isinstance(new, Adverb):
        return isinstance(old, Adverb) or (isinstance(old, Chunk) and old.role is PrepositionRole.GOAL)
    if not isinstance(new, Chunk) or not isinstance(old, Chunk):
        return isinstance(new, Chunk) and isinstance(old, Adverb) and new.role in _WHERE_TO
    if new.role is not None:
        return old.role is not None and any({old.role, new.role} <= group for group in (_WHERE_FROM, _WHERE_TO))
    if new.phrase.person or old.phrase.receiver:
        return new.phrase.person and old.phrase.receiver
    return (new.phrase.kind is NounKind.PLACE) == (old.role is not None)
