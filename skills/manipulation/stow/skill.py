"""The stow skill: the arm folded onto the body, or, with an object in the gripper, the object held near the body."""

from __future__ import annotations

import numpy as np

from skills.api import Cause, Succeeded
from skills.manipulation.arm.arm_skill import ArmSkill
from skills.manipulation.arm.poses import carry_configuration
from skills.manipulation.stow.ports import StowInputs, StowPorts
from skills.routine import Routine, SkillFailure

_NEAR_X_M, _NEAR_Z_M = 0.05, 0.06
"""A hand no farther than so beyond where it carries is near the body."""
_RAISED_M = 0.05
"""A body no more than so above its usual height is not raised."""


class Stow(StowPorts, ArmSkill[StowInputs]):
    """The skill that `StowPorts` declares."""

    def run(self, inputs: StowInputs) -> Routine[Succeeded]:
        """Stow, or carry. From a raised body the arm comes near first: lowered, it would press on what is under it."""
        yield from self.feel_arm("stowing the arm")
        usual_m = self.context.robot.capabilities().standing_height_m
        if self.context.robot.odometry().X_OB.translation()[2] > usual_m + _RAISED_M:
            try:
                yield from self._come_near()
            except SkillFailure as failure:
                if failure.cause is not Cause.PLANNING:
                    raise
        yield from self.stand_at(usual_m, "standing as usual")
        how = yield from self._come_near()
        yield from self.feel_arm("stowing the arm")
        return Succeeded(how)

    def _come_near(self) -> Routine[str]:
        """Fold the empty arm, or draw in what it holds where that is far from the body; says how it is then."""
        if not self.context.robot.gripper().holding:
            yield from self.stow()
            return "the arm is stowed"
        X_BH = self.model.X_BH(self.q_rad())
        p_BH = X_BH.translation()
        arm = self.arm
        far = p_BH[0] > max(arm.carry_x_m) + _NEAR_X_M or p_BH[2] > max(arm.carry_z_m) + _NEAR_Z_M
        if far or np.abs(p_BH[1]) > 0.3:
            rotation = X_BH.rotation()
            yield from self.move_to(
                lambda scene, q: carry_configuration(scene, arm, rotation, q), "drawing in the arm", speed_rad_s=0.9
            )
        return "the object is held near the body"
