"""What a mission decides by, waits for and watches: conditions as plain data."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Annotated, Any, Final

from executive.words.command import Command
from executive.words.expression import Expression, Kind
from skills.quantities import Quantity, Share

__all__ = [
    "RANGES",
    "READINGS",
    "AllOf",
    "AnyOf",
    "ButtonPressed",
    "Condition",
    "DoorOpen",
    "Look",
    "Not",
    "ValueIs",
    "parts_of",
]

READINGS: Final[Mapping[str, Kind]] = MappingProxyType(
    {
        "battery": Kind.NUMBER,  # charge, from 0 to 1
        "localised": Kind.TRUTH,  # whether the robot knows where it is
        "holding": Kind.TRUTH,  # whether the gripper holds something
        "elapsed": Kind.NUMBER,  # seconds on the robot's clock since the mission began
        "clock": Kind.TEXT,  # the time of day, as "08:30"
    }
)
"""The names that an expression may read besides a mission's own values."""
RANGES: Final[Mapping[str, Any]] = MappingProxyType(
    {"battery": Share, "elapsed": Annotated[float, Quantity(ge=0.0, le=604_800.0, unit="s")]}
)
"""The quantities of readings that are numbers."""


@dataclass(frozen=True)
class ValueIs:
    """An expression that is true or false, of values and readings."""

    expression: Expression

    def __str__(self) -> str:
        return str(self.expression)


@dataclass(frozen=True)
class Look:
    """A status check (a command to find): the robot goes there and looks.

    It does so each time that the condition is asked, unless its last answer is no older than `max_age_s`.
    """

    command: Command
    max_age_s: float = 0.0

    def __str__(self) -> str:
        at = "" if self.command.goal is None else f" at {self.command.goal}"
        return f"{self.command.object}{at}"


@dataclass(frozen=True)
class DoorOpen:
    """The door between two rooms, of those in the knowledge file, is open; the robot goes there and looks.

    An answer that is no older than `max_age_s` is not asked for again.
    """

    between: tuple[str, str]
    max_age_s: float = 0.0

    def __str__(self) -> str:
        return f"the door between {self.between[0]} and {self.between[1]} is open"


@dataclass(frozen=True)
class ButtonPressed:
    """The operator has pressed the button of this name since it was first looked at."""

    name: str

    def __str__(self) -> str:
        return f"button '{self.name}'"


@dataclass(frozen=True)
class AllOf:
    """All of them hold; decided as soon as one does not."""

    parts: tuple[Condition, ...]

    def __str__(self) -> str:
        return " and ".join(map(_bracketed, self.parts))


@dataclass(frozen=True)
class AnyOf:
    """One of them holds; decided as soon as one does."""

    parts: tuple[Condition, ...]

    def __str__(self) -> str:
        return " or ".join(map(_bracketed, self.parts))


@dataclass(frozen=True)
class Not:
    """It does not hold."""

    part: Condition

    def __str__(self) -> str:
        match self.part:
            case Look():
                return f"no {self.part}"
            case ValueIs(expression) if str(expression).isidentifier():
                return f"not {expression}"
        return f"not ({self.part})"


Condition = ValueIs | Look | DoorOpen | ButtonPressed | AllOf | AnyOf | Not


def _bracketed(part: Condition) -> str:
    """A condition within others, in brackets where it could be misread."""
    text = str(part)
    plain = isinstance(part, Look | DoorOpen | ButtonPressed | Not) or not {"and", "or", "if"} & set(text.split())
    return text if plain else f"({text})"


def parts_of(condition: Condition) -> Iterator[ValueIs | Look | DoorOpen | ButtonPressed]:
    """What it is made of, in order."""
    match condition:
        case AllOf(parts) | AnyOf(parts):
            for part in parts:
                yield from parts_of(part)
        case Not(part):
            yield from parts_of(part)
        case _:
            yield condition
