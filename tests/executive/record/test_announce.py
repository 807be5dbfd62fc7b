"""What the log says at the beginning."""

import math

import pytest

from executive.record.announce import announce, goal_position
from executive.words.command import parse_command


def test_run_and_commands_are_announced(compiled, make, knowledge, clock):
    told = []
    announce(lambda topic, m: told.append((topic, m)), clock, compiled(*make.FETCH), knowledge, world="flat", seed=4)
    assert [topic for topic, _ in told] == ["run", "taskChannel", "taskChannel"]
    assert (told[0][1]["seed"], told[0][1]["commands"]) == (4, list(make.FETCH))
    assert told[1][1]["obj_type"] == (2, 1)
    assert (told[2][1]["item_type"], told[2][1]["goal_x"]) == ((2, 1), 0.0)


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
