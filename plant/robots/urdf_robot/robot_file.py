"""The file `robot.yaml` that names the parts of a robot in its URDF."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Final, Literal

from pydantic import Field, PrivateAttr

from skills.inputs.errors import suggestion
from skills.inputs.schema import Name, Strict, validate
from skills.inputs.yaml_source import YamlSource, read_yaml
from skills.robot import BaseKind, GripperKind, quantities

DIGITS: Final = 9
"""Digits after the point of what is added up from a robot's files: beyond them is the error of sums."""
FieldOfView = Annotated[float, quantities.Quantity(gt=0.0, le=6.2832, unit="rad")]
Axis = Literal["x", "y", "z", "-x", "-y", "-z"]
Outline = Annotated[tuple[tuple[quantities.Coordinate, quantities.Coordinate], ...], Field(min_length=3)]


class WheelsFile(Strict):
    """Driven wheels: their joints, the left one first, and the links of casters, which slide on the floor."""

    joints: tuple[Name, Name]
    radius: quantities.Length
    casters: tuple[Name, ...] = ()


class BaseFile(Strict):
    """Base: its link with frame B (x ahead, z up), and how it drives; on a floating base without `wheels`."""

    link: Name
    motion: BaseKind = BaseKind.DIFFERENTIAL
    wheels: WheelsFile | None = None
    height: quantities.Height = Field(description="of the link's origin over the floor, with a lift at 0")
    footprint: quantities.Length | Outline = Field(description="outline from above, or the radius of a round base")
    max_speed: quantities.Speed = 0.6
    max_turn_rate: quantities.TurnRate = 1.0
    runtime: quantities.Duration = 7200.0


class LiftFile(Strict):
    """Lift: the joint that raises the base's link from the wheels, and its position while the robot drives."""

    joint: Name
    travelling: quantities.Coordinate = 0.0


class LidarFile(Strict):
    """LiDAR: its link (x ahead, z up) and its beams."""

    link: Name
    rings: quantities.Count = 1
    opening: Annotated[float, quantities.Quantity(ge=0.0, le=1.5, unit="rad")] = 0.0
    field_of_view: FieldOfView = 6.2832
    points: quantities.Count = 720
    range: tuple[quantities.Length, quantities.Length] = (0.1, 25.0)
    rate: Annotated[float, quantities.Quantity(gt=0.0, le=100.0, unit="Hz")] = 10.0


class CameraFile(Strict):
    """Camera with depth: its link, and whether that link's z (`optical`) or x (`link`) is ahead."""

    link: Name
    axes: Literal["optical", "link"] = "optical"
    width: quantities.Count = 640
    height: quantities.Count = 480
    field_of_view: Annotated[float, quantities.Quantity(gt=0.1, lt=3.0, unit="rad")] = 1.05
    depth: tuple[quantities.Length, quantities.Length] = (0.3, 5.0)


class HandFile(Strict):
    """Hand frame: a link behind the last joint, and its axes along the fingers and along their closing direction."""

    link: Name
    along: Axis
    closing: Axis


class ArmFile(Strict):
    """Arm: its joints from the shoulder on, their stowed positions, and positions of the carrying hand (B, m)."""

    joints: Annotated[tuple[Name, ...], Field(min_length=2)]
    stowed: tuple[quantities.Angle, ...]
    hand: HandFile
    max_reach: quantities.Length
    max_payload: quantities.Mass = 0.5
    standing: tuple[quantities.Length, ...] = Field(
        min_length=1, description="distances from an object to grasp, the best first"
    )
    nearer: tuple[quantities.Length, ...] = Field(
        min_length=1, description="distances from an object that is held from above"
    )
    carry_x: tuple[quantities.Coordinate, ...] = Field(min_length=1)
    carry_z: tuple[quantities.Coordinate, ...] = Field(min_length=1)
    carry_best_x: quantities.Coordinate | None = Field(None, description="the first of carry_x unless said")
    tuck_x: tuple[quantities.Coordinate, ...] = ()


class PadsFile(Strict):
    """Rubber on sliding fingers: spheres along x and y of the hand frame, and how far they pass the closing plane."""

    x: Annotated[tuple[quantities.Coordinate, ...], Field(min_length=1)]
    y: Annotated[tuple[quantities.Coordinate, ...], Field(min_length=1)]
    proud: quantities.Coordinate = 0.001


class GripperFile(Strict):
    """Gripper: its joints with their positions at an opening of 1, and its geometry in the hand frame (m)."""

    kind: GripperKind = GripperKind.PARALLEL
    joints: Annotated[dict[Name, quantities.Number], Field(min_length=1, max_length=2)]
    closed: dict[Name, quantities.Number] = Field({}, description="positions of the joints when the gripper is closed")
    widest: Annotated[float, quantities.Quantity(gt=0.0, le=3.2)]
    max_opening: quantities.Length
    max_force: quantities.Force = 40.0
    palm_x: quantities.Coordinate
    tip_x: quantities.Coordinate
    closing_z: quantities.Coordinate = 0.0
    half_breadth: quantities.Length
    tip_thickness: quantities.Length
    depth: quantities.Length | None = Field(None, description="from palm_x to tip_x unless said")
    length: quantities.Length | None = Field(None, description="4 cm beyond tip_x unless said")
    pads: PadsFile | bool = True


class RobotFile(Strict):
    """A robot: the file of its URDF and its parts; an arm, gripper, head or camera that is not named does not exist.

    Joints that no part names are fixed, at `held` (rad, m) or 0.
    """

    name: Name
    urdf: Name = "robot.urdf"
    base: BaseFile
    lift: LiftFile | None = None
    lidar: LidarFile
    cameras: dict[Name, CameraFile] = Field({})
    head: tuple[Name, Name] | None = Field(None, description="joints of pan and tilt")
    arm: ArmFile | None = None
    gripper: GripperFile | None = None
    held: dict[Name, quantities.Number] = Field({})
    gains: dict[Name, tuple[quantities.Number, quantities.Number]] = Field(
        {}, description="stiffness and damping of joints' servos; by the limit of effort unless said"
    )
    _source: YamlSource = PrivateAttr()

    @property
    def source(self) -> YamlSource:
        """The document, for the locations of errors."""
        return self._source

    @property
    def moving(self) -> tuple[str, ...]:
        """Driven joints: those of lift, wheels, head, arm and gripper."""
        lift = () if self.lift is None else (self.lift.joint,)
        wheels = () if self.base.wheels is None else self.base.wheels.joints
        arm = () if self.arm is None else self.arm.joints
        fingers = () if self.gripper is None else tuple(self.gripper.joints)
        return (*lift, *wheels, *(self.head or ()), *arm, *fingers)


def read_robot_file(path: Path) -> RobotFile:
    """Reads a robot's file. Raises InputError with file and line."""
    source = read_yaml(path)
    found = validate(RobotFile, source)
    found._source = source
    if found.gripper is not None and found.arm is None:
        raise source.error(("gripper",), "there is a gripper without an arm", "name the arm, or leave the gripper out")
    for name in found.gains:
        if name not in found.moving:
            raise source.error(("gains", name), f"no part drives joint '{name}'", suggestion(name, found.moving))
    if found.base.wheels is not None and found.base.motion is not BaseKind.DIFFERENTIAL:
        raise source.error(("base", "wheels"), "two wheels drive no omnidirectional base", "leave the wheels out")
    if found.arm is not None and len(found.arm.stowed) != len(found.arm.joints):
        what = f"stowed has {len(found.arm.stowed)} angles, and the arm {len(found.arm.joints)} joints"
        raise source.error(("arm", "stowed"), what, "give one angle for each joint")
    return found
