"""Base of the skills that move the arm: planned motions, holding, letting go, stowing."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray
from pydrake.math import RigidTransform

from skills.api import Cause, InputsT, Running, SkillContext
from skills.estimate.scan_points import segment_distance
from skills.manipulation.arm.collision import ArmScene, Box
from skills.manipulation.arm.hold import Grip, HoldWatch, grip_again, hold_watch
from skills.manipulation.arm.kinematics import ArmModel, arm_model
from skills.manipulation.arm.poses import UP_B, towards_shoulder
from skills.manipulation.arm.solid_cells import Outline, solid_boxes
from skills.robot import (
    ArmCapabilities,
    ArmTrajectory,
    CommandId,
    FloatArray,
    GripperCapabilities,
    GripperKind,
)
from skills.routine import Routine, RoutineSkill, SkillFailure

Goal = Callable[[ArmScene, FloatArray], FloatArray]
PlannedT = TypeVar("PlannedT")

PLANNING_LATENCY_S = 0.3
LINE_SPEED_RAD_S = 0.6
GRIPPER_FORCE_N = 20.0
CONTACT_LAG_M = 0.006
"""A hand that moves slowly and freely lags by 2 mm at most (measured in the plant); in contact it lags more at once."""
WEIGHING_S = 0.3
_STEP_RAD, _GRAVITY_M_S2 = 1e-4, 9.81
_TURNS_WITHIN_S, _TURN_CHECKED = 1.6, 3
"""The gripper has turned within so long (s); each such sample of the arm's trajectory is checked meanwhile."""
_RELEASE_RAD = 0.4
"""The finger opens so far to let go, and no farther: wide open it would reach what stands beside."""
_ASIDE_M, _LEVEL = 0.018, 0.5
"""Fixed finger and palm leave the object by so much before the hand is drawn back, or it would drag it along."""
_BACK_M = (0.16, 0.12, 0.08, 0.05)
_AT_ARM_M = 0.12
_BEYOND_M = 0.5


def held_mass_kg(model: ArmModel, q_rad: FloatArray, p_HO: FloatArray, extra_nm: FloatArray) -> float:
    """The mass (kg) at p_HO of the hand that explains efforts `extra_nm` (J,) best, by least squares."""
    steps = _STEP_RAD * np.eye(len(q_rad))
    rises = [(model.X_BH(q_rad + step) @ p_HO - model.X_BH(q_rad - step) @ p_HO)[2] for step in steps]
    lever_nm = _GRAVITY_M_S2 * np.array(rises) / (2.0 * _STEP_RAD)
    return float(lever_nm @ extra_nm / (lever_nm @ lever_nm))


@dataclass(frozen=True)
class GripperTurn:
    """The gripper turns from one opening to another (rad) while the arm moves."""

    from_rad: float
    to_rad: float

    @property
    def closes(self) -> bool:
        """Returns whether it ends narrower than it began."""
        return self.to_rad < self.from_rad

    @property
    def narrow_rad(self) -> float:
        """The narrower opening, for which the arm's motion is planned."""
        return max(0.0, min(self.from_rad, self.to_rad))

    def begins_s(self, scene: ArmScene, trajectory: ArmTrajectory) -> float | None:
        """When on a trajectory the gripper may begin to turn: as long as it is wide it touches nothing.

        None where there is no room for it on the way.
        """
        scene.set_opening(max(self.from_rad, self.to_rad))
        times_s = trajectory.times_s
        if self.closes:
            wide = trajectory.positions_rad[times_s <= _TURNS_WITHIN_S]
            return 0.0 if scene.path_free(wide[::_TURN_CHECKED]) else None
        begin_s = None
        for time_s, q_rad in zip(times_s[::-_TURN_CHECKED], trajectory.positions_rad[::-_TURN_CHECKED], strict=True):
            if times_s[-1] - time_s > _TURNS_WITHIN_S or not scene.free(q_rad):
                break
            begin_s = float(time_s)
        return begin_s


class ArmSkill(RoutineSkill[InputsT]):
    """A routine with an arm. `boxes` stand around it (frame B), `held` is in the hand (frame H).

    Around it stands also what the hand camera has seen so far, but in `known_W` (least and greatest corners, world)
    what `boxes` say.
    """

    def __init__(self, context: SkillContext) -> None:
        super().__init__(context)
        self.boxes: Sequence[Box] = ()
        self.held: Sequence[Box] = ()
        self.known_W: Sequence[tuple[FloatArray, FloatArray]] = ()
        self._scene: ArmScene | None = None
        self._model: ArmModel | None = None
        self._rng = np.random.default_rng(context.seed)

    def begin(self, inputs: InputsT) -> None:
        """Forgets an earlier attempt: what stood around, what was held, the random numbers drawn."""
        self._forget()
        super().begin(inputs)

    def resume(self, inputs: InputsT) -> None:
        """Goes on after a pause or a restart: what stood around may have moved."""
        if not self.can_go_on():
            self._forget()
        super().resume(inputs)

    def _forget(self) -> None:
        self._doubted_s = 0.0
        self.boxes, self.held, self.known_W, self._scene = (), (), (), None
        self._rng = np.random.default_rng(self.context.seed)

    _watch: HoldWatch | None = None
    _doubted_s: float = 0.0

    def lost(self, message: str) -> SkillFailure | None:
        """A failure of that message when what `_watch` watches is lost; what begins to slip is gripped again."""
        if self._watch is None:
            return None
        context = self.context
        grip = self._watch.judge(context.robot.gripper(), context.clock.now())
        if grip is Grip.SLIPPING:
            self.issue(grip_again(context.robot, self._watch.force_n, clock=context.clock, lease=context.lease))
        if grip is not Grip.LOST:
            return None
        self._watch = None
        return SkillFailure(Cause.POSTCONDITION, message)

    def hand_near(self, p_W: FloatArray, within_m: float) -> bool:
        """Returns whether the hand is this near to a point in the world."""
        p_BP = self.X_WB().inverse() @ np.asarray(p_W)
        return float(np.linalg.norm(self.model.X_BH(self.q_rad()).translation() - p_BP)) < within_m

    def try_shift_hand(self, offset_B: FloatArray, message: str, *, clear_of_boxes: bool = False) -> Routine[bool]:
        """Shifts the hand where a straight way is found; whether there was one. It may have to touch nothing."""
        try:
            yield from self.shift_hand(offset_B, message, clear_of_boxes=clear_of_boxes)
        except SkillFailure as failure:
            if failure.cause is not Cause.PLANNING:
                raise
            return False
        return True

    @property
    def model(self) -> ArmModel:
        """The robot's arm. Raises SkillFailure with cause PRECONDITION when it has none that we can move."""
        if self._model is None:
            try:
                self._model = arm_model(self.context.robot.capabilities())
            except ValueError as error:
                raise SkillFailure(Cause.PRECONDITION, str(error)) from error
        return self._model

    def q_rad(self) -> FloatArray:
        """Arm angles now, within their limits, beyond which a servo may be by a little; no trajectory may begin there.

        Raises SkillFailure with cause EXECUTION when the robot gives no numbers.
        """
        positions = self.context.robot.joints().position_rad
        q = np.array([positions[name] for name in self.model.names])
        if not np.all(np.isfinite(q)):
            raise SkillFailure(Cause.EXECUTION, "the robot does not know its arm's angles")
        return np.asarray(np.clip(q, self.model.lower_rad, self.model.upper_rad))

    def X_WB(self) -> RigidTransform:
        """The body's pose in the world, as estimated."""
        return self.context.X_WB()

    def scene_now(self, boxes: Sequence[Box] | None = None) -> Callable[[], ArmScene]:
        """Gives, inside a Worker job, the collision scene with what stands around and what is held just now.

        `boxes` (frame B) stand around instead of what is known, where they are given.
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
            scene.set_padding(0.01)
            scene.set_opening(opening)
            return scene

        return prepared

    def seen_boxes(self, beyond_m: float = 0.0) -> list[Box]:
        """What the hand camera has seen within reach, but what is known better and what is at the arm itself.

        `beyond_m` is added to the reach.
        """
        X_WB, q_rad = self.X_WB(), self.q_rad()
        arm_W = self.model.points_B(q_rad) @ X_WB.rotation().matrix().T + X_WB.translation()
        tip_W = X_WB @ self.model.X_BH(q_rad) @ np.array([self.gripper.length_m, 0.0, 0.0])
        segments, own = list(pairwise([*arm_W, tip_W])), self._own()

        def left_out(points_W: FloatArray) -> NDArray[np.bool_]:
            out = np.any([segment_distance(points_W, *each) < _AT_ARM_M for each in segments], axis=0)
            for low, high in self.known_W:
                out |= np.all((points_W > low) & (points_W < high), axis=1)
            return np.asarray(out | own.holds(points_W))

        return solid_boxes(self.context.solid.cells, X_WB, self._reach_m() + beyond_m, left_out)

    def _reach_m(self) -> float:
        """How far from the body's origin the arm and what it holds may come."""
        arm = self.context.robot.capabilities().arm
        return _BEYOND_M + (0.0 if arm is None else arm.max_reach_m)

    def _own(self) -> Outline:
        """The body's outline, a little wider."""
        corners = np.array(self.context.robot.capabilities().footprint_m)
        return Outline(self.X_WB(), corners.min(axis=0) - 0.05, corners.max(axis=0) + 0.05)

    def from_a_height(
        self, heights_m: Sequence[float], message: str, attempt: Callable[[], Routine[PlannedT]]
    ) -> Routine[PlannedT]:
        """What `attempt` gives with the body at the first of some heights (m) at which it finds a plan.

        Raises SkillFailure: that of the last height, or the first one that is not for want of a plan.
        """
        *first_m, last_m = heights_m
        for height_m in first_m:
            yield from self.stand_at(height_m, message)
            try:
                return (yield from attempt())
            except SkillFailure as failure:
                if failure.cause is not Cause.PLANNING:
                    raise
        yield from self.stand_at(last_m, message)
        return (yield from attempt())

    def move_to(
        self, goal: Goal, message: str, speed_rad_s: float | None = None, opening: float | None = None
    ) -> Routine[FloatArray]:
        """Plans to the configuration that `goal(scene, q_now)` gives, and goes there; gives that configuration.

        The gripper comes to `opening` on the way, as long as its wider opening is free of contact there; what it
        cannot do on the way it does before when it closes, afterwards when it opens.
        """

        scene_now, start, now_rad = self.scene_now(), self.q_rad(), self.context.robot.gripper().opening
        turn = None if opening is None else GripperTurn(now_rad, opening)

        def plan() -> tuple[ArmTrajectory, FloatArray, float | None]:
            scene, planner = scene_now(), self.context.stack.arm_planner
            if turn is not None:
                scene.set_opening(turn.narrow_rad)
            path = planner.path(scene, start, goal(scene, start), self._rng)
            trajectory = planner.timed(path, speed_rad_s=speed_rad_s, scene=scene)
            return trajectory, path[-1], None if turn is None else turn.begins_s(scene, trajectory)

        trajectory, q_goal_rad, turn_s = yield from self.compute(
            plan, latency_s=PLANNING_LATENCY_S, name="plan arm motion", message=message
        )
        if turn is None:
            yield from self.follow(trajectory, message)
            return q_goal_rad
        if turn_s is None and turn.closes:
            yield from self.move_gripper(turn.to_rad, GRIPPER_FORCE_N, message)
        yield from self.follow(trajectory, message, None if turn_s is None else self._turning(turn, turn_s))
        yield from self.move_gripper(turn.to_rad, GRIPPER_FORCE_N, message)
        return q_goal_rad

    def _turning(self, turn: GripperTurn, after_s: float) -> Callable[[FloatArray], bool]:
        """A guard for `follow` that stops nothing: it gives the gripper its command after a while."""
        begins_s, given = self.context.clock.now() + after_s, list[CommandId]()

        def guard(q_wanted_rad: FloatArray) -> bool:
            if not given and self.context.clock.now() >= begins_s:
                given.append(self.issue(self.gripper_command(turn.to_rad, GRIPPER_FORCE_N)))
            return False

        return guard

    def move_straight(
        self,
        p_BH: FloatArray,
        message: str,
        q_from_rad: FloatArray | None = None,
        *,
        clear_of_boxes: bool = False,
        guard: Callable[[FloatArray], bool] | None = None,
    ) -> Routine[bool]:
        """Moves the hand straight to p_BH with the orientation that it has; whether `guard` stopped it (see `follow`).

        The line begins at the joint angles of the arm, or at `q_from_rad`, which the arm about has. With
        `clear_of_boxes` it must not touch what stands around.
        """

        q = self.q_rad() if q_from_rad is None else q_from_rad
        scene_now = self.scene_now() if clear_of_boxes else None

        def plan() -> ArmTrajectory:
            X_BH = RigidTransform(self.model.X_BH(q).rotation(), p_BH)
            scene = None if scene_now is None else scene_now()
            if scene is not None:
                scene.set_padding(0.0)
            planner = self.context.stack.arm_planner
            return planner.timed(planner.line(self.model, q, X_BH, scene), speed_rad_s=LINE_SPEED_RAD_S)

        trajectory = yield from self.compute(plan, latency_s=0.1, name="plan straight line", message=message)
        return (yield from self.follow(trajectory, message, guard))

    def shift_hand(self, offset_B: FloatArray, message: str, *, clear_of_boxes: bool = False) -> Routine[None]:
        """Moves the hand straight by an offset in the body frame."""
        p_BH = self.model.X_BH(self.q_rad()).translation() + offset_B
        yield from self.move_straight(p_BH, message, clear_of_boxes=clear_of_boxes)

    def weigh(self, p_HO: FloatArray, message: str) -> Routine[float]:
        """The mass (kg) of what the still hand holds at p_HO (3,), from the arm's efforts; body level.

        Noise that one reading has is averaged over `WEIGHING_S`.
        """
        scene = yield from self.compute(self.scene_now(), latency_s=0.05, name="prepare weighing", message=message)
        end_s, found = self.context.clock.now() + WEIGHING_S, []
        while self.context.clock.now() < end_s:
            efforts = self.context.robot.joints().effort_nm
            q = self.q_rad()
            extra = np.array([efforts[name] for name in self.model.names]) - scene.gravity_efforts(q)
            found.append(held_mass_kg(self.model, q, p_HO, extra))
            yield Running(message)
        return float(np.median(found))

    def held_up(self, direction_B: FloatArray, lag_m: float = CONTACT_LAG_M) -> Callable[[FloatArray], bool]:
        """A guard for `follow`: whether the hand, which moves slowly that way, lags as far as if something stops it."""

        def guard(q_wanted_rad: FloatArray) -> bool:
            lag = self.model.X_BH(q_wanted_rad).translation() - self.model.X_BH(self.q_rad()).translation()
            return float(lag @ direction_B) > lag_m

        return guard

    @property
    def gripper(self) -> GripperCapabilities:
        """The gripper's geometry and limits. Raises SkillFailure with cause PRECONDITION when there is none."""
        gripper = self.context.robot.capabilities().gripper
        if gripper is None:
            raise SkillFailure(Cause.PRECONDITION, "the robot has no gripper")
        return gripper

    @property
    def arm(self) -> ArmCapabilities:
        """What the arm can do. Raises SkillFailure with cause PRECONDITION when there is none."""
        arm = self.context.robot.capabilities().arm
        if arm is None:
            raise SkillFailure(Cause.PRECONDITION, "the robot has no arm")
        return arm

    def hold_watch(self) -> HoldWatch:
        """A watch over what the gripper holds, from now on."""
        return hold_watch(self.context.robot.capabilities())

    @property
    def widest(self) -> float:
        """How far the gripper opens."""
        return self.gripper.widest

    @property
    def p_HT(self) -> FloatArray:
        """Where the middle of what the gripper holds is in the hand frame (3,), m."""
        return np.array([self.gripper.grip_x_m, 0.0, 0.0])

    def release_rad(self) -> float:
        """How far the gripper opens to let go of what it holds."""
        most = 0.75 if self.gripper.kind is GripperKind.HINGED else 1.0
        return min(self.context.robot.gripper().opening + self.gripper.like_turn(_RELEASE_RAD), most * self.widest)

    def leave_object(self) -> Routine[bool]:
        """Takes fixed finger and palm off what was let go of, and draws the hand back; whether there was a way.

        Fingers that both open are off it already.
        """
        X_BH = self.model.X_BH(self.q_rad())
        fingers, _, closing = X_BH.rotation().matrix().T
        if abs(closing[2]) < _LEVEL and self.gripper.kind is GripperKind.HINGED:
            aside = -_ASIDE_M * (closing * [1.0, 1.0, 0.0] + fingers)
            yield from self.try_shift_hand(aside, "letting go")
        for shift_B in retreats_B(X_BH, self.model.p_BS):
            if (yield from self.try_shift_hand(shift_B, "drawing the hand back")):
                return True
        return False

    def stow(self, message: str = "stowing the arm") -> Routine[None]:
        """Closes the gripper and fold the arm onto the body; nothing is done where it lies there already."""
        stowed = self.model.stowed_rad
        gripper = self.context.robot.gripper()
        closing_rad = 0.0 if not gripper.holding and gripper.opening > self.gripper.like_turn(0.05) else None
        if self.model.off_rad(self.q_rad(), stowed) > 0.05:
            yield from self.move_to(lambda scene, q: stowed, message, opening=closing_rad)
        elif closing_rad is not None:
            yield from self.move_gripper(closing_rad, GRIPPER_FORCE_N, message)

    def stand_as_usual(self, message: str = "standing as usual") -> Routine[None]:
        """Brings the body to its usual height."""
        yield from self.stand_at(self.context.robot.capabilities().standing_height_m, message)

    def try_stow(self) -> Routine[None]:
        """Stows where a way is found; used on the way out of failures."""
        try:
            yield from self.stow("stowing the arm after the failure")
        except SkillFailure:
            return


def retreats_B(X_BH: RigidTransform, p_BS: FloatArray) -> list[FloatArray]:
    """Shifts of the hand away from what it has let go of, the best first: back along the fingers, up, up and back.

    The last are towards the shoulder at p_BS: an arm that is stretched out has no other.
    """
    directions_B = (
        -X_BH.rotation().matrix()[:, 0],
        UP_B,
        math.sqrt(0.5) * (UP_B + towards_shoulder(p_BS, X_BH.translation())),
    )
    return [back_m * direction_B for direction_B in directions_B for back_m in _BACK_M]
