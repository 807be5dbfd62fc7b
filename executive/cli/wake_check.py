"""A sentence that names no robot, where the robot must be called: refused before anything heavy is imported."""

from __future__ import annotations

import re
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from executive.mission.request import Request
from skills.files.errors import InputError
from skills.files.outside import is_file
from skills.files.yaml_source import read_yaml

__all__ = ["refuse_unaddressed"]


def refuse_unaddressed(request: Request) -> None:
    """Raise InputError where a sentence lacks the robot's name, although the request or the world asks for it.

    Whether a name that is there calls the robot is decided later, and so is all that cannot be read here, and who of
    several robots is called.
    """
    if request.sentence is None or request.robots:
        return
    try:
        robot = _robot_of(request.world or "flat")
    except InputError:
        return
    required = robot.get("require_wake", False) if request.require_wake is None else request.require_wake
    name = str(robot.get("name") or "")
    if not (required and name) or re.search(rf"\b{re.escape(name)}\b", request.sentence, re.IGNORECASE):
        return
    hint = f'did you mean --no-wake? Or begin with "Hey {name}"'
    raise InputError(f"{name} is not called in '{request.sentence[:60]}'", hint=hint)


def _robot_of(world: str) -> dict[str, Any]:
    """What the knowledge file of a world says about its one robot; {} where it says nothing, or has several."""
    worlds = find_spec("plant.worlds")
    folders = [Path(world), *(Path(each) / world for each in (worlds and worlds.submodule_search_locations) or ())]
    file = next(file for folder in folders if is_file(file := folder / "knowledge.yaml") or folder is folders[-1])
    knowledge = read_yaml(file).data
    robot = knowledge.get("robot") if isinstance(knowledge, dict) and "robots" not in knowledge else None
    return robot if isinstance(robot, dict) else {}
