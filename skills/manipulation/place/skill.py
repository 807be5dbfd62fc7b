"""The place skill: find a free spot on a surface, lower the object until it stands, let go, check that it is there."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import ClassVar

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix

from skills.api import Cause, PlanningError, Succeeded, Surface
from skills.detect.viewpoints import cluster_boxes, surface_boxes
from skills.estimate.scan_points import SelfFilter
from skills.geometry import inside_polygon, wrap
from skills.manipulation.approach.standing import first_reachable_spot, free_places, go_to_one
from skills.manipulation.arm.arm_skill import GRIPPER_FORCE_N, Goal
from skills.manipulation.arm.collision import ArmScene, Box, box_corners
from skills.manipulation.arm.looking_skill import PICTURE_LATENCY_S, LookingSkill
from skills.manipulation.arm.poses import carry_configuration, overview_viewpoints, tucked_configuration
from skills.manipulation.arm.solid_cells import CELL_M
from skills.manipulation.grasp.candidates import hand_rotation
from skills.manipulation.grasp.reach import body_heights_m
from skills.manipulation.place.free_spot import (
    clear_spots,
    free_spots,
    roomiest_first,
    spaced_spots,
    spots,
    unseen_view,
)
from skills.manipulation.place.placement import (
    LEVEL,
    HeldObject,
    PrePlacePose,
    Release,
    above_goal,
    clear_heights,
    reaches,
    with_held,
)
from skills.manipulation.place.ports import PlaceInputs, PlacePorts
from skills.navigate.arm_footprint import ArmFootprint
from skills.navigate.ports import NavigateInputs
from skills.perception.surface_segmentation import SurfaceView, segment_surface
from skills.quantities import Length, Tries, TurnRate
from skills.robot import ArmTrajectory, FloatArray, Image, Pose2D
from skills.routine import Routine, SkillFailure

_SURELY_FREE_M = 0.03
_PRESS_M = 0.03
_LAG_IN_CONTACT_M = 0.02
"""A hand that goes down fast lags by so much only in contact: what it holds hangs lower than was thought."""
_SIDE_DROP_M, _LIFT_AGAIN_M = 0.12, 0.135
_MOST_SPOTS, _OTHER_SPOTS, _PLACES = 80, 6, 3
_OTHER_HEIGHT_COST = 0.05
_RELAX_M = 0.003
_FEEL_S = 0.4
_FLOOR_M = 0.06
_STANDS_OUT_M, _HIGHEST_M = 0.03, 0.5
_BESIDE, _TUCKED_M, _AHEAD_RAD = 0.6, 0.03, 0.6
_AT_HAND_M, _HIDDEN = 0.4, 0.5
"""A picture of which half is nearer than that, or too near to tell, shows what is held and not what lies behind it."""
_OVER_SPOT_M = 0.45
_SETTLES_WITHIN_S, _MOVES_ABOUT_M = 5.0, 0.2


@dataclass(frozen=True)
class PlaceOptions:
    """How an object is put down.

    No joint is faster than `lower_rad_s` while it is lowered until it stands. It must be seen again within
    `seen_again_m`. Where no free spot is in reach, the robot moves along the surface `moves` times at most.
    """

    lower_rad_s: TurnRate = 0.2
    seen_again_m: Length = 0.12
    moves: Tries = 2


class Place(PlacePorts, LookingSkill[PlaceInputs]):
    """The skill that `PlacePorts` declares."""

    Options: ClassVar[type] = PlaceOptions
    options: PlaceOptions

    def undone(self, inputs: PlaceInputs) -> str | None:
        """Judged by the gripper."""
        return "the object is still in the gripper" if self.context.robot.gripper().holding else None

    def run(self, inputs: PlaceInputs) -> Routine[Succeeded]:
        """Goes near, looks, puts down, looks again."""
        surface = inputs.surface
        if not self.context.robot.gripper().holding:
            raise SkillFailure(Cause.PRECONDITION, "there is nothing in the gripper to put down")
        self._clear_of = inputs.clear_of
        if len(self._spots(surface)) == 0:
            raise SkillFailure(Cause.PLANNING, f"the {surface.name} has no room out of the way")
        carried = self._carried()
        held = self._held(carried)
        yield from self._go_near(surface, held)
        try:
            yield from self._put_down(surface, held, carried)
        except SkillFailure:
            yield from self.stand_as_usual()
            raise
        yield from self.stand_as_usual()
        return Succeeded(f"put the object down on the {surface.name}")

    def _put_down(self, surface: Surface, held: HeldObject, carried: RotationMatrix) -> Routine[None]:
        """Finds a spot, lowers the object, lets go, checks, stow."""
        above = yield from self._find_spot(surface, held, carried)
        spot_W = np.asarray((self.X_WB() @ self.model.X_BH(self.q_rad()) @ held.p_HO)[:2])
        self.checkpoint = {**self.checkpoint, "spot_W": spot_W.tolist()}
        yield from self._lower(surface, above)
        put_down = held.box(self.model.X_BH(self.q_rad()))
        yield from self._let_go()
        yield from self._check(surface, spot_W, [put_down])
        yield from self.stow()

    def run_again(self, inputs: PlaceInputs) -> Routine[Succeeded]:
        """With an empty gripper: draw the hand back, and look whether the object stands where it was to be put."""
        surface = inputs.surface
        yield from self.pause(_FEEL_S, "feeling what the gripper holds")
        spot = self.checkpoint.get("spot_W")
        spot_W = None if spot is None else np.array([*spot, surface.height_m])
        over_spot = spot_W is not None and self.hand_near(spot_W, _OVER_SPOT_M)
        if self.context.robot.gripper().holding:
            if over_spot:
                yield from self.try_shift_hand(np.array([0.0, 0.0, _LIFT_AGAIN_M]), "lifting the object again")
            return (yield from self.run(inputs))
        if spot_W is None:
            raise SkillFailure(Cause.PRECONDITION, "there is nothing in the gripper, and it was not yet over its place")
        if over_spot:
            yield from self._let_go()
        yield from self._check(surface, spot_W[:2])
        yield from self.stow()
        yield from self.stand_as_usual()
        return Succeeded(f"the object stood on the {surface.name} already")

    def _carried(self) -> RotationMatrix:
        """How the hand was turned as the object was brought, which an attempt that was broken off has noted."""
        noted = self.checkpoint.get("carried")
        rotation = self.model.X_BH(self.q_rad()).rotation() if noted is None else RotationMatrix(np.array(noted))
        self.checkpoint = {**self.checkpoint, "carried": rotation.matrix().tolist()}
        return rotation

    def _find_spot(self, surface: Surface, held: HeldObject, carried: RotationMatrix) -> Routine[PrePlacePose]:
        """Look, and bring the object over a free spot; out of reach, go before another one that was seen."""
        spot_W, gone_to, arm = self._nearest_spot(surface), list[FloatArray](), self.arm
        heights_m, standing = self._heights_m(surface), f"standing up to the {surface.name}"
        while True:
            yield from self.stand_at(heights_m[0], standing)
            yield from self._hold_ahead(surface, carried)
            on_floor = surface.height_m < _FLOOR_M and self.object_camera.on_hand
            standing_W = self._standing_W(surface)
            view = yield from self._look_at_floor(surface) if on_floor else self._look(surface, spot_W)
            if view is None or (on_floor and len(free_spots(view, self._spots(surface))) == 0):
                view = unseen_view(surface, standing_W)
            try:
                above, X_WB = partial(self._go_above, surface, view, held), self.X_WB()
                corners_W = X_WB.multiply(box_corners(held.box(self.model.X_BH(self.q_rad()))).T).T
                clear_m = clear_heights(heights_m, float(X_WB.translation()[2]), corners_W, surface)
                return (yield from self.from_a_height(clear_m, standing, above))
            except SkillFailure as failure:
                others = roomiest_first(free_spots(view, self._spots(surface)), view, [*gone_to, spot_W])
                if failure.cause is not Cause.PLANNING or len(others) == 0 or len(gone_to) >= self.options.moves:
                    raise
            gone_to.append(spot_W)
            if not (yield from self._draw_in(held)):
                message = "carrying the object on along the surface"
                yield from self.move_to(
                    lambda scene, q: carry_configuration(scene, arm, carried, q), message, speed_rad_s=0.9
                )
            yield from self.stand_as_usual()
            spot_W = yield from self._go_before(spaced_spots(others)[:_OTHER_SPOTS], surface, held)

    _clear_of: tuple[tuple[float, float, float], ...] = ()

    def _spots(self, surface: Surface) -> FloatArray:
        """The spots (N, 2) of a surface that the inputs do not rule out."""
        return clear_spots(spots(surface), self._clear_of)

    def _nearest_spot(self, surface: Surface) -> FloatArray:
        """The spot on the surface nearest to the robot."""
        return np.asarray(_by_distance(self._spots(surface), self.X_WB())[0])

    def _standing_W(self, surface: Surface) -> FloatArray:
        """What the LiDAR and earlier pictures show above a surface, (N, 3) in the world.

        Where a large object in the gripper hides all from the hand camera, nothing else tells what stands there.
        """
        scan, capabilities = self.context.robot.scan(), self.context.robot.capabilities()
        seen = [(self.context.solid.cells + 0.5) * CELL_M]
        if scan is not None:
            (x0, y0), (x1, y1) = np.min(capabilities.footprint_m, axis=0), np.max(capabilities.footprint_m, axis=0)
            q, tip_H = self.q_rad(), np.array([self.gripper.length_m, 0.0, 0.0])
            arm_B = np.vstack([self.model.points_B(q), self.model.X_BH(q) @ tip_H])
            points_B = scan.points_B()
            foreign_B = points_B[SelfFilter((x0, x1, y0, y1)).foreign(points_B, arm_B, holding=True)]
            X_WB = self.context.localiser.estimate().X_WO @ scan.X_OB
            seen.append(foreign_B @ X_WB.rotation().matrix().T + X_WB.translation())
        points_W = np.vstack(seen)
        above_m = points_W[:, 2] - surface.height_m
        points_W = points_W[(above_m > _STANDS_OUT_M) & (above_m < _HIGHEST_M)]
        return points_W[inside_polygon(points_W[:, :2], surface.polygon_W, 0.0)]

    def _heights_m(self, surface: Surface) -> tuple[float, ...]:
        """How high the body may stand to put something down, the usual height first."""
        return body_heights_m(surface.height_m, self.context.robot.capabilities())

    def _go_near(self, surface: Surface, held: HeldObject) -> Routine[None]:
        """Drives nearer when the spots nearby are out of the arm's reach."""
        pose, near = self.context.pose(), spaced_spots(_by_distance(self._spots(surface), self.X_WB()))[:_OTHER_SPOTS]
        for spot in near:
            offset = np.array([spot[0] - pose.x_m, spot[1] - pose.y_m])
            bearing_rad = wrap(math.atan2(offset[1], offset[0]) - pose.yaw_rad)
            ahead = np.linalg.norm(offset) < max(self.arm.standing_m) and abs(bearing_rad) < _AHEAD_RAD
            if ahead and self._reach_cost(surface, held, spot)(pose) is not None:
                return
        yield from self._go_before(near, surface, held)

    def _go_before(self, candidates: Sequence[FloatArray], surface: Surface, held: HeldObject) -> Routine[FloatArray]:
        """Drives to where the first of some spots that can be is within the arm's reach, or as near as may be.

        Gives that spot. Raises SkillFailure with cause PLANNING: there is no free place before any of them.
        """
        yield from self._draw_in(held)
        context, pose, arm = self.context, self.context.pose(), self.arm
        footprint, best_m = ArmFootprint(context).now(), arm.standing_m[0]
        before = [
            (spot, free_places((float(spot[0]), float(spot[1])), pose, context.costmap, footprint, each, best_m))
            for spot, each in itertools.product(candidates, (arm.standing_m, arm.nearer_m))
        ]
        choose = partial(first_reachable_spot, before, partial(self._reach_cost, surface, held))
        message = f"choosing where to stand at the {surface.name}"
        chosen = yield from self.compute(choose, latency_s=0.2, name="choose a place", message=message)
        if chosen is None:
            raise SkillFailure(Cause.PLANNING, f"there is no free place to stand at the {surface.name}")
        spot, places = chosen
        yield from go_to_one(self, [NavigateInputs(place.pose, 0.08, 0.1, 0.5) for place in places[:_PLACES]])
        return spot

    def _tucked(self) -> bool:
        """Returns whether the hand is drawn in to the body."""
        X_BH, tuck_x_m = self.model.X_BH(self.q_rad()), self.arm.tuck_x_m
        beside = abs(float(X_BH.rotation().matrix()[1, 0])) > _BESIDE
        return bool(tuck_x_m) and beside and float(X_BH.translation()[0]) < max(tuck_x_m) + _TUCKED_M

    def _draw_in(self, held: HeldObject) -> Routine[bool]:
        """Draws in what sticks out over the surface while the robot drives up to it; whether the arm can."""
        arm, R_BH = self.arm, self.model.X_BH(self.q_rad()).rotation()
        if not arm.tuck_x_m or self._tucked():
            return bool(arm.tuck_x_m)
        self.held = [held.box_H]
        try:
            yield from self.move_to(
                lambda scene, q: tucked_configuration(scene, arm, R_BH, q), "drawing the object in", speed_rad_s=0.9
            )
        except SkillFailure as failure:
            if failure.cause is not Cause.PLANNING:
                raise
            return False
        finally:
            self.held = ()
        return True

    def _hold_ahead(self, surface: Surface, carried: RotationMatrix) -> Routine[None]:
        """Takes what was drawn in out of the view of a camera on the head."""
        if not self._tucked():
            return
        arm, self.boxes = self.arm, surface_boxes([surface], self.X_WB())
        message = f"holding the object before the {surface.name}"
        yield from self.move_to(lambda scene, q: carry_configuration(scene, arm, carried, q), message, speed_rad_s=0.9)

    def _reach_cost(self, surface: Surface, held: HeldObject, spot: FloatArray) -> Callable[[Pose2D], float | None]:
        """How awkwardly the arm puts the object down on a spot from a pose of the body; None where it does not.

        The highest approach is left out, because the next one reaches as far.
        """
        model, heights_m = self.model, self._heights_m(surface)
        p_WT = np.array([spot[0], spot[1], surface.height_m])

        def cost(pose: Pose2D) -> float | None:
            for (number, height_m), way in itertools.product(enumerate(heights_m), held.approaches()[1:]):
                p_BT = pose.transform(height_m).inverse() @ p_WT
                if any(reaches(model, X_BH) for X_BH in held.above(p_BT, model.p_BS, *way)):
                    return _OTHER_HEIGHT_COST * number + way[1]
            return None

        return cost

    def _look(self, surface: Surface, spot_W: FloatArray, beside: Sequence[Box] = ()) -> Routine[SurfaceView | None]:
        """What a picture shows of the surface, None where the object in the gripper hides all that is free."""
        return (yield from self._seen_on(surface, spot_W, beside))[1]

    def _seen_on(
        self, surface: Surface, spot_W: FloatArray, beside: Sequence[Box] = ()
    ) -> Routine[tuple[Image, SurfaceView | None]]:
        """A picture and what it shows of the surface, None where the object in the gripper hides all that is free.

        It hides the picture's lower half at least, so the camera looks low. Raises SkillFailure: there is no surface.
        """
        message = f"looking for a free spot on the {surface.name}"
        X_WB = self.X_WB()
        self.boxes = [*surface_boxes([surface], X_WB), *beside]
        p_BT = X_WB.inverse() @ np.array([spot_W[0], spot_W[1], surface.height_m])
        low_BT = self.model.p_BS + (p_BT - self.model.p_BS) * [0.8, 0.8, 1.0]
        yield from self.look_at(low_BT, overview_viewpoints(self.model, low_BT), message, speed_rad_s=0.9)
        image = yield from self.picture(message)
        X_WO = self.context.localiser.estimate().X_WO
        view = yield from self.compute(
            lambda: segment_surface(image, X_WO, surface), latency_s=0.15, name="segment", message=message
        )
        robot, near = self.context.robot, np.mean(image.depth_m < _AT_HAND_M)
        hidden = near > _HIDDEN and robot.gripper().holding and robot.scan() is not None
        if view is None and not hidden:
            raise SkillFailure(Cause.PLANNING, f"the {surface.name} is not seen from here")
        full = view is None or (hidden and len(free_spots(view, self._spots(surface))) == 0)
        return image, None if full else view

    def _look_at_floor(self, surface: Surface) -> Routine[SurfaceView | None]:
        """What the cameras at the body's front see of the floor: the object hides it from one on the hand."""
        message, robot = f"looking for a free spot on the {surface.name}", self.context.robot
        X_WO, views = self.context.localiser.estimate().X_WO, list[SurfaceView]()
        for camera in robot.capabilities().body_cameras:
            if not camera.looks_towards(0.0):
                continue
            take = partial(robot.image, camera.source)
            image = yield from self.sense(take, latency_s=PICTURE_LATENCY_S, name="floor picture", message=message)
            segment = partial(segment_surface, image, X_WO, surface)
            view = yield from self.compute(segment, latency_s=0.15, name="segment", message=message)
            views += [] if view is None else [view]
        return max(views, key=lambda view: len(view.plane_points), default=None)

    def _go_above(self, surface: Surface, view: SurfaceView, held: HeldObject) -> Routine[PrePlacePose]:
        """Brings the object above the best free spot."""
        X_WB = self.X_WB()
        free = free_spots(view, self._spots(surface))
        if len(free) == 0:
            raise SkillFailure(Cause.PLANNING, f"no free spot is seen on the {surface.name}")
        X_BW = X_WB.inverse()
        near = _by_distance(free, X_WB)[:_MOST_SPOTS]
        on_top = [X_BW @ np.array([x, y, view.plane.height_m]) for x, y in near]
        beside = cluster_boxes(view.clusters, X_WB)
        self.boxes = [*surface_boxes([surface], X_WB), *beside]
        letting_go = Release(beside, self.release_rad())
        goal = above_goal(on_top, held, self.context.stack.arm_planner, letting_go)
        q_rad = yield from self._bring(goal, held, f"bringing the object over the {surface.name}")
        X_BH = self.model.X_BH(q_rad)
        return PrePlacePose(q_rad, float(X_BH.translation()[2] - on_top[0][2]) - held.drop_m(X_BH.rotation()))

    def _bring(self, goal: Goal, held: HeldObject, message: str) -> Routine[FloatArray]:
        """Goes to a goal on a path on which what is held touches nothing; where there is none, the arm at least."""
        found: list[FloatArray] = []

        def noted(scene: ArmScene, q: FloatArray) -> FloatArray:
            found.append(goal(scene, q))
            return found[0]

        try:
            return (yield from self.move_to(with_held(noted, held.box_H), message, speed_rad_s=0.8))
        except SkillFailure as failure:
            if failure.cause is not Cause.PLANNING or not found:
                raise
        return (yield from self.move_to(lambda scene, q: found[0], message, speed_rad_s=0.8))

    def _lower(self, surface: Surface, above: PrePlacePose) -> Routine[None]:
        """Goes down slowly until the hand is held up, by contact, or the height is that of the surface.

        The path down begins at the angles for which it was found to be possible, and not at those of the arm: they
        differ a little, and near a singular posture that may make the difference between a path and none.
        After contact the arm no longer presses, or it would dip onto the surface as the gripper lets go.
        """
        message = f"putting the object down on the {surface.name}"
        p_BH = self.model.X_BH(above.q_rad).translation() - [0.0, 0.0, above.height_m - _SURELY_FREE_M]
        down_B = np.array([0.0, 0.0, -1.0])
        early = self.held_up(down_B, _LAG_IN_CONTACT_M)
        stopped = yield from self.move_straight(p_BH, message, q_from_rad=above.q_rad, guard=early)
        if not stopped:
            stopped = yield from self.follow(self._way_down(), message, self.held_up(down_B))
        if stopped:
            yield from self.try_shift_hand(np.array([0.0, 0.0, _RELAX_M]), message)

    def _way_down(self) -> ArmTrajectory:
        """Straight down as far as the arm can go, at most into the surface. Raises SkillFailure with cause PLANNING."""
        planner, X_BH = self.context.stack.arm_planner, self.model.X_BH(self.q_rad())
        depth_m = _SURELY_FREE_M + _PRESS_M
        why = PlanningError("the arm cannot go down")
        for part in (1.0, 0.85, 0.7, 0.5):
            lowered = RigidTransform(X_BH.rotation(), X_BH.translation() - [0.0, 0.0, part * depth_m])
            try:
                path = planner.line(self.model, self.q_rad(), lowered)
            except PlanningError as error:
                why = error
                continue
            return planner.timed(path, speed_rad_s=self.options.lower_rad_s)
        raise SkillFailure(Cause.PLANNING, str(why)) from why

    def _let_go(self) -> Routine[None]:
        """Open, and leave the object without dragging it."""
        yield from self.move_gripper(self.release_rad(), GRIPPER_FORCE_N, "letting go")
        yield from self.pause(0.3, "letting go")
        if not (yield from self.leave_object()):
            raise SkillFailure(Cause.PLANNING, "the hand cannot be drawn back from the object")

    def _check(self, surface: Surface, spot_W: FloatArray, put_down: Sequence[Box] = ()) -> Routine[None]:
        """Raises SkillFailure with cause POSTCONDITION unless something stands, at rest, where the object was put.

        The arm goes round `put_down`, the object's box (B), on its way.
        """
        if self.context.robot.gripper().holding:
            raise SkillFailure(Cause.POSTCONDITION, "the object is still in the gripper")
        end_s, at_rest = self.context.clock.now() + _SETTLES_WITHIN_S, False
        while not at_rest:
            image, view = yield from self._seen_on(surface, spot_W, put_down)
            if view is None:
                raise SkillFailure(Cause.PLANNING, f"the {surface.name} is not seen from here")
            off = [float(np.min(np.linalg.norm(c.points.p_W[:, :2] - spot_W, axis=1))) for c in view.clusters]
            if not off or min(off) > self.options.seen_again_m:
                yield from self.try_stow()
                where = f"on the {surface.name} where it was put down"
                raise SkillFailure(Cause.POSTCONDITION, f"the object is not seen {where}")
            p_WO = np.array([*spot_W, surface.height_m])
            at_rest = yield from self.at_rest_since(image, p_WO, _MOVES_ABOUT_M, "looking whether it is at rest")
            if not at_rest and self.context.clock.now() > end_s:
                yield from self.try_stow()
                raise SkillFailure(Cause.POSTCONDITION, f"the object still moves on the {surface.name}")

    def _held(self, carried: RotationMatrix) -> HeldObject:
        """What is held, as the skill noted that took it, or else as may be guessed from how it was brought."""
        payload, gripper = self.context.payload, self.gripper
        if payload.corners_H is not None and payload.R_BH is not None:
            return HeldObject(payload.R_BH, payload.corners_H)
        if abs(carried.matrix()[2, 2]) < LEVEL:
            low_H = carried.matrix().T @ np.array([0.0, 0.0, -_SIDE_DROP_M])
            return HeldObject(carried, np.array([gripper.grip_x_m, 0.0, 0.0]) + np.array([low_H, -low_H]))
        tip_H = np.array([gripper.tip_x_m, 0.0, 0.0])
        return HeldObject(hand_rotation(0.5 * math.pi, 0.0, 1.0), np.array([tip_H, tip_H - [0.06, 0.0, 0.0]]))


def _by_distance(points_W: FloatArray, X_WB: RigidTransform) -> FloatArray:
    here = Pose2D.from_transform(X_WB)
    ahead = np.array([here.x_m + 0.2 * math.cos(here.yaw_rad), here.y_m + 0.2 * math.sin(here.yaw_rad)])
    return points_W[np.argsort(np.linalg.norm(points_W - ahead, axis=1))]
