"""Waiting for something, and charging up to a level, as they are spoken."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import Final

from executive.language.questions import RefusalError
from executive.language.structure.amounts import SHARE, SPAN, seconds_of, share_of, time_of
from executive.language.structure.conditions import negated, suppose
from executive.language.structure.leaves import Leaves, State, Supposed
from executive.words.blocks import Dock, Wait
from executive.words.steps import MissionStep

__all__ = ["Done", "charged", "waited"]

Done = tuple[tuple[MissionStep, ...], State, tuple[str, ...]]
"""Steps, what is known behind them, and notes."""

_WAIT: Final = re.compile(
    r"(?:wait|stay|remain|pause|hold|stand|stand by|linger|stay put)(?P<where>(?: [\w']+)*?) (?P<how>until|till"
    r"|(?:for )?as long as|while|for)\b ?(?P<what>.+)",
    re.IGNORECASE,
)
_HERE: Final = re.compile(r"(?:|here|right here|where you are|around|still|over here)", re.IGNORECASE)
_PLACE: Final = re.compile(
    r"(?:over |right )?(?:in|at|by|near|next to|inside|beside) (?P<place>.+)|(?P<there>there)", re.IGNORECASE
)
_PASSED: Final = re.compile(rf"(?P<span>{SPAN}) (?:have|has|are|is) (?:passed|gone by|elapsed|over|up)", re.IGNORECASE)
_TIME: Final = re.compile(r"(?:it is|it's|the clock says) (?P<time>.+)", re.IGNORECASE)


def waited(text: str, state: State, leaves: Leaves) -> Done | None:
    """A wait for something to be so; None where it is none, or only for some time. Raises RefusalError."""
    match = _WAIT.fullmatch(text)
    if match is None or re.fullmatch(rf"(?:about |another )?{SPAN}", match["what"], re.IGNORECASE):
        return None
    steps, there = _gone(match["where"].strip(), state, leaves)
    if match["how"].lower() in ("until", "till"):
        if (passed := _PASSED.fullmatch(match["what"])) is not None and (
            span := seconds_of(passed["span"])
        ) is not None:
            return (*steps, MissionStep(block=Wait(seconds=span))), there, ()
        time = time_of(_TIME.sub(r"\g<time>", match["what"]))
        if time is not None:
            notes = (f"I take '{match['what']}' as {time.text}",) if time.taken else ()
            return (*steps, MissionStep(block=Wait(until_clock_s=time.seconds))), there, notes
        found = suppose(match["what"], there, leaves)
        return _until(found, steps, there)
    if match["how"].lower() == "for":
        more, there, what = _awaited(match["what"], there, leaves)
        return _until(suppose(what, there, leaves), (*steps, *more), there)
    found = suppose(match["what"], there, leaves)
    return _until(replace(found, condition=negated(found.condition), holds=found.fails), steps, there)


def _until(found: Supposed, steps: tuple[MissionStep, ...], there: State) -> Done:
    after = replace(found.holds, goal=found.holds.goal or there.goal)
    return (*steps, MissionStep(block=Wait(found.condition))), after, found.notes


def _gone(where: str, state: State, leaves: Leaves) -> tuple[tuple[MissionStep, ...], State]:
    """Where it is to be waited, and going there."""
    if _HERE.fullmatch(where):
        return (), state
    match = _PLACE.fullmatch(where)
    if match is None:
        raise RefusalError(f"I do not understand where to wait: '{where}'", [where])
    if match["there"] and state.goal is not None and state.at is not None:
        return (), state
    leaf = leaves.leaf(f"go {'to ' + match['place'] if match['place'] else 'there'}", state)
    return (MissionStep(leaf.commands),), leaf.state


_TO_PRESS: Final = re.compile(
    r"(?:me|us|somebody|someone|the operator) to (?P<act>(?:press|push|hit|click) .+)", re.IGNORECASE
)
_BUTTON: Final = re.compile(
    r"(?P<button>the (?:[\w-]+ )?button)(?: to be (?:pressed|pushed))?|a (?:press|push) (?:of|on) (?P<of>the "
    r"(?:[\w-]+ )?button)",
    re.IGNORECASE,
)
_TO_COME: Final = re.compile(
    r"(?P<who>.+?) to (?P<act>come|arrive|show up|appear|get|return|be|leave|enter|open|close|go|turn up)(?P<rest>.*)",
    re.IGNORECASE,
)
_PERSON_AT: Final = re.compile(r"(?P<who>.+?) (?:in|at) (?P<where>the .+)", re.IGNORECASE)
_FINITE: Final = {"be": "is", "go": "goes"}


def _awaited(what: str, state: State, leaves: Leaves) -> tuple[tuple[MissionStep, ...], State, str]:
    """What "wait for ..." waits for, in the words of "wait until ...", and going there where a place is said."""
    if (match := _TO_PRESS.fullmatch(what)) is not None:
        return (), state, f"I {match['act']}"
    if (match := _BUTTON.fullmatch(what)) is not None:
        return (), state, f"{match['button'] or match['of']} is pressed"
    if (match := _TO_COME.fullmatch(what)) is not None:
        act = _FINITE.get(match["act"].lower(), re.sub(r"^(\w+)", r"\1s", match["act"].lower()))
        return (), state, f"{match['who']} {act}{match['rest']}"
    if (match := _PERSON_AT.fullmatch(what)) is not None and leaves.somebody(match["who"], state):
        leaf = leaves.leaf(f"go to {match['where']}", state)
        return (MissionStep(leaf.commands),), leaf.state, f"{match['who']} comes"
    if leaves.somebody(what, state):
        return (), state, f"{what} comes"
    raise RefusalError(f"I do not understand what to wait for: '{what}'", [what])


_CHARGE: Final = re.compile(
    rf"(?:go )?(?:and )?(?:to the dock and )?(?:charge|recharge|dock)(?: yourself| your battery| the battery"
    rf"| up| and charge| at the dock)*"
    rf" (?:to|up to|until|till)(?: you are| you're| it is| the battery is| your battery is| you have| it has"
    rf"| reaching)?(?: at| charged to| to)?(?: at least)?"
    rf" (?P<level>{SHARE}|full|fully charged)(?: charge| battery| charged)?",
    re.IGNORECASE,
)
_FULL: Final = 0.99


def charged(text: str, state: State) -> Done | None:
    """Charging up to a level; None where no level is said."""
    match = _CHARGE.fullmatch(text)
    if match is None:
        return None
    level = _FULL if match["level"].lower().startswith("full") else share_of(match["level"])
    if level is None:
        raise RefusalError(f"'{match['level']}' is no charge; say it in percent", [match["level"]])
    return (MissionStep(block=Dock(level)),), replace(state, goal=None, at=None), ()
