"""The hand-over skill with a scripted arm and analytic scans."""

import math
from dataclasses import asdict, replace

import numpy as np
import pytest
from analytic_scan import scan_of
from planar_people import LateAnswer
from table_robot import MODEL, BlockCostmap, TableRobot, context_of, failed, outcome
from table_scene import BLUE, GREY, Can

from skills.api import Cause, Failed, Running, Succeeded
from skills.geometry import facing_poses
from skills.manipulation.arm.forces import levers_m
from skills.manipulation.hand_over.skill import HandOver, HandOverInputs
from skills.manipulation.hand_over.verification import Release
from skills.robot import Gripper, Pose2D, Scan

CARRYING = np.array([0.0, -3.0, 2.85, 0.0, 0.1, 1.57])
P_HT = np.array([0.18, 0.0, 0.0])
BEER = HandOverInputs("Robin", "beer")
PULL_S = 8.0


class _Person(TableRobot):
    """Somebody stands before it and pulls from a time on; each scan has a new stamp, efforts are noisy."""

    pull_n, pull_s, lost_s = 15.0, PULL_S, math.inf
    noise = np.random.default_rng(3)

    def scan(self):
        return None if self.scan_now is None else Scan(**{**self.scan_now.__dict__, "stamp_s": self.now_s})

    def joints(self):
        force_B = np.array([self.pull_n if self.now_s >= self.pull_s else 0.0, 0.0, 0.0])
        efforts = self.noise.normal(0.0, 0.3, len(MODEL.names)) - force_B @ levers_m(MODEL, self.q_rad, P_HT)
        return replace(super().joints(), effort_nm=dict(zip(MODEL.names, efforts.tolist(), strict=True)))

    def gripper(self):
        return replace(super().gripper(), holding=self.holding and self.now_s < self.lost_s)


ON_TRAY = (Can(0.85, 0.0, 0.033, 0.115, BLUE, base=0.94), Can(0.85, 0.0, 0.17, 0.01, GREY, base=0.93))
"""A beer on a tray, where Robin takes it."""


def _before_robin(**values):
    values = {"scan_now": scan_of([(1.4, 0.0, 0.2)]), "things": ON_TRAY, "holding": True, "opening": 0.3, **values}
    return _Person(CARRYING, **values)


def test_an_empty_gripper_is_a_failed_precondition():
    failed(HandOver(context_of(_Person())), HandOverInputs("Robin"), Cause.PRECONDITION, "nothing in the gripper")


def test_nobody_in_sight_is_a_failed_precondition():
    robot = _before_robin(scan_now=scan_of())
    failed(HandOver(context_of(robot)), HandOverInputs("Robin"), Cause.PRECONDITION, "nobody is seen near")


class _SurveyedWall(BlockCostmap):
    """Its survey explains a wall 1.55 m before the robot."""

    def is_unexplained(self, points_W):
        return points_W[:, 0] < 1.4


def test_a_person_with_the_back_to_a_surveyed_wall_gets_the_object():
    robot = _before_robin(scan_now=scan_of([(1.4, 0.0, 0.2)], wall_x=1.55), carries=True)
    assert isinstance(outcome(HandOver(context_of(robot, costmap=_SurveyedWall())), BEER), Succeeded)


# person, met before -> whom the result names
@pytest.mark.parametrize(
    ("person", "met", "whom"), [("Robin", True, "Robin"), ("somebody", False, "somebody"), ("person", False, "person")]
)
def test_the_result_names_a_person_only_whom_the_robot_has_met(person, met, whom):
    given = outcome(HandOver(context_of(_before_robin(carries=True))), replace(BEER, person=person, met=met))
    assert given.message == f"gave the beer to {whom}"


@pytest.mark.parametrize("y", [-0.4, 0.0, 0.4])
def test_the_object_is_held_out_near_the_person_without_contact(y):
    robot = _before_robin(scan_now=scan_of([(1.4, y, 0.2)]), things=None)
    skill = HandOver(context_of(robot))
    skill.begin(BEER)
    while "holding the beer out" not in skill.step().message:
        robot.advance(0.1)
    p_BT = MODEL.X_BH(robot.q_rad) @ P_HT
    assert 0.35 < math.hypot(p_BT[0] - 1.4, p_BT[1] - y) < 0.75
    assert 0.7 < p_BT[2] + 0.52 < 1.1
    assert robot.holding


def test_a_pull_opens_the_gripper_and_the_hand_is_drawn_in():
    robot = _before_robin(carries=True)
    assert outcome(HandOver(context_of(robot)), BEER).message == "gave the beer to somebody, taken for Robin"
    assert not (robot.holding or robot.carries)
    assert robot.q_rad == pytest.approx(MODEL.stowed_rad, abs=0.06)


def test_an_object_pulled_out_of_the_closed_gripper_is_given_when_seen_with_the_person():
    robot = _before_robin(pull_n=0.0, lost_s=PULL_S)
    assert isinstance(outcome(HandOver(context_of(robot)), BEER), Succeeded)


class _Rolling(_Person):
    """The beer rolls on the tray until a time."""

    def image(self, source, *, visual=True, depth=True):
        self.things = (replace(ON_TRAY[0], y=0.03 * math.sin(7.0 * min(self.now_s, self.rests_s))), ON_TRAY[1])
        return super().image(source, visual=visual, depth=depth)


# Time at which the object comes to rest -> message
@pytest.mark.parametrize(
    ("rests_s", "message"),
    [
        (15.0, "gave the beer to somebody, taken for Robin"),
        (math.inf, "the beer still moves where it was released before Robin"),
    ],
)
def test_an_object_that_still_moves_is_not_given(rests_s, message):
    robot = _Rolling(CARRYING, holding=True, opening=0.3, scan_now=scan_of([(1.4, 0.0, 0.2)]), rests_s=rests_s)
    step = outcome(HandOver(context_of(robot)), BEER)
    assert step.message == message
    assert robot.now_s > rests_s or step.cause is Cause.POSTCONDITION


def test_the_hand_camera_stays_below_the_face_of_a_person():
    robot, cameras_m = _before_robin(), []
    image = robot.image

    def taken(source, **what):
        picture = image(source, **what)
        cameras_m.append(picture.frames.pose("hand_camera").translation())
        return picture

    robot.image = taken
    assert isinstance(outcome(HandOver(context_of(robot)), BEER), Succeeded)
    assert max(z for _, _, z in cameras_m) < 1.4
    assert max(x for x, _, _ in cameras_m) < 1.4 - 0.7


@pytest.mark.parametrize("pull_n", [0.0, 4.0])
def test_noise_and_a_light_touch_are_no_pull(pull_n):
    robot = _before_robin(pull_n=pull_n)
    failed(HandOver(context_of(robot)), BEER, Cause.TIMEOUT, "Robin did not take the beer within 20 s")
    assert robot.holding
    assert robot.q_rad == pytest.approx(CARRYING, abs=0.01)


@pytest.mark.parametrize("lost", [{}, {"pull_n": 0.0, "lost_s": PULL_S}], ids=["released", "lost while held out"])
def test_an_object_that_the_hand_camera_does_not_see_with_the_person_is_not_given(lost):
    robot = _before_robin(things=(), **lost)
    failed(HandOver(context_of(robot)), BEER, Cause.POSTCONDITION, "the beer is not seen where it was released")
    assert robot.q_rad == pytest.approx(MODEL.stowed_rad, abs=0.06)


# What is where the open jaws press against something -> message
@pytest.mark.parametrize(
    ("things", "message"),
    [
        (ON_TRAY, "gave the beer to somebody, taken for Robin"),
        ((), "the beer is not seen where it was released before Robin"),
    ],
)
def test_open_jaws_that_press_against_something_hold_no_object(things, message):
    robot = _before_robin(things=things)

    def reading():
        presses = robot.opening > 0.5 and MODEL.X_BH(robot.q_rad).translation()[0] > 0.6
        return Gripper(robot.now_s, robot.opening, 5.0, robot.holding or presses)

    robot.gripper = reading
    assert outcome(HandOver(context_of(robot)), BEER).message == message


@pytest.mark.parametrize(("answer", "given"), [("let go", True), ("hold on", False)])
def test_the_operator_may_say_that_it_lets_go(answer, given):
    robot = _before_robin(pull_n=0.0)
    operator = LateAnswer(robot, answer, at_s=PULL_S)
    step = outcome(HandOver(replace(context_of(robot), ask=operator)), BEER)
    assert isinstance(step, Succeeded if given else Failed)
    assert operator.question.text == "Alice holds the beer out to Robin. Let go?"
    assert operator.withdrawn


def _ticks(robot, skill):
    """Begin and give the number of each tick before it is done."""
    skill.begin(BEER)
    tick = 0
    while isinstance(skill.step(), Running):
        yield (tick := tick + 1)
        robot.advance(0.1)
        assert robot.now() < 60.0


TICKS = pytest.mark.parametrize("every", [23, pytest.param(3, marks=pytest.mark.nightly)])


@TICKS
def test_cancelled_at_any_tick_no_command_still_runs(every):
    whole = _before_robin()
    count = sum(1 for _ in _ticks(whole, HandOver(context_of(whole))))
    for end in range(1, count + 1, every):
        robot = _before_robin()
        operator = LateAnswer(robot, "hold on", at_s=math.inf)
        skill = HandOver(replace(context_of(robot), ask=operator))
        next(tick for tick in _ticks(robot, skill) if tick == end)
        skill.end()
        assert robot.moving_parts == ()
        assert operator.withdrawn or operator.question is None


@TICKS
def test_paused_at_any_tick_it_goes_on_and_gives_it(every):
    whole = _before_robin()
    count = sum(1 for _ in _ticks(whole, HandOver(context_of(whole))))
    for pause in range(1, count + 1, every):
        robot = _before_robin()
        skill = HandOver(context_of(robot))
        next(tick for tick in _ticks(robot, skill) if tick == pause)
        skill.suspend()
        robot.advance(30.0)
        robot.pull_s = robot.now() + 6.0
        skill.resume(BEER)
        while isinstance(step := skill.step(), Running):
            robot.advance(0.1)
            assert robot.now() < 120.0
        assert step.message == "gave the beer to somebody, taken for Robin", (pause, step)
        assert not robot.holding


def test_after_a_restart_a_released_object_is_given():
    robot = _before_robin(holding=False)
    skill = HandOver(context_of(robot))
    skill.checkpoint = {"lets_go": True, "release": asdict(Release(0.85, 0.0, 0.94, 1.05))}
    skill.resume(BEER)
    while isinstance(step := skill.step(), Running):
        robot.advance(0.1)
    assert step.message == "gave the beer to somebody, taken for Robin"


def test_poses_before_a_person_face_them_and_the_nearest_comes_first():
    poses = facing_poses((3.0, 0.0), Pose2D(0.0, 0.0, 0.0), 1.5)
    assert math.hypot(poses[0].x_m - 1.5, poses[0].y_m) < 0.01
    for pose in poses:
        off = math.atan2(-pose.y_m, 3.0 - pose.x_m) - pose.yaw_rad
        assert math.remainder(off, 2 * math.pi) == pytest.approx(0.0, abs=1e-6)
