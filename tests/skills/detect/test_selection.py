"""Objects that may be what is sought although nothing recognises them."""

from dataclasses import replace

import pytest
from made_detections import detected_3d
from table_scene import TABLE

from skills.detect.selection import DetectInputs, doubtful_tracks
from skills.perception.tracker import Tracker
from skills.relations import Landmark, Relation, RelationKind

COKES = DetectInputs(("coke",), (TABLE,))


def tracks_of(*, size_m=(0.07, 0.07, 0.12), surface="table", shape=None, views=1, **seen):
    tracker = Tracker(("coke", "beer", "hammer", "wrench", "cube"))
    more = {"size_m": size_m, "surface": surface, "shape": shape, "is_segmented": True}
    for k in range(views):
        tracks = tracker.update([replace(detected_3d(eye=(0.0, 0.1 * k, 1.0), **seen), **more)], lambda track: True)
    return tracks


UNKNOWN = {"name": "thing", "score": 0.7}


@pytest.mark.parametrize(
    ("seen", "is_doubtful"),
    [
        (UNKNOWN, True),
        (UNKNOWN | {"surface": "shelf"}, False),
        (UNKNOWN | {"size_m": (0.5, 0.4, 0.02)}, False),
        (UNKNOWN | {"shape": {"coke": 0.02, "thing": 2.0}}, False),
        (UNKNOWN | {"shape": {"coke": 4.0, "thing": 0.3}, "views": 4}, True),
        (UNKNOWN | {"views": 6}, True),
        (UNKNOWN | {"shape": {"coke": 1.0, "thing": 1.0}, "views": 6}, False),
        ({"name": "coke", "score": 0.6}, True),
        ({"name": "beer", "score": 0.6, "alternatives": (("coke", 0.4),)}, True),
        ({"name": "beer", "score": 0.95}, False),
    ],
    ids=[
        "unknown",
        "elsewhere",
        "of another size",
        "of another shape",
        "of its shape in four views",
        "unknown in six views, of unknown shape",
        "unknown in six views, of any shape",
        "a coke in one view",
        "a beer or a coke",
        "a beer",
    ],
)
def test_an_object_is_in_doubt_while_it_may_be_what_is_sought(seen, is_doubtful):
    assert bool(doubtful_tracks(tracks_of(**seen), COKES)) is is_doubtful


def test_a_part_of_a_larger_object_is_in_no_doubt():
    (part,) = tracks_of(**UNKNOWN, size_m=(0.05, 0.04, 0.1))
    (box,) = tracks_of(**UNKNOWN, size_m=(0.4, 0.3, 0.1))
    beside = replace(part, number=2, position_W=box.position_W + [0.3, 0.0, 0.0])
    within = replace(part, number=3, position_W=box.position_W + [0.15, 0.1, 0.0])
    on_it = replace(within, number=4, latest=replace(part.latest, size_m=(0.07, 0.07, 0.14)))
    later = replace(within, number=5, latest=replace(part.latest, stamp_s=part.latest.stamp_s + 1.0))
    left = doubtful_tracks([box, beside, within, on_it, later], COKES)
    assert {track.number for track in left} == {2, 4, 5}


def test_an_object_without_the_attribute_is_in_no_doubt():
    tracks = tracks_of(**UNKNOWN)
    assert doubtful_tracks(tracks, replace(COKES, attributes=("red",))) == []
    assert doubtful_tracks(tracks, replace(COKES, attributes=("big",))) != []


def test_a_faint_score_of_another_class_explains_nothing():
    shape = {"hammer": 5.0, "coke": 6.0, "thing": 0.3}
    assert doubtful_tracks(tracks_of(name="hammer", score=0.31, shape=shape), COKES) != []


def test_a_landmark_is_in_doubt_only_where_a_wanted_object_may_be():
    beside = (Relation(RelationKind.NEXT_TO, (Landmark("hammer", classes=("hammer",)),)),)
    pipe = {"size_m": (0.3, 0.05, 0.03), "shape": {"coke": 0.02, "hammer": 6.0, "thing": 0.3}}
    assert doubtful_tracks(tracks_of(**UNKNOWN, **pipe), replace(COKES, relations=beside)) == []


def test_the_likeliest_comes_first():
    likely = tracks_of(name="coke", score=0.45)
    (other,) = tracks_of(**UNKNOWN, shape={"coke": 1.0, "thing": 1.0})
    left = doubtful_tracks([replace(other, number=2), *likely], COKES)
    assert [track.number for track in left] == [1, 2]
