"""Ports of the approach skill, from which trees are compiled."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from skills.api import Cause, ObjectObservation, Skill, Surface


@dataclass(frozen=True)
class ApproachInputs:
    """Object as it was seen, and the surfaces near it, including the one that it lies on."""

    observation: ObjectObservation
    surfaces: tuple[Surface, ...]


class ApproachPorts(Skill[ApproachInputs]):
    """Drives slowly, with the arm stowed, to where the arm can grasp an object, and looks at the object again."""

    done_by: ClassVar[str] = "skills.manipulation.approach.skill:Approach"
    name = "approach"
    Inputs = ApproachInputs
    outputs: ClassVar[Mapping[str, type]] = {"observation": ObjectObservation}
    causes: ClassVar[Mapping[Cause, str]] = {
        Cause.PLANNING: "no free place to stand is near enough to the object, or no path leads there",
        Cause.EXECUTION: "the robot did not reach the place to stand",
        Cause.POSTCONDITION: "the object is not seen again from there",
    }
    default_timeout_s = 150.0
    max_data_age_s: ClassVar[Mapping[str, float]] = {"odometry": 0.5, "observation": 3.0}
