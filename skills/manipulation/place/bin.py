"""Release of the held object into a bin, and the check by the object camera that it lies inside."""

from __future__ import annotations

import math

import numpy as np

from skills.api import Cause, InputsT, Surface
from skills.detect.viewpoints import surface_boxes
from skills.geometry import inside_polygon
from skills.manipulation.arm.arm_skill import CARRY_SPEED_RAD_S
from skills.manipulation.arm.held_object import LEAST_ABOVE_M
from skills.manipulation.arm.poses import UP_B, close_viewpoints
from skills.manipulation.grasp.reach import body_heights_m
from skills.manipulation.place.free_spots import SpotSearch, above_goal, free_area
from skills.manipulation.place.verification import PlaceVerification
from skills.perception.point_cloud import cloud_from_image
from skills.robot import FloatArray
from skills.routine import PlanningAttempt, Routine, SkillFailure

_STEEP_RAD = tuple(np.radians([75.0, 66.0, 82.0, 58.0]))
"""Angles below level at which the camera looks into a bin, the best first."""
_FROM_RIM_M = (0.38, 0.45, 0.32)
"""Distances of the camera from the middle of the rim, the best first."""
_WALL_M = 0.045
"""Distance from the outline within which points may belong to the walls."""
_BELOW_RIM_M = 0.03
_CELL_M = 0.015
_RISEN_M = 0.012
"""Height by which a cell rises when an object covers it."""
_LEAST_RISEN = 5
"""Least number of such cells for an object."""
_FLOOR_PERCENT = 20
"""Percentile of the seen heights that counts as the bin's floor."""
_RELEASE_M = 0.02
"""Height of the object's lowest point over the rim at the release."""

Heights = dict[tuple[int, int], float]
"""Greatest height (m) in each seen cell (x, y) of a bin."""


class BinPlacement(PlaceVerification[InputsT]):
    """Routine that lets the held object fall into a bin, and checks whether it lies there."""

    def throw_in(self, search: SpotSearch) -> Routine[None]:
        """Brings the object above the opening, lets go, and looks whether something new lies inside.

        Raises SkillFailure with cause POSTCONDITION when nothing is seen inside.
        """
        surface, held, area = search.surface, search.held, free_area(search.surface, search.held)
        before, message = (yield from self._look_inside(surface)), f"bringing the object over the {surface.name}"

        def above() -> Routine[FloatArray]:
            X_WB, planner = self.X_WB(), self.context.stack.arm_planner
            self.boxes = surface_boxes([surface], X_WB)
            middle, opening = [self._middle_B(surface)], self.release_opening()
            goal = above_goal(middle, held, planner, (), opening, lambda X_BH: area.takes(X_WB @ X_BH))
            return (yield from self.move_to(goal, message, CARRY_SPEED_RAD_S))

        heights_m = body_heights_m(surface.height_m, self.context.robot.capabilities())
        yield from self.attempt_at_heights(heights_m, message, above)
        over_W = self.X_WB() @ self.model.X_BH(self.q_rad()) @ held.p_HO
        self.checkpoint = {**self.checkpoint, "spot_W": over_W[:2].tolist()}
        held_kg = yield from self.weigh(self.p_HT, message)
        yield from self.try_shift_hand((_RELEASE_M - LEAST_ABOVE_M) * UP_B, message)
        yield from self.let_go(held_kg)
        yield from self.check_inside(surface, before)
        yield from self.stow()

    def check_inside(self, surface: Surface, before: Heights) -> Routine[None]:
        """Raises SkillFailure with cause POSTCONDITION unless the bin holds more than in the heights `before`."""
        if self.context.robot.gripper().holding:
            raise SkillFailure(Cause.POSTCONDITION, "the object is still in the gripper")
        after = yield from self._look_inside(surface)
        if risen_cells(before, after) < _LEAST_RISEN:
            yield from self.try_stow()
            raise SkillFailure(Cause.POSTCONDITION, f"the object is not seen in the {surface.name}")

    def _look_inside(self, surface: Surface) -> Routine[Heights]:
        """Looks steeply down into a bin; returns the heights of what is seen inside, none when no view is feasible."""
        message, p_BT = f"looking into the {surface.name}", self._middle_B(surface)
        self.boxes = surface_boxes([surface], self.X_WB())
        viewpoints = close_viewpoints(self.p_BS, p_BT, 0.0, _STEEP_RAD, _FROM_RIM_M)
        with PlanningAttempt() as attempt:
            yield from self.look_at(p_BT, viewpoints, message, CARRY_SPEED_RAD_S, raised_m=1.0)
        if attempt.failure is not None:
            return {}
        image = yield from self.picture(message)
        cloud = cloud_from_image(image, self.context.localiser.estimate().X_WO, heights_m=(-math.inf, surface.height_m))
        return inside_heights(cloud.p_W, surface)

    def _middle_B(self, surface: Surface) -> FloatArray:
        """Middle (3,) of a bin's opening in the body frame."""
        return np.asarray(self.X_WB().inverse() @ np.array([*np.mean(surface.polygon_W, axis=0), surface.height_m]))


def inside_heights(points_W: FloatArray, surface: Surface) -> Heights:
    """Returns the greatest height (m) of points (N, 3) in each cell inside a bin, without its walls."""
    inside = inside_polygon(points_W[:, :2], surface.polygon_W, -_WALL_M)
    heights: Heights = {}
    for x, y, z in points_W[inside & (points_W[:, 2] < surface.height_m - _BELOW_RIM_M)]:
        cell = math.floor(x / _CELL_M), math.floor(y / _CELL_M)
        heights[cell] = max(float(z), heights.get(cell, -math.inf))
    return heights


def risen_cells(before: Heights, after: Heights) -> int:
    """Number of cells that have risen; a cell not seen before counts from the floor's height."""
    floor_m = float(np.percentile([*after.values()], _FLOOR_PERCENT)) if after else 0.0
    return sum(z > before.get(cell, floor_m) + _RISEN_M for cell, z in after.items())
