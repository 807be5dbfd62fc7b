"""Parses spoken conditions: "there is a beer in the kitchen", "the battery is low"."""

import re
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Final

from executive.language.amounts import parse_seconds, parse_share, parse_time
from executive.language.clauses import CLAUSES
from executive.language.indirect import CONTENTS, OBJECTS
from executive.language.items import Adverb, Chunk, Whether, verb
from executive.language.questions import RefusalError, RefusalKind, Slot, which_question
from executive.language.roles import HERE
from executive.language.spelling import synonyms_of
from executive.language.structure.plain import IS, IT, PlainReader, SpokenCondition, State, with_preposition
from executive.language.templates import Match, page
from executive.words.condition import AllOf, AnyOf, ButtonPressed, DoorOpen, Not, ValueIs
from executive.words.knowledge import Knowledge
from executive.words.leaf_steps import DoorToOpen, OpenDoor
from executive.words.steps import Steps
from skills.inputs.errors import listing

_P: Final = page("conditions")
_DOORS: Final = page("doors")
_JOINED: Final = page("joined")
Done = tuple[Steps, State, tuple[str, ...]]
"""Steps, the state after them, and notes."""
RequestParser = Callable[[str, Callable[[], State], PlainReader], Done | None]
"""Parses a clause; the state before it is only computed for a request that it understands."""
FULL: Final = 0.99
"""Share at which a battery is full."""


def parse_condition(text: str, state: State, reader: PlainReader) -> SpokenCondition:
    """Parses a condition. Raises RefusalError when the robot can neither see nor measure it."""
    words = " ".join(text.replace(" o' clock", " o'clock").split()).strip(" ,.")
    words = words if (tail := _P["tail"].fullmatch(words)) is None else tail["condition"]
    if (found := usual_condition(words, state, reader)) is not None:
        return found
    if (unreal := CLAUSES["unreal"].search(words)) is not None:
        raise RefusalError(f"I can only decide by what I see now, not by '{words}'", [unreal.text])
    joined, left_open = _joined(words, state, reader)
    if joined is not None:
        return joined
    try:
        return _look(words, state, reader)
    except RefusalError as refusal:
        raise refusal if refusal.question is not None or left_open is None else left_open from None


def usual_condition(words: str, state: State, reader: PlainReader) -> SpokenCondition | None:
    """Parses a condition in a usual form: battery, gripper, place, clock, button, door, or people who come or go."""
    if (pressed := _P["pressed"].fullmatch(words)) is not None:
        return button_condition(pressed["button"], words, state)
    readers = (_measured, _door, _meeting)
    return next((found for read in readers if (found := read(words, state, reader)) is not None), None)


def _measured(words: str, state: State, reader: PlainReader) -> SpokenCondition | None:
    """Condition on a value that the robot measures: battery, gripper, place or time."""
    if (match := _P["measured"].fullmatch(words)) is None:
        return None
    share, seconds, time = parse_share(match["share"]), parse_seconds(match["span"]), parse_time(match["time"])
    if match["share"] and share is None:
        raise RefusalError(f"'{match['share']}' is no charge; say it in percent", [match["share"]])
    if (match["span"] and seconds is None) or (match["time"] and time is None):
        return None
    facts, sign = reader.knowledge.battery, match["sign"] or ">="
    values = {"low": facts.low, "charged": facts.charged, "full": FULL, "sign": sign, "share": share, "span": seconds}
    text = match["value"].format(**values, time=None if time is None else time.text)
    notes = () if time is None else time.notes(match["time"])
    found = SpokenCondition(ValueIs(text=text), words, state, state, notes)
    return found.negate(words) if match["not"] else found


def button_condition(button: str, words: str, state: State) -> SpokenCondition:
    """Condition that a button is pressed; the text names the button with its article, `words` are the whole text."""
    name = re.sub(r"^(?:the|a|any)\b\s*|\s*\bbutton$", "", button.strip(), flags=re.IGNORECASE).strip()
    return SpokenCondition(ButtonPressed(button=name.lower() or "button"), words, state, state)


def _door(words: str, state: State, reader: PlainReader) -> SpokenCondition | None:
    """Condition that a door is open or closed; "it" refers to the last door. Raises RefusalError like `_between`."""
    match = _DOORS["stands"].fullmatch(words)
    if match is None or (match["it"] and state.door is None):
        return None
    if (how := match["how"].lower()).endswith("locked"):
        raise RefusalError(
            f"I cannot see whether a door is {how}; ask whether it is closed", [how], kind=RefusalKind.UNSEEN
        )
    door = state.door if match["it"] and state.door is not None else DoorOpen(door=_between(match, reader.knowledge))
    opens = how in ("open", "opened", "opens", "to open", "is opening", "has opened")
    known = replace(state, door=door, goal=None, at=None)
    found = SpokenCondition(door, words, known, known)
    return found if opens != bool(match["not"]) else found.negate(words)


def parse_opening(text: str, known: Callable[[], State], reader: PlainReader) -> Done | None:
    """Parses a request to have a door opened: its step, the state afterwards, no notes; None for other texts.

    Raises RefusalError like `_between`, and if the robot would have to open a door that has no plug-in.
    """
    match = _DOORS["opening"].fullmatch(re.sub(r" for (?:me|us|you|him|her|them)$", "", text, flags=re.IGNORECASE))
    if match is None or ((state := known()).door is None and match["it"]):
        return None
    own, doors = match["own"], [door for door in reader.knowledge.doors if door.opens is not None]
    door = state.door if match["it"] or (own and not doors) else DoorOpen(door=_between(match, reader.knowledge))
    if door is None or (own and all(set(door.door) != {*one.between} for one in doors)):
        said = match["door"] or "it"
        raise RefusalError(f"I cannot open {said} myself; say 'ask somebody to open {said}'", [match.text])
    return (OpenDoor(door=DoorToOpen(door=door.door)),), replace(state, door=door, goal=None, at=None), ()


def _between(match: Match, knowledge: Knowledge) -> tuple[str, str]:
    """Rooms on the two sides of a door.

    Raises RefusalError when there is no such door; with a question when there are several.
    """
    bare = re.sub(r"^(?:the|that|this|a) ", "", match["door"], flags=re.IGNORECASE)
    if not knowledge.doors:
        what = f"I know no door here, so I cannot look at '{match['door']}'"
        raise RefusalError(what, [bare], kind=RefusalKind.NO_SUCH_DOOR)
    named = filter(None, (match[name] for name in ("room", "one", "other", "from", "to", "of")))
    rooms = {_room(name, knowledge) for name in named}
    fitting = [door.between for door in knowledge.doors if rooms <= {*door.between}]
    if not fitting:
        known = listing(" and ".join(door.between) for door in knowledge.doors)
        what = f"I know no such door as '{match['door']}'; there are doors between {known}"
        raise RefusalError(what, [bare], kind=RefusalKind.NO_SUCH_DOOR)
    if len(fitting) > 1:
        question = which_question(Slot.PLACE, bare, tuple(f"door between {one} and {other}" for one, other in fitting))
        raise RefusalError(question.text, [bare], question=question)
    return fitting[0]


def _room(name: str, knowledge: Knowledge) -> str:
    bare = re.sub(r"^(?:the|my|our|your) ", "", name, flags=re.IGNORECASE)
    known = {spelling.lower(): room for room in knowledge.rooms for spelling in knowledge.spellings([room])}
    found = knowledge.place(bare) or next(iter(synonyms_of(bare.lower(), known)), None)
    if found is None:
        what = f"I know no room '{bare}'; known are {listing(knowledge.rooms)}"
        raise RefusalError(what, [bare], kind=RefusalKind.NO_SUCH_DOOR)
    return knowledge.room(found)


def _meeting(words: str, state: State, reader: PlainReader) -> SpokenCondition | None:
    """Condition that somebody arrives at the robot's place, or leaves it."""
    gone = _P["goes"].fullmatch(words)
    match = gone or _P["comes"].fullmatch(words)
    if match is None or CLAUSES["unreal"].search(words):
        return None
    who, where = re.sub(r"\b(?:if|until)\b", "", match["who"]).strip(), match["place"] or None
    where = "there" if where is None and re.search(r"\bthere(?: any more)?$", words, re.IGNORECASE) else where
    if not (_P["nobody"].fullmatch(who) or reader.is_somebody(who, state)) or re.search(r"\b(?:or|and)\b", where or ""):
        return None
    return presence_condition(who, where, words, state, reader, gone=gone is not None)


def presence_condition(
    who: str, where: str | None, words: str, state: State, reader: PlainReader, *, gone: bool = False
) -> SpokenCondition:
    """Condition that somebody, or nobody, is at the robot's place or in a room; `words` are its text. Raises
    RefusalError.

    "There" may be an earlier room.
    """
    place = (where or "here").lower()
    room = state.at
    if place not in ("here", "there") or (place == "there" and state.memory.place != HERE):
        room = reader.room(place if place == "there" else where or "", state)
    if room is None:
        raise RefusalError(f"in which room can I see whether '{words}'? Name it", [words])
    nobody = _P["nobody"].fullmatch(who) is not None
    look = reader.look("anybody" if nobody or _P["anybody"].fullmatch(who) else who, room, words, state)
    return replace(look, condition=Not(part=look.condition) if gone != nobody else look.condition)


def _look(words: str, state: State, reader: PlainReader) -> SpokenCondition:
    """Condition that something is visible, or not visible. Raises RefusalError."""
    if (match := _P["sees"].fullmatch(words)) is not None:
        return _seen(match, words, state, reader)
    if (match := _P["fullness"].fullmatch(words)) is None:
        return reader.check(words, state)
    some = match["some"] != ""
    place = with_preposition(reader.read_items(match["place"]), "on" if some else "at")
    found = reader.look_by_items((verb("find"), Chunk(OBJECTS if some else CONTENTS), *place), words, state)
    empty = match["how"].lower() in ("empty", "free", "bare", "clear")
    return found.negate(words) if empty != bool(match["not"]) else found


def _seen(match: Match, words: str, state: State, reader: PlainReader) -> SpokenCondition:
    """Condition that the robot sees, or does not see, an object or a person."""
    said = match["what"]
    what = re.sub(r"^(?:him|them)(?= )", "it", said, flags=re.IGNORECASE)
    if re.fullmatch(r"it|one|him|her|them", what, re.IGNORECASE):
        found = reader.look_by_items((verb("find"), *reader.read_items(what)), words, state)
    elif match["looks"] and state.at is not None and reader.is_somebody(said, state):
        found = reader.look(said, state.at, words, state)
    elif re.fullmatch(r"it there", what, re.IGNORECASE):
        found = reader.look_by_items((verb("check"), Whether(), IT, IS, Adverb(here=False)), words, state)
    else:
        found = reader.exists(what, words, state)
    return found.negate(words) if match["not"] else found


def _joined(words: str, state: State, reader: PlainReader) -> tuple[SpokenCondition | None, RefusalError | None]:
    """Joins two conditions by "and" or "or"; returns None if that fails, with the first question that a half raised."""
    left_open: RefusalError | None = None
    for word, kind in ((" and ", AllOf), (" or ", AnyOf)):
        for before, after in _halves(words, word):
            try:
                first, second = _both(before, after, state, reader)
            except RefusalError as refusal:
                left_open = left_open or (refusal if refusal.question is not None else None)
                continue
            known = second.holds
            if kind is AnyOf:  # the person of two conditions on one person, without the place
                one, other = first.holds.memory.person, second.holds.memory.person
                same = one is not None and other is not None and one.name == other.name
                person = replace(one, within=None) if one is not None and same else state.memory.person
                known = replace(state, goal=None, at=None, memory=replace(state.memory, person=person))
            both = (first.condition, second.condition)
            parts = tuple(each for one in both for each in (one.parts if isinstance(one, kind) else (one,)))
            if any(isinstance(each, Not) and each.part in parts for each in parts):
                raise RefusalError(f"'{words}' says one thing and its opposite; say one of the two", [words])
            return SpokenCondition(kind(parts=parts), words, known, state, (*first.notes, *second.notes)), None
    return None, left_open


def _halves(words: str, word: str) -> Iterator[tuple[str, str]]:
    start = words.lower().find(word)
    while start > 0:
        after = words[start + len(word) :].removeprefix("if ").removeprefix("that ")
        yield (words[:start].removeprefix("both ").removeprefix("either ").strip(" ,"), after)
        start = words.lower().find(word, start + 1)


def _both(before: str, after: str, state: State, reader: PlainReader) -> tuple[SpokenCondition, SpokenCondition]:
    """Parses two joined conditions; the second may omit words of the first, and the first the place of both."""
    first = parse_condition(before, state, reader)
    denied = isinstance(first.condition, Not)
    if _JOINED["there"].match(before) and _JOINED["bare"].match(after):
        items = reader.read_items(after)
        place = next((item for item in items if isinstance(item, Chunk) and item.role is not None), None)
        if place is not None and not _JOINED["placed"].search(before):
            first = reader.look_by_items((*first.items, place), before, state)
            first = first.negate(before) if denied else first
        return first, reader.exists(after, after, first.holds)
    if _JOINED["at"].fullmatch(before) and re.match(r"(?:in|on|at|the) ", after, re.IGNORECASE) and " is " not in after:
        old = next((item for item in first.items if isinstance(item, Chunk) and item.role is not None), None)
        moved = with_preposition(reader.read_items(after), "in" if old is None else old.preposition)
        second = reader.look_by_items((*(one for one in first.items if one is not old), *moved), after, first.holds)
        return first, second.negate(after) if denied else second
    return first, parse_condition(after, first.holds, reader)
