"""Ports of the back_off skill, from which trees are compiled."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from skills.api import Cause, Part, Skill
from skills.quantities import Length


@dataclass(frozen=True)
class BackOffInputs:
    """Distance (m), and the least distance (m) that counts as success."""

    distance_m: Length = 0.4
    least_m: Length = 0.15


class BackOffPorts(Skill[BackOffInputs]):
    """Drives a short distance out of a tight place: straight, slowly, in the first direction with enough clearance."""

    done_by: ClassVar[str] = "skills.back_off.skill:BackOff"
    name: ClassVar[str] = "back_off"
    Inputs: ClassVar[type] = BackOffInputs
    uses: ClassVar[frozenset[Part]] = frozenset({Part.BASE})
    causes: ClassVar[Mapping[Cause, str]] = {
        Cause.PRECONDITION: "the LiDAR does not work",
        Cause.PLANNING: "there is no clearance in any direction",
        Cause.EXECUTION: "the robot refuses to drive or makes no progress",
    }
    default_timeout_s: ClassVar[float] = 15.0
    max_data_age_s: ClassVar[Mapping[str, float]] = {"odometry": 0.5}
