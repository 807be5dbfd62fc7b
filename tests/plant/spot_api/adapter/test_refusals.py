"""Every status of every response, for every verb: the cause is right, it comes within a second, and nothing moves on.

The robot behind the server does what it was told although its answer says otherwise, which is the worst that may be;
only a lease that does not count moves nothing. A robot that has begun to sit down or to stand up comes to rest there,
and a gripper at its opening.
"""

import math
import sys
import time
from pathlib import Path

import grpc
import numpy as np
import pytest
from bosdyn.api import (
    arm_command_pb2,
    basic_command_pb2,
    estop_pb2,
    gripper_command_pb2,
    header_pb2,
    image_pb2,
    lease_pb2,
    point_cloud_pb2,
    power_pb2,
    robot_command_pb2,
)
from bosdyn.api.keepalive import keepalive_pb2

sys.path.insert(0, str(Path(__file__).parents[1]))
from lock_step import LockStep

from plant.robots.spot.kind import spot_capabilities
from plant.spot_api.adapter.connection import LostError
from plant.spot_api.adapter.statuses import CODES, GOOD, MEANINGS
from plant.spot_api.server.faults import Fault
from skills.robot import ArmTrajectory, CommandCause, CommandState, LeaseError, NoImageError
from skills.testing.clock import VirtualClock
from skills.testing.robot import ScriptedRobot

READY_RAD = np.array([0.0, -0.9, 1.8, 0.0, -0.9, 0.0])
COMMANDS = "bosdyn.api.RobotCommandService"


def bad(statuses):
    """Names and numbers of the statuses that are no success."""
    return [(value.name, value.number) for value in statuses.DESCRIPTOR.values if value.name not in GOOD]


@pytest.fixture(scope="module")
def standing(credentials):
    def build():
        clock = VirtualClock()
        return ScriptedRobot(clock, capabilities=spot_capabilities()), clock

    step = LockStep(build, credentials)
    step.stand_up()
    yield step
    step.close()


@pytest.fixture
def lease(standing):
    return standing.robot.take_lease("test")


def arm_to(standing, goal_rad):
    return ArmTrajectory(np.array([0.0, 6.0]), np.array([standing.served.q_rad, goal_rad]))


def elsewhere(standing):
    """A posture of the arm that is far from the present one."""
    far = np.abs(standing.served.q_rad - READY_RAD).max() > 1.0
    return READY_RAD if far else np.array(spot_capabilities().arm.stowed_rad)


VERBS = {
    "drive": lambda it, **until: it.robot.drive(0.3, 0.0, 0.0, **until),
    "stand": lambda it, **until: it.robot.stand(0.46 if it.served.height_m > 0.5 else 0.54, 0.0, **until),
    "sit": lambda it, **until: it.robot.sit(**until),
    "move_arm": lambda it, **until: it.robot.move_arm(arm_to(it, elsewhere(it)), **until),
    "set_gripper": lambda it, **until: it.robot.set_gripper(0.8 if it.served.opening < 0.4 else 0.1, 20.0, **until),
    "stop": lambda it, until_s, lease: it.robot.stop(lease=lease),
}


def motion(standing):
    return (*np.round([standing.served.pose.x_m, standing.served.pose.y_m], 4), *np.round(standing.served.q_rad, 3))


def answered_with(standing, lease, verb, fault, call="RobotCommand"):
    """Commands with a fault; returns the status, the wall time that it took, and whether something moves on."""
    with standing.server.faults.fault(f"{COMMANDS}/{call}", fault):
        begun_s = time.monotonic()
        command = VERBS[verb](standing, until_s=standing.now() + 30.0, lease=lease)
        while standing.robot.command_status(command).state is CommandState.RUNNING and time.monotonic() < begun_s + 3.0:
            standing.advance(0.025)
        took_s = time.monotonic() - begun_s
    standing.advance(0.025)  # the part is halted
    standing.advance(0.65)  # a drive that the robot has begun ends by itself
    before = motion(standing)
    standing.advance(0.2)
    return standing.robot.command_status(command), took_s, motion(standing) != before


CASES = {
    **{
        name: (Fault(fields={"status": number}), MEANINGS[name][0])
        for name, number in bad(robot_command_pb2.RobotCommandResponse.Status)
    },
    **{
        f"lease-{name}": (Fault(fields={"lease_use_result.status": number}, handled=False), MEANINGS[name][0])
        for name, number in bad(lease_pb2.LeaseUseResult.Status)
    },
    **{
        name: (Fault(fields={"header.error.code": number}), MEANINGS[name][0])
        for name, number in bad(header_pb2.CommonError.Code)
    },
    **{code.name: (Fault(code=code), cause) for code, (cause, _) in CODES.items()},
    "request-lost": (Fault(request_s=math.inf), CommandCause.NO_ANSWER),
    "answer-lost": (Fault(answer_s=math.inf), CommandCause.NO_ANSWER),
}


@pytest.mark.parametrize("verb", VERBS)
@pytest.mark.parametrize("case", CASES)
def test_every_answer_to_a_command_has_its_cause_and_moves_nothing_on(standing, lease, verb, case):
    fault, cause = CASES[case]
    status, took_s, moves = answered_with(standing, lease, verb, fault)
    assert (status.state, status.cause, moves) == (CommandState.REFUSED, cause, False)
    assert took_s < 1.0
    assert case.removeprefix("lease-") in status.reason or "lost" in case


PARTS = {
    "drive": ("mobility_command_feedback", "", ()),
    "stand": ("mobility_command_feedback", "stand_feedback.status", basic_command_pb2.StandCommand.Feedback.Status),
    "sit": ("mobility_command_feedback", "sit_feedback.status", basic_command_pb2.SitCommand.Feedback.Status),
    "move_arm": (
        "arm_command_feedback",
        "arm_joint_move_feedback.status",
        arm_command_pb2.ArmJointMoveCommand.Feedback.Status,
    ),
    "set_gripper": (
        "gripper_command_feedback",
        "claw_gripper_feedback.status",
        gripper_command_pb2.ClawGripperCommand.Feedback.Status,
    ),
}


def feedbacks():
    """Yields verb, name of the status, fault of the feedback, and its cause."""
    for verb, (part, own, statuses) in PARTS.items():
        path = f"feedback.synchronized_feedback.{part}"
        for name, number in bad(basic_command_pb2.RobotCommandFeedbackStatus.Status):
            yield verb, name, Fault(fields={f"{path}.status": number}), MEANINGS[name][0]
        for name, number in bad(statuses) if own else ():
            yield verb, f"part-{name}", Fault(fields={f"{path}.{own}": number}), MEANINGS[name][0]
        for name, number in bad(header_pb2.CommonError.Code):
            yield verb, name, Fault(fields={"header.error.code": number}), MEANINGS[name][0]
        for code in (grpc.StatusCode.UNAVAILABLE, grpc.StatusCode.INTERNAL, grpc.StatusCode.UNAUTHENTICATED):
            yield verb, code.name, Fault(code=code), CODES[code][0]
        yield verb, "lost", Fault(answer_s=math.inf), CommandCause.NO_ANSWER


FEEDBACKS = {f"{verb}-{name}": (verb, fault, cause) for verb, name, fault, cause in feedbacks()}


@pytest.mark.parametrize("case", FEEDBACKS)
def test_every_feedback_has_its_cause_and_moves_nothing_on(standing, lease, case):
    verb, fault, cause = FEEDBACKS[case]
    status, took_s, moves = answered_with(standing, lease, verb, fault, "RobotCommandFeedback")
    assert (status.state, status.cause, moves) == (CommandState.STOPPED, cause, False)
    assert took_s < 1.0


@pytest.mark.parametrize(("name", "number"), bad(power_pb2.PowerCommandStatus))
@pytest.mark.parametrize("call", ["PowerCommand", "PowerCommandFeedback"])
def test_every_answer_to_a_power_command_has_its_cause(standing, lease, call, name, number):
    fault = standing.server.faults.fault(f"bosdyn.api.PowerService/{call}", Fault(fields={"status": number}))
    with fault, pytest.raises(LostError, match=name) as raised:
        standing.connection.power_is_done(standing.connection.power(True))
    assert raised.value.cause is MEANINGS[name][0]


@pytest.mark.parametrize(
    ("call", "name", "number"),
    [("AcquireLease", *each) for each in bad(lease_pb2.AcquireLeaseResponse.Status)]
    + [("TakeLease", *each) for each in bad(lease_pb2.TakeLeaseResponse.Status)],
)
def test_every_refusal_of_a_lease_names_itself(standing, lease, call, name, number):
    standing.robot.return_lease(lease)
    standing.connection.give_back()
    own = standing.robot.acquire_lease if call == "AcquireLease" else standing.robot.take_lease
    fault = standing.server.faults.fault(f"bosdyn.api.LeaseService/{call}", Fault(fields={"status": number}))
    with fault, pytest.raises(LeaseError, match=name):
        own("test")


@pytest.mark.parametrize(("name", "number"), bad(lease_pb2.LeaseUseResult.Status))
def test_a_lease_that_is_not_retained_is_lost(standing, lease, name, number):
    fault = Fault(fields={"lease_use_result.status": number, "lease_use_result.owner.client_name": "tablet"})
    standing.robot.heartbeat._beat_s = -math.inf
    with standing.server.faults.fault("bosdyn.api.LeaseService/RetainLease", fault):
        standing.robot.poll()
    command = standing.robot.drive(0.1, 0.0, 0.0, until_s=standing.now() + 1.0, lease=lease)
    status = standing.robot.command_status(command)
    lost = MEANINGS[name][0] is CommandCause.NO_LEASE
    assert (status.cause is CommandCause.NO_LEASE, "tablet" in status.reason) == (lost, lost)


@pytest.mark.parametrize(("name", "number"), bad(estop_pb2.EstopStopLevel))
def test_every_level_of_the_estop_but_none_names_itself(standing, name, number):
    fault = Fault(fields={"status.stop_level": number})
    with standing.server.faults.fault("bosdyn.api.EstopService/GetEstopSystemStatus", fault):
        assert name in standing.connection.estop_trouble()


@pytest.mark.parametrize(
    ("call", "name", "number"),
    [("SetEstopConfig", *each) for each in bad(estop_pb2.SetEstopConfigResponse.Status)]
    + [("RegisterEstopEndpoint", *each) for each in bad(estop_pb2.RegisterEstopEndpointResponse.Status)]
    + [("EstopCheckIn", *each) for each in bad(estop_pb2.EstopCheckInResponse.Status)],
)
def test_an_estop_that_cannot_be_ours_names_the_status(credentials, call, name, number):
    step = LockStep(
        lambda: (ScriptedRobot(clock := VirtualClock(), capabilities=spot_capabilities()), clock), credentials
    )
    try:
        fault = step.server.faults.fault(f"bosdyn.api.EstopService/{call}", Fault(fields={"status": number}))
        with fault, pytest.raises(LostError, match=name) as raised:
            step.robot.heartbeat.hold_estop()
        assert raised.value.cause is MEANINGS[name][0]
    finally:
        step.close()


@pytest.mark.parametrize(("name", "number"), bad(keepalive_pb2.ModifyPolicyResponse.Status))
def test_a_policy_that_is_refused_names_the_status(standing, lease, name, number):
    fault = Fault(fields={"status": number})
    call = standing.server.faults.fault("bosdyn.api.keepalive.KeepaliveService/ModifyPolicy", fault)
    with call, pytest.raises(LostError, match=name) as raised:
        standing.robot.heartbeat.add_policy()
    assert raised.value.cause is MEANINGS[name][0]


@pytest.mark.parametrize(("name", "number"), bad(keepalive_pb2.CheckInResponse.Status))
def test_a_policy_that_is_gone_is_added_again(standing, lease, name, number):
    beats = standing.robot.heartbeat
    beats.add_policy()
    before = beats._policy
    fault = Fault(fields={"status": number})
    with standing.server.faults.fault("bosdyn.api.keepalive.KeepaliveService/CheckIn", fault):
        beats._beat_s = -math.inf
        standing.robot.poll()
    assert beats._policy > before
    beats.remove_policy()


@pytest.mark.parametrize(("name", "number"), bad(image_pb2.ImageResponse.Status))
def test_every_picture_that_fails_names_the_status(standing, name, number):
    fault = Fault(fields={"image_responses.status": number})
    call = standing.server.faults.fault("bosdyn.api.ImageService/GetImage", fault)
    with call, pytest.raises(NoImageError, match=name):
        standing.robot.image("hand")


@pytest.mark.parametrize(("name", "number"), bad(point_cloud_pb2.PointCloudResponse.Status))
def test_a_point_cloud_that_fails_leaves_the_last_scan(standing, name, number):
    standing.advance(0.2)
    last = standing.robot.scan()
    fault = Fault(fields={"point_cloud_responses.status": number})
    with standing.server.faults.fault("bosdyn.api.PointCloudService/GetPointCloud", fault):
        standing.advance(0.3)
        assert standing.robot.scan() is last
    standing.advance(0.2)
    assert standing.robot.scan().stamp_s > last.stamp_s


@pytest.mark.parametrize("fault", [Fault(fields={"header.error.code": 2}), Fault(code=grpc.StatusCode.INTERNAL)])
def test_a_state_that_fails_leaves_the_last(standing, lease, fault):
    standing.advance(0.1)
    before = standing.robot.odometry()
    with standing.server.faults.fault("bosdyn.api.RobotStateService/GetRobotState", fault):
        standing.advance(1.0)
        assert standing.robot.odometry() is before
        command = standing.robot.drive(0.1, 0.0, 0.0, until_s=standing.now() + 1.0, lease=lease)
        assert standing.robot.command_status(command).cause is CommandCause.NO_ANSWER
