"""What the log says at the beginning."""

import math

import pytest

from executive.record.announce import announce, command_type, goal_position
from executive.words.command import parse_command
from executive.words.task import task_named


def test_run_and_commands_are_announced(compiled, make, knowledge, clock):
    logged = []
    commands = compiled(*make.FETCH).commands
    announce(lambda topic, m: logged.append((topic, m)), clock, "alice", commands, knowledge, world="flat", seed=4)
    assert [topic for topic, _ in logged] == ["run", "taskChannel", "taskChannel"]
    (_, run), (_, first), (_, second) = logged
    assert (run["seed"], run["commands"]) == (4, list(make.FETCH))
    assert (first["sequence"], first["mission_count"], first["task_count"], first["cmd_type"]) == (0, 2, 1, 1)
    assert (first["item_type"], first["item_count"], first["obj_type"]) == ((0,), (0,), (2, 1))
    assert (second["sequence"], second["item_type"], second["goal_x"], second["cmd_type"]) == (1, (2, 1), 0.0, 0)


@pytest.mark.parametrize(
    ("text", "position"),
    [
        ("Take [Nothing] to [kitchen] and do [Nothing] to [Nothing]", (4.0, 0.0)),
        ("Take [Nothing] to [counter] and do [Nothing] to [Nothing]", (4.5, -1.0)),
        ("Take [coke] to [Sam] and do [Nothing] to [Nothing]", (0.0, 4.0)),
        ("Take [coke] to [Sam at kitchen] and do [Nothing] to [Nothing]", (4.0, 0.0)),
        ("Take [coke] to [start] and do [Nothing] to [Nothing]", (0.0, 0.0)),
    ],
)
def test_goal_positions(knowledge, text, position):
    assert goal_position(knowledge, parse_command(text)) == position


def test_an_open_goal_has_no_position(knowledge):
    command = parse_command("Take [Nothing] to [Nothing] and do [grasp] to [coke]")
    assert all(math.isnan(value) for value in goal_position(knowledge, command))


def test_the_tasks_have_their_numbers():
    assert [command_type(task) for task in (None, task_named("grasp"), task_named("find"), task_named("place"))] == [
        0,
        1,
        2,
        3,
    ]
