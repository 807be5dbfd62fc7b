"""Grasp planning: selects the first candidate that the arm can reach, approach and lift."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from pydrake.math import RigidTransform

from skills.manipulation.arm.collision import ArmScene, Box, gaps_m
from skills.manipulation.arm.kinematics import ArmModel
from skills.manipulation.arm.motion import ArmPlanner
from skills.manipulation.arm.poses import towards_shoulder
from skills.manipulation.grasp.candidates import GraspCandidate, grasp_candidates
from skills.manipulation.grasp.placements import Target
from skills.quantities import Margin, TurnRate
from skills.robot import ArmTrajectory, FloatArray, GripperCapabilities
from skills.world_model import IN_THE_WAY, ObjectObservation, PlanningError

PREGRASPS_M = (0.12, 0.07, 0.045)
"""Distances from the grasp at which the straight approach begins, the best first."""
LIFTS_M = ((0.12, 0.0), (0.1, 0.08), (0.07, 0.0), (0.06, 0.08), (0.05, 0.12), (0.045, 0.0), (0.03, 0.0))
"""Lifts: distances up and back towards the shoulder, the best first."""
_SLOW_POINTS, _SLOW_DOWN_POINTS = 3, 2
"""Number of points, a centimetre apart, of the approach that the hand passes slowly, and more slowly down."""
_OTHERS_TRIED = 3
"""Number of near objects that are checked for being in the way."""
_MOST_CANDIDATES = 40
"""Number of candidates to check again without the blocking objects."""
_OUT_OF_REACH = "out of reach"
_OFF_M = 0.015
"""Margin by which the object is smaller than its box in the check of the lift."""
_LIFT_STEP_M = 0.01
"""Distance between the checks of a lift."""
_LIFT_MARGIN_M = 0.002
"""Least gap between the lifted object and an obstacle."""
_DOWN = 0.8
"""Vertical component of a direction that counts as down."""
_LEVEL = 0.5
"""Horizontal component of the fingers' direction below which they point down."""
_ALIKE_RAD = 0.3
"""Largest difference of equal arm postures: a lift that fails from one fails from the other."""


@dataclass(frozen=True)
class GraspPlan:
    """Grasp with the motions to its pre-grasp and to the grasp, whose last stretch is slow, and the lift (B)."""

    candidate: GraspCandidate
    to_pregrasp: ArmTrajectory
    to_grasp: ArmTrajectory
    last_bit: ArmTrajectory
    lift_B: FloatArray


@dataclass(frozen=True)
class Obstacle:
    """Neighbour of the object to grasp: its observation and its boxes in B."""

    seen: ObjectObservation
    boxes: tuple[Box, ...]

    @property
    def centre_B(self) -> FloatArray:
        """Centre (3,) of the neighbour's boxes."""
        return np.asarray(np.mean([box.X_FG.translation() for box in self.boxes], axis=0))


@dataclass(frozen=True)
class Surroundings:
    """Obstacles around the object, and the object itself, as boxes in B; `up_B` points up in the body frame.

    `others` are the objects among the boxes. `name` and the arm's largest reach, `reach_m`, are for the message when
    there is no grasp.
    """

    boxes: Sequence[Box]
    target: Box
    up_B: FloatArray
    others: Sequence[Obstacle] = ()
    name: str = "object"
    reach_m: float = np.inf

    def lets_rise(self, lift_B: FloatArray) -> bool:
        """Returns whether the object can rise along `lift_B` without contact.

        The check shrinks the object's box a little, so that its support and neighbours do not touch it. A box that
        still overlaps is part of the object: viewed from high up, a screwdriver's shaft is detected as an object next
        to the handle.
        """
        steps = np.linspace(0.0, 1.0, 2 + int(np.linalg.norm(lift_B) / _LIFT_STEP_M))
        x, y, z = (max(side - 2.0 * _OFF_M, 0.005) for side in self.target.size_m)
        gaps = gaps_m(Box(self.target.X_FG, (x, y, z)), self.boxes, steps[:, None] * lift_B)
        return bool(np.all((gaps > _LIFT_MARGIN_M) | (gaps[0] < 0.0)))

    def without(self, others: Sequence[Obstacle]) -> Surroundings:
        """Returns the surroundings without `others`."""
        gone = {id(box) for other in others for box in other.boxes}
        return replace(self, boxes=[box for box in self.boxes if id(box) not in gone])


@dataclass(frozen=True)
class GeometricGraspPlanner:
    """Plans grasps from the object's outline: selects the first candidate that the arm can reach, approach and lift.

    `padding_m` and `final_padding_m`: clearance of the hand from obstacles on its path, and on the straight approach.
    `approach_rad_s` and `last_rad_s`: joint speed limits on the approach, and on its last stretch; `touch_rad_s` on a
    last stretch down to a surface. `beside_fixed_m` and `beside_fixed_low_m`: gap at the fixed finger, and the gap for
    low objects, which would stop a finger that lands on them.
    """

    padding_m: Margin = 0.01
    final_padding_m: Margin = 0.002
    approach_rad_s: TurnRate = 0.5
    last_rad_s: TurnRate = 0.15
    touch_rad_s: TurnRate = 0.05
    beside_fixed_m: Margin = 0.010
    beside_fixed_low_m: Margin = 0.017

    def candidates(self, target: Target, p_BS: FloatArray, gripper: GripperCapabilities) -> list[GraspCandidate]:
        """Returns grasps, the best first; none for an object that is too wide or too flat. p_BS is the shoulder."""
        return grasp_candidates(target, p_BS, gripper, (self.beside_fixed_m, self.beside_fixed_low_m))

    def plan(
        self,
        scene: ArmScene,
        q_start_rad: FloatArray,
        candidates: Sequence[GraspCandidate],
        around: Surroundings,
        arm_planner: ArmPlanner,
        rng: np.random.Generator,
    ) -> GraspPlan:
        """Plans the best feasible candidate. Raises PlanningError with the reason when there is none."""
        reasons = list[str]()
        for candidate in candidates:
            try:
                approach, lift_B = self._reached(scene, q_start_rad, candidate, around, arm_planner)
                scene.set_boxes([*around.boxes, around.target])
                scene.set_padding(self.padding_m)
                path = arm_planner.path(scene, q_start_rad, approach[0], rng)
            except PlanningError as error:
                reasons.append(str(error))
                continue
            down = float(candidate.X_BH.rotation().matrix()[2, 0]) < -_DOWN
            last_rad_s, slow = (self.touch_rad_s, _SLOW_DOWN_POINTS) if down else (self.last_rad_s, _SLOW_POINTS)
            to_grasp = arm_planner.trajectory(approach[:-slow], speed_rad_s=self.approach_rad_s)
            last_bit = arm_planner.trajectory(approach[-slow - 1 :], speed_rad_s=last_rad_s)
            return GraspPlan(candidate, arm_planner.trajectory(path, scene=scene), to_grasp, last_bit, lift_B)
        if reasons and set(reasons) == {_OUT_OF_REACH}:
            raise PlanningError(_out_of_reach(scene.model, around))
        in_the_way = self._in_the_way(scene, q_start_rad, candidates, around, arm_planner)
        if in_the_way:
            outputs = {IN_THE_WAY: tuple(other.seen for other in in_the_way)}
            raise PlanningError(_behind(scene.model, around, in_the_way), outputs)
        last = f": {max(sorted(set(reasons)), key=reasons.count)}" if reasons else ""
        raise PlanningError(f"none of {len(candidates)} grasps of the {around.name} is within reach and free{last}")

    def _in_the_way(
        self,
        scene: ArmScene,
        q_near_rad: FloatArray,
        candidates: Sequence[GraspCandidate],
        around: Surroundings,
        arm_planner: ArmPlanner,
    ) -> tuple[Obstacle, ...]:
        """Returns the one object, or all near ones, that block every grasp, nearest first; empty when none blocks.

        Checks only the best candidates again.
        """

        def graspable(space: Surroundings) -> bool:
            for candidate in candidates[:_MOST_CANDIDATES]:
                with suppress(PlanningError):
                    self._reached(scene, q_near_rad, candidate, space, arm_planner)
                    return True
            return False

        p_BT = around.target.X_FG.translation()
        near = sorted(around.others, key=lambda other: float(np.linalg.norm(other.centre_B - p_BT)))[:_OTHERS_TRIED]
        if not near or graspable(around) or not graspable(around.without(near)):
            return ()
        return next(((other,) for other in near if graspable(around.without([other]))), tuple(near))

    def _reached(
        self,
        scene: ArmScene,
        q_near_rad: FloatArray,
        candidate: GraspCandidate,
        around: Surroundings,
        arm_planner: ArmPlanner,
    ) -> tuple[FloatArray, FloatArray]:
        """Returns the straight approach from the pre-grasp, and the lift (B). Raises PlanningError without them."""
        scene.set_boxes(around.boxes)
        scene.set_padding(self.final_padding_m)
        reason, no_lift_rad = _OUT_OF_REACH, list[FloatArray]()
        for distance in PREGRASPS_M:
            solutions = scene.model.inverse(candidate.retreat(distance), margin_rad=0.06)
            turned = [scene.model.turned_near(q, q_near_rad) for q in solutions]
            for q in sorted(turned, key=lambda q: float(np.max(np.abs(q - q_near_rad)))):
                if not scene.free(q):
                    reason = "the hand would touch something before the grasp"
                    continue
                try:
                    approach = arm_planner.line(scene.model, q, candidate.X_BH, scene)
                    if not any(np.max(np.abs(approach[-1] - other)) < _ALIKE_RAD for other in no_lift_rad):
                        no_lift_rad.append(approach[-1])
                        return approach, _lift(scene, approach[-1], around, arm_planner)
                except PlanningError as error:
                    reason = str(error)
        raise PlanningError(reason)


def _out_of_reach(model: ArmModel, around: Surroundings) -> str:
    off_m = float(np.linalg.norm(around.target.X_FG.translation() - model.p_BS))
    where = f"the {around.name} is out of reach: {off_m:.2f} m from the shoulder"
    if off_m > around.reach_m:
        return f"{where}, and the arm reaches {around.reach_m:.2f} m"
    return f"{where}, and the arm does not turn the hand there as a grasp needs it"


def _behind(model: ArmModel, around: Surroundings, others: Sequence[Obstacle]) -> str:
    """Returns the message on blocking objects: in front, as seen from the shoulder, or close to the object's side."""
    p_ST = around.target.X_FG.translation() - model.p_BS
    before = any((other.centre_B - model.p_BS) @ p_ST < p_ST @ p_ST for other in others)
    names = " and ".join(f"the {other.seen.kind}" for other in others)
    return f"the {around.name} is {'behind' if before else 'too near'} {names}"


def within_reach(model: ArmModel, candidate: GraspCandidate, up_B: FloatArray, margin_rad: float = 0.08) -> bool:
    """Returns whether the arm reaches a grasp, its pre-grasp and the end of its lift; ignores contact."""
    X_BH, distance = candidate.X_BH, PREGRASPS_M[-1]
    if not (model.reaches(X_BH, margin_rad) and model.reaches(candidate.retreat(distance), margin_rad)):
        return False
    lifted = (X_BH.translation() + offset for offset in lifts(model, X_BH, up_B))
    return any(model.reaches(RigidTransform(X_BH.rotation(), p), margin_rad) for p in lifted)


def lifts(model: ArmModel, X_BH: RigidTransform, up_B: FloatArray) -> list[FloatArray]:
    """Returns lift offsets from a grasp (B), the best first."""
    back = towards_shoulder(model.p_BS, X_BH.translation())
    return [up_m * up_B + back_m * back for up_m, back_m in LIFTS_M]


def _lift(scene: ArmScene, q_rad: FloatArray, around: Surroundings, arm_planner: ArmPlanner) -> FloatArray:
    """Returns the first lift that the arm can follow without contact. Raises PlanningError when there is none."""
    X_BH = scene.model.X_BH(q_rad)
    for lift_B in lifts(scene.model, X_BH, around.up_B):
        if not around.lets_rise(lift_B):
            continue
        with suppress(PlanningError):
            lifted = RigidTransform(X_BH.rotation(), X_BH.translation() + lift_B)
            arm_planner.line(scene.model, q_rad, lifted, scene)
            return lift_B
    raise PlanningError("the arm cannot lift the object from there")


def pull_back_B(X_BH: RigidTransform, p_BS: FloatArray) -> FloatArray:
    """Horizontal direction out of a grasp: against the fingers, or towards the shoulder where they point down."""
    against = -X_BH.rotation().matrix()[:, 0] * [1.0, 1.0, 0.0]
    if np.linalg.norm(against) < _LEVEL:
        against = (p_BS - X_BH.translation()) * [1.0, 1.0, 0.0]
    return np.asarray(against / np.linalg.norm(against))


class GraspPlanner(Protocol):
    """Plans grasps and the motions to them."""

    def candidates(self, target: Target, p_BS: FloatArray, gripper: GripperCapabilities) -> list[GraspCandidate]:
        """Returns grasp candidates, the best first; an empty list for an object that is too wide or too flat.

        `p_BS` is the position of the shoulder.
        """

    def plan(
        self,
        scene: ArmScene,
        q_start_rad: FloatArray,
        candidates: Sequence[GraspCandidate],
        around: Surroundings,
        arm_planner: ArmPlanner,
        rng: np.random.Generator,
    ) -> GraspPlan:
        """Plans the best feasible candidate. Raises PlanningError when none is feasible."""
