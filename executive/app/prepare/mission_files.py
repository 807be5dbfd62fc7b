"""Finds mission files, the shipped ones by name, and saves poses as missions."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Final

from skills.inputs.errors import InputError, nearest_name
from skills.inputs.outside import is_there
from skills.inputs.yaml_source import yaml_of

if TYPE_CHECKING:
    from typing import Unpack

    from executive.mission.request import Request, RequestFields
    from skills.teleop.driver import SavedPose


FOLDER: Final = Path(__file__).resolve().parents[3] / "missions"


def shipped_missions() -> dict[str, Path]:
    """Returns the files of the shipped missions by name."""
    return {file.stem: file for file in sorted(FOLDER.glob("*.yaml"))}


def request_of(mission: Request | str | Path, **fields: Unpack[RequestFields]) -> Request:
    """Returns the request for a sentence, a file or a shipped mission's name. Raises InputError for a wrong field."""
    from executive.mission.request import Request, with_fields

    if isinstance(mission, Request):
        return with_fields(mission, fields)
    is_file = isinstance(mission, Path) or mission.endswith((".yaml", ".yml")) or mission in shipped_missions()
    return with_fields(Request(file=Path(mission)) if is_file else Request(str(mission)), fields)


def mission_file(named: Path) -> Path:
    """Returns the file itself if it exists, else the shipped mission of that name.

    Raises:
        InputError: neither exists, and the name has no folder.
    """
    if is_there(named) or named.parent not in (Path(), Path(FOLDER.name)):
        return named
    known = shipped_missions()
    if named.stem in known and named.suffix in ("", ".yaml"):
        return known[named.stem]
    if named.suffix:
        return named
    near = nearest_name(named.name, known)
    hint = f"did you mean '{near}'?" if near else "`errand missions` lists the missions that come with Errand"
    raise InputError("there is no such mission", hint=hint, file=named)


_NAME: Final = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]{0,59}")


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
