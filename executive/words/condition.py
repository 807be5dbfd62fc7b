"""Conditions: what a mission decides by, waits for and watches, as a file writes them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property
from types import MappingProxyType
from typing import TYPE_CHECKING, Annotated, Any, Final, Union

from pydantic import BeforeValidator, Field, WrapValidator, model_validator
from typing_extensions import TypeAliasType

from executive.words.command import Command, Task, command_of_parts, parts_of_command
from executive.words.expression import Expression, Kind
from executive.words.forms import Forms, Strict
from skills.files.errors import listing
from skills.files.schema import Name, Text
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
"""The names that an expression may read besides a mission's own values."""
RANGES: Final[Mapping[str, Any]] = MappingProxyType(
    {"battery": Share, "elapsed": Annotated[float, Quantity(ge=0.0, le=604_800.0, unit="s")]}
)
"""The quantities of readings that are numbers."""


def _short(value: object) -> object:
    """A bare expression is a condition."""
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
    """An expression that is true or false, of values and readings."""

    text: Annotated[Text, Field(alias="expression", description='As in "battery < 0.3 and not holding".')]

    @cached_property
    def expression(self) -> Expression:
        """The expression, read. Raises ExpressionError."""
        return Expression(self.text)

    def __str__(self) -> str:
        return self.text


class _Looking(Strict):
    """What takes a look."""

    max_age_s: Delay = Field(
        default=0.0,
        description="How old an answer may be that is not asked for again (seconds, or a text such as "
        '"2 min"); 0: each time that the condition is asked, the robot looks again.',
    )


class Question(_Looking):
    """A question in English that a look answers."""

    look: Text = Field(description='The question, as in "is there a hammer in the workshop".')


class Look(_Looking):
    """An object that is seen: the robot goes there and looks, each time that the condition is asked."""

    object: Text = Field(description="An object that is looked for; `at` says where.")
    at: Text | None = Field(default=None, description="The place of the object; by default anywhere.")

    @classmethod
    def of(cls, command: Command, max_age_s: float = 0.0) -> Look:
        """The look of a status check."""
        parts = parts_of_command(command)
        return cls(object=parts["object"], at=parts.get("to"), max_age_s=max_age_s)

    @cached_property
    def command(self) -> Command:
        """The status check. Raises ValueError: a name that is none."""
        return command_of_parts({"do": Task.FIND.value, "object": self.object, "to": self.at})

    def __str__(self) -> str:
        at = "" if self.command.goal is None else f" at {self.command.goal}"
        return f"{self.command.object}{at}"


class LookFor(_Looking):
    """A person who is seen, or anybody."""

    person: Text = Field(description='A person who is looked for, or "anybody"; `at` says where.')
    at: Text | None = Field(default=None, description="The place of the person; by default anywhere.")


class DoorOpen(_Looking):
    """A door that is open; the robot goes there and looks."""

    door: Annotated[tuple[Name, ...], Field(min_length=1, max_length=2)] = Field(
        description="The two rooms that it joins, or the one room that has one door."
    )

    @model_validator(mode="before")
    @classmethod
    def _one_room(cls, data: Any) -> Any:
        """A door may be given by one room."""
        if isinstance(data, dict) and isinstance(data.get("door"), str):
            return {**data, "door": [data["door"]]}
        return data

    @property
    def between(self) -> tuple[str, str]:
        """The rooms that it joins, once both are known."""
        one, other = self.door
        return one, other

    def __str__(self) -> str:
        return f"the door between {self.door[0]} and {self.door[-1]} is open"


class ButtonPressed(Strict):
    """A button that the operator has pressed since it was first looked at."""

    button: Name = Field(description="The button's name.")

    def __str__(self) -> str:
        return f"button '{self.button}'"


class AllOf(Strict):
    """All of several conditions; decided as soon as one does not hold."""

    parts: Annotated[tuple[Condition, ...], Field(alias="all", min_length=1, description="All of these hold.")]

    def __str__(self) -> str:
        return " and ".join(map(_bracketed, self.parts))


class AnyOf(Strict):
    """One of several conditions; decided as soon as one holds."""

    parts: Annotated[tuple[Condition, ...], Field(alias="any", min_length=1, description="One of these holds.")]

    def __str__(self) -> str:
        return " or ".join(map(_bracketed, self.parts))


class Not(Strict):
    """A condition that does not hold."""

    part: Annotated[Condition, Field(alias="not", description="This does not hold.")]

    def __str__(self) -> str:
        match self.part:
            case Look():
                return f"no {self.part}"
            case ValueIs(text=text) if text.isidentifier():
                return f"not {text}"
        return f"not ({self.part})"


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
"""The models of all conditions."""


def _refused(told: Sequence[str]) -> str:
    said = f"it has {listing(told)}" if told else "it is empty"
    return f"a condition is an expression or one of {listing([*_KEYS][1:])}; {said}"


_FORMS: Final = Forms(_KEYS, _refused)


if TYPE_CHECKING:
    Condition = ValueIs | Question | Look | LookFor | DoorOpen | ButtonPressed | AllOf | AnyOf | Not
else:
    _AnyCondition = Union[CONDITIONS]  # noqa: UP007


def _bracketed(part: Condition) -> str:
    """A condition within others, in brackets where it could be misread."""
    text = str(part)
    plain = isinstance(part, Look | DoorOpen | ButtonPressed | Not) or not {"and", "or", "if"} & set(text.split())
    return text if plain else f"({text})"


def parts_of(condition: Condition) -> Iterator[Condition]:
    """The conditions that it is made of, in order: none of them all, any or not."""
    match condition:
        case AllOf(parts=parts) | AnyOf(parts=parts):
            for part in parts:
                yield from parts_of(part)
        case Not(part=part):
            yield from parts_of(part)
        case _:
            yield condition
