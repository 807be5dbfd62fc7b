"""Reads a sentence with conditions, loops, waits or speech, and builds the steps of its actions."""

import re
from collections.abc import Sequence
from dataclasses import replace
from typing import Final

from pydantic import ValidationError

from executive.language.amounts import parse_seconds
from executive.language.clauses import CHECKS, Clause, Cue, split, trailing_cue
from executive.language.coverage import TOLD, note_adverbs
from executive.language.items import verb, without_objects
from executive.language.nouns import NounKind
from executive.language.pipeline import Pipeline, Trace
from executive.language.questions import RefusalError, RefusalKind
from executive.language.reference import Memory
from executive.language.roles import Location
from executive.language.structure.builder import Builder
from executive.language.structure.conditions import REQUESTS, Done, parse_condition, statement_of_check
from executive.language.structure.plain import PlainReader, State, attempt, names_of_world, person_named, phrase_of_name
from executive.language.structure.speaking import ROOMS, SPEECH, asks, is_clause, say_in_each_room, says
from executive.language.templates import Match, page
from executive.words.command import SPEAKER, START, Command, Task
from executive.words.condition import Look
from executive.words.knowledge import ANYBODY, Knowledge
from executive.words.leaf_steps import Awaited, Check, Do, Speak, Wait, steps_of_commands
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
    stated = bool(row.plain) and all(
        CHECKS["told_first"].match(one.text) or CHECKS["pronoun"].match(one.text) for one in row.plain
    )
    if clause.begins and not stated:  # unless it goes on with "there is a hammer on the bench. bring it"
        row.flush()
        row.begun = len(row.steps)
    if given is not None and row.at == 1 and CHECKS["no_verb"].fullmatch(text):
        clause = replace(clause, lead=without_objects(row.reader.read_items(given)))
    if CHECKS["brings"].match(text) is not None or CHECKS["giving"].match(text) is not None:
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


def _brings_to_everyone(row: Builder, clause: Clause) -> bool:
    """Goes on with a delivery to each person of a group.

    Raises RefusalError when no room is named, no known person is there, or there is only one such object.
    """
    text, group = clause.text, ROOMS["everyone"].search(clause.text)
    if group is None or ROOMS["gives"].match(text) is None:
        return False
    state, knowledge = row.known(), row.reader.knowledge
    actions = row.reader.read(state, text, upto="understanding", elliptic=True).trace.actions
    goals = ((one.goal, one.goal.phrase.spoken) for one in actions if one.goal and one.goal.phrase)
    to, who = next(((goal, said) for goal, said in goals if ROOMS["everyone"].fullmatch(said)), (None, ""))
    if to is None:
        return False
    if (place := to.within) is None or place.phrase is None:
        raise RefusalError(f"I bring objects to one person at a time, not to {who}; name one, or a room", [who])
    room = row.reader.room(place.phrase.spoken, state)
    people = [name for name, facts in knowledge.people.items() if knowledge.room(facts.at) == room]
    if not people:
        raise RefusalError(f"I know nobody in the {room} to bring anything to: {who}", [who])
    if any(not phrase.indefinite for action in actions for phrase in action.objects):
        raise RefusalError(f"there is only one of it, and I cannot bring it to {who}; name one person", [who])
    each = [f"{text[: group.start]}{name}{text[group.end :]}" for name in people]
    row.clauses[row.at : row.at] = [Clause(". ", said) for said in each]
    row.special = True
    return True


def _meets_people(row: Builder, clause: Clause) -> bool:
    """Adds a request about people; finding somebody counts only before another request about the same person."""
    knowledge, found, then = row.reader.knowledge, trailing_cue(clause.text), row.ahead()
    timed = _PEOPLE["timed"].fullmatch(clause.text)
    seconds = None if timed is None else parse_seconds(timed["span"])
    if found is not None and found.kind in (Cue.WHILE, Cue.UNTIL):
        found = None  # how long the robot follows
    text = clause.text if timed is None or seconds is None else timed["clause"]
    request = _parse_people(text if found is None else found.before, knowledge)
    if request is None:
        return False
    refers = _PEOPLE["refers"].search(then) is not None
    if request["form"] == "find" and not (refers or (row.special and _refers_to_person(request))):
        return False
    if request["form"] == "stated" and not (refers and _parse_people(then, knowledge)):
        return False
    if found is not None:
        row.modify(clause, found)
    else:
        _flush_reasons(row)
        steps, state = _steps_on_people(request, row.state, row.reader)
        if seconds is not None and request["task"] == Task.FOLLOW.value:
            wait = Wait(awaited=Awaited(seconds=seconds))
            steps = (*steps[:-1], Together(steps=(steps[-1], wait), done_when="any"))
        elif seconds is not None:
            raise RefusalError(f"I do not do '{clause.text}' for a time", [clause.text])
        row.put(steps, state)
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
    named = [name for name in row.reader.knowledge.people if re.search(rf"\b{re.escape(name)}\b", reasons)]
    if len(named) == 1:
        row.state = replace(row.state, memory=replace(row.state.memory, person=person_named(named[0])))


def _parse_people(text: str, knowledge: Knowledge) -> Match | None:
    """Parses a clause about following, guiding, meeting or greeting people; None for other clauses.

    The match has the `task`, the person `who` (empty: the speaker), and the places `at` and `to`; its `form` is "find"
    or "stated" if it asks for nothing alone. Raises RefusalError when it is not clear whom the clause means.
    """
    forms = page("people", **names_of_world(knowledge))
    text = text if (around := forms["around"].fullmatch(text)) is None else around["clause"]
    match = forms["request"].fullmatch(text)
    if match is not None or forms["certain"].match(text) is None or forms["greets_known"].match(text) is not None:
        return match
    known = f"; known are {listing(knowledge.people)}" if knowledge.people else ""
    hint = f"name one person, or say 'the person in the kitchen'{known}"
    if (cue := trailing_cue(text)) is not None and _parse_people(cue.before, knowledge) is not None:
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


def _steps_on_people(match: Match, state: State, reader: PlainReader) -> Done:
    """Builds the steps for a request, with the state after them. Raises RefusalError."""
    person, knowledge, refers = _person(match, state, reader), reader.knowledge, _refers_to_person(match)
    said, task, to, where = match.text, Task(match["task"]) if match["task"] else None, match["to"], match["at"]
    if not where and person == ANYBODY and refers and state.memory.person is None and state.memory.place:
        where = "there"
    at, goal = (_place(text, state, reader) if text else None for text in (where, to))
    if to.lower() == "home" and goal is None:
        if person not in knowledge.people:
            raise RefusalError(f"{said}: which room is home?", ["home"], question=True)
        goal = knowledge.room(knowledge.people[person].at)
        state = state.noting([f"I take {person}'s home to be the {goal}"])
    here = state.goal if state.goal is not None and knowledge.place(state.goal) is not None else None
    verb = said.split()[0].lower()
    if (at or here) is None and (task is Task.GREET or (task is None and person == ANYBODY)):
        raise RefusalError(f"{said}: in which room?", question=True)
    if task is Task.GUIDE and goal is None:
        raise RefusalError(f"{said}: where to?", question=True)
    if person == SPEAKER and goal == START:
        raise RefusalError(f"{said}: you are here; name another place", [said])
    if task is Task.GREET:
        count = 0 if person == ANYBODY and not match["one"] else 1
        commands = [Command(goal=at or here, task=task, object=ObjectKind(ANYBODY), object_count=count, verb=verb)]
    elif task is None:
        commands = _go_to(person, at or here, verb, state)
    else:
        first = [] if at is None else _go_to(person, at, verb, state)
        commands = [*first, Command(goal=goal, task=task, object=ObjectKind(person), verb=verb)]
    memory = replace(state.memory, person=person_named(person))
    last = commands[-1] if commands else Command()
    if last.goal is not None and knowledge.place(last.goal) is not None:
        memory = replace(memory, place=Location(phrase_of_name(last.goal, NounKind.PLACE), "in"))
    after = reader.state_after(commands, memory, state)
    gone = last.task is Task.FOLLOW and last.goal is None
    return steps_of_commands(commands), after.elsewhere if gone else after


def _go_to(person: str, at: str | None, verb: str, state: State) -> list[Command]:
    """Goes to a known person at a place; for anybody only to the place, unless the robot is there already."""
    if person != ANYBODY:
        return [Command(goal=person, goal_at=at, verb=verb)]
    return [] if at == state.goal else [Command(goal=at, verb=verb)]


def _person(match: Match, state: State, reader: PlainReader) -> str:
    """Person that a request is about: known, the speaker or anybody. Raises RefusalError for an unclear pronoun."""
    before = state.memory.person
    if not match["who"]:
        if match["at"]:
            raise RefusalError(f"you are not there: '{match.text}'; say only where to", [match["at"]])
        return SPEAKER
    if _refers_to_person(match) and before is not None and match["task"] != "greet":
        return reader.knowledge.person(before.name) or before.name
    if match["him"] and not state.somebody:
        raise RefusalError(f"who is meant by '{match['who']}' in '{match.text}'?", [match["who"]], question=True)
    return reader.knowledge.person(match["who"]) or ANYBODY


def _place(text: str, state: State, reader: PlainReader) -> str | None:
    """World's name for a place in words; None for "home" where no place is called so. Raises RefusalError."""
    if text.lower() == "home":
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
    modified = found is not None and (found.kind is Cue.EVERY or not ROOMS["every_room"].search(clause.text))
    if found is not None and modified:
        row.modify(clause, found)
    return modified


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
    if any(one.task is not Task.FIND for one in reading.commands) or re.search(r"\b(?:in|on|at|near)\b", what):
        raise RefusalError(f"I cannot look for {listing([what])} in every room", [what])
    commands = tuple(replace(command, goal=None, goal_at=None) for command in reading.commands)
    row.flush()
    row.add(replace(reading, commands=commands, state=reading.state.elsewhere))
    row.special = True
    return True


_ACTS: Final = (
    _skips,
    _meets_people,
    _requests,
    asks,
    says,
    _checks,
    _is_modified,
    _brings_to_everyone,
    _searches_rooms,
)
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
    if len(clauses) > MOST_CLAUSES:
        raise RefusalError(f"{len(clauses)} parts are too many for one sentence; say it in {MOST_CLAUSES} at most")
    assert pipeline.knowledge is not None
    reader, begin = PlainReader(pipeline, pipeline.knowledge), State.initial(pipeline.knowledge, memory)
    builder = Builder(reader, act, [*clauses], begin)
    steps, state = builder.build()
    if all(isinstance(step, Do) for step in steps) and not builder.special:
        return plain
    if max(map(_depth, steps), default=0) > MOST_NESTED:
        raise RefusalError("three conditions or repetitions within each other are too many; say it in two sentences")
    parts = tuple(" | ".join(filter(None, (each.joint.strip(" ,;."), each.cue, each.text))) for each in clauses)
    walked = [each for step in steps for each in step.walk()]
    for each in (each for each in walked if isinstance(each, Repeat)):
        paced = each.loop.times is not None or each.loop.every_s is not None
        if not paced and all(isinstance(step, Speak) for step in each.steps):
            raise RefusalError("how often am I to say it? Say 'every minute', for example", question=True)
    commands = tuple(command for step in walked for command in step.commands)
    moved = next((n for n, one in enumerate(commands) if str(one.object) == SPEAKER), len(commands))
    back = any(one.item is not None and one.goal == START for one in commands[moved:])
    spoken = [step.speak for step in walked if isinstance(step, Speak)]
    adverbs = note_adverbs(plain.text, [*spoken, *re.findall("'([^']+)'", " ".join(state.notes))])
    notes = state.noting([*filter(None, [adverbs]), *([_BACK] if back else [])]).notes
    found = Trace(plain.text, state.memory, opened=plain.opened, tokens=plain.tokens, commands=commands)
    return replace(found, notes=notes, parts=parts, steps=steps)


_BACK: Final = "I bring it to the place where you have spoken to me, not to where you are then"
"""Note when the robot brings an object to the speaker after going elsewhere with the speaker."""


def _depth(step: Step) -> int:
    """Depth of nested blocks, without counting steps at the end."""
    inner = max(map(_depth, step.inner_steps), default=0)
    return inner + isinstance(step, Choose | Repeat | Try | Together | Ask)
