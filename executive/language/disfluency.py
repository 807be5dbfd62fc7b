"""Repairs disfluencies: corrections ("the wrench, no, the hammer") and negations ("not the coke")."""

from collections.abc import Collection, Iterable, Sequence
from dataclasses import replace
from functools import partial, reduce
from itertools import dropwhile, takewhile
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
    chunks,
    last_index,
    spoken_words,
)
from executive.language.lexicon import PrepositionRole, VerbKind, word_list
from executive.language.nouns import NounKind
from executive.language.phrases import Phrase
from executive.language.questions import RefusalError

_WHERE_FROM: Final = frozenset({PrepositionRole.SOURCE, PrepositionRole.AT, PrepositionRole.BESIDE})
_WHERE_TO: Final = frozenset({PrepositionRole.GOAL, PrepositionRole.AT, PrepositionRole.BESIDE, PrepositionRole.FOR})
_PRONOUNS: Final = frozenset({"it", "them"})


def repair_disfluencies(items: Iterable[Item]) -> tuple[Item, ...]:
    """Applies the speaker's corrections and negations; one that fits nothing becomes an unknown word.

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
    marks = ((mark, items[n:]) for n, mark in enumerate(items, 1) if isinstance(mark, Negation))
    found = (chunk.phrase for mark, behind in marks for chunk in _unwanted(mark, behind))
    return tuple(phrase for phrase in found if not phrase.pronoun)


def _unwanted(mark: Negation, behind: Sequence[Item]) -> list[Chunk]:
    match [item for item in behind if not isinstance(item, Separator)]:
        case [Chunk() as first, *_]:
            return chunks(_listed(mark, behind[behind.index(first) :]))
        case [Verb(), *words] if not any(chunk.phrase.head.word in _PRONOUNS for chunk in chunks(words)):
            acted = chunks(takewhile(lambda item: isinstance(item, Chunk), words))
            return [chunk for chunk in acted if chunk.role is None and not chunk.phrase.receiver]
    return []  # what is forbidden is the act, not the object: "don't drop the beer, put it down"


def _listed(mark: Negation, items: Sequence[Item]) -> Sequence[Item]:
    """Noun phrases from the first on that are negated together: "not the beer or the coke", "except beer and coke"."""
    joints, end = ("or", "and", ",") if mark.word in word_list("exceptions") else ("or",), 1
    while joined := [*takewhile(lambda item: getattr(item, "word", None) in joints, items[end:])]:
        match items[end + len(joined) :]:
            case [Chunk(role=role), *_] if role is None or joints == ("or",):
                end += len(joined) + 1
            case _:
                break
    return items[:end]


def _negated(done: list[Item], rest: list[Item], mark: Negation) -> tuple[list[Item], list[Item]]:
    """Removes what is negated to distinguish the requested one. Raises RefusalError for an action that is forbidden."""
    ahead = [*dropwhile(lambda item: isinstance(item, Separator | Correction), rest)]
    match [] if done and isinstance(done[-1], Being) else ahead:
        case [Verb() as act, *words]:
            clause = [*takewhile(lambda item: not isinstance(item, Verb | Being | Correction), words)]
            instead = [*dropwhile(lambda item: item != Separator("but"), clause)][1:]  # not to the hall but to the desk
            unknown = [item for item in clause if isinstance(item, Unknown)]
            after = [*([act, *instead] if instead else []), *words[len(clause) :]]
            negated, rest = [act, *clause], [Separator(","), *unknown, *after]
            fits, named = _done_instead(act, done, rest), _first_object(words)
            if named is not None and not (named.phrase.pronoun or named.phrase.speaker):
                rest = _with_meaning(rest, _first_object(rest), named.phrase, _PRONOUNS)
        case [Chunk() as named, *_]:
            negated, rest = [named], ahead[len(_listed(mark, ahead)) :]
            other = next((item for item in rest if not isinstance(item, Separator)), None)
            rest = _with_meaning(rest, other, named.phrase)
            fits = _meant_instead(named, mark, done, rest)
        case _:
            return [*done, Unknown(mark.word)], rest
    if not fits:
        said = spoken_words([mark, *negated]).replace(" n't", "n't")
        raise RefusalError(f"I cannot follow {said!r}; say only what I am to do", [said])
    return done, rest


def _first_object(items: Sequence[Item]) -> Chunk | None:
    return next((chunk for chunk in chunks(items) if chunk.role is None), None)


def _done_instead(negated: Verb, done: Sequence[Item], rest: Sequence[Item]) -> bool:
    """Returns whether the next verb replaces the negated one: both go, both handle objects, or a first one handles."""
    after = next((item for item in rest if isinstance(item, Verb)), None)
    goes = negated.kinds == {VerbKind.GO}
    first = not goes and not any(isinstance(item, Verb) for item in done)
    return after is not None and (first or goes == (after.kinds == {VerbKind.GO}))


def _meant_instead(negated: Chunk, mark: Negation, done: Sequence[Item], rest: Sequence[Item]) -> bool:
    """Returns whether another phrase replaces the negated one ("the milk, not the juice"), or it is to be left out."""
    phrase, verb = negated.phrase, last_index(done, lambda item: isinstance(item, Verb))
    if negated.role is None and verb is not None:
        every = any(chunk.phrase.universal for chunk in chunks(done))
        if every if phrase.kind is NounKind.PLACE else not (phrase.receiver or phrase.stands_for_one):
            return True
    meant = [item for item in (*done[verb or 0 :], *rest) if _corrects(negated, item)]
    told = not phrase.stands_for_one or any(len(chunk.phrase.content) > 1 for chunk in chunks(meant))
    return bool(meant) and told and (negated.role is None or not mark.word.startswith("but"))


def _with_meaning(items: list[Item], said: Item | None, meant: Phrase, pronouns: Collection[str] = ()) -> list[Item]:
    """Replaces "one", or a pronoun, by what it means: "don't take the red cup, take the blue one"."""
    if not isinstance(said, Chunk) or not (said.phrase.stands_for_one or said.phrase.head.word in pronouns):
        return items
    phrase = said.phrase.replace_one(meant) if said.phrase.stands_for_one else meant
    return [replace(said, phrase=phrase) if item is said else item for item in items]


def _corrected(done: list[Item], rest: list[Item], mark: Correction) -> tuple[list[Item], list[Item]]:
    """Replaces the corrected item by the item that follows it."""
    ahead = [*dropwhile(lambda item: isinstance(item, Separator | Correction), rest)]
    verb = last_index(done, lambda item: isinstance(item, Verb))
    before, clause = done[:verb], done[verb:]
    match ahead:
        case _ if all(isinstance(item, Separator) for item in done):
            return done, ahead
        case [Verb(), *_]:
            return done[: verb or 0], ahead
        case [Chunk() | Adverb(), *_] if verb is not None:
            news = [*takewhile(lambda item: isinstance(item, Chunk | Adverb), ahead)]
            return [*before, *reduce(_replaced, news, clause)], ahead[len(news) :]
        case [] if verb is not None and not mark.soft:  # the bag to the hall, the trunk I mean
            *clause, new = [*dropwhile(lambda item: isinstance(item, Separator), reversed(clause))][::-1]
            if isinstance(new, Chunk) and last_index(clause, partial(_corrects, new)) is not None:
                return [*before, *_replaced(clause, new)], rest
    return done if mark.soft else [*done, Unknown(mark.word)], rest


def _replaced(clause: Sequence[Item], new: Item) -> list[Item]:
    """Replaces the noun phrase that `new` corrects, or appends `new` when there is none."""
    at = last_index(clause, partial(_corrects, new))
    if at is None:
        return [*clause, new]
    match new, clause[at]:
        case Chunk(role=None, phrase=said), Chunk(phrase=meant) as old:
            # "two" and "the red one" take their noun from the old one
            counted = replace(meant, numbered=said.count) if said.counts else said
            new = replace(old, phrase=said.replace_one(meant) if said.stands_for_one else counted)
    return [*clause[:at], new, *clause[at + 1 :]]


def _corrects(new: Item, old: Item) -> bool:
    match new, old:
        case Adverb(), Adverb() | Chunk(role=PrepositionRole.GOAL):
            return True
        case Chunk(role=role), Adverb():
            return role in _WHERE_TO
        case Chunk(role=None, phrase=phrase), Chunk(phrase=other) if phrase.person or other.receiver:
            return phrase.person and other.receiver
        case Chunk(role=None, phrase=phrase), Chunk(role=role):
            return (phrase.kind is NounKind.PLACE) == (role is not None)
        case Chunk(), Chunk():
            return any({old.role, new.role} <= group for group in (_WHERE_FROM, _WHERE_TO))
    return False
