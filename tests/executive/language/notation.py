"""Short notation of steps for the tables of sentences."""

import json
import re

from executive.words.condition import AllOf, AnyOf, ButtonPressed, DoorOpen, Look, Not, ValueIs
from executive.words.leaf_steps import Check, Do, Dock, OpenDoor, Picture, Speak, Wait
from executive.words.steps import Ask, Choose, Group, Repeat, Together, Try
from skills.quantities import clock_s


def noted(steps):
    """Steps in the notation, with ";" between them."""
    return "; ".join(map(_step, steps))


def as_noted(lines):
    """Lines of a table in the form of `noted`; "then" may stand between commands."""
    return re.sub(r"\]\s*then Take", "]; Take", "; ".join(lines))


def _step(step):
    match step:
        case Do():
            return str(step.command)
        case Choose():
            return f"If ({_condition(step.condition)}) {_braced(step.then)}{_branch('Otherwise', step.otherwise)}"
        case Repeat():
            return f"Repeat{_rounds(step)} {_braced(step.steps)}"
        case Try():
            return f"Try {_braced(step.steps)} Otherwise {_braced(step.otherwise)}"
        case Together():
            return f"Together {_braced(step.steps)}"
        case Group():
            return f"Group{_policy(step)} {_braced(step.steps)}{_branch('Finally', step.always)}"
        case Wait():
            return f"Wait{_awaited(step)}"
        case Check():
            return f"Check ({_condition(step.condition)})"
        case Dock():
            return "Dock" if step.level is None else f"Dock to {step.level:g}"
        case OpenDoor():
            return f"Open {_quoted(step.door.between[0])} - {_quoted(step.door.between[1])}"
        case Picture(subject=subject):
            at, camera = subject.at and f" from {subject.at}", subject.camera and f" by {subject.camera}"
            return f"Picture of {subject.of}{at or ''}{camera or ''}"
        case Speak():
            return f"Say {_quoted(step.speak)}"
        case Ask():
            choices = "; ".join(f"{_quoted(choice)} {_braced(steps)}" for choice, steps in (step.choices or {}).items())
            return f"Ask {_quoted(step.ask)} {{{choices}}}"
    raise AssertionError(f"no sentence becomes {step!r}")


def _condition(condition):
    match condition:
        case ValueIs(text=text):
            return f"value {_quoted(text)}"
        case Look(command=command):
            return str(command)
        case DoorOpen(between=(one, other)):
            return f"door {_quoted(one)} - {_quoted(other)} open"
        case ButtonPressed(button=button):
            return f"button {_quoted(button)} pressed"
        case AllOf(parts=parts):
            return f"all({', '.join(map(_condition, parts))})"
        case AnyOf(parts=parts):
            return f"any({', '.join(map(_condition, parts))})"
        case Not(part=part):
            return f"not({_condition(part)})"
    raise AssertionError(f"no sentence asks {condition!r}")


def _rounds(step):
    loop = step.loop
    times = "" if loop.times is None else f" {loop.times} times"
    every = "" if loop.every_s is None else f" every {_number(loop.every_s)} s"
    while_ = "" if loop.while_ is None else f" while ({_condition(loop.while_)})"
    until = "" if loop.until is None else f" until ({_condition(loop.until)})"
    clock = "" if loop.until_clock is None else f" until {loop.until_clock}"
    return f"{times}{every}{while_}{until}{clock}"


def _awaited(step):
    awaited = step.awaited
    condition = "" if awaited.condition is None else f" for ({_condition(awaited.condition)})"
    seconds = "" if awaited.seconds is None else f" {_number(awaited.seconds)} s"
    clock = "" if awaited.until_clock is None else f" until {_number(clock_s(awaited.until_clock))} s"
    return f"{condition}{seconds}{clock}"


def _braced(steps):
    return f"{{{noted(steps)}}}"


def _branch(word, steps):
    return f" {word} {_braced(steps)}" if steps else ""


def _quoted(text):
    return json.dumps(text, ensure_ascii=False)


def _number(value):
    return short if float(short := f"{value:g}") == value else repr(float(value))


def _policy(step):
    """Reaction to a failed step, where there is one."""
    return "" if step.on_failure is None else f" {step.on_failure.value}"
