"""Collision checks between the arm, the body and the boxes around the robot."""

from __future__ import annotations

import math
import operator
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from copy import copy
from dataclasses import dataclass
from functools import lru_cache
from itertools import combinations, groupby
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray
from pydrake.math import RigidTransform

from skills.manipulation.arm.clearance import FIXED, Kind, box_gaps, touching
from skills.manipulation.arm.kinematics import ArmModel, arm_model
from skills.robot import Capabilities, FloatArray
from skills.world_model import NO_WORK_COUNTER, WorkCounter

if TYPE_CHECKING:
    from pydrake.geometry import GeometryId, SceneGraphInspector
    from pydrake.planning import SceneGraphCollisionChecker

AROUND: Final = "around"
"""Name of the body that stands for all boxes."""
EDGE_STEP_RAD = 0.05
"""Distance (rad, all joints together) between the configurations of a motion that are checked."""
_LINK_RADIUS_M = 0.06
"""Radius of the arm's links."""
_Arrays = tuple[NDArray[Any], ...]
_ALL_OR_NONE: Final = np.zeros(0, dtype=np.bool_)
"""Argument of `touching` for a check that need not tell the shapes apart."""


@dataclass(frozen=True)
class Box:
    """Box: pose of its centre in a frame that the user of the box names, and full extents in m."""

    X_FG: RigidTransform
    size_m: tuple[float, float, float]


def box_between(low: FloatArray, high: FloatArray, least_m: float = 0.0) -> Box:
    """Returns the upright box between two corners (3,), with sides of at least `least_m`."""
    x, y, z = np.maximum(high - low, least_m)
    return Box(RigidTransform(0.5 * (low + high)), (float(x), float(y), float(z)))


def gaps_m(box: Box, boxes: Sequence[Box], moves: FloatArray) -> FloatArray:
    """Gaps (K, N) in m between a box, after each of K moves (K, 3), and N others; negative where they overlap.

    All boxes and moves are in one frame.
    """
    (half, *_), (R, *_), (p, *_) = _as_arrays([box])
    return np.asarray(box_gaps(half, R, p, np.asarray(moves, dtype=float), *_as_arrays(boxes)))


def _as_arrays(boxes: Sequence[Box], X_BF: RigidTransform | None = None) -> _Arrays:
    """Half extents (N, 3), rotations (N, 3, 3) and centres (N, 3) of boxes in B; without X_BF, in their own frame."""
    X_FG = np.array([box.X_FG.GetAsMatrix34() for box in boxes]).reshape(-1, 3, 4)
    halves_m = 0.5 * np.array([box.size_m for box in boxes]).reshape(-1, 3)
    X = (X_BF or RigidTransform()).GetAsMatrix34()
    R_BG, p_BG = X[:, :3] @ X_FG[:, :, :3], X_FG[:, :, 3] @ X[:, :3].T + X[:, 3]
    return halves_m, np.ascontiguousarray(R_BG), np.ascontiguousarray(p_BG)


def box_corners(box: Box) -> FloatArray:
    """Returns the eight corners of a box, (8, 3) in its frame."""
    signs = np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).reshape(3, -1).T
    half = 0.5 * np.array(box.size_m)
    return np.asarray(signs * half @ box.X_FG.rotation().matrix().T + box.X_FG.translation())


class ArmScene:
    """Collision scene: a standing robot with boxes around it, all in the body frame.

    Legs stand at the given joint angles; the gripper's opening and the object in the hand may change between checks.
    Drake checks self-collision, including the held object. `clearance` checks robot and held object against the boxes;
    oriented bounding boxes replace meshes and other shapes of the robot.
    """

    def __init__(
        self,
        capabilities: Capabilities,
        model: ArmModel,
        joint_positions_rad: Mapping[str, float],
        padding_m: float = 0.01,
        work: WorkCounter = NO_WORK_COUNTER,
    ) -> None:
        """Builds the scene; `work` counts the checks."""
        self.model, self._work = model, work
        self._capabilities, self._gripper = capabilities, capabilities.gripper
        self._robot = _robot_of(capabilities).copy()
        self._padding_m, self._opening = padding_m, 0.0
        self._boxes: tuple[Box, ...] = ()
        self._X_BF = RigidTransform()
        self._obstacles: _Obstacles | None = None
        self.set_joints(joint_positions_rad)

    def set_boxes(self, boxes: Sequence[Box], X_BF: RigidTransform | None = None) -> None:
        """Replaces the boxes around the robot, given in frame F; without X_BF, in the body frame."""
        X_BF, same = RigidTransform() if X_BF is None else X_BF, len(boxes) == len(self._boxes)
        if same and all(map(operator.is_, boxes, self._boxes)) and X_BF.IsExactlyEqualTo(self._X_BF):
            return
        self._boxes, self._X_BF = tuple(boxes), X_BF
        self._obstacles = None

    @contextmanager
    def with_only(self, boxes: Sequence[Box], opening: float) -> Iterator[None]:
        """Replaces the boxes (frame B) and the gripper's opening for the duration of a context."""
        before, X_BF, opening_before = self._boxes, self._X_BF, self._opening
        self.set_boxes(boxes)
        self.set_opening(opening)
        try:
            yield
        finally:
            self.set_boxes(before, X_BF)
            self.set_opening(opening_before)

    def beyond_body_m(self, q_rad: FloatArray) -> tuple[float, float]:
        """Overhang (m) of the arm beyond the body's footprint, ahead and to a side; 0 where it does not overhang."""
        most_m = np.max(np.abs(np.asarray(self._capabilities.footprint_m)), axis=0)
        x, y, _ = self.model.points_B(q_rad).T
        ahead_m, beside_m = float(np.max(x) - most_m[0]), float(np.max(np.abs(y)) - most_m[1])
        return max(0.0, ahead_m + _LINK_RADIUS_M), max(0.0, beside_m + _LINK_RADIUS_M)

    def hold(self, boxes: Sequence[Box]) -> None:
        """Replaces the boxes fixed to the hand (frame H), which represent a held object."""
        self._robot.hold(tuple(boxes))
        self._obstacles = None

    def set_opening(self, opening: float) -> None:
        """Sets the gripper's opening for later checks, 0 closed."""
        self._obstacles = self._obstacles if opening == self._opening else None
        self._opening = opening

    def set_joints(self, joint_positions: Mapping[str, float]) -> None:
        """Sets the robot's other joints for later checks: legs, lift, head."""
        self._turn_joints(dict(joint_positions))
        self._robot.allow_stowed_contacts()

    def _turn_joints(self, joint_positions: dict[str, float]) -> None:
        self._joints_rad = joint_positions
        self._robot.set_joints(joint_positions)
        self._obstacles = None

    def set_padding(self, padding_m: float) -> None:
        """Sets the minimum distance (m) between robot and boxes for later checks."""
        self._obstacles = self._obstacles if padding_m == self._padding_m else None
        self._padding_m = padding_m

    def free(self, q_rad: FloatArray) -> bool:
        """Returns whether the arm at angles q_rad (J,) is free of collision."""
        self._work.count("arm_configuration_checks")
        if self._around().meet(np.asarray(q_rad, dtype=float)[None]):
            return False
        return bool(self._robot.checker.CheckConfigCollisionFree(self._full(q_rad)))

    def free_as_usual(self, q_rad: FloatArray, clear_m: float = 0.0) -> bool:
        """Returns whether angles q_rad (J,) are free by `clear_m` more at a lift's usual height; True without one."""
        lift, usual_m = self._capabilities.lift_joint, self._capabilities.standing_height_m
        if lift is None:
            return True
        boxes, X_BF, joints, padding_m = self._boxes, self._X_BF, self._joints_rad, self._padding_m
        usual = usual_m - self._capabilities.height_range_m[0]
        try:
            self.set_boxes(boxes, RigidTransform([0.0, 0.0, joints.get(lift, usual) - usual]) @ X_BF)
            self._turn_joints({**joints, lift: usual})
            self.set_padding(padding_m + clear_m)
            return self.free(q_rad)
        finally:
            self.set_padding(padding_m)
            self.set_boxes(boxes, X_BF)
            self._turn_joints(joints)

    def edge_free(self, q_from_rad: FloatArray, q_to_rad: FloatArray) -> bool:
        """Returns whether the straight joint motion between two configurations is free of collision."""
        self._work.count("arm_edge_checks")
        steps = max(1, math.ceil(float(np.linalg.norm(q_to_rad - q_from_rad)) / EDGE_STEP_RAD))
        if self._around().meet(np.linspace(q_from_rad, q_to_rad, steps + 1)):
            return False
        return bool(self._robot.checker.CheckEdgeCollisionFree(self._full(q_from_rad), self._full(q_to_rad)))

    def path_free(self, path_rad: FloatArray) -> bool:
        """Returns whether every configuration of a dense path (K, J) is free."""
        return all(self.free(q) for q in path_rad)

    def gravity_efforts(self, q_rad: FloatArray) -> FloatArray:
        """Efforts (J,), N m, that hold the arm's own weight at angles q_rad (J,) with a level body."""
        context = self._robot.checker.UpdatePositions(self._full(q_rad))
        held: FloatArray = -self._robot.plant.CalcGravityGeneralizedForces(context)[self._robot.arm_velocities]
        return held

    def contacts(self, q_rad: FloatArray) -> tuple[tuple[str, str], ...]:
        """Names of the links in contact or closer than the padding, for messages; `AROUND` stands for boxes."""
        links = self._around().touched(np.asarray(q_rad, dtype=float))
        return *_contacts(self._robot.checker, self._full(q_rad)), *((link, AROUND) for link in links)

    def _around(self) -> _Obstacles:
        """The present obstacles: boxes and the robot's shapes."""
        if self._obstacles is None:
            shapes = self._robot.shapes(self._full(np.zeros(len(self.model.joints))))
            self._obstacles = _Obstacles(self.model, shapes, _as_arrays(self._boxes, self._X_BF), self._padding_m)
        return self._obstacles

    def _full(self, q_rad: FloatArray) -> FloatArray:
        fingers = {} if self._gripper is None else self._gripper.finger_positions(self._opening)
        return self._robot.positions(q_rad, fingers)


@dataclass(frozen=True)
class _Shape:
    """Collision shape of the robot, its link, and the arm joint that moves it (`FIXED` when none does).

    X_LS is its pose in the link that this joint moves; in the body for `FIXED`.
    """

    link: str
    joint: int
    kind: Kind
    half_m: tuple[float, float, float]
    X_LS: RigidTransform

    @property
    def radius_m(self) -> float:
        """Radius of a bounding sphere of the shape."""
        radius, other, length = self.half_m
        if self.kind is Kind.BOX:
            return math.hypot(radius, other, length)
        return math.hypot(radius, length) if self.kind is Kind.CYLINDER else radius + length


class _Obstacles:
    """Boxes around the arm and the robot's shapes, as arrays."""

    def __init__(self, model: ArmModel, shapes: Sequence[_Shape], boxes: _Arrays, padding_m: float) -> None:
        """Stores boxes as half extents (N, 3), rotations (N, 3, 3) and centres (N, 3) in the body frame."""
        self._padding_m, self._boxes, self._frames = padding_m, boxes, model.frames
        self._moved = [shape for shape in shapes if shape.joint != FIXED]
        self._fixed = [shape for shape in shapes if shape.joint == FIXED]
        self._moved_rows = _rows(self._moved)
        self._any_fixed = self._touch(_ALL_OR_NONE, np.zeros((1, len(model.joints))), _rows(self._fixed))

    def meet(self, path_rad: FloatArray) -> bool:
        """Returns whether the robot is within the padding of a box at any configuration of the arm (K, J)."""
        return self._any_fixed or self._touch(_ALL_OR_NONE, path_rad, self._moved_rows)

    def touched(self, q_rad: FloatArray) -> list[str]:
        """Names of the links within the padding of a box, with the arm at q_rad (J,)."""
        links: dict[str, None] = {}
        for shapes in (self._fixed, self._moved):
            found = np.zeros(len(shapes), dtype=np.bool_)
            self._touch(found, q_rad[None], _rows(shapes))
            links.update((shapes[number].link, None) for number in np.flatnonzero(found))
        return list(links)

    def _touch(self, found: NDArray[np.bool_], path_rad: FloatArray, rows: _Arrays) -> bool:
        path_rad = np.ascontiguousarray(path_rad, dtype=float)
        return bool(touching(found, self._padding_m, path_rad, *self._frames, *rows, *self._boxes))


def _rows(shapes: Sequence[_Shape]) -> _Arrays:
    """Arrays of shapes, grouped by joint, in the order of the arguments of `touching`."""
    joints, ends, spheres = [], [], []
    X_LS = np.array([shape.X_LS.GetAsMatrix34() for shape in shapes]).reshape(-1, 3, 4)
    radii_m = np.array([shape.radius_m for shape in shapes])
    for joint, members in groupby(range(len(shapes)), lambda number: shapes[number].joint):
        numbers = [*members]
        middle = X_LS[numbers, :, 3].mean(axis=0)
        joints.append(joint)
        ends.append(numbers[-1] + 1)
        spheres.append([*middle, np.max(np.linalg.norm(X_LS[numbers, :, 3] - middle, axis=1) + radii_m[numbers])])
    return (
        np.array(joints, dtype=np.int64),
        np.array(ends, dtype=np.int64),
        np.array(spheres).reshape(-1, 4),
        radii_m,
        np.array([shape.kind for shape in shapes], dtype=np.int64),
        np.array([shape.half_m for shape in shapes]).reshape(-1, 3),
        np.ascontiguousarray(X_LS[:, :, :3]),
        np.ascontiguousarray(X_LS[:, :, 3]),
    )


@lru_cache(maxsize=4)
def _robot_of(capabilities: Capabilities) -> _Robot:
    """The robot built from a description, cached because building is slow; copy it before a change."""
    fingers = () if capabilities.gripper is None else tuple(capabilities.gripper.finger_positions(0.0))
    without_visuals = re.sub(r"<visual\b.*?</visual>", "", capabilities.description, flags=re.DOTALL)
    return _Robot(without_visuals, arm_model(capabilities), fingers)


class _Robot:
    """Drake's collision checker for the robot alone, welded at its body, and the robot's shapes."""

    def __init__(self, description: str, model: ArmModel, fingers: Sequence[str]) -> None:
        from pydrake.multibody.parsing import Parser
        from pydrake.planning import RobotDiagramBuilder, SceneGraphCollisionChecker

        builder = RobotDiagramBuilder()
        self.plant = plant = builder.plant()
        (robot,) = Parser(plant).AddModelsFromString(description, "urdf")
        plant.WeldFrames(plant.world_frame(), plant.GetFrameByName("body", robot))
        plant.Finalize()
        self._model, self._instance = model, plant.GetModelInstanceName(robot)
        self.checker = SceneGraphCollisionChecker(
            model=builder.Build(), robot_model_instances=[robot], edge_step_size=EDGE_STEP_RAD
        )
        self._held: tuple[Box, ...] = ()
        self._q = np.array(plant.GetPositions(plant.CreateDefaultContext()))
        joints = {plant.get_joint(index).name(): plant.get_joint(index) for index in plant.GetJointIndices(robot)}
        self._arm = np.array([joints[name].position_start() for name in model.names])
        self.arm_velocities = np.array([joints[name].velocity_start() for name in model.names])
        self._positions = {name: joint.position_start() for name, joint in joints.items() if joint.num_positions() == 1}
        moved = [plant.GetBodiesKinematicallyAffectedBy([joints[name].index()]) for name in model.names]
        self._links = [(plant.get_body(i), sum(i in each for each in moved) - 1) for i in plant.GetBodyIndices(robot)]
        standing = [body for body, joint in self._links if joint == FIXED]  # how legs stand, the arm does not change
        closing = [joints[name].child_body() for name in fingers]  # fingers meet when they close
        for one, other in (*combinations(standing, 2), *combinations(closing, 2)):
            self.checker.SetCollisionFilteredBetween(one, other, True)

    def copy(self) -> _Robot:
        """Returns an independent copy with the same plant."""
        other = copy(self)
        other.checker, other._q = self.checker.Clone(), self._q.copy()
        return other

    def set_joints(self, joint_positions: Mapping[str, float]) -> None:
        """Sets all joints that the checker does not vary; joints without a position become 0."""
        for name, start in self._positions.items():
            self._q[start] = joint_positions.get(name, 0.0)

    def positions(self, q_rad: FloatArray, fingers: Mapping[str, float]) -> FloatArray:
        """Positions of the whole model with the arm at q_rad (J,) and the gripper's joints at `fingers`."""
        q = self._q.copy()
        q[self._arm] = q_rad
        for name, position in fingers.items():
            q[self._positions[name]] = position
        return q

    def hold(self, boxes: tuple[Box, ...]) -> None:
        """Replaces the boxes in the hand (frame H)."""
        from pydrake.geometry import Box as BoxShape
        from pydrake.planning import BodyShapeDescription

        if boxes != self._held:
            self.checker.RemoveAllAddedCollisionShapes("held")
            for box in boxes:
                shape = BodyShapeDescription(BoxShape(*box.size_m), box.X_FG, self._instance, self._model.hand_link)
                self.checker.AddCollisionShape("held", shape)
            self._held = boxes

    def shapes(self, positions: FloatArray) -> list[_Shape]:
        """All shapes and the held boxes, with their joints, at `positions` of the whole model."""
        plant, inspector = self.plant, self.checker.model().scene_graph().model_inspector()
        context = self.checker.UpdatePositions(positions)
        chain = [plant.GetBodyByName(joint.child) for joint in self._model.joints]
        X_BL = [*(plant.EvalBodyPoseInWorld(context, link) for link in chain), RigidTransform()]  # of `FIXED` the last
        shapes = []
        for body, joint in self._links:
            X_LK = X_BL[joint].inverse() @ plant.EvalBodyPoseInWorld(context, body)
            for geometry in plant.GetCollisionGeometriesForBody(body):
                kind, half_m, X_KS = _measured(inspector, geometry)
                shapes.append(_Shape(body.name(), joint, kind, half_m, X_LK @ X_KS))
        for box in self._held:
            x, y, z = box.size_m
            half_m = 0.5 * x, 0.5 * y, 0.5 * z
            shapes.append(_Shape(self._model.hand_link, len(chain) - 1, Kind.BOX, half_m, box.X_FG))
        return sorted(shapes, key=lambda shape: shape.joint)

    def allow_stowed_contacts(self) -> None:
        """Allows the contacts between the stowed arm and the body on which it rests."""
        for a, b in _contacts(self.checker, self.positions(self._model.stowed_rad, {})):
            one, other = self.plant.GetBodyByName(a), self.plant.GetBodyByName(b)
            self.checker.SetCollisionFilteredBetween(one, other, True)


def _measured(
    inspector: SceneGraphInspector, geometry: GeometryId
) -> tuple[Kind, tuple[float, float, float], RigidTransform]:
    """Kind, half extents (m) and pose in the link, for a collision shape or its oriented bounding box."""
    from pydrake.geometry import Box as BoxShape
    from pydrake.geometry import Capsule, Cylinder, Sphere

    shape, X_KS = inspector.GetShape(geometry), inspector.GetPoseInFrame(geometry)
    match shape:
        case Sphere():
            return Kind.SPHERE, (shape.radius(), shape.radius(), 0.0), X_KS
        case Capsule():
            return Kind.CAPSULE, (shape.radius(), shape.radius(), 0.5 * shape.length()), X_KS
        case Cylinder():
            return Kind.CYLINDER, (shape.radius(), shape.radius(), 0.5 * shape.length()), X_KS
        case BoxShape():
            return Kind.BOX, (0.5 * shape.width(), 0.5 * shape.depth(), 0.5 * shape.height()), X_KS
    around = inspector.GetObbInGeometryFrame(geometry)
    if around is None:
        raise ValueError(f"link {inspector.GetName(geometry)}: a collision shape without end cannot be checked")
    x, y, z = around.half_width()
    return Kind.BOX, (float(x), float(y), float(z)), X_KS @ around.pose()


def _contacts(checker: SceneGraphCollisionChecker, q_rad: FloatArray) -> tuple[tuple[str, str], ...]:
    """Names of the links in contact or closer than the padding, at positions q_rad of the whole model."""
    clearance = checker.CalcRobotClearance(q_rad, 0.0)
    bodies = [
        (checker.get_body(a).name(), checker.get_body(b).name())
        for a, b in zip(clearance.robot_indices(), clearance.other_indices(), strict=True)
    ]
    return tuple(bodies)
