"""Description of a robot of ROS 2 in a YAML file: the topics, frames, limits and actions of its parts."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Final

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from errand_ros2.part_actions import ARM_ACTION, GRIPPER_ACTION, HEAD_ACTION
from errand_ros2.server import CARRY, POSTURE
from plant.robots.robot_kind import robot_kind, robot_kinds
from skills.inputs.errors import InputError
from skills.inputs.schema import first_error
from skills.inputs.yaml_source import YamlSource, read_yaml
from skills.robot import Capabilities

Topic = Annotated[
    str, Field(min_length=1, max_length=200, pattern=r"^/?[A-Za-z_][A-Za-z0-9_]*(/[A-Za-z_][A-Za-z0-9_]*)*$")
]
"""Name of a topic or action, below the robot's namespace unless it begins with a slash."""


class Part(BaseModel):
    """Part of a description; unknown keys are errors."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class BaseFile(Part):
    """Base: topic of velocities (`stamped`: TwistStamped), its limits, and the topic of heights and pitches."""

    command: Topic = "cmd_vel"
    stamped: bool = False
    speed: float = Field(default=0.8, gt=0.0, le=3.0)
    turn_rate: float = Field(default=1.0, gt=0.0, le=4.0)
    posture: Topic | None = None


class OdometryFile(Part):
    """Odometry: its topic, and the height (m) of the body's origin over the child frame of the message."""

    topic: Topic = "odom"
    raised: float = Field(default=0.0, ge=-2.0, le=2.0)


class LidarFile(Part):
    """LiDAR: `points` (PointCloud2) or `scan` (LaserScan); its frame; rings and elevations (deg) of a revolution."""

    points: Topic | None = None
    scan: Topic | None = None
    frame: Annotated[str, Field(min_length=1, max_length=200)] | None = None
    rings: int = Field(default=16, ge=2, le=256)
    lowest: float = Field(default=-15.0, ge=-90.0, lt=90.0)
    highest: float = Field(default=15.0, gt=-90.0, le=90.0)
    columns: int = Field(default=900, ge=60, le=7200)


class CameraFile(Part):
    """Topics of a camera: picture, depth, and their intrinsics (of the depth: by default those of the picture)."""

    image: Topic
    info: Topic
    depth: Topic | None = None
    depth_info: Topic | None = None


class ArmFile(Part):
    """Action of a trajectory controller."""

    action: Topic


class GripperFile(ArmFile):
    """Gripper: its action; `scale` from the opening to the action's position, which is a joint's and may fall as the
    gripper opens; topics of what it feels, if any."""

    scale: float = 1.0
    holding: Topic | None = None
    force: Topic | None = None
    carry: Topic | None = None


class RobotFile(Part):
    """A robot of ROS 2 of an installed kind, whose sizes count; with `sim_time` the run follows `/clock`."""

    kind: str = "spot"
    sim_time: bool = False
    base: BaseFile = BaseFile()
    odometry: OdometryFile = OdometryFile()
    joints: Topic | None = "joint_states"
    joint_names: Mapping[str, str] = {}  # names in ROS by Errand's names, where they differ
    lidar: LidarFile
    imu: Topic | None = None
    battery: Topic | None = None
    cameras: Mapping[str, CameraFile] = {}
    arm: ArmFile | None = None
    head: ArmFile | None = None
    gripper: GripperFile | None = None
    pose: Topic | None = None  # the robot's own localisation, such as amcl_pose


@dataclass(frozen=True)
class Description:
    """A robot's file, and its capabilities, without the parts that the file leaves out."""

    file: RobotFile
    capabilities: Capabilities


DRIVE_EXPIRY_S: Final = 0.6
_RINGED: Final = frozenset({"spot"})  # kinds whose LiDAR has the rings of `LidarFile`; of others one ring is used


def served_file(kind: str) -> RobotFile:
    """Returns the description of a robot that `errand serve-ros2` serves."""
    can, gripper = capabilities_of(kind), {"holding": "gripper/holding", "force": "gripper/force", "carry": CARRY}
    actions = {"arm": ARM_ACTION, "head": HEAD_ACTION, "gripper": GRIPPER_ACTION}
    parts: dict[str, dict[str, Any]] = {
        part: {"action": action} for part, action in actions.items() if getattr(can, part)
    }
    if can.gripper:
        parts["gripper"] |= {**gripper, "scale": can.gripper.finger_joints[0][1]}
    topics = {"image": "image", "info": "camera_info", "depth": "depth/image", "depth_info": "depth/camera_info"}
    cameras = {each.source: {key: f"{each.source}/{topic}" for key, topic in topics.items()} for each in can.cameras}
    lidar = {"points": "points"} if kind in _RINGED else {"scan": "scan"}
    sensors = {"lidar": lidar, "imu": "imu", "battery": "battery_state", "cameras": cameras}
    told = {"kind": kind, "sim_time": True, "base": {"posture": POSTURE}}
    return RobotFile.model_validate({**told, **sensors, **parts})


def load_description(path: Path | None, kind: str) -> Description:
    """Reads a description; without a file it is that of a served robot of a kind. Raises InputError."""
    if path is None:
        return described(served_file(kind))
    source = read_yaml(path)
    try:
        file = RobotFile.model_validate(source.data)
    except ValidationError as error:
        where, what, hint = first_error(error.errors())
        raise source.error(where, f"{'.'.join(map(str, where)) or 'the file'} {what}", hint) from error
    return described(file, source)


def described(file: RobotFile, source: YamlSource | None = None) -> Description:
    """Returns a file with the capabilities of its kind. Raises InputError for what does not fit together."""
    can = capabilities_of(file.kind)
    wrong = {
        part: f"a {file.kind} has no {part}"
        for part in ("arm", "head", "gripper")
        if getattr(file, part) is not None and getattr(can, part) is None
    }
    if (file.lidar.points is None) == (file.lidar.scan is None):
        wrong["lidar"] = "names points or scan, one of the two"
    if not file.cameras.keys() <= (known := {each.source: each for each in can.cameras}).keys():
        wrong["cameras"] = f"a {file.kind} has the cameras {', '.join(known)}"
    for part, what in wrong.items():
        raise source.error((part,), what) if source else InputError(f"{part}: {what}")
    arm = can.arm if file.arm else None
    kept = replace(
        can,
        arm=arm,
        gripper=can.gripper if arm and file.gripper else None,
        head=can.head if file.head else None,
        cameras=tuple(each for each in can.cameras if each.source in file.cameras),
        max_speed_m_s=min(can.max_speed_m_s, file.base.speed),
        max_turn_rate_rad_s=min(can.max_turn_rate_rad_s, file.base.turn_rate),
        drive_expiry_s=DRIVE_EXPIRY_S,
        localises=file.pose is not None,
    )
    return Description(file, kept)


def capabilities_of(kind: str) -> Capabilities:
    """Returns the capabilities of an installed kind of robot. Raises InputError."""
    if kind not in (known := robot_kinds()):
        raise InputError(f"there is no kind of robot '{kind[:60]}'", hint=f"known: {', '.join(sorted(known))}")
    return robot_kind(kind).capabilities()
