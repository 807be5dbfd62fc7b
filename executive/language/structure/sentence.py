"""Reads a sentence with conditions, loops, waits or speech, and builds the steps of its actions."""

import re
from collections.abc import Sequence
from dataclasses import replace
from typing import Final

from pydantic import ValidationError

from executive.language.clauses import CHECKS, Clause, Cue, end_of_scope, split, trailing_cue
from executive.language.coverage import TOLD, note_adverbs
from executive.language.items import Chunk, without_objects
from executive.language.pipeline import Pipeline, Trace
from executive.language.questions import RefusalError, RefusalKind
from executive.language.reference import Memory
from executive.language.structure.builder import Builder
from executive.language.structure.conditions import RequestParser, parse_condition, statement_of_check
from executive.language.structure.plain import (
    LastCheck,
    PlainReader,
    State,
    attempt,
    person_named,
)
from executive.language.structure.requests import (
    PEOPLE,
    REQUESTS,
    ROOMS,
    SPEECH,
    QuestionRequest,
    escape_braces,
    is_clause,
    parse_people,
    parse_question,
    parse_speech,
    refers_to_person,
    search_for,
    steps_for_everyone,
    steps_on_people,
)
from executive.language.templates import Match
from executive.words.command import PEOPLE_TASKS, SPEAKER, START
from executive.words.condition import Look
from executive.words.leaf_steps import Check, Do, Speak
from executive.words.step import Step
from executive.words.steps import Ask, Choose, Repeat, Steps, Together, Try
from skills.inputs.schema import first_error


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


def _meets_people(row: Builder, clause: Clause) -> bool:
    """Adds a request about people; finding somebody counts only before another request about the same person."""
    knowledge, found, then = row.reader.knowledge, trailing_cue(clause.text), row.ahead()
    if found is not None and found.kind in (Cue.WHILE, Cue.UNTIL):
        found = None  # how long the robot follows
    request = parse_people(clause.text if found is None else found.before, knowledge)
    if request is None:
        return False
    refers = PEOPLE["refers"].search(then) is not None
    if request["form"] == "find" and not (refers or (row.special and refers_to_person(request))):
        return False
    if request["form"] == "stated" and not (refers and parse_people(then, knowledge)):
        return False
    if found is not None:
        row.modify(clause, found)
    else:
        _flush_reasons(row)
        row.put(*steps_on_people(request, row.state, row.reader))
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


def _requests(row: Builder, clause: Clause, parsers: Sequence[RequestParser] = REQUESTS) -> bool:
    """Adds the steps of a request that one of the parsers understands."""
    done = next((done for parse in parsers if (done := parse(clause.text, row.known, row.reader)) is not None), None)
    if done is not None:
        row.put(*done)
    return done is not None


def _asks(row: Builder, clause: Clause) -> bool:
    """Adds a question to somebody, with the steps that follow each answer."""
    person, text = row.state.memory.person, clause.text
    if person is not None:
        text = re.sub(r"^(ask) (?:him|her)\b", rf"\1 {person.name}", text, flags=re.IGNORECASE)
    if (asked := parse_question(text, row.reader.knowledge)) is None:
        return False
    row.flush()
    _goes_to_listener(row, asked.of)
    choices = (_agreed if asked.yes_or_no else _chosen)(row, asked)
    row.put((Ask(ask=escape_braces(asked.text), choices=choices),), row.state.elsewhere)
    return True


def _agreed(row: Builder, asked: QuestionRequest) -> dict[str, Steps]:
    """Steps that follow the answers yes and no."""
    found: dict[str, Steps] = {"yes": (), "no": ()}
    while row.at < len(row.clauses):
        clause, rest = row.clauses[row.at], row.clauses[row.at].text
        answer = {Cue.SO: "yes", Cue.NOT: "no", Cue.OTHERWISE: "no"}.get(clause.kind) if clause.kind else None
        for said, intent in (("no", "declines"), ("yes", "agrees")):
            match = CHECKS[intent].match(rest) if clause.kind is Cue.IF and answer is None else None
            if match is not None:
                answer, rest = said, rest[match.end :].strip(" ,")
        if clause.kind is None and not any(found.values()) and CHECKS["brings_it"].match(rest):
            answer = "yes"
        if answer is None or found[answer]:
            break
        row.at += 1
        body = row.take(rest, end_of_scope(row.clauses, row.at, branch=True))
        if not body:
            raise clause.missing_action(clause.text)
        found[answer] = _steps_if_chosen(row, body, asked, asked.choices[0])
    if not found["yes"] and CHECKS["brings"].match(row.ahead()):
        raise RefusalError("say 'if yes' before the action for that answer", [row.ahead()])
    return found


def _chosen(row: Builder, asked: QuestionRequest) -> dict[str, Steps]:
    """Steps that follow each of the choices: the robot brings the chosen object if the sentence says so."""
    body = row.take("", row.at + 1) if CHECKS["brings"].match(row.ahead()) else []
    article = r"^(?:a|an|some|the|any|another) "
    return {
        re.sub(article, "", choice, flags=re.IGNORECASE): _steps_if_chosen(row, body, asked, choice) if body else ()
        for choice in asked.choices
    }


def _steps_if_chosen(row: Builder, body: Sequence[Clause], asked: QuestionRequest, choice: str) -> Steps:
    """Steps after an answer: "it" refers to the chosen object, and the asked person receives it."""
    objects = tuple(item.phrase for item in row.reader.read_items(choice) if isinstance(item, Chunk))
    person = person_named(asked.of["name"])
    memory = replace(row.state.memory, objects=objects, gathered=objects, where=None, person=person)
    steps, after = row.nest(body, replace(row.state, memory=memory, recipient=person))
    row.state = row.state.noting(after.notes)
    return steps


def _says(row: Builder, clause: Clause) -> bool:
    """Adds speech, behind the drive to the listener."""
    text, found = clause.text, trailing_cue(clause.text)
    if (match := SPEECH["tells_when"].fullmatch(text)) is not None:
        row.flush()
        statement = parse_condition(match["what"], row.state, row.reader).statement
        if statement is None:
            raise RefusalError(f"what am I to say in '{text}'?", [text])
        told = Clause("", f"tell {match['who']} that {statement}")
        row.clauses[row.at : row.at] = [Clause("", match["what"], Cue.SOON, "when"), told]
        return True
    if not SPEECH["speaks"].match(text) or SPEECH["asks_back"].match(text):
        return False
    if (everywhere := ROOMS["says_everywhere"].fullmatch(text)) is not None:
        _say_in_each_room(row, everywhere["said"])
        return True
    counts = found is not None and found.kind in (Cue.TIMES, Cue.EVERY) and found.text
    if found is not None and (not counts or re.match(r"for|until|every", found.text)):
        row.modify(clause, found)  # unless it is a part of what is said
        return True
    if (said := parse_speech(text, row.reader)) is None:
        return False
    if not (words := said["text"] or row.statement):
        raise RefusalError(f"what am I to say in '{text}'?", [text])
    row.flush()
    _goes_to_listener(row, said)
    row.put((Speak(speak=escape_braces(words)),), row.state)
    return True


def _goes_to_listener(row: Builder, to: Match) -> None:
    """Adds the drive to the listener."""
    said, place = to["name"] or to["pronoun"], to["where"]
    if not (said or place or to["speaker"]):
        return
    words = "here" if to["speaker"] else " in ".join(filter(None, (said, place)))
    reading = row.reader.go_to(words, row.state, by="come" if to["speaker"] else "go")
    last = row.steps[-1].commands[-1:] if row.steps and not place else ()
    if any(one.task in PEOPLE_TASKS and str(one.object) == reading.commands[-1].goal for one in last):
        return  # the robot has just followed or guided that person
    if reading.commands[-1].goal != row.state.goal or reading.commands[-1].goal_at is not None:
        row.add(reading)


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
    row.asked = LastCheck(supposed, looked=True)
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
            _say_in_each_room(row, ahead)
            return True
    if looks is None:
        return False
    reading = search_for(looks["what"], row.known(), row.reader)
    row.flush()
    row.add(reading)
    row.special = True
    return True


def _say_in_each_room(row: Builder, said: str) -> None:
    """Goes on with speech in every room."""
    goes = (f"go to the {room}" for room in row.reader.knowledge.rooms)
    row.clauses[row.at : row.at] = [Clause("", text) for go in goes for text in (go, said)]


_ACTS: Final = (
    _skips,
    _meets_people,
    _requests,
    _asks,
    _says,
    _checks,
    _is_modified,
    lambda row, clause: _requests(row, clause, (steps_for_everyone,)),
    _searches_rooms,
)
"""Actions in the order of trying."""

MOST_NESTED: Final = 2

MOST_CLAUSES: Final = 24


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
    builder = Builder(
        PlainReader(pipeline, pipeline.knowledge), act, clauses, State.initial(pipeline.knowledge, memory)
    )
    steps, state = builder.build()
    if all(isinstance(step, Do) for step in steps) and not builder.special:
        return plain
    if max(map(_depth, steps), default=0) > MOST_NESTED:
        raise RefusalError("three conditions or repetitions within each other are too many; say it in two sentences")
    parts = tuple(" | ".join(filter(None, (each.joint.strip(" ,;."), each.cue, each.text))) for each in clauses)
    walked = [each for step in steps for each in step.walk()]
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
