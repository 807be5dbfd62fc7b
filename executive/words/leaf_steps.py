"""Steps that contain no steps: commands, skills, used missions; waits, checks, charging, speech, and values."""

from __future__ import annotations

import functools
from collections.abc import Iterator, Mapping, Sequence
from typing import Annotated, Any, ClassVar, Final, Self

from pydantic import (
    BeforeValidator,
    Field,
    PrivateAttr,
    SerializerFunctionWrapHandler,
    StrictBool,
    ValidationInfo,
    model_serializer,
    model_validator,
)

from executive.words.command import Command, command_of_parts, object_text, parts_of_command
from executive.words.condition import Condition, DoorOpen
from executive.words.expression import Expression, Template, literal
from executive.words.phrase import Goal, ObjectWords, written
from executive.words.step import Fault, Scalar, Step, unreadable
from executive.words.task import Part, Task
from skills.inputs.schema import Name, Strict, Text
from skills.quantities import Duration, Number, QuantityError, Share, clock_text

COMMAND_KEYS: Final = ("take", "to", "do", "object")
_ELSEWHERE: Final = "Whether the robot also searches elsewhere; by default, if the place is the object's usual one."
_GIVES: Final = "Names for the output ports or the answer; later steps read them with {from: NAME} and in expressions."


class Say(Step):
    """Step written as a sentence in English."""

    say: Text = Field(description="The request, in English.")
    elsewhere: StrictBool | None = Field(default=None, description=_ELSEWHERE)
    gives: dict[str, Name] | None = Field(default=None, description=_GIVES)
    _meaning: tuple[Command, ...] = PrivateAttr(default=())

    @property
    def commands(self) -> tuple[Command, ...]:
        """Commands that the sentence means, once it is understood."""
        return self._meaning

    def with_commands(self, commands: tuple[Command, ...]) -> Say:
        """Copies the step with the commands that its sentence means."""
        copy = self.model_copy()
        copy._meaning = commands
        return copy


def _of_kind(value: Any, info: ValidationInfo) -> Any:
    """Text of an object by the kind that its task says; that of a command, in the context, stays."""
    task = None if info.context else info.data.get("do")
    return value if task is None or value is None else object_text(task.object_is, value)


class Do(Step):
    """Step with one command, written as its parts."""

    take: ObjectWords | None = Field(default=None, description="The object to carry; a number may stand before it.")
    to: Goal | None = Field(default=None, description='Place, person, "start", "Robin at hall", or spot on a surface.')
    do: Task | None = Field(default=None, description="The task there, on the object.")
    object: Annotated[
        ObjectWords | None, BeforeValidator(_of_kind, json_schema_input_type=ObjectWords | Number | None)
    ] = Field(
        default=None,
        description='The object of the task, or a person: a name, "person" for anybody, or "speaker"; or, as the task '
        'says, a time (seconds, or "10 min"), a number or a text.',
    )
    elsewhere: StrictBool | None = Field(default=None, description=_ELSEWHERE)
    gives: dict[str, Name] | None = Field(default=None, description=_GIVES)

    @model_validator(mode="after")
    def _is_a_command(self) -> Self:
        lacks = self.do is not None and self.do.object_is is not Part.NOTHING and self.object is None
        if lacks or (self.object is not None and self.do is None):
            about = "" if self.do is None else f"'{self.do.word}' needs its object, a {self.do.object_is.value}"
            raise QuantityError("'do' and 'object' go together", about or "say with 'do' what is done to it")
        if self.gives is not None and self.do is None:
            raise ValueError("'gives' goes with 'skill', 'ask', 'check', 'say' or 'do'")
        return self

    @classmethod
    def from_command(cls, command: Command) -> Do:
        """Builds the step for a command, and keeps the command's verb."""
        step = cls.model_validate(written(parts_of_command(command)), context=command)
        step.__dict__["command"] = command
        return step

    def with_command(self, command: Command) -> Do:
        """Copies the step with another command."""
        parts = written(parts_of_command(command))
        copy = self.model_copy(update={**dict.fromkeys(COMMAND_KEYS), **parts, "do": command.task})
        copy.__dict__["command"] = command
        return copy

    @functools.cached_property
    def command(self) -> Command:
        """Command of the step. Raises ValueError when a part cannot be parsed."""
        do = None if self.do is None else self.do.word
        parts = {"take": self.take, "to": self.to, "do": do, "object": self.object}
        return command_of_parts({key: None if each is None else str(each) for key, each in parts.items()})

    @property
    def commands(self) -> tuple[Command, ...]:
        """The one command, as a tuple."""
        return (self.command,)


def steps_of_commands(commands: Sequence[Command]) -> tuple[Do, ...]:
    """Returns one step for each command."""
    return tuple(map(Do.from_command, commands))


_With = Annotated[dict[str, Any] | None, Field(alias="with", description="The skill's ports, or a file's parameters.")]


class CallSkill(Step):
    """Step that calls a skill with values for its ports."""

    skill: Name = Field(description="The name of a registered skill.")
    values: _With = None
    gives: dict[str, Name] | None = Field(default=None, description=_GIVES)

    @property
    def words(self) -> str:
        """Name of the skill."""
        return self.skill


class UseMission(Step):
    """Step that runs another mission file."""

    use: Name = Field(description="Another mission file, as seen from this file's folder.")
    values: _With = None
    _mission: Any = PrivateAttr(default=None)

    @property
    def mission(self) -> Any:
        """`Mission` in the file, once the file is read."""
        return self._mission

    def with_mission(self, mission: Any) -> UseMission:
        """Copies the step with the mission that its file contains."""
        copy = self.model_copy()
        copy._mission = mission
        return copy

    @property
    def inner_steps(self) -> tuple[Step, ...]:
        """Steps of the used mission."""
        return () if self._mission is None else (*self._mission.steps, *self._mission.framing_steps)

    @property
    def words(self) -> str:
        """Name of the used mission."""
        return self.use if self._mission is None else str(self._mission.name)


Clock = Annotated[str, BeforeValidator(clock_text)]
"""Time of day."""


class Awaited(Strict):
    """Event that ends a wait: a condition, a duration, or a time of day."""

    condition: Annotated[Condition | None, Field(alias="for", description="Wait until this holds.")] = None
    seconds: Duration | None = Field(default=None, description='Length of the wait: seconds, or "10 min".')
    until_clock: Clock | None = Field(default=None, description='Until this time of day, as in "14:30".')
    every_s: Annotated[Duration, Field(alias="every", description="How often the robot looks for it.")] = 15.0

    @model_validator(mode="after")
    def _one_form(self) -> Self:
        if sum(each is not None for each in (self.condition, self.seconds, self.until_clock)) != 1:
            raise ValueError("give one of 'for', 'seconds' and 'until_clock'")
        return self


class Wait(Step):
    """`wait`: waits for a condition, for a duration, or until a time of day."""

    key: ClassVar[str] = "wait"
    awaited: Annotated[Awaited, Field(alias="wait", description="Wait for a condition, a duration or a time of day.")]

    @property
    def words(self) -> str:
        """Name of the step, with its condition if it has one."""
        condition = self.awaited.condition
        return self.key if condition is None else f"wait until {condition}"


class Answering(Step):
    """Step with an answer that later steps may read under a name."""

    gives: dict[str, Name] | None = Field(default=None, description=_GIVES)

    @property
    def answer_name(self) -> str | None:
        """Name under which later steps read the answer."""
        return (self.gives or {}).get("answer")

    @property
    def faults(self) -> Iterator[Fault]:
        """Yields a fault for each named output that the step does not have."""
        for wrong in (port for port in self.gives or () if port != "answer"):
            yield ("gives", wrong), f"it gives no '{wrong}'", "write {answer: NAME}"


class Check(Answering):
    """`check`: answers whether a condition holds; the answer is part of the mission's result."""

    key: ClassVar[str] = "check"
    condition: Annotated[Condition, Field(alias="check", description="Answers, in the result, whether this holds.")]

    @property
    def words(self) -> str:
        """Name of the step, with its condition."""
        return f"check whether {self.condition}"


class Charging(Strict):
    """Level of charge at the dock."""

    level: Share | None = Field(default=None, description="The charge, from 0 to 1; by default the knowledge file's.")


class Dock(Step):
    """`dock`: goes to the dock and charges."""

    key: ClassVar[str] = "dock"
    charging: Annotated[
        Charging,
        BeforeValidator(lambda value: {} if value is None else value, json_schema_input_type=Charging | None),
        Field(alias="dock", description="Go to the dock and charge."),
    ] = Charging()

    @model_serializer(mode="wrap")
    def _with_its_key(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        return {"dock": {}, **handler(self)}

    @property
    def level(self) -> float | None:
        """Charge from 0 to 1; None stands for the charge that the knowledge file states."""
        return self.charging.level


class Speak(Step):
    """`speak`: says a text to the people around."""

    key: ClassVar[str] = "speak"
    speak: Text = Field(description="The text for the people around; {NAME} inserts a value.")

    @property
    def text(self) -> Template:
        """Text with its expressions parsed. Raises ExpressionError."""
        return Template(self.speak)

    @property
    def words(self) -> str:
        """Text in quotes."""
        return f'speak "{self.speak}"'

    @property
    def faults(self) -> Iterator[Fault]:
        """Yields a fault if the text cannot be parsed."""
        yield from unreadable(("speak",), lambda: self.text)


class DoorToOpen(DoorOpen):
    """Door that must be opened, and the time limit for it."""

    within_s: Annotated[
        Duration, Field(alias="within", description='Time until the door is open: seconds, or a text such as "2 min".')
    ] = 120.0

    @property
    def words(self) -> str:
        """Words for what must happen to the door."""
        return f"have the {self.name} opened"


class OpenDoor(Step):
    """`open`: has a door opened, and waits until it is open; does nothing if the door is open already."""

    key: ClassVar[str] = "open"
    door: Annotated[DoorToOpen, Field(alias="open", description="Have a door opened, and wait until it is open.")]

    @property
    def words(self) -> str:
        """Name of the step, with its door."""
        return self.door.words


class Subject(Strict):
    """Subject of a picture, the place from which it is taken, and the camera."""

    of: Text = Field(description="An object, a surface, a named pose; or a room, of which four pictures are taken.")
    at: Text | None = Field(default=None, description="The place where the robot stands; by default a viewpoint.")
    camera: Name | None = Field(
        default=None, description="A camera of the robot, such as `hand`; by default that one, or one that sees it."
    )


class Picture(Step):
    """`picture`: takes a picture, which stands in the answers and in the folder `pictures/` of the run."""

    key: ClassVar[str] = "picture"
    subject: Annotated[Subject, Field(alias="picture", description="Take a picture of something.")]

    @property
    def words(self) -> str:
        """Words for what the picture shows."""
        return f"take a picture of the {self.subject.of}"


class Set(Step):
    """`set`: computes named values in order."""

    key: ClassVar[str] = "set"
    set: dict[Name, Scalar] = Field(description="Values by name: numbers, truths or expressions.")

    @property
    def values(self) -> Mapping[str, Expression]:
        """Parsed expression for each value. Raises ExpressionError."""
        return {name: _expression(value) for name, value in self.set.items()}

    @property
    def faults(self) -> Iterator[Fault]:
        """Yields the faults of values with bad names, and of values that cannot be parsed."""
        for name, value in self.set.items():
            if value is None:
                yield ("set", name), f"'{name}' gets no value", "give a number, a truth or an expression"
            yield from unreadable(("set", name), functools.partial(_expression, value))


def _expression(value: Scalar) -> Expression:
    """Parses the expression for a value. Raises ExpressionError."""
    return Expression(value) if isinstance(value, str) else literal(0 if value is None else value)
