"""Collision checks of the arm against the body and boxes around it."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np
from pydrake.math import RigidTransform

from skills.api import NO_WORK_COUNTER, WorkCounter
from skills.arm.kinematics import ArmModel
from skills.robot import Capabilities, FloatArray

_WORLD = "WorldModelInstance"
EDGE_STEP_RAD = 0.05
"""How far apart (rad, all joints together) the configurations of a motion are checked."""


@dataclass(frozen=True)
class Box:
    """A box: pose of its centre in some frame, full extents in m."""

    X_FG: RigidTransform
    size_m: tuple[float, float, float]


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
        from pydrake.multibody.parsing import Parser
        from pydrake.planning import RobotDiagramBuilder, SceneGraphCollisionChecker

        self.model, self._work = model, work
        builder = RobotDiagramBuilder()
        plant = builder.plant()
        (robot,) = Parser(plant).AddModelsFromString(_without_visuals(capabilities.description), "urdf")
        plant.WeldFrames(plant.world_frame(), plant.GetFrameByName("body", robot))
        plant.Finalize()
        self._instance = plant.GetModelInstanceName(robot)
        self._checker = SceneGraphCollisionChecker(
            model=builder.Build(), robot_model_instances=[robot], edge_step_size=EDGE_STEP_RAD
        )
        self._checker.SetPaddingAllRobotEnvironmentPairs(padding_m)
        self._q = np.zeros(plant.num_positions())
        joints = [plant.get_joint(index) for index in plant.GetJointIndices()]
        starts = {joint.name(): joint.position_start() for joint in joints if joint.num_positions() == 1}
        for name, start in starts.items():
            self._q[start] = joint_positions_rad.get(name, 0.0)
        self._arm = np.array([starts[name] for name in model.names])
        self._gripper = starts[model.gripper.name]
        self._boxes: tuple[Box, ...] = ()
        self._allow_stowed_contacts()

    def set_boxes(self, boxes: Sequence[Box]) -> None:
        """Replace the boxes around the robot (frame B)."""
        self._boxes = tuple(boxes)
        self._checker.RemoveAllAddedCollisionShapes("around")
        for box in boxes:
            self._add("around", box, _WORLD, "world")

    @contextmanager
    def with_only(self, boxes: Sequence[Box], opening_rad: float) -> Iterator[None]:
        """For a while other boxes stand around, and the gripper is open so far."""
        before, gripper = self._boxes, self._q[self._gripper]
        self.set_boxes(boxes)
        self.set_opening(opening_rad)
        try:
            yield
        finally:
            self.set_boxes(before)
            self._q[self._gripper] = gripper

    def hold(self, boxes: Sequence[Box]) -> None:
        """Replace the boxes fixed to the hand (frame H), for a thing held."""
        self._checker.RemoveAllAddedCollisionShapes("held")
        for box in boxes:
            self._add("held", box, self._instance, self.model.hand_link)

    def set_opening(self, opening_rad: float) -> None:
        """Angle of the gripper in later checks, 0 closed."""
        self._q[self._gripper] = -opening_rad

    def set_padding(self, padding_m: float) -> None:
        """Distance that the robot keeps from boxes in later checks."""
        self._checker.SetPaddingAllRobotEnvironmentPairs(padding_m)

    def free(self, q_rad: FloatArray) -> bool:
        """Whether arm angles q_rad (J,) collide with nothing."""
        self._work.count("arm_configuration_checks")
        return bool(self._checker.CheckConfigCollisionFree(self._full(q_rad)))

    def edge_free(self, q_from_rad: FloatArray, q_to_rad: FloatArray) -> bool:
        """Whether the straight joint motion between two configurations collides with nothing."""
        self._work.count("arm_edge_checks")
        return bool(self._checker.CheckEdgeCollisionFree(self._full(q_from_rad), self._full(q_to_rad)))

    def path_free(self, path_rad: FloatArray) -> bool:
        """Whether every configuration of a dense path (K, J) is free."""
        return all(self.free(q) for q in path_rad)

    def gravity_efforts(self, q_rad: FloatArray) -> FloatArray:
        """Efforts (J,), N m, with which the arm holds its own weight at angles q_rad (J,), the body level."""
        plant = self._checker.plant()
        context = self._checker.UpdatePositions(self._full(q_rad))
        held: FloatArray = -plant.CalcGravityGeneralizedForces(context)[self._arm]
        return held

    def contacts(self, q_rad: FloatArray) -> tuple[tuple[str, str], ...]:
        """Names of the links that touch or come closer than the padding, for messages."""
        clearance = self._checker.CalcRobotClearance(self._full(q_rad), 0.0)
        bodies = [
            (self._checker.get_body(a).name(), self._checker.get_body(b).name())
            for a, b in zip(clearance.robot_indices(), clearance.other_indices(), strict=True)
        ]
        return tuple(bodies)

    def _full(self, q_rad: FloatArray) -> FloatArray:
        q = self._q.copy()
        q[self._arm] = q_rad
        return q

    def _add(self, group: str, box: Box, instance: str, body: str) -> None:
        from pydrake.geometry import Box as BoxShape
        from pydrake.planning import BodyShapeDescription

        shape = BodyShapeDescription(BoxShape(*box.size_m), box.X_FG, instance, body)
        self._checker.AddCollisionShape(group, shape)

    def _allow_stowed_contacts(self) -> None:
        """Links that touch when the arm is stowed may touch: resting there is what stowing means."""
        for a, b in self.contacts(self.model.stowed_rad):
            plant = self._checker.plant()
            self._checker.SetCollisionFilteredBetween(plant.GetBodyByName(a), plant.GetBodyByName(b), True)


def _without_visuals(description: str) -> str:
    """URDF text without its visual elements, whose mesh files a skill does not need."""
    return re.sub(r"<visual\b.*?</visual>", "", description, flags=re.DOTALL)
