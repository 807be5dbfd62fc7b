"""The schema of mission files: one pydantic model, which is also the JSON Schema for editors."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping
from types import MappingProxyType
from typing import Annotated, Any, Final, Literal, get_type_hints

from pydantic import BaseModel, ConfigDict, Field, PrivateAttr, StrictBool, StrictInt, field_validator, model_validator

from executive.language.questions import QuestionPolicy
from executive.mission.command import Task
from executive.mission.errors import InputError, listing
from executive.mission.file.model import (
    DEFAULT_WORLD,
    KeyPath,
    OnFailure,
    OperatorQuestion,
    SourceLine,
    StaleData,
    StepGuards,
    StepPolicy,
)
from executive.mission.file.objects import ObjectFile
from executive.mission.file.people import RouteFile
from executive.mission.yaml_source import Name, Text, YamlSource
from skills.quantities import Duration, bounds, without_range, without_unit

__all__ = ["AskFile", "GuardsFile", "MissionFile", "PolicyFile", "StepFile", "mission_json_schema"]

Seconds = Annotated[Duration, Field(strict=True)]
Share = Annotated[float, Field(ge=0.0, le=1.0, strict=True)]
Attempts = Annotated[StrictInt, Field(ge=0, le=100)]
Objects = Annotated[StrictInt, Field(ge=0, le=10)]
Scalar = str | StrictBool | StrictInt | Annotated[float, Field(strict=True)] | None
COMMAND_KEYS: Final = ("take", "to", "do", "object")
FORMS: Final = "'say', some of 'take', 'to', 'do' and 'object', 'skill', or 'use'"
ONCE: Final = 1
_NO_SKILLS: Final[Mapping[str, type]] = MappingProxyType({})


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, populate_by_name=False)


class GuardsFile(_Strict):
    """What must hold while it runs; when it does not, the step fails."""

    battery: Share | None = Field(None, description="The least charge of the battery, from 0 to 1.")
    localised: StrictBool | None = Field(None, description="Whether the robot must know where it is.")
    time: Seconds | None = Field(
        None, description="The most seconds on the robot's clock since the run began; later than that it fails."
    )
    stale: StaleData | None = Field(
        None,
        description="What an old reading means. wait: stand still for a new one. fail: the guard does not hold. "
        "accept: judge by the old one.",
    )


class AskFile(_Strict):
    """The question to the operator for `on_failure: ask`."""

    text: Text | None = Field(None, description="The question; by default it tells what failed and why.")
    limit: Seconds = Field(60.0, description="Seconds on the robot's clock to wait for an answer.")
    default: Literal["skip", "stop"] = Field("stop", description="The answer when nobody answers in time.")


class PolicyFile(_Strict):
    """How something runs."""

    timeout: Seconds | None = Field(None, description="Seconds on the robot's clock for each attempt.")
    retries: Attempts | None = Field(None, description="How many more attempts after a failure.")
    on_failure: OnFailure | None = Field(
        None,
        description="What to do when it failed and no retries are left. retry: once more (or as often as `retries` "
        "says), then stop. skip: note it and go on. ask: ask the operator. return: go back to where the robot started, "
        "then stop. stop: the mission fails.",
    )
    ask: AskFile | None = Field(None, description="The question for `on_failure: ask`.")
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
        if self.ask is not None and self.on_failure is not OnFailure.ASK:
            raise ValueError("'ask' is the question of 'on_failure: ask', which does not stand beside it")
        return self

    def over(self, below: PolicyFile | None) -> StepPolicy:
        """This policy, with what it leaves open taken from `below`."""
        on_failure = self._own_or(below, "on_failure") or OnFailure.STOP
        retries = self._own_or(below, "retries")
        ask: AskFile | None = self._own_or(below, "ask")
        guards: GuardsFile | None = self._own_or(below, "guards")
        return StepPolicy(
            timeout_s=self._own_or(below, "timeout"),
            retries=(ONCE if on_failure is OnFailure.RETRY else 0) if retries is None else retries,
            on_failure=on_failure,
            question=OperatorQuestion() if ask is None else OperatorQuestion(ask.text, ask.limit, ask.default),
            guards=StepGuards()
            if guards is None
            else StepGuards(guards.battery, bool(guards.localised), guards.time, guards.stale),
            pick_ups=self._own_or(below, "pick_ups"),
            move_aside=self._own_or(below, "move_aside"),
        )

    def _own_or(self, below: PolicyFile | None, key: str) -> Any:
        own = getattr(self, key)
        return getattr(below, key, None) if own is None else own


class StepFile(PolicyFile):
    """A step: a sentence, the parts of a command, a skill with its ports, or another mission file."""

    say: Text | None = Field(None, description="What to do, in English.")
    take: Text | None = Field(None, description="What is carried; a number may stand before it.")
    to: Text | None = Field(None, description='The place or person, or "start", or "Robin at hall".')
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
        None, description="Names for the skill's output ports; later steps read them with {from: NAME}."
    )

    @model_validator(mode="after")
    def _one_form(self) -> StepFile:
        parts = [name for name in COMMAND_KEYS if getattr(self, name) is not None]
        forms = [key for key in ("say", "skill", "use") if getattr(self, key) is not None]
        if len(forms) > 1 or (forms and parts):
            raise ValueError(f"a step has either '{forms[0]}' or {listing([*forms[1:], *parts])}, not both")
        if not forms and not parts:
            raise ValueError(f"the step is empty: give it {FORMS}")
        if self.do is not Task.CHARGE and (self.do is None) != (self.object is None):
            raise ValueError("'do' and 'object' go together")
        if self.with_ is not None and self.skill is None and self.use is None:
            raise ValueError("'with' goes with 'skill' or 'use'")
        if self.elsewhere is not None and (self.skill is not None or self.use is not None):
            raise ValueError("'elsewhere' goes with a sentence or a command")
        if self.gives is not None and self.skill is None:
            raise ValueError("'gives' goes with 'skill'")
        return self


class MissionFile(PolicyFile):
    """A mission for one robot in one world. The policy keys at the top are for the whole of it."""

    model_config = ConfigDict(title="Errand mission")

    name: Name = Field(description="The mission's name; part of all path ids.")
    description: str | None = Field(None, description="What it is for.")
    world: Name = Field(DEFAULT_WORLD, description="A world by its name or folder.")
    robot: Name | None = Field(None, description="The robot's name; by default that of the world.")
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
    parameters: dict[str, Scalar] | None = Field(
        None,
        description="Parameters with their defaults, read as ${name} in values; one without a default must be given.",
    )
    questions: QuestionPolicy | None = Field(
        None,
        description="What becomes of a sentence that could mean several things. ask: who starts the mission is asked. "
        "first: the likeliest is taken. refuse (the default): the file is refused.",
    )
    each: PolicyFile | None = Field(None, description="The policy of every step that does not say otherwise.")
    steps: Annotated[tuple[StepFile, ...], Field(min_length=1)] = Field(description="What to do, one after the other.")
    _source: YamlSource | None = PrivateAttr(default=None)

    @field_validator("on_failure")
    @classmethod
    def _cannot_skip_itself(cls, on_failure: OnFailure | None) -> OnFailure | None:
        if on_failure is OnFailure.SKIP:
            raise ValueError("a whole mission cannot be skipped; set 'on_failure: skip' under 'each' or on a step")
        return on_failure

    @field_validator("ask")
    @classmethod
    def _cannot_skip_when_asked(cls, ask: AskFile | None) -> AskFile | None:
        if ask is not None and ask.default == "skip":
            raise ValueError("a whole mission cannot be skipped; set 'default' to stop")
        return ask

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
    step["anyOf"] = [{"required": [key]} for key in ("say", *COMMAND_KEYS, "skill", "use")]
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
