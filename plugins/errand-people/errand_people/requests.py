"""Requests about people: to follow, guide, meet, greet or ask them."""

import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final

from errand_people.asking import asks_somebody
from errand_people.tasks import Greet
from executive.language.clauses import Clause, Cue, trailing_cue
from executive.language.coverage import TOLD
from executive.language.nouns import NounKind
from executive.language.questions import RefusalError, RefusalKind
from executive.language.structure.builder import Builder
from executive.language.structure.conditions import Done
from executive.language.structure.plain import PlainReader, State, attempt, named, require
from executive.language.structure.speaking import cue_behind_speech, goes_to_listener, is_clause
from executive.language.templates import Match
from executive.words.command import SPEAKER, START, Command
from executive.words.knowledge import ANYBODY
from executive.words.leaf_steps import Speak, steps_of_commands
from executive.words.task import task_named
from skills.api import ObjectKind
from skills.inputs.errors import listing

_TABLE: Final = Path(__file__).with_name("people.yaml")


def about_people(row: Builder, clause: Clause) -> bool:
    """Adds a request about people."""
    return any(does(row, clause) for does in (_meets, _greets, asks_somebody))


def _greets(row: Builder, clause: Clause) -> bool:
    """Adds a greeting of a known person, or the robot's introduction, behind the drive to the listener."""
    text, forms = clause.text, row.reader.forms("people", _TABLE)
    if (said := forms["salutes"].match(text)) is None:
        return False
    if (found := cue_behind_speech(text)) is not None:
        row.modify(clause, found)
        return True
    listener = said if said["alone"] else row.reader.forms("speech")["who"].fullmatch(said.rest)
    if listener is None:
        return False
    row.flush()
    goes_to_listener(row, listener)
    row.put((Speak(speak=said["text"]),), row.state)
    return True


def _meets(row: Builder, clause: Clause) -> bool:
    """Adds a request to follow, guide, meet or greet people."""
    found = trailing_cue(clause.text)
    if found is not None and found.kind in (Cue.WHILE, Cue.UNTIL):
        found = None  # how long the robot follows
    request = _parse_people(clause.text if found is None else found.before, row.reader)
    if request is None or not _asks_alone(request, row):
        return False
    if found is not None:
        row.modify(clause, found)
        return True
    _flush_reasons(row)
    row.put(*_steps_on_people(request, row.state, row.reader))
    return True


def _asks_alone(request: Match, row: Builder) -> bool:
    """Returns whether a form is a request; finding somebody is one only before another about the same person."""
    refers = row.reader.forms("people", _TABLE)["refers"].search(row.ahead()) is not None
    match request["form"]:
        case "find":
            return refers or (row.special and _refers_to_person(request))
        case "stated":
            return refers and _parse_people(row.ahead(), row.reader) is not None
        case _:
            return True


def _flush_reasons(row: Builder) -> None:
    """Understands the pending clauses; skips a mere reason ("Robin is lost"), which is no request."""
    refusal = attempt(row.flush)
    if not isinstance(refusal, RefusalError):
        return
    reasons = " ".join(clause.text for clause in row.plain)
    if refusal.kind is not RefusalKind.NOTHING_TO_DO or not is_clause(reasons, row.reader.pipeline.parser):
        refusal.plain = False
        raise refusal
    row.plain, row.state = [], row.state.noting([TOLD.format(repr(reasons))])
    people = [name for name in row.reader.knowledge.people if re.search(rf"\b{re.escape(name)}\b", reasons)]
    if len(people) == 1:
        row.state = row.state.recalling(person=named(people[0]))


def _parse_people(text: str, reader: PlainReader) -> Match | None:
    """Parses a clause about following, guiding, meeting or greeting people; None for other clauses.

    The match has the `task`, the person `who` (empty: the speaker), and the places `at` and `to`; its `form` is "find"
    or "stated" if it asks for nothing alone. Raises RefusalError when it is not clear whom the clause means.
    """
    forms, knowledge = reader.forms("people", _TABLE), reader.knowledge
    text = text if (around := forms["around"].fullmatch(text)) is None else around["clause"]
    match = forms["request"].fullmatch(text)
    if match is not None or forms["certain"].match(text) is None or forms["greets_known"].match(text) is not None:
        return match
    known = f"; known are {listing(knowledge.people)}" if knowledge.people else ""
    hint = f"name one person, or say 'the person in the kitchen'{known}"
    if (cue := trailing_cue(text)) is not None and _parse_people(cue.before, reader) is not None:
        what, hint = f"I cannot do '{cue.before}' {cue.cue} {cue.text}", "I do it up to a place, or until you say stop"
    elif (unseen := forms["unseen"].search(text)) is not None:
        what = f"I cannot tell people apart by {unseen['by']}, such as '{unseen.text}'"
    elif (crowd := forms["crowd"].search(text)) is not None:
        what = f"I follow and guide one person at a time, not '{crowd.text}'"
    else:
        what = f"I do not understand whom and where '{text}' means"
    raise RefusalError(f"{what}; {hint}", [text])


def _refers_to_person(match: Match) -> bool:
    """Returns whether a pronoun refers to the person of a request."""
    return bool(match["him"] or match["that_person"])


def _steps_on_people(request: Match, state: State, reader: PlainReader) -> Done:
    """Builds the steps for a request, with the state after them. Raises RefusalError."""
    person, said, task = _person(request, state, reader), request.text, request["task"]
    spoken_of = person == ANYBODY and _refers_to_person(request) and state.memory.person is None
    at = _place(request["at"] or ("there" if spoken_of and state.memory.place else ""), state, reader)
    goal, state = _goal(request, person, state, reader)
    if task in ("greet", "") and at is None and reader.is_place(state.goal):
        at = state.goal
    greets_there = task == "greet" or (not task and person == ANYBODY)
    require(at or not greets_there, f"{said}: in which room?", question=True)
    require(goal or task != "guide", f"{said}: where to?", question=True)
    require(person != SPEAKER or goal != START, f"{said}: you are here; name another place", said)
    commands = _commands_on(request, person, at, goal, state)
    return steps_of_commands(commands), _state_behind(commands, person, state, reader)


def _commands_on(request: Match, person: str, at: str | None, goal: str | None, state: State) -> list[Command]:
    """Commands of a request about a person; for anybody the robot only goes to the place, unless it is there."""
    verb, anybody = request.text.split()[0].lower(), person == ANYBODY
    meets = Command(goal=at, verb=verb) if anybody else Command(goal=person, goal_at=at, verb=verb)
    first = [] if anybody and at == state.goal else [meets]
    match request["task"]:
        case "":
            return first
        case "greet":
            count = 0 if anybody and not request["one"] else 1
            return [Command(None, at, None, task_named(Greet.word), ObjectKind(ANYBODY), object_count=count, verb=verb)]
        case task:
            does = Command(goal=goal, task=task_named(task), object=ObjectKind(person), verb=verb)
            return [does] if at is None else [*first, does]


def _goal(request: Match, person: str, state: State, reader: PlainReader) -> tuple[str | None, State]:
    """Goal of a request, and the state with a note on whose home it is. Raises RefusalError for an unknown home."""
    goal, knowledge = _place(request["to"], state, reader), reader.knowledge
    if request["to"].lower() != "home" or goal is not None:
        return goal, state
    facts = require(knowledge.people.get(person), f"{request.text}: which room is home?", "home", question=True)
    home = knowledge.room(facts.at)
    return home, state.noting([f"I take {person}'s home to be the {home}"])


def _state_behind(commands: Sequence[Command], person: str, state: State, reader: PlainReader) -> State:
    """State after a request about a person, whom the robot may have followed anywhere."""
    last, memory = commands[-1] if commands else Command(), replace(state.memory, person=named(person))
    if last.goal is not None and reader.is_place(last.goal):
        memory = replace(memory, place=named(last.goal, NounKind.PLACE))
    after = reader.state_after(commands, memory, state)
    return after.elsewhere if last.task is not None and last.task.moves and last.goal is None else after


def _person(match: Match, state: State, reader: PlainReader) -> str:
    """Person that a request is about: known, the speaker or anybody. Raises RefusalError for an unclear pronoun."""
    before, who, said = state.memory.person, match["who"], match.text
    if not who:
        require(not match["at"], f"you are not there: '{said}'; say only where to", match["at"])
        return SPEAKER
    if _refers_to_person(match) and before is not None and match["task"] != "greet":
        return reader.knowledge.person(before.name) or before.name
    require(not match["him"] or state.somebody, f"who is meant by '{who}' in '{said}'?", who, question=True)
    return reader.knowledge.person(who) or ANYBODY


def _place(text: str, state: State, reader: PlainReader) -> str | None:
    """World's name for a place in words; None without words, and for "home" where no place is called so."""
    if text.lower() in ("", "home"):
        return reader.knowledge.place(text)
    return START if text.lower() in ("here", "back") else reader.place(text, state)
