"""From where an object is taken: the body heights to choose among, and the grasps that the arm reaches there.

A grasp counts as reached when the arm gets to it, to its pre-grasp and to the end of a lift without touching what is
known to stand around.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import islice, pairwise
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from pydrake.math import RigidTransform, RotationMatrix

from skills.api import ObjectObservation, Surface
from skills.detect.viewpoints import surface_boxes
from skills.manipulation.arm.arm_skill import ArmSkill
from skills.manipulation.arm.collision import ArmScene, Box
from skills.manipulation.arm.kinematics import ArmModel
from skills.manipulation.arm.solid_cells import boxes_of
from skills.manipulation.grasp.candidates import GraspCandidate, Target
from skills.manipulation.grasp.planning import PREGRASPS_M, lifts, within_reach
from skills.robot import Capabilities, FloatArray, GripperCapabilities, GripperKind

_LOW_SURFACE_M, _HIGH_SURFACE_M = 0.2, 0.72
_BELOW_LIMIT_M = 0.005
_OTHER_HEIGHT_COST: Final = 0.15
"""What a body height that is not the usual one costs: the body moves, and is less steady."""
_PADDING_M, _MARGIN_RAD = -0.002, 0.08
"""Fingertips end 1 mm above the surface where something thin lies."""
_LOOKED_AT = 60
_PARTS, _ABOVE_ARM_M = 9, 0.1
_BESIDE_COST, _OWN_M, _LOW_M, _LESS_M = 0.8, 0.05, 0.05, 0.01
_SURFACE_AROUND_M, _SURFACE_BAND_M, _KNOWN_ABOVE_M = 0.2, 0.06, 0.34
WIDE: Final = 0.9
"""How far the gripper is open, as a part of all that it opens, as it reaches for an object."""
_NARROW: Final = 0.6
"""The same among neighbours."""
_WIDE_PARALLEL: Final = 0.98
_LIFTS_FAR_M, _PARTS_OF_LIFT = 0.2, (0.25, 0.5, 0.75)
_GAP_BESIDE_M, _LESS_OPEN_RAD = 0.045, 0.2

CandidatesOf = Callable[[Target], list[GraspCandidate]]


@dataclass(frozen=True)
class Reached:
    """The best grasp that is reached with the body at a height: what it costs beyond the best there is."""

    cost: float
    height_m: float


@dataclass(frozen=True)
class ReachCheck:
    """What is needed to say how an object is reached from a pose of the body.

    The boxes that stand around, without the object, are given in the body frame of the moment at X_WB; `beside` are
    those of its neighbours, which cells show larger than they are: a grasp that touches only them is a last choice.
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
        """The best height, the first of which is the usual one; None where no grasp is reached from any.

        `at` gives X_WB for a height.
        """
        found = self.all(at, heights_m)
        return min(found, key=lambda reached: reached.cost, default=None)

    def all(self, at: Callable[[float], RigidTransform], heights_m: Sequence[float]) -> list[Reached]:
        """The best grasp from each height from which one is reached; the usual height alone where that is enough."""
        found = []
        for height_m in heights_m:
            cost = self._cost(at(height_m))
            if cost is None:
                continue
            if height_m == heights_m[0] and cost < _OTHER_HEIGHT_COST:
                return [Reached(cost, height_m)]
            found.append(Reached(cost + (0.0 if height_m == heights_m[0] else _OTHER_HEIGHT_COST), height_m))
        return found

    def arm_W(self, at: Callable[[float], RigidTransform], heights_m: Sequence[float]) -> FloatArray:
        """Points (N, 3) in the world along the arm and above it at the best grasp, before it and after a lift."""
        reached = self.best(at, heights_m)
        X_WB = None if reached is None else at(reached.height_m)
        best = None if X_WB is None else self._best(X_WB)[0]
        if X_WB is None or best is None:
            return np.empty((0, 3))
        model = self.scene.model
        along_B = np.concatenate([_along(model.points_B(q)) for q in _postures(self.scene, best, up_B(X_WB))])
        along_W = along_B @ X_WB.rotation().matrix().T + X_WB.translation()
        return np.concatenate([along_W, along_W + [0.0, 0.0, _ABOVE_ARM_M]])

    def _cost(self, X_WB: RigidTransform) -> float | None:
        best, beyond = self._best(X_WB)
        return None if best is None else beyond

    def _best(self, X_WB: RigidTransform) -> tuple[GraspCandidate | None, float]:
        """The best grasp that is reached from X_WB, and what it costs beyond the best there is."""
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
    """Grasps that the arm reaches with the body at X_WB, best first, and the cost of the best there is.

    Contact is not looked at.
    """
    candidates = candidates_of(observed_target(seen, X_WB))
    reached = (each for each in candidates if within_reach(model, each, up_B(X_WB), _MARGIN_RAD))
    return list(islice(reached, _LOOKED_AT)), candidates[0].cost if candidates else np.inf


def up_B(X_WB: RigidTransform) -> FloatArray:
    """Up in the body frame."""
    return np.asarray(X_WB.rotation().matrix().T @ np.array([0.0, 0.0, 1.0]))


def _postures(scene: ArmScene, candidate: GraspCandidate, up_B: FloatArray) -> list[FloatArray]:
    """Arm angles at a grasp, before it and after a lift at which it touches nothing; empty when there are none."""
    X_BH = candidate.X_BH
    lifted = (RigidTransform(X_BH.rotation(), X_BH.translation() + way_B) for way_B in lifts(scene.model, X_BH, up_B))
    found = list[FloatArray]()
    for ways in ([X_BH], map(candidate.retreated, PREGRASPS_M), lifted):
        q_rad = next((q for X in ways for q in scene.model.inverse(X, _MARGIN_RAD) if scene.free(q)), None)
        if q_rad is None:
            return []
        found.append(q_rad)
    return found


def _along(points_B: FloatArray) -> FloatArray:
    """Points (N, 3) along the segments between points, a few on each."""
    parts = np.linspace(0.0, 1.0, _PARTS)[:, None]
    return np.concatenate([a + parts * (b - a) for a, b in pairwise(points_B)])


def wide_share(gripper: GripperCapabilities) -> float:
    """How far a gripper is open, as a part of all that it opens, as it reaches for an object."""
    return WIDE if gripper.kind is GripperKind.HINGED else _WIDE_PARALLEL


def openings(candidates: Sequence[GraspCandidate], gripper: GripperCapabilities) -> tuple[float, ...]:
    """Openings of the gripper for the approach: wide and, as neighbours may leave no room for it, as far as needed.

    The opening is about proportional to the finger's angle.
    """
    wide = wide_share(gripper) * gripper.widest
    narrow = gripper.opening_for(min(each.width_m for each in candidates) + _GAP_BESIDE_M)
    return (wide, narrow) if narrow < wide - gripper.like_turn(_LESS_OPEN_RAD) else (wide,)


def body_heights_m(base_m: float, capabilities: Capabilities) -> tuple[float, ...]:
    """Heights of the body's origin over the floor to take an object that stands base_m over the floor, the usual first.

    A robot whose body cannot change its height has one.
    """
    low, high = capabilities.height_range_m
    lowest, usual = min(capabilities.standing_height_m, low + _BELOW_LIMIT_M), capabilities.standing_height_m
    highest = max(usual, high - _BELOW_LIMIT_M)
    first = lowest if base_m < _LOW_SURFACE_M else usual if base_m < _HIGH_SURFACE_M else highest
    between = [low + part * (high - low) for part in _PARTS_OF_LIFT] if high - low > _LIFTS_FAR_M else []
    return tuple(dict.fromkeys((first, usual, *between, lowest, highest)))


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


def resting_on(seen: ObjectObservation, surfaces: Sequence[Surface]) -> ObjectObservation:
    """An object where it was seen, but not sunk into the surface that it lies on: then no fingers would get round it.

    From a distance a flat object seems to be lower than it is, by as much as it is high.
    """
    x, y, z = seen.position_W
    top_m = max((surface.height_m for surface in surfaces if surface.name == seen.surface), default=-np.inf)
    return replace(seen, position_W=(x, y, max(z, float(top_m) + 0.5 * seen.size_m[2])))


def space_about(
    seen: ObjectObservation, half_m: float = _SURFACE_AROUND_M
) -> tuple[tuple[FloatArray, FloatArray], tuple[FloatArray, FloatArray]]:
    """Least and greatest corners (world, m) of the space on its surface about an object, and of its own space.

    What is tall reaches higher than what is known about it: the cells of its own top are no obstacle.
    """
    x, y, z = seen.position_W
    length_m, width_m, height_m = seen.size_m
    low_m, own_m = z - 0.5 * height_m - _SURFACE_BAND_M, 0.5 * max(length_m, width_m) + _OWN_M
    corners = ((half_m, low_m + _SURFACE_BAND_M + _KNOWN_ABOVE_M), (own_m, z + 0.5 * height_m + _OWN_M))
    about, own = (
        (np.array([x - side_m, y - side_m, low_m]), np.array([x + side_m, y + side_m, top_m]))
        for side_m, top_m in corners
    )
    return about, own


def _beside(seen: ObjectObservation, p_W: FloatArray) -> NDArray[np.bool_]:
    """Which points (N, 3) are in the space about an object, but neither its own nor just above its surface."""
    base_m = seen.position_W[2] - 0.5 * seen.size_m[2]
    low, high = space_about(seen)[0]
    inside = np.all((p_W > low) & (p_W < high), axis=1) & (p_W[:, 2] > base_m + _LOW_M)
    turn = RotationMatrix.MakeZRotation(-seen.yaw_rad).matrix()
    off = np.abs((p_W - np.array(seen.position_W)) @ turn.T)[:, :2]
    return np.asarray(inside & np.any(off > 0.5 * np.array(seen.size_m[:2]) + _OWN_M, axis=1))


def _less(box: Box) -> Box:
    """A little less of a box, since cells are larger than what is in them."""
    x, y, z = (max(side - 2.0 * _LESS_M, 0.01) for side in box.size_m)
    return Box(box.X_FG, (x, y, z))


def reach_check(
    skill: ArmSkill[Any], seen: ObjectObservation, surfaces: Sequence[Surface], beyond_m: float = 0.0
) -> Callable[[], ReachCheck]:
    """Gives, inside a Worker job, the check of how a skill's arm reaches an object on some surfaces.

    Around it stands what the hand camera has seen within the arm's reach and `beyond_m`, but just about the object.
    """
    X_WB, known_W = skill.X_WB(), skill.known_W
    seen = resting_on(seen, surfaces)
    skill.known_W = space_about(seen)
    boxes = [*surface_boxes(surfaces, X_WB), *skill.seen_boxes(beyond_m)]
    skill.known_W = known_W
    candidates = partial(skill.context.stack.grasp_planner.candidates, p_BS=skill.model.p_BS, gripper=skill.gripper)
    cells = skill.context.solid.cells
    beside = [_less(box) for box in boxes_of(cells, X_WB, partial(_beside, seen))]
    scene_now, widest, wide = skill.scene_now(boxes), skill.widest, wide_share(skill.gripper)

    def check() -> ReachCheck:
        """The check, with a collision scene of its own boxes."""
        return ReachCheck(scene_now(), boxes, X_WB, seen, candidates, widest, beside, wide)

    return check
