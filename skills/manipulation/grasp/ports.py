"""Ports of the grasp skill, from which trees are compiled."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from skills.api import Cause, ObjectObservation, Skill
from skills.quantities import Coordinate, Cosine
from skills.world_model import IN_THE_WAY


@dataclass(frozen=True)
class TriedGrasp:
    """Grasp in the world's axes: directions of the fingers and of their closing, the hand from the object (m)."""

    pointing_W: tuple[Cosine, Cosine, Cosine]
    closing_W: tuple[Cosine, Cosine, Cosine]
    hand_from_object_W: tuple[Coordinate, Coordinate, Coordinate]


@dataclass(frozen=True)
class GraspInputs:
    """Object as it was seen; grasps like those in `avoid` are the last choice."""

    observation: ObjectObservation
    avoid: tuple[TriedGrasp, ...] = ()


class GraspPorts(Skill[GraspInputs]):
    """Grasps an object and holds it near the body. On failure it opens the gripper and stows the arm.

    The output `tried` is `avoid` and the grasp of this attempt, also after a failure. After a failure for want of a
    plan, `in_the_way` are the objects that block every grasp, the nearest first; else it is empty.
    """

    done_by: ClassVar[str] = "skills.manipulation.grasp.skill:Grasp"
    name = "grasp"
    Inputs = GraspInputs
    outputs: ClassVar[Mapping[str, type]] = {
        "tried": tuple[TriedGrasp, ...],
        IN_THE_WAY: tuple[ObjectObservation, ...],
    }
    causes: ClassVar[Mapping[Cause, str]] = {
        Cause.PRECONDITION: "the object is not where it was seen or too heavy, the gripper is full, or there is no arm",
        Cause.PLANNING: "no grasp is within reach and free",
        Cause.EXECUTION: "the arm or the gripper did not reach its goal",
        Cause.POSTCONDITION: "the gripper closed on nothing, or the object slipped out",
    }
    default_timeout_s = 120.0
    max_data_age_s: ClassVar[Mapping[str, float]] = {"joints": 0.5, "gripper": 0.5}
    changes_world = True
    gripper_before = False
    gripper_after = True
