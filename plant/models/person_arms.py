"""Arms of people: they hang, make gestures, and hold the tray when it is out. They are only seen.

No contact, range or joint knows the arms, and the stepped context never moves them. A renderer calls `Arms.pose` after
it has set the plant's positions.
"""

from collections.abc import Mapping, Sequence
from typing import Final, Protocol

import numpy as np
from pydrake.common.value import AbstractValue, Value
from pydrake.geometry import FrameId, FramePoseVector, GeometryFrame, GeometryInstance, Role, SceneGraph
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import RigidBody
from pydrake.systems.framework import AbstractParameterIndex, Context, DiagramBuilder, LeafSystem

from skills.robot import FloatArray

SIDES: Final[Mapping[str, float]] = {"left": 1.0, "right": -1.0}
UPPER_M, LOWER_M = 0.284, 0.326
"""Lengths from the shoulder to the elbow, and from there to the middle of the hand."""
_SHOULDER, _HANGING = np.array([0.0, 0.205, 1.40]), np.array([0.062, 0.25, 0.805])
"""A left shoulder and hand (3,) in the person's frame (m)."""
_ELBOW = np.array([-0.6, 0.5, -0.6])
"""Direction in which a left elbow points."""
_GRIP = np.array([-0.13, 0.165, -0.01])
"""Where a left hand holds the tray, in the tray's frame (m)."""
_REACH_M = 0.999 * (UPPER_M + LOWER_M)
_OUT_M = 0.3
"""Horizontal distance of the tray from the person's axis from which on the hands hold it."""


class Gesturing(Protocol):
    """Figure of a person who moves the arms, whose trunk has the pose X_PT in the person's frame."""

    @property
    def X_PT(self) -> RigidTransform:
        """Pose of the trunk frame in the person's."""

    def hand(self, side: float, time_s: float) -> FloatArray:
        """Position (3,) of a hand in the trunk frame; `side` is 1 for the left one, -1 for the right one."""


def arm_poses(
    side: str, X_PT: RigidTransform | None = None, hand: FloatArray | None = None
) -> tuple[RigidTransform, RigidTransform]:
    """Poses of the upper and the lower arm of a side in the person's frame; both point along -z.

    The hand hangs, or is at `hand`, or goes to the tray at X_PT as the tray leaves the torso. It points at what is out
    of reach.
    """
    mirror = np.array([1.0, SIDES[side], 1.0])
    shoulder, hand = mirror * _SHOULDER, mirror * _HANGING if hand is None else hand
    if X_PT is not None:
        out = min(1.0, float(np.linalg.norm(X_PT.translation()[:2])) / _OUT_M)
        hand = hand + out * (X_PT @ (mirror * _GRIP) - hand)
    along = hand - shoulder
    reach_m = min(float(np.linalg.norm(along)), _REACH_M)
    along /= np.linalg.norm(along)
    forward_m = (reach_m**2 + UPPER_M**2 - LOWER_M**2) / (2.0 * reach_m)
    aside = mirror * _ELBOW - along * float(along @ (mirror * _ELBOW))
    elbow = shoulder + forward_m * along + np.sqrt(UPPER_M**2 - forward_m**2) * aside / np.linalg.norm(aside)
    return _pointing(shoulder, elbow), _pointing(elbow, shoulder + reach_m * along)


def _pointing(start: FloatArray, end: FloatArray) -> RigidTransform:
    z = (start - end) / np.linalg.norm(start - end)
    x = np.cross([0.0, 1.0, 0.0], z) / np.linalg.norm(np.cross([0.0, 1.0, 0.0], z))
    return RigidTransform(RotationMatrix(np.column_stack([x, np.cross(z, x), z])), start)


def _source_of(poses: AbstractValue) -> LeafSystem:
    """Returns a source of poses of frames, which are a parameter of its context."""
    source = LeafSystem()
    index = AbstractParameterIndex(source.DeclareAbstractParameter(poses))
    prerequisites = {source.abstract_parameter_ticket(index)}
    source.DeclareAbstractOutputPort("poses", poses.Clone, _copy_parameter, prerequisites)
    return source


def _copy_parameter(context: Context, output: AbstractValue) -> None:
    output.SetFrom(context.get_abstract_parameter(0))


class Arms:
    """Movable arms of the people who have a tray or a figure, if their model has the fixed arms that these replace."""

    def __init__(
        self,
        builder: DiagramBuilder,
        plant: MultibodyPlant,
        scene_graph: SceneGraph,
        people: Sequence[tuple[RigidBody, RigidBody | None, Gesturing | None]],
    ) -> None:
        """Replaces the fixed arms of people, each given with tray and figure, before the Diagram is built."""
        self._plant, self._frames = plant, dict[str, FrameId]()
        self._arms = list[tuple[str, tuple[str, str], RigidBody, RigidBody | None, Gesturing | None]]()
        source, inspector = scene_graph.RegisterSource("arms"), scene_graph.model_inspector()
        poses = FramePoseVector()
        for body, tray, figure in people:
            fixed = {inspector.GetName(each).split("::")[-1]: each for each in plant.GetVisualGeometriesForBody(body)}
            for side in (side for side in SIDES if f"{side}_lower_arm" in fixed):
                upper, lower = (f"{int(body.index())}_{side}_{part}_arm" for part in ("upper", "lower"))
                for name, part in ((upper, f"{side}_upper_arm"), (lower, f"{side}_lower_arm")):
                    self._frames[name] = frame = scene_graph.RegisterFrame(source, GeometryFrame(name))
                    poses.set_value(frame, RigidTransform())
                    for each in (fixed[each] for each in fixed if each.startswith(part)):
                        X_AG = RigidTransform() if figure is None else inspector.GetPoseInFrame(each)
                        arm = GeometryInstance(X_AG, inspector.GetShape(each), f"{each.get_value()}_{name}")
                        arm.set_illustration_properties(inspector.GetIllustrationProperties(each))
                        arm.set_perception_properties(inspector.GetPerceptionProperties(each))
                        scene_graph.RegisterGeometry(source, frame, arm)
                        for role in (Role.kIllustration, Role.kPerception):
                            scene_graph.RemoveRole(plant.get_source_id(), each, role)
                self._arms.append((side, (upper, lower), body, tray, figure))
        self._poses = builder.AddNamedSystem("arms", _source_of(Value[FramePoseVector](poses)))
        builder.Connect(self._poses.get_output_port(), scene_graph.get_source_pose_port(source))

    def poses(self, plant_context: Context) -> Mapping[str, RigidTransform]:
        """Poses X_WA of the arms by the names of their frames, as the people and the trays stand."""
        poses, time_s = dict[str, RigidTransform](), plant_context.get_time()
        for side, names, body, tray, figure in self._arms:
            X_WP = X_WT = self._plant.EvalBodyPoseInWorld(plant_context, body)
            hand = X_PT = None
            if tray is not None:
                X_PT = X_WP.inverse() @ self._plant.EvalBodyPoseInWorld(plant_context, tray)
            if figure is not None:
                hand, X_WT = figure.hand(SIDES[side], time_s), X_WP @ figure.X_PT
            poses |= {name: X_WT @ X_TA for name, X_TA in zip(names, arm_poses(side, X_PT, hand), strict=True)}
        return poses

    def pose(self, root_context: Context) -> None:
        """Poses the arms in a context of the whole Diagram."""
        moved = FramePoseVector()
        for name, X_WA in self.poses(self._plant.GetMyContextFromRoot(root_context)).items():
            moved.set_value(self._frames[name], X_WA)
        own = self._poses.GetMyMutableContextFromRoot(root_context)
        own.get_mutable_abstract_parameter(0).set_value(moved)
