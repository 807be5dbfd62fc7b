"""A mission, as a file writes it: what one robot does in one world, or each of several does."""

from __future__ import annotations

import enum
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Annotated, Any, Final, Literal, Self

from pydantic import BeforeValidator, ConfigDict, Field, PrivateAttr, StrictBool, field_validator, model_validator

from executive.words.command import Command
from executive.words.forms import Strict
from executive.words.knowledge import Corner
from executive.words.policy import OnFailure, OperatorQuestion, Policy
from executive.words.robot_config import RobotsFile
from executive.words.step import Given, Placed, Scalar, Step
from executive.words.steps import Branch, Handler, Steps, While
from skills.files.errors import SourceLine
from skills.files.schema import Name, Text
from skills.files.yaml_source import YamlSource
from skills.quantities import Delay, Speed

DEFAULT_WORLD: Final = "flat"


class QuestionPolicy(enum.Enum):
    """What becomes of a sentence that could mean several things."""

    ASK = "ask"  # somebody is asked where somebody is there; else the sentence is refused
    FIRST = "first"  # the likeliest meaning is taken
    REFUSE = "refuse"  # the sentence is refused


class Stop(Strict):
    """A waypoint at which the person stands for a while."""

    at: Corner | Name = Field(description="A point (x, y) in metres, or a place by its name.")
    pause: Delay = Field(default=0.0, description="How long the person stands there, in seconds.")


class Route(Strict):
    """A route on which a person walks, around walls and furniture."""

    waypoints: Annotated[tuple[Corner | Name | Stop, ...], Field(min_length=1)] = Field(
        description="Points (x, y) in metres or names of places, in order; the person begins at the first."
    )
    speed: Speed = Field(default=1.2, description="How fast the person walks, in m/s.")
    loop: StrictBool = Field(
        default=False, description="Whether the first waypoint follows the last; by default, once."
    )
    start: Delay = Field(default=0.0, description="When the person sets off, in seconds from the beginning.")
    yields: StrictBool = Field(default=True, description="Whether the person stops for a robot that is close ahead.")


class LooseObject(Strict):
    """An object that lies there at the beginning."""

    model: Name = Field(description="A class of objects, or the name of an imported model.")
    surfaces: Annotated[tuple[Name, ...], Field(min_length=1)] = Field(
        description="Surfaces on which it may lie; the seed chooses one."
    )


class Parameter(Strict):
    """A parameter of a mission file."""

    type: Literal["text", "number", "truth", "place", "object", "person"] | None = Field(
        default=None, description="What it is; a place, object or person is checked against the world."
    )
    default: Scalar = Field(default=None, description="Its value where none is given.")
    choices: tuple[Scalar, ...] | None = Field(default=None, description="The values that it may have.")
    description: Text | None = Field(default=None, description="What it is for.")


def _short_parameter(value: object) -> object:
    """A parameter may be declared by its default alone."""
    return value if isinstance(value, dict | Parameter) else {"default": value}


if TYPE_CHECKING:
    _Parameters = dict[str, Parameter]
else:
    _Parameters = dict[
        str, Annotated[Parameter, BeforeValidator(_short_parameter, json_schema_input_type=Parameter | Scalar)]
    ]


class _Whole(Placed):
    """The policy of a mission, or of a robot's part of it."""

    @field_validator("on_failure")
    @classmethod
    def _cannot_skip_itself(cls, on_failure: OnFailure | None) -> OnFailure | None:
        if on_failure is OnFailure.SKIP:
            raise ValueError("a whole mission cannot be skipped; set 'on_failure: skip' under 'each' or on a step")
        return on_failure

    @field_validator("question")
    @classmethod
    def _cannot_skip_when_asked(cls, question: OperatorQuestion | None) -> OperatorQuestion | None:
        if question is not None and question.default == "skip":
            raise ValueError("a whole mission cannot be skipped; set 'default' to stop")
        return question


class MissionPart(_Whole):
    """What one of several robots does. Its policy, `always`, `while` and `when` replace those at the file's top."""

    after: Name | Annotated[tuple[Name, ...], Field(min_length=1)] | None = Field(
        default=None, description="The robot, or the robots, whose parts must be done before this one begins."
    )
    steps: Annotated[Steps, Field(description="What it does, one after the other.")]
    always: Annotated[
        Branch,
        Field(description="Steps at the end of the part, whatever happened, also when the mission is cancelled."),
    ] = ()
    while_: Annotated[While | None, Field(alias="while", description="What must hold while the part runs.")] = None
    when: tuple[Handler, ...] | None = Field(
        default=None, description="What interrupts the part, the most important first."
    )

    @property
    def first(self) -> tuple[str, ...]:
        """The robots whose parts must be done before."""
        return (self.after,) if isinstance(self.after, str) else self.after or ()


class Mission(_Whole):
    """A mission in one world, for one robot or with a part for each of several. The policy keys at the top are for
    the whole of it, or for each part."""

    model_config = ConfigDict(title="Errand mission")

    name: Name = Field(description="The mission's name; part of all path ids.")
    description: str | None = Field(default=None, description="What it is for.")
    world: Name = Field(default=DEFAULT_WORLD, description="A world by its name or folder.")
    robot: Name | None = Field(
        default=None,
        description="The robot's name; by default that of the world, or of several robots the one that is done first.",
    )
    robots: RobotsFile | None = Field(
        default=None, description="The robots by name, each as its kind alone or with more; `--robots` replaces them."
    )
    knowledge: dict[str, Any] | None = Field(
        default=None,
        description="Laid over the world's knowledge: what stands here replaces what stands there, key by key.",
    )
    people: dict[Name, Route] | None = Field(
        default=None, description="People who walk while the mission runs, by name: new ones, or those of the world."
    )
    imports: tuple[Name, ...] | None = Field(
        default=None, description="Folders of `errand object import`, as seen from this file's folder."
    )
    objects: dict[Name, LooseObject] | None = Field(
        default=None, description="Objects that lie there at the beginning besides those of the world, by name."
    )
    parameters: _Parameters | None = Field(
        default=None,
        description="Parameters with their defaults, or {type: .., default: ..}, read as ${name} in values; one "
        "without a default must be given.",
    )
    questions: QuestionPolicy | None = Field(
        default=None,
        description="What becomes of a sentence that could mean several things. ask: who starts the mission is asked. "
        "first: the likeliest is taken. refuse (the default): the file is refused.",
    )
    each: Policy | None = Field(default=None, description="The policy of every step that does not say otherwise.")
    variables: dict[Name, Given] | None = Field(
        default=None,
        description="Values by name, as they are at the beginning; steps change them with `set` and `gives`.",
    )
    steps: Annotated[Branch, Field(description="What to do, one after the other. Left out where there are `parts`.")]
    parts: Annotated[dict[Name, MissionPart], Field(min_length=1)] | None = Field(
        default=None, description="What each robot does, by its name, all at the same time."
    )
    always: Annotated[
        Branch, Field(description="Steps at the end, whatever happened, also when the mission is cancelled.")
    ] = ()
    while_: Annotated[While | None, Field(alias="while", description="What must hold while the mission runs.")] = None
    when: tuple[Handler, ...] | None = Field(
        default=None, description="What interrupts the mission, the most important first."
    )
    _notes: tuple[str, ...] = PrivateAttr(default=())

    @model_validator(mode="before")
    @classmethod
    def _steps_or_parts(cls, data: Any) -> Any:
        """`parts` stand in the place of `steps`."""
        if not isinstance(data, dict) or not data.keys() & {"steps", "parts"}:
            return data
        if (data.get("steps") is None) == (data.get("parts") is None):
            raise ValueError("a mission has either 'steps', or 'parts' for several robots")
        return {"steps": None, **data}

    @classmethod
    def of_steps(cls, steps: Sequence[Step], *, world: str, robot: str) -> Self:
        """A mission without a file, named for its first command, or else for its first block."""
        first = next((command for step in steps for each in step.walk() for command in each.commands), None)
        if first is None:
            name = type(steps[0]).__name__.lower() if steps else "do"
        else:
            name = " ".join(filter(None, (first.verb or "do", str(first.object or first.item or first.goal or ""))))
        return cls(name=name, world=world, robot=robot or None, steps=tuple(steps))

    @property
    def document(self) -> YamlSource | None:
        """The file's data and lines; None when it was not read from a file."""
        return None if self._place is None else self._place.document

    @property
    def notes(self) -> tuple[str, ...]:
        """Which name in a sentence was taken for which."""
        return self._notes

    @property
    def robot_name(self) -> str:
        """The robot's name; empty where nobody has named it."""
        return self.robot or ""

    @property
    def source(self) -> SourceLine | None:
        """The line of its name; None when it was spoken."""
        return None if self._place is None else self._place.line(("name",))

    @property
    def commands(self) -> tuple[Command, ...]:
        """The commands of all steps, those of used missions included, in order."""
        return tuple(command for step in self.walk() for command in step.commands)

    @property
    def framing_steps(self) -> tuple[Step, ...]:
        """The steps that interrupt its own, and those that are done in the end."""
        return (*(step for each in self.when or () for step in each.steps), *self.always)

    @property
    def is_framed(self) -> bool:
        """Returns whether something is watched while its steps run, or done in the end."""
        return bool(self.always) or self.while_ is not None or self.when is not None

    def walk(self) -> Iterator[Step]:
        """All steps in order; a step that holds others comes before them."""
        for step in (*self.steps, *self.framing_steps):
            yield from step.walk()

    def with_notes(self, notes: tuple[str, ...]) -> Self:
        """The same mission with such notes."""
        copy = self.model_copy()
        copy._notes = notes
        return copy
