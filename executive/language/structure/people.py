"""Parses requests about people: to follow, guide, meet and greet them."""

import re
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Final

from executive.language.clauses import trailing_cue
from executive.language.lexicon import Patterns, any_of
from executive.language.nouns import NounKind
from executive.language.questions import RefusalError
from executive.language.roles import Location
from executive.language.structure.plain import PlainReader, State, phrase_of_name
from executive.words.command import SPEAKER, START, Command, Task
from executive.words.knowledge import ANYBODY, Knowledge
from skills.api import ObjectKind
from skills.inputs.errors import listing

_PEOPLE: Final = Patterns("structures.yaml", "people")
_TASKS: Final = {
    "follow": Task.FOLLOW,
    "guide": Task.GUIDE,
    "greet": Task.GREET,
    "meet": None,
    "find": None,
    "stated": None,
}


@dataclass(frozen=True)
class PeopleRequest:
    """Request about a person: the task (None: go to the person), and person, place and destination in words.

    `form` is the group of patterns that matched.
    """

    form: str
    said: str
    who: str
    at: str | None
    to: str | None

    @property
    def task(self) -> Task | None:
        """Task that the command gets."""
        return _TASKS[self.form]

    @property
    def refers(self) -> bool:
        """Returns whether a pronoun refers to the person."""
        return self.who.lower() in _PRONOUNS


def parse_people(text: str, knowledge: Knowledge) -> PeopleRequest | None:
    """Parses a clause about following, guiding, meeting or greeting people; None for other clauses.

    Raises RefusalError when such a clause does not say clearly whom it means.
    """
    text = _AROUND.sub("", text)
    forms = _of_world(tuple(knowledge.spellings(knowledge.people)), tuple(knowledge.spellings(knowledge.place_names())))
    if forms.begins.match(text) is None:
        return None
    for name in _TASKS:
        for form in forms.each(name):
            if (match := form.fullmatch(text)) is not None:
                found = {key: value for key, value in match.groupdict().items() if value}
                return PeopleRequest(name, text, found.get("who", "me"), found.get("at"), found.get("to"))
    if forms.certain.match(text) is None:
        return None
    known = f"; known are {listing(knowledge.people)}" if knowledge.people else ""
    hint = f"name one person, or say 'the person in the kitchen'{known}"
    if (cue := trailing_cue(text)) is not None and parse_people(cue.before, knowledge) is not None:
        what, hint = f"I cannot do '{cue.before}' {cue.cue} {cue.text}", "I do it up to a place, or until you say stop"
    elif (word := forms.unseen.search(text)) is not None:
        what = f"I cannot tell people apart by {(word.lastgroup or '').replace('_', ' ')}, such as '{word[0]}'"
    elif (word := forms.crowd.search(text)) is not None:
        what = f"I follow and guide one person at a time, not '{word[0]}'"
    else:
        what = f"I do not understand whom and where '{text}' means"
    raise RefusalError(f"{what}; {hint}", [text])


_AROUND: Final = re.compile(
    r"^(?:just|simply|kindly|now|then|also)\s+|,\s*(?:thanks|thank you)$|[,\s]+(?:please|now|then|too|also|as well)$",
    re.IGNORECASE,
)


def refers_to_somebody(text: str) -> bool:
    """Returns whether a clause contains "him", "her" or "them"."""
    return _PEOPLE.refers.search(text) is not None


@lru_cache(maxsize=16)
def _of_world(people: tuple[str, ...], places: tuple[str, ...]) -> Patterns:
    return _PEOPLE.with_words(names=any_of(people) or "(?!)", around=any_of(places) or "(?!)")


def commands_on_people(
    request: PeopleRequest, state: State, reader: PlainReader
) -> tuple[tuple[Command, ...], State, tuple[str, ...]]:
    """Builds the commands for a request, with the state after them and notes. Raises RefusalError."""
    person, notes = _person(request, state, reader), tuple[str, ...]()
    found = person == ANYBODY and request.refers and state.memory.person is None and state.memory.place is not None
    where = "there" if found and request.at is None else request.at
    at = None if where is None else _place(where, state, reader)
    goal = None if request.to is None else _place(request.to, state, reader)
    if request.to is not None and request.to.lower() == "home":
        goal, notes = _home(request, person, reader)
    here = state.goal if state.goal is not None and reader.knowledge.place(state.goal) is not None else None
    verb = request.said.split()[0].lower()
    if request.form == "greet":
        if at is None and here is None:
            raise RefusalError(f"{request.said}: in which room?", question=True)
        several = person == ANYBODY and request.who.lower() not in _ONE
        whom, count = ObjectKind(ANYBODY), 0 if several else 1
        commands = [Command(goal=at or here, task=Task.GREET, object=whom, object_count=count, verb=verb)]
    elif request.task is None:
        if person == ANYBODY and (at or here) is None:
            raise RefusalError(f"{request.said}: in which room?", question=True)
        commands = _go_to(person, at or here, verb, state)
    else:
        if request.task is Task.GUIDE and goal is None:
            raise RefusalError(f"{request.said}: where to?", question=True)
        if person == SPEAKER and goal == START:
            raise RefusalError(f"{request.said}: you are here; name another place", [request.said])
        first = [] if at is None else _go_to(person, at, verb, state)
        commands = [*first, Command(goal=goal, task=request.task, object=ObjectKind(person), verb=verb)]
    memory = replace(state.memory, person=Location(phrase_of_name(person, NounKind.PERSON), "to"))
    last = commands[-1] if commands else Command()
    if last.goal is not None and reader.knowledge.place(last.goal) is not None:
        memory = replace(memory, place=Location(phrase_of_name(last.goal, NounKind.PLACE), "in"))
    after = reader.state_after(tuple(commands), memory, state)
    gone = last.task is Task.FOLLOW and last.goal is None
    return tuple(commands), replace(after, goal=None, at=None) if gone else after, notes


def _go_to(person: str, at: str | None, verb: str, state: State) -> list[Command]:
    """Goes to a known person at a place; for anybody only to the place, unless the robot is there already."""
    if person != ANYBODY:
        return [Command(goal=person, goal_at=at, verb=verb)]
    return [] if at == state.goal else [Command(goal=at, verb=verb)]


_ONE: Final = frozenset(
    {
        "somebody",
        "someone",
        *(f"{word} {kind}" for word in ("a", "the", "this", "that") for kind in ("person", "guest", "visitor")),
    }
)
_SPEAKERS: Final = frozenset({"me", "us"})
_PRONOUNS: Final = frozenset({"him", "her", "them", "he", "she", "they", "this person", "that person", "the person"})


def _person(request: PeopleRequest, state: State, reader: PlainReader) -> str:
    """Person that a request is about: known, the speaker or anybody. Raises RefusalError for an unclear pronoun."""
    who, before = request.who.lower(), state.memory.person
    if who in _SPEAKERS:
        if request.at is not None:
            raise RefusalError(f"you are not there: '{request.said}'; say only where to", [request.at])
        return SPEAKER
    if who in _PRONOUNS and before is not None and request.form != "greet":
        return reader.knowledge.person(before.name) or before.name
    if who in _PRONOUNS - _ONE and not state.somebody:
        raise RefusalError(f"who is meant by '{request.who}' in '{request.said}'?", [request.who], question=True)
    return reader.knowledge.person(request.who) or ANYBODY


def _place(text: str, state: State, reader: PlainReader) -> str | None:
    """World's name for a place in words; None for "home". Raises RefusalError when it is no place."""
    if text.lower() == "home" and reader.knowledge.place(text) is None:
        return None
    if text.lower() in ("here", "back"):
        return START
    first, *more = reader.go_to(text, state).commands
    if more or first.goal is None or reader.knowledge.place(first.goal) is None:
        raise RefusalError(f"'{text}' is no place", [text])
    return first.goal


def _home(request: PeopleRequest, person: str, reader: PlainReader) -> tuple[str, tuple[str, ...]]:
    """Room where a person usually is, and a note. Raises RefusalError when that room is unknown."""
    knowledge = reader.knowledge
    if (place := knowledge.place("home")) is not None:
        return place, ()
    if person not in knowledge.people:
        raise RefusalError(f"{request.said}: which room is home?", ["home"], question=True)
    room = knowledge.room(knowledge.people[person].at)
    return room, (f"I take {person}'s home to be the {room}",)
