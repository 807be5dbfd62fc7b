"""Parses spoken conditions: "there is a beer in the kitchen", "the battery is low"."""

import re
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Final

from executive.language.amounts import AMOUNTS, parse_seconds, parse_share, parse_time
from executive.language.clauses import CLAUSES
from executive.language.indirect import CONTENTS, OBJECTS
from executive.language.items import Adverb, Chunk, Whether, verb
from executive.language.lexicon import Patterns, any_of
from executive.language.questions import RefusalError, RefusalKind, Slot, which_question
from executive.language.roles import HERE
from executive.language.spelling import synonyms_of
from executive.language.structure.plain import IS, IT, PlainReader, SpokenCondition, State, with_preposition
from executive.words.condition import AllOf, AnyOf, ButtonPressed, DoorOpen, Not, ValueIs
from executive.words.knowledge import Knowledge
from executive.words.leaf_steps import DoorToOpen, OpenDoor
from executive.words.steps import Steps
from skills.inputs.errors import listing

_SIGNS: Final = {
    **dict.fromkeys(("below", "under", "less than", "lower than", "smaller than", "beneath"), "<"),
    **dict.fromkeys(("above", "over", "more than", "higher than", "greater than"), ">"),
    **dict.fromkeys(("at least", "at", "not below", "not under", "no less than", ""), ">="),
    **dict.fromkeys(("at most", "not above", "not over", "no more than", "down to"), "<="),
}
_P: Final = Patterns("structures.yaml", "conditions", {**AMOUNTS, "compared": any_of(filter(None, _SIGNS))})
FULL: Final = 0.99
"""Share at which a battery is full."""


def parse_condition(text: str, state: State, reader: PlainReader) -> SpokenCondition:
    """Parses a condition. Raises RefusalError when the robot can neither see nor measure it."""
    words = _P.tail.sub("", " ".join(text.replace(" o' clock", " o'clock").split()).strip(" ,."))
    if (found := usual_condition(words, state, reader)) is not None:
        return found
    if (unreal := CLAUSES.unreal.search(words)) is not None:
        raise RefusalError(f"I can only decide by what I see now, not by '{words}'", [unreal[0]])
    joined, left_open = _joined(words, state, reader)
    if joined is not None:
        return joined
    try:
        return _look(words, state, reader)
    except RefusalError as refusal:
        raise refusal if refusal.question is not None or left_open is None else left_open from None


def usual_condition(words: str, state: State, reader: PlainReader) -> SpokenCondition | None:
    """Parses a condition in a usual form: battery, gripper, place, clock, button, door, or people who come or go."""
    return next((found for read in _READERS if (found := read(words, state, reader)) is not None), None)


def _value(expression: str, said: str, state: State, *notes: str) -> SpokenCondition:
    return SpokenCondition(ValueIs(text=expression), said, state, state, notes)


def _battery(words: str, state: State, reader: PlainReader) -> SpokenCondition | None:
    if (match := _P.battery.fullmatch(words)) is not None:
        if (share := parse_share(match["share"])) is None:
            raise RefusalError(f"'{match['share']}' is no charge; say it in percent", [match["share"]])
        return _value(f"battery {_SIGNS[(match['how'] or '').lower()]} {share:g}", words, state)
    if (match := _P.charged.fullmatch(re.sub(r"^you are", "you is", words))) is None:
        return None
    facts, how = reader.knowledge.battery, (match["how"] or match["low"] or "").lower()
    level = {"charged": f">= {facts.charged:g}", "full": f">= {FULL}", "fully charged": f">= {FULL}"}
    found = _value(f"battery {level.get(how, f'< {facts.low:g}')}", words, state)
    return found.negate(words) if match["not"] else found


def _holding(words: str, state: State, reader: PlainReader) -> SpokenCondition | None:
    words = re.sub(r"n't\b", " not", words)
    match = _P.holds.fullmatch(words) or _P.in_hand.fullmatch(words)
    if match is None:
        return None
    empty = (match["what"] or "").lower() == "nothing" or match.groupdict().get("how") in ("empty", "free")
    return _value("not holding" if empty != bool(match["not"]) else "holding", words, state)


def _place(words: str, state: State, reader: PlainReader) -> SpokenCondition | None:
    if _P.knows.fullmatch(words):
        return _value("localised", words, state)
    return _value("not localised", words, state) if _P.lost.fullmatch(words) else None


def _clock(words: str, state: State, reader: PlainReader) -> SpokenCondition | None:
    if (match := _P.passed.fullmatch(words)) is not None:
        seconds = parse_seconds(match["span"] or match["since"])
        return None if seconds is None else _value(f"elapsed >= {seconds:g}", words, state)
    match = _P.clock.fullmatch(words)
    time = None if match is None else parse_time(match["time"])
    if match is None or time is None:
        return None
    early = (match["how"] or "").lower() in ("before", "earlier than", "not yet") or "not yet" in words.lower()
    return _value(f'clock {"<" if early else ">="} "{time.text}"', words, state, *time.notes(match["time"]))


def _button(words: str, state: State, reader: PlainReader) -> SpokenCondition | None:
    match = _P.pressed.fullmatch(words)
    return None if match is None else button_condition(match["one"] or match["other"], words, state)


def button_condition(button: str, words: str, state: State) -> SpokenCondition:
    """Condition that a button is pressed; the text names the button with its article, `words` are the whole text."""
    name = re.sub(r"^(?:the|a|any)\b\s*|\s*\bbutton$", "", button.strip(), flags=re.IGNORECASE).strip()
    return SpokenCondition(ButtonPressed(button=name.lower() or "button"), words, state, state)


def _door(words: str, state: State, reader: PlainReader) -> SpokenCondition | None:
    """Condition that a door is open or closed; "it" refers to the last door. Raises RefusalError like `_between`."""
    match = _P.stands.fullmatch(words) or _P.turns.fullmatch(words)
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
    return found if opens != bool(match.groupdict().get("not")) else found.negate(words)


def parse_opening(text: str, state: State, reader: PlainReader) -> tuple[Steps, State, tuple[str, ...]] | None:
    """Parses a request to have a door opened: its step, the state afterwards, no notes; None for other texts.

    Raises RefusalError like `_between`, and if the robot would have to open a door that has no plug-in.
    """
    text = re.sub(r" for (?:me|us|you|him|her|them)$", "", text, flags=re.IGNORECASE)
    match = next((found for form in _P.each("opening") if (found := form.fullmatch(text)) is not None), None)
    if match is None or (match["it"] and state.door is None):
        return None
    own, doors = match.groupdict().get("own"), [door for door in reader.knowledge.doors if door.opens is not None]
    door = state.door if match["it"] or (own and not doors) else DoorOpen(door=_between(match, reader.knowledge))
    if door is None or (own and all(set(door.door) != {*one.between} for one in doors)):
        said = match["door"] or "it"
        raise RefusalError(f"I cannot open {said} myself; say 'ask somebody to open {said}'", [text])
    return (OpenDoor(door=DoorToOpen(door=door.door)),), replace(state, door=door, goal=None, at=None), ()


def _between(match: re.Match[str], knowledge: Knowledge) -> tuple[str, str]:
    """Rooms on the two sides of a door.

    Raises RefusalError when there is no such door; with a question when there are several.
    """
    bare = re.sub(r"^(?:the|that|this|a) ", "", match["door"], flags=re.IGNORECASE)
    if not knowledge.doors:
        what = f"I know no door here, so I cannot look at '{match['door']}'"
        raise RefusalError(what, [bare], kind=RefusalKind.NO_SUCH_DOOR)
    named = [match[name] for name in ("room", "one", "other", "from", "to", "of") if match[name]]
    rooms = {_room(name.strip(), knowledge) for name in named}
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
    gone = _P.goes.fullmatch(words)
    match = gone or _P.comes.fullmatch(words)
    if match is None or CLAUSES.unreal.search(words):
        return None
    who = re.sub(r"\b(?:if|until)\b", "", match["who"]).strip()
    where = match.groupdict().get("place") or match["room"]
    where = "there" if where is None and re.search(r"\bthere(?: any more)?$", words, re.IGNORECASE) else where
    if not (_P.nobody.fullmatch(who) or reader.is_somebody(who, state)) or re.search(r"\b(?:or|and)\b", where or ""):
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
    nobody = _P.nobody.fullmatch(who) is not None
    look = reader.look("anybody" if nobody or _P.anybody.fullmatch(who) else who, room, words, state)
    return replace(look, condition=Not(part=look.condition) if gone != nobody else look.condition)


def _look(words: str, state: State, reader: PlainReader) -> SpokenCondition:
    """Condition that something is visible, or not visible. Raises RefusalError."""
    if (match := _P.sees.fullmatch(words)) is not None:
        return _seen(match, words, state, reader)
    match = _P.fullness.fullmatch(re.sub(r"n't\b", " not", words))
    if match is None:
        return reader.check(words, state)
    place = with_preposition(reader.read_items(match["on"] or match["what"]), "on" if match["on"] else "at")
    found = reader.look_by_items((verb("find"), Chunk(OBJECTS if match["on"] else CONTENTS), *place), words, state)
    empty = (match["how"] or "").lower() in ("empty", "free", "bare", "clear")
    return found.negate(words) if empty != bool(match["not"]) else found


def _seen(match: re.Match[str], words: str, state: State, reader: PlainReader) -> SpokenCondition:
    """Condition that the robot sees, or does not see, an object or a person."""
    what = re.sub(r"^(?:him|them)(?= )", "it", match["what"], flags=re.IGNORECASE)
    looks = re.match(r"you (?:can |do |could |\w+n't |not )*(?:see|spot|notice)\b", words, re.IGNORECASE)
    if re.fullmatch(r"it|one|him|her|them", what, re.IGNORECASE):
        found = reader.look_by_items((verb("find"), *reader.read_items(what)), words, state)
    elif looks and state.at is not None and reader.is_somebody(match["what"], state):
        found = reader.look(match["what"], state.at, words, state)
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
    if _P.there.match(before) and _P.bare.match(after):
        items = reader.read_items(after)
        place = next((item for item in items if isinstance(item, Chunk) and item.role is not None), None)
        if place is not None and not _P.placed.search(before):
            first = reader.look_by_items((*first.items, place), before, state)
            first = first.negate(before) if denied else first
        return first, reader.exists(after, after, first.holds)
    if _P.at.fullmatch(before) and re.match(r"(?:in|on|at|the) ", after, re.IGNORECASE) and " is " not in after:
        old = next((item for item in first.items if isinstance(item, Chunk) and item.role is not None), None)
        moved = with_preposition(reader.read_items(after), "in" if old is None else old.preposition)
        second = reader.look_by_items((*(one for one in first.items if one is not old), *moved), after, first.holds)
        return first, second.negate(after) if denied else second
    return first, parse_condition(after, first.holds, reader)


_Reader = Callable[[str, State, PlainReader], SpokenCondition | None]
_READERS: Final[tuple[_Reader, ...]] = (_battery, _holding, _place, _clock, _button, _door, _meeting)
