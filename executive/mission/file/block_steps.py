"""From the blocks of a mission file to blocks as plain data."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import TYPE_CHECKING, Final, Protocol

from executive.mission.certainty import refuse_certain, refuse_certain_comparisons
from executive.mission.file.condition_schema import ConditionFile, RepeatFile
from executive.mission.file.schema import HandlerFile, StepFile
from executive.mission.file.scope import Scope
from executive.words.blocks import (
    Ask,
    Block,
    Check,
    Choose,
    Dock,
    Group,
    Handler,
    Repeat,
    Set,
    Speak,
    Together,
    Try,
    Wait,
)
from executive.words.command import Command, Task
from executive.words.condition import RANGES, AllOf, AnyOf, ButtonPressed, Condition, DoorOpen, Look, Not, ValueIs
from executive.words.expression import Expression, ExpressionError, Template, Value, literal
from executive.words.knowledge import ANYBODY, Knowledge
from executive.words.steps import KeyPath, MissionStep
from skills.files.errors import listing, suggestion

if TYPE_CHECKING:
    from executive.language.understand import Understanding

__all__ = ["Reader", "condition_of", "plain_value", "read_block", "round_values"]

MOST_ROUNDS: Final = 1000


class Reader(Protocol):
    """What reads the parts of a block; each raises InputError for what it cannot read."""

    knowledge: Knowledge

    def steps(self, scope: Scope, steps: Sequence[StepFile], path: KeyPath) -> tuple[MissionStep, ...]:
        """The steps of a list at `path`."""

    def condition(self, scope: Scope, condition: ConditionFile, path: KeyPath) -> Condition:
        """A condition at `path`."""

    def handlers(self, scope: Scope, handlers: Sequence[HandlerFile], path: KeyPath) -> tuple[Handler, ...]:
        """What interrupts, from a list at `path`."""

    def rounds(self, scope: Scope, step: StepFile, path: KeyPath) -> tuple[MissionStep, ...]:
        """A group for each value of a `for_each`."""

    def find_command(self, scope: Scope, path: KeyPath, found: str, at: str | None) -> Command:
        """The status check for something or somebody."""

    def meaning(self, scope: Scope, path: KeyPath, sentence: str) -> Understanding:
        """What a sentence means."""


def read_block(reader: Reader, scope: Scope, step: StepFile, path: KeyPath) -> Block | None:
    """The block of the step at `path`; None where it is none. Raises InputError."""
    for key, (given, read) in _BLOCKS.items():
        if getattr(step, given) is not None:
            return read(reader, scope, step, (*path, key))
    return None


def condition_of(reader: Reader, scope: Scope, condition: ConditionFile, path: KeyPath) -> Condition:
    """The condition that stands at `path`.

    Raises:
        InputError: an unknown name, no question, or a condition that cannot hold or cannot fail.
    """
    condition_at = _condition_of(reader, scope, condition, path)
    try:
        refuse_certain(condition_at, RANGES)
    except ExpressionError as error:
        raise scope.error(path, error.message, error.hint) from error
    return condition_at


def _condition_of(reader: Reader, scope: Scope, condition: ConditionFile, path: KeyPath) -> Condition:
    if condition.expression is not None:
        return ValueIs(_expression(scope, condition.expression, path))
    if condition.all is not None:
        return AllOf(tuple(reader.condition(scope, each, (*path, "all", n)) for n, each in enumerate(condition.all)))
    if condition.any is not None:
        return AnyOf(tuple(reader.condition(scope, each, (*path, "any", n)) for n, each in enumerate(condition.any)))
    if condition.not_ is not None:
        return Not(reader.condition(scope, condition.not_, (*path, "not")))
    if condition.look is not None:
        commands = reader.meaning(scope, (*path, "look"), condition.look).commands
        if len(commands) != 1 or commands[0].task is not Task.FIND:
            hint = "ask one thing, as in 'is there a hammer in the workshop'"
            raise scope.error((*path, "look"), f"'{condition.look}' is not one question that a look answers", hint)
        return Look(commands[0], condition.max_age_s)
    if condition.door is not None:
        return replace(_door(scope, condition.door, (*path, "door"), reader.knowledge), max_age_s=condition.max_age_s)
    if condition.button is not None:
        return ButtonPressed(condition.button)
    found = condition.object or _person(scope, condition.person or "", (*path, "person"), reader.knowledge)
    return Look(reader.find_command(scope, path, found, condition.at), condition.max_age_s)


def round_values(scope: Scope, repeat: RepeatFile, path: KeyPath, knowledge: Knowledge) -> Sequence[Value]:
    """The values of a `for_each`. Raises InputError: no values, too many, or one that is no plain value."""
    at = (*path, "repeat", "for_each")
    step = scope.source.data if scope.source is not None else {}
    for part in path:
        step = step[part]
    if not step.get("steps"):
        raise scope.error(path, "'repeat' needs 'steps' beside it", "add what is to be done in each round")
    if not isinstance(repeat.for_each, str):
        values = list(repeat.for_each or ())
        wrong = next((n for n, value in enumerate(values) if not isinstance(value, str | bool | int | float)), None)
        if wrong is not None:
            raise scope.error((*at, wrong), "no plain value", "list texts, numbers, or true and false")
    else:
        values = list(_known(scope, repeat.for_each, at, knowledge))
    if not 0 < len(values) <= MOST_ROUNDS:
        said = "there is nothing to go through" if not values else f"{len(values)} values are too many"
        raise scope.error(at, said, f"list up to {MOST_ROUNDS} values")
    return values


def _known(scope: Scope, of: str, path: KeyPath, knowledge: Knowledge) -> tuple[str, ...]:
    """The rooms, people or surfaces of a world, perhaps those in one room."""
    kind, _, room = of.partition(" in ")
    if kind not in ("rooms", "people", "surfaces") or (kind == "rooms" and room):
        hint = "write a list, or one of rooms, people, people in ROOM and surfaces in ROOM"
        raise scope.error(path, f"'{of[:60]}' is no list", hint)
    place = knowledge.place(room.removeprefix("the ")) if room else None
    if room and place is None:
        hint = suggestion(room, knowledge.place_names())
        raise scope.error(path, f"unknown place '{room[:60]}'", hint)
    if kind == "rooms":
        return tuple(knowledge.places)
    if kind == "surfaces":
        return tuple(knowledge.surfaces) if place is None else knowledge.surfaces_in(place)
    inside = {place, knowledge.room(place)} if place is not None else set()
    people = knowledge.people.items()
    return tuple(name for name, facts in people if place is None or inside & {facts.at, _room(facts.at, knowledge)})


def _room(place: str, knowledge: Knowledge) -> str | None:
    known = knowledge.place(place)
    return None if known is None else knowledge.room(known)


def _door(scope: Scope, rooms: tuple[str, ...], path: KeyPath, knowledge: Knowledge) -> DoorOpen:
    """The door that is meant, as the knowledge file has it."""
    named: list[str] = []
    for n, room in enumerate(rooms):
        known = knowledge.place(room)
        if known not in knowledge.places:
            raise scope.error((*path, n), f"unknown room '{room}'", suggestion(room, knowledge.places))
        named.append(known)
    doors = [door.between for door in knowledge.doors if set(named) <= set(door.between)]
    if len(doors) == 1:
        return DoorOpen(doors[0])
    told = " and ".join(named)
    if doors:
        raise scope.error(path, f"there are {len(doors)} doors of {told}", "name the two rooms that it joins")
    known = listing(" and ".join(door.between) for door in knowledge.doors)
    hint = f"known are the doors of {known}" if knowledge.doors else "add it under 'doors' in the knowledge file"
    raise scope.error(path, f"no door of {told} is known", hint)


def _person(scope: Scope, name: str, path: KeyPath, knowledge: Knowledge) -> str:
    """The person who is meant, perhaps anybody."""
    known = knowledge.somebody(ANYBODY if name.strip().lower() == "anybody" else name)
    if known is None:
        raise scope.error(path, f"unknown person '{name[:60]}'", suggestion(name, ("anybody", *knowledge.people)))
    return known


def _expression(scope: Scope, text: str, path: KeyPath) -> Expression:
    try:
        expression = Expression(text)
        refuse_certain_comparisons(expression, RANGES)
    except ExpressionError as error:
        raise scope.error(path, error.message, error.hint) from error
    return expression


def plain_value(scope: Scope, value: Value, path: KeyPath) -> Expression:
    """The expression of a plain value at `path`. Raises InputError: it is too long or too large."""
    try:
        return literal(value)
    except ExpressionError as error:
        raise scope.error(path, error.message, error.hint) from error


def _template(scope: Scope, text: str, path: KeyPath) -> Template:
    try:
        return Template(text)
    except ExpressionError as error:
        raise scope.error(path, error.message, error.hint) from error


def _choose(reader: Reader, scope: Scope, step: StepFile, path: KeyPath) -> Block:
    assert step.if_ is not None and step.then is not None
    above = path[:-1]
    return Choose(
        reader.condition(scope, step.if_, path),
        reader.steps(scope, step.then, (*above, "then")),
        reader.steps(scope, step.else_ or (), (*above, "else")),
    )


def _repeat(reader: Reader, scope: Scope, step: StepFile, path: KeyPath) -> Block:
    repeat, above = step.repeat, path[:-1]
    assert repeat is not None
    if repeat.for_each is not None:
        return Group(reader.rounds(scope, step, above), name=f"for each {repeat.as_}")
    assert step.steps is not None
    return Repeat(
        reader.steps(scope, step.steps, (*above, "steps")),
        repeat.times,
        None if repeat.until is None else reader.condition(scope, repeat.until, (*path, "until")),
        None if repeat.while_ is None else reader.condition(scope, repeat.while_, (*path, "while")),
        repeat.every,
    )


def _try(reader: Reader, scope: Scope, step: StepFile, path: KeyPath) -> Block:
    assert step.try_ is not None and step.else_ is not None
    return Try(reader.steps(scope, step.try_, path), reader.steps(scope, step.else_, (*path[:-1], "else")))


def _together(reader: Reader, scope: Scope, step: StepFile, path: KeyPath) -> Block:
    assert step.together is not None
    steps = reader.steps(scope, step.together, path)
    needed = {"all": None, "any": 1, None: None}.get(step.done_when, step.done_when)  # type: ignore[arg-type]
    if isinstance(needed, int) and needed > len(steps):
        at = (*path[:-1], "done_when")
        raise scope.error(at, f"{needed} of {len(steps)} steps cannot be done", f"give {len(steps)} at most")
    return Together(steps, needed)


def _group(reader: Reader, scope: Scope, step: StepFile, path: KeyPath) -> Block:
    assert step.group is not None
    above = path[:-1]
    holds = None
    if step.while_ is not None:
        holds = reader.condition(scope, step.while_.holds, (*above, "while", "holds"))
    return Group(
        reader.steps(scope, step.group, path),
        step.name,
        reader.steps(scope, step.always or (), (*above, "always")),
        holds,
        reader.handlers(scope, step.when or (), (*above, "when")),
    )


def _wait(reader: Reader, scope: Scope, step: StepFile, path: KeyPath) -> Block:
    wait = step.wait
    assert wait is not None
    if wait.for_ is not None:
        return Wait(reader.condition(scope, wait.for_, (*path, "for")), every_s=wait.every)
    if wait.until_clock is not None:
        hours, minutes = map(int, wait.until_clock.split(":"))
        return Wait(until_clock_s=3600.0 * hours + 60.0 * minutes)
    return Wait(seconds=wait.seconds)


def _check(reader: Reader, scope: Scope, step: StepFile, path: KeyPath) -> Block:
    assert step.check is not None
    return Check(reader.condition(scope, step.check, path), _answer_name(scope, step, path))


def _dock(reader: Reader, scope: Scope, step: StepFile, path: KeyPath) -> Block:
    assert step.dock is not None
    return Dock(step.dock.level)


def _speak(reader: Reader, scope: Scope, step: StepFile, path: KeyPath) -> Block:
    assert step.speak is not None
    return Speak(_template(scope, step.speak, path))


def _ask(reader: Reader, scope: Scope, step: StepFile, path: KeyPath) -> Block:
    assert step.ask is not None
    above = path[:-1]
    choices = {
        choice: reader.steps(scope, steps or (), (*above, "choices", choice))
        for choice, steps in (step.choices or {}).items()
    }
    default = step.default
    if choices and default is not None and default not in choices:
        known = listing(choices)
        raise scope.error((*above, "default"), f"'{default}' is none of the choices", f"they are {known}")
    alike = {choice.lower(): choice for choice in reversed(choices)}
    wrong = next((choice for choice in choices if alike[choice.lower()] != choice), None)
    if wrong is not None:
        what = f"the choices '{alike[wrong.lower()]}' and '{wrong}' are the same to one who answers"
        raise scope.error((*above, "choices", wrong), what, "give them different names")
    text = _template(scope, step.ask, path)
    return Ask(text, choices, step.match, step.limit, default, _answer_name(scope, step, path))


def _set(reader: Reader, scope: Scope, step: StepFile, path: KeyPath) -> Block:
    assert step.set is not None
    values = {}
    for name, value in step.set.items():
        if value is None:
            raise scope.error((*path, name), f"'{name}' gets no value", "give a number, a truth or an expression")
        at = (*path, name)
        values[name] = _expression(scope, value, at) if isinstance(value, str) else plain_value(scope, value, at)
    return Set(values)


def _answer_name(scope: Scope, step: StepFile, path: KeyPath) -> str | None:
    """The name under which later steps read the answer."""
    gives = step.gives or {}
    wrong = next((port for port in gives if port != "answer"), None)
    if wrong is not None:
        raise scope.error((*path[:-1], "gives", wrong), f"it gives no '{wrong}'", "write {answer: NAME}")
    return gives.get("answer")


_Read = Callable[[Reader, Scope, StepFile, KeyPath], Block]
_BLOCKS: Final[Mapping[str, tuple[str, _Read]]] = MappingProxyType(
    {
        "if": ("if_", _choose),
        "repeat": ("repeat", _repeat),
        "try": ("try_", _try),
        "together": ("together", _together),
        "group": ("group", _group),
        "wait": ("wait", _wait),
        "check": ("check", _check),
        "dock": ("dock", _dock),
        "speak": ("speak", _speak),
        "ask": ("ask", _ask),
        "set": ("set", _set),
    }
)
