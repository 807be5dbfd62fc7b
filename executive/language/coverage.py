"""Accounts for each word of a plain sentence: its meaning has it, a note names it, or it is lost.

A word that the meaning lacks refuses the sentence in a request; in a statement it makes a note, since a statement asks
for nothing. The fillers of words.yaml alone get no note.
"""

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Final

from executive.language.actions import Action
from executive.language.items import Aside, Being, Chunk, Item, Predicate, Unknown, Verb, spoken_words
from executive.language.lexicon import PrepositionRole, any_of, lexicon
from executive.language.limits import is_door
from executive.language.phrases import Phrase
from executive.language.roles import Location
from skills.inputs.errors import listing


@dataclass(frozen=True)
class Coverage:
    """Notes on words that change nothing, and the words that are lost, each with its clause."""

    notes: tuple[str, ...] = ()
    lost: tuple[tuple[str, str], ...] = ()


def cover(
    items: Sequence[Item],
    clauses: Sequence[Predicate],
    actions: Sequence[Action],
    taken_back: Sequence[str],
    *,
    known: bool,
) -> Coverage:
    """Accounts for the items of a sentence by its actions.

    `taken_back` are phrases that the speaker has corrected, `known` marks a sentence whose objects the world knows.
    """
    phrases = [phrase for action in actions for phrase in _phrases(action)]
    used = {token.index for phrase in phrases for token in phrase.tokens}
    described = {text for phrase in phrases for text in phrase.extra}
    asides = [item.word for item in items if isinstance(item, Aside)]
    asides += [
        f"{place.preposition} {place.text}" for action in actions for place in action.passes if not is_door(place)
    ]
    said, lost = list[str](), list[tuple[str, str]]()
    for clause in clauses:
        unused = [
            one
            for one in (clause.subject, *clause.items)
            if isinstance(one, Chunk)
            and not (one.phrase.speaker or one.phrase.addressed or used & _indices(one) or one.phrase.text in described)
        ]
        words = _spoken(clause)
        if _asks(clause, actions):
            favours = [chunk for chunk in unused if chunk.role is PrepositionRole.FOR and chunk.phrase.person]
            asides += [chunk.spoken for chunk in favours]
            lost += [(chunk.spoken, words) for chunk in unused if chunk not in favours]
        elif unused or (isinstance(clause.verb, Being) and " " in words and _only_tells(clause, clause.verb)):
            said.append(words)
    owned = [one.spoken for one in (action.target for action in actions) if one is not None and _is_owned(one)]
    notes = {
        _LEFT_OUT: asides,
        "I take {} to ask for nothing more": said,
        "I take {} not to be meant": list(taken_back),
    }
    if known:
        notes["I cannot tell whose it is: {}"] = owned
    texts = (form.format(listing(map(repr, words))) for form, words in notes.items() if words)
    return Coverage(tuple(texts), tuple(lost))


def _is_owned(phrase: Phrase) -> bool:
    return any(token.word in lexicon().owners for token in phrase.tokens[:-1])


def _indices(chunk: Chunk) -> set[int]:
    """Indices of the words that carry the meaning of a noun phrase."""
    return {token.index for token in chunk.phrase.content}


def left_out(items: Sequence[Item], repaired: Sequence[Item]) -> tuple[str, ...]:
    """Words of the items that the speaker's corrections and negations have removed."""
    kept = {index for item in repaired if isinstance(item, Chunk) for index in _indices(item)}
    chunks = (item for item in items if not isinstance(item, Chunk) or not kept & _indices(item))
    gone = [
        item
        for item in chunks
        if isinstance(item, Chunk | Unknown | Aside) and not any(item is one for one in repaired)
    ]
    return tuple(item.spoken if isinstance(item, Chunk) else item.word for item in gone)


def note_adverbs(text: str, told: Iterable[str]) -> str | None:
    """Note on adverbs of a structured sentence that change nothing, except in `told`: speech and other notes."""
    said = re.sub(any_of(told) or "(?!)", "", text, flags=re.IGNORECASE)
    words = [word for word in re.findall(r"\b\w+ly\b", said) if (word.lower(),) in lexicon().noted]
    return _LEFT_OUT.format(listing(map(repr, words))) if words else None


_LEFT_OUT: Final = "I leave out {}, and do the rest as usual"


def _spoken(clause: Predicate) -> str:
    verb = clause.verb
    told = (verb.topic or verb.teller) if isinstance(verb, Being) else None
    words = spoken_words(one for one in (clause.subject, verb, *clause.items) if one is not None).replace(" n't", "n't")
    return words if told is None else f"{told.spoken} {words}"


def _only_tells(clause: Predicate, verb: Being) -> bool:
    """Returns whether a statement tells an event or a state, and no place."""
    return verb.narrated or any(isinstance(item, Unknown) for item in clause.items)


def _asks(clause: Predicate, actions: Sequence[Action]) -> bool:
    """Returns whether a clause asks for an action, unlike a statement or a place that is only left."""
    verb = clause.verb
    if isinstance(verb, Being):
        return verb.asked or clause.whether
    return isinstance(verb, Verb) and not any(one.departs and one.verb == verb.text for one in actions)


def _phrases(action: Action) -> Iterator[Phrase]:
    """Yields the noun phrases that an action has."""
    yield from action.objects
    yield from (phrase for choice in action.choices for phrase in choice)
    yield from (phrase for phrase in (action.teller, action.time) if phrase is not None)
    for place in (action.source, action.goal, *action.passes):
        around: Location | None = place
        while around is not None:
            if around.phrase is not None:
                yield around.phrase
            around = around.within
