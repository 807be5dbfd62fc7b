"""Steps of a mission, as a file writes them: commands, skills, other missions, and blocks that hold steps.

Each step is one model, told from the others by its first key. What has been read is the same model with its sentences
understood and its names those of the world.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Final, Literal, Self, Union

from pydantic import (
    BeforeValidator,
    Field,
    PrivateAttr,
    SerializerFunctionWrapHandler,
    StrictBool,
    ValidatorFunctionWrapHandler,
    WrapValidator,
    model_serializer,
    model_validator,
)
from typing_extensions import TypeAliasType

from executive.words.command import Command, Task, command_of_parts, parts_of_command
from executive.words.condition import Condition
from executive.words.expression import Expression, ExpressionError, Template, literal
from executive.words.forms import Forms, Strict
from executive.words.policy import Policy
from skills.files.errors import InputError, SourceLine, listing
from skills.files.schema import Name, Text
from skills.files.yaml_source import KeyPath, YamlSource
from skills.quantities import Count, Duration, Number, QuantityError, Share, Whole, clock_text

__all__ = [
    "Ask",
    "Awaited",
    "CallSkill",
    "Charging",
    "Check",
    "Choose",
    "Do",
    "Dock",
    "ForEach",
    "Group",
    "Handler",
    "Loop",
    "Place",
    "Repeat",
    "Say",
    "Set",
    "Speak",
    "Step",
    "Steps",
    "Together",
    "Try",
    "UseMission",
    "Wait",
    "While",
    "steps_of_commands",
]

COMMAND_KEYS: Final = ("take", "to", "do", "object")
Given = str | StrictBool | Whole | Number
Scalar = Given | None
Fault = tuple[KeyPath, str, str]
"""The path below a step to what is wrong with it, a sentence and a hint."""


@dataclass(frozen=True)
class Place:
    """The place of a step in a file: the document, and the path in it."""

    source: YamlSource
    path: KeyPath

    @property
    def line(self) -> SourceLine:
        """Its line."""
        return SourceLine(self.source.path, self.source.line(self.path))

    def error(self, below: KeyPath, message: str, hint: str) -> InputError:
        """An error in what stands at a path below."""
        return self.source.error((*self.path, *below), message, hint)


class Step(Policy):
    """A step: its policy, and what it is to do."""

    key: ClassVar[str] = ""
    """The first key of its form, which names it in path ids."""
    _place: Place | None = PrivateAttr(default=None)

    @property
    def place(self) -> Place | None:
        """Where it stands in a file; None when it was spoken."""
        return self._place

    @property
    def source(self) -> SourceLine | None:
        """The line where it stands; None when it was spoken."""
        return None if self._place is None else self._place.line

    @property
    def is_block(self) -> bool:
        """Whether it decides, repeats, waits or the like, and is no command, skill or mission."""
        return bool(self.key)

    @property
    def commands(self) -> tuple[Command, ...]:
        """Its own commands."""
        return ()

    @property
    def within(self) -> Steps:
        """The steps that it holds, in order."""
        return ()

    @property
    def words(self) -> str:
        """What it is called in sentences."""
        return self.key

    @property
    def faults(self) -> Iterator[Fault]:
        """What is wrong with its values by themselves."""
        yield from ()

    def error(self, below: KeyPath, message: str, hint: str) -> InputError:
        """An error in what stands at a path below the step."""
        return InputError(message, hint=hint) if self._place is None else self._place.error(below, message, hint)

    def at(self, place: Place | None) -> Self:
        """The same step, which stands at a place."""
        copy = self.model_copy()
        copy._place = place
        return copy

    def walk(self) -> Iterator[Step]:
        """Itself and all steps that it holds, those of a used mission included."""
        yield self
        for step in self.within:
            yield from step.walk()


def _unreadable(path: KeyPath, read: Callable[[], object]) -> Iterator[Fault]:
    """What is wrong with an expression or a text with expressions."""
    try:
        read()
    except ExpressionError as error:
        yield path, error.message, error.hint


def _none_is_empty(value: Any, handler: ValidatorFunctionWrapHandler) -> Any:
    return () if value is None or value == () else handler(value)


if TYPE_CHECKING:
    Steps = tuple[Step, ...]
    Branch = tuple[Step, ...]
else:
    AnyStep = TypeAliasType("AnyStep", Annotated["_AnyStep", WrapValidator(lambda data, _: _read(data))])
    Steps = Annotated[tuple[AnyStep, ...], Field(min_length=1)]
    Branch = Annotated[Steps, WrapValidator(_none_is_empty, json_schema_input_type=Steps | None)]
"""Steps in a row; a branch may have none."""


def _named_goal(value: object) -> object:
    """A goal is named; a pose belongs to the skill that takes one. Raises QuantityError."""
    if isinstance(value, list | dict):
        hint = "for a pose write 'skill: navigate' with 'with: {x: 1.0, y: 2.0, yaw: 1.57}', in metres and radians"
        raise QuantityError("should be the name of a place or person", hint)
    return value


Goal = Annotated[Text, BeforeValidator(_named_goal)]
_ELSEWHERE: Final = "Whether an object that is not in its place is also searched for elsewhere; by default, yes."
_GIVES: Final = (
    "Names for the skill's output ports, or for the answer; later steps read them with {from: NAME} and in expressions."
)


class Say(Step):
    """A sentence."""

    say: Text = Field(description="What to do, in English.")
    elsewhere: StrictBool | None = Field(default=None, description=_ELSEWHERE)
    gives: dict[str, Name] | None = Field(default=None, description=_GIVES)
    _meaning: tuple[Command, ...] = PrivateAttr(default=())

    @property
    def commands(self) -> tuple[Command, ...]:
        """What the sentence means, once that is understood."""
        return self._meaning

    def meaning(self, commands: tuple[Command, ...]) -> Say:
        """The same sentence, which means these commands."""
        copy = self.model_copy()
        copy._meaning = commands
        return copy


class Do(Step):
    """A command, by its parts."""

    take: Text | None = Field(default=None, description="What is carried; a number may stand before it.")
    to: Goal | None = Field(default=None, description='The place or person, or "start", or "Robin at hall".')
    do: Task | None = Field(default=None, description="What to do there to the object.")
    object: Text | None = Field(default=None, description="The object of the task, or who is looked for.")
    elsewhere: StrictBool | None = Field(default=None, description=_ELSEWHERE)
    gives: dict[str, Name] | None = Field(default=None, description=_GIVES)

    @model_validator(mode="after")
    def _is_a_command(self) -> Self:
        if self.do is not Task.CHARGE and (self.do is None) != (self.object is None):
            raise ValueError("'do' and 'object' go together")
        if self.gives is not None and self.do is None:
            raise ValueError("'gives' goes with 'skill', 'ask', 'check', 'say' or 'do'")
        return self

    @classmethod
    def of(cls, command: Command) -> Do:
        """The step of a command, whose verb it remembers."""
        step = cls.model_validate(parts_of_command(command))
        step.__dict__["command"] = command
        return step

    def meaning(self, command: Command) -> Do:
        """The same step with another command."""
        parts: Mapping[str, Any] = {**dict.fromkeys(COMMAND_KEYS), **parts_of_command(command), "do": command.task}
        copy = self.model_copy(update=parts)
        copy.__dict__["command"] = command
        return copy

    @functools.cached_property
    def command(self) -> Command:
        """The command. Raises ValueError: a part is no name."""
        do = None if self.do is None else self.do.value
        return command_of_parts({"take": self.take, "to": self.to, "do": do, "object": self.object})

    @property
    def commands(self) -> tuple[Command, ...]:
        """The one command."""
        return (self.command,)


def steps_of_commands(commands: Sequence[Command]) -> tuple[Do, ...]:
    """A step for each command."""
    return tuple(map(Do.of, commands))


class CallSkill(Step):
    """A skill with its ports."""

    skill: Name = Field(description="The name of a registered skill.")
    values: Annotated[
        dict[str, Any] | None,
        Field(alias="with", description="The skill's input ports, or the parameters of the used file."),
    ] = None
    gives: dict[str, Name] | None = Field(default=None, description=_GIVES)

    @property
    def words(self) -> str:
        """The skill's name."""
        return self.skill


class UseMission(Step):
    """Another mission file, which is done as a step."""

    use: Name = Field(description="Another mission file, as seen from this file's folder.")
    values: Annotated[
        dict[str, Any] | None,
        Field(alias="with", description="The skill's input ports, or the parameters of the used file."),
    ] = None
    _mission: Any = PrivateAttr(default=None)

    @property
    def mission(self) -> Any:
        """The `Mission` of the file, once that is read."""
        return self._mission

    def meaning(self, mission: Any) -> UseMission:
        """The same step with its mission."""
        copy = self.model_copy()
        copy._mission = mission
        return copy

    @property
    def within(self) -> Steps:
        """The mission's steps."""
        return () if self._mission is None else (*self._mission.steps, *self._mission.around)

    @property
    def words(self) -> str:
        """The mission's name."""
        return self.use if self._mission is None else str(self._mission.name)


class Choose(Step):
    """`if`: the steps of `then` when the condition holds, else those of `else`, which may be none."""

    key: ClassVar[str] = "if"
    condition: Annotated[
        Condition, Field(alias="if", description="A condition that decides between `then` and `else`.")
    ]
    then: Annotated[Steps, Field(description="The steps when the condition of `if` holds.")]
    otherwise: Annotated[
        Branch,
        Field(
            alias="else",
            description="The steps when the condition of `if` does not hold, or when `try` failed.",
        ),
    ] = ()

    @property
    def within(self) -> Steps:
        """The steps of both branches."""
        return (*self.then, *self.otherwise)

    @property
    def words(self) -> str:
        """The condition in words."""
        return f"if {self.condition}"


class Loop(Strict):
    """Rounds of `steps`."""

    times: Count | None = Field(default=None, description="How many rounds; with a condition, how many at most.")
    until: Condition | None = Field(default=None, description="Rounds are made until this holds after one.")
    while_: Annotated[
        Condition | None, Field(alias="while", description="Rounds are made as long as this holds before one.")
    ] = None
    every_s: Annotated[
        Duration | None,
        Field(alias="every", description='A round begins so long after the one before began: seconds, or "30 min".'),
    ] = None
    for_each: tuple[Any, ...] | Text | None = Field(
        default=None,
        description='One round for each of a list, or of "rooms", "people", "people in ROOM" or "surfaces in ROOM".',
    )
    name: Annotated[Name | None, Field(alias="as", description="The name by which steps read it, as ${NAME}.")] = None

    @model_validator(mode="after")
    def _one_form(self) -> Self:
        if self.until is not None and self.while_ is not None:
            raise ValueError("rounds go on 'until' or 'while', not both")
        if (self.for_each is None) != (self.name is None):
            raise ValueError("'for_each' and 'as' go together")
        others = [key for key in ("times", "until", "while_", "every_s") if getattr(self, key) is not None]
        if self.for_each is not None and others:
            raise ValueError("'for_each' stands alone")
        if self.for_each is None and not others:
            raise ValueError("it does not say how often: give 'times', 'until', 'while', 'every' or 'for_each'")
        return self

    @property
    def is_endless(self) -> bool:
        """Whether nothing ends the rounds."""
        return self.times is None and self.until is None and self.while_ is None


_ROUNDS: Final = "How often, and until when, `steps` are repeated."


class Repeat(Step):
    """`repeat`: rounds of the same steps."""

    key: ClassVar[str] = "repeat"
    loop: Annotated[Loop, Field(alias="repeat", description=_ROUNDS)]
    steps: Annotated[Steps, Field(description="The steps that `repeat` repeats.")]

    @property
    def within(self) -> Steps:
        """The steps of a round."""
        return self.steps


class ForEach(Step):
    """`repeat` with `for_each`: its steps are read once for each value, which they name."""

    key: ClassVar[str] = "repeat"
    loop: Annotated[Loop, Field(alias="repeat", description=_ROUNDS)]
    steps: Any = Field(default=None, description="The steps that `repeat` repeats.")

    @property
    def faults(self) -> Iterator[Fault]:
        """No steps."""
        if not self.steps:
            yield (), "'repeat' needs 'steps' beside it", "add what is to be done in each round"


class Try(Step):
    """`try`: the steps in a row; as soon as one fails, those of `else` in their place."""

    key: ClassVar[str] = "try"
    steps: Annotated[Steps, Field(alias="try", description="Steps; as soon as one fails, those of `else` are done.")]
    otherwise: Annotated[
        Steps,
        Field(
            alias="else",
            description="The steps when the condition of `if` does not hold, or when `try` failed.",
        ),
    ]

    @property
    def within(self) -> Steps:
        """The steps of both branches."""
        return (*self.steps, *self.otherwise)


class Together(Step):
    """`together`: all steps side by side; done when enough of them are, then the others are stopped."""

    key: ClassVar[str] = "together"
    if TYPE_CHECKING:
        steps: Steps
    else:
        steps: Annotated[
            tuple[AnyStep, ...],
            Field(
                alias="together",
                min_length=2,
                description="Steps that run side by side: those that move different parts of the robot, or none.",
            ),
        ]
    done_when: Literal["all", "any"] | Count | None = Field(
        default=None, description="How many steps of `together` must be done: all of them unless said."
    )

    @property
    def within(self) -> Steps:
        """The steps side by side."""
        return self.steps

    @property
    def needed(self) -> int:
        """How many steps must be done."""
        if isinstance(self.done_when, int):
            return self.done_when
        return 1 if self.done_when == "any" else len(self.steps)

    @property
    def faults(self) -> Iterator[Fault]:
        """More steps that must be done than there are."""
        if self.needed > len(self.steps):
            what = f"{self.needed} of {len(self.steps)} steps cannot be done"
            yield ("done_when",), what, f"give {len(self.steps)} at most"


class While(Strict):
    """What must hold while steps run."""

    holds: Condition = Field(description="When it does not hold, the steps are stopped and have failed.")


class Handler(Strict):
    """What interrupts a group or a mission."""

    condition: Annotated[
        Condition, Field(alias="if", description="When this begins to hold, the steps are interrupted.")
    ]
    steps: Annotated[Steps, Field(alias="do", description="What is done then; afterwards the steps go on.")]
    times: Count = Field(default=10, description="How often at most; once more is a failure.")


class Group(Step):
    """`group`: steps in a row that share a policy, and what is watched while they run and done in the end."""

    key: ClassVar[str] = "group"
    steps: Annotated[Steps, Field(alias="group", description="Steps in a row that share a policy.")]
    name: Name | None = Field(default=None, description="What the group is called.")
    always: Annotated[
        Branch,
        Field(description="Steps at the end of the group, whatever happened, also when the mission is cancelled."),
    ] = ()
    while_: Annotated[While | None, Field(alias="while", description="What must hold while the group runs.")] = None
    when: tuple[Handler, ...] | None = Field(
        default=None, description="What interrupts the group, the most important first."
    )

    @property
    def within(self) -> Steps:
        """The steps that interrupt it, its own, and those at the end."""
        return (*(step for each in self.when or () for step in each.steps), *self.steps, *self.always)

    @property
    def words(self) -> str:
        """Its name."""
        return self.name or self.key


Clock = Annotated[str, BeforeValidator(clock_text)]
"""A time of day."""


class Awaited(Strict):
    """What is waited for: one of a condition, a time and a time of day."""

    condition: Annotated[Condition | None, Field(alias="for", description="Wait until this holds.")] = None
    seconds: Duration | None = Field(default=None, description='So long: seconds, or "10 min".')
    until_clock: Clock | None = Field(default=None, description='Until this time of day, as in "14:30".')
    every_s: Annotated[
        Duration, Field(alias="every", description="How often a condition that takes a look is looked at.")
    ] = 15.0

    @model_validator(mode="after")
    def _one_form(self) -> Self:
        if sum(each is not None for each in (self.condition, self.seconds, self.until_clock)) != 1:
            raise ValueError("give one of 'for', 'seconds' and 'until_clock'")
        return self

    @property
    def until_clock_s(self) -> float:
        """The time of day, in seconds after midnight; 0 where none is awaited."""
        hours, minutes = map(int, (self.until_clock or "00:00").split(":"))
        return 3600.0 * hours + 60.0 * minutes


class Wait(Step):
    """`wait`: for a condition, some time, or until a time of day."""

    key: ClassVar[str] = "wait"
    awaited: Annotated[
        Awaited, Field(alias="wait", description="Wait for a condition, some time, or until a time of day.")
    ]

    @property
    def words(self) -> str:
        """The condition in words, where it waits for one."""
        condition = self.awaited.condition
        return self.key if condition is None else f"wait until {condition}"


class _Answering(Step):
    """A step whose answer later steps may read under a name."""

    gives: dict[str, Name] | None = Field(default=None, description=_GIVES)

    @property
    def answer_name(self) -> str | None:
        """The name of its answer."""
        return (self.gives or {}).get("answer")

    @property
    def faults(self) -> Iterator[Fault]:
        """What it does not give."""
        for wrong in (port for port in self.gives or () if port != "answer"):
            yield ("gives", wrong), f"it gives no '{wrong}'", "write {answer: NAME}"


class Check(_Answering):
    """`check`: answers whether a condition holds; the answer is part of the mission's result."""

    key: ClassVar[str] = "check"
    condition: Annotated[
        Condition, Field(alias="check", description="Answer whether a condition holds, as part of the result.")
    ]

    @property
    def words(self) -> str:
        """The condition in words."""
        return f"check whether {self.condition}"


class Charging(Strict):
    """How far to charge at the dock."""

    level: Share | None = Field(
        default=None, description="The charge, from 0 to 1; by default as the knowledge file says."
    )


class Dock(Step):
    """`dock`: go to the dock and charge."""

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
        """The charge, from 0 to 1; None: as the knowledge file says."""
        return self.charging.level


class Speak(Step):
    """`speak`: says a text to the people around."""

    key: ClassVar[str] = "speak"
    speak: Text = Field(description="What to say to the people around; {NAME} puts in a value.")

    @property
    def text(self) -> Template:
        """The text with its values. Raises ExpressionError."""
        return Template(self.speak)

    @property
    def words(self) -> str:
        """The text in quotes."""
        return f'speak "{self.speak}"'

    @property
    def faults(self) -> Iterator[Fault]:
        """A text that cannot be read."""
        yield from _unreadable(("speak",), lambda: self.text)


def _choices(data: Any) -> Any:
    """Choices may be a list of their names. Raises ValueError: one is true or false."""
    names = list(data) if isinstance(data, list | dict) else []
    if any(isinstance(name, bool) for name in names):
        raise ValueError("yes, no, on and off mean true and false in YAML: put them in quotes")
    return dict.fromkeys(names) if isinstance(data, list) and all(isinstance(c, str) for c in names) else data


if TYPE_CHECKING:
    Choices = dict[str, tuple[Step, ...]]
else:
    Choices = Annotated[
        dict[Name, Branch],
        Field(min_length=1),
        BeforeValidator(_choices, json_schema_input_type=dict[Name, Steps | None] | tuple[Name, ...]),
    ]


class Ask(_Answering):
    """`ask`: puts a question to the people around, or to the operator.

    The answer is one of `choices`, whose steps are then done; or, with `match`, a name of the world as people say it, a
    number or any text. When nobody answers in time it is `default`; without one the step fails.
    """

    key: ClassVar[str] = "ask"
    ask: Text = Field(description="A question to the people around, or to the operator.")
    choices: Choices | None = Field(
        default=None, description="The answers to choose from, perhaps with the steps that each leads to."
    )
    match: Literal["place", "person", "object", "number", "text"] | None = Field(
        default=None, description="What the answer is, where there are no choices."
    )
    limit_s: Annotated[
        Duration, Field(alias="limit", description="How long to wait for an answer (robot's clock).")
    ] = 60.0
    default: Scalar = Field(
        default=None, description="The answer when nobody answers in time; without one the step fails."
    )

    @model_validator(mode="after")
    def _one_kind_of_answer(self) -> Self:
        if self.choices is not None and self.match is not None:
            raise ValueError("an answer is one of 'choices' or what 'match' says, not both")
        return self

    @property
    def text(self) -> Template:
        """The question with its values. Raises ExpressionError."""
        return Template(self.ask)

    @property
    def within(self) -> Steps:
        """The steps of all choices."""
        return tuple(step for steps in (self.choices or {}).values() for step in steps)

    @property
    def words(self) -> str:
        """The question in quotes."""
        return f'ask "{self.ask}"'

    @property
    def faults(self) -> Iterator[Fault]:
        """A default that is no choice, and choices that sound the same."""
        choices = self.choices or {}
        if choices and self.default is not None and self.default not in choices:
            yield ("default",), f"'{self.default}' is none of the choices", f"they are {listing(choices)}"
        alike = {choice.lower(): choice for choice in reversed(choices)}
        for wrong in (choice for choice in choices if alike[choice.lower()] != choice):
            what = f"the choices '{alike[wrong.lower()]}' and '{wrong}' are the same to one who answers"
            yield ("choices", wrong), what, "give them different names"
        yield from _unreadable(("ask",), lambda: self.text)
        yield from super().faults


class Set(Step):
    """`set`: values by name, worked out in order."""

    key: ClassVar[str] = "set"
    set: dict[Name, Scalar] = Field(description="Values by name: numbers, truths or expressions.")

    @property
    def values(self) -> Mapping[str, Expression]:
        """The expression of each value. Raises ExpressionError."""
        return {name: _expression(value) for name, value in self.set.items()}

    @property
    def faults(self) -> Iterator[Fault]:
        """Names without a value, and values that cannot be read."""
        for name, value in self.set.items():
            if value is None:
                yield ("set", name), f"'{name}' gets no value", "give a number, a truth or an expression"
            yield from _unreadable(("set", name), functools.partial(_expression, value))


def _expression(value: Scalar) -> Expression:
    """A value as an expression. Raises ExpressionError."""
    return Expression(value) if isinstance(value, str) else literal(0 if value is None else value)


_BLOCKS: Final[Mapping[str, type[Step]]] = MappingProxyType(
    {each.key: each for each in (Choose, Repeat, Try, Together, Wait, Check, Dock, Group, Speak, Ask, Set)}
)
BLOCKS: Final = tuple(_BLOCKS)
FORMS: Final = f"'say', some of 'take', 'to', 'do' and 'object', 'skill', 'use', or one of {listing(BLOCKS, last='or')}"
_KEYS: Final[Mapping[str, type[Step]]] = MappingProxyType(
    {"say": Say, "skill": CallSkill, "use": UseMission, **_BLOCKS, **dict.fromkeys(COMMAND_KEYS, Do)}
)


def _refused(told: Sequence[str]) -> str:
    if not told:
        return f"the step is empty: give it {FORMS}"
    return f"a step has either '{told[0]}' or {listing(told[1:])}, not both"


_FORMS: Final = Forms(_KEYS, _refused)


def _read(data: Any) -> Any:
    """A step of a file: `dock` may stand alone, and the steps of a `for_each` are read later, for each value."""
    if data == "dock" or (isinstance(data, Mapping) and "dock" in data and data["dock"] is None):
        data = {**({} if data == "dock" else data), "dock": {}}
    if isinstance(data, ForEach):
        return data
    if isinstance(data, Mapping) and isinstance(data.get("repeat"), Mapping) and "for_each" in data["repeat"]:
        return Forms({**_KEYS, "repeat": ForEach}, _refused).read(data)
    return _FORMS.read(data)


if not TYPE_CHECKING:
    _AnyStep = Union[tuple(dict.fromkeys(_KEYS.values()))]  # noqa: UP007
