"""Deeds become drafts of commands: going for a thing and carrying it are two."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import zip_longest
from typing import Final

from executive.language.lexicon import VerbKind, lexicon
from executive.language.phrases import Phrase
from executive.language.reference import Deed
from executive.language.refusal import RefusalError
from executive.language.roles import HERE, Location
from executive.mission.command import Command, Task, Thing

__all__ = ["Draft", "draft_commands", "spoken_command"]

_GOES_FOR: Final = frozenset({VerbKind.FIND, VerbKind.PICK, VerbKind.ROUND_TRIP, VerbKind.SINGLE_TRIP})

_FETCHES: Final = frozenset({VerbKind.ROUND_TRIP, VerbKind.PICK})
_TAKES: Final = _GOES_FOR | {VerbKind.PLACE}


@dataclass(frozen=True)
class Draft:
    """A command whose names are still as they were spoken."""

    verb: str
    item: Phrase | None = None
    goal: Location | None = None
    task: Task | None = None
    object: Phrase | None = None


def draft_commands(deeds: Sequence[Deed]) -> tuple[Draft, ...]:
    """The commands of all deeds, in order.

    A place that the robot is sent to first is where the next deed's thing is looked for; a thing in the hand is not
    gone for again.

    Raises:
        RefusalError: it is not said where something is to go.
    """
    drafts: list[Draft] = []
    held: Phrase | None = None
    for index, deed in enumerate(joined := _set_down(_one_by_one(_join_going(_without_wishes(deeds))))):
        later = any(other.again and other.target == deed.target for other in joined[index + 1 :])
        if _goal(deed, later) is None and deed.verb in lexicon().goal_wanted and not later:
            raise RefusalError(f"{deed.verb} {_name(deed)}: where to?", question=True)
        if deed.verb in lexicon().source_wanted and deed.source is None and deed.goal is None:
            raise RefusalError(f"{deed.verb} {_name(deed)}: from where?", [deed.verb])
        if _carried_on(deed, joined[index + 1 :]):
            drafts += [*_taking(deed, held), *_passing(deed, joined[index + 1])]
            held = deed.target
            continue
        drafts += _drafts(deed, held, later)
        held = _held_after(deed, held, later)
    return tuple(_one_in_hand(drafts))


def _one_in_hand(drafts: Sequence[Draft]) -> Iterator[Draft]:
    """Bring what is in the hand before something else is taken, and then that, too: "grab a coke and a water"."""
    held: Draft | None = None
    several = False
    for draft in drafts:
        if held is not None and draft.task is Task.GRASP:
            several = True
            yield Draft(held.verb, item=held.object, goal=HERE)
        held = draft if draft.task is Task.GRASP else held if draft.item is None else None
        yield draft
    if held is not None and (several or (held.object is not None and held.object.count > 1)):
        yield Draft(held.verb, item=held.object, goal=HERE)


def _set_down(deeds: Sequence[Deed]) -> tuple[Deed, ...]:
    """Put a thing where it was carried: "take it to the desk and set it down"."""
    found: list[Deed] = []
    for deed in deeds:
        before = found[-1] if found else None
        puts = deed.kind is VerbKind.PLACE and deed.goal is None and deed.again
        if before and puts and before.target == deed.target and _carries_somewhere(before):
            found[-1] = replace(before, kind=VerbKind.PLACE)
        else:
            found.append(deed)
    return tuple(found)


def _carries_somewhere(deed: Deed) -> bool:
    """Whether a thing is carried to a place, not to somebody."""
    return deed.kind in _GOES_FOR and deed.goal is not None and deed.goal is not HERE and not deed.goal.person


def _join_going(deeds: Sequence[Deed]) -> tuple[Deed, ...]:
    """Give the place of a bare "go" to the next deed, where that lacks one."""
    joined: list[Deed] = []
    for deed in deeds:
        before = joined[-1] if joined and joined[-1].kind is VerbKind.GO else None
        takes_source = before and deed.kind in _GOES_FOR and deed.source is None and not deed.again
        takes_goal = before and deed.kind is VerbKind.PLACE and deed.goal is None
        there = before and deed.kind in _GOES_FOR and deed.source is not None and deed.source.within is None
        same = before and there and before.goal and deed.source and before.goal.name == deed.source.name
        back = before and before.goal is HERE and deed.kind is VerbKind.ROUND_TRIP
        if same or back:
            joined.pop()
            takes_source = takes_source and not back
        if before and (takes_source or takes_goal):
            joined = joined if back else joined[:-1]
            deed = replace(deed, source=before.goal) if takes_source else replace(deed, goal=before.goal)
        joined.append(deed)
    return tuple(joined)


def _without_wishes(deeds: Sequence[Deed]) -> tuple[Deed, ...]:
    """Leave out a wish when the next words say how it is to be met: "I would like a tea, can you get me one"."""
    followed = zip_longest(deeds, deeds[1:])
    return tuple(deed for deed, after in followed if after is None or not _meets(after, deed))


def _meets(deed: Deed, wish: Deed) -> bool:
    """Whether a deed goes once more for what a wish asks to be brought."""
    same = deed.target is not None and wish.target is not None and deed.target.tokens == wish.target.tokens
    somebody = wish.goal is not None and (wish.goal is HERE or wish.goal.living)
    wished = wish.kind is VerbKind.ROUND_TRIP and somebody and wish.source is None and not wish.again
    put = wish.kind is VerbKind.PLACE and deed.kind is VerbKind.PLACE and deed.goal == wish.goal
    return same and deed.again and (put or (wished and deed.kind in _FETCHES))


def _one_by_one(deeds: Sequence[Deed]) -> tuple[Deed, ...]:
    """Carry each thing before the next is taken: "take the milk and the cup and put them on the table"."""
    ordered: list[Deed] = []
    for deed in deeds:
        last = next((n for n in range(len(ordered) - 1, -1, -1) if ordered[n].target == deed.target), None)
        between = [] if last is None else ordered[last + 1 :]
        taken = deed.again and bool(between) and all(other.kind in _TAKES and other.goal is None for other in between)
        ordered.insert(len(ordered) if last is None or not taken else last + 1, deed)
    return tuple(ordered)


def _drafts(deed: Deed, held: Phrase | None, later: bool) -> Iterator[Draft]:
    if deed.kind is VerbKind.GO:
        yield Draft(deed.verb, goal=deed.goal)
    elif deed.kind is VerbKind.FIND and not later:
        yield Draft(deed.verb, goal=deed.source, task=Task.FIND, object=deed.target)
    else:
        yield from _handling(deed, held, later)


def _carried_on(deed: Deed, after: Sequence[Deed]) -> bool:
    """Whether what is carried somewhere is then put down there: "take it to the bathroom, set it on the shelf"."""
    puts = bool(after) and after[0].kind is VerbKind.PLACE and after[0].again and after[0].target == deed.target
    return _carries_somewhere(deed) and puts and after[0].goal is not None and after[0].goal is not HERE


def _taking(deed: Deed, held: Phrase | None) -> Iterator[Draft]:
    """Going for a thing, unless it is in the hand."""
    if held != deed.target:
        yield Draft(deed.verb, goal=deed.source, task=Task.GRASP, object=deed.target)


def _passing(deed: Deed, puts: Deed) -> Iterator[Draft]:
    """Going, with the thing in the hand, by where it was to be carried, unless it is put down right there."""
    same = deed.goal is not None and puts.goal is not None and deed.goal.name == puts.goal.name
    if not same:
        yield Draft(deed.verb, goal=deed.goal)


def _handling(deed: Deed, held: Phrase | None, later: bool) -> Iterator[Draft]:
    """Going for a thing unless it is in the hand, and carrying it where a goal is said."""
    goal = _goal(deed, later)
    sets_down = deed.kind is VerbKind.PLACE
    if not (sets_down and goal is None):
        yield from _taking(deed, held)
    if sets_down:
        yield Draft(deed.verb, item=deed.target, goal=goal, task=Task.PLACE, object=deed.target)
    elif goal is not None:
        yield Draft(deed.verb, item=deed.target, goal=goal)


def _goal(deed: Deed, later: bool) -> Location | None:
    """Where the thing goes: what was said, or back, for what makes a round trip and is not needed again."""
    back = deed.kind is VerbKind.ROUND_TRIP and not later
    return deed.goal or (HERE if back else None)


def _held_after(deed: Deed, held: Phrase | None, later: bool) -> Phrase | None:
    if deed.kind is VerbKind.GO or (deed.kind is VerbKind.FIND and not later):
        return held
    return None if deed.kind is VerbKind.PLACE or _goal(deed, later) is not None else deed.target


def spoken_command(draft: Draft) -> Command:
    """The draft as a command with its names as they were spoken."""
    goal, within = draft.goal, None if draft.goal is None else draft.goal.within
    person = goal is not None and goal.person
    return Command(
        item=_thing(draft.item),
        goal=None if goal is None else goal.name if person else goal.text,
        goal_at=within.text if person and within is not None else None,
        task=draft.task,
        object=_thing(draft.object),
        item_count=1 if draft.item is None else draft.item.count,
        object_count=1 if draft.object is None else draft.object.count,
        verb=draft.verb,
    )


def _name(deed: Deed) -> str:
    return "it" if deed.target is None else f"the {deed.target.text}"


def _thing(phrase: Phrase | None) -> Thing | None:
    return None if phrase is None else phrase.thing
