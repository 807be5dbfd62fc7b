"""Conditions on which a mission decides, waits and interrupts its steps, as a mission file writes them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property
from types import MappingProxyType
from typing import TYPE_CHECKING, Annotated, Any, Final, Union

from pydantic import BeforeValidator, Field, WrapValidator
from typing_extensions import TypeAliasType

from executive.words.command import Command, command_of_parts, parts_of_command
from executive.words.expression import Expression, Kind
from executive.words.forms import Forms
from executive.words.phrase import ObjectWords, written
from executive.words.task import basic
from skills.inputs.errors import listing
from skills.inputs.schema import Name, Strict, Text
from skills.quantities import Delay, Quantity, Share

READINGS: Final[Mapping[str, Kind]] = MappingProxyType(
    {
        "battery": Kind.NUMBER,  # charge, from 0 to 1
        "localised": Kind.TRUTH,  # whether the robot knows where it is
        "holding": Kind.TRUTH,  # whether the gripper holds something
        "elapsed": Kind.NUMBER,  # seconds on the robot's clock since the mission began
        "clock": Kind.TEXT,  # the time of day, as "08:30"
    }
)
"""Readings of the robot that an expression may use besides the mission's variables."""
RANGES: Final[Mapping[str, Any]] = MappingProxyType(
    {"battery": Share, "elapsed": Annotated[float, Quantity(ge=0.0, le=604_800.0, unit="s")]}
)
"""Quantities of the numeric readings."""


def _short(value: object) -> object:
    """Expands a bare expression to a condition."""
    if isinstance(value, bool):
        return {"expression": str(value).lower()}
    return {"expression": value} if isinstance(value, str) else value


if not TYPE_CHECKING:
    Condition = TypeAliasType(
        "Condition",
        Annotated[
            "_AnyCondition",
            WrapValidator(lambda data, _: _FORMS.read(data)),
            BeforeValidator(_short, json_schema_input_type=Union[str, "_AnyCondition"]),
        ],
    )


class ValueIs(Strict):
    """Condition that an expression over variables and readings is true."""

    text: Annotated[Text, Field(alias="expression", description='As in "battery < 0.3 and not holding".')]

    @cached_property
    def expression(self) -> Expression:
        """Parsed expression. Raises ExpressionError."""
        return Expression(self.text)

    def __str__(self) -> str:
        return self.text


class _Looking(Strict):
    """Condition that the robot checks by looking."""

    max_age_s: Delay = Field(
        default=0.0,
        description="Age up to which an earlier answer counts (seconds, or a text such as "
        '"2 min"); 0: the robot looks again each time that the condition is checked.',
    )


class Question(_Looking):
    """Question in English, which the robot answers by looking."""

    look: Text = Field(description='The question, as in "is there a hammer in the workshop".')


class Look(_Looking):
    """Condition that an object is seen; the robot goes there and looks each time the condition is checked."""

    object: ObjectWords = Field(description="The object to look for; `at` says where.")
    at: Text | None = Field(default=None, description="The place of the object; by default anywhere.")

    @classmethod
    def from_command(cls, command: Command, max_age_s: float = 0.0) -> Look:
        """Builds the condition from a command to find an object."""
        parts = written(parts_of_command(command))
        return cls(object=parts["object"], at=parts.get("to"), max_age_s=max_age_s)

    @cached_property
    def command(self) -> Command:
        """Command to find the object. Raises ValueError when a name cannot be parsed."""
        return command_of_parts({"do": basic().look.word, "object": str(self.object), "to": self.at})

    def __str__(self) -> str:
        at = "" if self.command.goal is None else f" at {self.command.goal}"
        return f"{self.command.object}{at}"


class LookFor(_Looking):
    """Condition that a certain person, or any person, is seen."""

    person: Text = Field(description='The person to look for, or "anybody"; `at` says where.')
    at: Text | None = Field(default=None, description="The place of the person; by default anywhere.")


class DoorOpen(_Looking):
    """Condition that a door is open; the robot goes there and looks each time the condition is checked."""

    door: Annotated[
        tuple[Name, ...],
        Field(min_length=1, max_length=2, description="The two rooms that it joins, or a room with only one door."),
        BeforeValidator(lambda rooms: [rooms] if isinstance(rooms, str) else rooms),
    ]

    @property
    def between(self) -> tuple[str, str]:
        """Both rooms that the door joins, once they are known."""
        one, other = self.door
        return one, other

    @property
    def name(self) -> str:
        """Name of the door, formed from its rooms."""
        return f"door between {' and '.join(self.door)}" if len(self.door) > 1 else f"door of {self.door[0]}"

    def __str__(self) -> str:
        return f"the {self.name} is open"


class ButtonPressed(Strict):
    """Condition that the operator has pressed a button since the condition was first checked."""

    button: Name = Field(description="The button's name.")

    def __str__(self) -> str:
        return f"button '{self.button}'"


class AllOf(Strict):
    """Conjunction of conditions; it is false as soon as one condition is false."""

    parts: Annotated[tuple[Condition, ...], Field(alias="all", min_length=1, description="All of these hold.")]

    def __str__(self) -> str:
        return " and ".join(map(_bracketed, self.parts))


class AnyOf(Strict):
    """Disjunction of conditions; it is true as soon as one condition is true."""

    parts: Annotated[tuple[Condition, ...], Field(alias="any", min_length=1, description="One of these holds.")]

    def __str__(self) -> str:
        return " or ".join(map(_bracketed, self.parts))


class Not(Strict):
    """Negation of a condition."""

    part: Annotated[Condition, Field(alias="not", description="This does not hold.")]

    def __str__(self) -> str:
        text = str(self.part)
        return f"no {text}" if isinstance(self.part, Look) else f"not {text if text.isidentifier() else f'({text})'}"


_KEYS: Final[Mapping[str, type[Strict]]] = MappingProxyType(
    {
        "expression": ValueIs,
        "look": Question,
        "object": Look,
        "person": LookFor,
        "door": DoorOpen,
        "button": ButtonPressed,
        "all": AllOf,
        "any": AnyOf,
        "not": Not,
    }
)


CONDITIONS: Final[tuple[type[Any], ...]] = tuple(_KEYS.values())
"""Models of all conditions."""


def _refused(keys: Sequence[str]) -> str:
    said = f"it has {listing(keys)}" if keys else "it is empty"
    return f"a condition is an expression or one of {listing([*_KEYS][1:])}; {said}"


_FORMS: Final = Forms(_KEYS, _refused)


if TYPE_CHECKING:
    Condition = ValueIs | Question | Look | LookFor | DoorOpen | ButtonPressed | AllOf | AnyOf | Not
else:
    _AnyCondition = Union[CONDITIONS]  # noqa: UP007


def _bracketed(part: Condition) -> str:
    """Text of a condition inside another one, in brackets if it could be misread."""
    text = str(part)
    plain = isinstance(part, Look | DoorOpen | ButtonPressed | Not) or not {"and", "or", "if"} & set(text.split())
    return text if plain else f"({text})"


def parts_of(condition: Condition) -> Iterator[Condition]:
    """Yields the conditions inside a condition in order, but not `all`, `any` and `not` themselves."""
    match condition:
        case AllOf(parts=parts) | AnyOf(parts=parts):
            for part in parts:
                yield from parts_of(part)
        case Not(part=part):
            yield from parts_of(part)
        case _:
            yield condition
