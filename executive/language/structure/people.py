"""Parses requests about people: to follow, guide, meet and greet them."""

from dataclasses import dataclass, replace
from typing import Final

from executive.language.clauses import trailing_cue
from executive.language.nouns import NounKind
from executive.language.questions import RefusalError
from executive.language.roles import Location
from executive.language.structure.plain import PlainReader, State, names_of_world, phrase_of_name
from executive.language.templates import Match, page
from executive.words.command import SPEAKER, START, Command, Task
from executive.words.knowledge import ANYBODY, Knowledge
from skills.api import ObjectKind
from skills.inputs.errors import listing

_TASKS: Final = {"follow": Task.FOLLOW, "guide": Task.GUIDE, "greet": Task.GREET}
"""Tasks of the intents; the robot goes to the person for the other intents."""
PEOPLE: Final = page("people")


@dataclass(frozen=True)
class PeopleRequest:
    """Request about a person: its intent, and its match with the slots `who` (empty: the speaker), `at` and `to`."""

    form: str
    match: Match

    @property
    def refers(self) -> bool:
        """Returns whether a pronoun refers to the person."""
        return bool(self.match["him"] or self.match["that_person"])


def parse_people(text: str, knowledge: Knowledge) -> PeopleRequest | None:
    """Parses a clause about following, guiding, meeting or greeting people; None for other clauses.

    Raises RefusalError when such a clause does not say clearly whom it means.
    """
    forms = page("people", **names_of_world(knowledge))
    text = text if (around := forms["around"].fullmatch(text)) is None else around["clause"]
    for name in (*_TASKS, "meet", "find", "stated"):
        if (match := forms[name].fullmatch(text)) is not None:
            return PeopleRequest(name, match)
    if forms["certain"].match(text) is None or forms["greets_known"].match(text) is not None:
        return None
    known = f"; known are {listing(knowledge.people)}" if knowledge.people else ""
    hint = f"name one person, or say 'the person in the kitchen'{known}"
    if (cue := trailing_cue(text)) is not None and parse_people(cue.before, knowledge) is not None:
        what, hint = f"I cannot do '{cue.before}' {cue.cue} {cue.text}", "I do it up to a place, or until you say stop"
    elif (unseen := forms["unseen"].search(text)) is not None:
        what = f"I cannot tell people apart by {unseen['by']}, such as '{unseen.text}'"
    elif (crowd := forms["crowd"].search(text)) is not None:
        what = f"I follow and guide one person at a time, not '{crowd.text}'"
    else:
        what = f"I do not understand whom and where '{text}' means"
    raise RefusalError(f"{what}; {hint}", [text])


def commands_on_people(
    request: PeopleRequest, state: State, reader: PlainReader
) -> tuple[tuple[Command, ...], State, tuple[str, ...]]:
    """Builds the commands for a request, with the state after them and notes. Raises RefusalError."""
    person, notes = _person(request, state, reader), tuple[str, ...]()
    said, task, to = request.match.text, _TASKS.get(request.form), request.match["to"]
    found = person == ANYBODY and request.refers and state.memory.person is None and state.memory.place is not None
    where = request.match["at"] or ("there" if found else "")
    at = _place(where, state, reader) if where else None
    goal = _place(to, state, reader) if to else None
    if to.lower() == "home":
        goal, notes = _home(request, person, reader)
    here = state.goal if state.goal is not None and reader.knowledge.place(state.goal) is not None else None
    verb = said.split()[0].lower()
    if request.form == "greet":
        if at is None and here is None:
            raise RefusalError(f"{said}: in which room?", question=True)
        whom, count = ObjectKind(ANYBODY), 0 if person == ANYBODY and not request.match["one"] else 1
        commands = [Command(goal=at or here, task=Task.GREET, object=whom, object_count=count, verb=verb)]
    elif task is None:
        if person == ANYBODY and (at or here) is None:
            raise RefusalError(f"{said}: in which room?", question=True)
        commands = _go_to(person, at or here, verb, state)
    else:
        if task is Task.GUIDE and goal is None:
            raise RefusalError(f"{said}: where to?", question=True)
        if person == SPEAKER and goal == START:
            raise RefusalError(f"{said}: you are here; name another place", [said])
        first = [] if at is None else _go_to(person, at, verb, state)
        commands = [*first, Command(goal=goal, task=task, object=ObjectKind(person), verb=verb)]
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


def _person(request: PeopleRequest, state: State, reader: PlainReader) -> str:
    """Person that a request is about: known, the speaker or anybody. Raises RefusalError for an unclear pronoun."""
    match, before = request.match, state.memory.person
    if not match["who"]:
        if match["at"]:
            raise RefusalError(f"you are not there: '{match.text}'; say only where to", [match["at"]])
        return SPEAKER
    if request.refers and before is not None and request.form != "greet":
        return reader.knowledge.person(before.name) or before.name
    if match["him"] and not state.somebody:
        raise RefusalError(f"who is meant by '{match['who']}' in '{match.text}'?", [match["who"]], question=True)
    return reader.knowledge.person(match["who"]) or ANYBODY


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
        raise RefusalError(f"{request.match.text}: which room is home?", ["home"], question=True)
    room = knowledge.room(knowledge.people[person].at)
    return room, (f"I take {person}'s home to be the {room}",)
