"""The grasp skill: look closely, choose a grasp, take the object, lift it and make sure that it is held."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from pydrake.math import RigidTransform

from skills.api import Cause, ObjectObservation, PlanningError, Succeeded
from skills.detect.viewpoints import surface_boxes
from skills.manipulation.arm.arm_skill import GRIPPER_FORCE_N
from skills.manipulation.arm.collision import ArmScene, box_corners
from skills.manipulation.arm.looking_skill import LookingSkill
from skills.manipulation.arm.poses import (
    carry_configuration,
    close_viewpoints,
    overview_viewpoints,
    sees_closely,
)
from skills.manipulation.grasp.candidates import THIN_M, GraspCandidate
from skills.manipulation.grasp.close_view import LOOK_HALF_SIDE_M, SURFACE_AROUND_M, CloseView, examine, square
from skills.manipulation.grasp.in_hand import held_box, turned_in_hand
from skills.manipulation.grasp.memory import others_first, tried_grasp
from skills.manipulation.grasp.planning import PREGRASPS_M, GraspPlan, Surroundings, lifts, pull_back_B
from skills.manipulation.grasp.ports import GraspInputs, GraspPorts, TriedGrasp
from skills.manipulation.grasp.reach import WIDE, body_heights_m, openings, reach_check, space_about, up_B
from skills.manipulation.grasp.refusals import known_too_heavy, least_mass_kg, without_grasp
from skills.manipulation.grasp.servo import Aim, aimed_approach, seen_shift
from skills.manipulation.grasp.unseen import look_into_unseen
from skills.perception.class_forms import ANY_OBJECT
from skills.perception.detection_3d import detections_3d
from skills.perception.detector.camera_images import DETECTION_LATENCY_S, detect_in_image
from skills.quantities import Force, Length, Margin, Turn
from skills.robot import FloatArray, GripperKind
from skills.routine import Routine, SkillFailure
from skills.world_model import IN_THE_WAY

_CLOSED_RAD = 0.06
_PER_KG_N, _PER_LEVER_N_M, _MOST_OF_FORCE = 12.0, 400.0, 0.95
_RELAX_M, _RELAX_THIN_M, _FEEL_M, _FEEL_RAD_S, _DOWN = 0.002, 0.0005, 0.014, 0.12, 0.8
_ASIDE_RAD, _MOST_OF_IT = (0.0, 0.8, -0.8), 0.7
_FEEL_S = 0.4
_AIM_LATENCY_S = 0.1
_AT_OBJECT_M = 0.4
_CARRY_RAD_S, _GENTLY_RAD_S, _LONG_LEVER_M = 0.9, 0.45, 0.05
_HEIGHTS_TRIED = 2
_PULL_BACK_UP_M = (0.02, 0.0)
_DRAW_BACK_M = (0.18, 0.14, PREGRASPS_M[0], PREGRASPS_M[-1])


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


class Grasp(GraspPorts, LookingSkill[GraspInputs]):
    """The skill that `GraspPorts` declares."""

    Options: ClassVar[type] = GraspOptions
    options: GraspOptions

    def undone(self, inputs: GraspInputs) -> str | None:
        """Judged by the gripper."""
        return None if self.context.robot.gripper().holding else f"the {inputs.observation.kind} is not in the gripper"

    def run(self, inputs: GraspInputs) -> Routine[Succeeded]:
        """Look, plan, take, lift, carry."""
        name = inputs.observation.kind
        if self.context.robot.gripper().holding:
            raise SkillFailure(Cause.PRECONDITION, "the gripper holds something already")
        seen = inputs.observation
        self._refuse_known_heavy(seen)
        try:
            view, plan = yield from self._take_where_it_is(inputs)
        except SkillFailure as failure:
            yield from self._let_go(draw_back=len(self._tried) > len(inputs.avoid))
            raise self._telling(failure) from failure
        try:
            yield from self._carry(plan.candidate, str(name), view.target.height_m < THIN_M)
            yield from self.stand_as_usual(f"carrying the {name}")
        except SkillFailure as failure:
            raise self._telling(failure) from failure
        return Succeeded(f"holding the {name}", self._learnt())

    def _take_where_it_is(self, inputs: GraspInputs) -> Routine[tuple[CloseView, GraspPlan]]:
        """Look, plan and take; what moved meanwhile is looked at once more. Raises SkillFailure."""
        seen = inputs.observation
        view, plan = yield from self._plan_from_a_height(seen, inputs.avoid)
        moved = yield from self._taken(view, plan, inputs)
        if moved:
            view, plan = yield from self._look_and_plan(seen, inputs.avoid)
            if (yield from self._taken(view, plan, inputs)):
                raise SkillFailure(Cause.PRECONDITION, f"the {seen.kind} moves while the hand reaches for it")
        return view, plan

    def _taken(self, view: CloseView, plan: GraspPlan, inputs: GraspInputs) -> Routine[bool]:
        """Reaches for the object and takes it, unless it is seen to have moved away: then whether it has."""
        seen = inputs.observation
        self._tried = (*inputs.avoid, tried_grasp(plan.candidate, view.target.centre_B, view.X_WB))
        aimed = yield from self._reach(view, plan, str(seen.kind))
        if aimed is None:
            return True
        yield from self._take(*aimed, seen)
        return False

    def _reach(self, view: CloseView, plan: GraspPlan, name: str) -> Routine[tuple[CloseView, GraspPlan] | None]:
        """Brings the hand to the pre-grasp; view and plans as they are aimed there (see `_aimed`)."""
        yield from self.follow(plan.to_pregrasp, f"reaching for the {name}")
        return (yield from self._aimed(view, plan, name))

    def _aimed(self, view: CloseView, plan: GraspPlan, name: str) -> Routine[tuple[CloseView, GraspPlan] | None]:
        """View and plan corrected across the fingers by what is seen from the pre-grasp; None: the object is not there.

        Along the fingers, the guard stops the hand; along the object, a few cm do not matter.
        """
        message = f"reaching for the {name}"
        if not self.object_camera.on_hand:
            return view, plan
        image = yield from self.picture(message, settle_s=0.0)
        X_BC = image.frames.pose("body").inverse() @ image.frames.pose(image.camera_frame)
        scene_now = self.scene_now([*view.boxes, *self.seen_boxes()])

        def aim() -> Aim | None:
            found = seen_shift(view.target, image, X_BC)
            return aimed_approach(found, plan, self.model, scene_now)

        aimed = yield from self.compute(aim, latency_s=_AIM_LATENCY_S, name="aim", message=message)
        if aimed is None:
            return None
        offset_B, approach = aimed
        if approach is None or not (yield from self.try_shift_hand(offset_B, message, clear_of_boxes=True)):
            return view, plan
        X_BH = RigidTransform(offset_B) @ plan.candidate.X_BH
        plan = replace(plan, candidate=replace(plan.candidate, X_BH=X_BH), to_grasp=approach[0], last_bit=approach[1])
        return view.moved(offset_B), plan

    def _plan_from_a_height(
        self, seen: ObjectObservation, avoid: tuple[TriedGrasp, ...]
    ) -> Routine[tuple[CloseView, GraspPlan]]:
        """Looks and plans with the body at the height that suits best, or at another where that one does not do."""

        heights_m = yield from self._heights(seen)
        message = f"standing up to the {seen.kind}"
        return (yield from self.from_a_height(heights_m, message, lambda: self._look_and_plan(seen, avoid)))

    def _look_and_plan(
        self, seen: ObjectObservation, avoid: tuple[TriedGrasp, ...]
    ) -> Routine[tuple[CloseView, GraspPlan]]:
        """What is seen from the height at which the body stands, and a plan for it."""
        view = yield from self._look_closely(seen)
        return view, (yield from self._plan(view, str(seen.kind), avoid))

    def _heights(self, seen: ObjectObservation) -> Routine[list[float]]:
        """Body heights (m) from which the arm seems to reach the object, the best first; at least the usual one."""
        base_m = seen.position_W[2] - 0.5 * seen.size_m[2]
        heights_m = body_heights_m(base_m, self.context.robot.capabilities())
        chosen, arm_W = yield from self._suiting(seen, base_m, heights_m)
        if (yield from look_into_unseen(self, seen, arm_W)):
            chosen, _ = yield from self._suiting(seen, base_m, heights_m)
        return chosen or [heights_m[0]]

    def _suiting(
        self, seen: ObjectObservation, base_m: float, heights_m: Sequence[float]
    ) -> Routine[tuple[list[float], FloatArray]]:
        """Those heights (m) from which the arm seems to reach, the best first; where (points, world) it would be."""
        pose = self.context.pose()
        check_now = reach_check(self, seen, [square(seen.position_W, base_m, "guess", SURFACE_AROUND_M)])

        def choose() -> tuple[list[float], FloatArray]:
            check = check_now()
            found = sorted(check.all(pose.transform, heights_m), key=lambda each: each.cost)
            return [each.height_m for each in found][:_HEIGHTS_TRIED], check.arm_W(pose.transform, heights_m)

        message = f"choosing how high to stand before the {seen.kind}"
        return (yield from self.compute(choose, latency_s=0.1, name="choose a height", message=message))

    def begin(self, inputs: GraspInputs) -> None:
        """Forgets an earlier attempt, but not the grasps that `inputs` names."""
        self._tried, self._watch = inputs.avoid, None
        super().begin(inputs)

    def resume(self, inputs: GraspInputs) -> None:
        """Goes on after a pause or a restart; what happened meanwhile is no slip."""
        self._tried, self._watch = inputs.avoid, None if self._watch is None else self.hold_watch()
        super().resume(inputs)

    def trouble(self) -> SkillFailure | None:
        """That the object fell while it is lifted and drawn back; what begins to slip is gripped again."""
        return self.lost("the object fell out of the gripper while it was lifted")

    def _telling(self, failure: SkillFailure) -> SkillFailure:
        """A failure that says which grasps were tried, and what was in the way."""
        return SkillFailure(failure.cause, failure.message, {**self._learnt(), **failure.outputs})

    def _learnt(self) -> Mapping[str, object]:
        """The outputs while nothing is in the way."""
        return {"tried": self._tried, IN_THE_WAY: ()}

    def run_again(self, inputs: GraspInputs) -> Routine[Succeeded]:
        """An object in the gripper is taken along; with an empty gripper all begins anew."""
        seen, self._watch = inputs.observation, None
        yield from self.pause(_FEEL_S, "feeling what the gripper holds")
        at_object = self.hand_near(np.array(seen.position_W), _AT_OBJECT_M)
        if not self.context.robot.gripper().holding:
            if at_object:
                yield from self._let_go()
            return (yield from self.run(inputs))
        yield from self._take_along(seen, at_object)
        return Succeeded(f"the {seen.kind} was in the gripper already; holding it", self._learnt())

    def _take_along(self, seen: ObjectObservation, at_object: bool) -> Routine[None]:
        """Clamp, lift and draw back what the gripper grips, carry it near the body, and check that it is held."""
        yield from self.move_gripper(0.0, self.options.force_n, f"closing on the {seen.kind}")
        yield from self.pause(_FEEL_S, f"closing on the {seen.kind}")
        message, opening = f"carrying the {seen.kind}", self._check_held(str(seen.kind), None)
        R_BH = self.model.X_BH(self.q_rad()).rotation()
        if at_object:
            yield from self._lifted((), f"lifting the {seen.kind}")
            yield from self.try_shift_hand(-self.options.pull_back_m * R_BH.matrix()[:, 0] * [1.0, 1.0, 0.0], message)
        arm = self.arm
        yield from self.move_to(lambda scene, q: carry_configuration(scene, arm, R_BH, q), message, speed_rad_s=0.9)
        yield from self.pause(0.2, message)
        self._check_held(str(seen.kind), opening)
        yield from self.stand_as_usual(message)

    def _look_closely(self, seen: ObjectObservation) -> Routine[CloseView]:
        """A view of the object from 0.4 m, from aside where something hides a part of it; what is around comes with it.

        Raises SkillFailure with cause PRECONDITION when it is not seen.
        """
        base_m = seen.position_W[2] - 0.5 * seen.size_m[2]
        best: CloseView | None = None
        for aside_rad in _ASIDE_RAD if self.object_camera.on_hand else _ASIDE_RAD[:1]:
            self.boxes = surface_boxes([square(seen.position_W, base_m, "guess", 0.25)], self.X_WB())
            self.known_W = space_about(seen)
            try:
                view = yield from self._view_from(seen, base_m, aside_rad)
            except SkillFailure as failure:
                if best is None or failure.cause is not Cause.PLANNING:
                    raise
                continue
            if view is not None and (best is None or view.target.length_m > best.target.length_m):
                best = view
            if best is not None and (best.target.upright or best.target.length_m > _MOST_OF_IT * seen.size_m[0]):
                break
        if best is None:
            raise SkillFailure(Cause.PRECONDITION, f"the {seen.kind} is no longer where it was seen")
        self.known_W = space_about(seen, LOOK_HALF_SIDE_M)
        return best

    def _view_from(self, seen: ObjectObservation, base_m: float, aside_rad: float) -> Routine[CloseView | None]:
        """What a picture from near shows of the object, the camera turned about it; None when it is not there."""
        message = f"looking closely at the {seen.kind}"
        surface = square(seen.position_W, base_m, seen.surface or "surface")
        p_BT = self.X_WB().inverse() @ np.array(seen.position_W)
        if aside_rad != 0.0 or not self._looks_closely(p_BT):
            near = close_viewpoints(self.model.p_BS, p_BT, aside_rad)
            yield from self.look_at(p_BT, [*near, *overview_viewpoints(self.model, p_BT, aside_rad)], message)
        image = yield from self.picture(message)
        place, X_WB, detector = self.context.localiser.estimate(), self.X_WB(), self.context.detector

        def look() -> CloseView | None:
            found = detect_in_image(detector, image)
            named = [each for each in found if seen.kind.name in (ANY_OBJECT, each.class_name)]
            rest = [each for each in found if each not in named]
            placed = tuple(one for some in (named, rest) for one in detections_3d(image, place, some, [surface]))
            return examine(image, X_WB, surface, seen, place, placed, self.options.same_object_m)

        return (yield from self.compute(look, latency_s=DETECTION_LATENCY_S, name="detect closely", message=message))

    def _looks_closely(self, p_BT: FloatArray) -> bool:
        """Returns whether a camera on the hand looks closely at a point already, past an open gripper."""
        camera = self.object_camera
        open_wide = self.context.robot.gripper().opening > WIDE * self.widest
        return camera.on_hand and open_wide and sees_closely(self.model.X_BH(self.q_rad()) @ camera.X_FC, p_BT)

    def _plan(self, view: CloseView, name: str, avoid: tuple[TriedGrasp, ...]) -> Routine[GraspPlan]:
        self.boxes = view.boxes
        candidates = self.context.stack.grasp_planner.candidates(view.target, self.model.p_BS, self.gripper)
        candidates = others_first(candidates, avoid, view.target.centre_B, view.X_WB)
        if not candidates:
            raise SkillFailure(Cause.PLANNING, without_grasp(view.target, self.model.p_BS, self.gripper, name))
        openings_rad = openings(candidates, self.gripper)
        scene_now, q, stack, seen = self.scene_now(), self.q_rad(), self.context.stack, self.seen_boxes()
        arm = self.context.robot.capabilities().arm
        reach_m = np.inf if arm is None else arm.max_reach_m

        around = Surroundings((*view.boxes, *seen), view.target_box, up_B(view.X_WB), view.others, name, reach_m)

        def planned(scene: ArmScene, opening: float, space: Surroundings) -> tuple[GraspPlan, float]:
            """A plan for a gripper that is open so far, and that opening."""
            scene.set_opening(opening)
            return stack.grasp_planner.plan(scene, q, candidates, space, stack.arm_planner, self._rng), opening

        def plan() -> tuple[GraspPlan, float]:
            """A plan for the first opening for which there is one."""
            scene, (*first_rad, last_rad) = scene_now(), openings_rad
            for opening in first_rad:
                with suppress(PlanningError):  # why there is none is not asked: another opening is left
                    return planned(scene, opening, replace(around, others=()))
            return planned(scene, last_rad, around)

        found, opening = yield from self.compute(
            plan, latency_s=0.6, name="plan grasp", message=f"planning how to take the {name}"
        )
        yield from self.move_gripper(opening, GRIPPER_FORCE_N, "opening the gripper")
        return found

    def _take(self, view: CloseView, plan: GraspPlan, seen: ObjectObservation) -> Routine[None]:
        """Go on from the pre-grasp: close as firmly as its least mass needs, lift, weigh, close as firmly as it needs.

        Raises SkillFailure with cause POSTCONDITION when it is not held then, PRECONDITION when it is too heavy.
        """
        name, least_kg = str(seen.kind), least_mass_kg(seen)
        yield from self.follow(plan.to_grasp, f"reaching for the {name}")
        ahead = plan.candidate.X_BH.rotation().matrix()[:, 0]
        touched = yield from self.follow(plan.last_bit, f"reaching for the {name}", self.held_up(ahead))
        relax_m = _RELAX_M if view.target.height_m > THIN_M else _RELAX_THIN_M
        yield from self._to_the_ground(ahead, touched, relax_m, f"reaching for the {name}")
        X_BH = self.model.X_BH(self.q_rad())
        self.context.payload.kind = seen.kind
        force_n = self.options.force_n + _PER_LEVER_N_M * plan.candidate.lever_m
        most_n = _MOST_OF_FORCE * self.gripper.max_force_n
        yield from self.move_gripper(0.0, min(force_n + _PER_KG_N * least_kg, most_n), f"closing on the {name}")
        yield from self.pause(0.4, f"closing on the {name}")
        opening = self._check_held(name, None)
        turns = view.target.upright and self.gripper.kind is GripperKind.HINGED
        X_BH = turned_in_hand(X_BH, self.p_HT) if turns else X_BH
        self.held = [held_box(X_BH.inverse(), view.target_box)]
        self.context.payload.corners_H = box_corners(self.held[0])
        self.context.payload.R_BH = X_BH.rotation()
        self._watch = self.hold_watch()
        if not (yield from self._lifted([plan.lift_B], f"lifting the {name}")):
            raise SkillFailure(Cause.PLANNING, "the arm cannot lift the object from where it has hold of it")
        self._watch = None
        p_HO = self.held[0].X_FG.translation()
        mass_kg = yield from self.weigh(p_HO, f"lifting the {name}")
        self._check_held(name, opening)
        yield from self._refuse_heavy(mass_kg, plan.lift_B, name)
        firmly_n = min(force_n + _PER_KG_N * max(mass_kg, least_kg), most_n)
        yield from self.move_gripper(0.0, firmly_n, f"lifting the {name}")

    def _refuse_known_heavy(self, seen: ObjectObservation) -> None:
        """Raises SkillFailure with cause PRECONDITION for what is known, by its class and size, to be too heavy."""
        arm = self.context.robot.capabilities().arm
        too_heavy = None if arm is None else known_too_heavy(seen, arm.max_payload_kg)
        if too_heavy is not None:
            raise SkillFailure(Cause.PRECONDITION, too_heavy)

    def _refuse_heavy(self, mass_kg: float, lift_B: FloatArray, name: str) -> Routine[None]:
        """Sets down again what weighs more than the arm may carry, and raises SkillFailure with cause PRECONDITION."""
        arm = self.context.robot.capabilities().arm
        if arm is None or mass_kg <= arm.max_payload_kg:
            return
        planner, X_BH = self.context.stack.arm_planner, self.model.X_BH(self.q_rad())
        lowered = RigidTransform(X_BH.rotation(), X_BH.translation() - lift_B)
        try:
            down = planner.timed(planner.line(self.model, self.q_rad(), lowered), speed_rad_s=_FEEL_RAD_S)
            yield from self.follow(down, f"setting the {name} down again", self.held_up(-up_B(self.X_WB())))
        except PlanningError:
            pass
        most = f"the arm carries {arm.max_payload_kg:.1f} kg at most"
        raise SkillFailure(Cause.PRECONDITION, f"the {name} weighs {mass_kg:.1f} kg, and {most}")

    def _to_the_ground(self, ahead_B: FloatArray, touched: bool, relax_m: float, message: str) -> Routine[None]:
        """Fingers that point down go on until they touch the surface, whose height is known to a few mm only."""
        X_BH, planner = self.model.X_BH(self.q_rad()), self.context.stack.arm_planner
        if not touched and ahead_B @ up_B(self.X_WB()) < -_DOWN:
            deeper = RigidTransform(X_BH.rotation(), X_BH.translation() + _FEEL_M * ahead_B)
            try:
                path = planner.line(self.model, self.q_rad(), deeper)
            except PlanningError:
                return
            touched = yield from self.follow(
                planner.timed(path, speed_rad_s=_FEEL_RAD_S), message, self.held_up(ahead_B)
            )
        if touched:
            yield from self.try_shift_hand(-relax_m * ahead_B, message)

    def _lifted(self, planned_B: Sequence[FloatArray], message: str) -> Routine[bool]:
        """Lifts as planned or, where the hand stands otherwise by now, in another way; whether the arm found one."""
        for lift_B in (*planned_B, *lifts(self.model, self.model.X_BH(self.q_rad()), up_B(self.X_WB()))):
            if (yield from self.try_shift_hand(lift_B, message)):
                return True
        return False

    def _check_held(self, name: str, opening_before_rad: float | None) -> float:
        gripper = self.context.robot.gripper()
        if gripper.opening < self.gripper.like_turn(_CLOSED_RAD) or not gripper.holding:
            raise SkillFailure(Cause.POSTCONDITION, f"the gripper closed on nothing where the {name} was seen")
        slip = self.gripper.like_turn(self.options.slip_rad)
        if opening_before_rad is not None and abs(gripper.opening - opening_before_rad) > slip:
            raise SkillFailure(Cause.POSTCONDITION, f"the {name} slipped in the gripper while it was lifted")
        return gripper.opening

    def _carry(self, grasp: GraspCandidate, name: str, gently: bool) -> Routine[None]:
        """Draws back from the surface, holds the object near the body, and checks once more."""
        opening, self._watch = self._check_held(name, None), self.hold_watch()
        message = f"carrying the {name}"
        for up_m in _PULL_BACK_UP_M:
            way_B = self.options.pull_back_m * pull_back_B(grasp.X_BH, self.model.p_BS) + up_m * up_B(self.X_WB())
            if (yield from self.try_shift_hand(way_B, message, clear_of_boxes=True)):
                break
        R_BH = self.model.X_BH(self.q_rad()).rotation()
        speed_rad_s = _GENTLY_RAD_S if gently or grasp.lever_m > _LONG_LEVER_M else _CARRY_RAD_S
        arm = self.arm
        yield from self.move_to(lambda scene, q: carry_configuration(scene, arm, R_BH, q), message, speed_rad_s)
        yield from self.pause(0.2, message)
        self._check_held(name, opening)

    def _let_go(self, draw_back: bool = True) -> Routine[None]:
        """On failure: open the gripper, draw back from the object, stow; what does not work is left out."""
        at_object = (self._open, self._draw_back) if draw_back else ()
        for recovery in (*at_object, self.try_stow, self.stand_as_usual):
            try:
                yield from recovery()
            except SkillFailure:
                continue

    def _open(self) -> Routine[None]:
        yield from self.move_gripper(WIDE * self.widest, GRIPPER_FORCE_N, "opening the gripper after the failure")

    def _draw_back(self) -> Routine[None]:
        """Out of the object's reach, since the closing gripper must not catch it."""
        ahead = self.model.X_BH(self.q_rad()).rotation().matrix()[:, 0]
        ways = [(distance_m, True) for distance_m in _DRAW_BACK_M] + [
            (distance_m, False) for distance_m in _DRAW_BACK_M
        ]
        for distance_m, clear in ways:
            message = "drawing back after the failure"
            if (yield from self.try_shift_hand(-distance_m * ahead, message, clear_of_boxes=clear)):
                break
        yield from self.move_gripper(0.0, GRIPPER_FORCE_N, "closing the empty gripper")
