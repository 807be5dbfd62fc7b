"""Tests of who goes first among robots."""

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from executive.run.traffic_table import SILENT_S, TrafficTable
from skills.robot import Pose2D

DISCS = np.array([[0.0, 0.0, 0.3]])
WAY = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
NAMES = ("alice", "bob", "carl")
RELEASED = [{"robot": "alice", "turn": None, "x": [], "y": []}]


def table(time, *names):
    """A table in which each robot has been heard of."""
    made = TrafficTable(dict.fromkeys(names, DISCS), lambda: time.now_s)
    for name in names:
        made.report(name, Pose2D(0.0, 0.0, 0.0))
    return made


@pytest.fixture
def time():
    """A clock that is set by hand."""
    return SimpleNamespace(now_s=0.0)


@pytest.fixture
def made(time):
    return table(time, "alice", "bob")


@pytest.fixture
def alice(made):
    return made.view_of("alice")


@pytest.fixture
def bob(made):
    return made.view_of("bob")


def test_the_robot_that_claims_first_goes_first_and_keeps_its_turn(alice, bob):
    bob.claim()
    alice.claim()
    assert (bob.goes_before(alice), alice.goes_before(bob)) == (True, False)
    bob.claim()
    assert bob.goes_before(alice)


def test_a_claim_that_is_given_back_is_free_for_the_next(alice, bob):
    alice.claim()
    alice.announce(WAY, DISCS)
    bob.claim()
    alice.release()
    assert (bob.goes_before(alice), bob.others()[0].path) == (True, None)


def test_a_robot_that_falls_silent_loses_its_right_of_way(made, alice, bob, time):
    """Others see it as an obstacle only."""
    alice.claim()
    bob.claim()
    time.now_s = SILENT_S + 0.1
    made.report("bob", Pose2D(0.0, 0.0, 0.0))
    assert (bob.goes_before(alice), bob.others()) == (True, ())


def test_a_robot_sees_the_others_with_what_they_announced(alice, bob):
    alice.claim()
    alice.announce(WAY, DISCS)
    (seen,) = bob.others()
    assert (seen.name, seen.first, seen.path is WAY) == ("alice", True, True)


def test_a_robot_that_cannot_make_way_goes_first_instead(alice, bob):
    alice.claim()
    bob.claim()
    bob.let_pass("alice")
    assert bob.goes_before(alice)


ACTIONS = st.lists(
    st.tuples(st.sampled_from(("claim", "release", "heard", "wait", "change")), st.sampled_from(NAMES)), max_size=40
)


@given(ACTIONS)
def test_the_right_of_way_is_a_strict_order(actions):
    """Never do two go before each other, and never do robots wait for each other in a circle."""
    time = SimpleNamespace(now_s=0.0)
    made = table(time, *NAMES)
    for what, name in actions:
        if what == "claim":
            made.view_of(name).claim()
        elif what == "release":
            made.view_of(name).release()
        elif what == "heard":
            made.report(name, None)
        elif what == "wait":
            time.now_s += 0.8
        else:
            made.view_of(name).let_pass(NAMES[(NAMES.index(name) + 1) % 3])
        before = {(a, b) for a in NAMES for b in NAMES if a != b and made.view_of(a).goes_before(made.view_of(b))}
        assert all((b, a) not in before for a, b in before)
        a, b, c = NAMES
        assert not {(a, b), (b, c), (c, a)} <= before
        assert not {(b, a), (c, b), (a, c)} <= before


def test_a_reserved_path_is_logged_once_in_quarters_of_a_metre_and_again_when_it_is_released(made, alice):
    assert list(made.news()) == []
    alice.claim()
    alice.announce(np.column_stack([np.linspace(0.0, 1.0, 101), np.zeros(101), np.zeros(101)]), DISCS)
    (told,) = made.news()
    assert (told["robot"], told["turn"], told["y"]) == ("alice", 1, [0.0] * 5)
    assert np.allclose(told["x"], [0.0, 0.25, 0.5, 0.75, 1.0], atol=0.011)
    assert list(made.news()) == []
    alice.release()
    assert list(made.news()) == RELEASED


def test_the_path_of_a_silent_robot_is_not_logged(made, alice, time):
    alice.claim()
    assert len(list(made.news())) == 1
    time.now_s = SILENT_S + 0.1
    assert list(made.news()) == RELEASED


def test_a_robot_yields_unless_it_works_or_claimed_first(made, alice, bob):
    alice.claim()
    yields = [alice.others()[0].yields]
    for idle in (True, False):
        made.rest("bob", idle=idle)
        yields.append(alice.others()[0].yields)
    bob.claim()
    assert [*yields, alice.others()[0].yields, bob.others()[0].yields] == [False, True, False, True, False]


def test_the_discs_of_the_others_lie_at_their_estimated_poses(made):
    """Bob's disc of 0.3 m about (2, 1), and a little more; nothing of Alice's own."""
    made.report("bob", Pose2D(2.0, 1.0, 1.0))
    covered = made.covered_W("alice")
    assert covered[:, :2].tolist() == [[2.0, 1.0]]
    assert 0.4 < covered[0, 2] < 0.7


@pytest.mark.parametrize("end", ["release", "silence"])
def test_a_goal_is_reserved_until_it_is_given_back_or_the_robot_falls_silent(alice, bob, time, end):
    """As for a dock: the last pose of a way that was announced."""
    alice.claim()
    alice.announce(WAY, DISCS)
    (seen,) = bob.others()
    assert (seen.first, seen.path[-1].tolist()) == (True, WAY[-1].tolist())
    if end == "release":
        alice.release()
        assert bob.others()[0].path is None
    else:
        time.now_s += SILENT_S + 0.1
        assert bob.others() == ()
