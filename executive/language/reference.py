"""What "it", "one" and "there" stand for, and where a thing is that the sentence only tells of."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

from executive.language.actions import Action
from executive.language.lexicon import VerbKind
from executive.language.nouns import NounKind
from executive.language.phrases import Phrase
from executive.language.questions import RefusalError
from executive.language.roles import THERE, Location


@dataclass(frozen=True)
class Memory:
    """What was last spoken of: things, where they are, a place, a person.

    `gathered` are all things that were spoken of since one was last carried somewhere, `told` where things were said
    to be.
    """

    things: tuple[Phrase, ...] = ()
    gathered: tuple[Phrase, ...] = ()
    where: Location | None = None
    place: Location | None = None
    person: Location | None = None
    told: tuple[tuple[Phrase, Location], ...] = ()

    def where_is(self, thing: Phrase) -> Location | None:
        """Where a thing of that name was said to be."""
        return next((place for told, place in reversed(self.told) if told.head.lemma == thing.head.lemma), None)


@dataclass(frozen=True)
class Resolved:
    """The actions of a sentence without pronouns, what was spoken of last, and each pronoun with what it stood for."""

    actions: tuple[Action, ...] = ()
    memory: Memory = field(default_factory=Memory)
    meanings: tuple[tuple[str, str], ...] = ()


def resolve(actions: Sequence[Action], memory: Memory) -> Resolved:
    """The actions, each on one thing at most and without pronouns; `memory` is what was spoken of before.

    Raises:
        RefusalError: a pronoun stands for nothing that was said.
    """
    resolved = Resolved(memory=memory)
    for action in actions:
        resolved = _stated(action, resolved) if action.kind is None else _done(action, resolved)
    return resolved


def _done(action: Action, before: Resolved) -> Resolved:
    memory = before.memory
    again = any(phrase.pronoun for phrase in action.objects)
    meant = _all_meant(action.objects, memory)
    things = tuple(_named_before(thing, action, before.actions) or thing for thing in meant)
    goal, source = (_place(place, memory) for place in (action.goal, action.source))
    to = None if action.goal is None else action.goal.phrase
    taken = before.actions[-1].source if before.actions else None
    if again and to is not None and to.pronoun and goal is not None and goal == taken:  # put it next to it
        raise RefusalError(f"which place is {to.text!r}?", [to.text], question=True)
    told = again or any(phrase.stands_for_one for phrase in action.objects)
    source = source or (memory.where if told else None)
    person = next((place for place in (goal, source) if place is not None and place.living), memory.person)
    after = Memory(
        things=things or memory.things,
        gathered=() if goal is not None else tuple(dict.fromkeys((*memory.gathered, *things))),
        where=source if again or not things else None,
        place=goal or source or memory.place,
        person=person,
        told=memory.told,
    )
    bare = replace(action, objects=(), source=source, goal=goal, again=again)
    each = tuple(
        replace(
            bare,
            objects=(thing,),
            source=source or (memory.where_is(thing) if action.kind is not VerbKind.GO else None),
            again=again or thing not in meant,
        )
        for thing in things
    )
    return Resolved(
        (*before.actions, *(each if things else (bare,))), after, (*before.meanings, *_meanings(action, memory))
    )


def _named_before(thing: Phrase, action: Action, actions: Sequence[Action]) -> Phrase | None:
    """The thing that was taken before under the same name: "get the bread, go to the hall and put the bread there"."""
    if thing.indefinite or action.source is not None or action.kind not in (VerbKind.PLACE, VerbKind.SINGLE_TRIP):
        return None
    taken = (one.target for one in reversed(actions) if one.target is not None and one.kind is not VerbKind.PLACE)
    return next((target for target in taken if target.text.lower() == thing.text.lower()), None)


def _meanings(action: Action, memory: Memory) -> Iterator[tuple[str, str]]:
    """Each pronoun of an action with what it stands for."""
    for n, phrase in enumerate(action.objects):
        meant = _all_meant(action.objects[: n + 1], memory)[n:]
        if meant != (phrase,):
            yield phrase.text, " and ".join(thing.text for thing in meant)
    for place in (action.source, action.goal):
        found = _place(place, memory)
        if place is not None and found is not None and found != place:
            yield (THERE.preposition if place.phrase is None else place.phrase.text), found.text


def _stated(action: Action, before: Resolved) -> Resolved:
    """Remember a statement; "it is in the drawer" tells where the thing of an earlier action is."""
    memory = before.memory
    where = _place(action.source, memory)
    somebody = any(phrase.stands_for_somebody for phrase in action.objects)
    if where is not None and somebody and memory.person:  # bring it to Robin, he is in the hall
        met = replace(memory.person, within=where)
        actions = tuple(replace(one, goal=met) if one.goal == memory.person else one for one in before.actions)
        return replace(before, actions=actions, memory=replace(memory, person=met, place=where))
    teller = None if action.teller is None else Location(action.teller, within=None if action.objects else where)
    memory = replace(memory, where=where, place=where or memory.place, person=teller or memory.person)
    animal = somebody and any(thing.kind is NounKind.PERSON for thing in memory.things)
    if not animal and not any(phrase.pronoun for phrase in action.objects):
        return replace(before, memory=_told(action, where, memory))
    told = tuple(
        replace(one, source=where) if one.target in memory.things and one.source is None else one
        for one in before.actions
    )
    return replace(before, actions=told, memory=memory)


def _told(action: Action, where: Location | None, memory: Memory) -> Memory:
    """The memory after a statement of where somebody or something is."""
    people = [phrase for phrase in action.objects if phrase.person]
    if people:
        return replace(memory, person=Location(people[-1], within=where))
    told = () if where is None else tuple((phrase, where) for phrase in action.objects)
    called = [phrase for phrase in action.objects if phrase.proper]
    person = memory.person
    if called:
        *left, head = called[-1].tokens
        named = replace(called[-1], tokens=(*left, replace(head, kind=NounKind.PERSON)))
        person = Location(named, within=where)
    return replace(memory, person=person, things=action.objects or memory.things, told=(*memory.told, *told))


def _all_meant(phrases: Sequence[Phrase], memory: Memory) -> tuple[Phrase, ...]:
    """What the objects of an action stand for; each may stand for one before it ("the big box and the small one")."""
    things: list[Phrase] = []
    for phrase in phrases:
        meant = _meant(phrase, replace(memory, things=tuple(things) or memory.things))
        again = phrase.stands_for_one and bool(things) and meant[0].text == things[-1].text
        things += [] if again else meant
    return tuple(things)


def _meant(phrase: Phrase, memory: Memory) -> Sequence[Phrase]:
    """What a phrase stands for: itself, unless it is "it", "two of them" or "the red one"."""
    if not (phrase.pronoun or phrase.stands_for_one):
        return [phrase]
    if not memory.things:
        raise RefusalError(f"what does {phrase.text!r} stand for?", [phrase.text], question=True)
    if phrase.stands_for_one:
        return [phrase.instead_of_one(memory.things[-1])]
    if phrase.head.word in ("them", "they", "these", "those") and len(memory.gathered) > len(memory.things):
        return memory.gathered
    said = phrase.said_count
    return memory.things if said is None else [thing.with_count(said) for thing in memory.things]


def _place(place: Location | None, memory: Memory) -> Location | None:
    """The place that was meant: "there" is the last one, "her" the last person."""
    phrase = None if place is None else place.phrase
    pronoun = phrase is not None and (phrase.pronoun or phrase.stands_for_one or phrase.stands_for_somebody)
    if place is None or not (place == THERE or pronoun):
        return place
    meant = memory.person if phrase is not None and phrase.stands_for_somebody and memory.person else memory.place
    if phrase is not None and phrase.person:
        return place if memory.person is None else replace(memory.person, preposition=place.preposition)
    if meant is None:
        word = THERE.preposition if phrase is None else phrase.text
        raise RefusalError(f"which place is {word!r}?", [word], question=True)
    return meant if phrase is None or meant.phrase is None else replace(meant, preposition=place.preposition)
