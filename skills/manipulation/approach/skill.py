"""The approach skill: stand where the object seen can be grasped, then look at it again."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from skills.api import FLOOR, Cause, ObjectObservation, Succeeded, Surface
from skills.detect.ports import DetectInputs
from skills.detect.skill import Detect
from skills.manipulation.approach.ports import ApproachInputs, ApproachPorts
from skills.manipulation.approach.standing import Standing, free_places, go_to_one, is_comfortable, reachable
from skills.manipulation.arm.looking_skill import LookingSkill
from skills.manipulation.grasp.reach import body_heights_m, observed_target, reach_check
from skills.manipulation.grasp.refusals import without_grasp
from skills.manipulation.grasp.unseen import look_into_unseen
from skills.navigate.footprint import Footprint
from skills.navigate.ports import NavigateInputs
from skills.quantities import Count, Length, Margin, Speed, Turn
from skills.robot import FloatArray, Pose2D
from skills.routine import Routine, SkillFailure

_STILL_BEFORE_M = 1.3


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


class Approach(ApproachPorts, LookingSkill[ApproachInputs]):
    """The skill that `ApproachPorts` declares."""

    Options: ClassVar[type] = ApproachOptions
    options: ApproachOptions

    def run(self, inputs: ApproachInputs) -> Routine[Succeeded]:
        """Choose a place, go, look again."""
        seen = inputs.observation
        places = yield from self._places(inputs)
        if not places:
            raise SkillFailure(Cause.PLANNING, self._why_none(seen))
        if places[0].pose != self.context.pose():
            yield from self.stow()
            yield from self.stand_as_usual()
            tolerances = (self.options.position_tolerance_m, self.options.yaw_tolerance_rad, self.options.speed_m_s)
            goals = [NavigateInputs(place.pose, *tolerances) for place in places[: self.options.tries]]
            yield from go_to_one(self, goals)
        return (yield from self._look_again(inputs))

    def _places(self, inputs: ApproachInputs) -> Routine[list[Standing]]:
        """Where to stand, best first, once the space where the arm would go from there was looked into."""
        places, arm_W = yield from self._choose(inputs)
        if (yield from look_into_unseen(self, inputs.observation, arm_W)):
            places, _ = yield from self._choose(inputs)
        return places

    def _choose(self, inputs: ApproachInputs) -> Routine[tuple[list[Standing], FloatArray]]:
        """Where to stand as far as is known, best first, and where (points, world) the arm would be there.

        The first is where the robot stands already, when that is good enough.
        """
        seen, here, enough = inputs.observation, self.context.pose(), self.options.good_grasp
        comfortable = is_comfortable(here, (seen.position_W[0], seen.position_W[1]), self.arm)
        free, off_m = self._free_places(seen), math.hypot(seen.position_W[0] - here.x_m, seen.position_W[1] - here.y_m)
        heights_m = body_heights_m(seen.position_W[2] - 0.5 * seen.size_m[2], self.context.robot.capabilities())
        check_now = reach_check(self, seen, own_surfaces(inputs), beyond_m=off_m)

        def choose() -> tuple[list[Standing], FloatArray]:
            """The places and the arm there, by one collision scene for all poses."""
            check = check_now()

            def cost_at(pose: Pose2D) -> float | None:
                best = check.best(pose.transform, heights_m)
                return None if best is None else best.cost

            from_here = cost_at(here) if comfortable else None
            well_here = from_here is not None and from_here <= enough
            places = [Standing(here, 0.0)] if well_here else reachable(free, cost_at)
            return places, check.arm_W(places[0].pose.transform, heights_m) if places else np.empty((0, 3))

        return (
            yield from self.compute(choose, latency_s=0.2, name="choose a place", message="choosing where to stand")
        )

    def undone(self, inputs: ApproachInputs) -> str | None:
        """Judged by the robot's pose."""
        (x, y, _), pose = inputs.observation.position_W, self.context.pose()
        off_m = math.hypot(x - pose.x_m, y - pose.y_m)
        return None if off_m < _STILL_BEFORE_M else f"the robot is {off_m:.1f} m from the {inputs.observation.kind}"

    def _look_again(self, inputs: ApproachInputs) -> Routine[Succeeded]:
        seen = inputs.observation
        surfaces, on_floor = own_surfaces(inputs), seen.surface == FLOOR
        again = DetectInputs(
            (seen.kind.name,),
            surfaces,
            seen.kind.attributes,
            seen.position_W,
            floor=on_floor,
            seen_before=seen,
        )
        found = yield from self.perform(Detect(self.context), again)
        return Succeeded(f"standing before the {seen.kind}", found.outputs)

    def _free_places(self, seen: ObjectObservation) -> list[Standing]:
        context = self.context
        point_W = (seen.position_W[0], seen.position_W[1])
        footprint = Footprint.of(context.robot.capabilities())
        distances_m = self.arm.standing_m
        return free_places(point_W, context.pose(), context.costmap, footprint, distances_m, distances_m[0])

    def _why_none(self, seen: ObjectObservation) -> str:
        """Returns whether the object itself is beyond the gripper, or only the places about it are."""
        target, p_BS = observed_target(seen, self.X_WB()), self.model.p_BS
        if self.context.stack.grasp_planner.candidates(target, p_BS=p_BS, gripper=self.gripper):
            return f"there is no free place to stand from which the {seen.kind} is within reach"
        return without_grasp(target, p_BS, self.gripper, str(seen.kind))


def own_surfaces(inputs: ApproachInputs) -> tuple[Surface, ...]:
    """The surface that the object lies on, or all that are given where it is not among them."""
    return tuple(s for s in inputs.surfaces if s.name == inputs.observation.surface) or inputs.surfaces
