"""What a mission decides by and waits for, as it is spoken: "there is a beer in the kitchen", "the battery is low"."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Final

from executive.language.items import Chunk, Item
from executive.language.questions import RefusalError
from executive.language.roles import HERE
from executive.language.structure.amounts import SHARE, SPAN, seconds_of, share_of, time_of
from executive.language.structure.cutting import pattern
from executive.language.structure.doors import door_condition
from executive.language.structure.leaves import Leaves, State, Supposed, negated, placed, verb
from executive.words.condition import AllOf, AnyOf, ButtonPressed, Condition, DoorOpen, Not, ValueIs
from executive.words.expression import Expression

__all__ = ["meeting", "pressed", "reading", "suppose"]


def suppose(text: str, state: State, leaves: Leaves) -> Supposed:
    """The condition that `text` tells. Raises RefusalError: it tells none that can be looked at or read."""
    words = _TAIL.sub("", " ".join(text.replace(" o' clock", " o'clock").split()).strip(" ,."))
    if (found := reading(words, state, leaves)) is not None:
        return found
    if (unreal := pattern("unreal").search(words)) is not None:
        raise RefusalError(f"I can only decide by how things are now, not by '{words}'", [unreal[0]])
    joined, left_open = _joined(words, state, leaves)
    if joined is not None:
        return joined
    try:
        return _look(words, state, leaves)
    except RefusalError as refusal:
        raise refusal if refusal.question is not None or left_open is None else left_open from None


def reading(words: str, state: State, leaves: Leaves) -> Supposed | None:
    """The condition of a usual form: of battery, hand, place, clock, button, door, or somebody who comes or leaves."""
    return next((found for read in _READERS if (found := read(words, state, leaves)) is not None), None)


_TAIL: Final = re.compile(r"(?: (?:left|any more|anymore|any longer|again|already|yet|now|at all))+$", re.IGNORECASE)


def _plain(condition: Condition, said: str, state: State, *notes: str) -> Supposed:
    return Supposed(condition, said, state, state, notes)


def _value(expression: str) -> Condition:
    return ValueIs(Expression(expression))


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
_COMPARED: Final = "|".join(sorted(filter(None, _SIGNS), key=len, reverse=True))
_CHARGE: Final = (
    r"(?:the |your )?(?:battery(?:'s)?|charge|battery level|battery charge|charge level|charge of (?:the|your) battery)"
    r"(?: level| charge)?"
)
_IS: Final = r"(?: is| 's|'s| has| drops| falls| goes| gets| rises| reaches)(?: still| already| only| again| charged)*"
_BATTERY: Final = re.compile(
    rf"(?:{_CHARGE}{_IS}|you (?:have|are at|are charged)|you're at)(?: charged)?(?: to)? ?(?P<how>{_COMPARED})? ?"
    rf"(?P<share>{SHARE})(?: charge| charged| full| battery| of (?:the |your )?(?:battery|charge))?(?: left)?",
    re.IGNORECASE,
)
_CHARGED: Final = re.compile(
    rf"(?:{_CHARGE}|you){_IS.removesuffix('*')}*(?: are)?(?: (?P<not>not))? (?P<how>low|nearly empty"
    rf"|almost empty|running low|full|fully charged|charged)"
    r"(?: on (?:battery|charge|power))?|(?:you|the battery|your battery) (?:are|is) (?P<low>running low)"
    r"(?: on (?:battery|power))?",
    re.IGNORECASE,
)
_FULL: Final = 0.99


def _battery(words: str, state: State, leaves: Leaves) -> Supposed | None:
    match = _BATTERY.fullmatch(words)
    if match is not None:
        share = share_of(match["share"])
        if share is None:
            raise RefusalError(f"'{match['share']}' is no charge; say it in percent", [match["share"]])
        return _plain(_value(f"battery {_SIGNS[(match['how'] or '').lower()]} {share:g}"), words, state)
    match = _CHARGED.fullmatch(re.sub(r"^you are", "you is", words))
    if match is None:
        return None
    facts, how = leaves.knowledge.battery, (match["how"] or match["low"] or "").lower()
    level = {"charged": f">= {facts.charged:g}", "full": f">= {_FULL}", "fully charged": f">= {_FULL}"}
    found = _value(f"battery {level.get(how, f'< {facts.low:g}')}")
    return _plain(negated(found) if match["not"] else found, words, state)


_HAND: Final = r"(?:your|the) (?:hand|gripper|hands|arm)"
_HOLDS: Final = re.compile(
    rf"you(?: are|'re| do)?(?P<not> not| n't)? (?:hold|holding|carry|carrying|have|got)(?: got)? "
    rf"(?P<what>something|anything|nothing|an object|a thing)(?: in {_HAND})?",
    re.IGNORECASE,
)
_IN_HAND: Final = re.compile(
    rf"(?:there is|there's) (?P<what>something|anything|nothing) in {_HAND}|{_HAND} (?:is"
    rf"|are) (?P<not>not )?(?P<how>empty|free|full)",
    re.IGNORECASE,
)


def _holding(words: str, state: State, leaves: Leaves) -> Supposed | None:
    words = re.sub(r"n't\b", " not", words)
    match = _HOLDS.fullmatch(words) or _IN_HAND.fullmatch(words)
    if match is None:
        return None
    empty = (match["what"] or "").lower() == "nothing" or match.groupdict().get("how") in ("empty", "free")
    return _plain(_value("not holding" if empty != bool(match["not"]) else "holding"), words, state)


_KNOWS: Final = re.compile(r"you (?:know|still know) where you are|you are localised", re.IGNORECASE)
_LOST: Final = re.compile(
    r"you (?:don't|do not) know where you are|you are (?:lost|not localised)|you (?:have )?lost your way|you get lost",
    re.IGNORECASE,
)


def _place(words: str, state: State, leaves: Leaves) -> Supposed | None:
    if _KNOWS.fullmatch(words):
        return _plain(_value("localised"), words, state)
    return _plain(_value("not localised"), words, state) if _LOST.fullmatch(words) else None


_CLOCK: Final = re.compile(
    r"(?:it is|it's|it gets|the time is|it becomes|it has gone)(?: already| not yet)? "
    r"(?P<how>after|past|later than|before|earlier than|not yet)? ?(?P<time>.+)",
    re.IGNORECASE,
)
_PASSED: Final = re.compile(
    rf"(?:more than |at least )?(?P<span>{SPAN}) (?:have|has) (?:passed|gone by|elapsed)"
    rf"|you have been (?:working|running|going|at it) (?:for )?(?:more than |longer than |at least )?(?P<since>{SPAN})",
    re.IGNORECASE,
)


def _clock(words: str, state: State, leaves: Leaves) -> Supposed | None:
    match = _PASSED.fullmatch(words)
    if match is not None:
        seconds = seconds_of(match["span"] or match["since"])
        return None if seconds is None else _plain(_value(f"elapsed >= {seconds:g}"), words, state)
    match = _CLOCK.fullmatch(words)
    time = None if match is None else time_of(match["time"])
    if match is None or time is None:
        return None
    early = (match["how"] or "").lower() in ("before", "earlier than", "not yet") or "not yet" in words.lower()
    notes = (f"I take '{match['time']}' as {time.text}",) if time.taken else ()
    return _plain(_value(f'clock {"<" if early else ">="} "{time.text}"'), words, state, *notes)


_PRESSED: Final = re.compile(
    r"(?:i|we|me|us|somebody|someone|the operator|anybody) (?:have |has |to )?(?:press|presses|pressed|push|pushes"
    r"|pushed|hit|hits|click|clicks)"
    r"(?: on)? (?P<one>(?:the|a|any) (?:[\w-]+ ){0,2}?)button"
    r"|(?P<other>(?:the|a) (?:[\w-]+ ){0,2}?)button (?:is|was|gets|has been|is being|to be) (?:pressed|pushed|hit)",
    re.IGNORECASE,
)
_BUTTON: Final = "button"


def _button(words: str, state: State, leaves: Leaves) -> Supposed | None:
    match = _PRESSED.fullmatch(words)
    if match is None:
        return None
    return pressed(match["one"] or match["other"], words, state)


def pressed(button: str, words: str, state: State) -> Supposed:
    """Whether a button is pressed, which is spoken of with its article; `words` say it."""
    name = re.sub(r"^(?:the|a|any)\b\s*|\s*\bbutton$", "", button.strip(), flags=re.IGNORECASE).strip()
    return _plain(ButtonPressed(name.lower() or _BUTTON), words, state)


def _door(words: str, state: State, leaves: Leaves) -> Supposed | None:
    found = door_condition(words, state.door, leaves.knowledge)
    if found is None:
        return None
    door = found.part if isinstance(found, Not) else found
    assert isinstance(door, DoorOpen)
    known = replace(state, door=door, goal=None, at=None)
    return Supposed(found, words, known, known)


_COMES: Final = re.compile(
    r"(?P<who>[\w' ]+?) (?:(?:comes|arrives|shows up|appears|gets|is|'s|turns up|walks in|steps in|enters"
    r"|returns|goes|are|come|arrive|has come|has arrived|is coming|gets back"
    r"|to (?:come|arrive|show up|appear|get|return|be|enter|turn up))"
    r"(?: back| in| up| over| here| home| by| along| again| there)*)"
    r"(?: (?:in|into|to|at|inside) (?P<place>the .+|here|there)| (?P<room>the .+))?",
    re.IGNORECASE,
)
_GOES: Final = re.compile(
    r"(?P<who>[\w' ]+?) (?:leaves|has left|is gone|goes away|has gone|is away|is not there|isn't there"
    r"|is no longer there|is not here|isn't here|is no longer here|is there no more|to leave|to go away)"
    r"(?: (?P<room>the .+))?",
    re.IGNORECASE,
)
_NOBODY: Final = re.compile(r"(?:nobody|no one|no-one|no people|none)", re.IGNORECASE)


def _meeting(words: str, state: State, leaves: Leaves) -> Supposed | None:
    """Somebody comes to where the robot is, or leaves it."""
    gone = _GOES.fullmatch(words)
    match = gone or _COMES.fullmatch(words)
    if match is None or pattern("unreal").search(words):
        return None
    who = re.sub(r"\b(?:if|until)\b", "", match["who"]).strip()
    where = match.groupdict().get("place") or match["room"]
    where = "there" if where is None and re.search(r"\bthere(?: any more)?$", words, re.IGNORECASE) else where
    if not (_NOBODY.fullmatch(who) or leaves.somebody(who, state)) or re.search(r"\b(?:or|and)\b", where or ""):
        return None
    return meeting(who, where, words, state, leaves, gone=gone is not None)


def meeting(who: str, where: str | None, words: str, state: State, leaves: Leaves, *, gone: bool = False) -> Supposed:
    """Whether somebody, or nobody, is where the robot is, or in a room; `words` say it. Raises RefusalError."""
    nobody = _NOBODY.fullmatch(who) is not None
    room = _where(where, state, leaves)
    if room is None:
        raise RefusalError(f"in which room is '{words}' to be seen? Name it", [words])
    look = leaves.look("anybody" if nobody or who.lower() in _ANY else who, room, words, state)
    return replace(look, condition=Not(look.condition) if gone != nobody else look.condition)


def _where(where: str | None, state: State, leaves: Leaves) -> str | None:
    """The room that is meant: where the robot is, unless another one is said; "there" may be one that was spoken of."""
    if where is None or where.lower() == "here":
        return state.at
    if where.lower() != "there":
        return leaves.room(where, state)
    spoken_of = state.memory.place
    return state.at if spoken_of == HERE else leaves.room("there", state)


_ANY: Final = frozenset(
    {"somebody", "someone", "anyone", "anybody", "a person", "people", "any person", "they", "a guest"}
)
_SEES: Final = re.compile(
    r"you (?:can |do |could )?(?P<not>(?:can ?not|can't|don't|do not|did not|fail to) )?(?:still |manage to )?"
    r"(?:find|see|spot|discover|notice|have found|found)(?: that)? (?P<what>.+)",
    re.IGNORECASE,
)
_FILLED: Final = re.compile(
    r"(?:there is|there's) (?P<some>something|anything) (?:left )?(?:in|on|at) (?P<on>the .+)"
    r"|(?P<what>the .+?) is (?P<not>not )?(?P<how>empty|free|bare|clear|full|occupied)",
    re.IGNORECASE,
)


def _look(words: str, state: State, leaves: Leaves) -> Supposed:
    """Something to be seen, or not to be seen. Raises RefusalError."""
    match = _SEES.fullmatch(words)
    if match is not None:
        return _seen(match, words, state, leaves)
    match = _FILLED.fullmatch(re.sub(r"n't\b", " not", words))
    if match is not None:
        found = leaves.anything_on(match["on"] or match["what"], words, state)
        empty = (match["how"] or "").lower() in ("empty", "free", "bare", "clear")
        return found.denied(words) if empty != bool(match["not"]) else found
    return leaves.check(words, state)


def _seen(match: re.Match[str], words: str, state: State, leaves: Leaves) -> Supposed:
    """That the robot sees, or does not see, something or somebody."""
    what = re.sub(r"^(?:him|them)(?= )", "it", match["what"], flags=re.IGNORECASE)
    looks = re.match(r"you (?:can |do |could |\w+n't |not )*(?:see|spot|notice)\b", words, re.IGNORECASE)
    if re.fullmatch(r"it|one|him|her|them", what, re.IGNORECASE):
        found = leaves.looked((verb("find"), *leaves.read(what)), words, state)
    elif looks and state.at is not None and leaves.somebody(match["what"], state):
        found = leaves.look(match["what"], state.at, words, state)
    elif re.fullmatch(r"it there", what, re.IGNORECASE):
        found = leaves.it_is_there(words, state)
    else:
        found = leaves.exists(what, words, state)
    return found.denied(words) if match["not"] else found


def _joined(words: str, state: State, leaves: Leaves) -> tuple[Supposed | None, RefusalError | None]:
    """Several conditions with "and" or "or" between them, or else a question about one of them."""
    left_open: RefusalError | None = None
    for word, kind in ((" and ", AllOf), (" or ", AnyOf)):
        for before, after in _halves(words, word):
            try:
                parts = _both(before, after, state, leaves)
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
            return Supposed(kind(tuple(flat)), words, known, state, (*first.notes, *second.notes)), None
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


def _both(before: str, after: str, state: State, leaves: Leaves) -> tuple[Supposed, Supposed]:
    """Two conditions, where the second may leave out what the first has said, or the first the place of both."""
    first = suppose(before, state, leaves)
    if _THERE.match(before) and _BARE.match(after):
        place = next((item for item in leaves.read(after) if _is_place(item)), None)
        if place is not None and not _PLACED.search(before):
            first = _looked_again(first, (*first.items, place), before, state, leaves)
        return first, leaves.exists(after, after, first.holds)
    if _AT.fullmatch(before) and re.match(r"(?:in|on|at|the) ", after, re.IGNORECASE) and " is " not in after:
        return first, _looked_again(first, _moved(first.items, leaves.read(after)), after, first.holds, leaves)
    return first, suppose(after, first.holds, leaves)


def _looked_again(first: Supposed, items: Sequence[Item], words: str, state: State, leaves: Leaves) -> Supposed:
    """The same condition with other items."""
    found = leaves.looked(items, words, state)
    return found.denied(words) if isinstance(first.condition, Not) else found


def _moved(items: Sequence[Item], to: Sequence[Item]) -> tuple[Item, ...]:
    """The items with another place."""
    old = next((item for item in items if isinstance(item, Chunk) and item.role is not None), None)
    rest = tuple(item for item in items if item is not old)
    return (*rest, *placed(to, old.preposition if isinstance(old, Chunk) else "in"))


def _is_place(item: Item) -> bool:
    return isinstance(item, Chunk) and item.role is not None


_THERE: Final = re.compile(r"there(?: is|'s| are)\b|you (?:find|see)\b", re.IGNORECASE)
_PLACED: Final = re.compile(r" (?:in|on|at) (?:the|my) .+", re.IGNORECASE)
_AT: Final = re.compile(r"(?:.+? is|(?:there (?:is|are)|you (?:find|see)) .+?) (?:in|on|at) the [\w ]+", re.IGNORECASE)
_BARE: Final = re.compile(r"(?:a|an|some|any|two|three|no) ", re.IGNORECASE)
_Reader = Callable[[str, State, Leaves], Supposed | None]
_READERS: Final[tuple[_Reader, ...]] = (_battery, _holding, _place, _clock, _button, _door, _meeting)
