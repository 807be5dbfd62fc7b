"""Release of an object on a surface or into a bin, and the check by gripper, arm and camera that it rests there."""

import math
from collections.abc import Callable, Sequence

import numpy as np

from skills.api import Cause, InputsT, Surface
from skills.detect.viewpoints import surface_boxes
from skills.geometry import inside_polygon
from skills.manipulation.arm.arm_skill import CARRY_SPEED_RAD_S
from skills.manipulation.arm.collision import Box
from skills.manipulation.arm.held_object import LEAST_ABOVE_M
from skills.manipulation.arm.poses import UP_B, close_viewpoints, overview_viewpoints
from skills.manipulation.arm.releasing_skill import ReleasingSkill
from skills.manipulation.grasp.reach import body_heights_m
from skills.manipulation.place.free_spots import SpotSearch, above_goal, distances_m, free_area, objects_W
from skills.perception.detection_3d import Detection3D, at_points, detections_3d
from skills.perception.detector.camera_images import DETECTION_LATENCY_S, detect_in_image
from skills.perception.point_cloud import Mask, cloud_from_image
from skills.perception.surface_segmentation import SurfaceView, segment_surface
from skills.robot import FloatArray, Image
from skills.routine import PlanningAttempt, Routine, SkillFailure

_AT_HAND_M = 0.4
"""Depth below which a pixel shows the held object, or something too near to measure."""
_HIDDEN = 0.5
"""Least part of these pixels at which the held object hides the surface."""
_SETTLES_WITHIN_S = 5.0
_MOVES_ABOUT_M = 0.2
"""Radius around a spot of the search for a moving object."""
_NEW_M = 0.025
"""Distance from all earlier points on the surface beyond which a point belongs to the object."""
_LEAST_NEW = 10
"""Least number of these points for the object to be there."""
_ON_SURFACE_M = 0.15
"""Largest height over the surface of a detected object at rest on it."""
_NOT_SEEN = np.empty((0, 2))
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


class PlaceVerification(ReleasingSkill[InputsT]):
    """Routine that releases an object on a surface, and checks whether it rests there."""

    @property
    def thing(self) -> str:
        """Name of the object, also after its release."""
        return str(self.checkpoint.get("thing", super().thing))

    def let_go(self, held_kg: float | None) -> Routine[None]:
        """Opens the gripper and draws back without dragging the object; shakes off an object that sticks to the hand.

        Raises SkillFailure with cause POSTCONDITION when it still sticks, or the hand cannot leave it.
        """
        message = "letting go"
        free = (yield from self.open_hand(message)) or (yield from self.shake_off(message, turns_hand=False))
        p_BH = self.model.X_BH(self.q_rad()).translation()
        left = yield from self.leave_object()
        if free and (yield from self.hangs_on_hand(held_kg, message)):
            yield from self.try_shift_hand(p_BH - self.model.X_BH(self.q_rad()).translation(), message)
            free = yield from self.shake_off(f"shaking the {self.thing} off the fingers", turns_hand=False)
            left = yield from self.leave_object()
            free = free and not (yield from self.hangs_on_hand(held_kg, message))
        if not free:
            raise SkillFailure(Cause.POSTCONDITION, f"the {self.thing} is still in the gripper")
        if not left:
            raise SkillFailure(Cause.POSTCONDITION, f"the {self.thing} is put down, but the hand cannot draw back")

    def check(
        self,
        surface: Surface,
        spot_W: FloatArray,
        put_down: Sequence[Box] = (),
        before_W: FloatArray = _NOT_SEEN,
        within_m: float = 0.12,
    ) -> Routine[None]:
        """Raises SkillFailure with cause POSTCONDITION unless an object rests within `within_m` of the spot (2,).

        `before_W` (N, 2) are points on the objects that stood there before. The arm avoids `put_down`, the object's box
        (B), on its path.
        """
        end_s = self.context.clock.now() + _SETTLES_WITHIN_S
        p_WO = np.array([*spot_W, surface.height_m])
        while True:
            image = yield from self._seen_again(surface, spot_W, put_down, before_W, within_m)
            if image is None:
                yield from self.try_stow()
                where = f"on the {surface.name} where it was put down"
                raise SkillFailure(Cause.POSTCONDITION, f"the {self.thing} is not seen {where}")
            if (yield from self.stays_at_rest(image, p_WO, _MOVES_ABOUT_M, "looking whether it is at rest")):
                return
            if self.context.clock.now() > end_s:
                yield from self.try_stow()
                raise SkillFailure(Cause.POSTCONDITION, f"the {self.thing} still moves on the {surface.name}")

    def _seen_again(
        self, surface: Surface, spot_W: FloatArray, put_down: Sequence[Box], before_W: FloatArray, within_m: float
    ) -> Routine[Image | None]:
        """Returns a picture that shows the object near its spot, by depth or class, from a near viewpoint if needed."""

        def new(points_W: FloatArray) -> Mask:
            near = np.linalg.norm(points_W - spot_W, axis=1) < within_m
            return np.asarray(near & (distances_m(before_W, points_W) > _NEW_M))

        for near in (False, True):
            with PlanningAttempt() as attempt:
                image, view = yield from self.seen_on(surface, spot_W, put_down, near=near)
            if attempt.failure is not None:
                continue
            if np.count_nonzero(new(objects_W(view))) >= _LEAST_NEW or (
                yield from self._is_detected(image, surface, new)
            ):
                return image
        return None

    def _is_detected(self, image: Image, surface: Surface, new: Callable[[FloatArray], Mask]) -> Routine[bool]:
        """Returns whether the detector finds a `new` object of the class, which depth may miss when it is flat."""
        kind = self.checkpoint.get("kind")
        if kind not in self.context.detector.class_names:
            return False
        found = yield from self.detected_on(image, surface, f"looking for the {kind} on the {surface.name}")
        own_W = np.array([one.position_W for one in found if one.class_name == kind]).reshape(-1, 3)
        return bool(np.any(new(own_W[:, :2]) & (np.abs(own_W[:, 2] - surface.height_m) < _ON_SURFACE_M)))

    def detected_on(
        self, image: Image, surface: Surface, message: str, standing_W: FloatArray | None = None
    ) -> Routine[list[Detection3D]]:
        """Returns the detections in 3D in a picture of a surface.

        The points `standing_W` (N, 3) on the surface give the position of a detection without depth.
        """
        place, detector = self.context.localiser.estimate(), self.context.detector

        def detected() -> list[Detection3D]:
            seen = detect_in_image(detector, image)
            found = list(detections_3d(image, place, seen, [surface]))
            if standing_W is not None:
                lacking = [one for one in seen if all(one is not each.detection for each in found)]
                found += filter(None, (at_points(one, image, place, standing_W, surface.name) for one in lacking))
            return found

        return (yield from self.compute(detected, latency_s=DETECTION_LATENCY_S, name="look again", message=message))

    def seen_on(
        self, surface: Surface, spot_W: FloatArray, beside: Sequence[Box] = (), *, near: bool = False
    ) -> Routine[tuple[Image, SurfaceView | None]]:
        """Takes a picture, from afar or near, and segments the surface; no view when the held object occludes it.

        The object occludes at least the picture's lower half, so from afar the camera looks low. Raises SkillFailure
        with cause PLANNING when the surface is out of view.
        """
        message = f"looking for a free spot on the {surface.name}"
        X_WB, p_BS = self.X_WB(), self.model.p_BS
        self.boxes = [*surface_boxes([surface], X_WB), *beside]
        p_BT = X_WB.inverse() @ np.array([spot_W[0], spot_W[1], surface.height_m])
        low_BT = p_BS + (p_BT - p_BS) * [0.8, 0.8, 1.0]
        viewpoints = close_viewpoints(p_BS, p_BT) if near else overview_viewpoints(self.model.p_BS, low_BT)
        yield from self.look_at(p_BT if near else low_BT, viewpoints, message, CARRY_SPEED_RAD_S)
        image = yield from self.picture(message)
        X_WO = self.context.localiser.estimate().X_WO
        view = yield from self.compute(
            lambda: segment_surface(image, X_WO, surface), latency_s=0.15, name="segment", message=message
        )
        if view is None and not self.is_hidden(image):
            raise SkillFailure(Cause.PLANNING, f"the {surface.name} is not seen from here")
        return image, view

    def is_hidden(self, image: Image) -> bool:
        """Returns whether the held object occludes a picture, so that the LiDAR must replace it."""
        robot = self.context.robot
        near = float(np.mean(image.depth_m < _AT_HAND_M))
        return near > _HIDDEN and robot.gripper().holding and robot.scan() is not None


class BinPlacement(PlaceVerification[InputsT]):
    """Routine that lets the held object fall into a bin, and checks whether it lies there."""

    def throw_in(self, search: SpotSearch) -> Routine[None]:
        """Brings the object above the opening, lets go, and looks whether something new lies inside.

        Raises SkillFailure with cause POSTCONDITION when nothing is seen inside.
        """
        surface, held, area = search.surface, search.held, free_area(search.surface, search.held)
        before, message = (yield from self._look_inside(surface)), f"bringing the {self.thing} over the {surface.name}"

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
        after = yield from self._look_inside(surface)
        if risen_cells(before, after) < _LEAST_RISEN:
            yield from self.try_stow()
            raise SkillFailure(Cause.POSTCONDITION, f"the {self.thing} is not seen in the {surface.name}")

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
