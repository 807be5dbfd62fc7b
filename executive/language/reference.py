"""What "it", "one" and "there" stand for, and where a thing is that the sentence only tells of."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from executive.language.actions import Action
from executive.language.lexicon import VerbKind
from executive.language.phrases import Phrase
from executive.language.refusal import RefusalError
from executive.language.roles import THERE, Location

__all__ = ["Deed", "resolve"]


@dataclass(frozen=True)
class Deed:
    """An action on one thing at most, without pronouns; `again` says that the thing was spoken of before."""

    kind: VerbKind
    verb: str
    target: Phrase | None = None
    source: Location | None = None
    goal: Location | None = None
    again: bool = False


@dataclass
class _Memory:
    """What was last spoken of."""

    things: tuple[Phrase, ...] = ()
    where: Location | None = None
    place: Location | None = None


def resolve(actions: Sequence[Action]) -> tuple[Deed, ...]:
    """The actions as deeds, each on one thing.

    Raises:
        RefusalError: a pronoun stands for nothing that was said.
    """
    memory = _Memory()
    deeds: list[Deed] = []
    for action in actions:
        if action.kind is None:
            deeds = _stated(action, deeds, memory)
            continue
        again = any(phrase.pronoun for phrase in action.objects)
        things = _things(action, memory)
        goal, source = (_place(place, memory) for place in (action.goal, action.source))
        source = source or (memory.where if again else None)
        for thing in things or (None,):
            deeds.append(Deed(action.kind, action.verb, thing, source, goal, again))
        memory.things = things or memory.things
        memory.where = source if again or not things else None
        memory.place = goal or source or memory.place
    return tuple(deeds)


def _stated(action: Action, deeds: list[Deed], memory: _Memory) -> list[Deed]:
    """Remember a statement; "it is in the drawer" tells where the thing of an earlier deed is."""
    pronoun = any(phrase.pronoun for phrase in action.objects)
    memory.where = _place(action.source, memory)
    memory.place = memory.where or memory.place
    if not pronoun:
        memory.things = action.objects or memory.things
        return deeds
    return [
        replace(deed, source=memory.where) if deed.target in memory.things and deed.source is None else deed
        for deed in deeds
    ]


def _things(action: Action, memory: _Memory) -> tuple[Phrase, ...]:
    things: list[Phrase] = []
    for phrase in action.objects:
        if phrase.pronoun and not memory.things:
            raise RefusalError(f"what does {phrase.text!r} stand for?", [phrase.text], question=True)
        things += memory.things if phrase.pronoun else [phrase]
    return tuple(things)


def _place(place: Location | None, memory: _Memory) -> Location | None:
    pronoun = place is not None and place.phrase is not None and place.phrase.pronoun
    if place is None or not (pronoun or place == THERE):
        return place
    if memory.place is None:
        word = THERE.preposition if place.phrase is None else place.phrase.text
        raise RefusalError(f"which place is {word!r}?", [word], question=True)
    return memory.place
