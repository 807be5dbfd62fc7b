"""Steps that contain steps, and the union of all kinds of steps, as a mission file writes them.

The first key of a step selects its model. A resolved step has the same model, with understood sentences and with the
world's own names. As lines of text, commands have their text form and other steps are YAML.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Final, Literal, Self, Union

from pydantic import (
    BeforeValidator,
    Field,
    ValidationInfo,
    ValidatorFunctionWrapHandler,
    WrapValidator,
    field_validator,
    model_validator,
)
from typing_extensions import TypeAliasType

from executive.words.command import parse_command
from executive.words.condition import Condition
from executive.words.expression import Template
from executive.words.forms import Forms
from executive.words.leaf_steps import (
    COMMAND_KEYS,
    Answering,
    CallSkill,
    Check,
    Clock,
    Do,
    Dock,
    OpenDoor,
    Picture,
    Say,
    Set,
    Speak,
    UseMission,
    Wait,
    steps_of_commands,
)
from executive.words.step import Fault, Scalar, Step, unreadable
from executive.words.task import Part, Task, installed_tasks, is_task, task_named
from executive.words.zone import ZONES, Zones
from skills.inputs.errors import InputError, listing
from skills.inputs.schema import Name, Strict, Text
from skills.inputs.yaml_source import parse_yaml, yaml_of
from skills.quantities import Count, Duration, QuantityError


def _none_is_empty(value: Any, handler: ValidatorFunctionWrapHandler) -> Any:
    return () if value is None or value == () else handler(value)


if TYPE_CHECKING:
    Steps = tuple[Step, ...]
    Branch = tuple[Step, ...]
else:
    AnyStep = TypeAliasType("AnyStep", Annotated["_AnyStep", WrapValidator(lambda data, _: _read(data))])
    Steps = Annotated[tuple[AnyStep, ...], Field(min_length=1)]
    Branch = Annotated[Steps, WrapValidator(_none_is_empty, json_schema_input_type=Steps | None)]
"""Sequence of steps; a branch may be empty."""
_ELSE: Final = Field(alias="else", description="The steps when the condition of `if` does not hold, or `try` failed.")


class Choose(Step):
    """`if`: runs the steps of `then` when the condition holds, otherwise those of `else`, which may be empty."""

    key: ClassVar[str] = "if"
    condition: Annotated[Condition, Field(alias="if", description="Condition that decides between `then` and `else`.")]
    then: Annotated[Steps, Field(description="The steps when the condition of `if` holds.")]
    otherwise: Annotated[Branch, _ELSE] = ()

    @property
    def words(self) -> str:
        """Name of the step, with its condition."""
        return f"if {self.condition}"


class Loop(Strict):
    """Number, interval and end condition of the rounds in a `repeat`."""

    times: Count | None = Field(default=None, description="How many rounds; with a condition, how many at most.")
    until: Condition | None = Field(default=None, description="Rounds are made until this holds after one.")
    while_: Annotated[Condition | None, Field(alias="while", description="Rounds begin while this holds.")] = None
    until_clock: Clock | None = Field(default=None, description='Rounds begin until this time of day, as in "18:00".')
    every_s: Annotated[
        Duration | None,
        Field(alias="every", description='A round begins so long after the one before began: seconds, or "30 min".'),
    ] = None
    for_each: tuple[Any, ...] | Text | None = Field(
        default=None,
        description='One round for each of a list, or of "rooms", "poses", "people in ROOM" and the like.',
    )
    name: Annotated[Name | None, Field(alias="as", description="The name by which steps read it, as ${NAME}.")] = None

    @model_validator(mode="after")
    def _one_form(self) -> Self:
        if sum(each is not None for each in (self.until, self.while_, self.until_clock)) > 1:
            raise ValueError("rounds go on 'until' or 'while' or 'until_clock', not two of them")
        if (self.for_each is None) != (self.name is None):
            raise ValueError("'for_each' and 'as' go together")
        others = [
            key for key in ("times", "until", "while_", "until_clock", "every_s") if getattr(self, key) is not None
        ]
        if self.for_each is not None and others:
            raise ValueError("'for_each' stands alone")
        if self.for_each is None and not others:
            known = "'times', 'until', 'while', 'until_clock', 'every' or 'for_each'"
            raise ValueError(f"it does not say how often: give {known}")
        return self

    @property
    def is_endless(self) -> bool:
        """Returns whether the rounds have no end condition and no number."""
        return self.times is None and self.until is None and self.while_ is None and self.until_clock is None


_ROUNDS: Final = "How often, and until when, `steps` are repeated."


class Repeat(Step):
    """`repeat`: repeats its steps in rounds."""

    key: ClassVar[str] = "repeat"
    loop: Annotated[Loop, Field(alias="repeat", description=_ROUNDS)]
    steps: Annotated[Steps, Field(description="The steps that `repeat` repeats.")]


class ForEach(Step):
    """`repeat` with `for_each`: its steps are read once for each value, which they name."""

    key: ClassVar[str] = "repeat"
    loop: Annotated[Loop, Field(alias="repeat", description=_ROUNDS)]
    steps: Any = Field(default=None, description="The steps that `repeat` repeats.")

    @property
    def faults(self) -> Iterator[Fault]:
        """Yields a fault if the steps are missing."""
        if not self.steps:
            yield (), "'repeat' needs 'steps' beside it", "add what is to be done in each round"


class Try(Step):
    """`try`: runs the steps in order, and the steps of `else` as soon as one step fails."""

    key: ClassVar[str] = "try"
    steps: Annotated[Steps, Field(alias="try", description="Steps; as soon as one fails, those of `else` are done.")]
    otherwise: Annotated[Steps, _ELSE]


class Together(Step):
    """`together`: runs all steps in parallel until enough steps are done, and stops the others."""

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
    def needed(self) -> int:
        """Number of steps that must succeed."""
        if isinstance(self.done_when, int):
            return self.done_when
        return 1 if self.done_when == "any" else len(self.steps)

    @property
    def faults(self) -> Iterator[Fault]:
        """Yields a fault if `done_when` exceeds the number of steps."""
        if self.needed > len(self.steps):
            what = f"{self.needed} of {len(self.steps)} steps cannot be done"
            yield ("done_when",), what, f"give {len(self.steps)} at most"


class While(Strict):
    """Condition that must hold while a group or a mission runs."""

    holds: Condition = Field(description="When it does not hold, the steps are stopped and have failed.")


class Handler(Strict):
    """Condition that interrupts a group or a mission, with the steps that run then."""

    condition: Annotated[Condition, Field(alias="if", description="When this begins to hold, it interrupts the steps.")]
    steps: Annotated[Steps, Field(alias="do", description="The steps to run then; afterwards the others go on.")]
    times: Count = Field(default=10, description="How often at most; once more is a failure.")


class Group(Step):
    """`group`: runs steps in order with a common policy, watched conditions, and steps at the end."""

    key: ClassVar[str] = "group"
    steps: Annotated[Steps, Field(alias="group", description="Steps in a row that share a policy.")]
    name: Name | None = Field(default=None, description="What the group is called.")
    always: Annotated[Branch, Field(description="Steps at the group's end in any case, also when cancelled.")] = ()
    while_: Annotated[While | None, Field(alias="while", description="Condition that must hold meanwhile.")] = None
    when: tuple[Handler, ...] | None = Field(default=None, description="Conditions that interrupt it, by importance.")
    zones: Zones | None = Field(default=None, description=ZONES)

    @property
    def inner_steps(self) -> Steps:
        """Steps that interrupt the group, the group's own steps, and steps at the end."""
        return (*(step for each in self.when or () for step in each.steps), *self.steps, *self.always)

    @property
    def words(self) -> str:
        """Name of the group."""
        return self.name or self.key


def _choices(data: Any) -> Any:
    """Expands a list of choices to a mapping. Raises ValueError when a choice is true or false."""
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


_TRUTHS: Final = {True: ("yes", "on", "true"), False: ("no", "off", "false")}
"""Words that YAML reads as true and as false."""


class Ask(Answering):
    """`ask`: asks the people around, or the operator.

    The answer is one of `choices`, whose steps then run; or, with `match`, a name of the world, a number or any text.
    When nobody answers in time, the answer is `default`; without `default` the step fails.
    """

    key: ClassVar[str] = "ask"
    ask: Text = Field(description="A question to the people around, or to the operator.")
    choices: Choices | None = Field(default=None, description="Answers to choose from, perhaps with steps of each.")
    match: Literal["place", "person", "object", "number", "text"] | None = Field(
        default=None, description="Type of the answer, where there are no choices."
    )
    limit_s: Annotated[Duration, Field(alias="limit", description="Wait for an answer (s, robot's clock).")] = 60.0
    default: Scalar = Field(default=None, description="Answer when nobody answers in time; without one the step fails.")

    @field_validator("default", mode="before")
    @classmethod
    def _as_written(cls, default: Any, info: ValidationInfo) -> Any:
        """Reads a default as a choice is written: YAML reads `no` as false, and `2` as a number."""
        words = _TRUTHS[default] if isinstance(default, bool) else (str(default),)
        found = next((choice for choice in info.data.get("choices") or () if choice.lower() in words), default)
        return words[0] if isinstance(found, bool) else found

    @model_validator(mode="after")
    def _one_kind_of_answer(self) -> Self:
        if self.choices is not None and self.match is not None:
            raise ValueError("an answer is one of 'choices' or what 'match' says, not both")
        return self

    @property
    def text(self) -> Template:
        """Question with its expressions parsed. Raises ExpressionError."""
        return Template(self.ask)

    @property
    def words(self) -> str:
        """Question in quotes."""
        return f'ask "{self.ask}"'

    @property
    def faults(self) -> Iterator[Fault]:
        """Yields faults for a default that is no choice, and for choices that sound the same."""
        choices = self.choices or {}
        if choices and self.default is not None and self.default not in choices:
            yield ("default",), f"'{self.default}' is none of the choices", f"they are {listing(choices)}"
        alike = {choice.lower(): choice for choice in reversed(choices)}
        for wrong in (choice for choice in choices if alike[choice.lower()] != choice):
            what = f"the choices '{alike[wrong.lower()]}' and '{wrong}' are the same to one who answers"
            yield ("choices", wrong), what, "give them different names"
        yield from unreadable(("ask",), lambda: self.text)
        yield from super().faults


_BLOCKS: Final[Mapping[str, type[Step]]] = MappingProxyType(
    {
        each.key: each
        for each in (Choose, Repeat, Try, Together, Wait, Check, Dock, OpenDoor, Picture, Group, Speak, Ask, Set)
    }
)
BLOCKS: Final = tuple(_BLOCKS)
FORMS: Final = f"'say', some of 'take', 'to', 'do' and 'object', 'skill', 'use', or one of {listing(BLOCKS, last='or')}"
_KEYS: Final[Mapping[str, type[Step]]] = MappingProxyType(
    {"say": Say, "skill": CallSkill, "use": UseMission, **_BLOCKS, **dict.fromkeys(COMMAND_KEYS, Do)}
)


def _refused(keys: Sequence[str]) -> str:
    if not keys:
        return f"the step is empty: give it {FORMS}"
    return f"a step has either '{keys[0]}' or {listing(keys[1:])}, not both"


STEP_KEYS: Final = frozenset(_KEYS)
"""Keys that select what a step is; a task of such a word has no short form."""
_FORMS: Final = Forms(_KEYS, _refused)


def _read(data: Any) -> Any:
    """Reads a step from a file; accepts `dock` without a value, and keeps the steps of a `for_each` as data."""
    if data == "dock" or (isinstance(data, Mapping) and "dock" in data and data["dock"] is None):
        data = {**({} if data == "dock" else data), "dock": {}}
    if isinstance(data, ForEach):
        return data
    if isinstance(data, Mapping):
        data = _as_command(data)
    if isinstance(data, Mapping) and isinstance(data.get("repeat"), Mapping) and "for_each" in data["repeat"]:
        return Forms({**_KEYS, "repeat": ForEach}, _refused).read(data)
    return _FORMS.read(data)


_PLAIN_KINDS: Final = (Part.TIME, Part.NUMBER, Part.TEXT)
_PARTS: Final = MappingProxyType({"task": "do", "item": "take", "goal": "to", "object": "object"})
"""Parts of a command as a task names them, with the keys of a step."""


def _as_command(data: Mapping[Any, Any]) -> Mapping[Any, Any]:
    """Writes both forms of a task, `do: {task: vacuum, goal: kitchen}` and `vacuum: kitchen`, as parts of a command."""
    words = [key for key in data if key not in _KEYS and is_task(key)]
    said = {key: value for key, value in data.items() if key not in words and key != "do"}
    if len(words) + ("do" in data) > 1:
        raise ValueError(_refused([*words, *(["do"] if "do" in data else [])]))
    if words:
        (word,) = words
        task, given = task_named(word), data[word]
        main, kind = _main_part(task)
        fitting = None if kind is Part.NOTHING else str | int | float if kind in _PLAIN_KINDS else str
        if isinstance(given, bool) or not isinstance(given, Mapping | None | fitting):
            how = "leave its value out" if kind is Part.NOTHING else "write it as a text, in quotes"
            raise QuantityError(f"'{word}' takes {'no value' if kind is Part.NOTHING else f'a {kind.value}'}", how)
        parts = {"task": word, **(given if isinstance(given, Mapping) else {main: given})}
    elif isinstance(data.get("do"), Mapping) and "task" in data["do"]:
        parts = dict(data["do"])
    else:
        return data
    named = {_PARTS.get(key, key): value for key, value in parts.items() if value is not None}
    if twice := [key for key in said if key in named]:
        raise QuantityError(f"'{twice[0]}' of '{named['do']}' is said twice", "say it once")
    return {**named, **said}


def add_tasks(do: dict[str, Any]) -> None:
    """Adds both forms of each installed task to the JSON schema of a command, `Do`."""
    keys, short = do["properties"], [task for task in installed_tasks().values() if task.word not in _KEYS]
    own = {key: {"$ref": f"#/$defs/Do/properties/{key}"} for key in COMMAND_KEYS}
    parts = {part: own[key] for part, key in _PARTS.items() if part != "task"}
    word = {"type": "string", "anyOf": [{"enum": [*installed_tasks()]}, {"pattern": r"^\$\{"}]}
    form = {"type": "object", "properties": parts, "additionalProperties": False}
    whole = {**form, "properties": {"task": word, **parts}, "required": ["task"]}
    keys["do"] = {**keys["do"], "anyOf": [word, whole, {"type": "null"}]}
    for task in short:
        keys[task.word] = {"anyOf": [own[_main_part(task)[0]], form], "description": type(task).__doc__}
    do["anyOf"] = [{"required": [key]} for key in (*COMMAND_KEYS, *(task.word for task in short))]


def _main_part(task: Task) -> tuple[str, Part]:
    """Key and kind of the part that the short form of a task holds: its object, or its goal without an object."""
    return ("to", task.goal_is) if task.object_is is Part.NOTHING else ("object", task.object_is)


if not TYPE_CHECKING:
    _AnyStep = Union[(*dict.fromkeys(_KEYS.values()), Literal["dock"])]


class _Document(Strict):
    """Document that contains only steps."""

    steps: Steps


def steps_to_data(steps: Iterable[Step]) -> list[Any]:
    """Converts steps to the plain data of a mission file, without default values."""
    return [_short(step.model_dump(mode="json", by_alias=True, exclude_defaults=True)) for step in steps]


def steps_to_yaml(steps: Iterable[Step]) -> tuple[str, ...]:
    """Converts steps to the lines of a mission file's `steps`; no lines for no steps."""
    data = steps_to_data(steps)
    return tuple(yaml_of(data, width=1_000_000).splitlines()) if data else ()


def lines_of_steps(steps: Sequence[Step]) -> tuple[str, ...]:
    """Lines that `steps_from_lines` reads: text forms if all steps are commands, otherwise YAML.

    Steps from a mission file are given by their commands alone.
    """
    walked = [step for one in steps for step in one.walk()]
    if all(isinstance(step, Do) for step in walked) or any(step.source is not None for step in walked):
        return tuple(str(command) for step in walked for command in step.commands)
    return steps_to_yaml(steps)


def steps_from_lines(lines: Sequence[str]) -> Steps:
    """Parses commands in their text form, or steps in YAML. Raises ValueError for other lines."""
    try:
        return steps_of_commands(tuple(map(parse_command, lines)))
    except ValueError:
        return steps_from_yaml(lines)


def steps_from_yaml(lines: Sequence[str]) -> Steps:
    """Parses steps in YAML. Raises ValueError for other lines."""
    try:
        data = parse_yaml("\n".join(lines), Path("steps")).data
    except InputError as error:
        raise ValueError(error.message) from error
    return _Document.model_validate({"steps": data}, by_alias=True, by_name=False).steps


def _short(value: Any) -> Any:
    """Shortens data: drops empty keys, writes a condition as its expression, and whole seconds without a point."""
    if isinstance(value, list):
        return [_short(each) for each in value]
    if isinstance(value, float) and value.is_integer():
        return int(value)
    if not isinstance(value, dict):
        return value
    if value.keys() == {"expression"}:
        return value["expression"]
    short = {key: _short(each) for key, each in value.items() if each is not None and each != []}
    if "choices" in value:
        short["choices"] = {name: _short(steps) or None for name, steps in value["choices"].items()}
    return short
