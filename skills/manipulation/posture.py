"""Skills that move only the arm: stow folds it onto the body; pose_arm moves it to joint angles saved by teleop."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from skills.api import Cause, Part, Succeeded
from skills.manipulation.arm.arm_skill import GRIPPER_FORCE_N, ArmSkill
from skills.quantities import Angle, Turn
from skills.routine import PlanningAttempt, Routine, SkillFailure

_RAISED_M = 0.01
"""Height above the usual one beyond which the body counts as raised."""
_THERE_RAD = 0.05
"""Largest error of a joint angle at which the arm has reached its pose."""


@dataclass(frozen=True)
class StowInputs:
    """No inputs."""


class Stow(ArmSkill[StowInputs]):
    """Brings the arm near the body, and the body to its usual height. An arm that is near the body stays there."""

    name = "stow"
    Inputs = StowInputs
    uses: ClassVar[frozenset[Part]] = frozenset({Part.ARM})
    causes: ClassVar[Mapping[Cause, str]] = {
        Cause.PLANNING: "the arm finds no free path",
        Cause.EXECUTION: "the arm did not reach its goal",
    }
    default_timeout_s = 30.0
    max_data_age_s: ClassVar[Mapping[str, float]] = {"joints": 0.5, "gripper": 0.5}

    def run(self, inputs: StowInputs) -> Routine[Succeeded]:
        """Folds the empty arm or draws in the held object.

        It weighs what shut jaws hold before the levers of a folded arm are short. On a raised body the arm moves first,
        because it would press on obstacles below while the body sinks.
        """
        if self.context.robot.capabilities().arm is None:
            return Succeeded("there is no arm to stow")
        yield from self.feel_arm("stowing the arm")
        holding = yield from self.holds("feeling what the gripper holds")
        usual_m = self.context.robot.capabilities().standing_height_m
        if self.context.robot.odometry().X_OB.translation()[2] > usual_m + _RAISED_M:
            with PlanningAttempt():
                yield from self._come_near()
        yield from self.stand_at(usual_m, "standing as usual")
        yield from self._come_near()
        yield from self.feel_arm("stowing the arm")
        return Succeeded("the object is held near the body" if holding else "the arm is stowed")

    def _come_near(self) -> Routine[None]:
        """Folds the empty arm, or draws in an object that is far from the body."""
        if not self.context.robot.gripper().holding:
            yield from self.stow()
            return
        yield from self.draw_near(self.model.X_BH(self.q_rad()).rotation())


@dataclass(frozen=True)
class PoseArmInputs:
    """Joint angles from the shoulder on, and an opening (0 closed); None, or a held object, keeps the opening."""

    joints_rad: tuple[Angle, ...]
    opening: Turn | None = None


class PoseArm(ArmSkill[PoseArmInputs]):
    """Moves the arm on a free path to joint angles, then the gripper to an opening."""

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
