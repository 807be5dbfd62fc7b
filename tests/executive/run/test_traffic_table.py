"""Tests of who goes first among robots."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from executive.run.traffic_table import SILENT_S, TrafficTable
from skills.robot import Pose2D

DISCS = np.array([[0.0, 0.0, 0.3]])
WAY = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
NAMES = ("alice", "bob", "carl")


@dataclass
class Time:
    """A clock that is set by hand."""

    now_s: float = 0.0

    def now(self) -> float:
        """The time (s)."""
        return self.now_s


def table(time: Time, *names: str) -> TrafficTable:
    """A table in which each robot has been heard of."""
    made = TrafficTable(dict.fromkeys(names, DISCS), time.now)
    for name in names:
        made.report(name, Pose2D(0.0, 0.0, 0.0))
    return made


def test_the_robot_that_claims_first_goes_first() -> None:
    """| claims | goes first |
    | bob, alice | bob |"""
    made = table(Time(), "alice", "bob")
    made.view_of("bob").claim()
    made.view_of("alice").claim()
    assert made.view_of("bob").goes_before(made.view_of("alice"))
    assert not made.view_of("alice").goes_before(made.view_of("bob"))


def test_a_claim_that_is_held_keeps_its_turn() -> None:
    """Claiming again does not put a robot back."""
    made = table(Time(), "alice", "bob")
    made.view_of("bob").claim()
    made.view_of("alice").claim()
    made.view_of("bob").claim()
    assert made.view_of("bob").goes_before(made.view_of("alice"))


def test_a_claim_that_is_given_back_is_free_for_the_next() -> None:
    """After release the other goes first, and the way is gone."""
    made = table(Time(), "alice", "bob")
    made.view_of("alice").claim()
    made.view_of("alice").announce(WAY, DISCS)
    made.view_of("bob").claim()
    made.view_of("alice").release()
    assert made.view_of("bob").goes_before(made.view_of("alice"))
    assert made.view_of("bob").others()[0].path is None


def test_a_robot_that_falls_silent_loses_its_right_of_way() -> None:
    """Others see it as an obstacle only."""
    time = Time()
    made = table(time, "alice", "bob")
    made.view_of("alice").claim()
    made.view_of("bob").claim()
    time.now_s = SILENT_S + 0.1
    made.report("bob", Pose2D(0.0, 0.0, 0.0))
    assert made.view_of("bob").goes_before(made.view_of("alice"))
    assert made.view_of("bob").others() == ()


def test_a_robot_does_not_see_itself() -> None:
    """`others` are the others, with what they announced."""
    made = table(Time(), "alice", "bob")
    made.view_of("alice").claim()
    made.view_of("alice").announce(WAY, DISCS)
    (seen,) = made.view_of("bob").others()
    assert seen.name == "alice" and seen.first and seen.path is WAY


def test_turns_can_be_changed() -> None:
    """One that cannot make way goes first instead."""
    made = table(Time(), "alice", "bob")
    made.view_of("alice").claim()
    made.view_of("bob").claim()
    made.view_of("bob").let_pass("alice")
    assert made.view_of("bob").goes_before(made.view_of("alice"))


ACTIONS = st.lists(
    st.tuples(st.sampled_from(("claim", "release", "heard", "wait", "change")), st.sampled_from(NAMES)), max_size=40
)


@given(ACTIONS)
def test_the_right_of_way_is_a_strict_order(actions: list[tuple[str, str]]) -> None:
    """Never do two go before each other, and never do robots wait for each other in a circle."""
    time = Time()
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


def test_a_reserved_path_is_logged_once_and_again_when_it_is_released() -> None:
    """| what happened | news |
    | nothing | none |
    | claimed and announced | turn 1 and the way in steps of a quarter of a metre |
    | nothing since | none |
    | released | no way |"""
    made = table(Time(), "alice", "bob")
    assert list(made.news()) == []
    made.view_of("alice").claim()
    made.view_of("alice").announce(np.column_stack([np.linspace(0.0, 1.0, 101), np.zeros(101), np.zeros(101)]), DISCS)
    (told,) = made.news()
    assert (told["robot"], told["turn"], told["y"]) == ("alice", 1, [0.0] * 5)
    assert np.allclose(told["x"], [0.0, 0.25, 0.5, 0.75, 1.0], atol=0.011)
    assert list(made.news()) == []
    made.view_of("alice").release()
    assert list(made.news()) == [{"robot": "alice", "turn": None, "x": [], "y": []}]


def test_the_path_of_a_silent_robot_is_not_logged() -> None:
    """What is silent reserves nothing."""
    time = Time()
    made = table(time, "alice", "bob")
    made.view_of("alice").claim()
    assert len(list(made.news())) == 1
    time.now_s = SILENT_S + 0.1
    assert list(made.news()) == [{"robot": "alice", "turn": None, "x": [], "y": []}]


def test_an_idle_robot_yields_and_a_robot_with_a_claim_does_not() -> None:
    """| bob | alice, who claimed, sees him yield |
    | claims later | yes |
    | has nothing to do | yes |
    | works | no |
    | claimed first | no |"""
    made = table(Time(), "alice", "bob")
    made.view_of("alice").claim()
    assert not made.view_of("alice").others()[0].yields
    made.rest("bob", idle=True)
    assert made.view_of("alice").others()[0].yields
    made.rest("bob", idle=False)
    made.view_of("bob").claim()
    assert made.view_of("alice").others()[0].yields and not made.view_of("bob").others()[0].yields


def test_the_discs_of_the_others_lie_at_their_estimated_poses() -> None:
    """Bob's disc of 0.3 m about (2, 1), and a little more; nothing of Alice's own."""
    made = table(Time(), "alice", "bob")
    made.report("bob", Pose2D(2.0, 1.0, 1.0))
    covered = made.covered_W("alice")
    assert covered[:, :2].tolist() == [[2.0, 1.0]]
    assert 0.4 < covered[0, 2] < 0.7


def test_a_goal_is_reserved_until_it_is_given_back_or_the_robot_falls_silent() -> None:
    """As for a dock: the last pose of a way that was announced."""
    time = Time()
    made = table(time, "alice", "bob")
    for end in ("release", "silence"):
        made.view_of("alice").claim()
        made.view_of("alice").announce(WAY, DISCS)
        (seen,) = made.view_of("bob").others()
        assert seen.first and seen.path is not None and seen.path[-1].tolist() == WAY[-1].tolist()
        if end == "release":
            made.view_of("alice").release()
            assert made.view_of("bob").others()[0].path is None
        else:
            time.now_s += SILENT_S + 0.1
            assert made.view_of("bob").others() == ()
