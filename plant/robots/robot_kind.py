"""Kinds of robots, registered as entry points of the group `errand.robots`, and the robots of a run."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cache
from importlib.metadata import EntryPoint
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Protocol

import numpy as np

from skills.inputs.errors import InputError
from skills.inputs.plugins import PluginDefect, distribution_of, installed_plugins, run_plugin
from skills.robot import Capabilities, FloatArray, Pose2D, Robot

if TYPE_CHECKING:
    from pydrake.geometry import CollisionFilterManager, GeometryId, GeometrySet, SceneGraph
    from pydrake.multibody.plant import MultibodyPlant
    from pydrake.multibody.tree import ModelInstanceIndex, RigidBody
    from pydrake.systems.framework import Context

    from plant.rendering import Scene
    from plant.saved_state import State

GROUP = "errand.robots"


@dataclass(frozen=True)
class LocomotionLimits:
    """Speeds, accelerations and forces with which a robot moves; each kind of robot has its own subclass."""


@dataclass(frozen=True)
class PlacedRobot:
    """One robot in a run: its kind, and its poses at the start and at its dock (world frame).

    Without an `own_stack` file it uses the stack of its kind. `start_known` says whether the localiser receives the
    start pose. `locomotion` of another kind's class is ignored, and the kind's own limits apply. The battery starts at
    `charge` (0 to 1).
    """

    name: str
    kind: str
    start: Pose2D
    dock: Pose2D | None = None
    own_stack: Path | None = None
    start_known: bool = True
    locomotion: LocomotionLimits | None = None
    charge: float = 1.0

    @property
    def capabilities(self) -> Capabilities:
        """Capabilities according to the robot's kind."""
        return robot_kind(self.kind).capabilities()

    @property
    def stack_file(self) -> Path | None:
        """File with the robot's stack; None for the default stack."""
        return self.own_stack or robot_kind(self.kind).stack


class RobotBody(ABC):
    """Bodies and joints of one robot in a plant; `body` carries the body frame B, `hand` the hand frame H."""

    def __init__(
        self,
        plant: MultibodyPlant,
        robot: PlacedRobot,
        urdf: str,
        gains: Mapping[str, tuple[float, float]],
        packages: Mapping[str, Path] = MappingProxyType({}),
    ) -> None:
        """Adds the robot to `plant` (before Finalize), with the servo gains (p, d) of its joints.

        `packages` are the folders with the meshes to which the URDF refers.
        """
        from pydrake.multibody.parsing import Parser
        from pydrake.multibody.tree import PdControllerGains

        self.plant, self.robot, self.name, self.kind = plant, robot, robot.name, robot_kind(robot.kind)
        parser = Parser(plant)
        parser.SetAutoRenaming(True)
        for package, folder in packages.items():
            parser.package_map().Add(package, folder)
        (self.instance,) = parser.AddModelsFromString(urdf, "urdf")
        plant.RenameModelInstance(self.instance, robot.name)
        self.body: RigidBody = plant.GetBodyByName("body", self.instance)
        for joint, (p, d) in gains.items():
            plant.GetJointActuatorByName(joint, self.instance).set_controller_gains(PdControllerGains(p=p, d=d))

    @property
    def hand(self) -> RigidBody:
        """Last link of the arm; the body on a robot without an arm."""
        return self.plant.GetBodyByName(self.kind.hand_link, self.instance)

    def outline_W(self, context: Context) -> FloatArray:
        """Footprint (K, 2) of the body in the world, from above."""
        outline_B = np.array(self.kind.capabilities().footprint_m)
        corners_B = np.column_stack([outline_B, np.zeros(len(outline_B))])
        return np.asarray(self.plant.EvalBodyPoseInWorld(context, self.body).multiply(corners_B.T).T[:, :2])

    def instances(self) -> tuple[ModelInstanceIndex, ...]:
        """Model instances of this robot."""
        return (self.instance,)

    def filter_collisions(self, filters: CollisionFilterManager, floor: GeometrySet) -> None:
        """Filters collisions between links of this robot, and between the floor and all links but feet or wheels."""
        from pydrake.geometry import CollisionFilterDeclaration, GeometrySet

        filters.Apply(CollisionFilterDeclaration().ExcludeWithin(GeometrySet(self.geometries())))

    def geometries(self, prefix: str = "") -> list[GeometryId]:
        """Collision geometries of the links whose names begin with `prefix`."""
        bodies = [self.plant.get_body(index) for index in self.plant.GetBodyIndices(self.instance)]
        named = (body for body in bodies if body.name().startswith(prefix))
        return [each for body in named for each in self.plant.GetCollisionGeometriesForBody(body)]

    def set_joints(self, context: Context, positions: Mapping[str, float]) -> None:
        """Sets the positions (rad, m) of joints with one degree of freedom, by their names."""
        q = self.plant.GetPositions(context)
        for name, position in positions.items():
            q[self.plant.GetJointByName(name, self.instance).position_start()] = position
        self.plant.SetPositions(context, q)

    @abstractmethod
    def place(self, context: Context, pose: Pose2D | None = None) -> None:
        """Places the robot, standing with its arm stowed, at a pose, or at its start when the pose is None."""

    @abstractmethod
    def opening(self, context: Context) -> float:
        """Opening of the gripper, in the unit of `set_gripper`."""


class PlantRobot(Robot, Protocol):
    """Simulated robot: the Robot protocol, and the methods that the engine calls."""

    def control(self, now_s: float, dt_s: float) -> None:
        """Commands all servos for the next dt_s of simulated time."""

    def sense(self, now_s: float) -> None:
        """Updates all sensors."""

    def state(self) -> State:
        """Returns the state of servos and sensors; commands and leases are lost when the robot's computer restarts."""

    def restore(self, state: State) -> None:
        """Restores a state, before `power_up`."""

    def power_up(self, now_s: float) -> None:
        """Starts the robot where it stands, without lease and commands, and updates the sensors."""


@dataclass(frozen=True)
class SensorOptions:
    """Inputs to a robot's sensors: the plant's context and scene graph, and the seed of their noise.

    Without a `scene`, cameras return no pictures. `work` counts the rays cast and the pictures rendered.
    """

    scene_graph: SceneGraph
    context: Context
    seed: int = 0
    scene: Scene | None = None
    work: Counter[str] = field(default_factory=Counter)


@dataclass(frozen=True)
class RobotKind:
    """A kind of robot: its capabilities, and how it is built and driven in a plant.

    `gripper_links` are the hand and the fingers, `trunk_links` the body, `leg_links` legs or wheels; all others belong
    to the arm. `facts` is the file with its parameters, `stack` the file with its stack (None: the default stack).
    `add` adds a robot to a plant before Finalize, with or without visual meshes; `drive` creates its controllers and
    sensors.
    """

    name: str
    gripper_links: tuple[str, ...]
    trunk_links: tuple[str, ...]
    leg_links: tuple[str, ...]
    facts: Path
    capabilities: Callable[[], Capabilities]
    add: Callable[[MultibodyPlant, PlacedRobot, bool], RobotBody]
    drive: Callable[[RobotBody, SensorOptions], PlantRobot]
    stack: Path | None = None

    @property
    def hand_link(self) -> str:
        """Last link of the arm; the body on a robot without an arm."""
        return (*self.gripper_links, "body")[0]


@cache
def robot_kinds() -> Mapping[str, EntryPoint]:
    """Entry points of the installed kinds by name; a kind is loaded when it is first used."""
    return {entry.name: entry for entry in sorted(installed_plugins(GROUP))}


@cache
def robot_kind(name: str) -> RobotKind:
    """Loads a kind by its name. Raises KeyError when it is not installed, InputError when its plug-in is broken."""
    entry = robot_kinds()[name]
    try:
        kind: RobotKind = run_plugin(entry, entry.load)
    except PluginDefect as defect:
        what = f"robot kind '{name}' of distribution {distribution_of(entry)}: cannot load {entry.value} ({defect})"
        raise InputError(what, hint="repair or uninstall that distribution") from defect
    return kind
