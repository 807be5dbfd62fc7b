"""Ports of the relocalise skill, from which trees are compiled."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from skills.api import Cause, Part, Skill
from skills.quantities import Tries


@dataclass(frozen=True)
class RelocaliseInputs:
    """Largest numbers of headings to search in, an eighth of a turn apart, and of drives elsewhere."""

    turns: Tries = 8
    drives: Tries = 3


class RelocalisePorts(Skill[RelocaliseInputs]):
    """Finds the robot's pose on the map again. A pose counts once new scans agree with it for a second."""

    done_by: ClassVar[str] = "skills.relocalise.skill:Relocalise"
    name: ClassVar[str] = "relocalise"
    Inputs: ClassVar[type] = RelocaliseInputs
    uses: ClassVar[frozenset[Part]] = frozenset({Part.BASE})
    causes: ClassVar[Mapping[Cause, str]] = {
        Cause.PRECONDITION: "there are no new scans, or this robot's localiser cannot search",
        Cause.EXECUTION: "the robot refuses to move, or a camera gives no picture",
        Cause.POSTCONDITION: "no pose on the map fits what the robot sees",
    }
    default_timeout_s: ClassVar[float] = 240.0
    max_data_age_s: ClassVar[Mapping[str, float]] = {"localisation": 1.0}
