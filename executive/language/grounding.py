"""Names as spoken become names of the world, and what was left open is filled in."""

from __future__ import annotations

from collections.abc import Sequence

from executive.command import Command, Task, Thing
from executive.errors import did_you_mean, listing
from executive.knowledge import Knowledge
from executive.language.drafts import Draft
from executive.language.phrases import Phrase
from executive.language.refusal import RefusalError
from executive.language.roles import HERE, Location

__all__ = ["ground", "known_line"]


def known_line(knowledge: Knowledge | None) -> str:
    """What can be asked for and where one can be sent, in one line."""
    able = "I can fetch, take, put and find things, and go to places"
    if knowledge is None:
        return able
    return f"{able}; known things: {listing(knowledge.thing_names())}; known places: {listing(knowledge.place_names())}"


def ground(drafts: Sequence[Draft], knowledge: Knowledge) -> tuple[Command, ...]:
    """The drafts as commands in the world's own names, with default places where none was said.

    Raises:
        RefusalError: a thing, place or person is unknown, or a place could be several.
    """
    return tuple(_ground(draft, knowledge) for draft in drafts)


def _ground(draft: Draft, knowledge: Knowledge) -> Command:
    item, target = (None if phrase is None else _thing(phrase, knowledge) for phrase in (draft.item, draft.object))
    goal, goal_at = (None, None) if draft.goal is None else _goal(draft.goal, knowledge)
    if goal is None and target is not None and draft.task in (Task.GRASP, Task.FIND):
        goal = knowledge.default_place(draft.task, target.name)
    return Command(
        item=item,
        goal=goal,
        goal_at=goal_at,
        task=draft.task,
        object=target,
        item_count=1 if draft.item is None else draft.item.count,
        object_count=1 if draft.object is None else draft.object.count,
        verb=draft.verb,
    )


def _thing(phrase: Phrase, knowledge: Knowledge) -> Thing:
    """The known thing or category, with the adjectives before it."""
    if phrase.person and knowledge.person(phrase.text):
        raise RefusalError(f"I can look for things, not for people like {phrase.text!r}", [phrase.text])
    *left, head = phrase.tokens
    words = [t for t in left if t.text in phrase.text.split()]
    for first in range(len(words) + 1):
        attributes, name = words[:first], [t.text for t in words[first:]]
        forms = (" ".join([*name, form, *phrase.extra]) for form in (head.text, head.lemma))
        known = next(filter(None, map(knowledge.thing, forms)), None)
        if known and all(t.adjective for t in attributes):
            return Thing(known, tuple(t.word for t in attributes))
    raise _unknown("thing", phrase.text, knowledge.thing_names(), knowledge)


def _unknown(kind: str, name: str, known: Sequence[str], knowledge: Knowledge) -> RefusalError:
    near = did_you_mean(name, knowledge.spellings(known))
    hint = f" (did you mean {near!r}?)" if near else ""
    return RefusalError(f"I know no {kind} {name!r}{hint}; known {kind}s: {listing(known)}", [name])


def _goal(location: Location, knowledge: Knowledge) -> tuple[str, str | None]:
    """The goal, and where it is to be found when it is a person."""
    if location == HERE:
        return HERE.name, None
    person = None if location.phrase is None else knowledge.person(location.phrase.text)
    if person is None:
        return _place(location, knowledge), None
    return person, None if location.within is None else _place(location.within, knowledge)


def _place(location: Location, knowledge: Knowledge) -> str:
    """The known place that the words mean.

    Several surfaces may share a noun ("table"): the larger place around it, where said, tells which one is meant.
    """
    if location.phrase is None:
        raise RefusalError(f"which place is {location.preposition!r}?", [location.preposition], question=True)
    phrase, around = location.phrase, _around(location)
    room = None if around is None else knowledge.place(around)
    if around is not None and room is None:
        raise _unknown("place", around, knowledge.place_names(), knowledge)
    inside = [name for name in _candidates(phrase, knowledge) if room in (None, name, knowledge.room(name))]
    if not inside:
        raise _unknown("place", location.text, knowledge.place_names(), knowledge)
    if len(inside) > 1:
        raise RefusalError(f"which {phrase.text}: {listing(inside, last='or')}?", [phrase.text], question=True)
    return inside[0]


def _around(location: Location) -> str | None:
    """The name of the larger place that was said ("in the kitchen", "of the kitchen")."""
    if location.within is not None:
        return location.within.text
    extra = () if location.phrase is None else location.phrase.extra
    return " ".join(extra[1:]) if extra[:1] == ("of",) else None


def _candidates(phrase: Phrase, knowledge: Knowledge) -> list[str]:
    """The places of that very name, or else all that end with the noun."""
    bare = Phrase(phrase.tokens)
    exact = next(filter(None, map(knowledge.place, (phrase.text, bare.text, bare.singular))), None)
    if exact is not None:
        return [exact]
    return [name for name in knowledge.place_names() if name.split()[-1].lower() == bare.text.lower()]
