"""Base of all steps in a mission: policy (limits, guards, retries, failures), location in the file, properties."""

from __future__ import annotations

import enum
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, Literal, Self

from pydantic import Field, PrivateAttr, StrictBool, model_validator

from executive.words.command import Command
from executive.words.expression import ExpressionError
from skills.inputs.errors import InputError, SourceLine
from skills.inputs.schema import Strict, Text
from skills.inputs.yaml_source import KeyPath, YamlSource
from skills.quantities import Duration, Number, Quantity, Share, Whole

Given = str | StrictBool | Whole | Number
Scalar = Given | None
Fault = tuple[KeyPath, str, str]
"""Path below a step to its fault, a sentence and a hint."""
Attempts = Annotated[int, Quantity(ge=0, le=100)]
Objects = Annotated[int, Quantity(ge=0, le=10)]


class StaleData(enum.Enum):
    """Policy for a reading that is too old."""

    WAIT = "wait"  # stand still until there is a new one, and fail when the patience is over
    FAIL = "fail"  # count it as violated at once
    ACCEPT = "accept"  # judge by what there is


class OnFailure(enum.Enum):
    """Reaction to a failed step that has no retries left."""

    STOP = "stop"  # the mission fails
    RETRY = "retry"  # try again, once unless `retries` says otherwise, then stop
    SKIP = "skip"  # note it and go on with the next step; the mission's result names what was skipped
    ASK = "ask"  # ask the operator: retry, skip or stop
    RETURN = "return"  # go back to where the mission began, then stop


class Guards(Strict):
    """Conditions that must hold while a step runs; the step fails when one does not hold."""

    battery: Share | None = Field(default=None, description="The least charge of the battery, from 0 to 1.")
    localised: StrictBool | None = Field(default=None, description="Whether the robot must know where it is.")
    time_s: Annotated[
        Duration | None,
        Field(
            alias="time",
            description="The most seconds on the robot's clock since the run began; later than that it fails.",
        ),
    ] = None
    stale: StaleData | None = Field(
        default=None,
        description="Reaction to an old reading. wait: stand still for a new one. fail: the guard does not hold. "
        "accept: judge by the old one.",
    )


class OperatorQuestion(Strict):
    """Question to the operator for `on_failure: ask`."""

    text: Text | None = Field(default=None, description="The question; by default it says what failed and why.")
    limit_s: Annotated[Duration, Field(alias="limit", description="Wait for an answer (s, robot's clock).")] = 60.0
    default: Literal["skip", "stop"] = Field(default="stop", description="The answer when nobody answers in time.")


class Policy(Strict):
    """Policy of a step or mission: timeout, retries, reaction to a failure, guards."""

    timeout_s: Annotated[Duration | None, Field(alias="timeout", description="Time limit of each attempt (s).")] = None
    retries: Attempts | None = Field(default=None, description="How many more attempts after a failure.")
    on_failure: OnFailure | None = Field(
        default=None,
        description="Reaction to a failure without retries left. retry: once more (or as often as `retries` "
        "says), then stop. skip: note it and go on. ask: ask the operator. return: go back to where the robot started, "
        "then stop. stop: the mission fails.",
    )
    question: OperatorQuestion | None = Field(default=None, description="The question for `on_failure: ask`.")
    guards: Guards | None = Field(default=None, description="Guards that must hold while it runs.")
    pick_ups: Objects | None = Field(default=None, description="Pick-ups of a dropped object at most; by default, two.")
    move_aside: Objects | None = Field(
        default=None,
        description="How many objects that block every grasp the robot may move aside on their surface; "
        "by default, none.",
    )

    @model_validator(mode="after")
    def _asks_where_it_says_so(self) -> Self:
        if self.question is not None and self.on_failure is not OnFailure.ASK:
            raise ValueError("'question' is that of 'on_failure: ask', which does not stand beside it")
        return self

    @property
    def further_attempts(self) -> int:
        """Number of attempts after a failed one."""
        if self.retries is None:
            return int(self.on_failure is OnFailure.RETRY)
        return self.retries

    @property
    def is_empty(self) -> bool:
        """Returns whether the policy changes nothing."""
        guards = self.guards or Guards()
        guarded = guards.battery is not None or guards.localised or guards.time_s is not None
        numbers = (self.timeout_s, self.pick_ups, self.move_aside)
        stops = self.on_failure in (None, OnFailure.STOP, OnFailure.RETRY)
        return stops and not guarded and not self.further_attempts and numbers == (None, None, None)

    def with_policy(self, below: Policy | None) -> Self:
        """Copies the policy; values that it leaves open are taken from `below`."""
        values: dict[str, Any] = {} if below is None else {key: getattr(below, key) for key in Policy.model_fields}
        return self.model_copy(
            update={key: value for key, value in values.items() if value is not None and getattr(self, key) is None}
        )


@dataclass(frozen=True)
class Place:
    """Location of a step or a mission in a file: the document, and the path of keys in it.

    A key that is missing in the `part` of one of several robots is looked up at the top of the file.
    """

    document: YamlSource
    path: KeyPath = ()
    part: bool = False

    def line(self, below: KeyPath = ()) -> SourceLine:
        """Line of the value at a path below this location."""
        return SourceLine(self.document.path, self.document.line(self._whole(below)))

    def error(self, below: KeyPath, message: str, hint: str) -> InputError:
        """Error in the value at a path below this location."""
        return self.document.error(self._whole(below), message, hint)

    def _whole(self, below: KeyPath) -> KeyPath:
        own = (*self.path, *below)
        return below if self.part and own not in self.document.lines else own


class Placed(Policy):
    """Policy for a step or a mission, with its location in a file."""

    _place: Place | None = PrivateAttr(default=None)

    @property
    def place(self) -> Place | None:
        """Location in a file; None if there is no file."""
        return self._place

    def error(self, below: KeyPath, message: str, hint: str) -> InputError:
        """Error in the value at a path below the step or mission, for instance ("world",)."""
        return InputError(message, hint=hint) if self._place is None else self._place.error(below, message, hint)

    def within(self, below: KeyPath, error: InputError) -> InputError:
        """Adds the line of the value at a path below, which refers to an erroneous file."""
        line = None if self._place is None else self._place.line(below)
        return error if line is None else error.within(line.file, line.line)

    def with_place(self, place: Place | None) -> Self:
        """Copies the step or mission with another location."""
        copy = self.model_copy()
        copy._place = place
        return copy


class Step(Placed):
    """Step of a mission, with the step's policy."""

    key: ClassVar[str] = ""
    """First key of its form, which names the step in path ids."""

    @property
    def source(self) -> SourceLine | None:
        """Line of the step in its file; None if there is no file."""
        return None if self._place is None else self._place.line()

    @property
    def is_block(self) -> bool:
        """Returns whether the step is a block (decision, loop, wait and so on), no command, skill or used mission."""
        return bool(self.key)

    @property
    def commands(self) -> tuple[Command, ...]:
        """Commands of the step itself, without those of inner steps."""
        return ()

    @property
    def inner_steps(self) -> tuple[Step, ...]:
        """Steps inside the step, in the order of the fields."""
        return tuple(step for name in type(self).model_fields for step in _steps_in(getattr(self, name)))

    @property
    def words(self) -> str:
        """Name of the step for use in sentences."""
        return self.key

    @property
    def faults(self) -> Iterator[Fault]:
        """Yields the faults in the step's own values."""
        yield from ()

    def walk(self) -> Iterator[Step]:
        """Yields the step and all steps inside it, including those of a used mission."""
        yield self
        for step in self.inner_steps:
            yield from step.walk()


def _steps_in(value: Any) -> Iterator[Step]:
    if isinstance(value, Step):
        yield value
    elif isinstance(value, tuple | dict):
        for part in value.values() if isinstance(value, dict) else value:
            yield from _steps_in(part)


def unreadable(path: KeyPath, read: Callable[[], object]) -> Iterator[Fault]:
    """Yields the fault if an expression, or a text with expressions, cannot be parsed."""
    try:
        read()
    except ExpressionError as error:
        yield path, error.message, error.hint
