"""Requests about people who are described, and about what to say to people."""

import re
from dataclasses import replace
from pathlib import Path
from typing import Final

from errand_home.persons import appearance_of, clothing_note, description, plural_description
from errand_home.tasks import Answer, Deliver, Report, Seek
from errand_people.looks import Appearance
from executive.language.clauses import Clause, trailing_cue
from executive.language.nouns import NounKind
from executive.language.structure.builder import Builder
from executive.language.structure.plain import named, require
from executive.language.structure.speaking import goes_to_listener
from executive.language.templates import Match
from executive.words.command import START, Command
from executive.words.knowledge import ANYBODY
from executive.words.leaf_steps import Speak, steps_of_commands
from executive.words.task import Task, task_named
from skills.api import ObjectKind

_TABLE: Final = Path(__file__).with_name("persons.yaml")
_INTRODUCTION: Final = "Hello, I am the robot here. I bring things, and I follow and guide people."
_ONE: Final = "person"


def about_persons(row: Builder, clause: Clause) -> bool:
    """Adds a request about a person who is described, or about what to say to people."""
    forms, joined = row.reader.forms("persons", _TABLE)["requests"], _joined(row, clause)
    text = next((each for each in joined if forms.fullmatch(each) is not None), None)
    if text is None:
        found = trailing_cue(clause.text)
        if found is None or forms.fullmatch(found.before) is None:
            return False
        row.modify(clause, found)
        return True
    request = require(forms.fullmatch(text), text)
    row.at += joined.index(text)
    row.special = True  # a refusal of the clauses before is theirs
    if request["does"] != "hand":
        row.flush()
    _ACTS[request["does"]](row, request)
    if note := clothing_note(f"{'' if appearance_of(request['who']) else 'people '}{request['who']}"):
        row.state = row.state.noting([note])
    return True


def _joined(row: Builder, clause: Clause) -> list[str]:
    """Clause alone, and with the clause behind it, which a word such as "what" or "are" seems to begin."""
    after = row.following
    plain = after is not None and after.kind is None and not after.joint.strip() and not after.begins
    return [clause.text, *([f"{clause.text} {after.text}"] if after is not None and plain else [])]


def _seeks(row: Builder, request: Match) -> None:
    """Adds finding the person; words to say follow."""
    _puts_seek(row, request)
    if said := request["says"]:
        row.put((Speak(speak=_INTRODUCTION if said == "introduction" else said),), row.state)


def _goes_along(row: Builder, request: Match) -> None:
    """Adds finding the person, and following or guiding them."""
    to = request["to"]
    place = _place(row, to) if to and to.lower() not in ("here", "back") else START if to else None
    _puts_seek(row, request)
    task = task_named(request["does"])
    does = Command(goal=place, task=task, object=ObjectKind(ANYBODY), verb=_verb(request))
    memory = row.state.memory
    if place not in (None, START):
        memory = replace(memory, place=named(str(place), NounKind.PLACE))
    after = row.reader.state_after((does,), memory, row.state)
    row.put(steps_of_commands((does,)), after if place is not None else after.elsewhere)


def _introduces(row: Builder, request: Match) -> None:
    """Adds guiding one person to the room of another, and introducing them to each other."""
    knowledge, said = row.reader.knowledge, request.text
    one, other = (knowledge.person(request[slot]) for slot in ("one", "other"))
    first, second = require(one, said, said), require(other, said, said)
    require(first != second, f"'{said}' names one person twice; name two", said)
    at = _place(row, request["at"]) if request["at"] else None
    where = _place(row, request["where"]) if request["where"] else knowledge.room(knowledge.people[second].at)
    meets, joins = Command(goal=first, goal_at=at), Command(goal=second, goal_at=where)
    guides = Command(goal=where, task=task_named("guide"), object=ObjectKind(first), verb=_verb(request))
    row.state = row.state.recalling(person=named(second), place=named(where, NounKind.PLACE))
    _puts(row, meets, guides, joins)
    row.put((Speak(speak=f"{second}, this is {first}. {first}, this is {second}."),), row.state)


def _puts_seek(row: Builder, request: Match, at: str = "at") -> None:
    """Adds finding a described person at a place, by default where the robot is then."""
    words, said = request["who"], request.text
    appearance = require(appearance_of(words), f"I do not understand whom '{words}' describes", words)
    last = row.state.goal if row.reader.is_place(row.state.goal) else None
    found = _place(row, request[at]) if request[at] else last
    place = require(found, f"{said}: in which room?", question=True)
    seek = _command(Seek.word, description(appearance), request, goal=place)
    memory = replace(row.state.memory, person=named(ANYBODY), place=named(place, NounKind.PLACE))
    row.put(steps_of_commands((seek,)), row.reader.state_after((seek,), memory, row.state))


def _reports(row: Builder, request: Match) -> None:
    """Adds what the robot says of itself, the team or the date, behind the way to the listener."""
    if request["speaker"]:
        _puts(row, _command(Report.word, request["topic"], request, goal=START))
        return
    if request["who"]:
        _puts_seek(row, request, "where")
    elif request["them"] or request["name"]:
        _goes_to(row, request)
    _puts(row, _command(Report.word, request["topic"], request))


def _goes_to(row: Builder, request: Match) -> None:
    """Adds the way to a listener by name, or to the person of whom was spoken, unless the robot is with them."""
    person = row.state.memory.person
    if request["name"]:
        goes_to_listener(row, request)
        row.state = row.state.recalling(person=named(request["name"]))
        return
    them = request["them"]
    known = require(person, f"who is meant by '{them}' in '{request.text}'?", them, question=True)
    if row.reader.knowledge.person(known.name) is not None:
        goes_to_listener(row, replace(request, slots={"name": known.name}))
        return
    last = row.steps[-1].commands[-1:] if row.steps else ()
    beside = isinstance(row.steps[-1], Speak) if row.steps else False
    beside = beside or any(one.task is not None and (one.about_person or one.task.word in _BESIDE) for one in last)
    require(beside, f"I do not know where '{them}' are then; say where, as in 'the person at the desk'", them)


def _answers(row: Builder, request: Match) -> None:
    """Adds answering a question of a person, or of the one before the robot."""
    if request["who"]:
        _puts_seek(row, request)
    asked = "quiz" if "quiz" in request["topic"].lower() else "question"
    _puts(row, _command(Answer.word, asked, request))


def _counts(row: Builder, request: Match) -> None:
    """Adds counting people, and telling the number to the speaker."""
    words = request["who"]
    words = words if appearance_of(words) else f"people {words}"
    appearance = require(appearance_of(words), f"I do not understand whom '{words}' describes", words)
    place = _place(row, request["at"])
    require(place in row.reader.knowledge.rooms, f"{request.text}: people are counted in rooms; name one", place)
    counted = f"number of {plural_description(appearance)} in the {place}"
    _puts(row, _command(Report.word, counted, request, goal=START))


def _informs(row: Builder, request: Match) -> None:
    """Adds finding out the name, the pose or the gesture of the person at a place, and telling it."""
    place, where = _place(row, request["at"]), request["where"]
    goal: str | None = START
    if request["name"]:
        goal = row.reader.knowledge.person(request["name"])
    elif request["who"]:
        hint = "tell it to me, to somebody by name, or to the person at a place"
        plain = appearance_of(request["who"]) == Appearance()
        require(where and plain, f"I do not understand to whom to tell it in '{request.text}'; {hint}", request["who"])
        goal = _place(row, where)
    else:
        require(request["speaker"] or not request["them"], f"{request.text}: to whom?", question=True)
    at = where if request["name"] and where else ""
    spot = _place(row, at) if at else None
    on = "in" if place in row.reader.knowledge.rooms else "at"
    asked = f"{request['info'].lower()} of the {_ONE} {on} the {place}"
    _puts(row, replace(_command(Report.word, asked, request, goal=goal), goal_at=spot))


def _hands(row: Builder, request: Match) -> None:
    """Adds handing an object to a described person, in place of the speaker."""
    words, said = request["who"], request.text
    appearance = require(appearance_of(words), f"I do not understand whom '{words}' describes", words)
    row.plain.append(Clause(" and ", f"{_verb(request)} {request['thing']} to me"))
    row.flush()
    brought = row.steps[-1].commands[-1] if row.steps and row.steps[-1].commands else Command()
    held = brought.item if brought.goal == START else None
    item = require(held, f"what am I to bring in '{said}'? Say what to take", said)
    row.steps.pop()
    before = [command for step in row.steps for command in step.commands]
    at = next((one.goal for one in reversed(before) if row.reader.is_place(one.goal)), None)
    place = _place(row, request["at"]) if request["at"] else at
    known = require(place, f"{said}: in which room?", question=True)
    _puts(row, replace(_command(Deliver.word, description(appearance), request, goal=known), item=item))


def _place(row: Builder, said: str) -> str:
    """Place that words name, and nothing else. Raises RefusalError for more words."""
    plain = re.sub(r"^(?:the|my|our|your) ", "", said, flags=re.IGNORECASE)
    place = row.reader.place(said, row.state)
    whole = row.reader.knowledge.place(plain) == place or plain.lower() == "there"
    require(whole, f"I do not understand the place '{said}'", said)
    return place


def _command(word: str, text: str, request: Match, *, goal: str | None = None) -> Command:
    return Command(goal=goal, task=_task(word), object=ObjectKind(text), verb=_verb(request))


def _task(word: str) -> Task:
    return task_named(word)


def _verb(request: Match) -> str:
    return request.text.split()[0].lower()


def _puts(row: Builder, *commands: Command) -> None:
    """Adds commands; one without a goal leaves the robot where it is."""
    after = row.reader.state_after(commands, row.state.memory, row.state)
    stays = commands[-1].goal is None
    row.put(steps_of_commands(commands), replace(after, goal=row.state.goal, at=row.state.at) if stays else after)


_ACTS: Final = {
    **{"seek": _seeks, "follow": _goes_along, "guide": _goes_along, "report": _reports, "answer": _answers},
    **{"introduce": _introduces, "count": _counts, "inform": _informs, "hand": _hands},
}
_BESIDE: Final = (Seek.word, Report.word, Answer.word, Deliver.word)
"""Tasks after which the robot is beside a person."""
