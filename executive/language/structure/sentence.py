"""Reads a sentence with conditions, loops, waits or speech, and builds the steps of its actions."""

import re
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import cache, partial
from itertools import dropwhile
from typing import Final

from pydantic import ValidationError

from executive.language.amounts import parse_seconds
from executive.language.clauses import CHECKS, Clause, Cue, begins_as, cut, split, trailing_cue
from executive.language.cleaning import unkept_reason
from executive.language.coverage import note_adverbs
from executive.language.items import verb, without_objects
from executive.language.lexicon import unquoted
from executive.language.pipeline import Pipeline, Trace
from executive.language.questions import ClarifyingQuestion, RefusalError, RefusalKind, Slot
from executive.language.reference import Memory
from executive.language.roles import Location
from executive.language.structure.builder import ROUNDS, Builder, is_paced
from executive.language.structure.conditions import REQUESTS, parse_condition, statement_of_check
from executive.language.structure.plain import PlainReader, PlainReading, State, T, attempt, require, words_to_say
from executive.language.structure.speaking import ROOMS, SPEECH, say_in_each_room, says
from executive.language.task_sentences import task_again, task_openers, task_requests
from executive.language.templates import Match, words_of
from executive.language.tokens import smooth
from executive.words.command import SPEAKER, START, Command
from executive.words.condition import Look
from executive.words.leaf_steps import Check, Do, Speak, steps_of_commands
from executive.words.step import Step
from executive.words.steps import Ask, Choose, Repeat, Together, Try
from executive.words.task import Part, Task
from skills.api import ObjectKind
from skills.inputs.errors import known_names, listing
from skills.inputs.plugins import SENTENCES, PluginDefect, installed_plugins, run_plugin
from skills.inputs.schema import first_error

MOST_NESTED: Final = 2
MOST_CLAUSES: Final = 24


def act(row: Builder, clause: Clause, *, pages: bool = True) -> None:
    """Adds the steps of a clause with an action, and of the clauses that belong to it; plain words stay pending.

    Without `pages` no clause is a request of a task's page.
    """
    text, given = clause.text, row.given
    stated = bool(row.plain) and all(begins_as(one.text, "told_first", "pronoun") for one in row.plain)
    if clause.begins and not stated:  # unless it goes on with "there is a hammer on the bench. bring it"
        row.flush()
        row.begun = len(row.steps)
    if given is not None and row.at == 1 and CHECKS["no_verb"].fullmatch(text):
        clause = replace(clause, lead=without_objects(row.reader.read_items(given)))
    if begins_as(text, "brings", "giving"):
        row.given = text if (behind := trailing_cue(text)) is None else behind.before
    if (keeps := CHECKS["keeps"].fullmatch(text)) is not None:  # "keep sweeping", which was reworded
        clause, cue = replace(clause, text=keeps["what"], joint=". "), trailing_cue(text)
        if cue is None or cue.kind not in ROUNDS:
            row.modify(clause, Clause("", "", Cue.EVERY, "keep", before=clause.text, amount="1 second"))
            return
    if not any(does(row, clause) for does in _ACTS if pages or does is not _does_task):
        row.plain.append(clause)


def _skips(row: Builder, clause: Clause) -> bool:
    """Skips "do nothing", and "tell me the result" behind what gives an answer, which the robot says in any case."""
    idle, answered, value = (CHECKS[intent].fullmatch(clause.text) for intent in ("idle", "answered", "value"))
    if idle or answered:
        row.flush()
    before = [*row.steps[-1].walk()][-1].commands[-1:] if row.steps and not row.plain else ()
    words = {word for each in row.clauses[: row.at - 1] for word in words_of(each.text).words}
    told = answered is not None or (value is not None and value["what"].lower() in {"", *words})
    looked = answered is not None and row.asked is not None and row.asked.looked
    looked = looked or (told and any(one.task is not None and one.task.answers for one in before))
    row.special = row.special or looked
    return idle is not None or looked


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


def _does_task(row: Builder, clause: Clause) -> bool:
    """Adds a request that a sentence on the page of a task matches, unless Errand reads it without pages."""
    if task_openers().isdisjoint(words_of(clause.text).words):
        return False
    found = trailing_cue(clause.text)
    begun = found is None or any(one.slots for one in task_requests(found.before).values())
    if found is not None and not begun and found.kind in (Cue.EVERY, Cue.TIMES) and found.text:
        found = replace(found, before=f"{found.before} {found.text}", text="")  # "vacuum twice in the hall"
    text = clause.text if found is None else found.before
    if any(_reads_without_pages(row, replace(clause, text=each)) for each in {clause.text, text}):
        return False
    again, first = task_again(text), not (row.steps or row.plain)
    if found is not None and (again or task_requests(text)):
        require(not again, f"it is not clear which action '{found.cue}' belongs to; say it first", found.cue)
        row.modify(clause, found)
        return True
    parts = [each for one in again or [text] * first for each in cut(smooth(one))]
    if found is None and len(parts) > 1 and (again or task_requests(parts[-1].text)):
        row.insert(parts)
        return True
    if not (asked := task_requests(text)):
        return False
    row.flush()
    alike = "" if len(asked) == 1 else listing((task.named for task in asked), last="or")
    require(not alike, f"'{clause.text}' is a sentence of {alike}; say it in other words", clause.text)
    ((task, match),) = asked.items()
    commands, state = _task_commands(task, match, row.state, row.reader)
    row.put(steps_of_commands(commands), row.reader.state_after(commands, state.memory, state))
    return True


def _reads_without_pages(row: Builder, clause: Clause) -> bool:
    """Returns whether a clause has a meaning, or needs an answer, where no task has sentences of its own."""
    alone = Builder(row.reader, partial(act, pages=False), [clause], row.state, row.statement, row.given)
    read = attempt(alone.build)
    return not isinstance(read, RefusalError) or read.question is not None


def _does_more(row: Builder, clause: Clause) -> bool:
    """Adds a request that a plug-in understands by itself."""
    return any(does(row, clause) for does in _own_acts())


@cache
def _own_acts() -> tuple[Callable[[Builder, Clause], bool], ...]:
    """Functions of plug-ins that add the steps of a clause, in the order of their names; without broken ones."""
    found = list[Callable[[Builder, Clause], bool]]()
    for entry in sorted(installed_plugins(SENTENCES), key=lambda entry: entry.name):
        with suppress(PluginDefect):
            found.append(run_plugin(entry, entry.load))
    return tuple(found)


def _task_commands(task: Task, match: Match, state: State, reader: PlainReader) -> tuple[list[Command], State]:
    """Commands of a request for a task, one for each of its places or objects, with the state that knows them."""
    said, what, goals = unquoted(match.text), match["object"], [Command()]
    names = (match["goal"], "" if task.object_is is Part.TEXT else what)
    unkept = filter(None, (unkept_reason(said, said, task.unkept), *(unkept_reason(each, each) for each in names)))
    require(not (why := next(unkept, "")), why, said)
    if match["goal"]:
        state, goals = _at_kind(task.goal_is, match, "goal", state, reader)
    _ask_for(any(at.goal for at in goals) or not task.needs_goal, f"{said}: where?", Slot.PLACE)
    match task.object_is:
        case Part.NOTHING:
            objects = [Command()]
        case Part.THING:
            wanted = _ask_for(what, f"{said}: what?", Slot.THING)
            read = reader.read_commands(wanted, state, (verb("find"),))
            state, objects = read.state, [_where_it_is(one, read, reader, said) for one in read.commands if one.looks]
            people = [str(one.object) for one in objects if reader.knowledge.somebody(str(one.object)) is not None]
            require(not people, f"'{said}': {listing(people)} is no object", wanted)
            one = task.several or all(each.object_count == 1 for each in objects)
            require(one, f"'{said}' is for one object at a time; say how often, as in 'twice'", wanted)
            require(objects[1:] or wanted.lower() != "them", f"which objects are '{wanted}'? Name each", wanted)
        case Part.PERSON if what.lower() in ("", "me", "us"):
            objects = [Command(object=ObjectKind(SPEAKER))]
        case Part.PERSON | Part.PLACE | Part.ROOM:
            _ask_for(what, f"{said}: where?", Slot.PLACE)
            state, found = _at_kind(task.object_is, match, "object", state, reader)
            objects = [Command(object=ObjectKind(str(one.goal)), goal=one.goal_at) for one in found]
        case Part.TIME:
            seconds = _ask_for(parse_seconds(what), f"{said}: for how long?", Slot.THING)
            objects = [Command(object=ObjectKind("second"), object_count=round(seconds))]
        case _:
            words = _ask_for(what, f"{said}: what?", Slot.THING)
            objects = [Command(object=ObjectKind(words_to_say(words).strip("'")))]
    doing, each = said.split(maxsplit=1)[0].lower(), [(at if at.goal else one, one) for at in goals for one in objects]
    return [replace(one, goal=at.goal, goal_at=at.goal_at, task=task, verb=doing) for at, one in each], state


def _at_kind(kind: Part, match: Match, slot: str, state: State, reader: PlainReader) -> tuple[State, list[Command]]:
    """Commands of going to the places or people that a slot names, with the state that knows them.

    Raises RefusalError for a name of another kind: the slot's list may be narrower than the part's `kind`.
    """
    words, knowledge, kind = match[slot], reader.knowledge, Part.ROOM if match[f"room:{slot}"] else kind
    there = attempt(reader.go_to, words, state)
    if isinstance(there, RefusalError):
        nobody = RefusalError(f"I know nobody called '{words}'; {known_names(words, knowledge.people)}", [words])
        raise nobody if kind is Part.PERSON and there.question is None else there
    found = [one for one in there.commands if one.goal is not None]
    known = (*knowledge.named(kind), *[START] * (slot == "goal"))
    wrong = [str(one.goal) for one in found if one.goal not in known]
    require(not wrong, f"'{match.text}': {words if found[1:] == [] else listing(wrong)} is no {kind.value}", words)
    return there.state, found


def _ask_for(given: T | None, asked: str, slot: Slot) -> T:
    """Returns what a sentence of a task must say. Raises RefusalError with a question when it does not say it."""
    return require(given, asked, question=ClarifyingQuestion(asked[:1].upper() + asked[1:], slot))


def _where_it_is(look: Command, read: PlainReading, reader: PlainReader, said: str) -> Command:
    """Looks for a certain object, which was carried before, where it was put. Raises RefusalError for who has it."""
    carried = next((one for one in reversed(read.state.carried) if one.item == look.object), None)
    certain = (one.again or (one.target and not one.target.indefinite) for one in read.trace.resolved[-1:])
    if carried is None or read.trace.actions[-1].source is not None or not any(certain):
        return look
    who = "you have" if carried.goal == START else f"{carried.goal} has"
    require(reader.is_place(carried.goal), f"'{said}': {who} it then; say where it is")
    return replace(look, goal=carried.goal, goal_at=carried.goal_at)


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
        does = SPEECH["speaks"].match(ahead) is not None or words_of(ahead).word(0) in task_openers()
        does = does and looks is None and trailing_cue(ahead) is None
        row.at += does or looks is not None
        if does:
            say_in_each_room(row, ahead)
            return True
    if looks is None:
        return False
    what = looks["what"]
    reading = row.reader.read_commands(what, row.known(), (verb("find"),))
    looks_only = all(one.looks for one in reading.commands)
    nowhere = re.search(r"\b(?:in|on|at|near)\b", what) is None
    require(looks_only and nowhere, f"I cannot look for {listing([what])} in every room", what)
    commands = tuple(replace(command, goal=None, goal_at=None) for command in reading.commands)
    row.flush()
    row.add(replace(reading, commands=commands, state=reading.state.elsewhere))
    row.special = True
    return True


_ACTS: Final = (_skips, _does_task, _does_more, _requests, says, _checks, _is_modified, _brings_to_all, _searches_rooms)
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
