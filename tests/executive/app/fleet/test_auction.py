"""The auction: who is given what."""

from collections import Counter

import pytest
from hypothesis import given
from hypothesis import strategies as st

from executive.app.fleet.auction import Auction, Bid, award
from tests.tables import yaml_beside

AUCTIONS = yaml_beside(__file__, "bids.yaml")


@pytest.mark.parametrize("name", AUCTIONS)
def test_each_mission_goes_to_the_robot_that_is_done_first(name):
    awards = award([Bid(*row[:4], problems=tuple(row[4:])) for row in AUCTIONS[name]["bids"]])
    assert [[each.mission, each.robot, each.ends_s, each.first] for each in awards] == AUCTIONS[name]["awards"]


NAMES = ("Alice", "Bob", "Carol")


def bid_of(durations_s, cannot=frozenset()):
    """Bids of so many seconds, in turn; the pairs of mission and robot in `cannot` have a problem."""

    def bid(mission, robot):
        duration_s = durations_s[(mission * 7 + NAMES.index(robot)) % len(durations_s)]
        problems = ("out of reach",) if (mission, robot) in cannot else ()
        return Bid(mission, robot, 0.0, duration_s, problems=problems)

    return bid


@given(
    missions=st.integers(0, 8),
    robots=st.integers(1, 3),
    durations_s=st.lists(st.floats(1.0, 100.0), min_size=1, max_size=5),
    cannot=st.frozensets(st.tuples(st.integers(0, 7), st.sampled_from(NAMES))),
    ends=st.lists(st.tuples(st.integers(0, 2), st.sampled_from(["over", "fails", "stays"])), max_size=40),
)
def test_no_mission_is_given_to_two_robots_and_none_is_lost(missions, robots, durations_s, cannot, ends):
    dispatcher = Auction(range(missions), NAMES[:robots])
    begun, over, refused, bid = Counter(), [], set(), bid_of(durations_s, cannot)
    handed_back = Counter()
    for number, how in ends:
        turn = dispatcher.assign(bid)
        begun.update(each.mission for each in turn.begun)
        refused |= set(turn.refused)
        under_way = dispatcher.under_way
        assert len(set(under_way.values())) == len(under_way)
        everything = [*dispatcher.waiting, *under_way.values(), *over, *refused]
        assert sorted(everything) == list(range(missions))
        assert not any((mission, robot) in cannot for robot, mission in under_way.items())
        busy = sorted(under_way)
        if busy and how != "stays":
            robot = busy[number % len(busy)]
            if how == "over":
                over.append(dispatcher.under_way.pop(robot))
            else:
                handed_back[dispatcher.hand_back(robot)] += 1
                dispatcher.lose(robot)
    assert all(count <= 1 + handed_back[mission] for mission, count in begun.items())


def test_a_mission_that_is_handed_back_comes_before_the_others():
    dispatcher = Auction([1, 2], ["Alice", "Bob"])
    bid = bid_of([10.0])
    assert [(each.mission, each.robot) for each in dispatcher.assign(bid).begun] == [(1, "Alice"), (2, "Bob")]
    dispatcher.lose("Alice")
    assert dispatcher.hand_back("Alice") == 1
    assert not dispatcher.assign(bid).begun  # Bob is busy
    assert dispatcher.under_way.pop("Bob") == 2
    assert [(each.mission, each.robot) for each in dispatcher.assign(bid).begun] == [(1, "Bob")]


def test_a_mission_that_no_robot_can_do_is_refused_with_each_reason():
    dispatcher = Auction([1], ["Alice", "Bob"])
    turn = dispatcher.assign(bid_of([10.0], {(1, "Alice"), (1, "Bob")}))
    assert turn.refused == {1: "no robot can do it: Alice: out of reach; Bob: out of reach"}
    assert (dispatcher.waiting, dict(dispatcher.under_way)) == ([], {})


def test_without_a_robot_nothing_is_refused():
    dispatcher = Auction([1], ["Alice"])
    dispatcher.lose("Alice")
    assert (dispatcher.assign(bid_of([10.0])).refused, dispatcher.waiting) == ({}, [1])


def test_a_mission_that_goes_to_a_robot_that_has_to_charge_waits_until_it_has():
    dispatcher = Auction([1], ["Alice", "Bob"])

    def bid(mission, robot):
        return Bid(mission, robot, 0.0, 10.0 if robot == "Alice" else 99.0, charges=robot == "Alice")

    turn = dispatcher.assign(bid)
    assert (turn.begun, turn.charging, dispatcher.waiting) == ([], ["Alice"], [1])
    assert not dispatcher.assign(bid).begun  # Bob is free, and Alice is still done before him
    dispatcher.resting.discard("Alice")
    charged = dispatcher.assign(lambda mission, robot: Bid(mission, robot, 0.0, 10.0))
    assert [(each.mission, each.robot) for each in charged.begun] == [(1, "Alice")]


def test_a_mission_with_work_where_a_robot_is_at_work_waits_while_others_begin():
    places = {1: {"desk"}, 2: {"desk", "shelf"}, 3: {"shelf"}}
    dispatcher = Auction([1, 2, 3], NAMES[:2], lambda mission: frozenset(places[mission]))
    bid = bid_of([10.0], {(3, "Alice")})
    assert [(each.mission, each.robot) for each in begun_now(dispatcher, bid)] == [(1, "Alice"), (3, "Bob")]
    dispatcher.under_way.pop("Alice")
    assert not begun_now(dispatcher, bid)  # the shelf is still taken
    dispatcher.under_way.pop("Bob")
    assert [(each.mission, each.robot) for each in begun_now(dispatcher, bid)] == [(2, "Alice")]


def begun_now(dispatcher, bid):
    """What begins in rounds of the auction until nothing more does."""
    begun = []
    while turn := dispatcher.assign(bid).begun:
        begun += turn
    return begun
