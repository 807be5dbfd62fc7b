from dataclasses import FrozenInstanceError, replace

import numpy as np
import pytest
from made_detections import detected_3d

from skills.perception.tracker import Tracker


def tracker_of(*pictures, in_view=True):
    """Tracker after some pictures, each a list of detections."""
    tracker = Tracker(("beer", "coke", "hammer"))
    for seen in pictures:
        tracker.update(seen, lambda track: in_view)
    return tracker


LEFT, RIGHT = (0.0, 0.1, 1.0), (0.0, -0.1, 1.0)


@pytest.mark.parametrize(
    ("second", "views", "confirmed"), [(detected_3d(1.01, eye=RIGHT), 2, True), (detected_3d(eye=LEFT), 1, False)]
)
def test_two_views_confirm_a_track_only_from_different_viewpoints(second, views, confirmed):
    (track,) = tracker_of([detected_3d(eye=LEFT)], [second]).snapshot()
    assert (track.views, track.class_name, track.is_confirmed()) == (views, "coke", confirmed)


def test_positions_are_fused_by_their_covariances():
    (track,) = tracker_of([detected_3d(1.00, sigma=0.01)], [detected_3d(1.04, sigma=0.03)]).snapshot()
    assert 1.0 < track.position_W[0] < 1.015
    assert track.covariance[0, 0] < 0.01**2 + 0.012**2


def test_more_views_reduce_the_covariance():
    sigmas = [tracker_of(*[[detected_3d()]] * count).snapshot()[0].covariance.trace() for count in (1, 2, 4, 8)]
    assert sigmas == sorted(sigmas, reverse=True)


def test_the_error_of_fused_positions_agrees_with_the_covariance():
    rng = np.random.default_rng(5)
    errors = []
    for _ in range(300):
        seen = [[detected_3d(1.0 + rng.normal(0, 0.02), rng.normal(0, 0.02), sigma=0.02)] for _ in range(4)]
        (track, *_) = tracker_of(*seen).snapshot()
        off = track.position_W[:2] - [1.0, 0.0]
        errors.append(off @ np.linalg.solve(track.covariance[:2, :2], off))
    assert 0.8 < np.mean(errors) < 2.2  # two for two dimensions, less for the jitter that is allowed for


SURE = [[detected_3d()]] * 3
CLOSE = [detected_3d(1.0), detected_3d(1.03)]


@pytest.mark.parametrize(
    ("pictures", "count"),
    [
        ([[detected_3d(1.0)], [detected_3d(1.3)]], 2),
        ([CLOSE, CLOSE], 2),
        ([*SURE, [detected_3d(1.04, name="hammer")]], 2),
        ([*SURE, [detected_3d(1.005, name="hammer")]], 1),
    ],
    ids=["far", "in one picture", "another class", "another class at the same position"],
)
def test_a_far_or_different_detection_begins_another_track(pictures, count):
    assert len(tracker_of(*pictures).snapshot()) == count


@pytest.mark.parametrize(
    "pictures",
    [[[], []], [[detected_3d(score=0.45)]], [[detected_3d(score=0.9)], [], [], []]],
    ids=["no detection", "a faint detection", "a detection that is missed in three pictures"],
)
def test_without_a_lasting_detection_there_is_no_track(pictures):
    assert tracker_of(*pictures).snapshot() == ()


def test_an_object_detected_as_two_classes_is_the_better_one():
    both = [detected_3d(name="beer", score=0.55), detected_3d(1.01, name="coke", score=0.8)]
    (track,) = tracker_of(both, both).snapshot()
    assert track.class_name == "coke"


def test_the_class_follows_the_scores_of_all_views():
    seen = detected_3d(score=0.55, name="beer"), detected_3d(score=0.9, eye=LEFT), detected_3d(score=0.9, eye=RIGHT)
    (track,) = tracker_of(*([each] for each in seen)).snapshot()
    assert track.class_name == "coke"
    assert track.class_belief > 0.8


def test_a_picture_from_the_same_place_is_no_new_evidence_of_the_class():
    once, twice = (tracker_of(*[[detected_3d(score=0.6)]] * count).snapshot()[0].class_belief for count in (1, 2))
    assert once == twice


def test_a_missed_track_loses_belief():
    # odds 9 of a score of 0.9, times 0.15 / 0.88 for each picture that should show it
    beliefs = [t.belief for n in range(3) for t in tracker_of([detected_3d(score=0.9)], *[[]] * n).snapshot()]
    assert beliefs == pytest.approx([0.9, 0.605, 0.207], abs=0.001)


def test_belief_never_reaches_certainty():
    surest, missed = (tracker_of(*[[detected_3d(score=0.97)]] * 40, *[[]] * n).snapshot()[0].belief for n in (0, 2))
    assert (surest, missed < 0.97) == (0.999, True)


@pytest.mark.parametrize("score", [0.5, 0.7, 0.9])
def test_the_belief_of_a_new_track_is_its_score(score):
    assert tracker_of([detected_3d(score=score)]).snapshot()[0].belief == pytest.approx(score)


def test_a_track_out_of_view_keeps_its_belief():
    (track,) = tracker_of([detected_3d()], [], [], in_view=False).snapshot()
    assert (track.belief, track.missed) == (0.9, 0)


def test_a_track_that_was_confirmed_and_then_missed_is_no_longer_confirmed():
    seen = [[detected_3d(eye=LEFT)], [detected_3d(eye=RIGHT)]]
    assert tracker_of(*seen).snapshot()[0].is_confirmed()
    assert not tracker_of(*seen, [], []).snapshot()[0].is_confirmed()


def test_a_track_seen_as_another_class_stays_confirmed_while_its_class_is_likely():
    # twice surely a beer, then twice a coke
    seen = [[detected_3d(name="beer", eye=LEFT)], [detected_3d(name="beer", eye=RIGHT)]]
    doubts = [[detected_3d(name="coke", score=0.6, eye=(0.0, y_m, 1.0))] for y_m in (0.3, -0.3)]
    for count, confirmed in ((0, True), (2, False)):
        (track,) = tracker_of(*seen, *doubts[:count]).snapshot()
        assert track.is_confirmed() is confirmed, count


def test_a_segment_of_a_cluster_begins_a_track_that_another_label_joins():
    # the edge of the first picture cuts the object off: its middle is 8 cm higher than that of the segment
    cut_off = replace(detected_3d(name="coke", score=0.8, eye=LEFT), position_W=np.array([1.0, 0.02, 0.88]))
    segment = replace(detected_3d(name="thing", score=0.7, eye=RIGHT), is_segmented=True)
    (track,) = tracker_of([segment], [cut_off]).snapshot()
    assert (track.views, track.missed, track.class_name) == (2, 0, "coke")


def test_a_track_has_its_latest_and_its_best_detection():
    (track,) = tracker_of([detected_3d(score=0.95, stamp=1.0)], [detected_3d(score=0.7, stamp=2.0)]).snapshot()
    assert (track.last_seen_s, track.best.stamp_s) == (2.0, 1.0)


def test_a_label_keeps_its_size_when_a_segment_is_seen_after_it():
    labelled = detected_3d(name="coke", eye=LEFT, stamp=1.0)
    (track,) = tracker_of([labelled], [detected_3d(name="thing", score=0.7, eye=RIGHT, stamp=2.0)]).snapshot()
    assert (track.latest.class_name, track.last_seen_s) == ("coke", 2.0)


def test_a_snapshot_does_not_change_afterwards():
    tracker = tracker_of([detected_3d()])
    before = tracker.snapshot()
    tracker.update([detected_3d(1.01)], lambda track: True)
    assert before[0].position_W[0] == 1.0
    with pytest.raises(FrozenInstanceError):
        before[0].belief = 1.0


# odds: s / (1 - s) of the first score, times the root of the odds of the second over those of 0.25
@pytest.mark.parametrize(
    ("scores", "belief", "confirmed"),
    [((0.5, 0.3), 0.53, False), ((0.5, 0.4), 0.59, False), ((0.6, 0.4), 0.68, False), ((0.9, 0.6), 0.95, True)],
)
def test_a_faint_detection_supports_a_track_a_little(scores, belief, confirmed):
    pictures = [[detected_3d(score=score, eye=(0.0, 0.1 * k, 1.0))] for k, score in enumerate(scores)]
    (track,) = tracker_of(*pictures).snapshot()
    assert track.belief == pytest.approx(belief, abs=0.005)
    assert (track.views, track.is_confirmed()) == (len(scores), confirmed)


@pytest.mark.parametrize("name", ["coke", "beer"])
def test_a_faint_detection_only_renews_the_time_of_the_track(name):
    seen = [detected_3d(score=0.8, stamp=1.0)], [detected_3d(name=name, score=0.4, stamp=2.0)]
    (track,) = tracker_of(*seen).snapshot()
    assert (track.last_seen_s, track.missed) == (2.0, 0)
    assert (track.latest.class_name, track.latest.detection.score) == ("coke", 0.8)


def test_a_faint_detection_takes_no_track_from_a_sure_one():
    seen = [detected_3d(score=0.8)], [detected_3d(1.0, score=0.4), detected_3d(1.02, score=0.7)]
    (track,) = tracker_of(*seen).snapshot()
    assert track.latest.detection.score == 0.7


def test_the_order_of_the_detections_of_a_picture_does_not_matter():
    both = [detected_3d(1.0), detected_3d(1.2)]
    places = [sorted(t.position_W[0] for t in tracker_of(both, seen).snapshot()) for seen in (both, both[::-1])]
    assert places[0] == pytest.approx(places[1])


# pictures, one after the other      class     confirmed   something stands there
@pytest.mark.parametrize(
    ("names", "class_name", "confirmed"),
    [
        (("thing", "thing"), "thing", False),
        (("coke", "thing"), "coke", False),
        (("thing", "coke"), "coke", False),
        (("coke", "beer"), "beer", False),
    ],
)
def test_a_segment_shows_that_something_is_there_and_no_class(names, class_name, confirmed):
    scores = [0.7 if name == "thing" else 0.9 for name in names]
    first, second = (detected_3d(name=n, score=s, eye=e) for n, s, e in zip(names, scores, (LEFT, RIGHT), strict=True))
    (track,) = tracker_of([first], [second]).snapshot()
    assert (track.class_name, track.is_confirmed(), track.exists()) == (class_name, confirmed, True)
