"""Reach of the arm to an object: candidate body heights, grasps within reach, and space that no picture shows.

A grasp is within reach when the arm gets to it, to its pre-grasp and to the end of a lift without contact with known
obstacles.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import islice, pairwise, product
from typing import Any, Final, TypeVar

import numpy as np
from numpy.typing import NDArray
from pydrake.math import RigidTransform, RotationMatrix

from skills.api import ObjectObservation, Surface
from skills.detect.viewpoints import surface_boxes
from skills.manipulation.arm.arm_skill import ArmSkill
from skills.manipulation.arm.collision import ArmScene, Box
from skills.manipulation.arm.kinematics import ArmModel
from skills.manipulation.arm.looking_skill import LookingSkill
from skills.manipulation.arm.solid_cells import boxes_around, never_seen
from skills.manipulation.grasp.candidates import GraspCandidate
from skills.manipulation.grasp.close_view import OWN_M, SURFACE_AROUND_M, WIDE, space_about, square
from skills.manipulation.grasp.placements import UPRIGHT_M, Target
from skills.manipulation.grasp.planning import PREGRASPS_M, lifts, within_reach
from skills.robot import Capabilities, FloatArray, GripperCapabilities, GripperKind
from skills.routine import PlanningAttempt, Routine

_LOW_SURFACE_M = 0.2
"""Height of an object below which the body goes to its lowest height."""
_HIGH_SURFACE_M = 0.72
"""Height of an object above which the body goes to its highest height."""
_BELOW_LIMIT_M = 0.005
"""Distance that the body keeps from the ends of its range of heights."""
_LIFTS_FAR_M = 0.2
"""A body with a larger range of heights than this also tries heights in between."""
_PARTS_OF_LIFT = (0.25, 0.5, 0.75)
_HEIGHTS_TRIED = 2
_OTHER_HEIGHT_COST: Final = 0.15
"""Cost of an unusual body height: the body moves, and is less steady."""
_PADDING_M = -0.002
"""Padding of the check: fingertips end 1 mm above the surface of a thin object."""
_MARGIN_RAD = 0.08
_MOST_CHECKED = 60
"""Number of grasps within reach that are checked for contact."""
_PARTS = 9
"""Points on each segment of the arm."""
_ABOVE_ARM_M = 0.1
"""Height of the space above the arm that a picture must have shown."""
_BESIDE_COST = 0.8
"""Cost of a grasp that touches cells of a neighbour."""
_LOW_M = 0.05
"""Least height above the surface of a neighbour's cells."""
_LESS_M = 0.01
"""Margin by which a neighbour's boxes are smaller than its cells."""
_NARROW: Final = 0.6
"""The same among neighbours."""
_WIDE_PARALLEL: Final = 0.98
"""Opening of a parallel gripper for the approach, as a fraction of the maximum opening."""
_GAP_BESIDE_M = 0.045
"""Clearance at an object's sides for a gripper that opens only as far as needed."""
_LEAST_BESIDE_M = 0.025
"""Least clearance between the fingers and an object that passes between them."""
_LESS_OPEN_RAD = 0.2
"""Least difference between a narrower opening and the wide one."""
_GRASPABLE_M = 0.09
"""Largest side of an upright object as seen from afar."""
_UNSEEN_NEAR_M = 0.3
"""Distance from an object within which unseen space matters."""
_UNSEEN_FURTHEST_M = 1.6
"""Distance from the shoulder beyond which the hand camera shows too little of a space."""
_NEAREST_VIEW_M = 0.4
"""Least distance of a viewpoint from the unseen space."""
_FEWEST_UNSEEN = 3
"""Number of unseen points from which on the skill looks."""

ChosenT = TypeVar("ChosenT")
CandidatesOf = Callable[[Target], list[GraspCandidate]]


@dataclass(frozen=True)
class Reached:
    """Body height with a grasp within reach, and by how much the grasp costs more than the cheapest candidate."""

    cost: float
    height_m: float


@dataclass(frozen=True)
class ReachCheck:
    """Checks the arm's reach to an object from a pose of the body.

    `boxes` are the obstacles without the object, in the body frame at X_WB. `beside` are boxes around the cells of its
    neighbours, and too large for that reason: a grasp that touches only these is a last choice.
    """

    scene: ArmScene
    boxes: Sequence[Box]
    X_WB: RigidTransform
    seen: ObjectObservation
    candidates_of: CandidatesOf
    widest: float
    beside: Sequence[Box] = ()
    wide: float = WIDE

    def best(self, at: Callable[[float], RigidTransform], heights_m: Sequence[float]) -> Reached | None:
        """Returns the cheapest body height with its grasp; None when no grasp is within reach.

        `at` returns X_WB for a height; the first of `heights_m` is the usual one.
        """
        found = self.all(at, heights_m)
        return min(found, key=lambda reached: reached.cost, default=None)

    def all(self, at: Callable[[float], RigidTransform], heights_m: Sequence[float]) -> list[Reached]:
        """Returns the best grasp from each height; only that from the usual height when it is cheap enough."""
        found = []
        for height_m in heights_m:
            best, cost = self._best(at(height_m))
            if best is None:
                continue
            if height_m == heights_m[0] and cost < _OTHER_HEIGHT_COST:
                return [Reached(cost, height_m)]
            found.append(Reached(cost + (0.0 if height_m == heights_m[0] else _OTHER_HEIGHT_COST), height_m))
        return found

    def arm_W(self, at: Callable[[float], RigidTransform], heights_m: Sequence[float]) -> FloatArray:
        """Points (N, 3) in the world along and above the arm at the best grasp, before that grasp and after a lift."""
        reached = self.best(at, heights_m)
        X_WB = None if reached is None else at(reached.height_m)
        best = None if X_WB is None else self._best(X_WB)[0]
        if X_WB is None or best is None:
            return np.empty((0, 3))
        model = self.scene.model
        along_B = np.concatenate([_along(model.points_B(q)) for q in _postures(self.scene, best, up_B(X_WB))])
        along_W = along_B @ X_WB.rotation().matrix().T + X_WB.translation()
        return np.concatenate([along_W, along_W + [0.0, 0.0, _ABOVE_ARM_M]])

    def _best(self, X_WB: RigidTransform) -> tuple[GraspCandidate | None, float]:
        """Returns the best grasp within reach from X_WB, and by how much it costs more than the cheapest candidate."""
        reached, least = reached_grasps(self.scene.model, self.candidates_of, X_WB, self.seen)
        self.scene.set_padding(_PADDING_M)
        spaces = [(self.boxes, self.wide, _BESIDE_COST if self.beside else 0.0)]
        if self.beside:
            spaces = [((*self.boxes, *self.beside), _NARROW, 0.0), *spaces]
        for boxes, opening, extra in spaces:
            self.scene.set_boxes(boxes, X_WB.inverse() @ self.X_WB)
            self.scene.set_opening(opening * self.widest)
            best = next((each for each in reached if _postures(self.scene, each, up_B(X_WB))), None)
            if best is not None:
                return best, best.cost - least + extra
        return None, np.inf


def reached_grasps(
    model: ArmModel, candidates_of: CandidatesOf, X_WB: RigidTransform, seen: ObjectObservation
) -> tuple[list[GraspCandidate], float]:
    """Returns the grasps within reach from X_WB, best first, and the cheapest candidate's cost; ignores contact."""
    candidates = candidates_of(observed_target(seen, X_WB))
    reached = (each for each in candidates if within_reach(model, each, up_B(X_WB), _MARGIN_RAD))
    return list(islice(reached, _MOST_CHECKED)), candidates[0].cost if candidates else np.inf


def up_B(X_WB: RigidTransform) -> FloatArray:
    """Unit vector (3,) that points up, in the body frame."""
    return np.asarray(X_WB.rotation().matrix().T @ np.array([0.0, 0.0, 1.0]))


def _postures(scene: ArmScene, candidate: GraspCandidate, up_B: FloatArray) -> list[FloatArray]:
    """Returns free arm angles at a grasp, before it and after a lift; an empty list unless all three exist."""
    X_BH = candidate.X_BH
    lifted = (RigidTransform(X_BH.rotation(), X_BH.translation() + lift_B) for lift_B in lifts(scene.model, X_BH, up_B))
    found = list[FloatArray]()
    for poses in ([X_BH], map(candidate.retreat, PREGRASPS_M), lifted):
        q_rad = next((q for X in poses for q in scene.model.inverse(X, _MARGIN_RAD) if scene.free(q)), None)
        if q_rad is None:
            return []
        found.append(q_rad)
    return found


def _along(points_B: FloatArray) -> FloatArray:
    """Points (N, 3) along the segments between points."""
    parts = np.linspace(0.0, 1.0, _PARTS)[:, None]
    return np.concatenate([a + parts * (b - a) for a, b in pairwise(points_B)])


def wide_share(gripper: GripperCapabilities) -> float:
    """Opening of a gripper that reaches for an object, as a fraction of its maximum opening."""
    return WIDE if gripper.kind is GripperKind.HINGED else _WIDE_PARALLEL


def openings(candidates: Sequence[GraspCandidate], gripper: GripperCapabilities) -> tuple[float, ...]:
    """Returns openings for the approach: a wide one and, for tight space among neighbours, two narrower ones.

    The narrower ones fit the narrowest and the widest grasp. An opening is about proportional to the finger's angle.
    """
    widths_m, found = [each.width_m for each in candidates], [wide_share(gripper) * gripper.widest]
    for width_m in (min(widths_m), max(widths_m)):
        narrow = gripper.opening_for(width_m + _GAP_BESIDE_M)
        if narrow < found[0] and min(abs(narrow - each) for each in found) > gripper.like_turn(_LESS_OPEN_RAD):
            found.append(narrow)
    return tuple(found)


def passing(
    candidates: Sequence[GraspCandidate], opening: float, gripper: GripperCapabilities
) -> Sequence[GraspCandidate]:
    """Returns the grasps whose object passes between the fingers at an opening."""
    if opening >= wide_share(gripper) * gripper.widest:
        return candidates
    return [each for each in candidates if gripper.opening_for(each.width_m + _LEAST_BESIDE_M) <= opening]


def body_heights_m(base_m: float, capabilities: Capabilities) -> tuple[float, ...]:
    """Body heights (m above the floor) for an object base_m above the floor, the usual one first.

    A robot whose body height is fixed has only one.
    """
    low, high = capabilities.height_range_m
    lowest, usual = min(capabilities.standing_height_m, low + _BELOW_LIMIT_M), capabilities.standing_height_m
    highest = max(usual, high - _BELOW_LIMIT_M)
    first = lowest if base_m < _LOW_SURFACE_M else usual if base_m < _HIGH_SURFACE_M else highest
    between = [low + part * (high - low) for part in _PARTS_OF_LIFT] if high - low > _LIFTS_FAR_M else []
    return tuple(dict.fromkeys((first, usual, *between, lowest, highest)))


def observed_target(seen: ObjectObservation, X_WB: RigidTransform) -> Target:
    """Returns an observation as a grasp target: its box filled with points.

    A wide upright object counts as graspable: a close view may show a neck or a handle.
    """
    length, width, height = seen.size_m
    if height > UPRIGHT_M:
        length, width = min(length, _GRASPABLE_M), min(width, _GRASPABLE_M)
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
    is_round = height > UPRIGHT_M and length < 1.2 * width
    return Target(points, (float(centre[0]), float(centre[1])), yaw, length, width, height, base_m, is_round)


def raise_onto_surface(seen: ObjectObservation, surfaces: Sequence[Surface]) -> ObjectObservation:
    """Returns the observation raised onto its surface, because fingers cannot get around a sunken object.

    From a distance the estimated height of a flat object is too low, by up to the object's height.
    """
    x, y, z = seen.position_W
    top_m = max((surface.height_m for surface in surfaces if surface.name == seen.surface), default=-np.inf)
    return replace(seen, position_W=(x, y, max(z, float(top_m) + 0.5 * seen.size_m[2])))


def _beside(seen: ObjectObservation, p_W: FloatArray) -> NDArray[np.bool_]:
    """Mask (N,) of the points around an object, without its own points and those just above its surface."""
    base_m = seen.position_W[2] - 0.5 * seen.size_m[2]
    low, high = space_about(seen)[0]
    inside = np.all((p_W > low) & (p_W < high), axis=1) & (p_W[:, 2] > base_m + _LOW_M)
    turn = RotationMatrix.MakeZRotation(-seen.yaw_rad).matrix()
    off = np.abs((p_W - np.array(seen.position_W)) @ turn.T)[:, :2]
    return np.asarray(inside & np.any(off > 0.5 * np.array(seen.size_m[:2]) + OWN_M, axis=1))


def _less(box: Box) -> Box:
    """Returns the box shrunk a little, because cells are larger than their content."""
    x, y, z = (max(side - 2.0 * _LESS_M, 0.01) for side in box.size_m)
    return Box(box.X_FG, (x, y, z))


def reach_check(
    skill: ArmSkill[Any], seen: ObjectObservation, surfaces: Sequence[Surface], beyond_m: float = 0.0
) -> Callable[[], ReachCheck]:
    """Returns a function that builds, inside a Worker job, the check of how a skill's arm reaches an object.

    Obstacles are the surfaces, and the cameras' solid cells within the arm's reach plus `beyond_m`, except just around
    the object.
    """
    X_WB, known_W = skill.X_WB(), skill.known_W
    seen = raise_onto_surface(seen, surfaces)
    skill.known_W = space_about(seen)
    boxes = [*surface_boxes(surfaces, X_WB), *skill.seen_boxes(beyond_m)]
    skill.known_W = known_W
    candidates = partial(skill.context.stack.grasp_planner.candidates, p_BS=skill.model.p_BS, gripper=skill.gripper)
    cells = skill.context.solid.cells
    beside = [_less(box) for box in boxes_around(cells, X_WB, partial(_beside, seen))]
    scene_now, widest, wide = skill.scene_now(boxes), skill.gripper.widest, wide_share(skill.gripper)

    def check() -> ReachCheck:
        """Builds the check, with a collision scene of its own."""
        return ReachCheck(scene_now(), boxes, X_WB, seen, candidates, widest, beside, wide)

    return check


def choose_with_look(
    skill: LookingSkill[Any], seen: ObjectObservation, choose: Callable[[], Routine[tuple[ChosenT, FloatArray]]]
) -> Routine[ChosenT]:
    """Returns the choice that `choose` makes; `choose` also returns the arm's points (N, 3, world) for that choice.

    Looks once at points near the object that no picture has shown yet, and then chooses again. The hand camera looks
    down at objects: the board above a shelf is in no picture, and the arm would hit it.
    """
    chosen, arm_W = yield from choose()
    if (yield from look_into_unseen(skill, seen, arm_W)):
        chosen, _ = yield from choose()
    return chosen


def look_into_unseen(skill: LookingSkill[Any], seen: ObjectObservation, arm_W: FloatArray) -> Routine[bool]:
    """Looks at the arm's points (world) near an object that no picture has shown; returns whether it looked.

    Does not look when the object is too far away to show its surroundings, or when no path leads to a viewpoint.
    """
    if not skill.object_camera.on_hand:  # a head camera views from above what the arm would meet
        return False
    offsets = arm_W - np.array(seen.position_W)
    near_W = arm_W[np.linalg.norm(offsets[:, :2], axis=1) < _UNSEEN_NEAR_M]
    unseen_W = near_W[never_seen(near_W, skill.context.solid.views)]
    if len(unseen_W) < _FEWEST_UNSEEN:
        return False
    p_BT = skill.X_WB().inverse() @ unseen_W.mean(axis=0)
    if np.linalg.norm(p_BT - skill.model.p_BS) > _UNSEEN_FURTHEST_M:
        return False
    message = f"looking above the {seen.kind}"
    with PlanningAttempt() as attempt:
        yield from skill.look_at(p_BT, level_viewpoints(skill.model, p_BT), message)
    if attempt.failure is not None:
        return False
    yield from skill.picture(message)
    return True


def level_viewpoints(model: ArmModel, p_BT: FloatArray) -> list[FloatArray]:
    """Camera positions about as high as p_BT on the shoulder's side; low ones first, which see boards from below."""
    ahead = (p_BT - model.p_BS) * [1.0, 1.0, 0.0]
    ahead = ahead / max(float(np.linalg.norm(ahead)), 1e-6)
    places = (
        [*(model.p_BS + radius * ahead)[:2], p_BT[2] + up_m]
        for up_m, radius in product((-0.1, -0.2, 0.0, -0.3, 0.1), (0.25, 0.35, 0.15))
    )
    return [np.array(place) for place in places if np.linalg.norm(np.array(place) - p_BT) > _NEAREST_VIEW_M]


def heights_to_grasp(skill: LookingSkill[Any], seen: ObjectObservation) -> Routine[list[float]]:
    """Chooses body heights (m) from which the arm is likely to reach the object, the best first; at least one."""
    base_m = seen.position_W[2] - 0.5 * seen.size_m[2]
    heights_m = body_heights_m(base_m, skill.context.robot.capabilities())

    def choose() -> Routine[tuple[list[float], FloatArray]]:
        pose = skill.context.pose()
        check_now = reach_check(skill, seen, [square(seen.position_W, base_m, "guess", SURFACE_AROUND_M)])

        def chosen() -> tuple[list[float], FloatArray]:
            check = check_now()
            found = sorted(check.all(pose.transform, heights_m), key=lambda each: each.cost)
            return [each.height_m for each in found][:_HEIGHTS_TRIED], check.arm_W(pose.transform, heights_m)

        message = f"choosing how high to stand before the {seen.kind}"
        return (yield from skill.compute(chosen, latency_s=0.1, name="choose a height", message=message))

    return (yield from choose_with_look(skill, seen, choose)) or [heights_m[0]]
