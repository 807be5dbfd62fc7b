"""Which objects a log is sure of: each once, those that the search itself would count."""

import pytest

from executive.record.history import Event, seen_objects


def look_for(robot="Alice"):
    return Event("object_to_detect", 0.0, {"robot_name": robot, "class_name": ["hammer"]})


def tracks(*found, robot="Alice", t=1.0):
    told = [
        {
            "number": number,
            "class_name": name,
            "confirmed": sure,
            "belief": 0.9,
            "surface": surface,
            "position_W": list(place),
            "last_seen_s": t,
        }
        for number, name, sure, surface, place in found
    ]
    return Event("tracks", t, {"robot_name": robot, "tracks": told})


HERE, BESIDE, THERE = (1.0, 2.0, 0.8), (1.05, 2.0, 0.8), (3.0, 2.0, 0.8)


def names(*events):
    return [(seen.kind.name, seen.surface) for seen in seen_objects(events)]


def test_a_track_counts_when_it_is_confirmed():
    seen = (1, "coke", True, "table", HERE), (2, "beer", False, "table", THERE)
    assert names(look_for(), tracks(*seen)) == [("coke", "table")]


def test_an_object_that_a_later_view_denies_does_not_count():
    first = tracks((1, "coke", True, "table", HERE))
    assert names(look_for(), first, tracks((1, "coke", False, "table", HERE))) == []


@pytest.mark.parametrize(("place", "count"), [(BESIDE, 1), (THERE, 2)])
def test_an_object_that_two_searches_saw_counts_once(place, count):
    first, second = tracks((1, "coke", True, "table", HERE)), tracks((1, "coke", True, "table", place))
    assert len(names(look_for(), first, look_for(), second)) == count


def test_an_object_without_a_class_is_left_out():
    assert names(look_for(), tracks((1, "thing", True, "", HERE))) == []


def test_robots_that_search_at_the_same_time_are_kept_apart():
    one, other = tracks((1, "coke", True, "table", HERE)), tracks((1, "beer", True, "", THERE), robot="Bob")
    events = look_for(), look_for("Bob"), one, other
    assert names(*events) == [("coke", "table"), ("beer", None)]
