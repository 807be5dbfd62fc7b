"""Accounts for each word of a plain sentence: its meaning has it, a note names it, or it is lost.

A word that the meaning lacks refuses the sentence in a request; in a statement it makes a note, since a statement asks
for nothing. The fillers of words.yaml alone get no note.
"""

import re
from collections.abc import Iterable, Iterator, Sequence
from itertools import chain
from typing import Final

from executive.language.actions import Action
from executive.language.items import Aside, Being, Chunk, Item, Predicate, Unknown, Verb, spoken_words
from executive.language.lexicon import PrepositionRole, any_of, lexicon, word_list
from executive.language.limits import is_door
from executive.language.phrases import Phrase
from skills.inputs.errors import listing


def cover(
    items: Sequence[Item], clauses: Sequence[Predicate], actions: Sequence[Action]
) -> tuple[list[str], list[tuple[str, str]]]:
    """Accounts for the items of a sentence by its actions.

    Returns notes on the words that change nothing, and the words that are lost, each with its clause.
    """
    phrases = [*chain.from_iterable(action.phrases for action in actions)]
    asides, told, lost = [*_asides(items, actions, phrases)], list[str](), list[tuple[str, str]]()
    for clause in clauses:
        unused, words = _unused(clause, phrases), _spoken(clause)
        if _asks(clause, actions):
            persons = [one for one in unused if one.role is PrepositionRole.FOR and one.phrase.person]
            favours = [one for one in persons if one.phrase.count < 2]
            asides += [one.spoken for one in favours]
            lost += [(one.spoken, words) for one in unused if one not in favours]
            lost += [(said, words) for said in _unrelated(clause, phrases)]
        elif unused or _describes(clause, words):
            told.append(words)
    notes = {_LEFT_OUT: asides, TOLD: told, "I cannot tell whose it is: {}": [*_owned(actions)]}
    return [form.format(listing(map(repr, words))) for form, words in notes.items() if words], lost


def _asides(items: Sequence[Item], actions: Sequence[Action], phrases: Sequence[Phrase]) -> Iterator[str]:
    """Yields the words that do not change what the robot does, and the places that it only passes."""
    yield from (item.word for item in items if isinstance(item, Aside))
    yield from (token.text for one in phrases for token in one.tokens[:-1] if (token.word,) in lexicon().noted)
    yield from (f"{one.preposition} {one.text}" for action in actions for one in action.passes if not is_door(one))


def _owned(actions: Sequence[Action]) -> Iterator[str]:
    """Yields the objects and landmarks that are somebody's."""
    relations = dict.fromkeys(each for action in actions for phrase in action.phrases for each in phrase.relations)
    targets = [one.target for one in actions if one.target is not None]
    for phrase in (*targets, *(one for each in relations for one in each.landmarks)):
        if any(token.word in word_list("owners") for token in phrase.tokens[:-1]):
            yield phrase.spoken


def _unused(clause: Predicate, phrases: Sequence[Phrase]) -> list[Chunk]:
    """Noun phrases of a clause that are not among the phrases of the actions, nor described by them."""
    used = {token.index for phrase in phrases for token in phrase.tokens}
    described = {text for phrase in phrases for text in phrase.extra}
    chunks = [item for item in (clause.subject, *clause.items) if isinstance(item, Chunk)]
    named = (one for one in chunks if not (one.phrase.speaker or (one.phrase.addressed and one.role is None)))
    return [one for one in named if not used & _indices(one) and one.phrase.text not in described]


def _unrelated(clause: Predicate, phrases: Sequence[Phrase]) -> Iterator[str]:
    """Yields the relations in a clause that no action has."""
    related = {each for phrase in phrases for each in phrase.relations}
    chunks = (item for item in (clause.subject, *clause.items) if isinstance(item, Chunk))
    return (each.said for one in chunks for each in one.phrase.relations if each not in related)


def _describes(clause: Predicate, words: str) -> bool:
    """Returns whether a clause of several words tells an event or a state."""
    verb = clause.verb
    states = any(isinstance(item, Unknown) for item in clause.items)
    return " " in words and isinstance(verb, Being) and (verb.narrated or states)


def _indices(chunk: Chunk) -> set[int]:
    """Indices of the words that carry the meaning of a noun phrase."""
    return {token.index for token in chunk.phrase.content}


def left_out(items: Sequence[Item], repaired: Sequence[Item]) -> tuple[str, ...]:
    """Words of the items that the speaker's corrections and negations have removed."""
    kept = {index for item in repaired if isinstance(item, Chunk) for index in _indices(item)}
    chunks = [item.spoken for item in items if isinstance(item, Chunk) and not kept & _indices(item)]
    words = [item for item in items if isinstance(item, Unknown | Aside)]
    return (*chunks, *(item.word for item in words if all(item is not one for one in repaired)))


def note_adverbs(text: str, told: Iterable[str]) -> str | None:
    """Note on adverbs of a structured sentence that change nothing, except in `told`: speech and other notes."""
    said = re.sub(any_of(told) or "(?!)", "", text, flags=re.IGNORECASE)
    words = [word for word in re.findall(r"\b\w+ly\b", said) if (word.lower(),) in lexicon().noted]
    return _LEFT_OUT.format(listing(map(repr, words))) if words else None


TOLD: Final = "I take {} to ask for nothing more"
"""Note on a statement, with its words."""
_LEFT_OUT: Final = "I leave out {}, and do the rest as usual"


def _spoken(clause: Predicate) -> str:
    verb = clause.verb
    topic = (verb.topic or verb.teller) if isinstance(verb, Being) else None
    items = [Chunk(topic)] if topic is not None else []
    words = spoken_words(one for one in (*items, clause.subject, verb, *clause.items) if one is not None)
    return re.sub(r" (?='|n't)", "", words)


def _asks(clause: Predicate, actions: Sequence[Action]) -> bool:
    """Returns whether a clause asks for an action, unlike a statement or a place that is only left."""
    verb = clause.verb
    if isinstance(verb, Being):
        return verb.asked or clause.whether
    return isinstance(verb, Verb) and not any(one.departs and one.verb == verb.text for one in actions)
