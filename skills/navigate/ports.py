"""Inputs, outputs and causes of the navigate skill, from which a tree is compiled."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from skills.api import Cause, Part, Skill
from skills.quantities import Coordinate, Length, Speed, Turn
from skills.robot import Pose2D


@dataclass(frozen=True)
class NavigateInputs:
    """The goal (the body's pose in the world), tolerances and the maximum speed.

    Poses at `nearby_m`, forward and left of the goal, count as reached too: a failure is final only if none is
    reachable.
    """

    goal: Pose2D
    position_tolerance_m: Length = 0.10
    yaw_tolerance_rad: Turn = 0.10
    max_speed_m_s: Speed = 0.8
    nearby_m: tuple[tuple[Coordinate, Coordinate], ...] = ()


class NavigatePorts(Skill[NavigateInputs]):
    """Drives to a pose: plans a path for the whole footprint, follows it, and stands still at the goal."""

    done_by: ClassVar[str] = "skills.navigate.skill:Navigate"
    name: ClassVar[str] = "navigate"
    Inputs: ClassVar[type] = NavigateInputs
    uses: ClassVar[frozenset[Part]] = frozenset({Part.BASE})
    outputs: ClassVar[Mapping[str, type]] = {}
    causes: ClassVar[Mapping[Cause, str]] = {
        Cause.PRECONDITION: "localisation is lost, the LiDAR does not work, or the robot refuses to drive",
        Cause.PLANNING: "the goal is blocked, or there is no path, even after waiting for what stands there to move",
        Cause.EXECUTION: "the robot makes no progress, loses localisation or its LiDAR, or refuses to drive on",
        Cause.POSTCONDITION: "it stands still, but not at the goal",
    }
    default_timeout_s: ClassVar[float] = 180.0
    max_data_age_s: ClassVar[Mapping[str, float]] = {"odometry": 0.5}
