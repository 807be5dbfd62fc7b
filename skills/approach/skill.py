"""The approach skill: stand where the object seen can be grasped, then look at it again."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import ClassVar

import numpy as np
from pydrake.math import RigidTransform

from skills.api import FLOOR, Cause, ObjectObservation, Succeeded, Surface
from skills.approach.standing import Standing, free_places, go_to_one, is_comfortable, reachable
from skills.arm.arm_skill import ArmSkill
from skills.arm.kinematics import ArmModel
from skills.arm.routine import Routine, SkillFailure
from skills.detect.skill import Detect, DetectInputs
from skills.grasp.candidates import GraspCandidate, Target
from skills.grasp.planning import body_height_m, within_reach
from skills.navigate.footprint import Footprint
from skills.navigate.skill import NavigateInputs
from skills.quantities import Count, Length, Margin, Speed, Turn
from skills.robot import Pose2D

_STILL_BEFORE_M = 1.3


@dataclass(frozen=True)
class ApproachInputs:
    """The object as it was seen, and the surfaces near it, including the one that it lies on."""

    observation: ObjectObservation
    surfaces: tuple[Surface, ...]


@dataclass(frozen=True)
class ApproachOptions:
    """How exactly and how fast the robot goes before the object.

    It goes to the first of `tries` places to which a path leads. Where the best grasp from here costs no more than
    `good_grasp` above the best there is, it stays.
    """

    position_tolerance_m: Length = 0.06
    yaw_tolerance_rad: Turn = 0.08
    speed_m_s: Speed = 0.5
    tries: Count = 3
    good_grasp: Margin = 0.1


class Approach(ArmSkill[ApproachInputs]):
    """Drives slowly, arm stowed, to where the arm can grasp an object, and looks at the object again."""

    name = "approach"
    Inputs = ApproachInputs
    Options: ClassVar[type] = ApproachOptions
    options: ApproachOptions
    outputs: ClassVar[Mapping[str, type]] = {"observation": ObjectObservation}
    causes: ClassVar[Mapping[Cause, str]] = {
        Cause.PLANNING: "no free place to stand is near enough to the object, or no path leads there",
        Cause.EXECUTION: "the robot did not reach the place to stand",
        Cause.POSTCONDITION: "the object is not seen again from there",
    }
    default_timeout_s = 150.0
    max_data_age_s: ClassVar[Mapping[str, float]] = {"odometry": 0.5, "observation": 3.0}

    def run(self, inputs: ApproachInputs) -> Routine[Succeeded]:
        """Choose a place, go, look again."""
        seen = inputs.observation
        point_W = (seen.position_W[0], seen.position_W[1])
        here = self.context.pose()
        from_here = self._reach_cost(seen)(here) if is_comfortable(here, point_W) else None
        if from_here is None or from_here > self.options.good_grasp:
            free, reach_cost = self._free_places(seen), self._reach_cost(seen)
            places = yield from self.compute(
                lambda: reachable(free, reach_cost),
                latency_s=0.2,
                name="choose a place",
                message="choosing where to stand",
            )
            if not places:
                raise SkillFailure(Cause.PLANNING, self._why_none(seen))
            yield from self.stow()
            tolerances = (self.options.position_tolerance_m, self.options.yaw_tolerance_rad, self.options.speed_m_s)
            goals = [NavigateInputs(place.pose, *tolerances) for place in places[: self.options.tries]]
            yield from go_to_one(self, goals)
        return (yield from self._look_again(inputs))

    def undone(self, inputs: ApproachInputs) -> str | None:
        """Judged by the robot's pose."""
        (x, y, _), pose = inputs.observation.position_W, self.context.pose()
        off_m = math.hypot(x - pose.x_m, y - pose.y_m)
        return None if off_m < _STILL_BEFORE_M else f"the robot is {off_m:.1f} m from the {inputs.observation.thing}"

    def _look_again(self, inputs: ApproachInputs) -> Routine[Succeeded]:
        seen = inputs.observation
        surfaces = tuple(s for s in inputs.surfaces if s.name == seen.surface) or inputs.surfaces
        on_floor = seen.surface == FLOOR
        again = DetectInputs((seen.thing.name,), surfaces, seen.thing.attributes, seen.position_W, floor=on_floor)
        found = yield from self.perform(Detect(self.context), again)
        return Succeeded(f"standing before the {seen.thing}", found.outputs)

    def _free_places(self, seen: ObjectObservation) -> list[Standing]:
        context = self.context
        point_W = (seen.position_W[0], seen.position_W[1])
        footprint = Footprint.of(context.robot.capabilities())
        return free_places(point_W, context.pose(), context.costmap, footprint)

    def _why_none(self, seen: ObjectObservation) -> str:
        """Whether the object itself is beyond the gripper, or only the places about it are."""
        candidates = self.context.stack.grasp_planner.candidates
        if candidates(observed_target(seen, self.X_WB()), p_BS=self.model.p_BS, gripper=self.gripper):
            return f"there is no free place to stand from which the {seen.thing} is within reach"
        size_mm = " x ".join(f"{1000 * side:.0f}" for side in seen.size_m)
        return f"the gripper cannot take hold of the {seen.thing} as it lies ({size_mm} mm)"

    def _reach_cost(self, seen: ObjectObservation) -> Callable[[Pose2D], float | None]:
        base_m = seen.position_W[2] - 0.5 * seen.size_m[2]
        model = self.model
        candidates = partial(self.context.stack.grasp_planner.candidates, p_BS=model.p_BS, gripper=self.gripper)
        height_m = body_height_m(base_m, self.context.robot.capabilities())
        return lambda pose: grasp_cost(model, candidates, pose.transform(height_m), seen)


def grasp_cost(
    model: ArmModel,
    candidates_of: Callable[[Target], list[GraspCandidate]],
    X_WB: RigidTransform,
    seen: ObjectObservation,
) -> float | None:
    """Cost of the best grasp of an object that the arm reaches with the body at X_WB, beyond the best there is.

    None when it reaches no grasp.
    """
    up_B = X_WB.rotation().matrix().T @ np.array([0.0, 0.0, 1.0])
    candidates = candidates_of(observed_target(seen, X_WB))
    reached = (candidate.cost for candidate in candidates if within_reach(model, candidate, up_B))
    best = next(reached, None)
    return None if best is None else best - candidates[0].cost


def observed_target(seen: ObjectObservation, X_WB: RigidTransform) -> Target:
    """An observation as a grasp target: its box filled with points."""
    length, width, height = seen.size_m
    X_BW = X_WB.inverse()
    base_m = float((X_BW @ np.array(seen.position_W))[2]) - 0.5 * height
    turn = RigidTransform(X_BW.rotation())
    axis = turn @ np.array([np.cos(seen.yaw_rad), np.sin(seen.yaw_rad), 0.0])
    yaw = float(np.arctan2(axis[1], axis[0]))
    grid = np.stack(np.meshgrid(np.linspace(-0.5, 0.5, 41), np.linspace(-0.5, 0.5, 7)), axis=-1).reshape(-1, 2)
    along = np.array([[np.cos(yaw), np.sin(yaw)], [-np.sin(yaw), np.cos(yaw)]])
    centre = (X_BW @ np.array(seen.position_W))[:2]
    xy = centre + (grid * [length, min(width, 0.06)]) @ along
    points = np.column_stack([xy, np.full(len(xy), base_m + height)])
    is_round = height > 0.075 and length < 1.2 * width
    return Target(points, (float(centre[0]), float(centre[1])), yaw, length, width, height, base_m, is_round)
