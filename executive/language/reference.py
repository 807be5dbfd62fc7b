"""Resolves references: what "it", "one" and "there" mean, and where statements say that objects are."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

from executive.language.actions import Action
from executive.language.lexicon import VerbKind
from executive.language.nouns import NounKind
from executive.language.phrases import Phrase, SpokenRelation
from executive.language.questions import RefusalError
from executive.language.roles import THERE, Location


@dataclass(frozen=True)
class Memory:
    """Latest referents of the conversation: objects, their location, a place, a person.

    `gathered` are all objects named since the last transport; `locations` are where statements say that objects are.
    """

    objects: tuple[Phrase, ...] = ()
    gathered: tuple[Phrase, ...] = ()
    where: Location | None = None
    place: Location | None = None
    person: Location | None = None
    locations: tuple[tuple[Phrase, Location], ...] = ()

    def source(self, action: Action) -> Location | None:
        """Source of an action, or the location that a statement has given for an object with that name."""
        lemma = None if action.target is None or action.kind is VerbKind.GO else action.target.head.lemma
        told = (place for phrase, place in reversed(self.locations) if phrase.head.lemma == lemma)
        return action.source or next(told, None)


@dataclass(frozen=True)
class Resolution:
    """Actions of a sentence with pronouns resolved, the memory afterwards, and each pronoun with its meaning."""

    actions: tuple[Action, ...] = ()
    memory: Memory = field(default_factory=Memory)
    meanings: tuple[tuple[str, str], ...] = ()


def resolve(actions: Sequence[Action], memory: Memory) -> Resolution:
    """Replaces pronouns, so that each action has at most one object; `memory` has the referents from earlier sentences.

    Raises RefusalError when a pronoun refers to no earlier phrase.
    """
    resolved = Resolution(memory=memory)
    for action in actions:
        resolved = _stated(action, resolved) if action.kind is None else _done(action, resolved)
    return resolved


def _done(action: Action, before: Resolution) -> Resolution:
    memory, again = before.memory, any(phrase.pronoun for phrase in action.objects)
    meant = [_as_before(item, before.actions, memory) for item in _all_meant(action.objects, memory)]
    objects = tuple(_named_before(item, action, before.actions) for item in meant)
    goal, source = (_place(place, memory) for place in (action.goal, action.source))
    match action.goal, before.actions:
        case Location(phrase=Phrase(pronoun=True, text=text)), (*_, Action(source=taken)) if again and goal == taken:
            raise RefusalError(f"which place is {text!r}?", [text], question=True)  # put it next to it
    if again or any(phrase.stands_for_one for phrase in action.objects):
        source = source or memory.where
    whole = replace(action, objects=objects, source=source, goal=goal, again=again)
    each = [replace(whole, objects=(item,), again=again or item not in meant) for item in objects] or [whole]
    actions = (*before.actions, *(replace(one, source=memory.source(one)) for one in each))
    return Resolution(actions, _after(whole, memory), (*before.meanings, *_meanings(action, memory)))


def _after(action: Action, memory: Memory) -> Memory:
    """Memory after an action with all its objects."""
    goal, source, objects = action.goal, action.source, action.objects
    return replace(
        memory,
        objects=objects or memory.objects,
        gathered=() if goal is not None else tuple(dict.fromkeys((*memory.gathered, *objects))),
        where=source if action.again or not objects else None,
        place=goal or source or memory.place,
        person=next((place for place in (goal, source) if place is not None and place.living), memory.person),
    )


def _named_before(item: Phrase, action: Action, actions: Sequence[Action]) -> Phrase:
    """Earlier object with the same name, if any: "get the bread, go to the hall and put the bread there"."""
    if item.indefinite or action.source is not None or action.kind not in (VerbKind.PLACE, VerbKind.SINGLE_TRIP):
        return item
    taken = (one.target for one in reversed(actions) if one.target is not None and one.kind is not VerbKind.PLACE)
    return next((target for target in taken if target.text.lower() == item.text.lower()), item)


def _as_before(item: Phrase, actions: Sequence[Action], memory: Memory) -> Phrase:
    """Object with the relations that it had before, or without "other" if a person got one: the robot finds others."""
    plain = replace(item, tokens=tuple(t for t in item.tokens if t.word != "other"))
    given = (one for one in actions if one.for_somebody or (one.kind is VerbKind.ROUND_TRIP and one.goal is None))
    if any(one.target is not None and one.target.text.lower() == plain.text.lower() for one in given):
        return plain
    same = (one for one in memory.objects if one.relations and one.text.lower() == item.text.lower())
    return item if item.indefinite or item.relations else next(same, item)


def _meanings(action: Action, memory: Memory) -> Iterator[tuple[str, str]]:
    """Yields each pronoun in an action with its meaning."""
    for n, phrase in enumerate(action.objects):
        meant = _all_meant(action.objects[: n + 1], memory)[n:]
        if meant != (phrase,):
            yield phrase.text, " and ".join(item.text for item in meant)
    for place in (action.source, action.goal):
        found = _place(place, memory)
        if place is not None and found is not None and found != place:
            yield (THERE.preposition if place.phrase is None else place.phrase.text), found.text


def _stated(action: Action, before: Resolution) -> Resolution:
    """Remembers a statement; "it is in the drawer" gives the place of an object in an earlier action."""
    memory, where = before.memory, _place(action.source, before.memory)
    somebody = any(phrase.stands_for_somebody for phrase in action.objects)
    match memory.person, where:
        case Location() as person, Location() if somebody:
            return _met(replace(person, within=where), before)
    teller = None if action.teller is None else Location(action.teller, within=None if action.objects else where)
    told = replace(memory, where=where, place=where or memory.place, person=teller or memory.person)
    animal = somebody and NounKind.PERSON in [item.kind for item in memory.objects]
    if not animal and not any(phrase.pronoun for phrase in action.objects):
        return replace(before, memory=_remember(action, where, told))
    meant = memory.objects
    actions = [replace(one, source=one.source or where) if one.target in meant else one for one in before.actions]
    return replace(before, actions=tuple(actions), memory=told)


def _met(person: Location, before: Resolution) -> Resolution:
    """Goes to a person where a statement says that they are: "bring it to Robin, he is in the hall"."""
    actions = [replace(one, goal=person) if one.goal == before.memory.person else one for one in before.actions]
    memory = replace(before.memory, person=person, place=person.within)
    return replace(before, actions=tuple(actions), memory=memory)


def _remember(action: Action, where: Location | None, memory: Memory) -> Memory:
    """Memory after a statement on where a person or an object is."""
    people = [phrase for phrase in action.objects if phrase.person]
    if people:
        return replace(memory, person=Location(people[-1], within=where))
    locations = () if where is None else tuple((phrase, where) for phrase in action.objects)
    memory = replace(memory, objects=action.objects or memory.objects, locations=(*memory.locations, *locations))
    called = [phrase for phrase in action.objects if phrase.proper]
    if not called:
        return memory
    *left, head = called[-1].tokens
    named = replace(called[-1], tokens=(*left, replace(head, kind=NounKind.PERSON)))
    return replace(memory, person=Location(named, within=where))


def _all_meant(phrases: Sequence[Phrase], memory: Memory) -> tuple[Phrase, ...]:
    """Meanings of all objects in an action; each may refer to an earlier object ("the big box and the small one")."""
    objects: list[Phrase] = []
    for phrase in phrases:
        meant = _meant(phrase, replace(memory, objects=tuple(objects) or memory.objects))
        again = phrase.stands_for_one and bool(objects) and meant[0].text == objects[-1].text
        objects += [] if again else meant
    return tuple(objects)


def _meant(phrase: Phrase, memory: Memory) -> Sequence[Phrase]:
    """Meaning of a phrase: the phrase itself, or what "it", "two of them" or "the red one" refers to."""
    if not (phrase.pronoun or phrase.stands_for_one):
        return [phrase]
    if not memory.objects:
        raise RefusalError(f"what does {phrase.text!r} stand for?", [phrase.text], question=True)
    if phrase.stands_for_one:
        return [phrase.replace_one(memory.objects[-1])]
    if phrase.head.word in ("them", "they", "these", "those") and len(memory.gathered) > len(memory.objects):
        return memory.gathered
    said = phrase.said_count
    return memory.objects if said is None else [replace(item, numbered=said) for item in memory.objects]


def _place(place: Location | None, memory: Memory) -> Location | None:
    """Meaning of a place: "there" refers to the last place, "her" to the last person."""
    meant, said, spot = memory.place, THERE.preposition, tuple[SpokenRelation, ...]()
    match place:
        case Location(phrase=Phrase(pronoun=False, stands_for_one=False, stands_for_somebody=False)):
            return place
        case Location(phrase=Phrase(person=True)):
            within = place.within or (None if memory.person is None else memory.person.within)
            return replace(memory.person or place, preposition=place.preposition, within=within)
        case Location(phrase=Phrase(text=said, relations=spot, stands_for_somebody=somebody)):
            meant = (memory.person if somebody else None) or meant
        case _ if place != THERE:
            return place
    match meant:
        case None | Location(phrase=None) | Location(living=True) if spot:
            raise RefusalError(f"on which surface is '{spot[0].said}'?", question=True)
        case None:
            raise RefusalError(f"which place is {said!r}?", [said], question=True)
        case Location(phrase=Phrase() as known) if place != THERE:
            return replace(meant, phrase=replace(known, relations=spot), preposition=place.preposition)
    return meant
