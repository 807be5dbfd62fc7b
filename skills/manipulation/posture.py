"""Skills of the arm alone: stow folds it onto the body, pose_arm moves it to joint angles, as saved by teleop."""

import numpy as np

from skills.api import Cause, Succeeded
from skills.manipulation.arm.arm_skill import GRIPPER_FORCE_N, ArmSkill
from skills.ports import PoseArmInputs, PoseArmPorts, StowInputs, StowPorts
from skills.routine import Routine, SkillFailure, planning_failure

_NEAR_X_M = 0.05
"""Distance ahead of the carrying positions within which the hand is near the body."""
_NEAR_Y_M = 0.3
"""Distance to a side within which the hand is near the body."""
_NEAR_Z_M = 0.06
"""Height above the carrying positions within which the hand is near the body."""
_RAISED_M = 0.05
"""Height above the usual one beyond which the body counts as raised."""
_THERE_RAD = 0.05
"""Largest error of a joint angle at which the arm has reached its pose."""


class Stow(StowPorts, ArmSkill[StowInputs]):
    """Implementation of `StowPorts`."""

    def run(self, inputs: StowInputs) -> Routine[Succeeded]:
        """Stows or carries.

        The arm of a raised body comes near first, because it would press on obstacles below while the body sinks.
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


class PoseArm(PoseArmPorts, ArmSkill[PoseArmInputs]):
    """Implementation of `PoseArmPorts`."""

    def run(self, inputs: PoseArmInputs) -> Routine[Succeeded]:
        """Moves the arm, then the gripper."""
        goal = np.array(inputs.joints_rad)
        if len(goal) != len(self.model.names):
            text = f"the pose has {len(goal)} joint angles, the arm has {len(self.model.names)} joints"
            raise SkillFailure(Cause.PRECONDITION, text)
        if not self.model.within_limits(goal, -1e-3):
            raise SkillFailure(Cause.PRECONDITION, "the pose is beyond the limits of the arm's joints")
        yield from self.feel_arm("moving the arm to the pose")
        opens = inputs.opening is not None and not self.context.robot.gripper().holding
        if np.max(np.abs(self.q_rad() - goal)) > _THERE_RAD:
            yield from self.move_to(lambda scene, q: goal, "moving the arm to the pose")
        if opens and inputs.opening is not None:
            opening = min(inputs.opening, self.gripper.widest)
            yield from self.move_gripper(opening, GRIPPER_FORCE_N, "moving the gripper")
        yield from self.feel_arm("moving the arm to the pose")
        return Succeeded("the arm is in the pose")
