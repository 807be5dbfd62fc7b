"""How a mission is done by two robots that neither can do alone."""

from executive.app.fleet.auction import Bid
from executive.app.fleet.chain import Split, soonest, splits
from executive.words.command import parse_command

TAKE, PUT, GO = map(
    parse_command,
    (
        "Take [Nothing] to [kitchen] and do [grasp] to [2 red cup]",
        "Take [2 red cup] to [bedroom] and do [Nothing] to [Nothing]",
        "Take [Nothing] to [hall] and do [Nothing] to [Nothing]",
    ),
)


def lines(split):
    return [str(command) for command in split.first], [str(command) for command in split.second], split.table


def test_a_split_puts_the_held_object_on_a_table_and_takes_it_from_there():
    (split,) = splits((TAKE, PUT), ["desk"])
    put = "Take [2 red cup] to [desk] and do [Nothing] to [Nothing]"
    take = "Take [Nothing] to [desk] and do [grasp] to [2 red cup]"
    assert lines(split) == ([str(TAKE), put], [take, str(PUT)], "desk")


def test_each_table_gives_a_split():
    found = list(splits((TAKE, PUT, GO), ["desk", "shelf"]))
    assert [split.table for split in found] == ["desk", "shelf", None]


def test_between_commands_with_an_empty_gripper_nothing_is_handed_over():
    assert list(splits((GO, GO), ["desk"])) == [Split((GO,), (GO,))]


def test_a_single_command_cannot_be_split():
    assert list(splits((GO,), ["desk"])) == []


def test_the_second_waits_for_the_first_and_the_first_done_wins():
    split = Split((GO,), (GO,))
    first = [Bid(1, "Alice", 5.0, 10.0), Bid(1, "Bob", 0.0, 30.0)]
    second = [Bid(1, "Alice", 5.0, 1.0), Bid(1, "Bob", 20.0, 7.0)]
    chain = soonest(split, first, second)
    assert (chain.first.robot, chain.second.robot, chain.ends_s) == ("Alice", "Bob", 27.0)


def test_one_robot_is_no_chain():
    split = Split((GO,), (GO,))
    assert soonest(split, [Bid(1, "Alice", 0.0, 1.0)], [Bid(1, "Alice", 0.0, 1.0)]) is None
    refused = Bid(1, "Bob", 0.0, 1.0, problems=("out of reach",))
    assert soonest(split, [Bid(1, "Alice", 0.0, 1.0)], [refused]) is None
