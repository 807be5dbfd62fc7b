"""People in analytic LiDAR scans."""

import math
from dataclasses import replace

import numpy as np
import pytest
from analytic_scan import scan_of
from planar_people import PeopleDetector, person_at
from planar_robot import Bench, Box
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix

from skills.perception.people import PeopleOptions, PeopleWatch, SeenPerson, add_person, cameras_towards, people_in_scan
from skills.robot import CameraCapabilities, Pose2D, Scan

OUTLINE = ((0.56, 0.25), (0.56, -0.25), (-0.5, -0.25), (-0.5, 0.25))


def people_seen(scan, X_WB=None):
    return people_in_scan(scan, X_WB or RigidTransform(), OUTLINE)


def test_a_person_is_found_at_their_position():
    (person,) = people_seen(scan_of([(1.8, 0.4, 0.2)]))
    assert person.place_W == pytest.approx((1.8, 0.4), abs=0.12)


def test_the_nearest_of_two_comes_first():
    people = people_seen(scan_of([(2.6, -1.0, 0.2), (1.6, 0.8, 0.2)]))
    assert [round(person.place_W[1], 1) > 0 for person in people] == [True, False]


def test_a_person_in_front_of_a_wall_is_found():
    people = people_seen(scan_of([(1.6, 0.0, 0.2)], wall_x=2.6))
    assert len(people) == 1


def test_a_wall_is_no_person():
    assert people_seen(scan_of(wall_x=2.0)) == []


def test_a_thin_post_is_no_person():
    assert people_seen(scan_of([(1.5, 0.0, 0.03)])) == []


def test_a_person_who_leans_on_a_wall_is_not_found():
    assert people_seen(scan_of([(2.4, 0.0, 0.2)], wall_x=2.5)) == []


def test_a_person_far_away_does_not_count():
    assert people_seen(scan_of([(5.0, 0.0, 0.2)])) == []


def test_the_held_object_is_no_person():
    assert people_seen(scan_of([(0.55, 0.0, 0.1)])) == []


def test_the_position_is_in_the_world_frame():
    (person,) = people_seen(scan_of([(1.8, 0.0, 0.2)]), Pose2D(5.0, 2.0, 1.5708).transform())
    assert person.place_W == pytest.approx((5.0, 3.8), abs=0.12)
    assert person.distance_m == pytest.approx(1.8, abs=0.12)


def test_a_pair_of_legs_is_a_person_for_a_lidar_of_one_ring():
    angles = np.linspace(-0.5, 0.5, 200)
    x, y = 1.5 * np.ones(200), 1.5 * np.tan(angles)
    legs = np.abs(np.abs(y) - 0.12) < 0.06
    ranges = np.where(legs, np.hypot(x, y), np.nan).astype(np.float32)[None, :]
    scan = Scan(0.0, ranges, np.zeros(1), angles, RigidTransform([0.0, 0.0, 0.3]), RigidTransform())
    (person,) = people_in_scan(scan, RigidTransform(), ((0.3, 0.3), (-0.3, -0.3)))
    assert person.place_W == pytest.approx((1.6, 0.0), abs=0.05)


START = Pose2D(1.5, 5.4, 0.0)
STILL = np.zeros(3)


def looking(heading_rad):
    """Level camera with a heading to the left of ahead."""
    ahead = RotationMatrix(RollPitchYaw(-math.pi / 2, 0.0, -math.pi / 2))
    return RigidTransform(RotationMatrix.MakeZRotation(heading_rad) @ ahead)


HEADINGS_RAD = {"frontleft": -0.58, "frontright": 0.58, "left": 1.57, "right": -1.57, "back": 3.14}
BODY = tuple(CameraCapabilities(name, looking(heading)) for name, heading in HEADINGS_RAD.items())


def watched(*people, detector_changes=None, seconds=2.0, cameras=True):
    """Bench, detector and watch after some seconds."""
    bench = Bench(START, unmapped=people, cameras=cameras)
    detector = PeopleDetector(bench, list(people), **(detector_changes or {}))
    watch = PeopleWatch(replace(bench.context(), detector=detector))
    look(bench, watch, seconds)
    return bench, detector, watch


def look(bench, watch, seconds):
    for _ in range(round(seconds / 0.05)):
        bench.tick()
        watch.step(STILL)


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
        ((), 2, 3),
        ((Box(4.0, 5.2, 4.3, 5.5, 0.0, 0.8),), 6, 9),
        ((Box(0.1, 5.2, 0.4, 5.5, 0.0, 0.8),), 2, 3),
    ],
    ids=["nothing", "something ahead", "something behind"],
)
def test_cameras_take_more_pictures_while_an_unexplained_obstacle_is_in_view(unmapped, least, most):
    bench = Bench(START, unmapped=unmapped)
    detector = PeopleDetector(bench, [])
    look(bench, PeopleWatch(replace(bench.context(), detector=detector)), 4.0)
    assert set(detector.pictures) == {2}
    assert least <= len(detector.pictures) <= most
    assert bench.worker.names.count("look for people") == len(detector.pictures)


def depths_asked_for(people, *, with_lidar):
    """Returns for each picture of some seconds whether it has depth."""
    bench, asked = Bench(START, unmapped=people), []
    take = bench.robot.image
    bench.robot.image = lambda source, **wanted: asked.append(wanted["depth"]) or take(source, **wanted)
    if not with_lidar:
        bench.robot.scan = lambda: None
    watch = PeopleWatch(replace(bench.context(), detector=PeopleDetector(bench, people)))
    look(bench, watch, 2.0)
    return asked, watch.people()


def test_depth_is_taken_only_where_a_person_may_be_near():
    asked, _ = depths_asked_for([], with_lidar=True)
    assert set(asked) == {False}
    asked, people = depths_asked_for([person_at(3.5, 5.5)], with_lidar=True)
    assert (asked[-1], len(people)) == (True, 1)


def test_a_person_in_a_picture_without_depth_is_viewed_with_depth_at_once():
    asked, people = depths_asked_for([person_at(3.5, 5.5)], with_lidar=False)
    assert asked[:4] == [False, False, True, True]
    assert len(people) == 1


def test_a_person_counts_when_seen_twice_and_the_second_view_comes_soon():
    bench, _, watch = watched(person_at(3.5, 5.5), seconds=0.3)
    assert watch.people() == ()
    look(bench, watch, 0.4)
    assert len(watch.people()) == 1


def test_a_person_who_has_gone_is_forgotten():
    bench, detector, watch = watched(person_at(3.5, 5.5))
    bench.robot.boxes.remove(detector.people[0])
    look(bench, watch, 0.5)
    assert len(watch.people()) == 1
    look(bench, watch, 1.5)
    assert watch.people() == ()


@pytest.mark.parametrize(("stays", "remembered_s"), [(True, PeopleOptions().beside_s), (False, 2.0)])
def test_a_person_out_of_view_is_remembered_while_an_obstacle_is_there(stays, remembered_s):
    bench, detector, watch = watched(person_at(3.5, 5.5))
    bench.robot.push(0.0, 0.0, math.pi)
    if not stays:
        bench.robot.boxes.remove(detector.people[0])
        bench.costmap.clear_obstacles()
    look(bench, watch, remembered_s - 0.6)
    assert len(watch.people()) == 1
    look(bench, watch, 1.5)
    assert watch.people() == ()


def test_people_are_published_and_also_when_none_is_left():
    bench, detector, watch = watched(person_at(3.5, 5.5))
    topic, message = bench.published[-1]
    assert topic == "people"
    assert message["people"][0]["position_W"] == pytest.approx([3.5, 5.5], abs=0.2)
    assert len(message["people"][0]["covariance"]) == 4
    bench.robot.boxes.remove(detector.people[0])
    look(bench, watch, 5.0)
    count = len(bench.published)
    assert bench.published[-1][1]["people"] == []
    look(bench, watch, 2.0)
    assert len(bench.published) == count


def test_faint_detections_do_not_count():
    _, _, watch = watched(person_at(3.5, 5.5), detector_changes={"score": 0.4})
    assert watch.people() == ()


def test_a_detector_without_a_class_of_people_gets_no_pictures():
    bench, detector, watch = watched(person_at(3.5, 5.5), detector_changes={"class_names": ("cube",)})
    assert (watch.people(), detector.pictures, bench.robot.images_taken) == ((), [], 0)


def test_without_a_detector_or_cameras_no_picture_is_taken():
    bench = Bench(START, unmapped=[person_at(3.5, 5.5)])
    look(bench, PeopleWatch(bench.context()), 1.0)
    assert bench.robot.images_taken == 0
    _, detector, watch = watched(person_at(3.5, 5.5), cameras=False)
    assert (watch.people(), detector.pictures) == ((), [])


def test_errors_of_the_detector_are_raised():
    bench = Bench(START)

    class Broken(PeopleDetector):
        def detect(self, pictures):
            raise RuntimeError("the network is gone")

    watch = PeopleWatch(replace(bench.context(), detector=Broken(bench, [])))
    with pytest.raises(RuntimeError, match="the network is gone"):
        look(bench, watch, 1.0)


@pytest.mark.parametrize(
    ("velocity", "expected"),
    [
        ((0.0, 0.0, 0.0), ("frontleft", "frontright")),
        ((0.5, 0.1, 0.0), ("frontleft", "frontright")),
        ((0.0, 0.0, 0.9), ("frontleft", "frontright")),
        ((-0.3, 0.1, 0.0), ("back",)),
        ((0.1, 0.3, 0.0), ("left",)),
        ((-0.1, -0.3, 0.0), ("right",)),
    ],
)
def test_cameras_face_the_direction_of_motion(velocity, expected):
    assert tuple(camera.source for camera in cameras_towards(np.array(velocity), BODY)) == expected


def test_missing_cameras_are_not_used():
    assert cameras_towards(np.array([-0.3, 0.0, 0.0]), BODY[:1]) == ()


def seen(x, y, stamp_s, looks=1):
    return SeenPerson((x, y), np.eye(2) * 0.01, 0.9, stamp_s, START, looks)


def test_a_person_seen_again_is_the_same_at_the_newer_position():
    known = (seen(1.0, 1.0, 0.0), seen(3.0, 1.0, 0.0))
    first, second = add_person(known, seen(1.3, 1.0, 0.5), 0.7)
    assert (first.place_W, first.looks) == ((1.3, 1.0), 2)
    assert second is known[1]


def test_two_cameras_at_once_are_one_view():
    (one,) = add_person((seen(1.0, 1.0, 0.5),), seen(1.1, 1.0, 0.5), 0.7)
    assert one.looks == 1


def test_a_person_elsewhere_is_another_person():
    assert len(add_person((seen(1.0, 1.0, 0.0),), seen(2.0, 1.0, 0.5), 0.7)) == 2
