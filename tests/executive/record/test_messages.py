import math

import pytest

from executive.record.messages import TaskMessage, command_type, task_messages
from executive.words.command import Task, parse_command

CLASSES = {"drink": ("coke", "beer"), "hammer": ("hammer",), "unicorn": ("unicorn",)}


def messages(*texts):
    return task_messages(
        [parse_command(text) for text in texts],
        stamp=1.5,
        first_sequence=7,
        robot_name="Alice",
        classes=CLASSES.__getitem__,
        position=lambda command: (3.0, 1.0) if command.goal == "kitchen" else (math.nan, math.nan),
    )


def test_each_command_becomes_a_message_with_class_ids():
    first, second = messages(
        "Take [Nothing] to [kitchen] and do [grasp] to [2 drink]",
        "Take [2 drink] to [start] and do [Nothing] to [Nothing]",
    )
    assert first == TaskMessage(
        stamp=1.5,
        sequence=7,
        robot_name="Alice",
        mission_count=2,
        task_count=1,
        item_type=(0,),
        item_count=(0,),
        obj_type=(2, 1),
        obj_count=(2, 2),
        goal_x=3.0,
        goal_y=1.0,
        cmd_type=1,
    )
    assert (second.sequence, second.task_count, second.item_type, second.cmd_type) == (8, 2, (2, 1), 0)


def test_an_open_goal_has_no_position():
    (message,) = messages("Take [Nothing] to [Nothing] and do [find] to [hammer]")
    assert math.isnan(message.goal_x) and math.isnan(message.goal_y)


def test_a_class_without_a_number_is_an_error():
    with pytest.raises(KeyError):
        messages("Take [Nothing] to [kitchen] and do [find] to [unicorn]")


def test_the_tasks_have_their_numbers():
    assert [command_type(task) for task in (None, Task.GRASP, Task.FIND, Task.PLACE)] == [0, 1, 2, 3]
