"""Robots of a run, from the option that names them."""

import pytest

from executive.words.robot_config import RobotConfig, display_name, find_robot, parse_robots
from skills.inputs.errors import InputError
from skills.robot import Pose2D
from tests.tables import table

KINDS = ("fetch", "spot")


def test_each_robot_has_its_kind_in_the_order_of_the_option_and_perhaps_a_start():
    alice, bob = RobotConfig("Alice", "spot", Pose2D(1.0, -2.0, 1.57)), RobotConfig("Bob", "fetch")
    assert parse_robots("bob=fetch, alice=spot@1.0,-2,1.57", KINDS) == (bob, alice)
    assert parse_robots("eve=spot@0,0,0,bob=fetch", KINDS) == (RobotConfig("Eve", "spot", Pose2D(0.0, 0.0, 0.0)), bob)
    assert parse_robots("alice=spot,bob=fetch", KINDS) == (RobotConfig("Alice", "spot"), bob)


@pytest.mark.parametrize(*table(__file__, "wrong_options"))
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
