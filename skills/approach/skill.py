"""The approach skill: stand where the object seen can be grasped, then look at it again."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

from skills.api import FLOOR, Cause, ObjectObservation, Succeeded, Surface
from skills.approach.standing import Standing, free_places, go_to_one, is_comfortable, reachable
from skills.arm.arm_skill import ArmSkill
from skills.arm.routine import Routine, SkillFailure
from skills.detect.skill import Detect, DetectInputs
from skills.grasp.reach import body_heights_m, observed_target, reach_check
from skills.grasp.refusals import without_grasp
from skills.navigate.footprint import Footprint
from skills.navigate.skill import NavigateInputs
from skills.quantities import Count, Length, Margin, Speed, Turn
from skills.robot import Pose2D

_STILL_BEFORE_M = 1.3
ReachCost = Callable[[Pose2D], float | None]


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
        places = yield from self._places(inputs)
        if not places:
            raise SkillFailure(Cause.PLANNING, self._why_none(seen))
        if places[0].pose != self.context.pose():
            yield from self.stow()
            tolerances = (self.options.position_tolerance_m, self.options.yaw_tolerance_rad, self.options.speed_m_s)
            goals = [NavigateInputs(place.pose, *tolerances) for place in places[: self.options.tries]]
            yield from go_to_one(self, goals)
        return (yield from self._look_again(inputs))

    def _places(self, inputs: ApproachInputs) -> Routine[list[Standing]]:
        """Where to stand, best first: where the robot stands already, when that is good enough."""
        seen, here, enough = inputs.observation, self.context.pose(), self.options.good_grasp
        comfortable = is_comfortable(here, (seen.position_W[0], seen.position_W[1]))
        free, reach_cost = self._free_places(seen), self._reach_cost(seen, own_surfaces(inputs))

        def choose() -> list[Standing]:
            cost_at = reach_cost()
            from_here = cost_at(here) if comfortable else None
            return [Standing(here, 0.0)] if from_here is not None and from_here <= enough else reachable(free, cost_at)

        return (
            yield from self.compute(choose, latency_s=0.2, name="choose a place", message="choosing where to stand")
        )

    def undone(self, inputs: ApproachInputs) -> str | None:
        """Judged by the robot's pose."""
        (x, y, _), pose = inputs.observation.position_W, self.context.pose()
        off_m = math.hypot(x - pose.x_m, y - pose.y_m)
        return None if off_m < _STILL_BEFORE_M else f"the robot is {off_m:.1f} m from the {inputs.observation.thing}"

    def _look_again(self, inputs: ApproachInputs) -> Routine[Succeeded]:
        seen = inputs.observation
        surfaces, on_floor = own_surfaces(inputs), seen.surface == FLOOR
        again = DetectInputs(
            (seen.thing.name,),
            surfaces,
            seen.thing.attributes,
            seen.position_W,
            floor=on_floor,
            seen_before=seen,
        )
        found = yield from self.perform(Detect(self.context), again)
        return Succeeded(f"standing before the {seen.thing}", found.outputs)

    def _free_places(self, seen: ObjectObservation) -> list[Standing]:
        context = self.context
        point_W = (seen.position_W[0], seen.position_W[1])
        footprint = Footprint.of(context.robot.capabilities())
        return free_places(point_W, context.pose(), context.costmap, footprint)

    def _why_none(self, seen: ObjectObservation) -> str:
        """Whether the object itself is beyond the gripper, or only the places about it are."""
        target, p_BS = observed_target(seen, self.X_WB()), self.model.p_BS
        if self.context.stack.grasp_planner.candidates(target, p_BS=p_BS, gripper=self.gripper):
            return f"there is no free place to stand from which the {seen.thing} is within reach"
        return without_grasp(target, p_BS, self.gripper, str(seen.thing))

    def _reach_cost(self, seen: ObjectObservation, surfaces: Sequence[Surface]) -> Callable[[], ReachCost]:
        """Gives, inside a Worker job, what a grasp of the object costs from a pose: None where none is reached."""
        base_m, pose = seen.position_W[2] - 0.5 * seen.size_m[2], self.context.pose()
        off_m = math.hypot(seen.position_W[0] - pose.x_m, seen.position_W[1] - pose.y_m)
        heights_m = body_heights_m(base_m, self.context.robot.capabilities())
        check_now = reach_check(self, seen, surfaces, beyond_m=off_m)

        def prepared() -> ReachCost:
            """The cost by pose; all poses share one collision scene."""
            check = check_now()

            def cost(pose: Pose2D) -> float | None:
                best = check.best(pose.transform, heights_m)
                return None if best is None else best.cost

            return cost

        return prepared


def own_surfaces(inputs: ApproachInputs) -> tuple[Surface, ...]:
    """The surface that the object lies on, or all that are given where it is not among them."""
    return tuple(s for s in inputs.surfaces if s.name == inputs.observation.surface) or inputs.surfaces
