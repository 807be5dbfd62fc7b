"""Ports of the hand_over skill, from which trees are compiled."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from skills.api import Cause, Skill
from skills.quantities import Coordinate, Height


@dataclass(frozen=True)
class HandOverInputs:
    """Names of the person and of the object, for messages; the skill takes the nearest person in sight."""

    person: str
    thing: str = "object"


class HandOverPorts(Skill[HandOverInputs]):
    """Finds a person by LiDAR, goes there, holds the object out, lets go when they take it, and checks who has it.

    The output `released_W` is where the hand has let the object go, also after a failure; a failure before has none.
    """

    done_by: ClassVar[str] = "skills.manipulation.hand_over.skill:HandOver"
    name = "hand_over"
    Inputs = HandOverInputs
    outputs: ClassVar[Mapping[str, type]] = {"released_W": tuple[Coordinate, Coordinate, Height]}
    causes: ClassVar[Mapping[Cause, str]] = {
        Cause.PRECONDITION: "nothing is held, there is no new scan, or nobody is seen near",
        Cause.PLANNING: "no free place before the person, or no free path for the arm",
        Cause.EXECUTION: "the robot or its arm did not reach its goal",
        Cause.POSTCONDITION: "the object was lost, is still in the gripper, or is not seen at rest with the person",
        Cause.TIMEOUT: "the person did not take the object",
    }
    default_timeout_s = 180.0
    max_data_age_s: ClassVar[Mapping[str, float]] = {"joints": 0.5, "gripper": 0.5}
    changes_world = True
    gripper_before = True
    gripper_after = False
