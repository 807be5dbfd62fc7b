"""A gripper's goal: an opening and the most force to reach it with, which stays after the command's end."""

from __future__ import annotations

import enum
from dataclasses import dataclass

from plant.kept import Kept


@dataclass(frozen=True)
class GripperGoal:
    """Opening to reach (0 closed, in the unit of the gripper's kind) with at most `force_n` at the tip."""

    opening: float
    force_n: float


@dataclass(frozen=True)
class GripperTolerances:
    """When an opening is reached, and when the fingers stand still against something (units of the opening, s)."""

    arrived: float
    stall_rate: float
    stall_s: float = 0.25


class Closing(enum.Enum):
    """How far a gripper is with its goal."""

    MOVING = "moving"
    ARRIVED = "arrived"
    BLOCKED = "blocked"


class GripperServo(Kept, keeps=("goal", "_before", "_still_s")):
    """The present goal of one gripper, and the one before."""

    def __init__(self, opening: float, tolerances: GripperTolerances) -> None:
        """The gripper stands at an opening."""
        self._tolerances = tolerances
        self.goal = self._before = GripperGoal(opening, 20.0)
        self._still_s = 0.0

    def begin(self, goal: GripperGoal) -> None:
        """Take a new goal."""
        self._before, self.goal = self.goal, goal
        self._still_s = 0.0

    def follow(self, opening: float, rate: float, dt_s: float) -> Closing:
        """How far it is, after dt_s at an opening that changes at a rate."""
        self._still_s = self._still_s + dt_s if rate < self._tolerances.stall_rate else 0.0
        if abs(opening - self.goal.opening) < self._tolerances.arrived:
            return Closing.ARRIVED
        return Closing.BLOCKED if self._still_s > self._tolerances.stall_s else Closing.MOVING

    def halt(self, opening: float, rate: float) -> None:
        """Stay: a moving gripper where it is; one that holds an object keeps its force, or gets that of before."""
        if rate >= self._tolerances.stall_rate:
            self.goal = GripperGoal(opening, self.goal.force_n)
        elif self.goal.opening > opening:
            self.goal = self._before


def gripper_set_point(goal: float, now: float, lead: float) -> float:
    """Position that a servo is given so that it pushes with no more than its gain times `lead`."""
    return min(max(goal, now - lead), now + lead)
