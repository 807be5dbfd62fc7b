"""Ports of the pose_arm skill, from which trees are compiled."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from skills.api import Cause, Part, Skill
from skills.quantities import Angle, Turn


@dataclass(frozen=True)
class PoseArmInputs:
    """Joint angles from the shoulder on, and an opening (0 closed).

    None, or a held object, leaves the gripper as it is.
    """

    joints_rad: tuple[Angle, ...]
    opening: Turn | None = None


class PoseArmPorts(Skill[PoseArmInputs]):
    """Moves the arm on a free path to joint angles, then the gripper to an opening."""

    done_by: ClassVar[str] = "skills.manipulation.pose_arm.skill:PoseArm"
    name = "pose_arm"
    Inputs = PoseArmInputs
    uses: ClassVar[frozenset[Part]] = frozenset({Part.ARM})
    causes: ClassVar[Mapping[Cause, str]] = {
        Cause.PRECONDITION: "the pose is not one of this robot's arm",
        Cause.PLANNING: "the arm finds no free path",
        Cause.EXECUTION: "the arm did not reach its goal",
    }
    default_timeout_s = 30.0
    max_data_age_s: ClassVar[Mapping[str, float]] = {"joints": 0.5}
