"""Collision checks of the arm against the body and boxes around it."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING, Final

import numpy as np
from pydrake.math import RigidTransform

from skills.api import NO_WORK_COUNTER, WorkCounter
from skills.arm.kinematics import ArmModel
from skills.robot import Capabilities, FloatArray

if TYPE_CHECKING:
    from pydrake.planning import SceneGraphCollisionChecker

AROUND: Final = "around"
"""The name of the body that stands for all boxes."""
EDGE_STEP_RAD = 0.05
"""How far apart (rad, all joints together) the configurations of a motion are checked."""
_LINK_RADIUS_M, _PARALLEL = 0.06, 1e-6
_SCENES_KEPT, _FAR_M = 4, 100.0


@dataclass(frozen=True)
class Box:
    """A box: pose of its centre in some frame, full extents in m."""

    X_FG: RigidTransform
    size_m: tuple[float, float, float]


def gaps_m(box: Box, boxes: Sequence[Box], moves: FloatArray) -> FloatArray:
    """How far (m) a box is at least from each of N others after each of K moves (K, 3): (K, N).

    It is negative where they overlap. All are in one frame. By the fifteen axes that separate boxes (Gottschalk, Lin
    and Manocha, "OBBTree", 1996).
    """
    if not boxes:
        return np.empty((len(moves), 0))
    poses = np.array([other.X_FG.GetAsMatrix34() for other in boxes])
    own, others = box.X_FG.rotation().matrix().T, np.swapaxes(poses[:, :, :3], 1, 2)  # rows are the sides' directions
    crossed = np.cross(own[None, :, None, :], others[:, None, :, :]).reshape(-1, 9, 3)
    lengths = np.linalg.norm(crossed, axis=2, keepdims=True)
    crossed = np.where(lengths > _PARALLEL, crossed / np.maximum(lengths, _PARALLEL), own[0])
    axes = np.concatenate([np.broadcast_to(own, others.shape), others, crossed], axis=1)
    spans = np.abs(axes @ own.T) @ (0.5 * np.array(box.size_m))
    spans += np.einsum(
        "nas,ns->na", np.abs(axes @ np.swapaxes(others, 1, 2)), 0.5 * np.array([b.size_m for b in boxes])
    )
    apart = np.einsum("nac,nc->na", axes, poses[:, :, 3] - box.X_FG.translation())
    return np.asarray(np.max(np.abs(apart - np.einsum("nac,kc->kna", axes, moves)) - spans, axis=2))


def box_corners(box: Box) -> FloatArray:
    """The eight corners of a box, (8, 3) in the frame in which it is given."""
    signs = np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).reshape(3, -1).T
    half = 0.5 * np.array(box.size_m)
    return np.asarray(signs * half @ box.X_FG.rotation().matrix().T + box.X_FG.translation())


class ArmScene:
    """The robot standing still with boxes around it, all in the body frame.

    Legs stand at the joint angles given; the gripper's angle and a thing in the hand may change between checks.
    """

    def __init__(
        self,
        capabilities: Capabilities,
        model: ArmModel,
        joint_positions_rad: Mapping[str, float],
        padding_m: float = 0.01,
        work: WorkCounter = NO_WORK_COUNTER,
    ) -> None:
        """`work` counts the checks."""
        self.model, self._work = model, work
        self._description = _without_visuals(capabilities.description)
        self._joints_rad = dict(joint_positions_rad)
        self._padding_m, self._opening = padding_m, 0.0
        self._gripper, self._capabilities = capabilities.gripper, capabilities
        self._held: tuple[Box, ...] = ()
        self._built: dict[bytes, _BuiltScene] = {}
        self._now, self._X_BF = self._with(()), RigidTransform()

    def set_boxes(self, boxes: Sequence[Box], X_BF: RigidTransform | None = None) -> None:
        """Replace the boxes around the robot, given in frame F, the body's own where X_BF is left out.

        Boxes of one of the last few calls are found again at once; only X_BF may differ.
        """
        self._now, self._X_BF = self._with(tuple(boxes)), RigidTransform() if X_BF is None else X_BF
        self._now.place(self._X_BF)

    @contextmanager
    def with_only(self, boxes: Sequence[Box], opening: float) -> Iterator[None]:
        """For a while other boxes (frame B) stand around, and the gripper is open so far."""
        before, X_BF, opening_before_rad = self._now, self._X_BF, self._opening
        self.set_boxes(boxes)
        self._opening = opening
        try:
            yield
        finally:
            self._now, self._X_BF, self._opening = before, X_BF, opening_before_rad

    def beyond_body_m(self, q_rad: FloatArray) -> tuple[float, float]:
        """How far the arm sticks out of the body's footprint ahead and to a side (m); 0 where it does not."""
        most_m = np.max(np.abs(np.asarray(self._capabilities.footprint_m)), axis=0)
        x, y, _ = self.model.points_B(q_rad).T
        ahead_m, beside_m = float(np.max(x) - most_m[0]), float(np.max(np.abs(y)) - most_m[1])
        return max(0.0, ahead_m + _LINK_RADIUS_M), max(0.0, beside_m + _LINK_RADIUS_M)

    def hold(self, boxes: Sequence[Box]) -> None:
        """Replace the boxes fixed to the hand (frame H), for a thing held."""
        self._held = tuple(boxes)

    def set_opening(self, opening: float) -> None:
        """Opening of the gripper in later checks, 0 closed."""
        self._opening = opening

    def set_joints(self, joint_positions: Mapping[str, float]) -> None:
        """Where the robot's other joints are in later checks: legs, lift, head."""
        self._joints_rad = dict(joint_positions)
        for built in self._built.values():
            built.set_joints(self._joints_rad)

    def set_padding(self, padding_m: float) -> None:
        """Distance that the robot keeps from boxes in later checks."""
        self._padding_m = padding_m

    def _with(self, boxes: tuple[Box, ...]) -> _BuiltScene:
        """The scene with these boxes, the one built before where it is still kept."""
        key = b"".join(box.X_FG.GetAsMatrix34().tobytes() + np.array(box.size_m).tobytes() for box in boxes)
        fingers = () if self._gripper is None else tuple(self._gripper.finger_positions(0.0))
        built = self._built.pop(key, None)
        built = built or _BuiltScene(self._description, self.model, boxes, self._joints_rad, fingers)
        self._built[key] = built
        if len(self._built) > _SCENES_KEPT:
            del self._built[next(iter(self._built))]
        return built

    @property
    def _checker(self) -> SceneGraphCollisionChecker:
        """The checker of the present boxes, with the present padding and thing held."""
        return self._now.checker(self._padding_m, self._held)

    def free(self, q_rad: FloatArray) -> bool:
        """Whether arm angles q_rad (J,) collide with nothing."""
        self._work.count("arm_configuration_checks")
        return bool(self._checker.CheckConfigCollisionFree(self._full(q_rad)))

    def free_as_usual(self, q_rad: FloatArray) -> bool:
        """Whether arm angles q_rad (J,) collide with nothing once a torso on a lift is at its usual height again.

        True on robots without a lift.
        """
        lift, usual_m = self._capabilities.lift_joint, self._capabilities.standing_height_m
        if lift is None:
            return True
        before = self._joints_rad
        usual = usual_m - self._capabilities.height_range_m[0]
        try:
            self._now.place(RigidTransform([0.0, 0.0, before.get(lift, usual) - usual]) @ self._X_BF)
            self._now.set_joints({**before, lift: usual})
            return self.free(q_rad)
        finally:
            self._now.place(self._X_BF)
            self._now.set_joints(before)

    def edge_free(self, q_from_rad: FloatArray, q_to_rad: FloatArray) -> bool:
        """Whether the straight joint motion between two configurations collides with nothing."""
        self._work.count("arm_edge_checks")
        return bool(self._checker.CheckEdgeCollisionFree(self._full(q_from_rad), self._full(q_to_rad)))

    def path_free(self, path_rad: FloatArray) -> bool:
        """Whether every configuration of a dense path (K, J) is free."""
        return all(self.free(q) for q in path_rad)

    def gravity_efforts(self, q_rad: FloatArray) -> FloatArray:
        """Efforts (J,), N m, with which the arm holds its own weight at angles q_rad (J,), the body level."""
        checker = self._checker
        context = checker.UpdatePositions(self._full(q_rad))
        held: FloatArray = -checker.plant().CalcGravityGeneralizedForces(context)[self._now.arm_velocities]
        return held

    def contacts(self, q_rad: FloatArray) -> tuple[tuple[str, str], ...]:
        """Names of the links that touch or come closer than the padding, for messages; boxes are `AROUND`."""
        return _contacts(self._checker, self._full(q_rad))

    def _full(self, q_rad: FloatArray) -> FloatArray:
        fingers = {} if self._gripper is None else self._gripper.finger_positions(self._opening)
        return self._now.positions(q_rad, fingers)


class _BuiltScene:
    """Drake's collision checker with the robot welded by its body and all boxes on one floating body.

    Boxes are part of the model from the start: shapes that are added to a checker later cost 10 ms each.
    """

    def __init__(
        self,
        description: str,
        model: ArmModel,
        boxes: tuple[Box, ...],
        joint_positions_rad: Mapping[str, float],
        fingers: Sequence[str] = (),
    ) -> None:
        from pydrake.geometry import Box as BoxShape
        from pydrake.multibody.parsing import Parser
        from pydrake.multibody.plant import CoulombFriction
        from pydrake.multibody.tree import SpatialInertia
        from pydrake.planning import RobotDiagramBuilder, SceneGraphCollisionChecker

        builder = RobotDiagramBuilder()
        plant = builder.plant()
        (robot,) = Parser(plant).AddModelsFromString(description, "urdf")
        plant.WeldFrames(plant.world_frame(), plant.GetFrameByName("body", robot))
        around = plant.AddRigidBody(
            AROUND, plant.AddModelInstance(AROUND), SpatialInertia.SolidSphereWithMass(1.0, 1.0)
        )
        for number, box in enumerate(boxes):
            friction = CoulombFriction(1.0, 1.0)
            plant.RegisterCollisionGeometry(around, box.X_FG, BoxShape(*box.size_m), f"box_{number}", friction)
        plant.Finalize()
        self._model, self._instance = model, plant.GetModelInstanceName(robot)
        self._checker = SceneGraphCollisionChecker(
            model=builder.Build(), robot_model_instances=[robot], edge_step_size=EDGE_STEP_RAD
        )
        self._padding_m: float | None = None
        self._held: tuple[Box, ...] = ()
        self._q = np.array(plant.GetPositions(plant.CreateDefaultContext()))
        joints = {plant.get_joint(index).name(): plant.get_joint(index) for index in plant.GetJointIndices(robot)}
        self._arm = np.array([joints[name].position_start() for name in model.names])
        self.arm_velocities = np.array([joints[name].velocity_start() for name in model.names])
        self._positions = {name: joint.position_start() for name, joint in joints.items() if joint.num_positions() == 1}
        self.set_joints(joint_positions_rad)
        self._around = around.floating_positions_start()
        self.place(RigidTransform([0.0, 0.0, _FAR_M]))
        self._allow_stowed_contacts()
        for one, other in combinations([joints[name].child_body() for name in fingers], 2):  # they meet when they close
            self._checker.SetCollisionFilteredBetween(one, other, True)
        self.place(RigidTransform())

    def set_joints(self, joint_positions: Mapping[str, float]) -> None:
        """Where all joints are that are not given with each check; 0 where nothing is said."""
        for name, start in self._positions.items():
            self._q[start] = joint_positions.get(name, 0.0)

    def place(self, X_BF: RigidTransform) -> None:
        """Put the boxes' frame F there."""
        quaternion = X_BF.rotation().ToQuaternion().wxyz()
        self._q[self._around : self._around + 7] = [*quaternion, *X_BF.translation()]

    def positions(self, q_rad: FloatArray, fingers: Mapping[str, float]) -> FloatArray:
        """All positions of the model with the arm at q_rad (J,) and the gripper's joints there, by name."""
        q = self._q.copy()
        q[self._arm] = q_rad
        for name, position in fingers.items():
            q[self._positions[name]] = position
        return q

    def checker(self, padding_m: float, held: tuple[Box, ...]) -> SceneGraphCollisionChecker:
        """The checker with a padding to the boxes (m) and a thing in the hand (frame H)."""
        from pydrake.geometry import Box as BoxShape
        from pydrake.planning import BodyShapeDescription

        if held != self._held:
            self._checker.RemoveAllAddedCollisionShapes("held")
            for box in held:
                shape = BodyShapeDescription(BoxShape(*box.size_m), box.X_FG, self._instance, self._model.hand_link)
                self._checker.AddCollisionShape("held", shape)
            self._held = held
        if padding_m != self._padding_m:
            self._checker.SetPaddingAllRobotEnvironmentPairs(padding_m)
            self._padding_m = padding_m
        return self._checker

    def _allow_stowed_contacts(self) -> None:
        """Links that touch when the arm is stowed may touch: resting there is what stowing means."""
        for a, b in _contacts(self._checker, self.positions(self._model.stowed_rad, {})):
            plant = self._checker.plant()
            self._checker.SetCollisionFilteredBetween(plant.GetBodyByName(a), plant.GetBodyByName(b), True)


def _contacts(checker: SceneGraphCollisionChecker, q_rad: FloatArray) -> tuple[tuple[str, str], ...]:
    """Names of the links that touch or come closer than the padding at all positions q_rad of the model."""
    clearance = checker.CalcRobotClearance(q_rad, 0.0)
    bodies = [
        (checker.get_body(a).name(), checker.get_body(b).name())
        for a, b in zip(clearance.robot_indices(), clearance.other_indices(), strict=True)
    ]
    return tuple(bodies)


def _without_visuals(description: str) -> str:
    """URDF text without its visual elements, whose mesh files a skill does not need."""
    return re.sub(r"<visual\b.*?</visual>", "", description, flags=re.DOTALL)
