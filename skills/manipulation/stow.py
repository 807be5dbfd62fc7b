"""The stow skill: folds the arm onto the body, or holds an object in the gripper near the body."""

from skills.api import Succeeded
from skills.manipulation.arm.arm_skill import ArmSkill
from skills.ports import StowInputs, StowPorts
from skills.routine import Routine, planning_failure

_NEAR_X_M = 0.05
"""Distance ahead of the carrying positions within which the hand is near the body."""
_NEAR_Y_M = 0.3
"""Distance to a side within which the hand is near the body."""
_NEAR_Z_M = 0.06
"""Height above the carrying positions within which the hand is near the body."""
_RAISED_M = 0.05
"""Height above the usual one from which on the body counts as raised."""


class Stow(StowPorts, ArmSkill[StowInputs]):
    """Implementation of `StowPorts`."""

    def run(self, inputs: StowInputs) -> Routine[Succeeded]:
        """Stows or carries.

        The arm of a raised body comes near first, because while the body sinks it would press on what is below.
        """
        yield from self.feel_arm("stowing the arm")
        usual_m = self.context.robot.capabilities().standing_height_m
        if self.context.robot.odometry().X_OB.translation()[2] > usual_m + _RAISED_M:
            yield from planning_failure(self._come_near())
        yield from self.stand_at(usual_m, "standing as usual")
        holding = self.context.robot.gripper().holding
        yield from self._come_near()
        yield from self.feel_arm("stowing the arm")
        return Succeeded("the object is held near the body" if holding else "the arm is stowed")

    def _come_near(self) -> Routine[None]:
        """Folds the empty arm, or draws in an object that is far from the body."""
        if not self.context.robot.gripper().holding:
            yield from self.stow()
            return
        X_BH, arm = self.model.X_BH(self.q_rad()), self.arm
        x_m, y_m, z_m = X_BH.translation()
        far = x_m > max(arm.carry_x_m) + _NEAR_X_M or z_m > max(arm.carry_z_m) + _NEAR_Z_M
        if far or abs(y_m) > _NEAR_Y_M:
            yield from self.carry(X_BH.rotation(), "drawing in the arm")
