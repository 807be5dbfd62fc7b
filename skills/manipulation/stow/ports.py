"""Ports of the stow skill, from which trees are compiled."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from skills.api import Cause, Part, Skill


@dataclass(frozen=True)
class StowInputs:
    """No inputs."""


class StowPorts(Skill[StowInputs]):
    """Brings the arm near the body, and the body to its usual height. An arm that is near the body stays there."""

    done_by: ClassVar[str] = "skills.manipulation.stow.skill:Stow"
    name = "stow"
    Inputs = StowInputs
    uses: ClassVar[frozenset[Part]] = frozenset({Part.ARM})
    causes: ClassVar[Mapping[Cause, str]] = {
        Cause.PLANNING: "the arm finds no free path",
        Cause.EXECUTION: "the arm did not reach its goal",
    }
    default_timeout_s = 30.0
    max_data_age_s: ClassVar[Mapping[str, float]] = {"joints": 0.5, "gripper": 0.5}
