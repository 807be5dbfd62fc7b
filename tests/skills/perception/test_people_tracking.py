"""Tracks of people by scans and pictures, and the watch that feeds them."""

import math
from dataclasses import replace

import numpy as np
import pytest
from planar_people import PeopleDetector, person_at
from planar_robot import Bench, Box, ExactPlace

from skills.perception.people import SeenPerson
from skills.perception.people_tracking import PeopleOptions, PeopleTracker, PeopleWatch, predicted_place_W
from skills.robot import Pose2D

START = Pose2D(1.5, 5.4, 0.0)


PERSON = person_at(3.5, 5.5)


def watched(*people, detector_changes=None, seconds=2.0, cameras=True):
    """Bench, detector and watch after some seconds."""
    bench = Bench(START, unmapped=people, cameras=cameras, component=ExactPlace())
    detector = PeopleDetector(bench, list(people), **(detector_changes or {}))
    watch = PeopleWatch(replace(bench.context(), detector=detector))
    look(bench, watch, seconds)
    return bench, detector, watch


def counts_for(bench, watch, seconds):
    """Asserts that a person counts for some seconds, and no longer 1.5 s later."""
    look(bench, watch, seconds)
    assert len(watch.people()) == 1
    look(bench, watch, 1.5)
    assert watch.people() == ()


def look(bench, watch, seconds):
    for _ in range(round(seconds / 0.05)):
        bench.tick()
        watch.step(np.zeros(3))


@pytest.mark.parametrize("distance_m", [1.5, 2.0, 3.0, 3.5])
def test_a_person_in_a_picture_is_located_in_the_world(distance_m):
    _, _, watch = watched(person_at(1.5 + distance_m, 5.5))
    (person,) = watch.people()
    assert person.place_W == pytest.approx((1.5 + distance_m, 5.5), abs=0.2)
    assert np.all(np.linalg.eigvalsh(person.covariance) > 0.0)


# what stands there that no map explains        looks in 4 s
@pytest.mark.parametrize(
    ("unmapped", "least", "most"),
    [
        ((), 0, 0),
        ((Box(4.0, 5.2, 4.3, 5.5, 0.0, 0.8),), 6, 9),
        ((Box(0.1, 5.2, 0.4, 5.5, 0.0, 0.8),), 0, 0),
    ],
    ids=["nothing", "something ahead", "something behind"],
)
def test_cameras_take_pictures_only_while_an_unexplained_obstacle_is_in_view(unmapped, least, most):
    bench = Bench(START, unmapped=unmapped, component=ExactPlace())
    detector = PeopleDetector(bench, [])
    look(bench, PeopleWatch(replace(bench.context(), detector=detector)), 4.0)
    assert set(detector.pictures) <= {2}
    assert least <= len(detector.pictures) <= most
    assert bench.worker.names.count("look for people") == len(detector.pictures)


def test_a_person_whom_scans_track_is_looked_at_every_second():
    bench, detector, watch = watched(PERSON)
    before = len(detector.pictures)
    look(bench, watch, 4.0)
    assert len(detector.pictures) - before == 4
    assert len(watch.people()) == 1


def test_a_person_whom_no_scan_tracks_is_looked_at_twice_a_second():
    bench, detector, watch = watched(PERSON)
    bench.robot.scan = lambda: None
    before = len(detector.pictures)
    look(bench, watch, 1.8)
    assert len(detector.pictures) - before >= 3


def test_a_person_counts_when_seen_twice_and_the_second_view_comes_soon():
    bench, _, watch = watched(PERSON, seconds=0.3)
    assert watch.people() == ()
    look(bench, watch, 0.4)
    assert len(watch.people()) == 1


def test_a_person_who_has_gone_is_forgotten():
    bench, _, watch = watched(PERSON)
    bench.robot.blocks.remove(PERSON)
    counts_for(bench, watch, 0.5)


@pytest.mark.parametrize(("stays", "remembered_s"), [(True, PeopleOptions().beside_s), (False, 2.0)])
def test_a_person_out_of_view_is_remembered_while_an_obstacle_is_there(stays, remembered_s):
    bench, _, watch = watched(PERSON)
    bench.robot.push(0.0, 0.0, math.pi)
    bench.robot.scan = lambda: None
    if not stays:
        bench.robot.blocks.remove(PERSON)
        bench.costmap.clear_obstacles()
    counts_for(bench, watch, remembered_s - 0.6)


def test_a_person_out_of_view_is_remembered_while_scans_show_them():
    bench, _, watch = watched(PERSON)
    bench.robot.push(0.0, 0.0, math.pi)
    look(bench, watch, PeopleOptions().beside_s + 1.0)
    assert len(watch.people()) == 1


@pytest.mark.parametrize("fault", ["old", "without depth"])
def test_a_picture_that_cannot_locate_people_does_not_count_as_a_miss(fault, monkeypatch):
    bench, detector, watch = watched(PERSON)
    take = bench.robot.image

    def spoiled(source):
        image = take(source)
        stamp_s, depth_m = image.stamp_s - 9.0 * (fault == "old"), image.depth_m * (fault == "old")
        return replace(image, stamp_s=stamp_s, depth_m=depth_m)

    monkeypatch.setattr(bench.robot, "image", spoiled)
    detector.people.clear()
    look(bench, watch, 6.0)
    assert watch.faults
    assert len(watch.people()) == 1


def test_people_are_published_and_also_when_none_is_left():
    bench, detector, watch = watched(person_at(3.5, 5.5))
    topic, message = bench.published[-1]
    assert topic == "people"
    assert message["people"][0]["position_W"] == pytest.approx([3.5, 5.5], abs=0.2)
    assert len(message["people"][0]["covariance"]) == 4
    bench.robot.blocks.remove(detector.people[0])
    look(bench, watch, 5.0)
    count = len(bench.published)
    assert bench.published[-1][1]["people"] == []
    look(bench, watch, 2.0)
    assert len(bench.published) == count


def test_faint_detections_do_not_count():
    _, detector, watch = watched(PERSON, detector_changes={"score": 0.4})
    assert watch.people() == ()
    assert detector.pictures


def test_a_detector_without_a_class_of_people_gets_no_pictures():
    bench, detector, watch = watched(PERSON, detector_changes={"class_names": ("cube",)})
    assert (watch.people(), detector.pictures, bench.robot.images_taken) == ((), [], 0)


def test_errors_of_the_detector_are_raised():
    class Broken(PeopleDetector):
        def detect(self, pictures):
            raise RuntimeError("the network is gone")

    bench = Bench(START, unmapped=[PERSON])
    watch = PeopleWatch(replace(bench.context(), detector=Broken(bench, [])))
    with pytest.raises(RuntimeError, match="the network is gone"):
        look(bench, watch, 1.0)


def test_without_a_detector_or_cameras_no_picture_is_taken():
    bench = Bench(START, unmapped=[PERSON])
    look(bench, PeopleWatch(bench.context()), 1.0)
    assert bench.robot.images_taken == 0
    _, detector, watch = watched(PERSON, cameras=False)
    assert (watch.people(), detector.pictures) == ((), [])


def seen(x, y, stamp_s):
    return SeenPerson((x, y), np.eye(2) * 0.01, 0.9, stamp_s, START)


def tracked(*looks, by_scan=False, apart_m=0.7):
    tracker = PeopleTracker()
    for people in looks:
        tracker.update(people, by_scan=by_scan, apart_m=apart_m)
    return tracker.people


def test_a_person_seen_again_keeps_the_number_and_is_near_the_newer_position():
    first, second = tracked([seen(1.0, 1.0, 0.0), seen(3.0, 1.0, 0.0)], [seen(1.3, 1.0, 0.5)])
    assert first.place_W == pytest.approx((1.3, 1.0), abs=0.05)
    assert (first.track, first.looks, second.looks) == (1, 2, 1)


def test_two_cameras_at_once_are_one_view():
    (one,) = tracked([seen(1.0, 1.0, 0.5)], [seen(1.1, 1.0, 0.5)])
    assert one.looks == 1


def test_a_person_elsewhere_is_another_person():
    assert len(tracked([seen(1.0, 1.0, 0.0)], [seen(2.0, 1.0, 0.5)])) == 2


def walking(speed_m_s, y_m=0.0, from_s=0.0, to_s=2.0, x_m=0.0):
    """One person in scans, 0.1 s apart."""
    times = np.arange(from_s, to_s, 0.1)
    return [[seen(x_m + speed_m_s * time, y_m, time)] for time in times]


def test_velocity_and_way_of_a_walking_person_are_estimated():
    (one,) = tracked(*walking(1.0), by_scan=True)
    assert one.velocity_W == pytest.approx((1.0, 0.0), abs=0.15)
    assert one.moved_m == pytest.approx(1.9, abs=0.15)
    assert predicted_place_W(one, 2.4) == pytest.approx((2.4, 0.0), abs=0.2)


def test_two_people_who_cross_keep_their_numbers():
    pairs = zip(walking(1.0, 0.2), walking(-1.0, -0.2, x_m=2.0), strict=True)
    a, b = tracked(*([*one, *other] for one, other in pairs), by_scan=True, apart_m=0.35)
    assert (a.velocity_W[0], b.velocity_W[0]) == pytest.approx((1.0, -1.0), abs=0.2)


def test_a_person_hidden_for_a_second_keeps_the_number():
    (one,) = tracked(*walking(1.0, to_s=1.5), *walking(1.0, from_s=2.5, to_s=3.0), by_scan=True)
    assert one.track == 1


def test_a_picture_that_comes_later_than_a_scan_counts_as_a_view():
    tracker = PeopleTracker()
    for stamp_s in (0.0, 0.2, 0.4):
        tracker.update([seen(1.0, 1.0, stamp_s + 0.2)], by_scan=True, apart_m=0.35)
        tracker.update([seen(1.0, 1.0, stamp_s)], by_scan=False, apart_m=0.7)
    (one,) = tracker.people
    assert (one.looks, one.scans) == (3, 3)


def test_scans_alone_track_people_where_the_options_say_so():
    bench = Bench(START, unmapped=[PERSON])
    watch = PeopleWatch(bench.context(), PeopleOptions(track_m=6.0))
    look(bench, watch, 1.0)
    (one,) = watch.tracks()
    assert one.place_W == pytest.approx((3.5, 5.5), abs=0.2)
    assert watch.people() == ()


def test_a_person_out_of_sight_is_tracked_for_a_while():
    bench = Bench(START, unmapped=[PERSON])
    watch = PeopleWatch(bench.context(), PeopleOptions(track_m=6.0))
    look(bench, watch, 1.0)
    bench.robot.blocks.remove(PERSON)
    look(bench, watch, PeopleOptions().hidden_s - 0.5)
    assert len(watch.tracks()) == 1
    look(bench, watch, 1.0)
    assert watch.tracks() == ()
