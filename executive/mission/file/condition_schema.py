"""The schema of conditions, rounds and waits in mission files."""

from __future__ import annotations

from typing import Annotated, Any, Final

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, model_validator

from skills.files.errors import listing
from skills.files.schema import Name, Text
from skills.quantities import Count, Delay, Duration, Share, clock_text

__all__ = ["CONDITION", "DockFile", "RepeatFile", "Strict", "WaitFile", "WhileFile"]

_LOOKS: Final = ("look", "object", "person", "door")
_CONDITIONS: Final = ("expression", "look", "object", "person", "door", "button", "all", "any", "not")


class Strict(BaseModel):
    """No unknown keys, and nothing changes."""

    model_config = ConfigDict(extra="forbid", frozen=True, populate_by_name=False, defer_build=True)


Clock = Annotated[str, BeforeValidator(clock_text)]
"""A time of day."""


def _expression(value: object) -> object:
    """A bare expression is a condition."""
    if isinstance(value, bool):
        return {"expression": str(value).lower()}
    return {"expression": value} if isinstance(value, str) else value


class ConditionFile(Strict):
    """A condition: one of an expression, something to look for, a door, a button, or a combination of conditions."""

    expression: Text | None = Field(None, description='Of values and readings, as in "battery < 0.3 and not holding".')
    look: Text | None = Field(None, description='A question in English, as in "is there a hammer in the workshop".')
    object: Text | None = Field(None, description="An object that is looked for; `at` says where.")
    person: Text | None = Field(None, description='A person who is looked for, or "anybody"; `at` says where.')
    at: Text | None = Field(None, description="The place of the object or person; by default anywhere.")
    door: Annotated[tuple[Name, ...], Field(min_length=1, max_length=2)] | None = Field(
        None, description="A door that is open: the two rooms that it joins, or the one room that has one door."
    )
    button: Name | None = Field(None, description="A button that the operator presses.")
    all: Annotated[tuple[Condition, ...], Field(min_length=1)] | None = Field(None, description="All of these hold.")
    any: Annotated[tuple[Condition, ...], Field(min_length=1)] | None = Field(None, description="One of these holds.")
    not_: Condition | None = Field(None, alias="not", description="This does not hold.")
    max_age_s: Delay = Field(
        0.0,
        description="How old an answer may be that is not asked for again (seconds, or a text such as "
        '"2 min"); 0: each time that the condition is asked, the robot looks again.',
    )

    @model_validator(mode="before")
    @classmethod
    def _one_room(cls, data: Any) -> Any:
        """A door may be given by one room."""
        if isinstance(data, dict) and isinstance(data.get("door"), str):
            return {**data, "door": [data["door"]]}
        return data

    @model_validator(mode="after")
    def _one_form(self) -> ConditionFile:
        forms = [name for name in _CONDITIONS if getattr(self, "not_" if name == "not" else name) is not None]
        if len(forms) != 1:
            said = f"it has {listing(forms)}" if forms else "it is empty"
            raise ValueError(f"a condition is an expression or one of {listing(_CONDITIONS[1:])}; {said}")
        if self.at is not None and forms[0] not in ("object", "person"):
            raise ValueError("'at' goes with 'object' or 'person'")
        if self.max_age_s and forms[0] not in _LOOKS:
            raise ValueError(f"'max_age_s' goes with what takes a look: {listing(_LOOKS)}")
        return self


Condition = Annotated[ConditionFile, BeforeValidator(_expression, json_schema_input_type=str | ConditionFile)]
CONDITION = Condition
ConditionFile.model_rebuild()


class RepeatFile(Strict):
    """Rounds of `steps`."""

    times: Count | None = Field(None, description="How many rounds; with a condition, how many at most.")
    until: Condition | None = Field(None, description="Rounds are made until this holds after one.")
    while_: Condition | None = Field(
        None, alias="while", description="Rounds are made as long as this holds before one."
    )
    every: Duration | None = Field(
        None, description='A round begins so long after the one before began: seconds, or "30 min".'
    )
    for_each: tuple[Any, ...] | Text | None = Field(
        None,
        description='One round for each of a list, or of "rooms", "people", "people in ROOM" or "surfaces in ROOM".',
    )
    as_: Name | None = Field(None, alias="as", description="The name by which steps read it, as ${NAME}.")

    @model_validator(mode="after")
    def _one_form(self) -> RepeatFile:
        if self.until is not None and self.while_ is not None:
            raise ValueError("rounds go on 'until' or 'while', not both")
        if (self.for_each is None) != (self.as_ is None):
            raise ValueError("'for_each' and 'as' go together")
        others = [key for key in ("times", "until", "while_", "every") if getattr(self, key) is not None]
        if self.for_each is not None and others:
            raise ValueError("'for_each' stands alone")
        if self.for_each is None and not others:
            raise ValueError("it does not say how often: give 'times', 'until', 'while', 'every' or 'for_each'")
        return self


class WaitFile(Strict):
    """What is waited for: one of a condition, a time and a time of day."""

    for_: Condition | None = Field(None, alias="for", description="Wait until this holds.")
    seconds: Duration | None = Field(None, description='So long: seconds, or "10 min".')
    until_clock: Clock | None = Field(None, description='Until this time of day, as in "14:30".')
    every: Duration = Field(15.0, description="How often a condition that takes a look is looked at.")

    @model_validator(mode="after")
    def _one_form(self) -> WaitFile:
        if sum(each is not None for each in (self.for_, self.seconds, self.until_clock)) != 1:
            raise ValueError("give one of 'for', 'seconds' and 'until_clock'")
        return self


class DockFile(Strict):
    """How far to charge at the dock."""

    level: Share | None = Field(None, description="The charge, from 0 to 1; by default as the knowledge file says.")


class WhileFile(Strict):
    """What must hold while steps run."""

    holds: Condition = Field(description="When it does not hold, the steps are stopped and have failed.")
