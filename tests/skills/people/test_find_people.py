"""The find_people skill: turns and observations."""

import math
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from planar_people import PeopleDetector, person_at
from planar_robot import LENS, TWO_ROOMS, Bench, Box

from skills.api import Cause, Failed, ObjectKind, ObjectObservation, Succeeded
from skills.people import find_people
from skills.people.find_people import FindPeople, FindPeopleInputs, FindPeopleOptions
from skills.robot import Pose2D

ROOM = tuple((x, y) for x, y in ((0.2, 0.2), (4.8, 0.2), (4.8, 3.8), (0.2, 3.8)))


CORRIDOR = (Box(-4.0, -0.1, 4.0, 0.0), Box(-4.0, 1.2, 4.0, 1.3), Box(-4.1, -0.1, -4.0, 1.3), Box(4.0, -0.1, 4.1, 1.3))
BODY = Box(2.8, 1.8, 3.2, 2.2)
"""A body 0.4 m wide at (3.0, 2.0)."""


def bench_in_room(*unmapped, start=Pose2D(1.5, 2.0, 0.0), surveyed=TWO_ROOMS, cameras=False):  # noqa: B008
    return Bench(start, unmapped=unmapped, surveyed=surveyed, cameras=cameras)


def ended(bench, detector=None, **inputs):
    """Runs the skill in the room; returns its last step."""
    bench.tick(10)
    context = bench.context() if detector is None else replace(bench.context(), detector=detector)
    return bench.run(FindPeople(context), FindPeopleInputs(**{"area_W": ROOM, "place": "room", **inputs}))


def lit_bench(monkeypatch, person):
    """Bench with cameras, whose pictures are not dark."""
    bench = bench_in_room(person, cameras=True)
    take = bench.robot.image
    lit = lambda source, **how: replace(take(source, **how), grey=np.full((LENS.height, LENS.width), 120, np.uint8))  # noqa: E731
    monkeypatch.setattr(bench.robot, "image", lit)
    return bench


def test_in_a_narrow_corridor_the_robot_turns_no_further_than_is_clear():
    bench = bench_in_room(start=Pose2D(0.0, 0.6, 0.0), surveyed=CORRIDOR)
    step = ended(bench, area_W=((-3.9, 0.1), (3.9, 0.1), (3.9, 1.1), (-3.9, 1.1)), place="corridor")
    assert "nobody is seen in the corridor from here" in step.message
    assert abs(bench.robot.pose.yaw_rad) < 0.9  # 1.1 m long and 0.5 m wide, it would touch the walls at about 1.2


def test_the_observation_is_at_the_persons_position():
    step = ended(bench_in_room(BODY))
    assert isinstance(step, Succeeded)
    assert math.dist(step.outputs["observation"].position_W[:2], (3.0, 2.0)) < 0.3


def test_people_near_avoided_positions_do_not_count():
    known = ObjectObservation(0.0, ObjectKind("person"), (3.3, 2.2, 0.8), (0.5, 0.5, 1.7), 0.0, 1.0, "room")
    assert ended(bench_in_room(BODY), avoid=(known,)).message == "nobody else is seen in the room from here"


def test_the_pictures_with_a_person_are_published_with_their_boxes(monkeypatch):
    # a person 2 m ahead in the room; the first look has both cameras' pictures
    person = person_at(3.5, 2.0)
    bench = lit_bench(monkeypatch, person)
    ended(bench, PeopleDetector(bench, [person]))
    shown = [message for topic, message in bench.published if topic == "detections"]
    assert all(message["detections"][0]["class_name"] == "person" for message in shown)
    assert shown


@pytest.mark.parametrize(("unpictured", "kind"), [(False, Failed), (True, Succeeded)])
def test_a_body_that_no_picture_shows_counts_only_where_that_is_asked_for(unpictured, kind, monkeypatch):
    # a body 1.5 m ahead, as wide as a person, for whom the detector sees nobody
    bench = lit_bench(monkeypatch, person_at(3.0, 2.0))
    step = ended(bench, PeopleDetector(bench, []), unpictured=unpictured)
    assert isinstance(step, kind), step


class NearSightless(PeopleDetector):
    """Sees nobody within 1.7 m, as a detector to which the pictures show only legs."""

    def _seen(self, person):
        here, (x_m, y_m) = self.bench.robot.pose, ((person.x0 + person.x1) / 2, (person.y0 + person.y1) / 2)
        return super()._seen(person) if math.hypot(x_m - here.x_m, y_m - here.y_m) > 1.7 else None


def bench_with(monkeypatch, *people):
    """Bench with lit cameras, and these people in the room."""
    bench = lit_bench(monkeypatch, people[0])
    bench.robot.blocks += [one for one in people if one not in bench.robot.blocks]
    return bench


CLOSE = person_at(2.6, 2.5), person_at(2.6, 1.5)
"""Two people 1.2 m from the robot."""


@pytest.mark.parametrize("count", [0, 1])
def test_bodies_that_pictures_do_not_show_whole_forbid_nobody(count, monkeypatch):
    bench = bench_with(monkeypatch, *CLOSE)
    step = ended(bench, NearSightless(bench, [*CLOSE]), count=count)
    assert step.cause is Cause.EXECUTION
    assert "nobody is seen in the room from here, but what stands at (2." in step.message


@pytest.mark.parametrize(("count", "found"), [(0, 2), (2, 2)])
def test_a_robot_that_may_move_counts_people_who_were_too_near_for_its_pictures(count, found, monkeypatch):
    bench = bench_with(monkeypatch, *CLOSE)
    monkeypatch.setattr(FindPeople, "Options", partial(FindPeopleOptions, hidden=1.0))  # it looks for nobody else
    step = ended(bench, NearSightless(bench, [*CLOSE]), count=count, moves=True)
    assert isinstance(step, Succeeded), step
    assert len(step.outputs["observations"]) == found


def test_the_people_found_so_far_are_given_where_another_may_stand(monkeypatch):
    near, far = person_at(2.6, 2.5), person_at(4.0, 1.4)
    bench = bench_with(monkeypatch, near, far)
    step = ended(bench, NearSightless(bench, [near, far]), count=0)
    assert step.cause is Cause.EXECUTION
    assert step.message.startswith("there is one person in the room, but what stands at (2.")
    assert len(step.outputs["observations"]) == 1


@pytest.mark.parametrize(
    ("tall_m", "top_m", "says"),
    [
        (1.2, 0.5, "nobody is seen in the room from here"),  # low, and its top is in the pictures
        (1.2, 1.7, "nobody is seen in the room from here, but what stands at (3."),  # a head would be above them
        (1.7, 0.5, "nobody is seen in the room from here, but what stands at (3."),  # the detector may miss a person
    ],
)
def test_only_pictures_that_show_the_top_of_a_low_body_show_that_it_is_no_person(tall_m, top_m, says, monkeypatch):
    # at 2 m the bench's cameras show a quarter of a person: `top_m` is the height that they must show
    monkeypatch.setattr(find_people, "_VISIBLE", 0.2)
    monkeypatch.setattr(find_people, "_HEIGHTS_M", (0.1, 0.3, top_m))
    body = person_at(3.7, 2.0)
    bench = lit_bench(monkeypatch, Box(body.x0, body.y0, body.x1, body.y1, 0.0, tall_m))
    step = ended(bench, PeopleDetector(bench, []), moves=True)
    assert step.message.startswith(says)
    assert step.cause is (Cause.EXECUTION if "but" in says else Cause.POSTCONDITION)


@pytest.mark.parametrize(("apart_m", "behind_m"), [(0.5, 0.0), (0.4, 0.0), (0.4, 0.2)])
def test_people_who_touch_are_at_least_one(apart_m, behind_m, monkeypatch):
    # a detector often shows two people who touch as one; scans show that there is room for two
    people = person_at(3.5, 2.0 - apart_m / 2), person_at(3.5 + behind_m, 2.0 + apart_m / 2)
    bench = bench_with(monkeypatch, *people)
    step = ended(bench, PeopleDetector(bench, [people[0]]), count=0)
    assert step.cause is Cause.EXECUTION
    assert step.message.startswith("there is one person in the room, but what stands at (3.")
    assert len(step.outputs["observations"]) == 1


@pytest.mark.parametrize("apart_m", [0.6, 0.8])
def test_people_side_by_side_are_counted_one_by_one(apart_m, monkeypatch):
    people = person_at(3.5, 2.0 - apart_m / 2), person_at(3.5, 2.0 + apart_m / 2)
    bench = bench_with(monkeypatch, *people)
    step = ended(bench, PeopleDetector(bench, [*people]), count=0)
    assert isinstance(step, Succeeded), step
    assert len(step.outputs["observations"]) == 2


def spoil(bench, monkeypatch, change, sources=("frontleft", "frontright"), while_=lambda: True):
    """Changes the pictures of some cameras while a condition holds."""
    take = bench.robot.image

    def spoiled(source, **how):
        image = take(source, **how)
        return change(image) if source in sources and while_() else image

    monkeypatch.setattr(bench.robot, "image", spoiled)


def without_depth(image, value=0.0):
    return replace(image, depth_m=np.full_like(image.depth_m, value))


def not_a_number(image):
    return without_depth(image, np.nan)


def old(image):
    return replace(image, stamp_s=image.stamp_s - 4.0)


PERSON = person_at(3.5, 2.0)
"""A person 2 m ahead of the robot."""


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (without_depth, "the frontleft camera gives pictures without depth"),
        (not_a_number, "the frontleft camera gives pictures without depth"),
        (old, "the frontleft camera gives only a picture that is 4.0 s old"),
    ],
)
@pytest.mark.parametrize("count", [0, 1])
def test_pictures_in_which_nobody_can_be_located_are_no_look(change, says, count, monkeypatch):
    bench = lit_bench(monkeypatch, PERSON)
    spoil(bench, monkeypatch, change)
    step = ended(bench, PeopleDetector(bench, [PERSON]), count=count)
    assert (step.cause, step.message) == (Cause.EXECUTION, says)


def test_robot_waits_for_depth_that_comes_back(monkeypatch):
    bench = lit_bench(monkeypatch, PERSON)
    spoil(bench, monkeypatch, not_a_number, while_=lambda: bench.clock.now() < 4.0)
    assert isinstance(ended(bench, PeopleDetector(bench, [PERSON])), Succeeded)


def test_scans_alone_find_a_person_where_bodies_without_a_picture_count(monkeypatch):
    bench = lit_bench(monkeypatch, PERSON)
    spoil(bench, monkeypatch, without_depth)
    assert isinstance(ended(bench, PeopleDetector(bench, [PERSON]), unpictured=True), Succeeded)


def test_the_camera_is_the_cause_where_scans_alone_find_nobody(monkeypatch):
    bench = lit_bench(monkeypatch, BODY)
    bench.robot.blocks.remove(BODY)
    spoil(bench, monkeypatch, old)
    step = ended(bench, PeopleDetector(bench, []), unpictured=True)
    assert (step.cause, "4.0 s old" in step.message) == (Cause.EXECUTION, True)


@pytest.mark.parametrize(
    ("x_m", "y_m", "cause"),
    [((1.9, 2.5), (2.8, 3.4), Cause.POSTCONDITION), ((0.2, 0.9), (1.6, 2.6), Cause.EXECUTION)],
    ids=["on the side to which the robot turns", "behind"],
)
def test_only_a_sound_camera_shows_what_counts_as_seen(x_m, y_m, cause, monkeypatch):
    bench = lit_bench(monkeypatch, BODY)
    bench.robot.blocks.remove(BODY)
    spoil(bench, monkeypatch, without_depth, ("frontleft",))
    area_W = tuple((x, y) for x, y in zip((*x_m, *x_m[::-1]), np.repeat(y_m, 2), strict=True))
    step = ended(bench, PeopleDetector(bench, []), area_W=area_W)
    assert step.cause is cause, step.message


def test_a_body_in_the_scan_is_not_denied_where_a_camera_is_faulty(monkeypatch):
    # the pictures of the sound camera do not show the body as a person
    bench = lit_bench(monkeypatch, BODY)
    spoil(bench, monkeypatch, without_depth, ("frontleft",))
    area_W = ((2.6, 1.6), (3.4, 1.6), (3.4, 2.4), (2.6, 2.4))
    step = ended(bench, PeopleDetector(bench, []), area_W=area_W)
    assert step.cause is Cause.EXECUTION
    assert step.message.endswith("but the frontleft camera gives pictures without depth")


def blank_person(detector):
    """Change of a picture: no depth in the boxes of people."""

    def change(image):
        depth_m = image.depth_m.copy()
        for found in detector.detect([image.grey])[0]:
            u0, v0, u1, v1 = (round(value) for value in found.box)
            depth_m[max(0, v0 - 3) : v1 + 3, max(0, u0 - 3) : u1 + 3] = np.nan
        return replace(image, depth_m=depth_m)

    return change


def test_somebody_in_a_picture_that_has_no_depth_there_is_not_nobody(monkeypatch):
    bench = lit_bench(monkeypatch, PERSON)
    detector = PeopleDetector(bench, [PERSON])
    spoil(bench, monkeypatch, blank_person(detector))
    step = ended(bench, detector)
    assert step.cause is Cause.EXECUTION
    assert step.message.endswith("but somebody is in a picture that has no depth there")


def test_a_robot_that_may_move_goes_nearer_to_somebody_who_is_too_far_for_depth(monkeypatch):
    far = person_at(4.2, 2.0)
    bench = lit_bench(monkeypatch, far)
    short_m = 2.2
    spoil(bench, monkeypatch, lambda image: replace(image, depth_m=image.depth_m * (image.depth_m < short_m)))
    step = ended(bench, PeopleDetector(bench, [far]), moves=True)
    assert isinstance(step, Succeeded), step.message
    assert math.dist(step.outputs["observation"].position_W[:2], (4.2, 2.0)) < 0.4


def test_a_person_whom_another_picture_locates_is_counted_once(monkeypatch):
    bench = lit_bench(monkeypatch, PERSON)
    detector = PeopleDetector(bench, [PERSON])
    spoil(bench, monkeypatch, blank_person(detector), ("frontleft",))
    step = ended(bench, detector, count=0)
    assert isinstance(step, Succeeded), step.message
    assert len(step.outputs["observations"]) == 1


# the room on the left, in which a screen hides the right half of it
SCREEN = (*TWO_ROOMS, Box(2.6, 0.1, 2.7, 2.2))


def test_a_robot_that_may_move_finds_a_person_behind_a_screen():
    step = ended(bench_in_room(Box(3.9, 0.9, 4.3, 1.3), start=Pose2D(1.8, 1.6, 0.0), surveyed=SCREEN), moves=True)
    assert isinstance(step, Succeeded), step.message
    assert math.dist(step.outputs["observation"].position_W[:2], (4.1, 1.1)) < 0.3


def test_a_robot_that_sees_the_whole_empty_room_stays_where_it_is():
    bench = bench_in_room()
    step = ended(bench, moves=True)
    assert (step.cause, step.message) == (Cause.POSTCONDITION, "nobody is seen in the room from here")
    assert math.dist((bench.robot.pose.x_m, bench.robot.pose.y_m), (1.5, 2.0)) < 0.1


def test_a_hidden_part_is_the_cause_where_no_pose_shows_it():
    step = ended(bench_in_room(surveyed=(*TWO_ROOMS, Box(2.4, 0.1, 2.5, 3.9))), moves=True)
    assert (step.cause, step.message[-23:]) == (Cause.EXECUTION, "of it was never in view")
