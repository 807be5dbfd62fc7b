"""Commands that the robot carries out although it refuses them, and refusals of power, E-stop and policy.

Each has its cause within a second, and nothing moves on. Only a lease that does not count moves nothing. A robot that
has begun to sit down or to stand up comes to rest there, and a gripper at its opening.
"""

import math
from contextlib import contextmanager

import numpy as np
import pytest
from bosdyn.api import estop_pb2, header_pb2, lease_pb2, power_pb2, robot_command_pb2
from bosdyn.api.keepalive import keepalive_pb2
from call_faults import Fault
from lock_step import LockStep, scripted

from errand_spot.adapter.connection import Connection, LostError
from errand_spot.adapter.statuses import CODES, GOOD, MEANINGS
from plant.robots.spot.kind import spot_capabilities
from skills.robot import ArmTrajectory, CommandCause, CommandState

READY_RAD = np.array([0.0, -0.9, 1.8, 0.0, -0.9, 0.0])
COMMANDS = "bosdyn.api.RobotCommandService"


def bad(statuses):
    """Names and numbers of the statuses that are no success."""
    return [(value.name, value.number) for value in statuses.DESCRIPTOR.values if value.name not in GOOD]


@contextmanager
def lost(step, call, name, fields):
    """Asserts that a call whose answer has a status is an error with its name and its cause."""
    fault = step.server.faults.fault(f"bosdyn.api.{call}", Fault(fields=fields))
    with fault, pytest.raises(LostError, match=name) as raised:
        yield
    assert raised.value.cause is MEANINGS[name][0]


@pytest.fixture(scope="module")
def standing(credentials):
    step = LockStep(scripted, credentials)
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


def answered_with(standing, lease, verb, fault):
    """Commands with a fault; returns the status within a second, and whether something moves on."""
    with standing.server.faults.fault(f"{COMMANDS}/RobotCommand", fault):
        with pytest.MonkeyPatch.context() as patch:
            if math.inf in (fault.request_s, fault.answer_s):
                patch.setattr(Connection.call, "__defaults__", (0.1,))  # its timeout
            command = VERBS[verb](standing, until_s=standing.now() + 30.0, lease=lease)
        standing.until(lambda: standing.status(command).state is not CommandState.RUNNING, 1.0, every_s=0.025)
    standing.advance(0.025)  # the part is halted
    standing.advance(0.65 if verb == "drive" else 0.1)  # a drive that the robot has begun ends by itself
    before = motion(standing)
    standing.advance(0.2)
    return standing.robot.command_status(command), motion(standing) != before


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


KINDS = {"STATUS_UNKNOWN", "lease-STATUS_OLDER", "CODE_INTERNAL_SERVER_ERROR", "UNAVAILABLE"}
KINDS |= {"request-lost", "answer-lost"}
"""An answer of each kind: every verb meets it by day. One verb meets each other answer, the rest by night."""


def answers():
    """Each answer with each verb."""
    for row, case in enumerate(CASES):
        for column, verb in enumerate(VERBS):
            by_day = case in KINDS or (row + column) % len(VERBS) == 0
            yield pytest.param(case, verb, marks=[pytest.mark.nightly] * (not by_day), id=f"{case}-{verb}")


def test_every_kind_of_answer_is_one_of_the_cases():
    assert set(CASES) >= KINDS


@pytest.mark.parametrize(("case", "verb"), list(answers()))
def test_every_answer_to_a_command_has_its_cause_and_moves_nothing_on(standing, lease, verb, case):
    fault, cause = CASES[case]
    status, moves = answered_with(standing, lease, verb, fault)
    assert (status.state, status.cause, moves) == (CommandState.REFUSED, cause, False)
    assert case.removeprefix("lease-") in status.reason or "lost" in case


@pytest.mark.parametrize(("name", "number"), bad(power_pb2.PowerCommandStatus))
def test_every_feedback_of_a_power_command_has_its_cause(standing, lease, name, number):
    with lost(standing, "PowerService/PowerCommandFeedback", name, {"status": number}):
        standing.connection.power_is_done(standing.connection.power(True))


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
def test_an_estop_that_cannot_be_ours_names_the_status(step, call, name, number):
    with lost(step, f"EstopService/{call}", name, {"status": number}):
        step.robot.heartbeat.hold_estop()


@pytest.mark.parametrize(("name", "number"), bad(keepalive_pb2.ModifyPolicyResponse.Status))
def test_a_policy_that_is_refused_names_the_status(standing, lease, name, number):
    with lost(standing, "keepalive.KeepaliveService/ModifyPolicy", name, {"status": number}):
        standing.robot.heartbeat.add_policy()


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
