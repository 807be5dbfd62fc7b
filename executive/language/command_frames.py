"""Builds command frames: resolved actions as commands with spoken names, one to take an object and one to carry it."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Final

from executive.language.actions import Action
from executive.language.lexicon import VerbKind, word_list
from executive.language.phrases import Phrase
from executive.language.questions import RefusalError
from executive.language.roles import HERE, Location
from executive.words.command import Command
from executive.words.task import Task, basic

_GOES_FOR: Final = frozenset({VerbKind.FIND, VerbKind.PICK, VerbKind.ROUND_TRIP, VerbKind.SINGLE_TRIP})
_TAKES: Final = {*_GOES_FOR, VerbKind.PLACE}


@dataclass(frozen=True)
class CommandFrame:
    """Command with names that are not grounded in a world."""

    verb: str
    item: Phrase | None = None
    goal: Location | None = None
    task: Task | None = None
    object: Phrase | None = None

    @property
    def takes(self) -> bool:
        """Returns whether the robot takes hold of the object."""
        return self.task is not None and self.task.takes

    @property
    def looks(self) -> bool:
        """Returns whether the robot looks for the object, and answers."""
        return self.task is not None and self.task.looks


def command_frames(actions: Sequence[Action]) -> tuple[CommandFrame, ...]:
    """Converts actions to command frames, in order.

    After a bare "go", the next action's object is searched at that destination; a held object is not fetched again.

    Raises RefusalError when the destination of an object is missing.
    """
    alone = {VerbKind.WAIT: basic().wait, VerbKind.CHARGE: basic().charge}
    frames: list[CommandFrame] = []
    held: Phrase | None = None
    joined = _merge(_one_by_one(_merge(_merge(actions, _meet), _join)), _set_down)
    for index, action in enumerate(joined, 1):
        verb, target = action.verb, action.target
        later = any(other.again and other.target == target for other in joined[index:])
        put_at = next((after.goal for after in joined[index : index + 1] if _puts_down(action, after)), None)
        goal = _goal(action, later)
        taking = [] if held == target else [CommandFrame(verb, goal=action.source, task=basic().take, object=target)]
        match action:
            case Action(goal=Location(name=name)) if put_at is not None:
                going = [] if name == put_at.name else [CommandFrame(verb, goal=goal)]
                frames, held = [*frames, *taking, *going], target
            case Action(kind=VerbKind.GO | VerbKind.WAIT | VerbKind.CHARGE as kind):
                frames.append(CommandFrame(verb, goal=goal, task=alone.get(kind), object=action.time))
            case Action(kind=VerbKind.FIND) if not later:
                frames.append(CommandFrame(verb, goal=action.source, task=basic().look, object=target))
            case Action(kind=VerbKind.PLACE):
                putting = CommandFrame(verb, item=target, goal=goal, task=basic().put, object=target)
                frames, held = [*frames, *(taking if goal is not None else []), putting], None
            case _ if goal is None:
                frames, held = [*frames, *taking], target
            case _:
                frames, held = [*frames, *taking, CommandFrame(verb, item=target, goal=goal)], None
    return tuple(_one_in_hand(frames))


def _goal(action: Action, later: bool) -> Location | None:
    """Where an action brings its object, unless a later action says so; raises RefusalError if a place is missing."""
    verb, name = action.verb, "it" if action.target is None else f"the {action.target.text}"
    goal = action.goal or (HERE if action.kind is VerbKind.ROUND_TRIP and not later else None)
    if goal is None and verb in word_list("goal_wanted") and not later:
        raise RefusalError(f"{verb} {name}: where to?", question=True)
    if verb in word_list("source_wanted") and action.source is None and action.goal is None:
        raise RefusalError(f"{verb} {name}: from where?", [verb])
    return goal


def _one_in_hand(frames: Sequence[CommandFrame]) -> Iterator[CommandFrame]:
    """Delivers the held object before the next one is taken: "grab a coke and a water"."""
    held: CommandFrame | None = None
    several = False
    for frame in frames:
        if held is not None and frame.takes:
            several = True
            yield CommandFrame(held.verb, item=held.object, goal=HERE)
        held = frame if frame.takes else held if frame.item is None else None
        yield frame
    if held is not None and (several or (held.object is not None and held.object.count > 1)):
        yield CommandFrame(held.verb, item=held.object, goal=HERE)


def _merge(actions: Sequence[Action], join: Callable[[Action, Action], Action | None]) -> tuple[Action, ...]:
    """Joins actions that follow each other, where `join` makes one of two."""
    merged: list[Action] = []
    for action in actions:
        one = join(merged[-1], action) if merged else None
        merged = [*merged, action] if one is None else [*merged[:-1], one]
    return tuple(merged)


def _meet(wish: Action, action: Action) -> Action | None:
    """Leaves out a wish that the next words say how to meet: "I would like a tea, can you get me one"."""
    if wish.target is None or action.target is None or action.target.tokens != wish.target.tokens or not action.again:
        return None
    match wish, action.kind:
        case Action(kind=VerbKind.PLACE), VerbKind.PLACE if action.goal == wish.goal:
            return action
        case Action(kind=VerbKind.ROUND_TRIP, source=None, again=False), VerbKind.ROUND_TRIP | VerbKind.PICK:
            return action if wish.for_somebody else None
    return None


def _join(going: Action, action: Action) -> Action | None:
    """Joins a "go" and the next action if that names no place, or leads there itself; "then fetch" stays separate."""
    place, there = going.goal, None if going.goal is None else going.goal.name
    match action:
        case _ if going.kind is not VerbKind.GO:
            return None
        case Action(kind=VerbKind.ROUND_TRIP) if place == HERE:
            return action
        case Action(goal=Location(name=name)) if name == there and place is not None and place.living:
            return action
        case Action(kind=VerbKind.CHARGE) if place is not None and place.phrase is not None:
            return action if place.phrase.head.lemma in word_list("docks") else None
        case Action(kind=VerbKind.PLACE, goal=None):
            return replace(action, goal=place)
        case Action(source=Location(within=None, name=name)) if name == there:
            return action if action.kind in _GOES_FOR else None
        case Action(kind=VerbKind.ROUND_TRIP, follows=True) | Action(again=True):
            return None
        case Action(source=None) if action.kind in _GOES_FOR:
            return replace(action, source=place)
    return None


def _set_down(before: Action, action: Action) -> Action | None:
    """Joins carrying an object and putting it down: "take it to the desk and set it down"."""
    return replace(before, kind=VerbKind.PLACE) if action.goal is None and _puts_down(before, action) else None


def _puts_down(before: Action, action: Action) -> bool:
    """Returns whether an action puts down the object that was carried, and not for the speaker."""
    goal = before.goal if before.kind in _GOES_FOR else None
    carried = goal is not None and HERE not in (goal, action.goal) and not goal.person
    return carried and action.kind is VerbKind.PLACE and action.again and action.target == before.target


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
    item, thing = (None if one is None else one.object_kind for one in (frame.item, frame.object))
    item_count, count = (1 if one is None else one.count for one in (frame.item, frame.object))
    name = None if goal is None else goal.name if person else goal.text
    at = within.text if person and within is not None else None
    return Command(item, name, at, frame.task, thing, item_count, count, frame.verb)
