"""The messages on the tasks to do that other nodes of a robot system get."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Final

from executive.words.command import Command, Task, Thing
from skills.perception.class_forms import class_forms

__all__ = ["TaskMessage", "command_type", "task_messages"]

TASK_TOPIC: Final = "taskChannel"
DETECT_TOPIC: Final = "object_to_detect"
DESTINATION_TOPIC: Final = "object_destination"
NOTHING_ID: Final = 0


@dataclass(frozen=True)
class TaskMessage:
    """One command as numbers.

    Types are class ids, several where a category was asked for ("drink"); 0 is Nothing. `goal_x`, `goal_y` are in the
    world frame (m), NaN where the goal was left open. `mission_count` says how many commands the mission has,
    `task_count` which of them this is, from 1. `cmd_type`: 0 go or take, 1 grasp, 2 find, 3 place, 4 wait,
    5 charge.
    """

    stamp: float
    sequence: int
    robot_name: str
    mission_count: int
    task_count: int
    item_type: tuple[int, ...]
    item_count: tuple[int, ...]
    obj_type: tuple[int, ...]
    obj_count: tuple[int, ...]
    goal_x: float
    goal_y: float
    cmd_type: int


def command_type(task: Task | None) -> int:
    """The number of a task: 0 for Nothing, else its place among the tasks from 1."""
    return 0 if task is None else [*Task].index(task) + 1


def task_messages(
    commands: Sequence[Command],
    *,
    stamp: float,
    first_sequence: int,
    robot_name: str,
    classes: Callable[[str], Iterable[str]],
    position: Callable[[Command], tuple[float, float]],
) -> tuple[TaskMessage, ...]:
    """The commands as messages, numbered from `first_sequence` on; `stamp` is the robot's clock (s).

    `classes` gives the classes that an object's name stands for, `position` where a command's goal is, (x, y) in the
    world frame (m). Raises KeyError for a class without a number.
    """

    def types(thing: Thing | None) -> tuple[int, ...]:
        """The numbers of an object's classes."""
        return (NOTHING_ID,) if thing is None else tuple(class_forms()[name].id for name in classes(thing.name))

    def message(index: int, command: Command) -> TaskMessage:
        """The message of one of the commands."""
        item, target = types(command.item), types(command.object)
        goal_x, goal_y = position(command)
        return TaskMessage(
            stamp=stamp,
            sequence=first_sequence + index,
            robot_name=robot_name,
            mission_count=len(commands),
            task_count=index + 1,
            item_type=item,
            item_count=(0 if command.item is None else command.item_count,) * len(item),
            obj_type=target,
            obj_count=(0 if command.object is None else command.object_count,) * len(target),
            goal_x=goal_x,
            goal_y=goal_y,
            cmd_type=command_type(command.task),
        )

    return tuple(message(index, command) for index, command in enumerate(commands))
