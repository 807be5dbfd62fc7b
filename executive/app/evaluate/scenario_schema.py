"""The schema of a scenario file for `errand evaluate`: what is run, in which worlds, and what is varied."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field, model_validator

from executive.mission.scenario import RandomFaults
from executive.words.variation import (
    NORMAL_LIGHT,
    Brightness,
    Clutter,
    Friction,
    MorePeople,
)
from skills.files.schema import Name, Text
from skills.quantities import LongDuration, Seed

__all__ = ["EvaluationFile", "FaultsFile", "MissionEntry", "VariationsFile"]


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, populate_by_name=True)


class MissionEntry(_Strict):
    """A mission: exactly one of `say` and `file`."""

    say: Text | None = Field(None, description="A sentence.")
    file: Name | None = Field(
        None, description="A mission file, as seen from this file, or a name of `errand missions`."
    )
    name: Name | None = Field(None, description="What the report calls it.")
    set: dict[str, Any] = Field(default_factory=dict, description="Values for the parameters of the file.")
    answers: tuple[Text, ...] = Field((), description="Answers to the questions that it leaves open.")

    @model_validator(mode="after")
    def _one_of_both(self) -> MissionEntry:
        if (self.say is None) == (self.file is None):
            raise ValueError("give exactly one of 'say' and 'file'")
        if self.set and self.file is None:
            raise ValueError("'set' gives values to a mission file, and there is none")
        return self


class FaultsFile(_Strict):
    """Faults by their words, and how many more the seed draws."""

    name: Name | None = Field(None, description="What the report calls it.")
    faults: tuple[Text, ...] = Field((), description="Faults by their words.")
    random: RandomFaults = Field(0, description="How many more the run's seed draws.")


Light = Name | Brightness
_SOME = Field(min_length=1)


class VariationsFile(_Strict):
    """Lists of values; each value of one is tried with each of all others."""

    light: Annotated[tuple[Light, ...], _SOME] = Field(
        (NORMAL_LIGHT,), description="Lights by name (normal, dim, bright, evening, low sun), or brightnesses."
    )
    clutter: Annotated[tuple[Clutter, ...], _SOME] = Field((0,), description="How many more objects lie about.")
    people: Annotated[tuple[MorePeople, ...], _SOME] = Field((0,), description="How many more people walk about.")
    friction: Annotated[tuple[Friction, ...], _SOME] = Field(
        (1.0,), description="Factors on the friction of loose objects and robots."
    )
    faults: Annotated[tuple[Text | FaultsFile, ...], _SOME] = Field(
        ("none",), description="Sensor and other faults: `none`, the words of one, or several together."
    )
    scenario: Annotated[tuple[Name, ...], _SOME] = Field(
        ("none",), description="`none`, or files of faults and events, as `errand run --scenario` takes them."
    )
    stack: Annotated[tuple[Name, ...], _SOME] = Field(
        ("default",), description="`default`, `no_map`, or stack files: what the robot uses."
    )


Robots = Annotated[dict[Name, Name], _SOME]


class EvaluationFile(_Strict):
    """Missions, worlds, robots, seeds and variations, whose product is the set of runs."""

    missions: Annotated[tuple[Text | MissionEntry, ...], _SOME] = Field(
        description="Sentences, names of `errand missions`, and mission files, as seen from this file."
    )
    worlds: Annotated[tuple[Name, ...], _SOME] | None = Field(
        None, description="Worlds by name or folder; by default each mission's own."
    )
    robots: Robots | Annotated[tuple[Robots, ...], _SOME] | None = Field(
        None, description="Robots by name, each with its kind, or a list of such mappings to be tried in turn."
    )
    seeds: Text | Annotated[tuple[Seed, ...], _SOME] = Field(
        "1-20", description="Seeds such as `1-20`, or a list of them."
    )
    time_limit: LongDuration | None = Field(None, description="Each run ends after so long on the robot's clock.")
    variations: VariationsFile = Field(VariationsFile.model_validate({}), description="What is varied.")
