"""Publishes the first messages in a log: facts about the run, one message for each command, and the map."""

from __future__ import annotations

import base64
import math
import platform
from collections.abc import Mapping, Sequence
from importlib.metadata import PackageNotFoundError, version
from types import MappingProxyType
from typing import Any, Final

import cv2
import numpy as np

from executive.words.command import START, Command
from executive.words.knowledge import Knowledge
from executive.words.schemas import RUN, TASK
from executive.words.task import Task
from skills.api import ObjectKind, Publish
from skills.class_forms import class_form
from skills.grid_map import GridMap
from skills.robot import Clock

PACKAGES: Final = ("spot-errand", "drake", "py-trees", "numpy")
_GREY: Final = {"free": 255, "unknown": 205, "occupied": 0}
_NOTHING_ID: Final = 0


def announce(
    publish: Publish,
    clock: Clock,
    robot_name: str,
    commands: Sequence[Command],
    knowledge: Knowledge,
    *,
    world: str,
    seed: int,
    scenario: Sequence[str] = (),
    robots: Mapping[str, str] = MappingProxyType({}),
) -> None:
    """Publishes the run's facts, then one message for each command of a robot.

    `scenario` lists the faults and events of the run, `robots` has the kind of each robot if there are several. Raises
    KeyError if an object class has no number.
    """
    texts = [str(command) for command in commands]
    facts = {"world": world, "seed": seed, "commands": texts, "versions": versions(PACKAGES)}
    more = {"scenario": list(scenario), "robots": dict(robots)}
    publish(RUN, {**facts, **{key: value for key, value in more.items() if value}})
    count, stamp = len(commands), clock.now()
    for index, command in enumerate(commands):
        numbers = {"sequence": index, "robot_name": robot_name, "mission_count": count, "task_count": index + 1}
        publish(TASK, {"stamp": stamp, **numbers, **_task_message(command, knowledge)})


def _task_message(command: Command, knowledge: Knowledge) -> Mapping[str, Any]:
    """Encodes a command as numbers.

    Object types are class ids, several for a category ("drink"), 0 for none. `goal_x` and `goal_y` are in the world
    frame (m), NaN if the command names no goal. `cmd_type`: 0 go or take, 1 grasp, 2 find, 3 place, 4 wait, 5 charge.
    """

    def ids(item: ObjectKind | None) -> tuple[int, ...]:
        """Returns the numbers of an object's classes."""
        if item is None:
            return (_NOTHING_ID,)
        return tuple(class_form(name).id for name in knowledge.classes(knowledge.object_name(item.name) or item.name))

    items, objects = ids(command.item), ids(command.object)
    goal_x, goal_y = goal_position(knowledge, command)
    return {
        "item_type": items,
        "item_count": (0 if command.item is None else command.item_count,) * len(items),
        "obj_type": objects,
        "obj_count": (0 if command.object is None else command.object_count,) * len(objects),
        "goal_x": goal_x,
        "goal_y": goal_y,
        "cmd_type": command_type(command.task),
    }


def command_type(task: Task | None) -> int:
    """Number of a task: 0 for Nothing, else 255 for one of a plug-in that has none."""
    return 0 if task is None else task.number


def goal_position(knowledge: Knowledge, command: Command) -> tuple[float, float]:
    """Position of a command's goal, (x, y) in the world frame (m); NaN if the command names no goal."""
    if command.goal is None:
        return math.nan, math.nan
    person = knowledge.person(command.goal)
    place = knowledge.place(command.goal_at or (knowledge.people[person].at if person else command.goal))
    if command.goal == START or place is None:
        return knowledge.start.x, knowledge.start.y
    pose = knowledge.place_pose(place)
    return pose.x, pose.y


def versions(packages: Sequence[str]) -> dict[str, str]:
    """Returns the versions of Python and of packages; "not installed" for a package that is missing."""
    found = {"python": platform.python_version()}
    for package in packages:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            found[package] = "not installed"
    return found


def map_message(grid: GridMap, knowledge: Knowledge, *, world: str) -> Mapping[str, Any]:
    """Encodes the map: a grey PNG (first row: largest y), its origin in the world (m), the places, the dock.

    A room has an outline, a named pose the angle in which the robot looks there.
    """
    grey = grid.grey(**_GREY)
    png = cv2.imencode(".png", np.ascontiguousarray(grey[::-1]), [cv2.IMWRITE_PNG_COMPRESSION, 9])[1].tobytes()
    width_m, height_m = grid.size_m
    rooms = knowledge.rooms
    middles = {name: np.mean(outline, axis=0) for name, outline in rooms.items()}
    middles |= {name: np.array([pose.x, pose.y]) for name in knowledge.poses if (pose := knowledge.place_pose(name))}
    return {
        "world": world,
        "frame_id": "world",
        "resolution_m": grid.resolution_m,
        "origin_m": {"x": grid.origin_m[0], "y": grid.origin_m[1]},
        "size_m": {"x": width_m, "y": height_m},
        "format": "png",
        "data": base64.b64encode(png).decode(),
        "places": [
            {"name": name, "x": round(float(x), 3), "y": round(float(y), 3)}
            | ({"outline": rooms[name]} if name in rooms else {"yaw_rad": round(knowledge.place_pose(name).yaw, 3)})
            for name, (x, y) in middles.items()
        ],
        "dock": None if knowledge.dock is None else {"x": knowledge.dock.x, "y": knowledge.dock.y},
    }
