"""Steps that hold steps, and small ones: what a mission decides, repeats, waits for, says and asks, as plain data."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from executive.words.condition import Condition
from executive.words.expression import Expression, Template, Value

if TYPE_CHECKING:
    from executive.words.steps import MissionStep

__all__ = [
    "Ask",
    "Block",
    "Check",
    "Choose",
    "Dock",
    "Group",
    "Handler",
    "Repeat",
    "Set",
    "Speak",
    "Together",
    "Try",
    "Wait",
    "steps_of",
]


@dataclass(frozen=True)
class Choose:
    """`if`: the steps of `then` when the condition holds, else those of `otherwise`, which may be none."""

    condition: Condition
    then: tuple[MissionStep, ...]
    otherwise: tuple[MissionStep, ...] = ()


@dataclass(frozen=True)
class Repeat:
    """`repeat`: rounds of the same steps.

    With `until`, rounds are made until it holds after one; with `while_`, as long as it holds before one; with
    `every_s`, one begins so long (s, robot's clock) after the one before began. `times` is how many rounds there are,
    or with a condition how many at most.
    """

    steps: tuple[MissionStep, ...]
    times: int | None = None
    until: Condition | None = None
    while_: Condition | None = None
    every_s: float | None = None


@dataclass(frozen=True)
class Try:
    """`try`: the steps in a row; as soon as one fails, those of `otherwise` in their place."""

    steps: tuple[MissionStep, ...]
    otherwise: tuple[MissionStep, ...]


@dataclass(frozen=True)
class Together:
    """`together`: all steps side by side; done when `needed` of them are (None: all), then the others are stopped."""

    steps: tuple[MissionStep, ...]
    needed: int | None = None


@dataclass(frozen=True)
class Handler:
    """What interrupts a group: when the condition begins to hold, its steps are done, `times` at most."""

    condition: Condition
    steps: tuple[MissionStep, ...]
    times: int = 10


@dataclass(frozen=True)
class Group:
    """`group`: steps in a row that share a policy.

    `holds` must hold while they run; `when` interrupts them, the first of several first; `always` runs at the end,
    whatever happened, also when the mission is cancelled.
    """

    steps: tuple[MissionStep, ...]
    name: str | None = None
    always: tuple[MissionStep, ...] = ()
    holds: Condition | None = None
    when: tuple[Handler, ...] = ()


@dataclass(frozen=True)
class Wait:
    """`wait`: for a condition, so many seconds, or until a time of day (s after midnight); one of the three.

    A condition that takes a look is looked at anew `every_s` after the look before.
    """

    condition: Condition | None = None
    seconds: float | None = None
    until_clock_s: float | None = None
    every_s: float = 15.0


@dataclass(frozen=True)
class Check:
    """`check`: answers whether a condition holds; the answer is part of the mission's result."""

    condition: Condition
    gives: str | None = None


@dataclass(frozen=True)
class Dock:
    """`dock`: go to the dock and charge to `level` (0 to 1; None: as the knowledge file says)."""

    level: float | None = None


@dataclass(frozen=True)
class Speak:
    """`speak`: say a text to the people around."""

    text: Template


@dataclass(frozen=True)
class Ask:
    """`ask`: put a question to the people around, or to the operator.

    The answer is one of `choices`, whose steps are then done; or, with `match`, a name of the world as people say it
    ("place", "person", "object"), a "number" or any "text". When nobody answers within `limit_s` (robot's clock) it is
    `default`; without one the step fails.
    """

    text: Template
    choices: Mapping[str, tuple[MissionStep, ...]] = field(default_factory=dict)
    match: str | None = None
    limit_s: float = 60.0
    default: Value | None = None
    gives: str | None = None


@dataclass(frozen=True)
class Set:
    """`set`: values by name, worked out in order."""

    values: Mapping[str, Expression]


Block = Choose | Repeat | Try | Together | Group | Wait | Check | Dock | Speak | Ask | Set


def steps_of(block: Block) -> Iterator[MissionStep]:
    """The steps that a block holds, in order."""
    match block:
        case Choose(_, then, otherwise):
            yield from (*then, *otherwise)
        case Try(steps, otherwise):
            yield from (*steps, *otherwise)
        case Repeat(steps) | Together(steps):
            yield from steps
        case Group(steps):
            yield from (*(each for handler in block.when for each in handler.steps), *steps, *block.always)
        case Ask():
            yield from (each for steps in block.choices.values() for each in steps)
        case _:
            return
