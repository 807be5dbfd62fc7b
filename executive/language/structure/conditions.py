"""Parses spoken conditions ("the battery is low"), and requests for doors, pictures, charging and waits."""

import re
from collections.abc import Callable
from dataclasses import replace
from typing import Final

from executive.language.amounts import parse_seconds, parse_share, parse_time
from executive.language.clauses import CHECKS, CLAUSES, trailing_cue
from executive.language.indirect import CONTENTS, OBJECTS
from executive.language.items import Chunk, verb
from executive.language.questions import RefusalError, RefusalKind, Slot, which_question
from executive.language.roles import HERE
from executive.language.spelling import synonyms_of
from executive.language.structure.plain import PlainReader, SpokenCondition, State, attempt, require, with_preposition
from executive.language.templates import Match, page
from executive.words.condition import AllOf, AnyOf, ButtonPressed, DoorOpen, Not, ValueIs
from executive.words.knowledge import Knowledge
from executive.words.leaf_steps import Awaited, Charging, Dock, DoorToOpen, OpenDoor, Picture, Subject, Wait
from executive.words.steps import Steps
from executive.words.task import basic
from skills.inputs.errors import listing

_P: Final = page("conditions")
_DOORS: Final = page("doors")
_JOINED: Final = page("joined")
_WAITING: Final = page("waiting")
Done = tuple[Steps, State]
"""Steps, and the state after them."""
_SUBJECTS: Final = {"him": "he", "her": "she"}
_FULL: Final = 0.99
"""Share at which a battery is full."""
_NO_CHARGE: Final = "'{}' is no charge; say it in percent"


def parse_condition(text: str, state: State, reader: PlainReader) -> SpokenCondition:
    """Parses a condition. Raises RefusalError when the robot can neither see nor measure it."""
    words = " ".join(text.replace(" o' clock", " o'clock").split()).strip(" ,.")
    words = words if (tail := _P["tail"].fullmatch(words)) is None else tail["condition"]
    if (found := usual_condition(words, state, reader)) is not None:
        return found
    if (unreal := CLAUSES["unreal"].search(words)) is not None:
        raise RefusalError(f"I can only decide by what I see now, not by '{words}'", [unreal.text])
    joined = _joined(words, state, reader)
    if isinstance(joined, SpokenCondition):
        return joined
    alone = attempt(_look, words, state, reader)
    if isinstance(alone, RefusalError):
        raise alone if alone.question is not None or joined is None else joined
    return alone


def usual_condition(words: str, state: State, reader: PlainReader) -> SpokenCondition | None:
    """Parses a condition in a usual form: battery, gripper, place, clock, button, door, or people who come or go."""
    readers = (_measured, _door, _meeting)
    return next((found for read in readers if (found := read(words, state, reader)) is not None), None)


def _measured(words: str, state: State, reader: PlainReader) -> SpokenCondition | None:
    """Condition on a button, or on a value that the robot measures: battery, gripper, place or time."""
    if (match := _P["pressed"].fullmatch(words)) is not None:
        return SpokenCondition(ButtonPressed(button=match["button"].lower() or "button"), words, state, state)
    if (match := _P["measured"].fullmatch(words)) is None:
        return None
    share, seconds, time = parse_share(match["share"]), parse_seconds(match["span"]), parse_time(match["time"])
    require(share or not match["share"], _NO_CHARGE.format(match["share"]), match["share"])
    if (match["span"] and seconds is None) or (match["time"] and time is None):
        return None
    facts, sign = reader.knowledge.battery, match["sign"] or ">="
    values = {"low": facts.low, "charged": facts.charged, "full": _FULL, "sign": sign, "share": share, "span": seconds}
    text = match["value"].format(**values, time=None if time is None else time.text)
    known = state if time is None else state.noting(time.notes(match["time"]))
    found = SpokenCondition(ValueIs(text=text), words, known, known)
    return found.negate(words) if match["not"] else found


def _door(words: str, state: State, reader: PlainReader) -> SpokenCondition | None:
    """Condition that a door is open or closed; "it" refers to the last door. Raises RefusalError like `_between`."""
    match = _DOORS["stands"].fullmatch(words)
    if match is None or (match["it"] and state.door is None):
        return None
    how = match["how"].lower()
    unseen = f"I cannot see whether a door is {how}; ask whether it is closed"
    require(not how.endswith("locked"), unseen, how, kind=RefusalKind.UNSEEN)
    door = state.door if match["it"] and state.door is not None else DoorOpen(door=_between(match, reader.knowledge))
    known = replace(state.elsewhere, door=door)
    found = SpokenCondition(door, words, known, known)
    opens = how in ("open", "opened", "opens", "to open", "is opening", "has opened")
    return found if opens != bool(match["not"]) else found.negate(words)


def parse_opening(text: str, known: Callable[[], State], reader: PlainReader) -> Done | None:
    """Parses a request to have a door opened. Raises RefusalError for a door that the robot itself cannot open."""
    match = _DOORS["opening"].fullmatch(text)
    if match is None or ((state := known()).door is None and match["it"]):
        return None
    own, doors = match["own"], [door for door in reader.knowledge.doors if door.opens is not None]
    door = state.door if match["it"] or (own and not doors) else DoorOpen(door=_between(match, reader.knowledge))
    if door is None or (own and all(set(door.door) != {*one.between} for one in doors)):
        said = match["door"] or "it"
        raise RefusalError(f"I cannot open {said} myself; say 'ask somebody to open {said}'", [match.text])
    return (OpenDoor(door=DoorToOpen(door=door.door)),), replace(state.elsewhere, door=door)


def _between(match: Match, knowledge: Knowledge) -> tuple[str, str]:
    """Rooms on the two sides of a door. Raises RefusalError for no such door, and with a question for several."""
    bare = re.sub(r"^(?:the|that|this|a) ", "", match["door"], flags=re.IGNORECASE)
    no_door = f"I know no door here, so I cannot look at '{match['door']}'"
    require(knowledge.doors, no_door, bare, kind=RefusalKind.NO_SUCH_DOOR)
    named = filter(None, (match[name] for name in ("room", "one", "other", "from", "to", "of")))
    rooms = {_room(name, knowledge) for name in named}
    fitting = [door.between for door in knowledge.doors if rooms <= {*door.between}]
    known = listing(" and ".join(door.between) for door in knowledge.doors)
    unknown = f"I know no such door as '{match['door']}'; there are doors between {known}"
    require(fitting, unknown, bare, kind=RefusalKind.NO_SUCH_DOOR)
    if len(fitting) > 1:
        question = which_question(Slot.PLACE, bare, tuple(f"door between {one} and {other}" for one, other in fitting))
        raise RefusalError(question.text, [bare], question=question)
    return fitting[0]


def _room(name: str, knowledge: Knowledge) -> str:
    bare = re.sub(r"^(?:the|my|our|your) ", "", name, flags=re.IGNORECASE)
    known = {spelling.lower(): room for room in knowledge.rooms for spelling in knowledge.spellings([room])}
    found = knowledge.place(bare) or next(iter(synonyms_of(bare.lower(), known)), None)
    unknown = f"I know no room '{bare}'; known are {listing(knowledge.rooms)}"
    return knowledge.room(require(found, unknown, bare, kind=RefusalKind.NO_SUCH_DOOR))


def _meeting(words: str, state: State, reader: PlainReader) -> SpokenCondition | None:
    """Condition that somebody, or nobody, is at the robot's place or in a room, arrives there, or leaves it."""
    gone = _P["goes"].fullmatch(words)
    match = gone or _P["comes"].fullmatch(words)
    if match is None or CLAUSES["unreal"].search(words):
        return None
    who, where = re.sub(r"\b(?:if|until)\b", "", match["who"]).strip(), match["place"]
    nobody = _P["nobody"].fullmatch(who) is not None
    if not (nobody or reader.is_somebody(who, state)) or re.search(r"\b(?:or|and)\b", where):
        return None
    room = _room_of_meeting(where, words, state, reader)
    subject = "anybody" if nobody or _P["anybody"].fullmatch(who) else _SUBJECTS.get(who.lower(), who)
    look = reader.check(f"{subject} is in the {room}", state, words)
    return look if nobody == (gone is not None) else replace(look, condition=Not(part=look.condition))


def _room_of_meeting(where: str, words: str, state: State, reader: PlainReader) -> str:
    """Room where people come or go: named, an earlier one ("there"), or the robot's. Raises RefusalError if unknown."""
    place = where.lower() or ("there" if re.search(r"\bthere(?: any more)?$", words, re.IGNORECASE) else "here")
    here = place == "here" or (place == "there" and state.memory.place == HERE)
    room = state.at if here else reader.room(where or place, state)
    return require(room, f"in which room can I see whether '{words}'? Name it", words)


def _look(words: str, state: State, reader: PlainReader) -> SpokenCondition:
    """Condition that something is visible, or not visible. Raises RefusalError."""
    if (match := _P["sees"].fullmatch(words)) is not None:
        return _seen(match, words, state, reader)
    if (match := _P["fullness"].fullmatch(words)) is None:
        return reader.check(words, state)
    some = match["some"] != ""
    place = with_preposition(reader.read_items(match["place"]), "on" if some else "at")
    found = reader.looks((verb("find"), Chunk(OBJECTS if some else CONTENTS), *place), words, state)
    empty = match["how"].lower() in ("empty", "free", "bare", "clear")
    return found.negate(words) if empty != bool(match["not"]) else found


def _seen(match: Match, words: str, state: State, reader: PlainReader) -> SpokenCondition:
    """Condition that the robot sees, or does not see, an object or a person."""
    what = match["what"]
    if re.fullmatch(r"it|one|him|her|them", what, re.IGNORECASE):
        found = reader.looks((verb("find"), *reader.read_items(what)), words, state)
    elif match["looks"] and state.at is not None and reader.is_somebody(what, state):
        found = reader.check(f"{_SUBJECTS.get(what.lower(), what)} is in the {state.at}", state, words)
    else:
        seen = re.sub(r"^(?:him|them)(?= )", "it", what, flags=re.IGNORECASE)
        found = reader.check(f"there is {seen}", state, words)
    return found.negate(words) if match["not"] else found


def _joined(words: str, state: State, reader: PlainReader) -> SpokenCondition | RefusalError | None:
    """Joins two conditions by "and" or "or"; if that fails, returns the first question that a half raised, or None."""
    left_open: RefusalError | None = None
    for word, kind in (("or", AnyOf), ("and", AllOf)):  # "and" joins more closely
        for joint in re.finditer(rf" {word} (?:if )?(?:that )?", words, re.IGNORECASE):
            before = re.sub(r"^(?:both |either )", "", words[: joint.start()]).strip(" ,")
            halves = attempt(_both, before, words[joint.end() :], state, reader)
            if not isinstance(halves, RefusalError):
                return _join(kind, *halves, words, state)
            left_open = left_open or (halves if halves.question is not None else None)
    return left_open


def _join(
    kind: type[AnyOf | AllOf], first: SpokenCondition, second: SpokenCondition, words: str, state: State
) -> SpokenCondition:
    """Joins two conditions; only after both of them hold ("and") is the state the one after the second."""
    known, both = second.holds, (first.condition, second.condition)
    if kind is AnyOf:  # the person of two conditions on one person, without the place
        one, other = first.holds.memory.person, known.memory.person
        same = one is not None and other is not None and one.name == other.name
        person = replace(one, within=None) if one is not None and same else state.memory.person
        known = state.elsewhere.recalling(person=person).noting(known.notes)
    parts = tuple(each for one in both for each in (one.parts if isinstance(one, kind) else (one,)))
    opposed = any(isinstance(each, Not) and each.part in parts for each in parts)
    require(not opposed, f"'{words}' says one thing and its opposite; say one of the two", words)
    return SpokenCondition(kind(parts=parts), words, known, state.noting(known.notes))


def _both(before: str, after: str, state: State, reader: PlainReader) -> tuple[SpokenCondition, SpokenCondition]:
    """Parses two joined conditions; the second may omit words of the first, and the first the place of both."""
    if _JOINED["there"].match(before) and _JOINED["bare"].match(after):
        place = None if _JOINED["placed"].search(before) else _JOINED["placed"].search(after)
        before = before if place is None else f"{before} {after[place.start :]}"
        after = f"there is {after}"
    elif (first_at := _JOINED["at"].fullmatch(before)) and (second_at := _JOINED["elsewhere"].fullmatch(after)):
        after = f"{first_at['stem']} {second_at['on'] or first_at['on']} {second_at['place']}"
    first = parse_condition(before, state, reader)
    return first, parse_condition(after, first.holds, reader)


def statement_of_check(text: str) -> str | None:
    """Turns a check into a statement: "is the door open" becomes "the door is open"."""
    return None if (match := CHECKS["checked"].fullmatch(text)) is None else match.instead


def parse_wait(text: str, known: Callable[[], State], reader: PlainReader) -> Done | None:
    """Parses a wait in a place: until a condition holds, while it holds, or for a person; None for a mere duration."""
    match = _WAITING["wait"].fullmatch(text)
    if match is None or _WAITING["only_span"].fullmatch(match["what"]):
        return None
    (steps, there), how, what = _gone(match["where"], known(), reader), match["how"].lower(), match["what"]
    at = _WAITING["person_at"].fullmatch(what) if how == "for" else None
    if at is not None and reader.is_somebody(at["who"], there):
        reading = reader.go_to(at["where"], there)
        steps, there, what = (*steps, *reading.steps), reading.state, at["who"]
    awaited, after = _awaited(how, what, there, reader)
    return (*steps, Wait(awaited=awaited)), after


def _awaited(how: str, what: str, state: State, reader: PlainReader) -> tuple[Awaited, State]:
    """What ends a wait, and the state after it."""
    if how in ("until", "till"):
        ends = _WAITING["ends"].fullmatch(what)
        if (seconds := parse_seconds("" if ends is None else ends["span"])) is not None:
            return Awaited(seconds=seconds), state
        if (time := parse_time(what if ends is None else ends["time"])) is not None:
            return Awaited(until_clock=time.text), state.noting(time.notes(what))
        found: SpokenCondition | None = parse_condition(what, state, reader)
    elif how == "for":
        somebody = reader.is_somebody(what, state)
        event = f"{what} is here" if somebody else _WAITING["button"].reword(what, whole=True)
        found = usual_condition(event, state, reader)
    else:
        found = parse_condition(what, state, reader).negate(what)
    found = require(found, f"I do not understand what to wait for: '{what}'", what)
    return Awaited(condition=found.condition), replace(found.holds, goal=found.holds.goal or state.goal)


def _gone(where: str, state: State, reader: PlainReader) -> Done:
    """Adds the drive to the place of a wait."""
    match = require(
        _WAITING["place"].fullmatch(where or "here"), f"I do not understand where to wait: '{where}'", where
    )
    if match["here"] or (match["there"] and state.goal is not None and state.at is not None):
        return (), state
    reading = reader.go_to(match["place"] or "there", state)
    return reading.steps, reading.state


def _parse_pictures(text: str, known: Callable[[], State], reader: PlainReader) -> Done | None:
    """Parses a request for pictures; None for other texts. Raises RefusalError for an unknown name."""
    if (match := page("pictures")["picture"].fullmatch(text)) is None or trailing_cue(text) is not None:
        return None
    state = known()
    stands = reader.go_to(match["at"], state).commands if match["at"] else ()
    require(len(stands) <= 1, f"I take a picture from one place at a time, not from {match['at']}", match["at"])
    at = stands[0].goal if stands else None
    subjects = _of_each(match["of"], reader.knowledge) or re.split(r",? and |,? then |, ", match["of"])
    pictured = (Subject(of=_pictured(of, state, reader), at=at, camera=match["camera"] or None) for of in subjects)
    return tuple(Picture(subject=subject) for subject in pictured), state.elsewhere


def _pictured(what: str, state: State, reader: PlainReader) -> str:
    """Place, or object of a kind, that a picture shows. Raises RefusalError for one of several, or at a place."""
    place = reader.knowledge.place(re.sub(r"^(?:the|a|an|my|our|your) ", "", what, flags=re.IGNORECASE))
    if place is not None:
        return place
    finds, *more = reader.read_commands(what, state, (verb("find"),)).commands
    if more or finds.object is None or finds.object.relations or finds.object_count != 1:
        raise RefusalError(f"I cannot tell in a picture which one is '{what}'", [what])
    usual = finds.goal == reader.knowledge.default_place(basic().look, finds.object.name)
    require(usual, f"I take a picture of the first {finds.object} that I see, not of '{what}'", what)
    return str(finds.object)


def _of_each(text: str, knowledge: Knowledge) -> list[str]:
    """Rooms, or surfaces of a kind, that "every table except the desk" means; none for other texts."""
    every, *others = re.split(r",? (?:except(?: for)?|but not|other than|apart from) ", text)
    kind = re.fullmatch(r"(?:every|each|all(?: of)?(?: the)?) (?:single )?(\w+?)s?", every, re.IGNORECASE)
    if kind is None:
        return []
    named = knowledge.rooms if kind[1].lower() == "room" else knowledge.surfaces
    of_kind = [name for name in named if kind[1].lower() in ("room", "surface", name.split()[-1].lower())]
    said = re.split(r",? (?:and|or) |, ", others[0]) if others else []
    left_out = [knowledge.place(re.sub(r"^(?:the|my|our) ", "", one, flags=re.IGNORECASE)) for one in said]
    known = len(others) <= 1 and None not in left_out
    require(known, f"I do not know what to leave out of '{text}'; name places", text)
    return [name for name in of_kind if name not in left_out]


def _parse_charging(text: str, known: Callable[[], State], reader: PlainReader) -> Done | None:
    """Parses charging up to a level; None if the text states no level."""
    if (match := _WAITING["charge"].fullmatch(text)) is None:
        return None
    level = require(
        _FULL if match["full"] else parse_share(match["level"]), _NO_CHARGE.format(match["level"]), match["level"]
    )
    return (Dock(charging=Charging(level=level)),), known().elsewhere


REQUESTS: Final = (parse_opening, _parse_pictures, _parse_charging, parse_wait)
"""Parsers of requests; each computes the state before a clause only if it understands the clause."""
