"""Ports of the find_people skill, from which a tree is compiled."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from skills.api import Cause, ObjectObservation, Part, Skill
from skills.perception.class_forms import PERSON
from skills.quantities import Coordinate, Tries


@dataclass(frozen=True)
class FindPeopleInputs:
    """Area to search: the corners (x, y) of `area_W`, with the name `place`.

    `person` is the name of the wanted person; any person counts, since the skill recognises no faces. A `count` of 0
    counts all people.
    """

    area_W: tuple[tuple[Coordinate, Coordinate], ...]
    place: str
    person: str = PERSON
    count: Tries = 1


class FindPeoplePorts(Skill[FindPeopleInputs]):
    """Looks for people with body cameras and LiDAR; with the LiDAR alone if the detector has no class of people."""

    done_by: ClassVar[str] = "skills.find_people.skill:FindPeople"
    name = "find_people"
    Inputs = FindPeopleInputs
    uses: ClassVar[frozenset[Part]] = frozenset({Part.BASE})
    outputs: ClassVar[Mapping[str, type]] = {
        "observation": ObjectObservation,
        "observations": tuple[ObjectObservation, ...],
    }
    causes: ClassVar[Mapping[Cause, str]] = {
        Cause.PRECONDITION: "there is no new scan",
        Cause.EXECUTION: "it is too dark to see, a camera gives no picture, or the robot refuses to turn",
        Cause.POSTCONDITION: "nobody is seen, or fewer than asked for",
    }
    default_timeout_s = 60.0
    max_data_age_s: ClassVar[Mapping[str, float]] = {"localisation": 1.0}
