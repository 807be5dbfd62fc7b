"""The kinds of robots that a plant can hold, each registered as an entry point of the group `errand.robots`."""

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

from skills.files.errors import InputError
from skills.files.plugins import PluginDefect, distribution_of, installed_plugins, run_plugin
from skills.robot import Capabilities, Pose2D, Robot

if TYPE_CHECKING:
    from pydrake.geometry import CollisionFilterManager, GeometryId, GeometrySet, SceneGraph
    from pydrake.multibody.plant import MultibodyPlant
    from pydrake.multibody.tree import ModelInstanceIndex, RigidBody
    from pydrake.systems.framework import Context

    from plant.rendering import Scene
    from plant.saved_state import State

GROUP = "errand.robots"


class RobotBody(ABC):
    """One robot's bodies and joints in a plant.

    `body` has the protocol's body frame B, `hand` its hand frame H.
    """

    def __init__(
        self,
        plant: MultibodyPlant,
        name: str,
        kind: RobotKind,
        urdf: str,
        gains: Mapping[str, tuple[float, float]],
        packages: Mapping[str, Path] = MappingProxyType({}),
    ) -> None:
        """Adds the robot to `plant` (before Finalize), with the gains (p, d) of its joints' servos.

        `packages` are the folders of meshes that the URDF names.
        """
        from pydrake.multibody.parsing import Parser
        from pydrake.multibody.tree import PdControllerGains

        self.plant, self.name, self.kind = plant, name, kind
        parser = Parser(plant)
        parser.SetAutoRenaming(True)
        for package, folder in packages.items():
            parser.package_map().Add(package, folder)
        (self.instance,) = parser.AddModelsFromString(urdf, "urdf")
        plant.RenameModelInstance(self.instance, name)
        self.body: RigidBody = plant.GetBodyByName("body", self.instance)
        for joint, (p, d) in gains.items():
            plant.GetJointActuatorByName(joint, self.instance).set_controller_gains(PdControllerGains(p=p, d=d))

    @property
    def hand(self) -> RigidBody:
        """The last link of the arm."""
        return self.plant.GetBodyByName(self.kind.gripper_links[0], self.instance)

    def instances(self) -> tuple[ModelInstanceIndex, ...]:
        """The model instances that make up this robot."""
        return (self.instance,)

    def filter_collisions(self, filters: CollisionFilterManager, floor: GeometrySet) -> None:
        """Lets links of this robot pass each other, and what never touches the floor pass it."""
        from pydrake.geometry import CollisionFilterDeclaration, GeometrySet

        filters.Apply(CollisionFilterDeclaration().ExcludeWithin(GeometrySet(self.geometries())))

    def geometries(self, prefix: str = "") -> list[GeometryId]:
        """Collision geometries of the links whose names begin with `prefix`."""
        bodies = [self.plant.get_body(index) for index in self.plant.GetBodyIndices(self.instance)]
        named = (body for body in bodies if body.name().startswith(prefix))
        return [each for body in named for each in self.plant.GetCollisionGeometriesForBody(body)]

    @abstractmethod
    def place(self, context: Context, pose: Pose2D) -> None:
        """Sets the robot standing at a pose (world frame) with its arm stowed."""

    @abstractmethod
    def opening(self, context: Context) -> float:
        """How far the gripper is open, in the unit of `set_gripper`."""


class PlantRobot(Robot, Protocol):
    """A simulated robot: the protocol, and what the simulation calls in turn."""

    def control(self, now_s: float, dt_s: float) -> None:
        """Command all servos for the next dt_s of simulated time."""

    def sense(self, now_s: float) -> None:
        """Takes new sensor readings."""

    def state(self) -> State:
        """What the robot itself keeps: servos and sensors. Commands and leases do not outlive its computer."""

    def restore(self, state: State) -> None:
        """Has such a state, before it powers up."""

    def power_up(self, now_s: float) -> None:
        """Begins again where it stands: nobody has the lease, no command runs; take readings."""


@dataclass(frozen=True)
class LocomotionLimits:
    """What bears a robot can do. Each kind of robot has its own, and takes no other's."""


@dataclass(frozen=True)
class BodyOptions:
    """How a robot is put into a plant: with meshes where they are installed, moved within the limits of its stack."""

    visuals: bool = True
    carried: bool = True
    locomotion: LocomotionLimits | None = None


@dataclass(frozen=True)
class SensorOptions:
    """What the sensors of a robot need.

    The seed and the robot's name give the noise; without a scene, cameras are blind.
    The battery begins at `charge` (0 to 1) and charges while the body stands still at `dock`. `work` counts rays cast
    and pictures rendered.
    """

    scene_graph: SceneGraph
    context: Context
    seed: int = 0
    scene: Scene | None = None
    dock: Pose2D | None = None
    charge: float = 1.0
    work: Counter[str] = field(default_factory=Counter)


@dataclass(frozen=True)
class RobotKind:
    """A kind of robot: what it can do, how it is put into a plant (before Finalize), and what drives it there.

    `gripper_links` are the hand and the fingers; `trunk_links` and `leg_links` those of the body and of legs or wheels:
    all others are the arm's. `facts` is the file of its numbers, `stack` that of the stack that suits it
    (None: the default stack).
    """

    name: str
    gripper_links: tuple[str, ...]
    trunk_links: tuple[str, ...]
    leg_links: tuple[str, ...]
    facts: Path
    capabilities: Callable[[], Capabilities]
    add: Callable[[MultibodyPlant, str, BodyOptions], RobotBody]
    drive: Callable[[RobotBody, SensorOptions], PlantRobot]
    stack: Path | None = None


@cache
def robot_kinds() -> Mapping[str, EntryPoint]:
    """The kinds that are installed, by name. The modules of each are loaded when it is first used."""
    return {entry.name: entry for entry in sorted(installed_plugins(GROUP))}


@cache
def robot_kind(name: str) -> RobotKind:
    """A kind by its name. Raises KeyError: it is not installed. Raises InputError: its plug-in is broken."""
    entry = robot_kinds()[name]
    try:
        kind: RobotKind = run_plugin(entry, entry.load)
    except PluginDefect as defect:
        what = f"robot kind '{name}' of distribution {distribution_of(entry)}: cannot load {entry.value} ({defect})"
        raise InputError(what, hint="repair or uninstall that distribution") from defect
    return kind
