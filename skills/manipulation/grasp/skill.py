"""The grasp skill: views the object closely, plans a grasp, grasps and lifts the object, and checks that it is held."""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from itertools import product
from typing import ClassVar

import numpy as np
from pydrake.math import RigidTransform

from skills.api import Cause, ObjectObservation, PlanningError, Succeeded
from skills.manipulation.arm.arm_skill import CARRY_SPEED_RAD_S, GRIPPER_FORCE_N, SHUT_RAD
from skills.manipulation.arm.collision import ArmScene, box_corners
from skills.manipulation.arm.held_object import held_box, square_hand_pose
from skills.manipulation.arm.poses import finger_sweep_m
from skills.manipulation.grasp.candidates import (
    THIN_M,
    GraspCandidate,
    TriedGrasp,
    least_mass_kg,
    others_first,
    tried_grasp,
    why_no_candidates,
    why_too_heavy,
)
from skills.manipulation.grasp.close_view import WIDE, CloseLookingSkill, CloseView
from skills.manipulation.grasp.planning import PREGRASPS_M, GraspPlan, Surroundings, lifts, pull_back_B
from skills.manipulation.grasp.reach import heights_to_grasp, openings, passing, up_B
from skills.manipulation.grasp.servo import Aim, aim_approach, measure_shift
from skills.quantities import Force, Length, Margin, Turn
from skills.robot import FloatArray, GripperKind
from skills.routine import Routine, SkillFailure
from skills.world_model import IN_THE_WAY

_PER_KG_N = 12.0
"""Additional force per kilogram of the object."""
_MOST_OF_FORCE = 0.95
"""Largest force of a grip, as a fraction of the gripper's limit."""
_PER_LEVER_N_M = 400.0
"""Additional force per metre between the grip and the centre of mass; the tips would press a thin object out."""
_THIN_N = 20.0
"""Force on a thin object between rounded fingertips, which press it out with more."""
_GENTLE_N = 8.0
"""Force of hinged fingers until they touch the object; faster ones throw a thin object behind their tips."""
_RELAX_M, _RELAX_THIN_M = 0.002, 0.0005
"""Height by which fingers on the surface rise before they close, also on an object that is thinner than `THIN_M`."""
_NEARBY_M, _NEARBY_USUAL_M = 0.02, 0.04
"""Space between fingers and a thin object before they go down once more, and about another before they close gently."""
_CLEAR_M = 0.002
"""Clearance of a finger that sweeps over the surface."""
_SLIM_M, _BELOW_SLIM_M = 0.015, 0.004
"""Width of a slim part of a thicker object, and depth of the fingertips below its axis; deeper is the hollow."""
_SHORT_M = 0.025
"""Distance from the grasp beyond which a contact of the hand is not with the surface below the object."""
_FEEL_M = 0.014
"""Additional depth of the fingers, to feel the surface."""
_FEEL_RAD_S, _FEEL_LOW_M, _LONG = 0.03, 0.04, 1.5
"""Joint speed of that, and for which objects it is done: by height, or by the ratio of length to width."""
_TOUCH_S = 15.0
"""Longest time from the last bit of the approach to the lift, in which fingertips may touch the surface."""
_MOST_SHOWN = 8
"""Number of the best grasps that are tried with a way through space that pictures show."""
_DOWN = 0.8
"""Vertical component of a direction that counts as down."""
_FEEL_S, _RAISE_M = 0.4, 0.08
"""Pause for the gripper's readings of the held object, and rise of the hand before it weighs it once more."""
_AIM_LATENCY_S = 0.1
_AT_OBJECT_M = 0.4
"""Distance within which a hand may have gripped the object before a restart."""
_GENTLY_RAD_S, _LONG_LEVER_M = 0.45, 0.05
"""Joint speed while the arm carries a thin object, or one held farther than this from its centre of mass."""
_PULL_BACK_UP_M = (0.02, 0.0)
"""Rises of the hand while it draws back from the surface, the best first."""
_DRAW_BACK_M = (0.18, 0.14, PREGRASPS_M[0], PREGRASPS_M[-1])
"""Distances by which the hand draws back from an object after a failure, the best first."""


@dataclass(frozen=True)
class GraspInputs:
    """Observed object; grasps similar to those in `avoid` are the last choice."""

    observation: ObjectObservation
    avoid: tuple[TriedGrasp, ...] = ()


@dataclass(frozen=True)
class GraspOptions:
    """Grip force (N), and limits beyond which the object counts as lost.

    `same_object_m`: search radius around the object's last position. `slip_rad`: a gripper that opens or closes by more
    than this during the lift has lost the object. `pull_back_m`: how far the hand draws back after the lift.
    """

    force_n: Force = 80.0
    same_object_m: Length = 0.12
    slip_rad: Turn = 0.12
    pull_back_m: Margin = 0.12


class Grasp(CloseLookingSkill[GraspInputs]):
    """Grasps an object and holds it near the body. On failure it opens the gripper and stows the arm.

    The output `tried` is `avoid` plus the grasp of this attempt, also after a failure. When no grasp can be planned,
    the output `in_the_way` lists the objects that block every grasp, the nearest first; otherwise it is empty.
    """

    name = "grasp"
    Inputs = GraspInputs
    outputs: ClassVar[Mapping[str, type]] = {"tried": tuple[TriedGrasp, ...], IN_THE_WAY: tuple[ObjectObservation, ...]}
    causes: ClassVar[Mapping[Cause, str]] = {
        Cause.PRECONDITION: "the object is not where it was seen or too heavy, the gripper is full, or there is no arm",
        Cause.PLANNING: "no grasp is within reach and free",
        Cause.EXECUTION: "the arm or the gripper did not reach its goal",
        Cause.POSTCONDITION: "the gripper closed on nothing, or the object slipped out",
    }
    default_timeout_s = 120.0
    max_data_age_s: ClassVar[Mapping[str, float]] = {"joints": 0.5, "gripper": 0.5}
    changes_world = True
    gripper_before = False
    gripper_after = True
    Options: ClassVar[type] = GraspOptions
    options: GraspOptions
    lost_message = "the {thing} slipped out of the grip while it was lifted"

    def begin(self, inputs: GraspInputs) -> None:
        """Resets the state of an earlier attempt, and starts from the grasps that `inputs` names."""
        self._tried = inputs.avoid
        super().begin(inputs)

    def resume(self, inputs: GraspInputs) -> None:
        """Continues after a pause or a restart."""
        self._tried = inputs.avoid
        super().resume(inputs)

    def undone(self, inputs: GraspInputs) -> str | None:
        """Returns a reason when the gripper is empty."""
        return None if self.context.robot.gripper().holding else f"the {inputs.observation.kind} is not in the gripper"

    def run(self, inputs: GraspInputs) -> Routine[Succeeded]:
        """Views, plans, grasps, lifts and carries."""
        seen, name = inputs.observation, str(inputs.observation.kind)
        if self.context.robot.gripper().holding:
            raise SkillFailure(Cause.PRECONDITION, "the gripper holds something already")
        arm = self.context.robot.capabilities().arm
        too_heavy = None if arm is None else why_too_heavy(seen.kind, arm.max_payload_kg)
        if too_heavy is not None:
            raise SkillFailure(Cause.PRECONDITION, too_heavy)
        try:
            view, plan = yield from self._take_where_it_is(inputs)
        except SkillFailure as failure:
            if (yield from self._still_held(failure, seen)):
                return (yield from self._secured(inputs))
            yield from self._let_go(draw_back=len(self._tried) > len(inputs.avoid))
            raise self._with_outputs(failure) from failure
        try:
            yield from self._carry(plan.candidate, name, view.target.height_m < THIN_M)
            yield from self.stand_as_usual(f"carrying the {name}")
        except SkillFailure as failure:
            if (yield from self._still_held(failure, seen)):
                return (yield from self._secured(inputs))
            raise self._with_outputs(failure) from failure
        return Succeeded(f"holding the {name}", self._outputs())

    def run_again(self, inputs: GraspInputs) -> Routine[Succeeded]:
        """Secures an object in the gripper; with an empty gripper, makes a new attempt."""
        seen, self._watch = inputs.observation, None
        yield from self.pause(_FEEL_S, "feeling what the gripper holds")
        at_object = self.is_hand_near(np.array(seen.position_W), _AT_OBJECT_M)
        if not self.context.robot.gripper().holding:
            if at_object:
                yield from self._let_go()
            return (yield from self.run(inputs))
        yield from self._keep_held(seen, at_object)
        return Succeeded(f"the {seen.kind} was in the gripper already; holding it", self._outputs())

    def _still_held(self, failure: SkillFailure, seen: ObjectObservation) -> Routine[bool]:
        """Returns whether the gripper still holds the object that a failure calls lost; feels its weight once more."""
        if failure.cause is not Cause.POSTCONDITION:
            return False
        message = "feeling whether the gripper is empty"
        yield from self.pause(_FEEL_S, message)  # moving fingers feel nothing
        if self.context.payload.kind is None:  # shut jaws felt light, maybe because the object lay on the arm
            yield from self.shift_by_first([_RAISE_M * up_B(self.X_WB())], message, clear_of_boxes=True)
            self.context.payload.kind = seen.kind
        return (yield from self.holds(message))

    def _secured(self, inputs: GraspInputs) -> Routine[Succeeded]:
        """Carries an object that seemed to be lost while the arm still feels its weight."""
        yield from self._keep_held(inputs.observation, True)
        return Succeeded(f"holding the {inputs.observation.kind}, which slipped in the gripper", self._outputs())

    def _keep_held(self, seen: ObjectObservation, at_object: bool) -> Routine[None]:
        """Clamps, lifts and draws back the gripped object, carries it near the body, and checks that it is held."""
        yield from self.move_gripper(0.0, self.options.force_n, f"closing on the {seen.kind}")
        yield from self.pause(_FEEL_S, f"closing on the {seen.kind}")
        message, opening = f"carrying the {seen.kind}", (yield from self._check_held(str(seen.kind), None))
        R_BH = self.model.X_BH(self.q_rad()).rotation()
        if at_object:
            yield from self._lift((), f"lifting the {seen.kind}")
            yield from self.try_shift_hand(-self.options.pull_back_m * R_BH.matrix()[:, 0] * [1.0, 1.0, 0.0], message)
        yield from self.carry(R_BH, message)
        yield from self.pause(0.2, message)
        yield from self._check_held(str(seen.kind), opening)
        yield from self.stand_as_usual(message)

    def _with_outputs(self, failure: SkillFailure) -> SkillFailure:
        """Adds the tried grasps and the blocking objects to the failure's outputs."""
        return SkillFailure(failure.cause, failure.message, {**self._outputs(), **failure.outputs})

    def _outputs(self) -> Mapping[str, object]:
        """Outputs while no object blocks the grasps."""
        return {"tried": self._tried, IN_THE_WAY: ()}

    def _take_where_it_is(self, inputs: GraspInputs) -> Routine[tuple[CloseView, GraspPlan]]:
        """Views, plans and grasps; retries once when the object has moved. Fails when the retry fails too."""
        seen = inputs.observation
        heights_m = yield from heights_to_grasp(self, seen)
        attempt = partial(self._look_and_plan, seen, inputs.avoid)
        view, plan = yield from self.attempt_at_heights(heights_m, f"standing up to the {seen.kind}", attempt)
        if not (yield from self._take_unmoved(view, plan, inputs)):
            view, plan = yield from self._look_and_plan(seen, inputs.avoid)
            if not (yield from self._take_unmoved(view, plan, inputs)):
                raise SkillFailure(Cause.PRECONDITION, f"the {seen.kind} moves while the hand reaches for it")
        return view, plan

    def _take_unmoved(self, view: CloseView, plan: GraspPlan, inputs: GraspInputs) -> Routine[bool]:
        """Reaches for the object and grasps it; returns False when it has moved away."""
        seen = inputs.observation
        self._tried = (*inputs.avoid, tried_grasp(plan.candidate, view.target.centre_B, view.X_WB))
        aimed = yield from self._reach(view, plan, str(seen.kind))
        if aimed is not None:
            yield from self._take(*aimed, seen)
        return aimed is not None

    def _reach(self, view: CloseView, plan: GraspPlan, name: str) -> Routine[tuple[CloseView, GraspPlan] | None]:
        """Brings the hand to the pre-grasp; returns view and plan corrected there (see `_aimed`)."""
        yield from self.follow(plan.to_pregrasp, f"reaching for the {name}")
        return (yield from self._aimed(view, plan, name))

    def _aimed(self, view: CloseView, plan: GraspPlan, name: str) -> Routine[tuple[CloseView, GraspPlan] | None]:
        """Corrects view and plan across the fingers by a picture from the pre-grasp; None when the object is not there.

        Along the fingers, the guard stops the hand; along the object, a few centimetres do not matter.
        """
        message = f"reaching for the {name}"
        if not self.object_camera.on_hand:
            return view, plan
        image = yield from self.picture(message, settle_s=0.0, near=True)
        X_BC = image.frames.pose("body").inverse() @ image.frames.pose(image.camera_frame)
        scene_now = self.scene_now([*view.boxes, *self.seen_boxes()])

        def aim() -> Aim | None:
            found = measure_shift(view.target, image, X_BC)
            return aim_approach(found, plan, self.model, scene_now)

        aimed = yield from self.compute(aim, latency_s=_AIM_LATENCY_S, name="aim", message=message)
        if aimed is None:
            return None
        offset_B, approach = aimed
        if approach is None or not (yield from self.try_shift_hand(offset_B, message, clear_of_boxes=True)):
            return view, plan
        X_BH = RigidTransform(offset_B) @ plan.candidate.X_BH
        plan = replace(plan, candidate=replace(plan.candidate, X_BH=X_BH), to_grasp=approach[0], last_bit=approach[1])
        return view.shift(offset_B), plan

    def _look_and_plan(
        self, seen: ObjectObservation, avoid: tuple[TriedGrasp, ...]
    ) -> Routine[tuple[CloseView, GraspPlan]]:
        """Views the object from the body's present height, and plans its grasp."""
        view = yield from self.look_closely(seen, self.options.same_object_m)
        return view, (yield from self._plan(view, str(seen.kind), avoid))

    def _plan(self, view: CloseView, name: str, avoid: tuple[TriedGrasp, ...]) -> Routine[GraspPlan]:
        """Plans a grasp and opens the gripper for it. Raises SkillFailure with cause PLANNING when none is feasible."""
        self.boxes = view.boxes
        every = self.context.stack.grasp_planner.candidates(view.target, self.model.p_BS, self.gripper)
        candidates = others_first(every, avoid, view.target.centre_B, view.X_WB)
        if not candidates:
            why = why_no_candidates(view.target, self.model.p_BS, self.gripper, name)
            raise SkillFailure(Cause.PLANNING, f"the {name} offers no other hold than the last two" if every else why)
        wide, scene_now = openings(candidates, self.gripper), self.scene_now()
        q, stack = self.q_rad(), self.context.stack
        p_WO = view.X_WB @ np.array([*view.target.centre_B, view.target.base_m])
        shown = (((*view.boxes, *self.seen_boxes(hidden_W=p_WO)), _MOST_SHOWN),) if view.target.upright else ()
        spaces = [*shown, ((*view.boxes, *self.seen_boxes()), len(candidates))]  # the arm comes from above to flat ones
        around = Surroundings(spaces[-1][0], view.target_box, up_B(view.X_WB), view.others, name, self.arm.max_reach_m)

        def planned(scene: ArmScene, opening: float, space: Surroundings, most: int) -> tuple[GraspPlan, float]:
            scene.set_opening(opening)
            grasps = passing(candidates, opening, self.gripper)[:most]
            return stack.grasp_planner.plan(scene, q, grasps, space, stack.arm_planner, self._rng), opening

        def plan() -> tuple[GraspPlan, float]:
            """Plans through space that pictures show, then any, with each opening; finds at last what is in the way."""
            scene = scene_now()
            for (boxes, most), opening in product(spaces, wide):
                with suppress(PlanningError):
                    return planned(scene, opening, replace(around, boxes=boxes, others=()), most)
            return planned(scene, wide[-1], around, len(candidates))

        found, opening = yield from self.compute(
            plan, latency_s=0.6, name="plan grasp", message=f"planning how to take the {name}"
        )
        yield from self.move_gripper(opening, GRIPPER_FORCE_N, "opening the gripper")
        return found

    def _take(self, view: CloseView, plan: GraspPlan, seen: ObjectObservation) -> Routine[None]:
        """Closes with the force for the minimum mass, lifts, weighs, and grips with the force for the measured mass.

        Raises SkillFailure with cause POSTCONDITION when the gripper then holds no object, and PRECONDITION when the
        object is too heavy.
        """
        name, least_kg = str(seen.kind), least_mass_kg(seen.kind)
        yield from self.follow(plan.to_grasp, f"reaching for the {name}")
        ahead = plan.candidate.X_BH.rotation().matrix()[:, 0]
        self.context.expect_touch(_TOUCH_S)
        touched = yield from self.follow(plan.last_bit, f"reaching for the {name}", self.contact_guard(ahead))
        if touched:
            self._check_reached(plan.candidate.X_BH, name)
        yield from self._lower_on(view, plan, touched, name)
        X_BH = self.model.X_BH(self.q_rad())
        self.context.payload.kind = seen.kind
        lever_m = None if view.target.height_m <= THIN_M else plan.candidate.lever_m
        force_n = yield from self._close(lever_m, least_kg, f"closing on the {name}")
        yield from self.pause(_FEEL_S, f"closing on the {name}")
        felt = self.context.robot.gripper()
        if felt.opening > self.gripper.like_turn(SHUT_RAD):
            yield from self._check_held(name, None)
        turns = view.target.upright and self.gripper.kind is GripperKind.HINGED
        X_BH = square_hand_pose(X_BH, self.p_HT) if turns else X_BH
        self.held = [held_box(X_BH.inverse(), view.target_box)]
        self.context.payload.corners_H = box_corners(self.held[0])
        self.context.payload.R_BH = X_BH.rotation()
        self._watch = self.hold_watch()
        if not (yield from self._lift([plan.lift_B], f"lifting the {name}")):
            raise SkillFailure(Cause.PLANNING, "the arm cannot lift the object from where it has hold of it")
        self.context.expect_touch(0.0)
        self._watch = None
        yield from self._check_held(name, felt.opening)
        mass_kg = yield from self.weigh(self.held[0].X_FG.translation(), f"lifting the {name}")
        yield from self._refuse_heavy(mass_kg, plan.lift_B, name)
        yield from self.move_gripper(0.0, self._grip_n(force_n, max(mass_kg, least_kg)), f"lifting the {name}")

    def _lower_on(self, view: CloseView, plan: GraspPlan, touched: bool, name: str) -> Routine[None]:
        """Lowers the fingers onto the surface below a low or long object, and brings hinged ones near its sides."""
        target, X_BH, message = view.target, plan.candidate.X_BH, f"closing on the {name}"
        ahead, thin = X_BH.rotation().matrix()[:, 0], target.height_m <= THIN_M
        relax_m = max(_RELAX_M, finger_sweep_m(X_BH, self.X_WB(), self.gripper) + _CLEAR_M)
        if plan.candidate.width_m < _SLIM_M and not target.upright:
            relax_m = max(relax_m, 0.5 * target.height_m - _BELOW_SLIM_M)
        if touched or target.height_m < _FEEL_LOW_M or target.length_m > _LONG * target.width_m:
            yield from self._to_the_ground(ahead, touched, relax_m, f"reaching for the {name}")
        if self.gripper.kind is GripperKind.HINGED:
            near = self.gripper.opening_for(plan.candidate.width_m + (_NEARBY_M if thin else _NEARBY_USUAL_M))
            yield from self.move_gripper(min(near, self.context.robot.gripper().opening), GRIPPER_FORCE_N, message)
            if thin:
                yield from self._to_the_ground(ahead, False, _RELAX_THIN_M, message)

    def _close(self, lever_m: float | None, mass_kg: float, message: str) -> Routine[float]:
        """Closes the fingers, hinged ones gently until they touch; returns the force (N) for an object without mass.

        `lever_m` is the distance from the grip to the centre of mass; None for a thin object.
        """
        force_n = self.options.force_n + _PER_LEVER_N_M * (lever_m or 0.0)
        if self.gripper.kind is GripperKind.HINGED:
            force_n = _THIN_N if lever_m is None else force_n
            with suppress(SkillFailure):  # a heavy object still moves when the command expires
                yield from self.move_gripper(0.0, _GENTLE_N, message)
        yield from self.move_gripper(0.0, self._grip_n(force_n, mass_kg), message)
        return force_n

    def _grip_n(self, least_n: float, mass_kg: float) -> float:
        """Returns the grip force (N) for a mass, within the gripper's limit."""
        return min(least_n + _PER_KG_N * mass_kg, _MOST_OF_FORCE * self.gripper.max_force_n)

    def _check_reached(self, X_BH: RigidTransform, name: str) -> None:
        """Raises SkillFailure with cause EXECUTION when the fingers end short of the object and would push it out."""
        short_m = float((self.model.X_BH(self.q_rad()).inverse() @ X_BH).translation()[0])
        if short_m > _SHORT_M:
            where = f"{100.0 * short_m:.0f} cm before it was about the {name}"
            raise SkillFailure(Cause.EXECUTION, f"the hand touched something {where}")

    def _refuse_heavy(self, mass_kg: float, lift_B: FloatArray, name: str) -> Routine[None]:
        """Sets down an object that is heavier than the arm may carry. Raises SkillFailure with cause PRECONDITION."""
        if mass_kg <= (most_kg := self.arm.max_payload_kg):
            return
        with suppress(PlanningError):
            yield from self.press(-lift_B, -up_B(self.X_WB()), _FEEL_RAD_S, f"setting the {name} down again")
        most = f"the arm carries {most_kg:.1f} kg at most"
        raise SkillFailure(Cause.PRECONDITION, f"the {name} weighs {mass_kg:.1f} kg, and {most}")

    def _to_the_ground(self, ahead_B: FloatArray, touched: bool, relax_m: float, message: str) -> Routine[None]:
        """Lowers downward fingers onto the surface, whose height is known only to a few millimetres."""
        if not touched and ahead_B @ up_B(self.X_WB()) < -_DOWN:
            try:
                touched = yield from self.press(_FEEL_M * ahead_B, ahead_B, _FEEL_RAD_S, message)
            except PlanningError:
                touched = True  # the surface may be just below
        if touched:
            yield from self.try_shift_hand(-relax_m * ahead_B, message)

    def _lift(self, planned_B: Sequence[FloatArray], message: str) -> Routine[bool]:
        """Lifts as planned or, if the hand is off the plan, along another path; returns whether a path was found."""
        others_B = lifts(self.model, self.model.X_BH(self.q_rad()), up_B(self.X_WB()))
        return (yield from self.shift_by_first([*planned_B, *others_B], message))

    def _check_held(self, name: str, opening_before: float | None) -> Routine[float]:
        """Returns the gripper's opening, and tells the robot that it carries the object.

        Raises SkillFailure with cause POSTCONDITION when the object is not held.
        """
        held, gripper = (yield from self.holds(f"feeling for the {name}")), self.context.robot.gripper()
        if not held:
            raise SkillFailure(Cause.POSTCONDITION, f"the gripper closed on nothing where the {name} was seen")
        if opening_before is None:
            self.context.robot.carry(True, lease=self.context.lease)
        slip = self.gripper.like_turn(self.options.slip_rad)
        if opening_before is not None and abs(gripper.opening - opening_before) > slip:
            raise SkillFailure(Cause.POSTCONDITION, f"the {name} slipped in the gripper while it was lifted")
        return gripper.opening

    def _carry(self, grasp: GraspCandidate, name: str, gently: bool) -> Routine[None]:
        """Draws back from the surface, brings the object near the body, and checks once more that it is held."""
        opening, self._watch = self.context.robot.gripper().opening, self.hold_watch()
        message, back_B = f"carrying the {name}", self.options.pull_back_m * pull_back_B(grasp.X_BH, self.model.p_BS)
        offsets_B = (back_B + up_m * up_B(self.X_WB()) for up_m in _PULL_BACK_UP_M)
        yield from self.shift_by_first(offsets_B, message, clear_of_boxes=True)
        speed_rad_s = _GENTLY_RAD_S if gently or grasp.lever_m > _LONG_LEVER_M else CARRY_SPEED_RAD_S
        yield from self.carry(self.model.X_BH(self.q_rad()).rotation(), message, speed_rad_s)
        yield from self.pause(0.2, message)
        yield from self._check_held(name, opening)

    def _let_go(self, draw_back: bool = True) -> Routine[None]:
        """After a failure: opens the gripper, draws back from the object and stows; skips steps that fail."""
        for recovery in (*((self._open, self._draw_back) if draw_back else ()), self.try_stow, self.stand_as_usual):
            with suppress(SkillFailure):
                yield from recovery()

    def _open(self) -> Routine[None]:
        yield from self.move_gripper(WIDE * self.gripper.widest, GRIPPER_FORCE_N, "opening after the failure")

    def _draw_back(self) -> Routine[None]:
        """Draws back from the object, so that the closing gripper does not catch it."""
        back_B = -self.model.X_BH(self.q_rad()).rotation().matrix()[:, 0]
        offsets_B, message = [distance_m * back_B for distance_m in _DRAW_BACK_M], "drawing back after the failure"
        if not (yield from self.shift_by_first(offsets_B, message, clear_of_boxes=True)):
            yield from self.shift_by_first(offsets_B, message)
        yield from self.move_gripper(0.0, GRIPPER_FORCE_N, "closing the empty gripper")
