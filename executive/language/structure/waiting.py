"""Waiting for something, and charging up to a level, as they are spoken."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import Final

from executive.language.questions import RefusalError
from executive.language.structure.amounts import SHARE, SPAN, seconds_of, share_of, time_of
from executive.language.structure.conditions import meeting, pressed, reading, suppose
from executive.language.structure.leaves import Leaves, State, Supposed, negated
from executive.words.blocks import Dock, Wait
from executive.words.steps import MissionStep

__all__ = ["Done", "charged", "wait", "waited"]

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
    return wait(match["where"].strip(), match["how"].lower(), match["what"], state, leaves)


def wait(where: str, how: str, what: str, state: State, leaves: Leaves) -> Done:
    """A wait in a place: until something is so, for somebody ("for"), or as long as something is so.

    Raises RefusalError.
    """
    steps, there = _gone(where, state, leaves)
    if how in ("until", "till"):
        if (passed := _PASSED.fullmatch(what)) is not None and (span := seconds_of(passed["span"])) is not None:
            return (*steps, MissionStep(block=Wait(seconds=span))), there, ()
        if (time := time_of(_TIME.sub(r"\g<time>", what))) is not None:
            notes = (f"I take '{what}' as {time.text}",) if time.taken else ()
            return ((*steps, MissionStep(block=Wait(until_clock_s=time.seconds))), there, notes)
        return _until(suppose(what, there, leaves), steps, there)
    if how == "for":
        more, there, found = _awaited(what, there, leaves)
        return _until(found, (*steps, *more), there)
    found = suppose(what, there, leaves)
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
    leaf = leaves.going(match["place"] or match["there"], state)
    return (MissionStep(leaf.commands),), leaf.state


_BUTTON: Final = re.compile(
    r"(?P<button>the (?:[\w-]+ )?button)|a (?:press|push) (?:of|on) (?P<of>the (?:[\w-]+ )?button)", re.IGNORECASE
)
_PERSON_AT: Final = re.compile(r"(?P<who>.+?) (?:in|at) (?P<where>the .+)", re.IGNORECASE)


def _awaited(what: str, state: State, leaves: Leaves) -> tuple[tuple[MissionStep, ...], State, Supposed]:
    """What "wait for ..." waits for, and going there where a place is said."""
    if (match := _BUTTON.fullmatch(what)) is not None:
        return (), state, pressed(match["button"] or match["of"], what, state)
    if " to " in what and (found := reading(what, state, leaves)) is not None:
        return (), state, found
    if (match := _PERSON_AT.fullmatch(what)) is not None and leaves.somebody(match["who"], state):
        leaf = leaves.going(match["where"], state)
        found = meeting(match["who"], None, what, leaf.state, leaves)
        return (MissionStep(leaf.commands),), leaf.state, found
    if leaves.somebody(what, state):
        return (), state, meeting(what, None, what, state, leaves)
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
