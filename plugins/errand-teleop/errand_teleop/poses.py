"""Poses of a robot that is driven by hand, saved as mission files."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from skills.inputs.errors import InputError
from skills.inputs.yaml_source import yaml_of
from skills.robot import Pose2D

_NAME: Final = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]{0,59}")


@dataclass(frozen=True)
class SavedPose:
    """Pose of the body in the world, the arm's joints and the gripper's opening (rad)."""

    base: Pose2D
    joints_rad: tuple[float, ...]
    opening: float


def pose_text(name: str, pose: SavedPose, *, world: str) -> str:
    """Returns the text of a mission that drives to a pose and sets arm and gripper."""
    base = {"x": pose.base.x_m, "y": pose.base.y_m, "yaw": pose.base.yaw_rad}
    steps: list[dict[str, object]] = [{"skill": "navigate", "with": {key: round(v, 3) for key, v in base.items()}}]
    if pose.joints_rad:
        joints = {"joints": [round(angle, 4) for angle in pose.joints_rad], "opening": round(pose.opening, 3)}
        steps.append({"skill": "pose_arm", "with": joints})
    file = {"name": name.replace("_", " "), "world": world, "steps": steps}
    return yaml_of(file)


def save_pose(folder: Path, name: str | None, pose: SavedPose, *, world: str) -> Path:
    """Writes a pose as NAME.yaml, without a name as `pose_1` and so on; never overwrites a file.

    Raises:
        InputError: the name is taken or not allowed, or the file cannot be written.
    """
    name = name or next(free for n in range(1, 10_000) if not (folder / f"{(free := f'pose_{n}')}.yaml").exists())
    path = folder / f"{name}.yaml"
    if not _NAME.fullmatch(name):
        raise InputError(f"'{name[:60]}' is no name for a pose", hint="use letters, digits, '_' and '-'")
    if path.exists():
        raise InputError("a pose of this name exists", hint="give another name", file=path)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with path.open("x", encoding="utf-8") as file:
            file.write(pose_text(name, pose, world=world))
    except OSError as error:
        raise InputError(f"cannot write it ({error.strerror})", hint="name another --poses", file=path) from error
    return path
