"""Base of the skills that release the held object: they open the gripper, check its force, and draw back."""

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import ClassVar

import numpy as np
from pydrake.math import RigidTransform

from skills.api import Cause, Failed, InputsT, Running, Step
from skills.manipulation.arm.arm_skill import GRIPPER_FORCE_N
from skills.manipulation.arm.looking_skill import LookingSkill
from skills.manipulation.arm.poses import UP_B, towards_shoulder
from skills.quantities import Coordinate, Height
from skills.robot import FloatArray, GripperKind
from skills.routine import Routine

_RELEASE_RAD = 0.55
"""Opening at which the fingertip passes a bottle; a wider one would reach neighbours."""
_WIDE = 0.75
"""Largest opening of a hinged gripper for a release, as a fraction of the maximum opening."""
_ASIDE_M = 0.018
"""Distance of fixed finger and palm from the object before the hand draws back, so that they do not drag it."""
_LEVEL = 0.5
"""A closing direction with a smaller vertical component is level."""
_BACK_M = (0.16, 0.12, 0.08, 0.05)
"""Distances by which the hand is drawn back, the best first."""
_STILL_S = 0.5
"""Pause in which hand and object come to rest."""
_FREE_S = 2.0
"""Time that the open gripper has to become empty."""
_SHAKE_RAD = (0.35, -0.35, 0.35, -0.35)
_SHAKE_RAD_S = 3.0
_CALM_S = 0.2
"""Pause before weighing, in which the arm comes to rest."""
_STILL_HELD = 0.5
"""Least part of the object's weight on the arm at which it still hangs on the hand."""
_LEAST_KG = 0.06
"""Least mass that weighing can tell from nothing."""


class ReleasingSkill(LookingSkill[InputsT]):
    """Routine that releases the held object.

    Its result has the output `released_W`, the point of the release. Every failure after the release has the cause
    POSTCONDITION, because the robot must then search for the object.
    """

    outputs: ClassVar[Mapping[str, type]] = {"released_W": tuple[Coordinate, Coordinate, Height]}
    max_data_age_s: ClassVar[Mapping[str, float]] = {"joints": 0.5, "gripper": 0.5}
    changes_world = True
    gripper_before = True
    gripper_after = False

    def step(self) -> Step:
        """Continues the routine; adds the point of the release to its result."""
        step, released_W = super().step(), self.checkpoint.get("released_W")
        if isinstance(step, Running) or released_W is None:
            return step
        ended = replace(step, outputs={**step.outputs, "released_W": tuple(released_W)})
        if isinstance(ended, Failed) and ended.cause in (Cause.PLANNING, Cause.EXECUTION):
            return replace(ended, cause=Cause.POSTCONDITION)
        return ended

    def end(self) -> None:
        """Resets `Payload.offered`."""
        self.context.payload.offered = False
        super().end()

    def release_opening(self) -> float:
        """Opening at which the gripper releases the held object."""
        most = _WIDE if self.gripper.kind is GripperKind.HINGED else 1.0
        release = self.context.robot.gripper().opening + self.gripper.like_turn(_RELEASE_RAD)
        return min(release, most * self.gripper.widest)

    def open_hand(self, message: str) -> Routine[bool]:
        """Opens the gripper just far enough; returns whether it then feels no object."""
        self.context.payload.offered = True  # the jaws leave a sticking object so slowly that it seems to slip, or lost
        yield from self.move_gripper(self.release_opening(), GRIPPER_FORCE_N, message)
        released_W = self.X_WB() @ self.model.X_BH(self.q_rad()) @ self.p_HT
        self.checkpoint = {**self.checkpoint, "released_W": released_W.tolist()}
        free = yield from self._feels_nothing(message)
        yield from self.pause(_STILL_S, message)
        return free

    def shake_off(self, message: str, *, turns_hand: bool) -> Routine[bool]:
        """Opens and closes the jaws a little, wide at the end, to shake off an object that sticks to a finger.

        With `turns_hand` the hand also turns to and fro. Returns whether the gripper then feels no object.
        """
        wide = _WIDE * self.gripper.widest
        for opening in (wide, wide - self.gripper.like_turn(_RELEASE_RAD), wide):
            yield from self.move_gripper(opening, GRIPPER_FORCE_N, message)
        if turns_hand:
            q, wrist = self.q_rad(), np.eye(len(self.model.names))[-1]
            turns = [q + turn_rad * wrist for turn_rad in _SHAKE_RAD]
            inside = [each for each in turns if np.all((each > self.model.lower_rad) & (each < self.model.upper_rad))]
            path = np.array([q, *inside, q])
            yield from self.follow(self.context.stack.arm_planner.trajectory(path, speed_rad_s=_SHAKE_RAD_S), message)
        yield from self.pause(_STILL_S, message)
        return (yield from self._feels_nothing(message))

    def _feels_nothing(self, message: str) -> Routine[bool]:
        """Waits until the gripper feels no object; returns False when it still feels one after the time limit."""
        end_s = self.context.clock.now() + _FREE_S
        while self.context.robot.gripper().holding:
            if self.context.clock.now() > end_s:
                return False
            yield Running(message)
        return True

    def hangs_on_hand(self, held_kg: float | None, message: str) -> Routine[bool]:
        """Returns whether the arm still bears most of the held weight; False for a weight too small to measure."""
        if held_kg is None or held_kg < _LEAST_KG:
            return False
        yield from self.pause(_CALM_S, message)
        return (yield from self.weigh(self.p_HT, message)) > max(_STILL_HELD * held_kg, _LEAST_KG)

    def leave_object(self) -> Routine[bool]:
        """Moves fixed finger and palm off a released object and draws the hand back; returns whether a path was found.

        Two moving fingers are off the object already.
        """
        X_BH = self.model.X_BH(self.q_rad())
        fingers, _, closing = X_BH.rotation().matrix().T
        if abs(closing[2]) < _LEVEL and self.gripper.kind is GripperKind.HINGED:
            aside = -_ASIDE_M * (closing * [1.0, 1.0, 0.0] + fingers)
            yield from self.try_shift_hand(aside, "letting go")
        return (yield from self.shift_by_first(retreats_B(X_BH, self.model.p_BS), "drawing the hand back"))


def retreats_B(X_BH: RigidTransform, p_BS: FloatArray) -> list[FloatArray]:
    """Offsets of the hand (B) away from a released object, best first: back along the fingers, up, up and back.

    The last ones point towards the shoulder at p_BS: a stretched arm has no other retreat.
    """
    up_and_back_B = math.sqrt(0.5) * (UP_B + towards_shoulder(p_BS, X_BH.translation()))
    directions_B = (-X_BH.rotation().matrix()[:, 0], UP_B, up_and_back_B)
    return [back_m * direction_B for direction_B in directions_B for back_m in _BACK_M]
