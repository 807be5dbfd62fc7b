"""Builds command frames: resolved actions as commands with spoken names, one to take an object and one to carry it."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import zip_longest
from typing import Final

from executive.language.actions import Action
from executive.language.lexicon import VerbKind, word_list
from executive.language.phrases import Phrase
from executive.language.questions import RefusalError
from executive.language.roles import HERE, Location
from executive.words.command import Command, Task

_GOES_FOR: Final = frozenset({VerbKind.FIND, VerbKind.PICK, VerbKind.ROUND_TRIP, VerbKind.SINGLE_TRIP})
_TAKES: Final = {*_GOES_FOR, VerbKind.PLACE}
_ALONE: Final[Mapping[VerbKind | None, Task | None]] = {
    VerbKind.GO: None,
    VerbKind.WAIT: Task.WAIT,
    VerbKind.CHARGE: Task.CHARGE,
}


@dataclass(frozen=True)
class CommandFrame:
    """Command with names that are not grounded in a world."""

    verb: str
    item: Phrase | None = None
    goal: Location | None = None
    task: Task | None = None
    object: Phrase | None = None


def command_frames(actions: Sequence[Action]) -> tuple[CommandFrame, ...]:
    """Converts actions to command frames, in order.

    After a bare "go", the next action's object is searched at that destination; a held object is not fetched again.

    Raises RefusalError when the destination of an object is missing.
    """
    frames: list[CommandFrame] = []
    held: Phrase | None = None
    # A wish is left out where the next words say how to meet it: "I would like a tea, can you get me one".
    followed = zip_longest(actions, actions[1:])
    asked = tuple(action for action, after in followed if after is None or not _meets(after, action))
    joined = _set_down(_one_by_one(_join_going(asked)))
    for index, action in enumerate(joined):
        verb, target, puts = action.verb, action.target, action.kind is VerbKind.PLACE
        after = joined[index + 1] if index + 1 < len(joined) else None
        later = any(other.again and other.target == target for other in joined[index + 1 :])
        goal = action.goal or (HERE if action.kind is VerbKind.ROUND_TRIP and not later else None)
        name = "it" if target is None else f"the {target.text}"
        if goal is None and verb in word_list("goal_wanted") and not later:
            raise RefusalError(f"{verb} {name}: where to?", question=True)
        if verb in word_list("source_wanted") and action.source is None and action.goal is None:
            raise RefusalError(f"{verb} {name}: from where?", [verb])
        taking = [CommandFrame(verb, goal=action.source, task=Task.GRASP, object=target)] if held != target else []
        if after is not None and _puts_down(after, action) and after.goal not in (None, HERE):
            same = action.goal is not None and after.goal is not None and action.goal.name == after.goal.name
            frames += [*taking, *([] if same else [CommandFrame(verb, goal=action.goal)])]
            held = target
        elif action.kind in _ALONE:
            frames.append(CommandFrame(verb, goal=action.goal, task=_ALONE[action.kind], object=action.time))
        elif action.kind is VerbKind.FIND and not later:
            frames.append(CommandFrame(verb, goal=action.source, task=Task.FIND, object=target))
        else:
            frames += [] if puts and goal is None else taking
            if puts:
                frames.append(CommandFrame(verb, item=target, goal=goal, task=Task.PLACE, object=target))
            elif goal is not None:
                frames.append(CommandFrame(verb, item=target, goal=goal))
            held = None if puts or goal is not None else target
    return tuple(_one_in_hand(frames))


def _puts_down(action: Action, before: Action) -> bool:
    """Returns whether an action puts down the object that was carried: "take it to the desk and set it down"."""
    goal = before.goal if before.kind in _GOES_FOR else None
    carried = goal is not None and goal is not HERE and not goal.person
    return carried and action.kind is VerbKind.PLACE and action.again and action.target == before.target


def _one_in_hand(frames: Sequence[CommandFrame]) -> Iterator[CommandFrame]:
    """Delivers the held object before the next one is taken: "grab a coke and a water"."""
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


def _set_down(actions: Sequence[Action]) -> tuple[Action, ...]:
    """Merges carrying an object and putting it down: "take it to the desk and set it down"."""
    found: list[Action] = []
    for action in actions:
        if found and action.goal is None and _puts_down(action, found[-1]):
            found[-1] = replace(found[-1], kind=VerbKind.PLACE)
        else:
            found.append(action)
    return tuple(found)


def _join_going(actions: Sequence[Action]) -> tuple[Action, ...]:
    """Merges a bare "go" with the next action if that action names no place; "then fetch" stays separate."""
    joined: list[Action] = []
    for action in actions:
        before = joined[-1] if joined and joined[-1].kind is VerbKind.GO else None
        own = action.follows and action.kind is VerbKind.ROUND_TRIP
        takes_source = before and action.kind in _GOES_FOR and action.source is None and not (action.again or own)
        takes_goal = before and action.kind is VerbKind.PLACE and action.goal is None
        there = before and action.kind in _GOES_FOR and action.source is not None and action.source.within is None
        same = before and there and before.goal and action.source and before.goal.name == action.source.name
        back = before and before.goal is HERE and action.kind is VerbKind.ROUND_TRIP
        to_them = before and before.goal and before.goal.living and action.goal and action.goal.name == before.goal.name
        goal = before.goal.phrase if before and before.goal else None
        docks = action.kind is VerbKind.CHARGE and goal is not None and goal.head.lemma in word_list("docks")
        if same or back or to_them or docks:
            joined.pop()
            takes_source = takes_source and not (back or to_them)
        if before and (takes_source or takes_goal):
            joined = joined if back or to_them else joined[:-1]
            action = replace(action, source=before.goal) if takes_source else replace(action, goal=before.goal)
        joined.append(action)
    return tuple(joined)


def _meets(action: Action, wish: Action) -> bool:
    """Returns whether an action already fetches the object that a wish asks for."""
    same = action.target is not None and wish.target is not None and action.target.tokens == wish.target.tokens
    somebody = wish.goal is not None and (wish.goal is HERE or wish.goal.living)
    wished = wish.kind is VerbKind.ROUND_TRIP and somebody and wish.source is None and not wish.again
    put = wish.kind is VerbKind.PLACE and action.kind is VerbKind.PLACE and action.goal == wish.goal
    return same and action.again and (put or (wished and action.kind in (VerbKind.ROUND_TRIP, VerbKind.PICK)))


def _one_by_one(actions: Sequence[Action]) -> tuple[Action, ...]:
    """Carries each object before taking the next: "take the milk and the cup and put them on the table"."""
    ordered: list[Action] = []
    for action in actions:
        last = next((n for n in range(len(ordered) - 1, -1, -1) if ordered[n].target == action.target), None)
        between = [] if last is None else ordered[last + 1 :]
        taken = action.again and bool(between) and all(other.kind in _TAKES and other.goal is None for other in between)
        ordered.insert(len(ordered) if last is None or not taken else last + 1, action)
    return tuple(ordered)


def spoken_command(frame: CommandFrame) -> Command:
    """Command with names as the speaker said them."""
    goal, within = frame.goal, None if frame.goal is None else frame.goal.within
    person = goal is not None and goal.person
    return Command(
        item=None if frame.item is None else frame.item.object_kind,
        goal=None if goal is None else goal.name if person else goal.text,
        goal_at=within.text if person and within is not None else None,
        task=frame.task,
        object=None if frame.object is None else frame.object.object_kind,
        item_count=1 if frame.item is None else frame.item.count,
        object_count=1 if frame.object is None else frame.object.count,
        verb=frame.verb,
    )
