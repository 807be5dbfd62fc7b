"""What the detect skill takes and gives: all that a tree is compiled from."""

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
    """What to look for (any of `classes`, with all `attributes`) and on which surfaces.

    The class "thing" is any object that stands there, whether the detector has a class for it or not; those where
    one of `avoid` was seen are the last choice.

    The search ends with the first `count` objects; a count of 0 searches all surfaces and counts all objects. With
    `expected_W` it searches that place only, and only objects within 0.35 m of it count. With `floor`, objects on the
    floor beside the surfaces count where they come into view.
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
    """Searches surfaces for objects from where the robot stands. Stows the arm when it finds nothing."""

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
