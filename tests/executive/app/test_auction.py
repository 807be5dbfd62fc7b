"""The auction: who is given what."""

import pytest

from executive.app.auction import Bid, award


def bids(*rows):
    return [Bid(*row[:4], problems=tuple(row[4:])) for row in rows]


# (bids as mission, robot, ready in s, duration in s, problems), what is awarded as mission, robot, end in s, begins now
TABLE = [
    ([], []),
    ([(1, "Alice", 0.0, 30.0), (1, "Bob", 0.0, 20.0)], [(1, "Bob", 20.0, True)]),  # the nearer one
    ([(1, "Bob", 0.0, 20.0), (1, "Alice", 0.0, 20.0)], [(1, "Alice", 20.0, True)]),  # equals: by name
    ([(1, "Alice", 0.0, 30.0), (1, "Bob", 15.0, 20.0)], [(1, "Alice", 30.0, True)]),  # what it does now counts
    ([(1, "Alice", 40.0, 30.0), (1, "Bob", 15.0, 20.0)], [(1, "Bob", 35.0, True)]),
    ([(1, "Alice", 0.0, 9.0, "out of reach"), (1, "Bob", 50.0, 20.0)], [(1, "Bob", 70.0, True)]),
    ([(1, "Alice", 0.0, 9.0, "out of reach"), (1, "Bob", 0.0, 2.0, "low")], []),  # nobody can
    (
        [(1, "Alice", 0.0, 30.0), (1, "Bob", 0.0, 40.0), (2, "Alice", 0.0, 20.0), (2, "Bob", 0.0, 60.0)],
        [(2, "Alice", 20.0, True), (1, "Bob", 40.0, True)],  # what it has to do by then counts
    ),
    (
        [(1, "Alice", 0.0, 10.0), (1, "Bob", 0.0, 90.0), (2, "Alice", 0.0, 20.0), (2, "Bob", 0.0, 90.0)],
        [(1, "Alice", 10.0, True), (2, "Alice", 30.0, False)],  # the second waits for the first
    ),
]  # fmt: skip


@pytest.mark.parametrize(("offered", "expected"), TABLE)
def test_each_mission_goes_to_the_robot_that_is_done_first(offered, expected):
    awards = award(bids(*offered))
    assert [(each.mission, each.robot, each.ends_s, each.first) for each in awards] == expected
