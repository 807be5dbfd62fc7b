"""Base of the skills that move the arm: planned motions, contact, weighing, carrying, stowing."""

import math
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import ClassVar, TypeVar

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix

from skills.api import Cause, InputsT, Running, SkillContext
from skills.hold import Grip, HoldWatch, grip_again, hold_watch
from skills.manipulation.arm.collision import ArmScene, Box
from skills.manipulation.arm.forces import hand_force_n, held_mass_kg
from skills.manipulation.arm.kinematics import ArmModel, arm_model
from skills.manipulation.arm.motion import ArmPlanner, GripperTurn
from skills.manipulation.arm.poses import carry_configuration, hangs_below
from skills.manipulation.arm.solid_cells import Outline, OwnSpace, column_boxes, hidden_boxes, solid_boxes
from skills.robot import (
    ArmCapabilities,
    ArmTrajectory,
    CommandId,
    FloatArray,
    GripperCapabilities,
    GripperKind,
)
from skills.routine import PlanningAttempt, Routine, RoutineSkill, SkillFailure

Goal = Callable[[ArmScene, FloatArray], FloatArray]
"""Chooses the goal configuration (J,) of a motion, given the scene and the present configuration (J,)."""
PlannedT = TypeVar("PlannedT")

PLANNING_LATENCY_S = 0.3
LINE_SPEED_RAD_S = 0.6
CARRY_SPEED_RAD_S = 0.9
GRIPPER_EXPIRY_S = 4.0
GRIPPER_FORCE_N = 20.0
"""Force with which an empty gripper opens and closes."""
CONTACT_LAG_M = 0.0035
"""Lag of a slow hand that means contact; a free hand lags by at most 2 mm (measured in the plant)."""
_FEEL_LAG_M, _DOWN = 0.0022, 0.8
"""The same for an empty hand that moves down at 0.05 rad/s at most, and the vertical component that counts as down."""
_CONTACT_N, _PRESS_N = 8.0, 15.0
"""Force on a slow hand that means contact; on a free hand it is at most 6 N (measured in the plant). With an object."""
_NEAR_X_M, _NEAR_Y_M, _NEAR_Z_M = 0.05, 0.3, 0.06
"""Distances ahead of the carrying positions, to a side and above them within which the hand is near the body."""
WEIGHING_S = 0.3
"""Time over which weighing averages the noise of the readings."""
FEELING_S = (0.5, 4.0)
"""Least and most time to feel a thin object's weight."""
_FEELING_KG = 0.0045
"""Standard error of the mean at which the arm has felt long enough."""
LEAST_FELT_KG = 0.015
"""Mass from which on shut jaws hold something; an empty arm weighs up to 9 g more or less than computed."""
SHUT_RAD = 0.02
"""Opening below which the fingers may meet each other before an object that is in the hollow behind their tips."""
_PADDING_M = 0.01
"""Distance that the arm keeps from boxes."""
_BEYOND_M = 0.5
"""Length of the hand and the held object beyond the arm's reach."""
_OUTLINE_MARGIN_M = 0.05
_STOWED_RAD = 0.05
"""Joints no farther from the stowed configuration than this are stowed."""
_OPEN_RAD = 0.05
"""An opening beyond this is closed before the arm is stowed."""


class ArmSkill(RoutineSkill[InputsT]):
    """Routine that moves the arm.

    `boxes` (frame B) are obstacles; `held` (frame H) are boxes in the hand. Solid cells from the cameras are obstacles
    too, except within `known_W` (lowest and highest corners, world), where only `boxes` count. While `_watch` is set,
    the loss of the held object fails the skill with `lost_message`.
    """

    lost_message: ClassVar[str] = "the {thing} was lost"

    def __init__(self, context: SkillContext) -> None:
        super().__init__(context)
        self.boxes: Sequence[Box] = ()
        self.held: Sequence[Box] = ()
        self.known_W: Sequence[tuple[FloatArray, FloatArray]] = ()
        self._scene: ArmScene | None = None
        self._model: ArmModel | None = None
        self._watch: HoldWatch | None = None
        self._doubted_s = 0.0
        self._rng = np.random.default_rng(context.seed)

    def begin(self, inputs: InputsT) -> None:
        """Resets the obstacles, the held object and the random numbers of an earlier attempt."""
        self._watch = None
        self._forget()
        super().begin(inputs)

    def resume(self, inputs: InputsT) -> None:
        """Continues after a pause or a restart; obstacles may have moved, and a slip during the pause is ignored."""
        self._watch = None if self._watch is None else self.hold_watch()
        if not self.can_go_on():
            self._forget()
        super().resume(inputs)

    def _forget(self) -> None:
        self._doubted_s = 0.0
        self.boxes, self.held, self.known_W, self._scene = (), (), (), None
        self._rng = np.random.default_rng(self.context.seed)

    def trouble(self) -> SkillFailure | None:
        """Returns a failure when the watched object is lost."""
        if self._watch is None or self.grip_by(self._watch) is not Grip.LOST:
            return None
        self._watch = None
        return SkillFailure(Cause.POSTCONDITION, self.lost_message.format(thing=self.thing))

    def grip_by(self, watch: HoldWatch) -> Grip:
        """Judges the grip; grips the object more firmly when it starts to slip."""
        robot, clock = self.context.robot, self.context.clock
        if (grip := watch.judge(robot.gripper(), clock.now())) is Grip.SLIPPING:
            self.issue(grip_again(robot, watch.force_n, clock=clock, lease=self.context.lease))
        return grip

    @property
    def model(self) -> ArmModel:
        """Kinematics of the robot's arm. Raises SkillFailure with cause PRECONDITION when it has no suitable arm."""
        if self._model is None:
            try:
                self._model = arm_model(self.context.robot.capabilities())
            except ValueError as error:
                raise SkillFailure(Cause.PRECONDITION, str(error)) from error
        return self._model

    @property
    def arm(self) -> ArmCapabilities:
        """Capabilities of the arm. Raises SkillFailure with cause PRECONDITION when there is none."""
        arm = self.context.robot.capabilities().arm
        if arm is None:
            raise SkillFailure(Cause.PRECONDITION, "the robot has no arm")
        return arm

    @property
    def gripper(self) -> GripperCapabilities:
        """Geometry and limits of the gripper. Raises SkillFailure with cause PRECONDITION when there is none."""
        gripper = self.context.robot.capabilities().gripper
        if gripper is None:
            raise SkillFailure(Cause.PRECONDITION, "the robot has no gripper")
        return gripper

    @property
    def thing(self) -> str:
        """Name of the held object, as far as it is known."""
        return str(self.context.payload.kind or "object")

    @property
    def p_HT(self) -> FloatArray:
        """Point (3,) in the hand frame at which the gripper holds an object (m)."""
        return np.array([self.gripper.grip_x_m, 0.0, 0.0])

    def X_WB(self) -> RigidTransform:
        """The body's estimated pose in the world."""
        return self.context.X_WB()

    def q_rad(self) -> FloatArray:
        """Present arm angles (J,), clipped to their limits, because a servo may slightly exceed them.

        Raises SkillFailure with cause EXECUTION when the robot reports angles that are not finite.
        """
        positions = self.context.robot.joints().position_rad
        q = np.array([positions[name] for name in self.model.names])
        if not np.all(np.isfinite(q)):
            raise SkillFailure(Cause.EXECUTION, "the robot does not know its arm's angles")
        return np.asarray(np.clip(q, self.model.lower_rad, self.model.upper_rad))

    def arm_points_B(self, q_rad: FloatArray) -> FloatArray:
        """Points (J + 1, 3) of the arm in the body frame: the joints from the shoulder on, and the gripper's tip."""
        gripper = self.context.robot.capabilities().gripper
        tip_B = self.model.X_BH(q_rad) @ np.array([0.0 if gripper is None else gripper.length_m, 0.0, 0.0])
        return np.vstack([self.model.points_B(q_rad), tip_B])

    def is_hand_near(self, p_W: FloatArray, within_m: float) -> bool:
        """Returns whether the hand is within a distance of a point in the world."""
        p_BP = self.X_WB().inverse() @ np.asarray(p_W)
        return float(np.linalg.norm(self.model.X_BH(self.q_rad()).translation() - p_BP)) < within_m

    def hold_watch(self) -> HoldWatch:
        """A new monitor for the object in the gripper."""
        return hold_watch(self.context.robot.capabilities())

    def scene_now(self, boxes: Sequence[Box] | None = None) -> Callable[[], ArmScene]:
        """Returns a function that builds the collision scene as it is now, inside a Worker job.

        `boxes` (frame B) replace the skill's obstacles.
        """
        robot, model, held = self.context.robot, self.model, self.held
        boxes = [*self.boxes, *self.seen_boxes()] if boxes is None else boxes
        capabilities, joints = robot.capabilities(), robot.joints()
        work, opening = self.context.work, max(0.0, robot.gripper().opening)

        def prepared() -> ArmScene:
            self._scene = scene = self._scene or ArmScene(capabilities, model, joints.position_rad, work=work)
            scene.set_joints(joints.position_rad)
            scene.set_boxes(boxes)
            scene.hold(held)
            scene.set_padding(_PADDING_M)
            scene.set_opening(opening)
            return scene

        return prepared

    def seen_boxes(self, beyond_m: float = 0.0, hidden_W: FloatArray | None = None) -> list[Box]:
        """Boxes (B) around the solid cells and columns within the arm's reach plus `beyond_m`, outside `known_W`.

        Omits cells at the body, the arm and the held object: a small pose error must not block the arm. Space about a
        point `hidden_W` (3,) that no picture shows counts as solid.
        """
        context, X_WB, q_rad = self.context, self.X_WB(), self.q_rad()
        held_H = context.payload.corners_H if context.robot.gripper().holding else None
        held_W = None if held_H is None else (X_WB @ self.model.X_BH(q_rad), held_H)
        arm_W, stowed_W = (X_WB @ self.arm_points_B(q_rad).T for q_rad in (q_rad, self.model.stowed_rad))
        own = OwnSpace(self._outline(), (arm_W,), tuple(self.known_W), held_W)
        reach_m = _BEYOND_M + self.arm.max_reach_m + beyond_m
        seen = solid_boxes(context.solid.cells, X_WB, reach_m, own.holds)
        own = replace(own, lines_W=(arm_W, stowed_W))
        hidden = [] if hidden_W is None else hidden_boxes(hidden_W, context.solid.views, X_WB, own.holds)
        return [*seen, *column_boxes(context.solid_columns, X_WB, reach_m, own.holds), *hidden]

    def _outline(self) -> Outline:
        """The body's outline, grown by a margin."""
        corners = np.array(self.context.robot.capabilities().footprint_m)
        return Outline(self.X_WB(), corners.min(axis=0) - _OUTLINE_MARGIN_M, corners.max(axis=0) + _OUTLINE_MARGIN_M)

    def attempt_at_heights(
        self, heights_m: Sequence[float], message: str, attempt: Callable[[], Routine[PlannedT]]
    ) -> Routine[PlannedT]:
        """Runs `attempt` at each body height (m) in turn until one finds a plan.

        Raises the SkillFailure of the last height, or the first failure with another cause than PLANNING.
        """
        *first_m, last_m = heights_m
        for height_m in first_m:
            yield from self.stand_at(height_m, message)
            with PlanningAttempt():
                return (yield from attempt())
        yield from self.stand_at(last_m, message)
        return (yield from attempt())

    def move_to(
        self, goal: Goal, message: str, speed_rad_s: float | None = None, opening: float | None = None
    ) -> Routine[FloatArray]:
        """Plans to the configuration `goal(scene, q_now)` and moves there; returns that configuration.

        The gripper moves to `opening` during the motion if the wider of its two openings is free of contact. Otherwise
        it closes before the motion, or opens after it.
        """
        scene_now, start, opening_now = self.scene_now(), self.q_rad(), self.context.robot.gripper().opening
        turn = None if opening is None else GripperTurn(opening_now, opening)

        def plan() -> tuple[ArmTrajectory, FloatArray, float | None]:
            scene, planner = scene_now(), self.context.stack.arm_planner
            if turn is not None:
                scene.set_opening(turn.narrow)
            path = planner.path(scene, start, goal(scene, start), self._rng)
            trajectory = planner.trajectory(path, speed_rad_s=speed_rad_s, scene=scene)
            return trajectory, path[-1], None if turn is None else turn.begins_s(scene, trajectory)

        trajectory, q_goal_rad, turn_s = yield from self.compute(
            plan, latency_s=PLANNING_LATENCY_S, name="plan arm motion", message=message
        )
        if turn is None:
            yield from self.follow(trajectory, message)
            return q_goal_rad
        if turn_s is None and turn.closes:
            yield from self.move_gripper(turn.end, GRIPPER_FORCE_N, message)
        yield from self.follow(trajectory, message, None if turn_s is None else self._turning(turn, turn_s))
        yield from self.move_gripper(turn.end, GRIPPER_FORCE_N, message)
        return q_goal_rad

    def move_gripper(self, opening: float, force_n: float, message: str) -> Routine[None]:
        """Moves the gripper with limited force. Raises SkillFailure with cause EXECUTION when it does not finish."""

        def attempt() -> Routine[None]:
            stopped_s: float | None = 0.0
            while stopped_s is not None:
                until_s = self.context.clock.now() + GRIPPER_EXPIRY_S
                command = self.issue(self.gripper_command(opening, force_n))
                stopped_s = yield from self.finish(command, message, "the gripper", until_s=until_s)

        yield from self.persist(attempt, message)

    def gripper_command(self, opening: float, force_n: float) -> CommandId:
        """Commands the gripper without waiting for it."""
        context = self.context
        if opening > context.robot.gripper().opening:
            context.payload.corners_H = context.payload.R_BH = context.payload.kind = None
            context.robot.carry(False, lease=context.lease)
        until_s = context.clock.now() + GRIPPER_EXPIRY_S
        return context.robot.set_gripper(opening, force_n, until_s=until_s, lease=context.lease)

    def _turning(self, turn: GripperTurn, after_s: float) -> Callable[[FloatArray], bool]:
        """A guard for `follow` that commands the gripper after `after_s` and never stops the arm."""
        begins_s, given = self.context.clock.now() + after_s, list[CommandId]()

        def guard(q_wanted_rad: FloatArray) -> bool:
            if not given and self.context.clock.now() >= begins_s:
                given.append(self.issue(self.gripper_command(turn.end, GRIPPER_FORCE_N)))
            return False

        return guard

    def carry(self, R_BH: RotationMatrix, message: str, speed_rad_s: float | None = CARRY_SPEED_RAD_S) -> Routine[None]:
        """Draws the hand near the body, and keeps the object upright: R_BH only turns about the vertical."""
        arm, hangs = self.arm, hangs_below(self.context.payload.corners_H, self.gripper)
        yield from self.move_to(lambda scene, q: carry_configuration(scene, arm, R_BH, q, hangs), message, speed_rad_s)

    def draw_near(self, R_BH: RotationMatrix) -> Routine[None]:
        """Draws in the hand, if it is ahead, above or to the side of where it carries objects (see `carry`)."""
        (x_m, y_m, z_m), arm = self.model.X_BH(self.q_rad()).translation(), self.arm
        far = x_m > max(arm.carry_x_m) + _NEAR_X_M or z_m > max(arm.carry_z_m) + _NEAR_Z_M
        if far or abs(y_m) > _NEAR_Y_M:
            yield from self.carry(R_BH, "drawing in the arm")

    def move_straight(
        self,
        p_BH: FloatArray,
        message: str,
        q_from_rad: FloatArray | None = None,
        *,
        clear_of_boxes: bool = False,
        guard: Callable[[FloatArray], bool] | None = None,
    ) -> Routine[bool]:
        """Moves the hand straight to p_BH with its present orientation; returns whether `guard` stopped it.

        The line begins at the arm's present angles, or at the nearby angles `q_from_rad`. With `clear_of_boxes` the arm
        must touch no obstacle.
        """
        q = self.q_rad() if q_from_rad is None else q_from_rad
        scene_now = self.scene_now() if clear_of_boxes else None

        def plan() -> ArmTrajectory:
            X_BH = RigidTransform(self.model.X_BH(q).rotation(), p_BH)
            scene = None if scene_now is None else scene_now()
            if scene is not None:
                scene.set_padding(0.0)
            planner: ArmPlanner = self.context.stack.arm_planner
            return planner.trajectory(planner.line(self.model, q, X_BH, scene), speed_rad_s=LINE_SPEED_RAD_S)

        trajectory = yield from self.compute(plan, latency_s=0.1, name="plan straight line", message=message)
        return (yield from self.follow(trajectory, message, guard))

    def try_shift_hand(self, offset_B: FloatArray, message: str, *, clear_of_boxes: bool = False) -> Routine[bool]:
        """Moves the hand straight by an offset (3,) in B; returns False when no straight path exists."""
        p_BH = self.model.X_BH(self.q_rad()).translation() + offset_B
        with PlanningAttempt() as attempt:
            yield from self.move_straight(p_BH, message, clear_of_boxes=clear_of_boxes)
        return attempt.failure is None

    def shift_by_first(
        self, offsets_B: Iterable[FloatArray], message: str, *, clear_of_boxes: bool = False
    ) -> Routine[bool]:
        """Moves the hand by the first offset (3,) that has a straight path; returns False when none has one."""
        for offset_B in offsets_B:
            if (yield from self.try_shift_hand(offset_B, message, clear_of_boxes=clear_of_boxes)):
                return True
        return False

    def press(self, offset_B: FloatArray, direction_B: FloatArray, speed_rad_s: float, message: str) -> Routine[bool]:
        """Moves the hand slowly by an offset (3,) in B; returns whether contact along a direction stopped the hand.

        Ignores obstacles. Raises PlanningError when the arm cannot follow the line.
        """
        X_BH, planner = self.model.X_BH(self.q_rad()), self.context.stack.arm_planner
        path = planner.line(self.model, self.q_rad(), RigidTransform(X_BH.rotation(), X_BH.translation() + offset_B))
        trajectory = planner.trajectory(path, speed_rad_s=speed_rad_s)
        return (yield from self.follow(trajectory, message, self.contact_guard(direction_B)))

    def contact_guard(
        self, direction_B: FloatArray, lag_m: float = CONTACT_LAG_M, most_n: float = _PRESS_N
    ) -> Callable[[FloatArray], bool]:
        """A guard for `follow` that stops a slow hand at contact: at a lag along a direction; down, also at a force.

        An empty hand that feels for a surface below it stops at a smaller lag and force.
        """
        before_nm, down = self.efforts_nm(), direction_B[2] < -_DOWN
        feels = down and self.context.payload.kind is None
        most_m, most_n = (_FEEL_LAG_M, _CONTACT_N) if feels else (lag_m, most_n if down else math.inf)

        def guard(q_wanted_rad: FloatArray) -> bool:
            q_rad = self.q_rad()
            lag = self.model.X_BH(q_wanted_rad).translation() - self.model.X_BH(q_rad).translation()
            force_n = hand_force_n(self.model, q_rad, self.p_HT, self.efforts_nm() - before_nm)
            return float(lag @ direction_B) > most_m or -float(force_n @ direction_B) > most_n

        return guard

    def efforts_nm(self) -> FloatArray:
        """Present efforts (J,) of the arm's joints (N m)."""
        efforts = self.context.robot.joints().effort_nm
        return np.array([efforts[name] for name in self.model.names])

    def holds(self, message: str) -> Routine[bool]:
        """Returns whether the gripper holds something, and tells the robot: shut jaws by the weight on the resting arm.

        A gripper that has opened since the last grasp, or has two flat fingers, holds what it reports.
        """
        reading, payload = self.context.robot.gripper(), self.context.payload
        if payload.kind is None or self.gripper.kind is not GripperKind.HINGED or reading.opening > SHUT_RAD:
            return reading.holding
        held = (yield from self.weigh(self.p_HT, message, FEELING_S)) > LEAST_FELT_KG
        self.context.robot.carry(held, lease=self.context.lease)
        payload.kind = payload.kind if held else None
        yield Running(message)
        return held

    def weigh(
        self, p_HO: FloatArray, message: str, span_s: tuple[float, float] = (WEIGHING_S, WEIGHING_S)
    ) -> Routine[float]:
        """Measures the mass (kg) of the object that a resting hand holds at p_HO (3,), with the body level.

        It averages over the shorter time `span_s`, and up to the longer while the standard error is too large.
        """
        scene = yield from self.compute(self.scene_now(), latency_s=0.05, name="prepare weighing", message=message)
        begun_s, found = self.context.clock.now(), list[float]()
        while (spent_s := self.context.clock.now() - begun_s) < span_s[1]:
            if spent_s > span_s[0] and np.std(found) < _FEELING_KG * math.sqrt(len(found)):
                break
            q = self.q_rad()
            found.append(held_mass_kg(self.model, q, p_HO, self.efforts_nm() - scene.gravity_efforts(q)))
            yield Running(message)
        return float(np.mean(found))

    def stow(self, message: str = "stowing the arm") -> Routine[None]:
        """Closes the empty gripper, if there is one, and folds the arm onto the body, unless it is folded already."""
        if self.context.robot.capabilities().arm is None:
            return
        stowed, reading = self.model.stowed_rad, self.context.robot.gripper()
        gripper = self.context.robot.capabilities().gripper
        is_open = gripper is not None and not reading.holding and reading.opening > gripper.like_turn(_OPEN_RAD)
        closing = 0.0 if is_open else None
        if self.model.off_rad(self.q_rad(), stowed) > _STOWED_RAD:
            yield from self.move_to(lambda scene, q: stowed, message, opening=closing)
        elif closing is not None:
            yield from self.move_gripper(closing, GRIPPER_FORCE_N, message)

    def try_stow(self) -> Routine[None]:
        """Stows the arm after a failure; does nothing when stowing fails too."""
        with suppress(SkillFailure):
            yield from self.stow("stowing the arm after the failure")

    def stand_as_usual(self, message: str = "standing as usual") -> Routine[None]:
        """Brings the body to its usual height."""
        yield from self.stand_at(self.context.robot.capabilities().standing_height_m, message)
