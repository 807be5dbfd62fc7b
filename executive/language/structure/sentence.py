"""Reads a sentence with conditions, loops, waits or speech, and builds the steps of its actions."""

import re
from collections.abc import Sequence
from dataclasses import replace
from itertools import dropwhile
from typing import Final

from pydantic import ValidationError

from executive.language.clauses import CHECKS, Clause, Cue, begins_as, split, trailing_cue
from executive.language.coverage import TOLD, note_adverbs
from executive.language.items import verb, without_objects
from executive.language.nouns import NounKind
from executive.language.pipeline import Pipeline, Trace
from executive.language.questions import RefusalError, RefusalKind
from executive.language.reference import Memory
from executive.language.roles import Location
from executive.language.structure.builder import Builder, is_paced
from executive.language.structure.conditions import REQUESTS, Done, parse_condition, statement_of_check
from executive.language.structure.plain import PlainReader, State, attempt, named, require
from executive.language.structure.speaking import ROOMS, SPEECH, asks, is_clause, say_in_each_room, says
from executive.language.templates import Match, page
from executive.words.command import SPEAKER, START, Command, Task
from executive.words.condition import Look
from executive.words.knowledge import ANYBODY
from executive.words.leaf_steps import Check, Do, Speak, steps_of_commands
from executive.words.step import Step
from executive.words.steps import Ask, Choose, Repeat, Together, Try
from skills.api import ObjectKind
from skills.inputs.errors import listing
from skills.inputs.schema import first_error

_PEOPLE: Final = page("people")
MOST_NESTED: Final = 2
MOST_CLAUSES: Final = 24


def act(row: Builder, clause: Clause) -> None:
    """Adds the steps of a clause with an action, and of the clauses that belong to it; plain words stay pending."""
    text, given = clause.text, row.given
    stated = bool(row.plain) and all(begins_as(one.text, "told_first", "pronoun") for one in row.plain)
    if clause.begins and not stated:  # unless it goes on with "there is a hammer on the bench. bring it"
        row.flush()
        row.begun = len(row.steps)
    if given is not None and row.at == 1 and CHECKS["no_verb"].fullmatch(text):
        clause = replace(clause, lead=without_objects(row.reader.read_items(given)))
    if begins_as(text, "brings", "giving"):
        row.given = text if (behind := trailing_cue(text)) is None else behind.before
    if not any(does(row, clause) for does in _ACTS):
        row.plain.append(clause)


def _skips(row: Builder, clause: Clause) -> bool:
    """Skips "do nothing", and "tell me the result" behind a look, which the robot answers in any case."""
    idle, answered = (CHECKS[intent].fullmatch(clause.text) is not None for intent in ("idle", "answered"))
    if idle or answered:
        row.flush()
    looked = answered and row.asked is not None and row.asked.looked
    row.special = row.special or looked
    return idle or looked


def _requests(row: Builder, clause: Clause) -> bool:
    """Adds the steps of a request for a door, pictures, charging or a wait."""
    done = next(filter(None, (parse(clause.text, row.known, row.reader) for parse in REQUESTS)), None)
    if done is not None:
        row.put(*done)
    return done is not None


def _brings_to_all(row: Builder, clause: Clause) -> bool:
    """Goes on with a delivery to each person of a group. Raises RefusalError when there is only one such object."""
    text, group = clause.text, ROOMS["everyone"].search(clause.text)
    if group is None or ROOMS["gives"].match(text) is None:
        return False
    state = row.known()
    actions = row.reader.read(state, text, upto="understanding", elliptic=True).trace.actions
    goals = ((one.goal, one.goal.phrase.spoken) for one in actions if one.goal and one.goal.phrase)
    found = next(((goal, said) for goal, said in goals if ROOMS["everyone"].fullmatch(said)), None)
    if found is None:
        return False
    people, (_, who) = _people_at(*found, state, row.reader), found
    several = all(phrase.indefinite for action in actions for phrase in action.objects)
    require(several, f"there is only one of it, and I cannot bring it to {who}; name one person", who)
    row.insert(Clause(". ", f"{text[: group.start]}{name}{text[group.end :]}") for name in people)
    row.special = True
    return True


def _people_at(group: Location, who: str, state: State, reader: PlainReader) -> list[str]:
    """People of a group in a room. Raises RefusalError when no room is named, or no known person is there."""
    no_room = f"I bring objects to one person at a time, not to {who}; name one, or a room"
    place = require(group.within.phrase if group.within else None, no_room, who)
    room, knowledge = reader.room(place.spoken, state), reader.knowledge
    people = [name for name, facts in knowledge.people.items() if knowledge.room(facts.at) == room]
    return require(people, f"I know nobody in the {room} to bring anything to: {who}", who)


def _meets_people(row: Builder, clause: Clause) -> bool:
    """Adds a request about people."""
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
    refers = _PEOPLE["refers"].search(row.ahead()) is not None
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
    forms, knowledge = reader.forms("people"), reader.knowledge
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
            return [Command(None, at, None, Task.GREET, ObjectKind(ANYBODY), object_count=count, verb=verb)]
        case task:
            does = Command(goal=goal, task=Task(task), object=ObjectKind(person), verb=verb)
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
    return after.elsewhere if last.task is Task.FOLLOW and last.goal is None else after


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


def _checks(row: Builder, clause: Clause) -> bool:
    """Adds a check that is no plain command: "look whether the door is open", "is the battery low"."""
    text = statement_of_check(clause.text)
    if text is None or trailing_cue(text) is not None:
        return False
    state = row.known()
    plain = attempt(row.reader.read_commands, clause.text, state)
    if not isinstance(plain, RefusalError):
        return False
    supposed = attempt(parse_condition, text, state, row.reader)
    if isinstance(supposed, RefusalError):
        clear = supposed.question is not None or supposed.kind in (RefusalKind.NO_SUCH_DOOR, RefusalKind.UNSEEN)
        raise supposed if clear else plain
    found = supposed.condition
    row.put((Do.from_command(found.command) if isinstance(found, Look) else Check(condition=found),), supposed.holds)
    row.asked = replace(supposed, looked=True)
    return True


def _is_modified(row: Builder, clause: Clause) -> bool:
    """Adds an action that a cue behind it makes conditional or repeats."""
    found = trailing_cue(clause.text)
    if found is None or (found.kind is not Cue.EVERY and ROOMS["every_room"].search(clause.text)):
        return False
    row.modify(clause, found)
    return True


def _searches_rooms(row: Builder, clause: Clause) -> bool:
    """Adds a search of all rooms, or speech in each room behind "go to every room"."""
    looks, ahead = ROOMS["search"].fullmatch(clause.text), row.ahead()
    if ROOMS["goes_everywhere"].fullmatch(clause.text) is not None:
        looks = ROOMS["what_there"].fullmatch(ahead) or ROOMS["search"].fullmatch(ahead)
        says = looks is None and SPEECH["speaks"].match(ahead) is not None and trailing_cue(ahead) is None
        row.at += says or looks is not None
        if says:
            say_in_each_room(row, ahead)
            return True
    if looks is None:
        return False
    what = looks["what"]
    reading = row.reader.read_commands(what, row.known(), (verb("find"),))
    looks_only = all(one.task is Task.FIND for one in reading.commands)
    nowhere = re.search(r"\b(?:in|on|at|near)\b", what) is None
    require(looks_only and nowhere, f"I cannot look for {listing([what])} in every room", what)
    commands = tuple(replace(command, goal=None, goal_at=None) for command in reading.commands)
    row.flush()
    row.add(replace(reading, commands=commands, state=reading.state.elsewhere))
    row.special = True
    return True


_ACTS: Final = (_skips, _meets_people, _requests, asks, says, _checks, _is_modified, _brings_to_all, _searches_rooms)
"""Actions in the order of trying."""


def read_structure(plain: Trace, clauses: Sequence[Clause] | None, pipeline: Pipeline, memory: Memory) -> Trace:
    """Reads a sentence with conditions, loops, waits or speech, given the trace of its plain reading.

    Returns the plain trace for a list of plain commands, and for plain words that are refused. `clauses` are the
    sentence's clauses, if known; `memory` has the referents from earlier sentences.
    """
    decides = True
    try:
        clauses = split(plain.text)[1] if clauses is None else clauses
        decides = any(one.kind is not None or trailing_cue(one.text) is not None for one in clauses)
        if not decides and (plain.refusal is None or plain.refused_at == "cleaning"):
            return plain
        return _structured(plain, clauses, pipeline, memory)
    except RefusalError as refusal:
        return plain if refusal.plain and not decides else replace(plain, refusal=refusal, refused_at="structure")
    except ValidationError as error:
        _, wrong, _ = first_error(error.errors())
        return replace(plain, refusal=RefusalError(f"a number in it {wrong}"), refused_at="structure")


def _structured(plain: Trace, clauses: Sequence[Clause], pipeline: Pipeline, memory: Memory) -> Trace:
    """Reads the structured sentence. Raises RefusalError with the words if any part is uncertain."""
    too_many = f"{len(clauses)} parts are too many for one sentence; say it in {MOST_CLAUSES} at most"
    require(len(clauses) <= MOST_CLAUSES, too_many)
    assert pipeline.knowledge is not None
    reader, begin = PlainReader(pipeline, pipeline.knowledge), State.initial(pipeline.knowledge, memory)
    builder = Builder(reader, act, [*clauses], begin)
    steps, state = builder.build()
    if all(isinstance(step, Do) for step in steps) and not builder.special:
        return plain
    walked = [each for step in steps for each in step.walk()]
    deep = "three conditions or repetitions within each other are too many; say it in two sentences"
    require(max(map(_depth, steps), default=0) <= MOST_NESTED, deep)
    how_often = "how often am I to say it? Say 'every minute', for example"
    require(not any(map(_says_without_end, walked)), how_often, question=True)
    parts = tuple(" | ".join(filter(None, (each.joint.strip(" ,;."), each.cue, each.text))) for each in clauses)
    commands = tuple(command for step in walked for command in step.commands)
    behind = dropwhile(lambda one: str(one.object) != SPEAKER, commands)
    back = [_BACK] if any(one.item is not None and one.goal == START for one in behind) else []
    spoken = [step.speak for step in walked if isinstance(step, Speak)]
    adverbs = note_adverbs(plain.text, [*spoken, *re.findall("'([^']+)'", " ".join(state.notes))])
    notes = state.noting([*filter(None, [adverbs]), *back]).notes
    found = Trace(plain.text, state.memory, opened=plain.opened, tokens=plain.tokens, commands=commands)
    return replace(found, notes=notes, parts=parts, steps=steps)


_BACK: Final = "I bring it to the place where you have spoken to me, not to where you are then"
"""Note when the robot brings an object to the speaker after going elsewhere with the speaker."""


def _says_without_end(step: Step) -> bool:
    """Returns whether a step only speaks again and again, without a pause or number."""
    return isinstance(step, Repeat) and not is_paced(step.loop) and all(isinstance(one, Speak) for one in step.steps)


def _depth(step: Step) -> int:
    """Depth of nested blocks, without counting steps at the end."""
    inner = max(map(_depth, step.inner_steps), default=0)
    return inner + isinstance(step, Choose | Repeat | Try | Together | Ask)
