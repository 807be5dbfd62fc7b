"""Ports of the detect skill, from which a tree is compiled."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from skills.api import (
    Cause,
    ObjectObservation,
    Skill,
    Surface,
)
from skills.quantities import Coordinate, Height, Tries


@dataclass(frozen=True)
class DetectInputs:
    """Wanted objects (any of `classes`, with all `attributes`) and the surfaces to search.

    The class "thing" is any object, whether the detector knows its class or not; objects at the positions of `avoid`
    are the last choice.

    The search ends with the first `count` objects; a count of 0 searches all surfaces and counts all objects. With
    `expected_W` it searches only that position, and only objects within 0.35 m of it count. With `floor`, visible
    objects on the floor beside the surfaces count too.
    """

    classes: tuple[str, ...]
    surfaces: tuple[Surface, ...]
    attributes: tuple[str, ...] = ()
    expected_W: tuple[Coordinate, Coordinate, Height] | None = None
    count: Tries = 1
    floor: bool = False
    avoid: tuple[ObjectObservation, ...] = ()
    seen_before: ObjectObservation | None = None


class DetectPorts(Skill[DetectInputs]):
    """Searches surfaces for objects without driving. Stows the arm when it finds too few."""

    done_by: ClassVar[str] = "skills.detect.skill:Detect"
    name = "detect"
    Inputs = DetectInputs
    outputs: ClassVar[Mapping[str, type]] = {
        "observation": ObjectObservation,
        "observations": tuple[ObjectObservation, ...],
    }
    causes: ClassVar[Mapping[Cause, str]] = {
        Cause.PRECONDITION: "a class, attribute or surface cannot be searched for from here, or there is no arm",
        Cause.PLANNING: "the arm reaches no viewpoint",
        Cause.EXECUTION: "the arm did not reach its viewpoint, or the camera shows nothing",
        Cause.POSTCONDITION: "no such object is seen, or fewer than asked for",
    }
    default_timeout_s = 90.0
    max_data_age_s: ClassVar[Mapping[str, float]] = {"observation": 3.0}
