"""The followed person among the tracks of all people."""

import math

import numpy as np
import pytest

from errand_people.followed_person import Target, TargetOptions, is_addressed
from skills.perception.people import SeenPerson
from skills.robot import Pose2D

HERE = Pose2D(0.0, 0.0, 0.0)


def track(number, x, stamp_s, y=0.0, speed_m_s=1.0):
    return SeenPerson((x, y), np.eye(2) * 0.01, 1.0, stamp_s, HERE, track=number, velocity_W=(speed_m_s, 0.0), scans=9)


def walked(seconds=2.0, others=()):
    target = Target(track(1, 2.0, 0.0), HERE, TargetOptions())
    for stamp_s in np.arange(0.1, seconds + 0.05, 0.1):
        target.update([track(1, 2.0 + stamp_s, stamp_s), *others], (), stamp_s)
    return target


def test_the_trail_leads_from_the_robot_to_the_person():
    trail = walked().trail
    assert trail[0] == pytest.approx((0.0, 0.0)) and trail[-1] == pytest.approx((4.0, 0.0), abs=0.11)


def test_a_person_who_comes_back_takes_the_loop_off_the_trail():
    target = walked()
    for n in range(1, 16):
        target.update([track(1, 4.0 - 0.1 * n, 2.0 + 0.1 * n, speed_m_s=-1.0)], (), 2.0 + 0.1 * n)
    assert target.trail[:, 0].max() < 3.3


def test_a_person_seen_again_far_from_the_trail_begins_a_new_one():
    target = walked()
    target.farthest_m = 20.0
    target.update([track(7, 9.0, 8.0, y=3.0)], (), 8.0)
    assert target.trail.tolist() == [[0.0, 0.0], [9.0, 3.0]]


# Predicted at x = 5.4 at 3.4 s -> track that is followed, and how long it has been hidden
@pytest.mark.parametrize(
    ("seen", "others", "number", "hidden"),
    [
        (track(7, 5.4, 3.4), (), 7, False),
        (track(7, 9.0, 3.0), (), 1, True),
        (track(2, 4.6, 3.4, y=0.2), [track(2, 4.5, 2.0, y=0.8)], 1, True),
    ],
    ids=["near the prediction", "too far away", "seen beside the person before"],
)
def test_a_new_track_is_the_person_again_only_near_the_prediction(seen, others, number, hidden):
    target = walked(others=others)
    target.update([seen], (), seen.stamp_s)
    assert (target.seen.track, target.hidden_s(3.4) > 1.0) == (number, hidden)
    assert hidden or target.hidden_s(3.4) == 0.0


def test_on_a_search_somebody_far_away_may_be_the_person():
    target = walked()
    target.update([track(7, 10.0, 12.0)], (), 12.0)
    assert target.seen.track == 1
    target.farthest_m = 20.0
    target.update([track(7, 10.0, 12.1)], (), 12.1)
    assert target.seen.track == 7


def test_a_person_stands_still_after_five_seconds_in_one_place():
    target = walked()
    for n in range(1, 52):
        target.update([track(1, 4.0, 2.0 + 0.1 * n, speed_m_s=0.0)], (), 2.0 + 0.1 * n)
        assert target.stands_still(2.0 + 0.1 * n) == (n >= 46)


def test_the_time_that_a_person_has_stood_begins_anew_when_they_are_trusted():
    target = walked()
    for n in range(1, 152):
        target.update([track(1, 4.0, 2.0 + 0.1 * n, speed_m_s=0.0)], (), 2.0 + 0.1 * n)
    assert target.standing_s(17.1) == pytest.approx(10.6, abs=0.2)
    target.trust()
    assert target.standing_s(17.1) == pytest.approx(0.0, abs=0.2)


# Tracks at 3.4 s, at 3.5 s after the person of the first was rejected -> who is followed then
@pytest.mark.parametrize(
    ("first", "then", "number"),
    [
        ([track(7, 5.4, 3.4)], [track(7, 5.5, 3.5)], 0),
        ([track(7, 5.4, 3.4), track(8, 5.4, 3.4, y=2.0)], [track(7, 5.5, 3.5), track(8, 5.5, 3.5, y=1.5)], 8),
        ([track(7, 5.4, 3.4)], [track(9, 5.4, 3.5, speed_m_s=0.0)], 0),
        ([track(7, 5.4, 3.4)], [track(9, 5.4, 3.5, speed_m_s=0.5)], 9),
    ],
    ids=["the rejected one", "seen beside", "stands where the rejected one was", "walks there"],
)
def test_somebody_rejected_is_not_taken_for_the_person_again(first, then, number):
    target = walked()
    before = target.seen
    target.update(first, (), 3.4)
    target.reject(before)
    target.update(then, (), 3.5)
    assert target.seen.track == number
    assert number or target.seen.place_W == before.place_W


def test_a_person_is_not_doubted_after_a_short_gap():
    target = walked()
    target.update([track(7, 2.9 + 2.0, 2.9)], (), 2.9)
    assert target.seen.track == 7 and target.doubted is None


def test_a_person_is_doubted_after_a_long_gap_or_a_close_crossing_until_trusted():
    target, before = walked(), walked().seen
    target.update([track(7, 5.4, 3.4)], (), 3.4)
    assert target.doubted.track == before.track
    target.trust()
    assert target.doubted is None
    other = track(2, 5.5, 3.5, y=0.5)
    target.update([track(7, 5.5, 3.5), other], (other,), 3.5)
    assert target.doubted.track == 7


@pytest.mark.parametrize(("x", "doubted"), [(5.4, False), (3.0, True)])
def test_a_track_goes_on_without_doubt_only_where_the_person_was_expected(x, doubted):
    # last seen at 4.0 m with 1 m/s, 1.4 s before
    target = walked()
    target.update([track(1, x, 3.4)], (), 3.4)
    assert target.seen.stamp_s == 3.4 and (target.doubted is not None) is doubted


AHEAD, BEHIND, FAR = (3.0, 0.0), (-1.0, 0.0), (5.0, 0.0)


# Places of people, the first is asked, who stands still or is in sight -> whether that person is addressed
@pytest.mark.parametrize(
    ("places", "still", "in_sight", "addressed"),
    [
        ((AHEAD, FAR), False, False, True),
        ((FAR, AHEAD), True, True, False),
        ((AHEAD, BEHIND), True, True, True),
        ((AHEAD, BEHIND), True, False, False),
        ((AHEAD, BEHIND), False, True, False),
        ((BEHIND,), True, False, True),
        ((BEHIND,), False, False, False),
        ((BEHIND, AHEAD), True, True, False),
    ],
)
def test_a_person_is_asked_only_where_nobody_else_answers(places, still, in_sight, addressed):
    people = [SeenPerson(place, np.eye(2), 1.0, 0.0, HERE) for place in places]
    near = sorted(people, key=lambda one: math.hypot(*one.place_W))
    assert is_addressed(people[0], near, HERE, still=still, in_sight=in_sight) is addressed


def test_the_longest_loss_counts_the_time_with_somebody_rejected():
    target = walked()
    before = target.seen
    target.update([track(7, 4.2, 3.0)], (), 3.0)
    target.update([track(7, 4.2, 9.0)], (), 9.0)
    assert target.longest_loss_s == pytest.approx(6.0)
    target.reject(before)
    target.update([track(8, 4.2, 15.0)], (), 15.0)
    target.update([track(8, 4.2, 15.1)], (), 15.1)
    assert target.longest_loss_s == pytest.approx(13.0)
