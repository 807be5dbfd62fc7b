"""Doors with a handle, which a robot with an arm opens by itself where it can."""

import math
from dataclasses import dataclass

from skills.geometry import relative_pose
from skills.quantities import Angle, Coordinate, Height
from skills.robot import DoorHandle, Pose2D


@dataclass(frozen=True)
class ArmDoor:
    """Door with a handle at a position (x, y, height) in the world (m), which swings open in a direction (rad)."""

    handle: tuple[Coordinate, Coordinate, Height]
    swings: Angle

    def open(self, door_name: str, between: tuple[str, str]) -> None:
        """Raises RuntimeError: only the skill open_door may use the robot's arm."""
        raise RuntimeError("the robot opens it with its arm, in the step 'open'")

    def handle_from(self, body: Pose2D, body_m: float, middle_W: tuple[float, float]) -> DoorHandle:
        """The handle as a robot at a pose sees it, its body `body_m` above the floor; `middle_W` is the doorway's."""
        x, y, height_m = self.handle
        off = relative_pose(body, Pose2D(x, y, 0.0))
        before = (body.x_m - middle_W[0], body.y_m - middle_W[1])
        pull = before[0] * math.cos(self.swings) + before[1] * math.sin(self.swings) > 0.0
        to_right = before[0] * (y - middle_W[1]) - before[1] * (x - middle_W[0]) > 0.0
        return DoorHandle((off.x_m, off.y_m, height_m - body_m), to_right, pull)
