"""What a mission decides by and waits for, as it is spoken: "there is a beer in the kitchen", "the battery is low"."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Final

from executive.language.questions import RefusalError
from executive.language.roles import HERE
from executive.language.structure.amounts import SHARE, SPAN, seconds_of, share_of, time_of
from executive.language.structure.cutting import pattern
from executive.language.structure.doors import door_condition
from executive.language.structure.leaves import Leaves, State, Supposed
from executive.words.condition import AllOf, AnyOf, ButtonPressed, Condition, DoorOpen, Not, ValueIs
from executive.words.expression import Expression

__all__ = ["negated", "suppose"]


def negated(condition: Condition) -> Condition:
    """The contrary."""
    return condition.part if isinstance(condition, Not) else Not(condition)


def suppose(text: str, state: State, leaves: Leaves) -> Supposed:
    """The condition that `text` tells. Raises RefusalError: it tells none that can be looked at or read."""
    words = " ".join(text.replace(" o' clock", " o'clock").split()).strip(" ,.")
    words = _TAIL.sub("", words)
    for read in _READERS:
        if (found := read(words, state, leaves)) is not None:
            return found
    if (unreal := pattern("unreal").search(words)) is not None:
        raise RefusalError(f"I can only decide by how things are now, not by '{words}'", [unreal[0]])
    joined = _joined(words, state, leaves)
    return joined if joined is not None else _look(words, state, leaves)


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
    r"(?:i|we|somebody|someone|the operator|anybody) (?:have |has )?(?:press|presses|pressed|push|pushes|pushed"
    r"|hit|hits|click|clicks)"
    r"(?: on)? (?P<one>(?:the|a|any) (?:[\w-]+ ){0,2}?)button"
    r"|(?P<other>(?:the|a) (?:[\w-]+ ){0,2}?)button (?:is|was|gets|has been|is being) (?:pressed|pushed|hit)",
    re.IGNORECASE,
)
_BUTTON: Final = "button"


def _button(words: str, state: State, leaves: Leaves) -> Supposed | None:
    match = _PRESSED.fullmatch(words)
    if match is None:
        return None
    name = re.sub(r"^(?:the|a|any)\s*", "", (match["one"] or match["other"]).strip(), flags=re.IGNORECASE)
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
    r"|returns|goes|are|come"
    r"|arrive|has come|has arrived|is coming|gets back)(?: back| in| up| over| here| home| by| along| again| there)*)"
    r"(?: (?:in|into|to|at|inside) (?P<place>the .+|here|there)| (?P<room>the .+))?",
    re.IGNORECASE,
)
_GOES: Final = re.compile(
    r"(?P<who>[\w' ]+?) (?:leaves|has left|is gone|goes away|has gone|is away|is not there|isn't there"
    r"|is no longer there"
    r"|is not here|isn't here|is no longer here|is there no more)(?: (?P<room>the .+))?",
    re.IGNORECASE,
)
_STAYS: Final = re.compile(r"(?P<who>[\w' ]+?) (?:is|stays|remains)(?: still)? (?:there|here)", re.IGNORECASE)
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
    nobody = _NOBODY.fullmatch(who) is not None
    if not (nobody or leaves.somebody(who, state)) or re.search(r"\b(?:or|and)\b", where or ""):
        return None
    room = _where(where, state, leaves)
    if room is None:
        raise RefusalError(f"in which room is '{words}' to be seen? Name it", [words])
    look = leaves.look("anybody" if nobody or who.lower() in _ANY else who, room, state)
    holds = Not(look.condition) if (gone is not None) != nobody else look.condition
    return replace(look, condition=holds, said=words)


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
_REWORDED: Final[tuple[tuple[re.Pattern[str], str], ...]] = tuple(
    (re.compile(spoken, re.IGNORECASE), meant)
    for spoken, meant in (
        (r"there(?: is|'s| are|'re) (?:no more|no longer any|not any more|no) (.+)", r"there is a \1"),
        (r"there(?: is|'s| are)(?:n't| not) (?:a|an|any|any more|enough) (.+)", r"there is a \1"),
        (r"there(?: is|'s| are) (?:none|no one|not any|n't any)(?: left| more)?(.*)", r"there is one\1"),
        (r"there(?: is|'s| are)(?:n't| not)(?: one| any)(?: left| more)?(.*)", r"there is one\1"),
        (r"(?:nobody|no one|no-one)(?: is|'s)(.+)", r"anybody is\1"),
        (r"there(?: is|'s) (?:nobody|no one)(.+)", r"anybody is\1"),
        (r"nothing(?: is|'s)(?: left)? (.+)", r"there is anything \1"),
        (r"there(?: is|'s) nothing(?: left)? (.+)", r"there is anything \1"),
        (
            r"(.+?)(?: is| are|'s)(?:n't| not)(?: any more| anymore| yet)? (in|on|at|inside|there|near|next to)\b(.*)",
            r"\1 is \2\3",
        ),
        (r"(.+?)(?: is| are|'s) no longer (in|on|at|inside|there|near|next to)\b(.*)", r"\1 is \2\3"),
        (r"(.+?)(?: is| are) (?:gone|missing) from (.+)", r"\1 is in \2"),
    )
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
        found = leaves.check(f"is there anything on {match['on'] or match['what']}", state, asked=True)
        empty = (match["how"] or "").lower() in ("empty", "free", "bare", "clear")
        return _turned(found, words) if empty != bool(match["not"]) else replace(found, said=words)
    for spoken, meant in _REWORDED:
        if (other := spoken.fullmatch(words)) is not None:
            return _turned(leaves.check(other.expand(meant), state), words)
    found = leaves.check(words, state)
    return replace(found, said=words)


def _seen(match: re.Match[str], words: str, state: State, leaves: Leaves) -> Supposed:
    what = match["what"]
    known = re.fullmatch(r"(?:it|him|her|them|one)\b.*", what, re.IGNORECASE) or re.match(r"the |my |[A-Z]", what)
    if re.fullmatch(r"it|one|him|her|them", what, re.IGNORECASE):
        found = leaves.check(f"find {what}", state, asked=True)
        return _turned(found, words) if match["not"] else replace(found, said=words)
    looks = re.match(r"you (?:can |do |could |\w+n't |not )*(?:see|spot|notice)\b", words, re.IGNORECASE)
    if looks and state.at is not None and leaves.somebody(what, state):
        found = leaves.look(what, state.at, state)
        return _turned(found, words) if match["not"] else replace(found, said=words)
    said = re.sub(r"^(him|them)\b", "it", what, flags=re.IGNORECASE)
    if re.fullmatch(r"it(?: there)?", said, re.IGNORECASE):
        said = "it is there"
    elif known and re.match(r"one\b", what) is None and " in " in f"{what} ":
        said = re.sub(r" (in|on|at) ", r" is \1 ", said, count=1)
    else:
        said = f"there is {said}"
    found = leaves.check(said, state)
    return _turned(found, words) if match["not"] else replace(found, said=words)


def _turned(found: Supposed, words: str) -> Supposed:
    """The contrary of what was looked for."""
    return Supposed(negated(found.condition), words, found.fails, found.holds, found.notes)


def _joined(words: str, state: State, leaves: Leaves) -> Supposed | None:
    """Several conditions with "and" or "or" between them."""
    for word, kind in ((" and ", AllOf), (" or ", AnyOf)):
        for before, after in _halves(words, word):
            parts = _both(before, after, state, leaves)
            if parts is None:
                continue
            first, second = parts
            flat = [
                each
                for one in parts
                for each in (one.condition.parts if isinstance(one.condition, kind) else (one.condition,))
            ]
            known = second.holds if kind is AllOf else _either(first, second, state)
            return Supposed(kind(tuple(flat)), words, known, state, (*first.notes, *second.notes))
    return None


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
        yield words[:start].removeprefix("both ").removeprefix("either ").strip(" ,"), after
        start = words.lower().find(word, start + 1)


def _both(before: str, after: str, state: State, leaves: Leaves) -> tuple[Supposed, Supposed] | None:
    if _THERE.match(before) and _BARE.match(after):
        after = f"there is {after}"
        place = _PLACED.search(after)
        before = before if place is None or _PLACED.search(before) else f"{before}{place[0]}"
    elif (is_there := _IS_THERE.match(before)) is not None and re.match(r"(?:in|on|at) ", after, re.IGNORECASE):
        after = f"{is_there[1]} is {after}"
    elif (seen := _THERE_AT.match(before)) is not None and re.match(r"(?:in|on|at|the) ", after, re.IGNORECASE):
        if " is " not in after:
            after = f"{seen[1]} {'' if after[:4].lower() != 'the ' else seen[2] + ' '}{after}"
    elif is_there is not None and re.match(r"the ", after, re.IGNORECASE) and " is " not in after:
        after = f"{is_there[1]} is {is_there[2]} {after}"
    try:
        first = suppose(before, state, leaves)
        return first, suppose(after, first.holds, leaves)
    except RefusalError:
        return None


_THERE: Final = re.compile(r"there(?: is|'s| are)\b|you (?:find|see)\b", re.IGNORECASE)
_PLACED: Final = re.compile(r" (?:in|on|at) (?:the|my) .+", re.IGNORECASE)
_IS_THERE: Final = re.compile(r"(.+?) is (in|on|at) the [\w ]+$", re.IGNORECASE)
_THERE_AT: Final = re.compile(r"((?:there (?:is|are)|you (?:find|see)) .+?) (in|on|at) the [\w ]+$", re.IGNORECASE)
_BARE: Final = re.compile(r"(?:a|an|some|any|two|three|no) ", re.IGNORECASE)
_Reader = Callable[[str, State, Leaves], Supposed | None]
_READERS: Final[tuple[_Reader, ...]] = (_battery, _holding, _place, _clock, _button, _door, _meeting)
