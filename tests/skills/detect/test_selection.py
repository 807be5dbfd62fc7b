"""Clusters worth a closer view."""

from dataclasses import replace

import numpy as np
from made_detections import detected_3d
from pydrake.math import RigidTransform
from table_scene import BLUE, COKE, GREY, TABLE, Can, scene

from skills.detect.selection import unlabelled_clusters
from skills.perception.surface_segmentation import segment_surface
from skills.perception.tracker import Tracker

BOX = Can(1.1, 0.25, 0.06, 0.10, GREY)


def clusters(*things):
    return segment_surface(scene(things), RigidTransform(), TABLE).clusters


def track_at(x, y, **seen):
    tracker = Tracker(("coke", "beer", "hammer", "wrench", "cube"))
    return tracker.update([replace(detected_3d(**seen), position_W=np.array([x, y, 0.8]))], lambda track: True)


def test_clusters_with_a_track_are_not_unlabelled():
    left = unlabelled_clusters(clusters(COKE, BOX), track_at(COKE.x, COKE.y), ("coke",))
    assert [round(one.shape.centre[1], 1) for one in left] == [0.2]


def test_an_empty_table_has_no_unlabelled_clusters():
    assert unlabelled_clusters(clusters(), (), ("coke",)) == []


def test_cluster_with_a_track_that_may_be_wanted_stays_unlabelled():
    # what it was taken for, and how many clusters are left of the one that stands there
    rows = [("coke", (), 0), ("beer", (("coke", 0.4),), 1), ("beer", (("hammer", 0.4),), 0), ("beer", (), 0)]
    for name, alternatives, expected in rows:
        tracks = track_at(COKE.x, COKE.y, name=name, score=0.76, alternatives=alternatives)
        assert len(unlabelled_clusters(clusters(COKE), tracks, ("coke",))) == expected, (name, alternatives)


def test_clusters_too_large_or_small_for_the_class_are_ignored():
    tall = Can(1.1, 0.25, 0.06, 0.39, BLUE)
    assert len(unlabelled_clusters(clusters(COKE, tall), (), ("person",))) == 1
    assert len(unlabelled_clusters(clusters(COKE, tall), (), ("person", "coke"))) == 2


def test_a_place_that_was_seen_twice_counts_once():
    assert len(unlabelled_clusters([*clusters(COKE), *clusters(COKE)], (), ("coke",))) == 1
