"""The approach skill: drives to where the arm can grasp an observed object, and observes the object again."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from typing import ClassVar

import numpy as np

from skills.api import FLOOR, Cause, ObjectObservation, Succeeded, Surface
from skills.detect.selection import DetectInputs
from skills.detect.skill import Detect
from skills.footprint import Footprint
from skills.manipulation.approach.base_placement import (
    BasePlacement,
    free_placements,
    go_to_one,
    is_comfortable,
    reachable_placements,
)
from skills.manipulation.arm.looking_skill import LookingSkill
from skills.manipulation.grasp.candidates import why_no_candidates
from skills.manipulation.grasp.reach import body_heights_m, choose_with_look, observed_target, reach_check
from skills.navigate.surroundings import NavigateInputs
from skills.quantities import Count, Length, Margin, Speed, Turn
from skills.robot import FloatArray, Pose2D
from skills.routine import Routine, SkillFailure

_STILL_BEFORE_M = 1.3
"""Largest distance from the object at which the robot stands before it."""


@dataclass(frozen=True)
class ApproachInputs:
    """Observed object, and the surfaces near it, including the one on which it lies."""

    observation: ObjectObservation
    surfaces: tuple[Surface, ...]


@dataclass(frozen=True)
class ApproachOptions:
    """Tolerances and speed of the drive, and the condition for the robot to stay where it is.

    `tries`: number of placements to which the robot tries to drive. `good_grasp`: the robot stays when the best grasp
    from its present pose costs at most this much more than the cheapest candidate.
    """

    position_tolerance_m: Length = 0.06
    yaw_tolerance_rad: Turn = 0.08
    speed_m_s: Speed = 0.5
    tries: Count = 3
    good_grasp: Margin = 0.1


class Approach(LookingSkill[ApproachInputs]):
    """Drives slowly, with the arm stowed, to where the arm can grasp an object, and observes the object again."""

    name = "approach"
    Inputs = ApproachInputs
    outputs: ClassVar[Mapping[str, type]] = {"observation": ObjectObservation}
    causes: ClassVar[Mapping[Cause, str]] = {
        Cause.PLANNING: "no free place to stand is near enough to the object, or no path leads there",
        Cause.EXECUTION: "the robot did not reach the place to stand",
        Cause.POSTCONDITION: "the object is not seen again from there",
    }
    default_timeout_s = 150.0
    max_data_age_s: ClassVar[Mapping[str, float]] = {"odometry": 0.5, "observation": 3.0}
    Options: ClassVar[type] = ApproachOptions
    options: ApproachOptions

    def run(self, inputs: ApproachInputs) -> Routine[Succeeded]:
        """Chooses a base placement, drives there and observes the object again."""
        seen = inputs.observation
        placements = yield from choose_with_look(self, seen, partial(self._choose, inputs))
        if not placements:
            raise SkillFailure(Cause.PLANNING, self._why_none(seen))
        if placements[0].pose != self.context.pose():
            yield from self.stow()
            yield from self.stand_as_usual()
            tolerances = (self.options.position_tolerance_m, self.options.yaw_tolerance_rad, self.options.speed_m_s)
            goals = [NavigateInputs(each.pose, *tolerances) for each in placements[: self.options.tries]]
            yield from go_to_one(self, goals)
        surfaces, on_floor = own_surfaces(inputs), seen.surface == FLOOR
        again = DetectInputs(
            (seen.kind.name,), surfaces, seen.kind.attributes, seen.position_W, floor=on_floor, seen_before=seen
        )
        found = yield from self.perform(Detect(self.context), again)
        return Succeeded(f"standing before the {seen.kind}", found.outputs)

    def _choose(self, inputs: ApproachInputs) -> Routine[tuple[list[BasePlacement], FloatArray]]:
        """Chooses base placements, best first, and points (N, 3, world) on the arm at the first one.

        The first placement is the present pose if its grasp is good enough.
        """
        context, seen = self.context, inputs.observation
        here, point_W = context.pose(), (seen.position_W[0], seen.position_W[1])
        comfortable, enough = is_comfortable(here, point_W, self.arm), self.options.good_grasp
        footprint, distances_m = Footprint.of(context.robot.capabilities()), self.arm.standing_m
        free = free_placements(point_W, here, context.free_space(), footprint, distances_m, distances_m[0])
        off_m = math.hypot(point_W[0] - here.x_m, point_W[1] - here.y_m)
        heights_m = body_heights_m(seen.position_W[2] - 0.5 * seen.size_m[2], context.robot.capabilities())
        check_now = reach_check(self, seen, own_surfaces(inputs), beyond_m=off_m)

        def choose() -> tuple[list[BasePlacement], FloatArray]:
            check = check_now()

            def cost_at(pose: Pose2D) -> float | None:
                best = check.best(pose.transform, heights_m)
                return None if best is None else best.cost

            from_here = cost_at(here) if comfortable else None
            well_here = from_here is not None and from_here <= enough
            placements = [BasePlacement(here, 0.0)] if well_here else reachable_placements(free, cost_at)
            arm_W = check.arm_W(placements[0].pose.transform, heights_m) if placements else np.empty((0, 3))
            return placements, arm_W

        message = "choosing where to stand"
        return (yield from self.compute(choose, latency_s=0.2, name="choose a place", message=message))

    def _why_none(self, seen: ObjectObservation) -> str:
        """Returns why there is no placement: the gripper cannot grasp the object, or no free pose is within reach."""
        target, p_BS = observed_target(seen, self.X_WB()), self.model.p_BS
        if self.context.stack.grasp_planner.candidates(target, p_BS=p_BS, gripper=self.gripper):
            return f"there is no free place to stand from which the {seen.kind} is within reach"
        return why_no_candidates(target, p_BS, self.gripper, str(seen.kind))

    def undone(self, inputs: ApproachInputs) -> str | None:
        """Returns a reason when the robot is far from the object."""
        (x, y, _), pose = inputs.observation.position_W, self.context.pose()
        off_m = math.hypot(x - pose.x_m, y - pose.y_m)
        return None if off_m < _STILL_BEFORE_M else f"the robot is {off_m:.1f} m from the {inputs.observation.kind}"


def own_surfaces(inputs: ApproachInputs) -> tuple[Surface, ...]:
    """Returns only the surface on which the object lies, or all given surfaces when that one is not among them."""
    return tuple(s for s in inputs.surfaces if s.name == inputs.observation.surface) or inputs.surfaces
