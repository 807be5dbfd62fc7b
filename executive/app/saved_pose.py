"""Poses saved by hand: each is a mission file of its own, to be run, or used by another one (`use: NAME.yaml`)."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Final

import yaml

from skills.files.errors import InputError
from skills.teleop.driver import SavedPose

_NAME: Final = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]{0,59}")


def pose_text(name: str, pose: SavedPose, *, world: str) -> str:
    """The mission file of a pose: drive there, take the arm's pose, set the gripper."""
    base = {"x": pose.base.x_m, "y": pose.base.y_m, "yaw": pose.base.yaw_rad}
    steps: list[dict[str, object]] = [{"skill": "navigate", "with": {key: round(v, 3) for key, v in base.items()}}]
    if pose.joints_rad:
        joints = {"joints": [round(angle, 4) for angle in pose.joints_rad], "opening": round(pose.opening, 3)}
        steps.append({"skill": "pose_arm", "with": joints})
    file = {"name": name.replace("_", " "), "world": world, "steps": steps}
    return str(yaml.safe_dump(file, sort_keys=False, default_flow_style=None, width=120))


def save_pose(folder: Path, name: str | None, pose: SavedPose, *, world: str) -> Path:
    """Write a pose as NAME.yaml, `pose_1` and so on without a name. Raises InputError: there is one, or it cannot be.

    A file that is there is never overwritten.
    """
    name = name or next(free for n in range(1, 10_000) if not (folder / f"{(free := f'pose_{n}')}.yaml").exists())
    path = folder / f"{name}.yaml"
    if not _NAME.fullmatch(name):
        raise InputError(f"'{name[:60]}' is no name for a pose", hint="use letters, digits, '_' and '-'")
    if path.exists():
        raise InputError("there is a pose of this name", hint="give another name", file=path)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with path.open("x", encoding="utf-8") as file:
            file.write(pose_text(name, pose, world=world))
    except OSError as error:
        raise InputError(f"cannot write it ({error.strerror})", hint="name another --poses", file=path) from error
    return path
