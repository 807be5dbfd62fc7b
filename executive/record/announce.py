"""What the log says at the beginning: the run's world, seed and versions, and the commands as messages."""

from __future__ import annotations

import math
import platform
from collections.abc import Mapping, Sequence
from importlib.metadata import PackageNotFoundError, version
from types import MappingProxyType

from executive.record.messages import TASK_TOPIC, task_messages
from executive.record.schemas import RUN
from executive.tree.compiler import CompiledTree
from executive.words.command import START, Command
from executive.words.knowledge import Knowledge
from skills.api import Publish
from skills.robot import Clock

PACKAGES = ("spot-errand", "drake", "py-trees", "numpy")


def announce(
    publish: Publish,
    clock: Clock,
    tree: CompiledTree,
    knowledge: Knowledge,
    *,
    world: str,
    seed: int,
    scenario: Sequence[str] = (),
    robots: Mapping[str, str] = MappingProxyType({}),
) -> None:
    """Write the run's facts, then one message for each command. `scenario` tells what goes wrong and happens in it,
    `robots` the kind of each robot where there are several.
    """
    texts = [str(command) for command in tree.commands]
    facts = {"world": world, "seed": seed, "commands": texts, "versions": versions(PACKAGES)}
    more = {"scenario": list(scenario), "robots": dict(robots)}
    publish(RUN, {**facts, **{key: value for key, value in more.items() if value}})
    messages = task_messages(
        tree.commands,
        stamp=clock.now(),
        first_sequence=0,
        robot_name=tree.robot_name,
        classes=lambda name: knowledge.classes(knowledge.thing(name) or name),
        position=lambda command: goal_position(knowledge, command),
    )
    for message in messages:
        publish(TASK_TOPIC, vars(message))


def goal_position(knowledge: Knowledge, command: Command) -> tuple[float, float]:
    """Where a command's goal is, (x, y) in the world frame (m); NaN where it was left open."""
    if command.goal is None:
        return math.nan, math.nan
    person = knowledge.person(command.goal)
    place = knowledge.place(command.goal_at or (knowledge.people[person].at if person else command.goal))
    if command.goal == START or place is None:
        return knowledge.start.x, knowledge.start.y
    pose = knowledge.place_pose(place)
    return pose.x, pose.y


def versions(packages: Sequence[str]) -> dict[str, str]:
    """The versions of Python and of installed packages."""
    return {"python": platform.python_version(), **{name: _version(name) for name in packages}}


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "not installed"
