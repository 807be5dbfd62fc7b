"""Resolved actions become command frames: going for a thing and carrying it are two."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import zip_longest
from typing import Final

from executive.language.lexicon import VerbKind, lexicon
from executive.language.phrases import Phrase
from executive.language.questions import RefusalError
from executive.language.reference import ResolvedAction
from executive.language.roles import HERE, Location
from executive.words.command import Command, Task
from skills.api import Thing

_GOES_FOR: Final = frozenset({VerbKind.FIND, VerbKind.PICK, VerbKind.ROUND_TRIP, VerbKind.SINGLE_TRIP})

_FETCHES: Final = frozenset({VerbKind.ROUND_TRIP, VerbKind.PICK})
_TAKES: Final = _GOES_FOR | {VerbKind.PLACE}
_ALONE: Final = {VerbKind.GO: None, VerbKind.WAIT: Task.WAIT, VerbKind.CHARGE: Task.CHARGE}


@dataclass(frozen=True)
class CommandFrame:
    """A command whose names are still as they were spoken."""

    verb: str
    item: Phrase | None = None
    goal: Location | None = None
    task: Task | None = None
    object: Phrase | None = None


def command_frames(actions: Sequence[ResolvedAction]) -> tuple[CommandFrame, ...]:
    """The commands of all actions, in order.

    A place that the robot is sent to first is where the next action's thing is looked for; a thing in the hand is not
    gone for again.

    Raises:
        RefusalError: it is not said where something is to go.
    """
    frames: list[CommandFrame] = []
    held: Phrase | None = None
    for index, action in enumerate(joined := _set_down(_one_by_one(_join_going(_without_wishes(actions))))):
        later = any(other.again and other.target == action.target for other in joined[index + 1 :])
        if _goal(action, later) is None and action.verb in lexicon().goal_wanted and not later:
            raise RefusalError(f"{action.verb} {_name(action)}: where to?", question=True)
        if action.verb in lexicon().source_wanted and action.source is None and action.goal is None:
            raise RefusalError(f"{action.verb} {_name(action)}: from where?", [action.verb])
        if _carried_on(action, joined[index + 1 :]):
            frames += [*_taking(action, held), *_passing(action, joined[index + 1])]
            held = action.target
            continue
        frames += _frames(action, held, later)
        held = _held_after(action, held, later)
    return tuple(_one_in_hand(frames))


def _one_in_hand(frames: Sequence[CommandFrame]) -> Iterator[CommandFrame]:
    """Bring what is in the hand before something else is taken, and then that, too: "grab a coke and a water"."""
    held: CommandFrame | None = None
    several = False
    for frame in frames:
        if held is not None and frame.task is Task.GRASP:
            several = True
            yield CommandFrame(held.verb, item=held.object, goal=HERE)
        held = frame if frame.task is Task.GRASP else held if frame.item is None else None
        yield frame
    if held is not None and (several or (held.object is not None and held.object.count > 1)):
        yield CommandFrame(held.verb, item=held.object, goal=HERE)


def _set_down(actions: Sequence[ResolvedAction]) -> tuple[ResolvedAction, ...]:
    """Put a thing where it was carried: "take it to the desk and set it down"."""
    found: list[ResolvedAction] = []
    for action in actions:
        before = found[-1] if found else None
        puts = action.kind is VerbKind.PLACE and action.goal is None and action.again
        if before and puts and before.target == action.target and _carries_somewhere(before):
            found[-1] = replace(before, kind=VerbKind.PLACE)
        else:
            found.append(action)
    return tuple(found)


def _carries_somewhere(action: ResolvedAction) -> bool:
    """Whether a thing is carried to a place, not to somebody."""
    return action.kind in _GOES_FOR and action.goal is not None and action.goal is not HERE and not action.goal.person


def _join_going(actions: Sequence[ResolvedAction]) -> tuple[ResolvedAction, ...]:
    """Give the place of a bare "go" to the next action, where that lacks one; "then fetch" is an errand of its own."""
    joined: list[ResolvedAction] = []
    for action in actions:
        before = joined[-1] if joined and joined[-1].kind is VerbKind.GO else None
        own = action.anew and action.kind is VerbKind.ROUND_TRIP
        takes_source = before and action.kind in _GOES_FOR and action.source is None and not (action.again or own)
        takes_goal = before and action.kind is VerbKind.PLACE and action.goal is None
        there = before and action.kind in _GOES_FOR and action.source is not None and action.source.within is None
        same = before and there and before.goal and action.source and before.goal.name == action.source.name
        back = before and before.goal is HERE and action.kind is VerbKind.ROUND_TRIP
        to_them = before and before.goal and before.goal.living and action.goal and action.goal.name == before.goal.name
        goal = before.goal.phrase if before and before.goal else None
        docks = action.kind is VerbKind.CHARGE and goal is not None and goal.head.lemma in lexicon().docks
        if same or back or to_them or docks:
            joined.pop()
            takes_source = takes_source and not (back or to_them)
        if before and (takes_source or takes_goal):
            joined = joined if back or to_them else joined[:-1]
            action = replace(action, source=before.goal) if takes_source else replace(action, goal=before.goal)
        joined.append(action)
    return tuple(joined)


def _without_wishes(actions: Sequence[ResolvedAction]) -> tuple[ResolvedAction, ...]:
    """Leave out a wish when the next words say how it is to be met: "I would like a tea, can you get me one"."""
    followed = zip_longest(actions, actions[1:])
    return tuple(action for action, after in followed if after is None or not _meets(after, action))


def _meets(action: ResolvedAction, wish: ResolvedAction) -> bool:
    """Whether a action goes once more for what a wish asks to be brought."""
    same = action.target is not None and wish.target is not None and action.target.tokens == wish.target.tokens
    somebody = wish.goal is not None and (wish.goal is HERE or wish.goal.living)
    wished = wish.kind is VerbKind.ROUND_TRIP and somebody and wish.source is None and not wish.again
    put = wish.kind is VerbKind.PLACE and action.kind is VerbKind.PLACE and action.goal == wish.goal
    return same and action.again and (put or (wished and action.kind in _FETCHES))


def _one_by_one(actions: Sequence[ResolvedAction]) -> tuple[ResolvedAction, ...]:
    """Carry each thing before the next is taken: "take the milk and the cup and put them on the table"."""
    ordered: list[ResolvedAction] = []
    for action in actions:
        last = next((n for n in range(len(ordered) - 1, -1, -1) if ordered[n].target == action.target), None)
        between = [] if last is None else ordered[last + 1 :]
        taken = action.again and bool(between) and all(other.kind in _TAKES and other.goal is None for other in between)
        ordered.insert(len(ordered) if last is None or not taken else last + 1, action)
    return tuple(ordered)


def _frames(action: ResolvedAction, held: Phrase | None, later: bool) -> Iterator[CommandFrame]:
    if action.kind in _ALONE:
        yield CommandFrame(action.verb, goal=action.goal, task=_ALONE[action.kind], object=action.time)
    elif action.kind is VerbKind.FIND and not later:
        yield CommandFrame(action.verb, goal=action.source, task=Task.FIND, object=action.target)
    else:
        yield from _handling(action, held, later)


def _carried_on(action: ResolvedAction, after: Sequence[ResolvedAction]) -> bool:
    """Whether what is carried somewhere is then put down there: "take it to the bathroom, set it on the shelf"."""
    puts = bool(after) and after[0].kind is VerbKind.PLACE and after[0].again and after[0].target == action.target
    return _carries_somewhere(action) and puts and after[0].goal is not None and after[0].goal is not HERE


def _taking(action: ResolvedAction, held: Phrase | None) -> Iterator[CommandFrame]:
    """Going for a thing, unless it is in the hand."""
    if held != action.target:
        yield CommandFrame(action.verb, goal=action.source, task=Task.GRASP, object=action.target)


def _passing(action: ResolvedAction, puts: ResolvedAction) -> Iterator[CommandFrame]:
    """Going, with the thing in the hand, by where it was to be carried, unless it is put down right there."""
    same = action.goal is not None and puts.goal is not None and action.goal.name == puts.goal.name
    if not same:
        yield CommandFrame(action.verb, goal=action.goal)


def _handling(action: ResolvedAction, held: Phrase | None, later: bool) -> Iterator[CommandFrame]:
    """Going for a thing unless it is in the hand, and carrying it where a goal is said."""
    goal = _goal(action, later)
    sets_down = action.kind is VerbKind.PLACE
    if not (sets_down and goal is None):
        yield from _taking(action, held)
    if sets_down:
        yield CommandFrame(action.verb, item=action.target, goal=goal, task=Task.PLACE, object=action.target)
    elif goal is not None:
        yield CommandFrame(action.verb, item=action.target, goal=goal)


def _goal(action: ResolvedAction, later: bool) -> Location | None:
    """Where the thing goes: what was said, or back, for what makes a round trip and is not needed again."""
    back = action.kind is VerbKind.ROUND_TRIP and not later
    return action.goal or (HERE if back else None)


def _held_after(action: ResolvedAction, held: Phrase | None, later: bool) -> Phrase | None:
    if action.kind in _ALONE or (action.kind is VerbKind.FIND and not later):
        return held
    return None if action.kind is VerbKind.PLACE or _goal(action, later) is not None else action.target


def spoken_command(frame: CommandFrame) -> Command:
    """The frame as a command with its names as they were spoken."""
    goal, within = frame.goal, None if frame.goal is None else frame.goal.within
    person = goal is not None and goal.person
    return Command(
        item=_thing(frame.item),
        goal=None if goal is None else goal.name if person else goal.text,
        goal_at=within.text if person and within is not None else None,
        task=frame.task,
        object=_thing(frame.object),
        item_count=1 if frame.item is None else frame.item.count,
        object_count=1 if frame.object is None else frame.object.count,
        verb=frame.verb,
    )


def _name(action: ResolvedAction) -> str:
    return "it" if action.target is None else f"the {action.target.text}"


def _thing(phrase: Phrase | None) -> Thing | None:
    return None if phrase is None else phrase.thing
