"""Resolves references: what "it", "one" and "there" mean, and where statements say that objects are."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

from executive.language.actions import Action
from executive.language.lexicon import VerbKind
from executive.language.nouns import NounKind
from executive.language.phrases import Phrase
from executive.language.questions import RefusalError
from executive.language.roles import HERE, THERE, Location


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

    def where_is(self, item: Phrase) -> Location | None:
        """Location that a statement has given for an object with that name."""
        return next((place for phrase, place in reversed(self.locations) if phrase.head.lemma == item.head.lemma), None)


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
    memory = before.memory
    again = any(phrase.pronoun for phrase in action.objects)
    meant = _all_meant(action.objects, memory)
    meant = tuple(_as_before(item, before.actions, memory) for item in meant)
    objects = tuple(_named_before(item, action, before.actions) or item for item in meant)
    goal, source = (_place(place, memory) for place in (action.goal, action.source))
    to = None if action.goal is None else action.goal.phrase
    taken = before.actions[-1].source if before.actions else None
    if again and to is not None and to.pronoun and goal is not None and goal == taken:  # put it next to it
        raise RefusalError(f"which place is {to.text!r}?", [to.text], question=True)
    refers = again or any(phrase.stands_for_one for phrase in action.objects)
    source = source or (memory.where if refers else None)
    person = next((place for place in (goal, source) if place is not None and place.living), memory.person)
    after = Memory(
        objects=objects or memory.objects,
        gathered=() if goal is not None else tuple(dict.fromkeys((*memory.gathered, *objects))),
        where=source if again or not objects else None,
        place=goal or source or memory.place,
        person=person,
        locations=memory.locations,
    )
    bare = replace(action, objects=(), source=source, goal=goal, again=again)
    each = tuple(
        replace(
            bare,
            objects=(item,),
            source=source or (memory.where_is(item) if action.kind is not VerbKind.GO else None),
            again=again or item not in meant,
        )
        for item in objects
    )
    return Resolution(
        (*before.actions, *(each if objects else (bare,))), after, (*before.meanings, *_meanings(action, memory))
    )


def _named_before(item: Phrase, action: Action, actions: Sequence[Action]) -> Phrase | None:
    """Earlier object with the same name: "get the bread, go to the hall and put the bread there"."""
    if item.indefinite or action.source is not None or action.kind not in (VerbKind.PLACE, VerbKind.SINGLE_TRIP):
        return None
    taken = (one.target for one in reversed(actions) if one.target is not None and one.kind is not VerbKind.PLACE)
    return next((target for target in taken if target.text.lower() == item.text.lower()), None)


def _as_before(item: Phrase, actions: Sequence[Action], memory: Memory) -> Phrase:
    """Object with the relations that it had before, or without "other" if a person got one: the robot finds others."""
    plain = replace(item, tokens=tuple(t for t in item.tokens if t.word != "other"))
    given = (one for one in actions if one.goal == HERE or (one.goal and one.goal.living))
    back = (one for one in actions if one.kind is VerbKind.ROUND_TRIP and one.goal is None)
    if any(one.target is not None and one.target.text.lower() == plain.text.lower() for one in (*given, *back)):
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
    memory = before.memory
    where = _place(action.source, memory)
    somebody = any(phrase.stands_for_somebody for phrase in action.objects)
    if where is not None and somebody and memory.person:  # bring it to Robin, he is in the hall
        met = replace(memory.person, within=where)
        actions = tuple(replace(one, goal=met) if one.goal == memory.person else one for one in before.actions)
        return replace(before, actions=actions, memory=replace(memory, person=met, place=where))
    teller = None if action.teller is None else Location(action.teller, within=None if action.objects else where)
    memory = replace(memory, where=where, place=where or memory.place, person=teller or memory.person)
    animal = somebody and any(item.kind is NounKind.PERSON for item in memory.objects)
    if not animal and not any(phrase.pronoun for phrase in action.objects):
        return replace(before, memory=_remember(action, where, memory))
    placed = tuple(
        replace(one, source=where) if one.target in memory.objects and one.source is None else one
        for one in before.actions
    )
    return replace(before, actions=placed, memory=memory)


def _remember(action: Action, where: Location | None, memory: Memory) -> Memory:
    """Memory after a statement on where a person or an object is."""
    people = [phrase for phrase in action.objects if phrase.person]
    if people:
        return replace(memory, person=Location(people[-1], within=where))
    locations = () if where is None else tuple((phrase, where) for phrase in action.objects)
    called = [phrase for phrase in action.objects if phrase.proper]
    person = memory.person
    if called:
        *left, head = called[-1].tokens
        named = replace(called[-1], tokens=(*left, replace(head, kind=NounKind.PERSON)))
        person = Location(named, within=where)
    return replace(
        memory, person=person, objects=action.objects or memory.objects, locations=(*memory.locations, *locations)
    )


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
    phrase = None if place is None else place.phrase
    pronoun = phrase is not None and (phrase.pronoun or phrase.stands_for_one or phrase.stands_for_somebody)
    if place is None or not (place == THERE or pronoun):
        return place
    meant = memory.person if phrase is not None and phrase.stands_for_somebody and memory.person else memory.place
    if phrase is not None and phrase.person:
        within = place.within or (None if memory.person is None else memory.person.within)
        return replace(memory.person or place, preposition=place.preposition, within=within)
    spot = () if phrase is None else phrase.relations
    if spot and (meant is None or meant.phrase is None or meant.living):
        raise RefusalError(f"on which surface is '{spot[0].said}'?", question=True)
    if meant is None:
        word = THERE.preposition if phrase is None else phrase.text
        raise RefusalError(f"which place is {word!r}?", [word], question=True)
    if phrase is None or meant.phrase is None:
        return meant
    return replace(meant, phrase=replace(meant.phrase, relations=spot), preposition=place.preposition)
