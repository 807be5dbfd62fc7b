"""Joint control by streams, of a scripted robot whose legs stand on the floor."""

import time
from dataclasses import replace

import numpy as np
import pytest
from bosdyn.api import basic_command_pb2, robot_command_pb2
from bosdyn.client.robot_command import (
    NotPoweredOnError,
    RobotCommandBuilder,
    RobotCommandStreamingClient,
    UnsupportedError,
)
from bosdyn.client.robot_state import RobotStateStreamingClient
from pydrake.math import RigidTransform, RollPitchYaw
from scipy.optimize import least_squares

from errand_spot.messages import our_joint, timestamp
from errand_spot.server.computer import Pace
from errand_spot.server.joint_control import LEG_JOINTS, feet_B
from skills.testing.robot import ScriptedRobot

PACE, SHARED = Pace.CLIENT, True
Answer = robot_command_pb2.JointControlStreamResponse
FOOT_M = 0.036
FEET_F = np.array([[0.298, 0.166, 0.0], [0.298, -0.166, 0.0], [-0.298, 0.166, 0.0], [-0.298, -0.166, 0.0]])
"""Feet (4, 3) around their middle on the floor."""


STANDING_RAD = np.tile([0.0, 0.85, -1.58], 4)
"""Leg joints of a standing body, by the maker."""


def legs_rad(height_m, pitch_rad=0.0, ahead_m=0.0, wider_m=0.0):
    """Leg joints (12,) of a body at a height and pitch, shifted ahead, over feet that stand wider apart."""
    X_FB = RigidTransform(RollPitchYaw(0.0, pitch_rad, 0.0), [ahead_m, 0.0, height_m])
    wider = [[0.0, wider_m * side, FOOT_M] for side in (1, -1, 1, -1)]
    p_BF = (X_FB.inverse() @ (FEET_F + wider).T).T
    return least_squares(lambda q: (feet_B(q) - p_BF).ravel(), STANDING_RAD).x


def with_legs(robot):
    """Joints of the scripted robot with those of legs on the floor."""
    joints = ScriptedRobot.joints(robot)
    legs = dict(zip(map(our_joint, LEG_JOINTS), legs_rad(robot.height_m, robot.pitch_rad).tolist(), strict=True))
    still = dict.fromkeys(legs, 0.0)
    added = {"position_rad": legs, "velocity_rad_s": still, "effort_nm": still}
    return replace(joints, **{name: {**getattr(joints, name), **values} for name, values in added.items()})


def test_the_feet_of_a_standing_robot_are_below_its_hips():
    p_BF = feet_B(STANDING_RAD)
    assert p_BF[:, 2] == pytest.approx([FOOT_M - 0.52] * 4, abs=0.01)
    assert p_BF[:, :2] == pytest.approx(FEET_F[:, :2], abs=0.03)


@pytest.fixture
def legged(spot, monkeypatch):
    scripted = spot.served.scripted
    monkeypatch.setattr(scripted, "joints", lambda: with_legs(scripted), raising=False)
    time.sleep(0.05)
    return spot


def message(spot, rows, *, ahead_s=0.2, gains=True, key=0, **fields):
    """Message of the stream for 19 joints."""
    made = robot_command_pb2.JointControlStreamRequest()
    command, count = made.joint_command, len(rows)
    command.position.extend(rows)
    command.velocity.extend([0.0] * count)
    command.load.extend([0.0] * count)
    if gains:
        command.gains.k_q_p.extend([100.0] * count)
        command.gains.k_qd_p.extend([2.0] * count)
    command.end_time.CopyFrom(timestamp(spot.served.server.computer.now_s() + ahead_s))
    command.user_command_key = key
    for name, value in fields.items():
        getattr(command, name).value = value
    return made


def now_rad(spot):
    """All joints as the state stream gives them."""
    return np.array(next(spot.client(RobotStateStreamingClient).get_robot_state_stream()).joint_states.position)


def activate(spot):
    return spot.commands.robot_command(RobotCommandBuilder.joint_command())


def streamed(spot, rows_of, steps=60, **fields):
    """Streams a message each 0.05 s of the robot's time, and returns the answer; the last are sent again."""
    computer = spot.served.server.computer

    def messages():
        for step in range(steps):
            yield message(spot, rows_of(step), gains=step == 0, key=step + 1, **fields)
            computer.do(lambda: [computer.step() for _ in range(2)]).result()

    return spot.client(RobotCommandStreamingClient).send_joint_control_commands(messages())


def test_arm_and_gripper_follow_the_stream_and_the_state_stream_names_the_last_message(legged):
    number, start = activate(legged), now_rad(legged)
    goal = start + np.array([0.0] * 16 + [0.6, 0.0, -0.5])
    answer = streamed(legged, lambda step: start + (goal - start) * min(step / 40.0, 1.0))
    assert answer.status == Answer.STATUS_OK
    assert now_rad(legged)[12:18] == pytest.approx(goal[12:18], abs=0.02)
    assert legged.served.scripted.opening == pytest.approx(0.5, abs=0.05)
    state = next(legged.client(RobotStateStreamingClient).get_robot_state_stream())
    assert state.last_command.user_command_key == 60
    told = legged.commands.robot_command_feedback(number).feedback.full_body_feedback.joint_feedback
    assert (told.status, told.num_messages_received) == (basic_command_pb2.JointCommand.Feedback.STATUS_ACTIVE, 60)


# leg joints: height (m), pitch (rad), shift ahead (m); what the body does
POSTURES = {
    "squat": ((0.44, 0.0, 0.0), (0.44, 0.0, 0.0)),
    "nod": ((0.52, 0.15, 0.0), (0.52, 0.15, 0.0)),
    "lean ahead": ((0.5, 0.0, 0.06), (0.5, 0.0, 0.06)),
    "feet a little wider": ((0.46, 0.0, 0.0, 0.04), (0.46, 0.0, 0.0)),
}


@pytest.mark.parametrize("posture", POSTURES)
def test_the_legs_move_the_body_over_the_feet(legged, posture):
    asked, (height_m, pitch_rad, ahead_m) = POSTURES[posture]
    activate(legged)
    start, goal = now_rad(legged), now_rad(legged)
    goal[:12] = legs_rad(*asked)
    assert streamed(legged, lambda step: start + (goal - start) * min(step / 30.0, 1.0)).status == Answer.STATUS_OK
    robot = legged.served.scripted
    assert (robot.height_m, robot.pitch_rad) == pytest.approx((height_m, pitch_rad), abs=0.02)
    assert (robot.pose.x_m, robot.pose.y_m) == pytest.approx((ahead_m, 0.0), abs=0.02)


# what is wrong; changed message; status; words of the answer
REFUSALS = {
    "too few joints": (lambda row: row[:12], {}, Answer.STATUS_INVALID_REQUEST, "has 12 values; 19 are needed"),
    "below the range": (lambda row: [*legs_rad(0.32), *row[12:]], {}, Answer.STATUS_INVALID_REQUEST, "body's height"),
    "a foot in the air": (
        lambda row: [*row[:2], row[2] - 0.8, *row[3:]],
        {},
        Answer.STATUS_INVALID_REQUEST,
        "foot's distance",
    ),
    "limit of 0": (lambda row: row, {"velocity_safety_limit": 0.0}, Answer.STATUS_INVALID_REQUEST, "must be above 0"),
    "too far ahead": (lambda row: row, {"ahead_s": 1e6}, Answer.STATUS_TOO_DISTANT, "86400 s"),
    "late": (lambda row: row, {"ahead_s": -0.1}, Answer.STATUS_EXPIRED, "s ago"),
}


@pytest.mark.parametrize("wrong", REFUSALS)
def test_a_stream_that_cannot_be_obeyed_ends_with_status_and_reason(legged, wrong):
    change, fields, status, says = REFUSALS[wrong]
    activate(legged)
    row = change(now_rad(legged).tolist())
    answer = streamed(legged, lambda _: row, **fields)
    assert (answer.status, says in answer.message) == (status, True), answer


def test_joint_control_without_gains_is_refused_as_torque_control(legged):
    activate(legged)
    made = message(legged, now_rad(legged).tolist())
    made.joint_command.gains.k_q_p[13] = 0.0
    answer = legged.client(RobotCommandStreamingClient).send_joint_control_commands(iter([made]))
    assert (answer.status, "arm0.sh1 is 0: torque" in answer.message) == (Answer.STATUS_INVALID_REQUEST, True)


def test_a_stream_without_joint_control_is_inactive(legged):
    assert streamed(legged, lambda _: now_rad(legged)).status == Answer.STATUS_INACTIVE


def test_joint_control_ends_when_no_message_comes(legged):
    number = activate(legged)
    time.sleep(1.5)
    told = legged.commands.robot_command_feedback(number).feedback.full_body_feedback
    assert told.joint_feedback.status == basic_command_pb2.JointCommand.Feedback.STATUS_ERROR
    assert told.status == basic_command_pb2.RobotCommandFeedbackStatus.STATUS_COMMAND_TIMED_OUT


def test_a_joint_above_the_safety_limit_is_a_behaviour_fault(legged):
    activate(legged)
    still = now_rad(legged)
    streamed(legged, lambda step: still, 5, velocity_safety_limit=2.0)
    assert legged.served.server.computer.fault is None
    fast = legged.served.scripted
    turning = with_legs(fast)
    fast.joints = lambda: replace(turning, velocity_rad_s={**turning.velocity_rad_s, "arm_sh0": 2.5})
    streamed(legged, lambda step: still, 5, velocity_safety_limit=2.0)
    assert legged.served.server.computer.fault is not None


def test_a_robot_that_sits_takes_no_joint_control(legged):
    legged.commands.robot_command(RobotCommandBuilder.synchro_sit_command())
    time.sleep(3.0)
    with pytest.raises(UnsupportedError):
        activate(legged)
    legged.robot.power_off(cut_immediately=True, timeout_sec=5.0)
    with pytest.raises(NotPoweredOnError):
        activate(legged)
