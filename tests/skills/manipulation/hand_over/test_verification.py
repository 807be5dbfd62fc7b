"""Tests of the check that a person has the released object, with a head camera."""

import itertools
from dataclasses import asdict, replace

import numpy as np
import pytest
from analytic_scan import scan_of
from pydrake.math import RigidTransform, RotationMatrix
from table_robot import HEAD_CAPABILITIES, HEAD_MODEL, TableRobot, context_of, failed, outcome
from table_scene import BLUE, GREY, RED, Can, scene

from skills.api import Cause, Succeeded, nobody_to_ask
from skills.detection import Detection
from skills.manipulation.arm.forces import levers_m
from skills.manipulation.hand_over.skill import HandOver, HandOverInputs
from skills.manipulation.hand_over.verification import (
    Release,
    Seen,
    judge_release,
    lies_at,
    names_in,
    release_of,
    stands_at,
    stays_in_place,
)
from skills.perception.detection_3d import Detection3D
from skills.robot import Gripper, Scan

COKE = HandOverInputs("Robin", "coke")
PULL_S = 8.0
AHEAD_M, LEVEL_M = 0.85, 1.0
P_HT = np.array([HEAD_CAPABILITIES.gripper.grip_x_m, 0.0, 0.0])
CARRYING = next(
    q
    for q in HEAD_MODEL.inverse(RigidTransform(RotationMatrix.MakeXRotation(np.pi / 2), [0.6, 0.0, 0.6]))
    if HEAD_MODEL.within_limits(q)
)
RELEASE = Release(1.05, 0.0, 0.95, 1.07)


class _BeforeRobin(TableRobot):
    """Robin stands before it and pulls from a time on."""

    def scan(self):
        return Scan(**{**scan_of([(1.4, 0.0, 0.2)]).__dict__, "stamp_s": self.now_s})

    def joints(self):
        pull_B = np.array([15.0 if self.now_s >= PULL_S else 0.0, 0.0, 0.0])
        efforts = (-pull_B @ levers_m(HEAD_MODEL, self.q_rad, P_HT)).tolist()
        return replace(super().joints(), effort_nm=dict(zip(HEAD_MODEL.names, efforts, strict=True)))


def _robot(*things, **values):
    values = {"holding": True, "opening": 0.06, **values}
    return _BeforeRobin(CARRYING, capabilities=HEAD_CAPABILITIES, things=things, **values)


def _at_release(colour, base_m=LEVEL_M - 0.06):
    return Can(AHEAD_M, 0.0, 0.033, 0.115, colour, base=base_m)


def test_an_object_seen_at_its_release_point_is_given():
    assert (
        outcome(HandOver(context_of(_robot(_at_release(RED)))), COKE).message
        == "gave the coke to somebody, taken for Robin"
    )


def test_two_fingers_are_drawn_straight_back_from_a_released_object():
    robot = _robot(_at_release(RED))
    skill = HandOver(context_of(robot))
    skill.begin(COKE)
    while "holding the coke out" not in skill.step().message:
        robot.advance(0.1)
    X_BH = HEAD_MODEL.X_BH(robot.q_rad)
    moved = len(robot.arm_commands)
    while not hasattr(skill.step(), "outputs"):
        robot.advance(0.1)
    way_H = X_BH.inverse() @ HEAD_MODEL.X_BH(robot.arm_commands[moved].positions_rad[-1]).translation()
    assert way_H == pytest.approx([-0.16, 0.0, 0.0], abs=0.003)  # not aside first: both fingers are off it


def test_the_arm_is_stowed_around_the_hands_that_bear_the_object():
    robot = _robot(_at_release(RED))
    context = context_of(robot)
    around_m = ((-0.033, 0.033), (-0.06, 0.055), (-0.033, 0.033))  # the can, gripped in its middle; y of the hand is up
    context.payload.corners_H = P_HT + np.array(list(itertools.product(*around_m)))
    assert isinstance(outcome(HandOver(context), COKE), Succeeded)
    for q in np.vstack([each.positions_rad for each in robot.arm_commands[-2:]]):
        for x_m in (0.0, 0.1, 0.2):
            x, y, z = HEAD_MODEL.X_BH(q) @ np.array([x_m, 0.0, 0.0])
            over_m = z + HEAD_CAPABILITIES.standing_height_m - (LEVEL_M - 0.06)
            assert max(abs(x - AHEAD_M), abs(y)) > 0.20 or not -0.10 < over_m < 0.02, "through the tray"
    assert HEAD_MODEL.X_BH(robot.arm_commands[-2].positions_rad[-1]).translation()[0] < 0.61  # near the body first
    assert robot.q_rad == pytest.approx(HEAD_MODEL.stowed_rad, abs=0.06)


@pytest.mark.parametrize(
    ("things", "message"),
    [
        ((), "not seen where it was released before Robin"),
        ((_at_release(RED, base_m=0.0),), "the coke fell to the floor before Robin"),
        ((_at_release(BLUE, base_m=0.80),), "not seen where it was released"),
    ],
    ids=["nowhere", "on the floor", "something else that is not as high"],
)
def test_an_object_that_the_person_does_not_have_is_not_given(things, message):
    failed(HandOver(context_of(_robot(*things))), COKE, Cause.POSTCONDITION, message)


def test_an_object_that_the_closing_gripper_feels_is_still_in_it():
    robot = _robot(_at_release(RED))
    opened = []

    def feels():
        """Nothing while the fingers are open, and the object again once they close."""
        opened.extend([robot.opening] if robot.opening > 0.07 else [])
        return Gripper(robot.now_s, robot.opening, 5.0, not opened or robot.opening < 0.03)

    robot.gripper = feels
    context = replace(context_of(robot), ask=lambda question: nobody_to_ask(replace(question, default="let go")))
    failed(HandOver(context), COKE, Cause.POSTCONDITION, "the coke is still in the gripper")
    assert len(opened) > 1


def test_a_head_that_does_not_turn_is_reported_in_one_sentence():
    robot = _robot(_at_release(RED), refuse_because={"point_head": "the head is stuck"})
    failed(HandOver(context_of(robot)), COKE, Cause.POSTCONDITION, "the coke was released, but is not seen: the head")


@pytest.mark.parametrize(("things", "given"), [((_at_release(RED),), True), ((), False)])
def test_after_a_restart_it_looks_at_the_release_point(things, given):
    robot = _robot(*things, holding=False)
    skill = HandOver(context_of(robot))
    skill.checkpoint = {"lets_go": True, "release": asdict(Release(AHEAD_M, 0.0, 0.94, 1.06))}
    skill.resume(COKE)
    while not hasattr(step := skill.step(), "outputs"):
        robot.advance(0.1)
    assert isinstance(step, Succeeded) is given


def _seen(thing, p_W):
    image = scene(())
    detection = Detection(thing, 0.9, (0.0, 0.0, 9.0, 9.0))
    none = np.empty((0, 2), np.int64)
    colours = np.empty((0, 3), np.uint8)
    eye_W = np.zeros(3)
    return image, Detection3D(
        0.0, detection, np.array(p_W), np.eye(3), np.eye(3), (0.1, 0.1, 0.1), 0.0, eye_W, none, colours, None
    )


@pytest.mark.parametrize(
    ("thing", "p_W", "seen"),
    [
        ("wrench", (1.05, 0.1, 0.94), Seen.GIVEN),
        ("wrench", (1.30, 0.1, 0.75), Seen.GIVEN),  # taken towards the person
        ("coke", (1.05, 0.1, 0.94), Seen.NOT_SEEN),  # another class
        ("wrench", (1.05, 0.6, 0.94), Seen.NOT_SEEN),  # too far aside
        ("wrench", (1.05, 0.6, 0.02), Seen.FELL),
        ("wrench", (3.05, 0.6, 0.02), Seen.NOT_SEEN),  # lay elsewhere before
    ],
)
def test_a_flat_object_is_known_by_its_class_and_place(thing, p_W, seen):
    image, found = _seen(thing, p_W)
    assert judge_release(image, RigidTransform(), [found], ("wrench",), RELEASE).seen is seen


@pytest.mark.parametrize(
    ("things", "stands"),
    [
        ((Can(1.05, 0.0, 0.033, 0.12, GREY, base=0.93),), True),
        ((Can(1.05, 0.0, 0.18, 0.01, GREY, base=0.92),), False),  # a tray without anything on it
        ((Can(1.05, 0.3, 0.033, 0.12, GREY, base=0.93),), False),
        ((), False),
    ],
)
def test_depth_shows_a_tall_object_whatever_its_class(things, stands):
    assert stands_at(scene(things), RigidTransform(), RELEASE) is stands


TRAY, FLAT_RELEASE = Can(1.05, 0.0, 0.18, 0.01, GREY, base=0.92), Release(1.05, 0.0, 0.95, 0.97)


FLAT, MUG = Can(1.05, 0.0, 0.04, 0.025, GREY, base=0.93), Can(1.09, 0.03, 0.04, 0.095, BLUE, base=0.82)


# What is on a tray whose top is at a height, down to which the search goes -> whether something lies there
@pytest.mark.parametrize(
    ("things", "top_m", "lowest_m", "lies"),
    [((FLAT,), 0.93, 0.95, True), ((), 0.93, 0.95, False), ((MUG,), 0.82, 0.80, True), ((), 0.82, 0.80, False)],
)
def test_depth_shows_an_object_on_a_level_plate(things, top_m, lowest_m, lies):
    tray = replace(TRAY, base=top_m - TRAY.height)
    assert lies_at(scene((tray, *things)), RigidTransform(), FLAT_RELEASE, lowest_m) is lies


# Classes of the detector that the name has -> result for an object on a tray 13 cm below the release
@pytest.mark.parametrize(("names", "seen"), [((), Seen.GIVEN), (("coke",), Seen.NOT_SEEN)])
def test_an_own_object_that_fell_onto_the_tray_is_given(names, seen):
    image = scene((replace(TRAY, base=0.81), MUG))
    assert judge_release(image, RigidTransform(), [], names, FLAT_RELEASE).seen is seen


def test_depth_cannot_separate_a_flat_object_from_its_support():
    assert not stands_at(scene((replace(TRAY, base=0.945),)), RigidTransform(), FLAT_RELEASE)


def test_the_release_point_follows_from_the_box_in_the_hand():
    corners_H = np.array([[x, y, z] for x in (0.13, 0.20) for y in (-0.05, 0.06) for z in (-0.03, 0.03)])
    X_WH = RigidTransform(RotationMatrix.MakeXRotation(np.pi / 2), [2.0, 1.0, 1.1])  # y of the hand is up
    release = release_of(X_WH, P_HT, corners_H)
    assert (release.x_m, release.y_m) == pytest.approx((2.0 + P_HT[0], 1.0))
    assert (release.low_m, release.top_m) == pytest.approx((1.05, 1.16))


# places (x) of detections -> whether the object stays there
@pytest.mark.parametrize(
    ("places_m", "stays"), [((1.0, 1.01, 1.0, 1.0), True), ((1.0, 1.01, 1.0), False), ((1.0, 1.01, 1.06, 1.0), False)]
)
def test_four_detections_at_one_place_show_an_object_at_rest(places_m, stays):
    assert stays_in_place([np.array([x_m, 0.0, 0.9]) for x_m in places_m]) is stays


def test_the_classes_that_a_text_names():
    assert names_in("red wrench", ("wrench", "beer")) == ("wrench",)
    assert names_in("drink", ("wrench", "beer")) == ()
