"""Mission as a file writes it: the steps of one robot, or of each of several robots, in one world."""

from __future__ import annotations

import enum
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Annotated, Any, Final, Literal, Self

from pydantic import BeforeValidator, ConfigDict, Field, PrivateAttr, StrictBool, field_validator, model_validator

from executive.words.command import Command
from executive.words.outlines import Corner
from executive.words.robot_config import RobotsFile
from executive.words.step import Given, OnFailure, OperatorQuestion, Placed, Policy, Scalar, Step
from executive.words.steps import Branch, Group, Handler, Steps, While
from executive.words.zone import ZONES, ZoneFacts, Zones
from skills.inputs.errors import SourceLine
from skills.inputs.schema import Name, Strict, Text
from skills.inputs.yaml_source import YamlSource
from skills.quantities import Delay, Margin, Quantity, Share, Speed

DEFAULT_WORLD: Final = "flat"


class QuestionPolicy(enum.Enum):
    """Policy for an ambiguous sentence."""

    ASK = "ask"  # somebody is asked where somebody is there; else the sentence is refused
    FIRST = "first"  # the likeliest meaning is taken
    REFUSE = "refuse"  # the sentence is refused


Distractions = Annotated[int, Quantity(ge=0, le=10)]
"""Number of distractions that the seed draws."""
Walked = Annotated[float, Quantity(ge=0.0, le=1_000.0, unit="m")]
"""Length of a path that a person has walked."""


class Stop(Strict):
    """Waypoint at which a person stands for a while."""

    at: Corner | Name = Field(description="A point (x, y) in metres, or a place by its name.")
    pause: Delay = Field(default=0.0, description="Time for which the person stands there, in seconds.")


class Distraction(Strict):
    """Lapse in a walking person's attention: the person stops, and may first step back."""

    after: Walked = Field(description="Path that the person has walked by then, in metres.")
    stop: Delay = Field(default=3.0, description="Time for which the person stands, in seconds.")
    back: Margin = Field(default=0.0, description="Path that the person first walks back, in metres.")


ANY_ROBOT: Final = "robot"


class Manner(Strict):
    """Manner in which a person walks."""

    speed: Speed = Field(default=1.2, description="Speed of the person, in m/s.")
    loop: StrictBool = Field(default=False, description="Whether the first waypoint follows the last; by default not.")
    yields: StrictBool = Field(default=True, description="Whether the person stops for a robot that is close ahead.")
    apart: StrictBool = Field(default=False, description="Keeps apart from people, as followers and wanderers do.")
    pace: Annotated[Share, Field(lt=1.0)] = Field(
        default=0.0, description="Share by which the seed changes the speed every 3 m, up and down."
    )
    distractions: Distractions | tuple[Distraction, ...] = Field(
        default=(), description="Lapses of attention, or how many the seed draws."
    )
    follows: Name | None = Field(
        default=None,
        description="A robot by its name, or `robot` for any: once it speaks within 3 m of the person, the person "
        "follows it. A distracted one waits until the robot comes near or speaks.",
    )
    wanders: StrictBool = Field(
        default=False, description="Whether the person walks between free points that the seed draws, after the route."
    )
    steps_aside: Share = Field(
        default=1.0,
        description="Probability that the person, asked by a robot to let it pass, does so; 0 for the deaf.",
    )
    says: Text | None = Field(default=None, description="Words to a robot within 3 m, once, at the end of the route.")


class Route(Manner):
    """Route of a walking person around walls, furniture and closed doors."""

    waypoints: tuple[Corner | Name | Stop, ...] = Field(
        default=(), description="Points (x, y) in metres or names of places, in order; the person begins at the first."
    )
    start: Delay = Field(default=0.0, description="Time at which the person sets off, in seconds from the beginning.")

    @model_validator(mode="after")
    def _leads_somewhere(self) -> Self:
        if not self.waypoints and self.follows is None and not self.wanders:
            raise ValueError("a route needs 'waypoints', or 'follows' or 'wanders'")
        if self.follows is not None and (self.wanders or self.loop):
            raise ValueError("a person who follows a robot neither wanders nor walks a loop; take one of them out")
        return self


class LooseObject(Strict):
    """Object that lies on a surface at the beginning."""

    model: Name = Field(description="A class of objects, or the name of an imported model.")
    surfaces: Annotated[tuple[Name, ...], Field(min_length=1)] = Field(
        description="Surfaces on which it may lie; the seed chooses one."
    )


class Parameter(Strict):
    """Parameter that a mission file declares."""

    type: Literal["text", "number", "truth", "place", "object", "person"] | None = Field(
        default=None, description="Its type; a place, object or person is checked against the world."
    )
    default: Scalar = Field(default=None, description="Its value when none is given.")
    choices: tuple[Scalar, ...] | None = Field(default=None, description="Its possible values.")
    description: Text | None = Field(default=None, description="Its purpose.")


_SHORT: Final = BeforeValidator(
    lambda value: value if isinstance(value, dict | Parameter) else {"default": value},
    json_schema_input_type=Parameter | Scalar,
)
if TYPE_CHECKING:
    _Parameters = dict[str, Parameter]
else:
    _Parameters = dict[str, Annotated[Parameter, _SHORT]]


class _Whole(Placed):
    """Policy for a whole mission, or for the part of one robot."""

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
    """Part for one of several robots. Its policy, `always`, `while` and `when` replace those at the file's top."""

    after: Name | Annotated[tuple[Name, ...], Field(min_length=1)] | None = Field(
        default=None, description="The robot, or the robots, whose parts must be done before this one begins."
    )
    steps: Annotated[Steps, Field(description="Its steps, in order.")]
    always: Annotated[Branch, Field(description="Steps at the part's end in any case, also when cancelled.")] = ()
    while_: Annotated[While | None, Field(alias="while", description="Condition that must hold meanwhile.")] = None
    when: tuple[Handler, ...] | None = Field(default=None, description="Conditions that interrupt it, by importance.")

    @property
    def first(self) -> tuple[str, ...]:
        """Robots whose parts must be done before this one begins."""
        return (self.after,) if isinstance(self.after, str) else self.after or ()


_STATES: Final = frozenset({"be", "have"})
"""Verbs of questions, which name nothing that the robot does: it finds out."""


class Mission(_Whole):
    """Mission in one world, for one robot or with a part for each of several.

    The policy at the top of the file applies to the whole mission, or to each part.
    """

    model_config = ConfigDict(title="Errand mission")

    name: Name = Field(description="The mission's name; part of all path ids.")
    description: str | None = Field(default=None, description="Its purpose.")
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
        description="Changes of the world's knowledge: values here replace those of the world, key by key.",
    )
    zones: Zones | None = Field(default=None, description=ZONES)
    people: dict[Name, Route] | None = Field(
        default=None, description="People who walk while the mission runs, by name: new ones, or those of the world."
    )
    imports: tuple[Name, ...] | None = Field(
        default=None, description="Folders of `errand object import`, as seen from this file's folder."
    )
    objects: dict[Name, LooseObject] | None = Field(default=None, description="Further objects in the world, by name.")
    parameters: _Parameters | None = Field(
        default=None,
        description="Parameters with their defaults, or {type: .., default: ..}, read as ${name} in values; one "
        "without a default must be given.",
    )
    questions: QuestionPolicy | None = Field(
        default=None,
        description="Policy for an ambiguous sentence. ask: the user who starts the mission answers. "
        "first: the likeliest meaning counts. refuse (the default): the file is refused.",
    )
    each: Policy | None = Field(default=None, description="The policy of every step that does not say otherwise.")
    variables: dict[Name, Given] | None = Field(
        default=None,
        description="Values by name, as they are at the beginning; steps change them with `set` and `gives`.",
    )
    steps: Annotated[Branch, Field(description="The steps, in order; omitted where there are `parts`.")]
    parts: Annotated[dict[Name, MissionPart], Field(min_length=1)] | None = Field(
        default=None, description="The part of each robot, by its name; all run at the same time."
    )
    always: Annotated[Branch, Field(description="Steps at the end in any case, also when it is cancelled.")] = ()
    while_: Annotated[While | None, Field(alias="while", description="Condition that must hold meanwhile.")] = None
    when: tuple[Handler, ...] | None = Field(default=None, description="Conditions that interrupt it, by importance.")
    _notes: tuple[str, ...] = PrivateAttr(default=())

    @model_validator(mode="before")
    @classmethod
    def _steps_or_parts(cls, data: Any) -> Any:
        """Accepts `parts` instead of `steps`."""
        if not isinstance(data, dict) or not data.keys() & {"steps", "parts"}:
            return data
        if (data.get("steps") is None) == (data.get("parts") is None):
            raise ValueError("a mission has either 'steps', or 'parts' for several robots")
        return {"steps": None, **data}

    @classmethod
    def from_steps(cls, steps: Sequence[Step], *, world: str, robot: str) -> Self:
        """Builds a mission without a file; names it after its first command, or else after its first block.

        Three or more commands like the first are counted: "visit hall and 6 more".
        """
        commands = [command for step in steps for each in step.walk() for command in each.commands]
        name = type(steps[0]).__name__.lower() if steps else "do"
        if commands:
            first = commands[0]
            verb = "find" if first.verb in _STATES else first.verb or "do"
            more = sum(each.verb == first.verb for each in commands) - 1
            counted = f"and {more} more" if more > 1 else ""
            name = " ".join(filter(None, (verb, str(first.object or first.item or first.goal or ""), counted)))
        return cls(name=name, world=world, robot=robot or None, steps=tuple(steps))

    @property
    def document(self) -> YamlSource | None:
        """Data and line numbers of the file; None for a mission without a file."""
        return None if self._place is None else self._place.document

    @property
    def notes(self) -> tuple[str, ...]:
        """Notes on words in a sentence that were taken for known names."""
        return self._notes

    @property
    def robot_name(self) -> str:
        """Name of the robot; empty where the mission names none."""
        return self.robot or ""

    @property
    def source(self) -> SourceLine | None:
        """Line of the mission's name; None for a mission without a file."""
        return None if self._place is None else self._place.line(("name",))

    @property
    def commands(self) -> tuple[Command, ...]:
        """Commands in all steps, in order, including those of used missions."""
        return tuple(command for step in self.walk() for command in step.commands)

    @property
    def framing_steps(self) -> tuple[Step, ...]:
        """Steps that interrupt the mission's own steps, and steps that run at the end."""
        return (*(step for each in self.when or () for step in each.steps), *self.always)

    @property
    def is_framed(self) -> bool:
        """Returns whether the mission has `always`, `while` or `when`, or zones."""
        return bool(self.always) or self.while_ is not None or self.when is not None or bool(self.zones)

    @property
    def whole_zones(self) -> Mapping[str, ZoneFacts]:
        """Zones that hold for the whole mission: its own zones, and those of a group that is the only step."""
        lone = self.steps[0] if len(self.steps) == 1 else None
        return {**((isinstance(lone, Group) and lone.zones) or {}), **(self.zones or {})}

    def walk(self) -> Iterator[Step]:
        """Yields all steps in order; a step comes before the steps that it contains."""
        for step in (*self.steps, *self.framing_steps):
            yield from step.walk()

    def with_notes(self, notes: tuple[str, ...]) -> Self:
        """Copies the mission with other notes."""
        copy = self.model_copy()
        copy._notes = notes
        return copy
