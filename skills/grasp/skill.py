"""The grasp skill: look closely, choose a grasp, take the object, lift it and make sure that it is held."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import reduce
from typing import ClassVar

import numpy as np
from pydrake.math import RigidTransform

from skills.api import Cause, LocalisationEstimate, ObjectObservation, Succeeded, Surface
from skills.arm.arm_skill import GRIPPER_FORCE_N, ArmSkill
from skills.arm.collision import ArmScene, Box
from skills.arm.poses import carry_configuration, close_viewpoints, look_configuration, overview_viewpoints
from skills.arm.routine import Routine, SkillFailure
from skills.detect.viewpoints import cluster_box, cluster_boxes, surface_boxes
from skills.grasp.candidates import GraspCandidate, Target
from skills.grasp.memory import TriedGrasp, others_first, tried_grasp
from skills.grasp.planning import PREGRASPS_M, GraspPlan, Surroundings, body_height_m, lifts
from skills.perception.detection_3d import Detection3D, detections_3d
from skills.perception.detector.camera_images import DETECTION_LATENCY_S, detections_in
from skills.perception.surface_segmentation import Cluster, SurfaceView, cluster_of, parted, view_surface
from skills.quantities import Force, Length, Margin, Turn
from skills.robot import FloatArray, Image

_LOOK_HALF_SIDE_M = 0.4
_CLOSED_RAD = 0.06
_SURFACE_AROUND_M = 0.2
_FEEL_S = 0.4
_AT_THING_M = 0.4
_DRAW_BACK_M = (0.18, 0.14, PREGRASPS_M[0], PREGRASPS_M[-1])


@dataclass(frozen=True)
class GraspInputs:
    """The object as it was seen; grasps like those in `avoid` are the last choice."""

    observation: ObjectObservation
    avoid: tuple[TriedGrasp, ...] = ()


@dataclass(frozen=True)
class CloseView:
    """The object and what is around it, seen closely; X_WB at that time."""

    target: Target
    boxes: tuple[Box, ...]
    target_box: Box
    X_WB: RigidTransform


@dataclass(frozen=True)
class GraspOptions:
    """How firmly is gripped (N), and when the object counts as lost.

    The object is looked for within `same_object_m` of where it was seen. A gripper that opens or closes by `slip_rad`
    while it lifts has lost it. After lifting the hand draws back by `pull_back_m`.
    """

    force_n: Force = 80.0
    same_object_m: Length = 0.12
    slip_rad: Turn = 0.12
    pull_back_m: Margin = 0.12


class Grasp(ArmSkill[GraspInputs]):
    """Grasps an object and holds it near the body. On failure it opens the gripper and stows the arm.

    The output `tried` is `avoid` and the grasp of this attempt, after a failure, too.
    """

    name = "grasp"
    Inputs = GraspInputs
    Options: ClassVar[type] = GraspOptions
    options: GraspOptions
    outputs: ClassVar[Mapping[str, type]] = {"tried": tuple[TriedGrasp, ...]}
    causes: ClassVar[Mapping[Cause, str]] = {
        Cause.PRECONDITION: "the object is not where it was seen, the gripper is full, or there is no arm",
        Cause.PLANNING: "no grasp is within reach and free",
        Cause.EXECUTION: "the arm or the gripper did not reach its goal",
        Cause.POSTCONDITION: "the gripper closed on nothing, or the object slipped out",
    }
    default_timeout_s = 120.0
    max_data_age_s: ClassVar[Mapping[str, float]] = {"joints": 0.5, "gripper": 0.5}
    changes_world = True
    gripper_before = False
    gripper_after = True

    def undone(self, inputs: GraspInputs) -> str | None:
        """Judged by the gripper."""
        return None if self.context.robot.gripper().holding else f"the {inputs.observation.thing} is not in the gripper"

    def run(self, inputs: GraspInputs) -> Routine[Succeeded]:
        """Look, plan, take, lift, carry."""
        thing = inputs.observation.thing
        if self.context.robot.gripper().holding:
            raise SkillFailure(Cause.PRECONDITION, "the gripper holds something already")
        seen, capabilities = inputs.observation, self.context.robot.capabilities()
        try:
            height_m = body_height_m(seen.position_W[2] - 0.5 * seen.size_m[2], capabilities)
            yield from self.stand_at(height_m, f"standing up to the {thing}")
            view = yield from self._look_closely(seen)
            plan = yield from self._plan(view, str(thing), inputs.avoid)
            self._tried = (*inputs.avoid, tried_grasp(plan.candidate, view.target.centre_B, view.X_WB))
            yield from self._take(plan, str(thing))
        except SkillFailure as failure:
            yield from self._let_go()
            raise self._telling(failure) from failure
        try:
            yield from self._carry(view, plan.candidate, str(thing))
        except SkillFailure as failure:
            raise self._telling(failure) from failure
        yield from self.stand_at(capabilities.standing_height_m, f"carrying the {thing}")
        return Succeeded(f"holding the {thing}", {"tried": self._tried})

    def begin(self, inputs: GraspInputs) -> None:
        """Forget an earlier attempt, but not the grasps that `inputs` names."""
        self._tried = inputs.avoid
        super().begin(inputs)

    def resume(self, inputs: GraspInputs) -> None:
        """Go on after a pause or a restart."""
        self._tried = inputs.avoid
        super().resume(inputs)

    def _telling(self, failure: SkillFailure) -> SkillFailure:
        """A failure that says which grasps were tried."""
        return SkillFailure(failure.cause, failure.message, {"tried": self._tried})

    def run_again(self, inputs: GraspInputs) -> Routine[Succeeded]:
        """An object in the gripper is taken along; with an empty gripper all begins anew."""
        seen = inputs.observation
        yield from self.pause(_FEEL_S, "feeling what the gripper holds")
        at_thing = self.hand_near(np.array(seen.position_W), _AT_THING_M)
        if not self.context.robot.gripper().holding:
            if at_thing:
                yield from self._let_go()
            return (yield from self.run(inputs))
        yield from self._take_along(seen, at_thing)
        return Succeeded(f"the {seen.thing} was in the gripper already; holding it", {"tried": self._tried})

    def _take_along(self, seen: ObjectObservation, at_thing: bool) -> Routine[None]:
        """Clamp, lift and draw back what the gripper grips, carry it near the body, and check that it is held."""
        yield from self.move_gripper(0.0, self.options.force_n, f"closing on the {seen.thing}")
        yield from self.pause(_FEEL_S, f"closing on the {seen.thing}")
        message, opening = f"carrying the {seen.thing}", self._check_held(str(seen.thing), None)
        R_BH = self.model.X_BH(self.q_rad()).rotation()
        if at_thing:
            yield from self._lift_again(f"lifting the {seen.thing}")
            yield from self.try_shift_hand(-self.options.pull_back_m * R_BH.matrix()[:, 0] * [1.0, 1.0, 0.0], message)
        yield from self.move_to(lambda scene, q: carry_configuration(scene, R_BH, q), message, speed_rad_s=0.9)
        yield from self.pause(0.2, message)
        self._check_held(str(seen.thing), opening)
        yield from self.stand_at(self.context.robot.capabilities().standing_height_m, message)

    def _lift_again(self, message: str) -> Routine[None]:
        """Lift what the gripper grips in the first way that the arm finds; where it finds none, it is carried low."""
        for way_B in lifts(self.model, self.model.X_BH(self.q_rad()), self._up_B()):
            if (yield from self.try_shift_hand(way_B, message)):
                return

    def _look_closely(self, seen: ObjectObservation) -> Routine[CloseView]:
        """A view of the object from 0.4 m; the plane and what stands around come with it."""
        message = f"looking closely at the {seen.thing}"
        base_m = seen.position_W[2] - 0.5 * seen.size_m[2]
        surface = _square(seen.position_W, base_m, seen.surface or "surface")
        self.boxes = surface_boxes([_square(seen.position_W, base_m, "guess", 0.25)], self.X_WB())
        X_HC = self.hand_camera.X_FC
        p_BT = self.X_WB().inverse() @ np.array(seen.position_W)

        def goal(scene: ArmScene, q: FloatArray) -> FloatArray:
            viewpoints = [*close_viewpoints(self.model.p_BS, p_BT), *overview_viewpoints(self.model, p_BT)]
            return look_configuration(scene, X_HC, viewpoints, p_BT, q)

        yield from self.move_to(goal, message)
        yield from self.clear_view(message)
        image = yield from self.picture(message)
        place, X_WB, detector = self.context.localiser.estimate(), self.X_WB(), self.context.detector

        def examine() -> CloseView | None:
            found = detections_in(detector, image)
            same_class = [each for each in found if each.class_name == seen.thing.name]
            placed = detections_3d(image, place, same_class, [surface])
            return _examine(image, X_WB, surface, seen, place, placed, self.options.same_object_m)

        view = yield from self.compute(examine, latency_s=DETECTION_LATENCY_S, name="detect closely", message=message)
        if view is None:
            raise SkillFailure(Cause.PRECONDITION, f"the {seen.thing} is no longer where it was seen")
        return view

    def _plan(self, view: CloseView, thing: str, avoid: tuple[TriedGrasp, ...]) -> Routine[GraspPlan]:
        self.boxes = view.boxes
        up_B = view.X_WB.rotation().matrix().T @ np.array([0.0, 0.0, 1.0])
        candidates = self.context.stack.grasp_planner.candidates(view.target, self.model.p_BS, self.gripper)
        candidates = others_first(candidates, avoid, view.target.centre_B, view.X_WB)
        if not candidates:
            raise SkillFailure(Cause.PLANNING, f"the {thing} is too wide for the gripper")
        opening = 0.9 * self.open_rad
        yield from self.move_gripper(opening, GRIPPER_FORCE_N, "opening the gripper")

        scene_now, q, stack = self.scene_now(), self.q_rad(), self.context.stack

        def plan() -> GraspPlan:
            scene = scene_now()
            scene.set_opening(opening)
            around = Surroundings(view.boxes, view.target_box, up_B)
            return stack.grasp_planner.plan(scene, q, candidates, around, stack.arm_planner, self._rng)

        return (
            yield from self.compute(plan, latency_s=0.6, name="plan grasp", message=f"planning how to take the {thing}")
        )

    def _take(self, plan: GraspPlan, thing: str) -> Routine[None]:
        """Reach, close, lift; raises SkillFailure with cause POSTCONDITION when it is not held then."""
        yield from self.follow(plan.to_pregrasp, f"reaching for the {thing}")
        yield from self.follow(plan.to_grasp, f"reaching for the {thing}")
        yield from self.move_gripper(0.0, self.options.force_n, f"closing on the {thing}")
        yield from self.pause(0.4, f"closing on the {thing}")
        opening = self._check_held(thing, None)
        yield from self._lift(plan.lift_B, f"lifting the {thing}")
        yield from self.pause(0.3, f"lifting the {thing}")
        self._check_held(thing, opening)

    def _lift(self, planned_B: FloatArray, message: str) -> Routine[None]:
        """Lift as planned or, where the hand came to stand otherwise, in another way. Raises SkillFailure."""
        others = lifts(self.model, self.model.X_BH(self.q_rad()), self._up_B())
        for lift_B in (planned_B, *others):
            if (yield from self.try_shift_hand(lift_B, message)):
                return
        raise SkillFailure(Cause.PLANNING, "the arm cannot lift the object from where it has hold of it")

    def _check_held(self, thing: str, opening_before_rad: float | None) -> float:
        gripper = self.context.robot.gripper()
        if gripper.opening_rad < _CLOSED_RAD or not gripper.holding:
            raise SkillFailure(Cause.POSTCONDITION, f"the gripper closed on nothing where the {thing} was seen")
        if opening_before_rad is not None and abs(gripper.opening_rad - opening_before_rad) > self.options.slip_rad:
            raise SkillFailure(Cause.POSTCONDITION, f"the {thing} slipped in the gripper while it was lifted")
        return gripper.opening_rad

    def _carry(self, view: CloseView, grasp: GraspCandidate, thing: str) -> Routine[None]:
        """Draw back from the surface, hold the object near the body, and check once more."""
        opening = self._check_held(thing, None)
        X_HB = grasp.X_BH.inverse()
        self.held = [_held_box(X_HB, view.target_box)]
        message = f"carrying the {thing}"
        ahead = grasp.X_BH.rotation().matrix()[:, 0] * [1.0, 1.0, 0.0]
        yield from self.try_shift_hand(-self.options.pull_back_m * ahead + 0.02 * self._up_B(), message)
        R_BH = self.model.X_BH(self.q_rad()).rotation()
        yield from self.move_to(lambda scene, q: carry_configuration(scene, R_BH, q), message, speed_rad_s=0.9)
        yield from self.pause(0.2, message)
        self._check_held(thing, opening)

    def _let_go(self) -> Routine[None]:
        """On failure: open the gripper, draw back, stow; what does not work is left out."""
        for recovery in (self._open, self._draw_back, self.try_stow, self._stand_down):
            try:
                yield from recovery()
            except SkillFailure:
                continue

    def _open(self) -> Routine[None]:
        yield from self.move_gripper(0.9 * self.open_rad, GRIPPER_FORCE_N, "opening the gripper after the failure")

    def _draw_back(self) -> Routine[None]:
        """Out of the object's reach, since the closing gripper must not catch it."""
        ahead = self.model.X_BH(self.q_rad()).rotation().matrix()[:, 0]
        for distance_m in _DRAW_BACK_M:
            if (yield from self.try_shift_hand(-distance_m * ahead, "drawing back after the failure")):
                break
        yield from self.move_gripper(0.0, GRIPPER_FORCE_N, "closing the empty gripper")

    def _stand_down(self) -> Routine[None]:
        yield from self.stand_at(self.context.robot.capabilities().standing_height_m, "standing as usual")

    def _up_B(self) -> FloatArray:
        return np.asarray(self.X_WB().rotation().matrix().T @ np.array([0.0, 0.0, 1.0]))


def _square(
    position_W: tuple[float, float, float], height_m: float, name: str, half: float = _LOOK_HALF_SIDE_M
) -> Surface:
    """A square patch about a point."""
    x, y, _ = position_W
    corners = ((x - half, y - half), (x + half, y - half), (x + half, y + half), (x - half, y + half))
    return Surface(name, corners, height_m)


def _examine(
    image: Image,
    X_WB: RigidTransform,
    surface: Surface,
    seen: ObjectObservation,
    place: LocalisationEstimate,
    found: tuple[Detection3D, ...],
    within_m: float,
) -> CloseView | None:
    view = view_surface(image, place.X_WO, surface, margin_m=0.0)
    if view is None:
        return None
    view = reduce(parted, found, view)
    cluster = _same_thing(view, seen, found, within_m)
    if cluster is None:
        return None
    others = [each for each in view.clusters if each is not cluster]
    target_box = cluster_box(cluster, X_WB)
    boxes = (*surface_boxes([_seen_surface(view, surface, cluster.shape.centre)], X_WB), *cluster_boxes(others, X_WB))
    return CloseView(_target(cluster, X_WB), boxes, target_box, X_WB)


def _seen_surface(view: SurfaceView, surface: Surface, centre: tuple[float, float]) -> Surface:
    """The surface as far as its own points show it, and as much all around the object, since its edge may be unseen."""
    xy = view.plane_points.p_W[:, :2]
    low, high = np.percentile(xy, [0.2, 99.8], axis=0)
    low, high = (
        np.minimum(low, np.array(centre) - _SURFACE_AROUND_M),
        np.maximum(high, np.array(centre) + _SURFACE_AROUND_M),
    )
    corners = ((low[0], low[1]), (high[0], low[1]), (high[0], high[1]), (low[0], high[1]))
    return Surface(surface.name, tuple((float(x), float(y)) for x, y in corners), view.plane.height_m)


def _same_thing(
    view: SurfaceView, seen: ObjectObservation, found: tuple[Detection3D, ...], within_m: float
) -> Cluster | None:
    """The cluster that is the object: detected as of its class and nearest, else nearest of all; None: all are far."""
    expected = np.array(seen.position_W[:2])

    def off(cluster: Cluster) -> float:
        return float(np.linalg.norm(np.array(cluster.shape.centre) - expected))

    classed = [cluster for each in found if (cluster := cluster_of(view.clusters, each)) is not None]
    for clusters in (classed, view.clusters):
        near = [cluster for cluster in clusters if off(cluster) < within_m]
        if near:
            return min(near, key=off)
    return None


def _target(cluster: Cluster, X_WB: RigidTransform) -> Target:
    X_BW = X_WB.inverse()
    shape = cluster.shape
    points_B = cluster.points.p_W @ X_BW.rotation().matrix().T + X_BW.translation()
    centre_B = X_BW @ np.array([*shape.centre, cluster.base_m])
    axis_B = X_BW.rotation().matrix() @ np.array([np.cos(shape.yaw_rad), np.sin(shape.yaw_rad), 0.0])
    return Target(
        points_B=points_B,
        centre_B=(float(centre_B[0]), float(centre_B[1])),
        yaw_rad=float(np.arctan2(axis_B[1], axis_B[0])),
        length_m=shape.length_m,
        width_m=shape.width_m,
        height_m=shape.height_m,
        base_m=float(centre_B[2]),
        round=shape.round,
    )


def _held_box(X_HB: RigidTransform, box: Box) -> Box:
    """A box in B as the upright box about it in H, for the object once it is held."""
    half = 0.5 * np.array(box.size_m)
    signs = np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).reshape(3, -1).T
    X_HG = X_HB @ box.X_FG
    corners = signs * half @ X_HG.rotation().matrix().T + X_HG.translation()
    low, high = corners.min(axis=0), corners.max(axis=0)
    return Box(RigidTransform(0.5 * (low + high)), tuple(float(v) for v in np.maximum(high - low - 0.02, 0.01)))  # type: ignore[arg-type]
