"""The schema of mission files: one pydantic model, which is also the JSON Schema for editors."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping
from types import MappingProxyType
from typing import Annotated, Any, Final, Literal, get_type_hints

from pydantic import (
    BeforeValidator,
    ConfigDict,
    Field,
    PrivateAttr,
    StrictBool,
    field_validator,
    model_validator,
)

from executive.language.questions import QuestionPolicy
from executive.mission.file.condition_schema import (
    Condition,
    DockFile,
    RepeatFile,
    Strict,
    WaitFile,
    WhileFile,
)
from executive.mission.file.objects import ObjectFile
from executive.mission.file.people import RouteFile
from executive.words.command import Task
from executive.words.robots import RobotsFile
from executive.words.steps import (
    DEFAULT_WORLD,
    KeyPath,
    OnFailure,
    OperatorQuestion,
    SourceLine,
    StaleData,
    StepGuards,
    StepPolicy,
)
from skills.files.errors import InputError, listing
from skills.files.schema import Name, Text
from skills.files.yaml_source import YamlSource
from skills.quantities import (
    Count,
    Duration,
    Number,
    Quantity,
    QuantityError,
    Share,
    Whole,
    bounds,
    without_range,
    without_unit,
)

__all__ = [
    "GuardsFile",
    "HandlerFile",
    "MissionFile",
    "PartFile",
    "PolicyFile",
    "QuestionFile",
    "RoundFile",
    "StepFile",
    "mission_json_schema",
]


def _choices(data: Any) -> Any:
    """Choices may be a list of their names. Raises ValueError: one is true or false."""
    names = list(data) if isinstance(data, list | dict) else []
    if any(isinstance(name, bool) for name in names):
        raise ValueError("yes, no, on and off mean true and false in YAML: put them in quotes")
    return dict.fromkeys(names) if isinstance(data, list) and all(isinstance(c, str) for c in names) else data


Steps = Annotated[tuple["StepFile", ...], Field(min_length=1)]
Choices = Annotated[
    dict[Name, "Steps | None"],
    Field(min_length=1),
    BeforeValidator(
        _choices,
        json_schema_input_type=dict[Name, "Steps | None"] | tuple[Name, ...],
    ),
]
Attempts = Annotated[int, Quantity(ge=0, le=100)]
Objects = Annotated[int, Quantity(ge=0, le=10)]
Given = str | StrictBool | Whole | Number
Scalar = Given | None
COMMAND_KEYS: Final = ("take", "to", "do", "object")
BLOCKS: Final = ("if", "repeat", "try", "together", "wait", "check", "dock", "group", "speak", "ask", "set")
FORMS: Final = f"'say', some of 'take', 'to', 'do' and 'object', 'skill', 'use', or one of {listing(BLOCKS, last='or')}"
ONCE: Final = 1
_NO_SKILLS: Final[Mapping[str, type]] = MappingProxyType({})
_BESIDE: Final[Mapping[str, tuple[str, ...]]] = MappingProxyType(
    {
        "with": ("skill", "use"),
        "elsewhere": ("say", "take", "to", "do", "object"),
        "gives": ("skill", "ask", "check", "say", "do"),
        "then": ("if",),
        "else": ("if", "try"),
        "steps": ("repeat",),
        "done_when": ("together",),
        "name": ("group",),
        "always": ("group",),
        "while": ("group",),
        "when": ("group",),
        "choices": ("ask",),
        "match": ("ask",),
        "limit": ("ask",),
        "default": ("ask",),
    }
)
"""With which forms of a step a key goes."""
_NEEDED: Final[Mapping[str, str]] = MappingProxyType({"if": "then", "try": "else", "repeat": "steps"})
_FIELDS: Final = MappingProxyType({"with": "with_", "if": "if_", "else": "else_", "try": "try_", "while": "while_"})


def _named_goal(value: object) -> object:
    """A goal is named; a pose belongs to the skill that takes one. Raises QuantityError."""
    if isinstance(value, list | dict):
        hint = "for a pose write 'skill: navigate' with 'with: {x: 1.0, y: 2.0, yaw: 1.57}', in metres and radians"
        raise QuantityError("should be the name of a place or person", hint)
    return value


Goal = Annotated[Text, BeforeValidator(_named_goal)]


class GuardsFile(Strict):
    """What must hold while it runs; when it does not, the step fails."""

    battery: Share | None = Field(None, description="The least charge of the battery, from 0 to 1.")
    localised: StrictBool | None = Field(None, description="Whether the robot must know where it is.")
    time: Duration | None = Field(
        None, description="The most seconds on the robot's clock since the run began; later than that it fails."
    )
    stale: StaleData | None = Field(
        None,
        description="What an old reading means. wait: stand still for a new one. fail: the guard does not hold. "
        "accept: judge by the old one.",
    )


class QuestionFile(Strict):
    """The question to the operator for `on_failure: ask`."""

    text: Text | None = Field(None, description="The question; by default it tells what failed and why.")
    limit: Duration = Field(60.0, description="Seconds on the robot's clock to wait for an answer.")
    default: Literal["skip", "stop"] = Field("stop", description="The answer when nobody answers in time.")


class PolicyFile(Strict):
    """How something runs."""

    timeout: Duration | None = Field(None, description="Seconds on the robot's clock for each attempt.")
    retries: Attempts | None = Field(None, description="How many more attempts after a failure.")
    on_failure: OnFailure | None = Field(
        None,
        description="What to do when it failed and no retries are left. retry: once more (or as often as `retries` "
        "says), then stop. skip: note it and go on. ask: ask the operator. return: go back to where the robot started, "
        "then stop. stop: the mission fails.",
    )
    question: QuestionFile | None = Field(None, description="The question for `on_failure: ask`.")
    guards: GuardsFile | None = Field(None, description="What must hold while it runs.")
    pick_ups: Objects | None = Field(
        None, description="How often an object that falls on the way is picked up again; by default, twice."
    )
    move_aside: Objects | None = Field(
        None,
        description="How many objects that stand in the way of one that is to be taken may be moved aside, on the "
        "surface where they stand; by default, none.",
    )

    @model_validator(mode="after")
    def _asks_where_it_says_so(self) -> PolicyFile:
        if self.question is not None and self.on_failure is not OnFailure.ASK:
            raise ValueError("'question' is that of 'on_failure: ask', which does not stand beside it")
        return self

    def over(self, below: PolicyFile | None) -> StepPolicy:
        """This policy, with what it leaves open taken from `below`."""
        on_failure = self._own_or(below, "on_failure") or OnFailure.STOP
        retries = self._own_or(below, "retries")
        question: QuestionFile | None = self._own_or(below, "question")
        guards: GuardsFile | None = self._own_or(below, "guards")
        return StepPolicy(
            timeout_s=self._own_or(below, "timeout"),
            retries=(ONCE if on_failure is OnFailure.RETRY else 0) if retries is None else retries,
            on_failure=on_failure,
            question=OperatorQuestion()
            if question is None
            else OperatorQuestion(question.text, question.limit, question.default),
            guards=StepGuards()
            if guards is None
            else StepGuards(guards.battery, bool(guards.localised), guards.time, guards.stale),
            pick_ups=self._own_or(below, "pick_ups"),
            move_aside=self._own_or(below, "move_aside"),
        )

    def _own_or(self, below: PolicyFile | None, key: str) -> Any:
        own = getattr(self, key)
        return getattr(below, key, None) if own is None else own


def is_for_each(step: Mapping[str, Any]) -> bool:
    """Whether the data of a step make a round for each of several values."""
    repeat = step.get("repeat")
    return isinstance(repeat, Mapping) and "for_each" in repeat


class StepFile(PolicyFile):
    """A step: a sentence, the parts of a command, a skill with its ports, another mission file, or a block of steps."""

    say: Text | None = Field(None, description="What to do, in English.")
    take: Text | None = Field(None, description="What is carried; a number may stand before it.")
    to: Goal | None = Field(None, description='The place or person, or "start", or "Robin at hall".')
    do: Task | None = Field(None, description="What to do there to the object.")
    object: Text | None = Field(None, description="The object of the task, or who is looked for.")
    skill: Name | None = Field(None, description="The name of a registered skill.")
    use: Name | None = Field(None, description="Another mission file, as seen from this file's folder.")
    elsewhere: StrictBool | None = Field(
        None, description="Whether an object that is not in its place is also searched for elsewhere; by default, yes."
    )
    with_: dict[str, Any] | None = Field(
        None, alias="with", description="The skill's input ports, or the parameters of the used file."
    )
    gives: dict[str, Name] | None = Field(
        None,
        description="Names for the skill's output ports, or for the answer; later steps read them with {from: NAME} "
        "and in expressions.",
    )
    if_: Condition | None = Field(None, alias="if", description="A condition that decides between `then` and `else`.")
    then: Steps | None = Field(None, description="The steps when the condition of `if` holds.")
    else_: Steps | None = Field(
        None, alias="else", description="The steps when the condition of `if` does not hold, or when `try` failed."
    )
    repeat: RepeatFile | None = Field(None, description="How often, and until when, `steps` are repeated.")
    steps: Steps | None = Field(None, description="The steps that `repeat` repeats.")
    try_: Steps | None = Field(None, alias="try", description="Steps; as soon as one fails, those of `else` are done.")
    together: Annotated[tuple[StepFile, ...], Field(min_length=2)] | None = Field(
        None, description="Steps that run side by side: those that move different parts of the robot, or none."
    )
    done_when: Literal["all", "any"] | Count | None = Field(
        None, description="How many steps of `together` must be done: all of them unless said."
    )
    wait: WaitFile | None = Field(None, description="Wait for a condition, some time, or until a time of day.")
    check: Condition | None = Field(None, description="Answer whether a condition holds, as part of the result.")
    dock: DockFile | None = Field(None, description="Go to the dock and charge.")
    group: Steps | None = Field(None, description="Steps in a row that share a policy.")
    name: Name | None = Field(None, description="What the group is called.")
    always: Steps | None = Field(
        None, description="Steps at the end of the group, whatever happened, also when the mission is cancelled."
    )
    while_: WhileFile | None = Field(None, alias="while", description="What must hold while the group runs.")
    when: tuple[HandlerFile, ...] | None = Field(
        None, description="What interrupts the group, the most important first."
    )
    speak: Text | None = Field(None, description="What to say to the people around; {NAME} puts in a value.")
    ask: Text | None = Field(None, description="A question to the people around, or to the operator.")
    choices: Choices | None = Field(
        None, description="The answers to choose from, perhaps with the steps that each leads to."
    )
    match: Literal["place", "person", "object", "number", "text"] | None = Field(
        None, description="What the answer is, where there are no choices."
    )
    limit: Duration = Field(60.0, description="How long to wait for an answer (robot's clock).")
    default: Scalar = Field(None, description="The answer when nobody answers in time; without one the step fails.")
    set: dict[Name, Scalar] | None = Field(None, description="Values by name: numbers, truths or expressions.")

    @model_validator(mode="before")
    @classmethod
    def _short_forms(cls, data: Any) -> Any:
        """`dock` may stand alone; the steps of a `for_each` are read once for each value, by the resolver."""
        if data == "dock":
            return {"dock": {}}
        if not isinstance(data, dict):
            return data
        if data.get("dock") is None and "dock" in data:
            data = {**data, "dock": {}}
        if is_for_each(data) and "steps" in data:
            data = {key: value for key, value in data.items() if key != "steps"}
        return data

    @model_validator(mode="after")
    def _one_form(self) -> StepFile:
        parts = [name for name in COMMAND_KEYS if self._has(name)]
        forms = [key for key in ("say", "skill", "use", *BLOCKS) if self._has(key)]
        if len(forms) > 1 or (forms and parts):
            raise ValueError(f"a step has either '{forms[0]}' or {listing([*forms[1:], *parts])}, not both")
        if not forms and not parts:
            raise ValueError(f"the step is empty: give it {FORMS}")
        if self.do is not Task.CHARGE and (self.do is None) != (self.object is None):
            raise ValueError("'do' and 'object' go together")
        for key, with_one_of in _BESIDE.items():
            if self._has(key) and not {*forms, *parts} & set(with_one_of):
                raise ValueError(f"'{key}' goes with {listing(map(repr, with_one_of), last='or')}")
        needed = _NEEDED.get(forms[0]) if forms else None
        if needed is not None and not self._has(needed) and not (self.repeat and self.repeat.for_each is not None):
            raise ValueError(f"'{forms[0]}' needs '{needed}' beside it")
        if self.choices is not None and self.match is not None:
            raise ValueError("an answer is one of 'choices' or what 'match' says, not both")
        return self

    def _has(self, key: str) -> bool:
        """Whether the file gives this key."""
        return _FIELDS.get(key, key) in self.model_fields_set and getattr(self, _FIELDS.get(key, key)) is not None


class HandlerFile(Strict):
    """What interrupts a group or a mission."""

    if_: Condition = Field(alias="if", description="When this begins to hold, the steps are interrupted.")
    do: Steps = Field(description="What is done then; afterwards the steps go on.")
    times: Count = Field(10, description="How often at most; once more is a failure.")


class RoundFile(Strict):
    """The steps of one round of a `for_each`."""

    steps: Steps


class ParameterFile(Strict):
    """A parameter of a mission file."""

    type: Literal["text", "number", "truth", "place", "object", "person"] | None = Field(
        None, description="What it is; a place, object or person is checked against the world."
    )
    default: Scalar = Field(None, description="Its value where none is given.")
    choices: tuple[Scalar, ...] | None = Field(None, description="The values that it may have.")
    description: Text | None = Field(None, description="What it is for.")


def _short_parameter(value: object) -> object:
    """A parameter may be declared by its default alone."""
    return value if isinstance(value, dict) else {"default": value}


Parameter = Annotated[ParameterFile, BeforeValidator(_short_parameter, json_schema_input_type=ParameterFile | Scalar)]


class PartFile(PolicyFile):
    """What one of several robots does. Its policy, `always`, `while` and `when` replace those at the file's top."""

    after: Name | Annotated[tuple[Name, ...], Field(min_length=1)] | None = Field(
        None, description="The robot, or the robots, whose parts must be done before this one begins."
    )
    steps: Steps = Field(description="What it does, one after the other.")
    always: Steps | None = Field(
        None, description="Steps at the end of the part, whatever happened, also when the mission is cancelled."
    )
    while_: WhileFile | None = Field(None, alias="while", description="What must hold while the part runs.")
    when: tuple[HandlerFile, ...] | None = Field(
        None, description="What interrupts the part, the most important first."
    )

    @property
    def first(self) -> tuple[str, ...]:
        """The robots whose parts must be done before."""
        return (self.after,) if isinstance(self.after, str) else self.after or ()


class MissionFile(PolicyFile):
    """A mission in one world, for one robot or with a part for each of several. The policy keys at the top are for
    the whole of it, or for each part."""

    model_config = ConfigDict(title="Errand mission")

    name: Name = Field(description="The mission's name; part of all path ids.")
    description: str | None = Field(None, description="What it is for.")
    world: Name = Field(DEFAULT_WORLD, description="A world by its name or folder.")
    robot: Name | None = Field(
        None,
        description="The robot's name; by default that of the world, or of several robots the one that is done first.",
    )
    robots: RobotsFile | None = Field(
        None, description="The robots by name, each as its kind alone or with more; `--robots` replaces them."
    )
    knowledge: dict[str, Any] | None = Field(
        None, description="Laid over the world's knowledge: what stands here replaces what stands there, key by key."
    )
    people: dict[Name, RouteFile] | None = Field(
        None, description="People who walk while the mission runs, by name: new ones, or those of the world."
    )
    imports: tuple[Name, ...] | None = Field(
        None, description="Folders of `errand object import`, as seen from this file's folder."
    )
    objects: dict[Name, ObjectFile] | None = Field(
        None, description="Objects that lie there at the beginning besides those of the world, by name."
    )
    parameters: dict[str, Parameter] | None = Field(
        None,
        description="Parameters with their defaults, or {type: .., default: ..}, read as ${name} in values; one "
        "without a default must be given.",
    )
    questions: QuestionPolicy | None = Field(
        None,
        description="What becomes of a sentence that could mean several things. ask: who starts the mission is asked. "
        "first: the likeliest is taken. refuse (the default): the file is refused.",
    )
    each: PolicyFile | None = Field(None, description="The policy of every step that does not say otherwise.")
    variables: dict[Name, Given] | None = Field(
        None, description="Values by name, as they are at the beginning; steps change them with `set` and `gives`."
    )
    steps: Steps | None = Field(description="What to do, one after the other. Left out where there are `parts`.")
    parts: Annotated[dict[Name, PartFile], Field(min_length=1)] | None = Field(
        None, description="What each robot does, by its name, all at the same time."
    )
    always: Steps | None = Field(
        None, description="Steps at the end, whatever happened, also when the mission is cancelled."
    )
    while_: WhileFile | None = Field(None, alias="while", description="What must hold while the mission runs.")
    when: tuple[HandlerFile, ...] | None = Field(
        None, description="What interrupts the mission, the most important first."
    )
    _source: YamlSource | None = PrivateAttr(default=None)

    @model_validator(mode="before")
    @classmethod
    def _parts_are_steps(cls, data: Any) -> Any:
        """`parts` stand in the place of `steps`."""
        return {"steps": None, **data} if isinstance(data, dict) and "parts" in data else data

    @model_validator(mode="after")
    def _steps_or_parts(self) -> MissionFile:
        if (self.steps is None) == (self.parts is None):
            raise ValueError("a mission has either 'steps', or 'parts' for several robots")
        return self

    @field_validator("on_failure")
    @classmethod
    def _cannot_skip_itself(cls, on_failure: OnFailure | None) -> OnFailure | None:
        if on_failure is OnFailure.SKIP:
            raise ValueError("a whole mission cannot be skipped; set 'on_failure: skip' under 'each' or on a step")
        return on_failure

    @field_validator("question")
    @classmethod
    def _cannot_skip_when_asked(cls, question: QuestionFile | None) -> QuestionFile | None:
        if question is not None and question.default == "skip":
            raise ValueError("a whole mission cannot be skipped; set 'default' to stop")
        return question

    @property
    def source(self) -> YamlSource | None:
        """The file's data and lines; None when it was not read from a file."""
        return self._source

    def error(self, path: KeyPath, message: str, hint: str) -> InputError:
        """An error in what stands at `path`, for instance ("world",)."""
        return InputError(message, hint=hint) if self._source is None else self._source.error(path, message, hint)

    def source_line(self, path: KeyPath) -> SourceLine | None:
        """Where `path` stands in the file."""
        return None if self._source is None else SourceLine(self._source.path, self._source.line(path))


StepFile.model_rebuild()
MissionFile.model_rebuild()


def with_source(file: MissionFile, source: YamlSource) -> MissionFile:
    """The same file, which knows where it was read from."""
    file._source = source
    return file


def mission_json_schema(inputs: Mapping[str, type] = _NO_SKILLS) -> dict[str, Any]:
    """The JSON Schema of mission files. What is no text may also be a parameter, "${name}".

    `inputs` are the `Inputs` of skills by name: where a step names one of them, its numbers keep the ports' ranges.
    """
    schema = MissionFile.model_json_schema(by_alias=True)
    described: dict[str, Any] = _open_to_parameters(schema)
    step = described["$defs"]["StepFile"]
    described["required"] = [key for key in described["required"] if key != "steps"]
    described["anyOf"] = [{"required": [key]} for key in ("steps", "parts")]
    step["anyOf"] = [{"required": [key]} for key in ("say", *COMMAND_KEYS, "skill", "use", *BLOCKS)]
    step["allOf"] = [
        {
            "if": {"properties": {"skill": {"const": name}}, "required": ["skill"]},
            "then": {"properties": {"with": {"properties": dict(_ports(record))}}},
        }
        for name, record in inputs.items()
    ]
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **described}


def _ports(record: type) -> Iterator[tuple[str, Any]]:
    """The schemas of a skill's numbers that have a range, by all names that a file may give them.

    A number may also be a parameter, or what an earlier step gave; the fields of a pose may stand by themselves.
    """
    for name, hint in get_type_hints(record, include_extras=True).items():
        limits = {_KEYWORDS[bound]: limit for bound, limit in bounds(hint).items()}
        if limits:
            kind = "integer" if without_range(hint) is int else "number"
            taken = [{"type": kind, **limits}, dict(_PARAMETER), {"type": "object", "required": ["from"]}]
            yield from ((each, {"anyOf": taken}) for each in dict.fromkeys((name, without_unit(name))))
        elif isinstance(hint, type) and dataclasses.is_dataclass(hint):
            yield from _ports(hint)


_REFERENCE: Final = r"^\$\{[A-Za-z_][A-Za-z0-9_]*\}$"
_PARAMETER: Final[Mapping[str, Any]] = MappingProxyType({"type": "string", "pattern": _REFERENCE})
_CLOSED_TYPES: Final = ("number", "integer", "boolean")
_KEYWORDS: Final = {"gt": "exclusiveMinimum", "ge": "minimum", "lt": "exclusiveMaximum", "le": "maximum"}


def _open_to_parameters(node: Any) -> Any:
    """The schema with a parameter allowed wherever a number, a truth value or one of some words is wanted."""
    if isinstance(node, list):
        return [_open_to_parameters(part) for part in node]
    if not isinstance(node, dict):
        return node
    opened = {key: _open_to_parameters(part) for key, part in node.items() if key != "title" or "properties" in node}
    closed = opened.get("type") in _CLOSED_TYPES or "enum" in opened
    if not closed:
        return opened
    outside = {key: opened.pop(key) for key in ("default", "description") if key in opened}
    return {"anyOf": [opened, dict(_PARAMETER)], **outside}
