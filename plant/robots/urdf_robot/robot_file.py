"""The file `robot.yaml` that names the parts of a robot in its URDF."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, PrivateAttr

from skills.inputs.schema import Name, validate
from skills.inputs.yaml_source import YamlSource, read_yaml
from skills.robot import BaseKind, GripperKind, quantities

FieldOfView = Annotated[float, quantities.Quantity(gt=0.0, le=6.2832, unit="rad")]
Axis = Literal["x", "y", "z", "-x", "-y", "-z"]


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, defer_build=True)


class BaseFile(_Strict):
    """Base: its link, whose origin is the body frame B (x ahead, z up), and how it drives."""

    link: Name
    motion: BaseKind = BaseKind.DIFFERENTIAL
    height: quantities.Height = Field(description="of the link's origin over the floor")
    footprint: Annotated[tuple[tuple[quantities.Coordinate, quantities.Coordinate], ...], Field(min_length=3)]
    max_speed: quantities.Speed = 0.6
    max_turn_rate: quantities.TurnRate = 1.0
    runtime: quantities.Duration = 7200.0


class LidarFile(_Strict):
    """LiDAR: its link (x ahead, z up) and its beams."""

    link: Name
    rings: quantities.Count = 1
    opening: Annotated[float, quantities.Quantity(ge=0.0, le=1.5, unit="rad")] = 0.0
    field_of_view: FieldOfView = 6.2832
    points: quantities.Count = 720
    range: tuple[quantities.Length, quantities.Length] = (0.1, 25.0)
    rate: Annotated[float, quantities.Quantity(gt=0.0, le=100.0, unit="Hz")] = 10.0


class CameraFile(_Strict):
    """Camera with depth: its link, and whether that link's z (`optical`) or x (`link`) is ahead."""

    link: Name
    axes: Literal["optical", "link"] = "optical"
    width: quantities.Count = 640
    height: quantities.Count = 480
    field_of_view: Annotated[float, quantities.Quantity(gt=0.1, lt=3.0, unit="rad")] = 1.05
    depth: tuple[quantities.Length, quantities.Length] = (0.3, 5.0)


class HandFile(_Strict):
    """Hand frame: a link behind the last joint, and the axes of it along the fingers and along their closing."""

    link: Name
    along: Axis
    closing: Axis


class ArmFile(_Strict):
    """Arm: its joints from the shoulder on, where they are stowed, and where the hand carries (B, m)."""

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
    tuck_x: tuple[quantities.Coordinate, ...] = ()


class GripperFile(_Strict):
    """Gripper: its joints with the part of an opening of one that each goes, and its geometry in the hand frame (m)."""

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
    pads: bool = True


class RobotFile(_Strict):
    """A robot: the file of its URDF and its parts; it has no arm, gripper, head or camera where none is named.

    Joints that no part names are fixed, at `held` (rad, m) or 0.
    """

    name: Name
    urdf: Name = "robot.urdf"
    base: BaseFile
    lidar: LidarFile
    cameras: dict[Name, CameraFile] = {}
    head: tuple[Name, Name] | None = Field(None, description="joints of pan and tilt")
    arm: ArmFile | None = None
    gripper: GripperFile | None = None
    held: dict[Name, quantities.Number] = {}
    _source: YamlSource = PrivateAttr()

    @property
    def source(self) -> YamlSource:
        """The document, for the places of errors."""
        return self._source

    @property
    def moving(self) -> tuple[str, ...]:
        """Joints that are driven: of head, arm and gripper."""
        arm = () if self.arm is None else self.arm.joints
        return (*(self.head or ()), *arm, *(self.gripper.joints if self.gripper is not None else ()))


def read_robot_file(path: Path) -> RobotFile:
    """Reads a robot's file. Raises InputError with file and line."""
    source = read_yaml(path)
    found = validate(RobotFile, source)
    found._source = source
    if found.gripper is not None and found.arm is None:
        raise source.error(("gripper",), "there is a gripper without an arm", "name the arm, or leave the gripper out")
    if found.arm is not None and len(found.arm.stowed) != len(found.arm.joints):
        what = f"stowed has {len(found.arm.stowed)} angles, and the arm {len(found.arm.joints)} joints"
        raise source.error(("arm", "stowed"), what, "give one angle for each joint")
    return found
