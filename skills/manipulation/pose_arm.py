"""The pose_arm skill: moves the arm to joint angles, such as `errand teleop` saves."""

import numpy as np

from skills.api import Cause, Succeeded
from skills.manipulation.arm.arm_skill import GRIPPER_FORCE_N, ArmSkill
from skills.ports import PoseArmInputs, PoseArmPorts
from skills.routine import Routine, SkillFailure

_THERE_RAD = 0.05
"""Largest difference of a joint angle at which the arm counts as there."""


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
