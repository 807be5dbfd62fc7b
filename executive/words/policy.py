"""Policies: limits, guards and retries of a step or a mission, and the reaction to a failure."""

from __future__ import annotations

import enum
from typing import Annotated, Any, Literal, Self

from pydantic import Field, StrictBool, model_validator

from executive.words.forms import Strict
from skills.inputs.schema import Text
from skills.quantities import Duration, Quantity, Share

Attempts = Annotated[int, Quantity(ge=0, le=100)]
Objects = Annotated[int, Quantity(ge=0, le=10)]


class StaleData(enum.Enum):
    """Policy for a reading that is older than it may be."""

    WAIT = "wait"  # stand still until there is a new one, and fail when the patience is over
    FAIL = "fail"  # count it as violated at once
    ACCEPT = "accept"  # judge by what there is


class OnFailure(enum.Enum):
    """Reaction to a failed step without retries left."""

    STOP = "stop"  # the mission fails
    RETRY = "retry"  # try again, once unless `retries` says otherwise, then stop
    SKIP = "skip"  # note it and go on with the next step; the mission's result names what was skipped
    ASK = "ask"  # ask the operator: retry, skip or stop
    RETURN = "return"  # go back to where the mission began, then stop


class Guards(Strict):
    """Guards of a running step, which fails when one does not hold."""

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
    limit_s: Annotated[
        Duration, Field(alias="limit", description="Seconds on the robot's clock to wait for an answer.")
    ] = 60.0
    default: Literal["skip", "stop"] = Field(default="stop", description="The answer when nobody answers in time.")


class Policy(Strict):
    """Policy of a step or mission: timeout, retries, reaction to a failure, guards."""

    timeout_s: Annotated[
        Duration | None, Field(alias="timeout", description="Seconds on the robot's clock for each attempt.")
    ] = None
    retries: Attempts | None = Field(default=None, description="How many more attempts after a failure.")
    on_failure: OnFailure | None = Field(
        default=None,
        description="Reaction to a failure without retries left. retry: once more (or as often as `retries` "
        "says), then stop. skip: note it and go on. ask: ask the operator. return: go back to where the robot started, "
        "then stop. stop: the mission fails.",
    )
    question: OperatorQuestion | None = Field(default=None, description="The question for `on_failure: ask`.")
    guards: Guards | None = Field(default=None, description="Guards that must hold while it runs.")
    pick_ups: Objects | None = Field(
        default=None, description="How often the robot picks up an object that it drops; by default, twice."
    )
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
        """Copies the policy, with its open values taken from `below`."""
        values: dict[str, Any] = {} if below is None else {key: getattr(below, key) for key in Policy.model_fields}
        return self.model_copy(
            update={key: value for key, value in values.items() if value is not None and getattr(self, key) is None}
        )
