"""A sentence that names no robot, where the robot must be called: refused before anything heavy is imported."""

from __future__ import annotations

import argparse
import re
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NoReturn

from skills.files.errors import InputError
from skills.files.outside import is_file
from skills.files.yaml_source import read_yaml

__all__ = ["refuse_unaddressed"]


def refuse_unaddressed(arguments: Sequence[str]) -> None:
    """Raise InputError where `--say` lacks the robot's name, although `--wake` or the world asks for it.

    Whether a name that is there calls the robot is decided later, and so is all that cannot be read here, and who of
    several robots is called.
    """
    options = _Options(add_help=False, allow_abbrev=False)
    options.add_argument("--say")
    options.add_argument("--world", default="flat")
    options.add_argument("--robots")
    options.add_argument("--wake", action=argparse.BooleanOptionalAction)
    try:
        asked, _ = options.parse_known_args(arguments)
        robot = _robot_of(asked.world)
    except (ValueError, InputError):
        return
    if asked.robots is not None:
        return
    required = robot.get("require_wake", False) if asked.wake is None else asked.wake
    name = str(robot.get("name") or "")
    if asked.say is None or not (required and name) or re.search(rf"\b{re.escape(name)}\b", asked.say, re.IGNORECASE):
        return
    hint = f'did you mean --no-wake? Or begin with "Hey {name}"'
    raise InputError(f"{name} is not called in '{asked.say[:60]}'", hint=hint)


class _Options(argparse.ArgumentParser):
    """Raises where the command's own parser will say what is wrong."""

    def error(self, message: str) -> NoReturn:
        raise ValueError(message)


def _robot_of(world: str) -> dict[str, Any]:
    """What the knowledge file of a world says about its one robot; {} where it says nothing, or has several."""
    worlds = find_spec("plant.worlds")
    folders = [Path(world), *(Path(each) / world for each in (worlds and worlds.submodule_search_locations) or ())]
    file = next(file for folder in folders if is_file(file := folder / "knowledge.yaml") or folder is folders[-1])
    knowledge = read_yaml(file).data
    robot = knowledge.get("robot") if isinstance(knowledge, dict) and "robots" not in knowledge else None
    return robot if isinstance(robot, dict) else {}
