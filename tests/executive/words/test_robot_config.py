"""Robots of a run, from the option that names them."""

from __future__ import annotations

import pytest

from executive.words.robot_config import RobotConfig, display_name, find_robot, parse_robots
from skills.files.errors import InputError
from skills.robot import Pose2D

KINDS = ("fetch", "spot")


def test_each_robot_has_its_kind_in_the_order_of_the_option():
    expected = (RobotConfig("Bob", "fetch"), RobotConfig("Alice", "spot"))
    assert parse_robots("bob=fetch, alice=spot", KINDS) == expected


def test_a_start_may_follow_the_kind():
    robots = parse_robots("alice=spot@1.0,-2,1.57,bob=fetch,eve=spot@0,0,0", KINDS)
    assert robots == (
        RobotConfig("Alice", "spot", Pose2D(1.0, -2.0, 1.57)),
        RobotConfig("Bob", "fetch"),
        RobotConfig("Eve", "spot", Pose2D(0.0, 0.0, 0.0)),
    )


@pytest.mark.parametrize(
    ("option", "message"),
    [
        # option, what the error says with its hint
        ("", "no robots are named; write NAME=KIND"),
        (" , ", "no robots are named"),
        ("alice=spot,,bob=fetch", "has a comma too many"),
        ("alice", "'alice' does not give a robot and its kind; write NAME=KIND"),
        ("alice=spot,bob", "'bob' does not give a robot and its kind"),
        ("=spot", "a robot without a name"),
        ("7up=spot", "'7up' is no name for a robot"),
        ("everyone=spot", "'everyone' means all robots"),
        ("alice=spot,alice=fetch", "two robots are called 'alice'; give one of them another name"),
        ("alice=spot,Alice=fetch", "'alice' and 'Alice' are the same name"),
        ("rob-1=spot,rob 1=fetch", "'rob-1' and 'rob 1' are the same name"),
        ("alice=spto", "unknown kind of robot 'spto'; did you mean 'spot'? (known are fetch and spot)"),
        ("alice=pr2", "unknown kind of robot 'pr2'; known are fetch and spot"),
        ("alice=", "unknown kind of robot ''; known are fetch and spot"),
        ("alice=spot@1,2", "'1,2' is no start for alice: a pose has 3 numbers, not 2"),
        ("alice=spot@x,2,3", "does not give a robot and its kind|is no start for alice"),
        ("alice=spot@1,2,1e9", "is no start for alice"),
    ],
)
def test_invalid_list_of_robots_is_refused(option, message):
    with pytest.raises(InputError) as error:
        parse_robots(option, KINDS)
    assert any(part in str(error.value) for part in message.split("|"))


@pytest.mark.parametrize(("name", "shown"), [("alice", "Alice"), ("R2-D2", "R2-D2"), ("bob", "Bob")])
def test_a_name_is_shown_with_a_capital(name, shown):
    assert display_name(name) == shown


def test_a_robot_is_called_without_regard_to_case():
    assert find_robot("BOB", ["alice", "bob"]) == "bob"
    assert find_robot("Robin", ["alice", "bob"]) is None
