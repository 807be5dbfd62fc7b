"""The place skill: finds a free spot on a surface, lowers the object until it stands, releases it, and checks."""

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from typing import ClassVar

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix

from skills.api import Cause, PlanningError, Succeeded, Surface
from skills.detect.viewpoints import cluster_boxes, surface_boxes
from skills.estimate.scan_points import SelfFilter
from skills.geometry import inside_polygon, wrap
from skills.manipulation.approach.base_placement import first_reachable_spot, free_placements, go_to_one
from skills.manipulation.arm.arm_skill import CARRY_SPEED_RAD_S, Goal
from skills.manipulation.arm.collision import ArmScene, box_corners
from skills.manipulation.arm.held_object import HeldObject, held_object
from skills.manipulation.arm.looking_skill import PICTURE_LATENCY_S
from skills.manipulation.arm.poses import UP_B, finger_sweep_m, tucked_configuration
from skills.manipulation.arm.solid_cells import cell_centres
from skills.manipulation.grasp.reach import body_heights_m
from skills.manipulation.place.free_spots import (
    PrePlacePose,
    SpotSearch,
    above_goal,
    clear_heights,
    free_area,
    hold_on_path,
    longest_edge_rad,
    objects_W,
    reaches,
    spaced_spots,
    unseen_view,
)
from skills.manipulation.place.verification import BinPlacement
from skills.navigate.arm_footprint import ArmFootprint
from skills.navigate.surroundings import NavigateInputs
from skills.perception.surface_segmentation import SurfaceView, segment_surface
from skills.quantities import Coordinate, Length, Tries, TurnRate
from skills.relations import Relation
from skills.robot import FloatArray, Pose2D
from skills.routine import PlanningAttempt, Routine, SkillFailure

_SURELY_FREE_M = 0.03
"""Height down to which the object moves fast, because it cannot touch the surface there."""
_PRESS_M = 0.03
"""Largest depth of the hand below the height of the surface while it feels for contact."""
_TOUCH_S = 25.0
"""Longest time from the lowering to the retreat, in which fingertips may touch the surface."""
_LAG_IN_CONTACT_M = 0.02
"""Lag of a fast hand in contact: the held object hangs lower than was thought."""
_LIFT_AGAIN_M = 0.135
"""Height by which the arm lifts an object that was over its spot before a restart."""
_MOST_SPOTS = 80
"""Number of free spots that are tried from one place."""
_OTHER_SPOTS = 6
"""Number of spots for which a place to stand is looked for."""
_PLACES = 3
"""Number of places to stand to which a path is looked for."""
_OTHER_HEIGHT_COST = 0.05
"""Cost of a body height for each step from the usual one."""
_RELAX_M = 0.003
"""Distance by which the arm is raised after contact."""
_LOW_TIP_M = 0.02
"""Height of a fingertip over the object's lowest point below which it may touch the surface."""
_TIPS_RAD_S = 0.05
"""Joint speed limit while low fingertips near the surface."""
_FEEL_S = 0.4
"""Pause for the gripper's readings of the held object."""
_FLOOR_M = 0.06
"""Surfaces lower than this are seen by the cameras on the body."""
_STANDS_OUT_M = 0.03
"""Height over the surface from which on points belong to objects."""
_HIGHEST_M = 0.5
"""Largest height over the surface of points that belong to objects on it."""
_BESIDE = 0.6
"""Lateral component of the hand's direction that a tucked hand exceeds."""
_TUCKED_M = 0.03
"""Distance beyond the tucked position at which a hand still counts as tucked."""
_AHEAD_RAD = 0.6
"""Largest bearing of a spot that counts as ahead."""
_OVER_SPOT_M = 0.45
"""Distance of the hand from a spot within which the restart interrupted the placement."""


@dataclass(frozen=True)
class PlaceInputs:
    """Surface to put the object on.

    The object's centre must come to rest outside all circles `clear_of` (x, y, radius) in the world, and where all
    `relations` hold.
    """

    surface: Surface
    clear_of: tuple[tuple[Coordinate, Coordinate, Length], ...] = ()
    relations: tuple[Relation, ...] = ()


@dataclass(frozen=True)
class PlaceOptions:
    """Speed of lowering, and limits of the search for a spot.

    `lower_rad_s`: joint speed limit while the object is lowered. `seen_again_m`: distance from its spot within which
    the object must be seen again. `moves`: how often the robot drives at most when no free spot is within reach.
    """

    lower_rad_s: TurnRate = 0.2
    seen_again_m: Length = 0.12
    moves: Tries = 5


class Place(BinPlacement[PlaceInputs]):
    """Puts the held object down on a surface, or lets it fall into a bin, and stows the arm.

    It drives nearer when no free spot is within reach.

    The output `released_W` is the point of the release, also after a later failure; a failure before it has none.
    """

    name = "place"
    Inputs = PlaceInputs
    causes: ClassVar[Mapping[Cause, str]] = {
        Cause.PRECONDITION: "nothing is held",
        Cause.PLANNING: "no free spot of the surface is seen within reach, or the arm finds no path to it",
        Cause.EXECUTION: "the robot or its arm did not reach its goal",
        Cause.POSTCONDITION: "it was let go and is not seen at rest where it was put down, or is still in the gripper",
    }
    default_timeout_s = 240.0
    Options: ClassVar[type] = PlaceOptions
    options: PlaceOptions

    def undone(self, inputs: PlaceInputs) -> str | None:
        """Returns a reason when the object is still in the gripper."""
        return f"the {self.thing} is still in the gripper" if self.context.robot.gripper().holding else None

    def run(self, inputs: PlaceInputs) -> Routine[Succeeded]:
        """Drives near, views the surface, puts the object down, and checks."""
        surface = inputs.surface
        if not (yield from self.holds("feeling what the gripper holds")):
            raise SkillFailure(Cause.PRECONDITION, "there is nothing in the gripper to put down")
        carried = self._carried()
        held, pose = held_object(self.context.payload, self.gripper, carried), self.context.pose()
        search = SpotSearch(surface, held, inputs.clear_of, relations=inputs.relations, robot=pose)
        if len(search.spots()) == 0:
            raise SkillFailure(Cause.PLANNING, f"the {surface.name} has no spot out of the way")
        yield from self._go_near(search)
        try:
            yield from (self.throw_in(search) if surface.is_bin else self._put_down(search, carried))
        except SkillFailure:
            yield from self.stand_as_usual()
            raise
        yield from self.stand_as_usual()
        return Succeeded(f"put the {self.thing} {'in' if surface.is_bin else 'down on'} the {surface.name}")

    def _put_down(self, search: SpotSearch, carried: RotationMatrix) -> Routine[None]:
        """Finds a spot, lowers and releases the object, checks, and stows the arm."""
        surface, held = search.surface, search.held
        above = yield from self._find_spot(search, carried)
        spot_W = np.asarray((self.X_WB() @ self.model.X_BH(self.q_rad()) @ held.p_HO)[:2])
        kind = self.context.payload.kind
        self.checkpoint = {**self.checkpoint, "spot_W": spot_W.tolist(), "kind": None if kind is None else kind.name}
        held_kg = yield from self.weigh(self.p_HT, f"weighing the {self.thing} over the {surface.name}")
        self.context.expect_touch(_TOUCH_S)
        yield from self._lower(surface, above, held)
        put_down = held.box(self.model.X_BH(self.q_rad()))
        yield from self.let_go(held_kg)
        self.context.expect_touch(0.0)
        yield from self.check(surface, spot_W, [put_down], objects_W(search.seen()), self.options.seen_again_m)
        yield from self.stow()

    def run_again(self, inputs: PlaceInputs) -> Routine[Succeeded]:
        """Checks, with an empty gripper, whether the object stands on its spot; else makes a new attempt."""
        surface = inputs.surface
        yield from self.pause(_FEEL_S, "feeling what the gripper holds")
        spot = self.checkpoint.get("spot_W")
        spot_W = None if spot is None else np.array([*spot, surface.height_m])
        over_spot = spot_W is not None and self.is_hand_near(spot_W, _OVER_SPOT_M)
        if self.context.robot.gripper().holding:
            if over_spot:
                yield from self.try_shift_hand(_LIFT_AGAIN_M * UP_B, f"lifting the {self.thing} again")
            return (yield from self.run(inputs))
        if spot_W is None:
            raise SkillFailure(Cause.PRECONDITION, f"the {self.thing} left the gripper before it was over its place")
        self.checkpoint = {"released_W": spot_W.tolist(), **self.checkpoint}
        if over_spot:
            yield from self.let_go(None)
        if surface.is_bin:
            yield from self.check_inside(surface, {})
        else:
            yield from self.check(surface, spot_W[:2], within_m=self.options.seen_again_m)
        yield from self.stow()
        yield from self.stand_as_usual()
        return Succeeded(f"the {self.thing} was {'in' if surface.is_bin else 'on'} the {surface.name} already")

    def _carried(self) -> RotationMatrix:
        """Rotation of the hand while it carried the object, from the checkpoint of an interrupted attempt."""
        noted = self.checkpoint.get("carried")
        rotation = self.model.X_BH(self.q_rad()).rotation() if noted is None else RotationMatrix(np.array(noted))
        self.checkpoint = {**self.checkpoint, "carried": rotation.matrix().tolist(), "thing": self.thing}
        return rotation

    def _find_spot(self, search: SpotSearch, carried: RotationMatrix) -> Routine[PrePlacePose]:
        """Brings the object over a free spot; when none is within reach, drives to others until none is left."""
        surface, spot_W = search.surface, _by_distance(search.spots(), self.X_WB())[0]
        heights_m, standing, moves = self._heights_m(surface), f"standing up to the {surface.name}", 0
        while True:
            yield from self.stand_at(heights_m[0], standing)
            if self._tucked():  # a head camera sees past an object ahead of the body
                self.boxes = surface_boxes([surface], self.X_WB())
                yield from self.carry(carried, f"holding the {self.thing} before the {surface.name}")
            view = yield from self._view(search, spot_W)
            search.add(view, spot_W)
            with PlanningAttempt() as attempt:
                above, X_WB = partial(self._go_above, search, view), self.X_WB()
                corners_W = X_WB.multiply(box_corners(search.held.box(self.model.X_BH(self.q_rad()))).T).T
                clear_m = clear_heights(heights_m, float(X_WB.translation()[2]), corners_W, surface)
                return (yield from self.attempt_at_heights(clear_m, standing, above))
            if moves >= self.options.moves:
                raise SkillFailure(Cause.PLANNING, search.why_none()) from attempt.failure
            moves += 1
            if not (yield from self._draw_in(search.held)):
                yield from self.carry(carried, f"carrying the {self.thing} on along the surface")
            yield from self.stand_as_usual()
            spot_W = yield from self._go_on(search)

    def _go_on(self, search: SpotSearch) -> Routine[FloatArray]:
        """Drives to the next spot that has a base placement. Raises SkillFailure when none is left."""
        while others := search.others(self.X_WB().translation()[:2])[:_OTHER_SPOTS]:
            with PlanningAttempt():
                return (yield from self._go_before(others, search))
            search.pass_over(others)
        raise SkillFailure(Cause.PLANNING, search.why_none())

    def _view(self, search: SpotSearch, spot_W: FloatArray) -> Routine[SurfaceView]:
        """Views the surface; if the object occludes it, uses earlier pictures and the LiDAR for the objects on it."""
        surface, standing_W = search.surface, self._standing_W(search.surface)
        hidden = surface.height_m < _FLOOR_M and self.object_camera.on_hand
        if hidden:
            view = yield from self._look_at_floor(surface)
        else:
            image, view = yield from self.seen_on(surface, spot_W)
            hidden = self.is_hidden(image)
            if search.missing():
                message = f"looking at what stands on the {surface.name}"
                found = yield from self.detected_on(image, surface, message, self._standing_W(surface))
                search.see(found)
        if view is None or (hidden and len(search.free(view)) == 0):
            return unseen_view(surface, standing_W)
        return view

    def _standing_W(self, surface: Surface) -> FloatArray:
        """Points (N, 3, world) above a surface from the LiDAR and earlier pictures.

        They replace the hand camera when a large object in the gripper occludes its view.
        """
        scan, capabilities = self.context.robot.scan(), self.context.robot.capabilities()
        seen = [cell_centres(self.context.solid.cells)]
        if scan is not None:
            (x0, y0), (x1, y1) = np.min(capabilities.footprint_m, axis=0), np.max(capabilities.footprint_m, axis=0)
            points_B = scan.points_B()
            own, arm_B = SelfFilter((x0, x1, y0, y1)), self.arm_points_B(self.q_rad())
            foreign_B = points_B[own.foreign(points_B, arm_B, holding=True)]
            X_WB = self.context.localiser.estimate().X_WO @ scan.X_OB
            seen.append(foreign_B @ X_WB.rotation().matrix().T + X_WB.translation())
        points_W = np.vstack(seen)
        above_m = points_W[:, 2] - surface.height_m
        points_W = points_W[(above_m > _STANDS_OUT_M) & (above_m < _HIGHEST_M)]
        return points_W[inside_polygon(points_W[:, :2], surface.polygon_W, 0.0)]

    def _heights_m(self, surface: Surface) -> tuple[float, ...]:
        """Body heights (m) for putting an object down, the usual one first."""
        return body_heights_m(surface.height_m, self.context.robot.capabilities())

    def _go_near(self, search: SpotSearch) -> Routine[None]:
        """Drives nearer when the spots nearby are out of the arm's reach."""
        pose, near = self.context.pose(), spaced_spots(_by_distance(search.spots(), self.X_WB()))[:_OTHER_SPOTS]
        reach = self._reach(search)
        for spot in near:
            offset = np.array([spot[0] - pose.x_m, spot[1] - pose.y_m])
            bearing_rad = wrap(math.atan2(offset[1], offset[0]) - pose.yaw_rad)
            ahead = np.linalg.norm(offset) < max(self.arm.standing_m) and abs(bearing_rad) < _AHEAD_RAD
            if ahead and reach(spot)(pose) is not None:
                return
        yield from self._go_before(near, search)

    def _go_before(self, candidates: Sequence[FloatArray], search: SpotSearch) -> Routine[FloatArray]:
        """Drives to a pose within reach of one of the candidates, or as near as possible; returns that spot.

        Raises SkillFailure with cause PLANNING when no spot has a free base placement.
        """
        if not (yield from self._draw_in(search.held)):
            yield from self.draw_near(self._carried())
        context, pose, arm = self.context, self.context.pose(), self.arm
        footprint, best_m, space = ArmFootprint(context).now(), arm.standing_m[0], context.free_space()
        before = [
            (spot, free_placements((float(spot[0]), float(spot[1])), pose, space, footprint, each, best_m))
            for spot, each in itertools.product(candidates, (arm.standing_m, arm.nearer_m))
        ]
        choose = partial(first_reachable_spot, before, self._reach(search))
        message = f"choosing where to stand at the {search.surface.name}"
        chosen = yield from self.compute(choose, latency_s=0.2, name="choose a place", message=message)
        if chosen is None:
            raise SkillFailure(Cause.PLANNING, f"there is no free place to stand at the {search.surface.name}")
        spot, places = chosen
        yield from go_to_one(self, [NavigateInputs(place.pose, 0.08, 0.1, 0.5) for place in places[:_PLACES]])
        return spot

    def _tucked(self) -> bool:
        """Returns whether the hand is tucked in at the body."""
        X_BH, tuck_x_m = self.model.X_BH(self.q_rad()), self.arm.tuck_x_m
        beside = abs(float(X_BH.rotation().matrix()[1, 0])) > _BESIDE
        return bool(tuck_x_m) and beside and float(X_BH.translation()[0]) < max(tuck_x_m) + _TUCKED_M

    def _draw_in(self, held: HeldObject) -> Routine[bool]:
        """Draws in an object that would overhang the surface during a drive; returns whether the arm can."""
        arm, R_BH = self.arm, self.model.X_BH(self.q_rad()).rotation()
        if not arm.tuck_x_m or self._tucked():
            return bool(arm.tuck_x_m)
        self.held = [held.box_H]
        try:
            message, tuck = f"drawing the {self.thing} in", partial(tucked_configuration, arm=arm, R_BH=R_BH)
            with PlanningAttempt() as attempt:
                yield from self.move_to(lambda scene, q: tuck(scene, q_near_rad=q), message, CARRY_SPEED_RAD_S)
            return attempt.failure is None
        finally:
            self.held = ()

    def _reach(self, search: SpotSearch) -> Callable[[FloatArray], Callable[[Pose2D], float | None]]:
        """Returns, for a spot, the function from a pose to the cost of putting the object down; None when out of reach.

        Omits the highest approach, because the next one reaches as far.
        """
        model, surface, held, area = self.model, search.surface, search.held, search.area()
        heights_m, edge_rad = self._heights_m(surface), longest_edge_rad(surface)

        def cost(spot: FloatArray, pose: Pose2D) -> float | None:
            p_WT = np.array([spot[0], spot[1], surface.height_m])
            for (number, height_m), way in itertools.product(enumerate(heights_m), held.approaches()[1:]):
                X_WB = pose.transform(height_m)
                above = held.above(X_WB.inverse() @ p_WT, model.p_BS, *way, edge_rad - pose.yaw_rad)
                if any(reaches(model, X_BH) and area.takes(X_WB @ X_BH) for X_BH in above):
                    return _OTHER_HEIGHT_COST * number + way[1]
            return None

        return lambda spot: partial(cost, spot)

    def _look_at_floor(self, surface: Surface) -> Routine[SurfaceView | None]:
        """Views the floor with the cameras at the body's front, because the held object occludes the hand camera."""
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

    def _go_above(self, search: SpotSearch, view: SurfaceView) -> Routine[PrePlacePose]:
        """Brings the object above the best free spot."""
        X_WB, surface, held = self.X_WB(), search.surface, search.held
        free = search.free(view)
        if len(free) == 0:
            raise SkillFailure(Cause.PLANNING, f"no free spot is seen on the {surface.name}")
        X_BW, area = X_WB.inverse(), free_area(surface, held, view)
        near = _by_distance(free, X_WB)[:_MOST_SPOTS]
        on_top = [X_BW @ np.array([x, y, view.plane.height_m]) for x, y in near]
        beside = cluster_boxes(view.clusters, X_WB)
        self.boxes = [*surface_boxes([surface], X_WB), *beside]
        along_rad = longest_edge_rad(surface) - Pose2D.from_transform(X_WB).yaw_rad
        planner, opening = self.context.stack.arm_planner, self.release_opening()
        goal = above_goal(on_top, held, planner, beside, opening, lambda X_BH: area.takes(X_WB @ X_BH), along_rad)
        q_rad = yield from self._bring(goal, held, f"bringing the {self.thing} over the {surface.name}")
        X_BH = self.model.X_BH(q_rad)
        return PrePlacePose(q_rad, float(X_BH.translation()[2] - on_top[0][2]) - held.drop_m(X_BH.rotation()))

    def _bring(self, goal: Goal, held: HeldObject, message: str) -> Routine[FloatArray]:
        """Moves to a goal without contact of the held object; when no such path exists, ignores the object."""
        found: list[FloatArray] = []

        def noted(scene: ArmScene, q: FloatArray) -> FloatArray:
            found.append(goal(scene, q))
            return found[0]

        try:
            return (yield from self.move_to(hold_on_path(noted, held.box_H), message, speed_rad_s=0.8))
        except SkillFailure as failure:
            if failure.cause is not Cause.PLANNING or not found:
                raise
        return (yield from self.move_to(lambda scene, q: found[0], message, speed_rad_s=0.8))

    def _lower(self, surface: Surface, above: PrePlacePose, held: HeldObject) -> Routine[None]:
        """Lowers the object until contact stops the hand, or to the height of the surface.

        The path down begins at its planned angles, not at the arm's present ones: near a singular posture their small
        difference decides whether a path exists. After contact the arm rises a little, or it would dip onto the surface
        as the gripper releases. Raises SkillFailure with cause PLANNING when no path exists.
        """
        message = f"putting the {self.thing} down on the {surface.name}"
        p_BH = self.model.X_BH(above.q_rad).translation() - (above.height_m - _SURELY_FREE_M) * UP_B
        early = self.contact_guard(-UP_B, _LAG_IN_CONTACT_M, math.inf)
        stopped = yield from self.move_straight(p_BH, message, q_from_rad=above.q_rad, guard=early)
        X_BH, gripper = self.model.X_BH(self.q_rad()), self.gripper
        tip_B = X_BH.rotation() @ np.array([gripper.fixed_tip_x_m, 0.0, gripper.fixed_z_m])
        low = held.drop_m(X_BH.rotation()) + float(tip_B[2]) < _LOW_TIP_M
        if not stopped:
            stopped = yield from self._press_down(message, _TIPS_RAD_S if low else self.options.lower_rad_s)
        if stopped:
            sweep_m = finger_sweep_m(X_BH, self.X_WB(), gripper) if low else 0.0
            yield from self.try_shift_hand(max(_RELAX_M, sweep_m) * UP_B, message)

    def _press_down(self, message: str, speed_rad_s: float) -> Routine[bool]:
        """Presses the object slowly down; returns whether contact stopped it. Fails when no line is feasible."""
        for part in (1.0, 0.85, 0.7, 0.5):
            with suppress(PlanningError):
                down_B = -part * (_SURELY_FREE_M + _PRESS_M) * UP_B
                return (yield from self.press(down_B, -UP_B, speed_rad_s, message))
        raise SkillFailure(Cause.PLANNING, f"the arm cannot lower the {self.thing} straight down")


def _by_distance(points_W: FloatArray, X_WB: RigidTransform) -> FloatArray:
    here = Pose2D.from_transform(X_WB)
    ahead = np.array([here.x_m + 0.2 * math.cos(here.yaw_rad), here.y_m + 0.2 * math.sin(here.yaw_rad)])
    return points_W[np.argsort(np.linalg.norm(points_W - ahead, axis=1))]
