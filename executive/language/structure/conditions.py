"""What a mission decides by and waits for, as it is spoken: "there is a beer in the kitchen", "the battery is low"."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Final

from executive.language.amounts import AMOUNTS, seconds_of, share_of, time_of
from executive.language.clauses import CLAUSES
from executive.language.items import Chunk, Item, verb
from executive.language.lexicon import Patterns, any_of
from executive.language.questions import RefusalError, RefusalKind, Slot, which
from executive.language.roles import HERE
from executive.language.spelling import synonyms_of
from executive.language.structure.plain import PlainReader, State, Supposed, behind_preposition, contrary
from executive.words.condition import AllOf, AnyOf, ButtonPressed, Condition, DoorOpen, Not, ValueIs
from executive.words.knowledge import Knowledge
from skills.files.errors import listing


def suppose(text: str, state: State, reader: PlainReader) -> Supposed:
    """The condition that `text` tells. Raises RefusalError: it tells none that can be looked at or read."""
    words = _P.tail.sub("", " ".join(text.replace(" o' clock", " o'clock").split()).strip(" ,."))
    if (found := usual_condition(words, state, reader)) is not None:
        return found
    if (unreal := CLAUSES.unreal.search(words)) is not None:
        raise RefusalError(f"I can only decide by how things are now, not by '{words}'", [unreal[0]])
    joined, left_open = _joined(words, state, reader)
    if joined is not None:
        return joined
    try:
        return _look(words, state, reader)
    except RefusalError as refusal:
        raise refusal if refusal.question is not None or left_open is None else left_open from None


def usual_condition(words: str, state: State, reader: PlainReader) -> Supposed | None:
    """The condition of a usual form: of battery, hand, place, clock, button, door, or somebody who comes or reader."""
    return next((found for read in _READERS if (found := read(words, state, reader)) is not None), None)


def _plain(condition: Condition, said: str, state: State, *notes: str) -> Supposed:
    return Supposed(condition, said, state, state, notes)


def _value(expression: str) -> Condition:
    return ValueIs(text=expression)


_BELOW: Final = ("below", "under", "less than", "lower than", "smaller than", "beneath")
_ABOVE: Final = ("above", "over", "more than", "higher than", "greater than")
_LEAST: Final = ("at least", "at", "not below", "not under", "no less than")
_MOST: Final = ("at most", "not above", "not over", "no more than", "down to")
_SIGNS: Final = {
    **dict.fromkeys(_BELOW, "<"),
    **dict.fromkeys(_ABOVE, ">"),
    **dict.fromkeys(_LEAST, ">="),
    **dict.fromkeys(_MOST, "<="),
    "": ">=",
}
_P: Final = Patterns("structures.yaml", "conditions", {**AMOUNTS, "compared": any_of(filter(None, _SIGNS))})
_FULL: Final = 0.99


def _battery(words: str, state: State, reader: PlainReader) -> Supposed | None:
    match = _P.battery.fullmatch(words)
    if match is not None:
        share = share_of(match["share"])
        if share is None:
            raise RefusalError(f"'{match['share']}' is no charge; say it in percent", [match["share"]])
        return _plain(_value(f"battery {_SIGNS[(match['how'] or '').lower()]} {share:g}"), words, state)
    match = _P.charged.fullmatch(re.sub(r"^you are", "you is", words))
    if match is None:
        return None
    facts, how = reader.knowledge.battery, (match["how"] or match["low"] or "").lower()
    level = {"charged": f">= {facts.charged:g}", "full": f">= {_FULL}", "fully charged": f">= {_FULL}"}
    found = _value(f"battery {level.get(how, f'< {facts.low:g}')}")
    return _plain(contrary(found) if match["not"] else found, words, state)


def _holding(words: str, state: State, reader: PlainReader) -> Supposed | None:
    words = re.sub(r"n't\b", " not", words)
    match = _P.holds.fullmatch(words) or _P.in_hand.fullmatch(words)
    if match is None:
        return None
    empty = (match["what"] or "").lower() == "nothing" or match.groupdict().get("how") in ("empty", "free")
    return _plain(_value("not holding" if empty != bool(match["not"]) else "holding"), words, state)


def _place(words: str, state: State, reader: PlainReader) -> Supposed | None:
    if _P.knows.fullmatch(words):
        return _plain(_value("localised"), words, state)
    return _plain(_value("not localised"), words, state) if _P.lost.fullmatch(words) else None


def _clock(words: str, state: State, reader: PlainReader) -> Supposed | None:
    match = _P.passed.fullmatch(words)
    if match is not None:
        seconds = seconds_of(match["span"] or match["since"])
        return None if seconds is None else _plain(_value(f"elapsed >= {seconds:g}"), words, state)
    match = _P.clock.fullmatch(words)
    time = None if match is None else time_of(match["time"])
    if match is None or time is None:
        return None
    early = (match["how"] or "").lower() in ("before", "earlier than", "not yet") or "not yet" in words.lower()
    notes = (f"I take '{match['time']}' as {time.text}",) if time.taken else ()
    return _plain(_value(f'clock {"<" if early else ">="} "{time.text}"'), words, state, *notes)


_BUTTON: Final = "button"


def _button(words: str, state: State, reader: PlainReader) -> Supposed | None:
    match = _P.pressed.fullmatch(words)
    if match is None:
        return None
    return button_condition(match["one"] or match["other"], words, state)


def button_condition(button: str, words: str, state: State) -> Supposed:
    """Whether a button is pressed, which is spoken of with its article; `words` say it."""
    name = re.sub(r"^(?:the|a|any)\b\s*|\s*\bbutton$", "", button.strip(), flags=re.IGNORECASE).strip()
    return _plain(ButtonPressed(button=name.lower() or _BUTTON), words, state)


def _door(words: str, state: State, reader: PlainReader) -> Supposed | None:
    found = door_condition(words, state.door, reader.knowledge)
    if found is None:
        return None
    door = found.part if isinstance(found, Not) else found
    assert isinstance(door, DoorOpen)
    known = replace(state, door=door, goal=None, at=None)
    return Supposed(found, words, known, known)


def _meeting(words: str, state: State, reader: PlainReader) -> Supposed | None:
    """Somebody comes to where the robot is, or leaves it."""
    gone = _P.goes.fullmatch(words)
    match = gone or _P.comes.fullmatch(words)
    if match is None or CLAUSES.unreal.search(words):
        return None
    who = re.sub(r"\b(?:if|until)\b", "", match["who"]).strip()
    where = match.groupdict().get("place") or match["room"]
    where = "there" if where is None and re.search(r"\bthere(?: any more)?$", words, re.IGNORECASE) else where
    if not (_P.nobody.fullmatch(who) or reader.is_somebody(who, state)) or re.search(r"\b(?:or|and)\b", where or ""):
        return None
    return meeting(who, where, words, state, reader, gone=gone is not None)


def meeting(
    who: str, where: str | None, words: str, state: State, reader: PlainReader, *, gone: bool = False
) -> Supposed:
    """Whether somebody, or nobody, is where the robot is, or in a room; `words` say it. Raises RefusalError."""
    nobody = _P.nobody.fullmatch(who) is not None
    room = _where(where, state, reader)
    if room is None:
        raise RefusalError(f"in which room is '{words}' to be seen? Name it", [words])
    look = reader.look("anybody" if nobody or who.lower() in _ANY else who, room, words, state)
    return replace(look, condition=Not(part=look.condition) if gone != nobody else look.condition)


def _where(where: str | None, state: State, reader: PlainReader) -> str | None:
    """The room that is meant: where the robot is, unless another one is said; "there" may be one that was spoken of."""
    if where is None or where.lower() == "here":
        return state.at
    if where.lower() != "there":
        return reader.room(where, state)
    spoken_of = state.memory.place
    return state.at if spoken_of == HERE else reader.room("there", state)


_ANY: Final = frozenset(
    {"somebody", "someone", "anyone", "anybody", "a person", "people", "any person", "they", "a guest"}
)


def _look(words: str, state: State, reader: PlainReader) -> Supposed:
    """Something to be seen, or not to be seen. Raises RefusalError."""
    match = _P.sees.fullmatch(words)
    if match is not None:
        return _seen(match, words, state, reader)
    match = _P.fullness.fullmatch(re.sub(r"n't\b", " not", words))
    if match is not None:
        found = reader.anything_on(match["on"] or match["what"], words, state)
        empty = (match["how"] or "").lower() in ("empty", "free", "bare", "clear")
        return found.denied(words) if empty != bool(match["not"]) else found
    return reader.check(words, state)


def _seen(match: re.Match[str], words: str, state: State, reader: PlainReader) -> Supposed:
    """That the robot sees, or does not see, something or somebody."""
    what = re.sub(r"^(?:him|them)(?= )", "it", match["what"], flags=re.IGNORECASE)
    looks = re.match(r"you (?:can |do |could |\w+n't |not )*(?:see|spot|notice)\b", words, re.IGNORECASE)
    if re.fullmatch(r"it|one|him|her|them", what, re.IGNORECASE):
        found = reader.look_by_items((verb("find"), *reader.items_of(what)), words, state)
    elif looks and state.at is not None and reader.is_somebody(match["what"], state):
        found = reader.look(match["what"], state.at, words, state)
    elif re.fullmatch(r"it there", what, re.IGNORECASE):
        found = reader.it_is_there(words, state)
    else:
        found = reader.exists(what, words, state)
    return found.denied(words) if match["not"] else found


def _joined(words: str, state: State, reader: PlainReader) -> tuple[Supposed | None, RefusalError | None]:
    """Several conditions with "and" or "or" between them, or else a question about one of them."""
    left_open: RefusalError | None = None
    for word, kind in ((" and ", AllOf), (" or ", AnyOf)):
        for before, after in _halves(words, word):
            try:
                parts = _both(before, after, state, reader)
            except RefusalError as refusal:
                left_open = left_open or (refusal if refusal.question is not None else None)
                continue
            first, second = parts
            flat = [
                each
                for one in parts
                for each in (one.condition.parts if isinstance(one.condition, kind) else (one.condition,))
            ]
            known = second.holds if kind is AllOf else _either(first, second, state)
            return Supposed(kind(parts=tuple(flat)), words, known, state, (*first.notes, *second.notes)), None
    return None, left_open


def _either(first: Supposed, second: Supposed, state: State) -> State:
    """What is known where one of two conditions holds: who is meant, where both are about one person, but not where."""
    one, other = first.holds.memory.person, second.holds.memory.person
    person = state.memory.person
    if one is not None and other is not None and one.name == other.name:
        person = replace(one, within=None)
    return replace(state, goal=None, at=None, memory=replace(state.memory, person=person))


def _halves(words: str, word: str) -> Iterator[tuple[str, str]]:
    start = words.lower().find(word)
    while start > 0:
        after = words[start + len(word) :].removeprefix("if ").removeprefix("that ")
        yield (words[:start].removeprefix("both ").removeprefix("either ").strip(" ,"), after)
        start = words.lower().find(word, start + 1)


def _both(before: str, after: str, state: State, reader: PlainReader) -> tuple[Supposed, Supposed]:
    """Two conditions, where the second may leave out what the first has said, or the first the place of both."""
    first = suppose(before, state, reader)
    if _P.there.match(before) and _P.bare.match(after):
        place = next((item for item in reader.items_of(after) if _is_place(item)), None)
        if place is not None and not _P.placed.search(before):
            first = _looked_again(first, (*first.items, place), before, state, reader)
        return first, reader.exists(after, after, first.holds)
    if _P.at.fullmatch(before) and re.match(r"(?:in|on|at|the) ", after, re.IGNORECASE) and " is " not in after:
        return first, _looked_again(first, _moved(first.items, reader.items_of(after)), after, first.holds, reader)
    return first, suppose(after, first.holds, reader)


def _looked_again(first: Supposed, items: Sequence[Item], words: str, state: State, reader: PlainReader) -> Supposed:
    """The same condition with other items."""
    found = reader.look_by_items(items, words, state)
    return found.denied(words) if isinstance(first.condition, Not) else found


def _moved(items: Sequence[Item], to: Sequence[Item]) -> tuple[Item, ...]:
    """The items with another place."""
    old = next((item for item in items if isinstance(item, Chunk) and item.role is not None), None)
    rest = tuple(item for item in items if item is not old)
    return (*rest, *behind_preposition(to, old.preposition if isinstance(old, Chunk) else "in"))


def _is_place(item: Item) -> bool:
    return isinstance(item, Chunk) and item.role is not None


_Reader = Callable[[str, State, PlainReader], Supposed | None]
_READERS: Final[tuple[_Reader, ...]] = (_battery, _holding, _place, _clock, _button, _door, _meeting)


_OPEN: Final = frozenset({"open", "opened", "opens", "to open", "is opening", "has opened"})


def door_condition(words: str, last: DoorOpen | None, knowledge: Knowledge) -> Condition | None:
    """That a door is open or not, where the words tell that; "it" is the door that was spoken of `last`.

    Raises:
        RefusalError: there is no such door, or several, with a question then.
    """
    match = _P.stands.fullmatch(words) or _P.turns.fullmatch(words)
    if match is None or (match["it"] and last is None):
        return None
    found = last if match["it"] and last is not None else DoorOpen(door=_between(match, knowledge))
    is_open = (match["how"].lower() in _OPEN) != bool(match.groupdict().get("not"))
    return found if is_open else Not(part=found)


def _between(match: re.Match[str], knowledge: Knowledge) -> tuple[str, str]:
    """The rooms on the two sides of the door that is meant."""
    said = match["door"]
    bare = re.sub(r"^(?:the|that|this|a) ", "", said, flags=re.IGNORECASE)
    if not knowledge.doors:
        what = f"I know no door here, so '{said}' cannot be looked at"
        raise RefusalError(what, [bare], kind=RefusalKind.NO_SUCH_DOOR)
    named = [match[name] for name in ("room", "one", "other", "from", "to", "of") if match[name]]
    rooms = {_room(name.strip(), knowledge) for name in named}
    fitting = [door.between for door in knowledge.doors if rooms <= {*door.between}]
    if not fitting:
        known = listing(f"{one} and {other}" for one, other in (door.between for door in knowledge.doors))
        what = f"I know no such door as '{said}'; there are doors between {known}"
        raise RefusalError(what, [bare], kind=RefusalKind.NO_SUCH_DOOR)
    if len(fitting) > 1:
        question = which(Slot.PLACE, bare, tuple(f"door between {one} and {other}" for one, other in fitting))
        raise RefusalError(question.text, [bare], question=question)
    return fitting[0]


def _room(name: str, knowledge: Knowledge) -> str:
    bare = re.sub(r"^(?:the|my|our|your) ", "", name, flags=re.IGNORECASE)
    known = {spelling.lower(): room for room in knowledge.places for spelling in knowledge.spellings([room])}
    found = knowledge.place(bare) or next(iter(synonyms_of(bare.lower(), known)), None)
    if found is None:
        what = f"I know no room '{bare}'; known are {listing(knowledge.places)}"
        raise RefusalError(what, [bare], kind=RefusalKind.NO_SUCH_DOOR)
    return knowledge.room(found)
