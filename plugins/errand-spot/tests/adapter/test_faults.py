"""Every status of every response of the adapter, against a server with that fault; `test_refusals` has commands."""

import math
from itertools import product

import numpy as np
import pytest
from bosdyn.api import (
    image_pb2,
    lease_pb2,
    point_cloud_pb2,
    power_pb2,
    robot_command_pb2,
    robot_state_pb2,
    time_sync_pb2,
)
from call_faults import Fault
from lock_step import PASSWORD, USER, LockStep, scripted
from proxy import Proxy

from errand_spot.adapter.connection import SLOW_S, Address, Connection, LostError
from errand_spot.adapter.robot import ApiRobot
from errand_spot.adapter.statuses import trouble
from plant.robots.spot.kind import spot_capabilities
from skills.robot import ArmTrajectory, CommandCause, CommandState, LeaseError, NoImageError

API = "bosdyn.api."
FEEDBACK = API + "RobotCommandService/RobotCommandFeedback"
WITHIN_S, EXPIRY_S = 1.0, 3.0
TO_ARM_RAD = np.array([spot_capabilities().arm.stowed_rad, [0.0, -0.9, 1.8, 0.0, -0.9, 0.0]])
VERBS_OF = {
    "mobility_command_feedback": ("drive", "stand", "sit"),
    "arm_command_feedback": ("move_arm",),
    "gripper_command_feedback": ("set_gripper",),
    "sit_feedback": ("sit",),
    "stand_feedback": ("stand",),
    "arm_joint_move_feedback": ("move_arm",),
    "claw_gripper_feedback": ("set_gripper",),
}
"""Verbs whose feedback has a field."""
ROBOT_ENDED = ("STATUS_COMMAND_OVERRIDDEN", "STATUS_ROBOT_FROZEN")
"""Statuses by which the robot does something else: the adapter does not stop that."""
GOING = ("STATUS_PROCESSING", "STATUS_IN_PROGRESS")
SUCCESS = ("STATUS_COMPLETE", "STATUS_IS_STANDING", "STATUS_IS_SITTING", "STATUS_AT_GOAL", "STATUS_APPLYING_FORCE")


def statuses(enum, *but):
    """Numbers and names of an enum's values, those in `but` left out."""
    return [(value.number, value.name) for value in enum.values if value.name not in but]


def status_fields(message, prefix=""):
    """Paths of the fields called `status` within a message, with their enums."""
    for field in message.fields:
        if field.enum_type is not None and field.name == "status":
            yield prefix + field.name, field.enum_type
        elif field.message_type is not None and field.name not in ("header", "request"):
            yield from status_fields(field.message_type, f"{prefix}{field.name}.")


def feedbacks():
    """A verb, a path in its feedback, the value of its status and its name; by day one verb meets each status."""
    found = robot_command_pb2.RobotCommandFeedbackResponse.DESCRIPTOR.fields_by_name["feedback"].message_type
    for path, enum in status_fields(found, "feedback."):
        verbs = VERBS_OF.get(path.split(".")[-2], ())
        for verb, (number, name) in product(verbs, statuses(enum)):
            by_day = verb == verbs[number % len(verbs)] or name == "STATUS_COMMAND_TIMED_OUT"
            marks = () if by_day else pytest.mark.nightly
            yield pytest.param(verb, path, enum, number, name, marks=marks, id=f"{verb}-{name}")


@pytest.fixture(scope="module")
def shared(credentials):
    made = LockStep(scripted, credentials)
    made.stand_up()
    yield made
    made.close()


@pytest.fixture
def step(shared):
    """The robot in lock-step: it stands still with its arm stowed and its gripper closed, and has the lease."""
    if shared.connection.lease is None or shared.robot.lease_holder() is None:
        shared.lease = shared.robot.take_lease("test")
    robot = shared.served
    shared.server.computer.stop_parts(("mobility", "arm", "gripper"))
    robot.velocity[:], robot.height_m, robot.pitch_rad, robot.opening = 0.0, 0.52, 0.0, 0.0
    robot.q_rad = np.array(spot_capabilities().arm.stowed_rad)
    shared.advance(0.05)
    return shared


SENDS = {
    "drive": lambda robot, end: robot.drive(0.4, 0.0, 0.2, **end),
    "stand": lambda robot, end: robot.stand(0.42, 0.1, **end),
    "sit": lambda robot, end: robot.sit(**end),
    "move_arm": lambda robot, end: robot.move_arm(ArmTrajectory(np.array([0.0, 4.0]), TO_ARM_RAD), **end),
    "set_gripper": lambda robot, end: robot.set_gripper(1.2, 40.0, **end),
}


def sent(step, verb):
    """Sends a verb that takes longer than a second."""
    return SENDS[verb](step.robot, step.until_in(EXPIRY_S))


def ended(step, command, within_s=WITHIN_S):
    """Advances until the command has ended; returns its status."""
    step.until(lambda: step.robot.command_status(command).state is not CommandState.RUNNING, within_s, every_s=0.2)
    return step.robot.command_status(command)


def moves(step):
    """Returns whether base or arm move."""
    before = step.served.pose, step.served.q_rad.copy()
    step.advance(0.1)
    return step.served.pose != before[0] or bool(np.abs(step.served.q_rad - before[1]).max() > 1e-6)


@pytest.mark.parametrize(("verb", "path", "enum", "number", "name"), list(feedbacks()))
def test_a_command_ends_as_its_feedback_says(step, verb, path, enum, number, name):
    begun_s = step.now()
    with step.server.faults.fault(FEEDBACK, Fault(fields={path: number})):
        status = ended(step, sent(step, verb))
    late = name == "STATUS_COMMAND_TIMED_OUT"
    if name in GOING:
        assert status.state is not CommandState.STOPPED or status.cause is CommandCause.LATE
    elif name in SUCCESS or (verb == "drive" and late):
        assert status.state is CommandState.DONE
    else:
        cause = CommandCause.LATE if late else trouble(enum, number).cause
        assert (status.state, status.cause, bool(status.reason)) == (CommandState.STOPPED, cause, True)
        step.advance(begun_s + WITHIN_S - step.now())
        assert name in ROBOT_ENDED or not moves(step)


@pytest.mark.parametrize(
    ("verb", "number"),
    [
        *(("acquire", number) for number, _ in statuses(lease_pb2.AcquireLeaseResponse.Status.DESCRIPTOR, "STATUS_OK")),
        *(("take", number) for number, _ in statuses(lease_pb2.TakeLeaseResponse.Status.DESCRIPTOR, "STATUS_OK")),
    ],
)
def test_a_lease_that_is_not_given_is_an_error(step, verb, number):
    step.robot.return_lease(step.lease)
    step.connection.give_back()
    fault = Fault(fields={"status": number}, handled=False)
    with step.server.faults.fault(f"{API}LeaseService/{verb.title()}Lease", fault), pytest.raises(LeaseError):
        getattr(step.robot, f"{verb}_lease")("test")
    assert step.robot.lease_holder() is None


RESULTS = statuses(lease_pb2.LeaseUseResult.Status.DESCRIPTOR, "STATUS_OK", "STATUS_UNMANAGED")


@pytest.mark.parametrize(("number", "name"), RESULTS, ids=[name for _, name in RESULTS])
def test_a_lease_that_is_not_retained_does_not_count(step, number, name):
    step.robot.heartbeat._beat_s = -math.inf
    retain = f"{API}LeaseService/RetainLease"
    with step.server.faults.fault(retain, Fault(fields={"lease_use_result.status": number}, handled=False)):
        step.advance(0.05)
    if name != "STATUS_UNKNOWN":
        assert step.robot.lease_holder() != step.lease
        assert ended(step, sent(step, "drive")).cause is CommandCause.NO_LEASE


@pytest.mark.parametrize("number", [n for n, _ in statuses(image_pb2.ImageResponse.Status.DESCRIPTOR, "STATUS_OK")])
def test_a_picture_that_is_not_taken_is_an_error(step, number):
    fault = Fault(fields={"image_responses.status": number})
    with step.server.faults.fault(f"{API}ImageService/GetImage", fault), pytest.raises(NoImageError):
        step.robot.image("hand")


@pytest.mark.parametrize(
    "number", [n for n, _ in statuses(point_cloud_pb2.PointCloudResponse.Status.DESCRIPTOR, "STATUS_OK")]
)
def test_a_scan_that_does_not_come_leaves_the_last_one(step, number):
    before = step.robot.scan()
    fault = Fault(fields={"point_cloud_responses.status": number})
    with step.server.faults.fault(f"{API}PointCloudService/GetPointCloud", fault):
        step.advance(0.3)
        assert step.robot.scan() is before
    step.advance(0.3)
    assert step.robot.scan() is not before


POWER = power_pb2.PowerCommandStatus.DESCRIPTOR


@pytest.mark.parametrize("number", [n for n, _ in statuses(POWER, "STATUS_IN_PROGRESS", "STATUS_SUCCESS")])
def test_power_that_is_not_switched_is_an_error_with_its_cause(step, number):
    fault = Fault(fields={"status": number}, handled=False)
    with step.server.faults.fault(f"{API}PowerService/PowerCommand", fault), pytest.raises(LostError) as lost:
        step.connection.power(False)
    assert lost.value.cause is trouble(POWER, number).cause
    step.advance(0.1)
    assert step.robot.powered


@pytest.mark.parametrize("number", [n for n, _ in statuses(time_sync_pb2.TimeSyncState.Status.DESCRIPTOR, "STATUS_OK")])
def test_a_clock_that_is_not_synchronised_stays_as_it_was(step, number):
    before = step.connection._ahead_s
    fault = Fault(fields={"state.status": number})
    with step.server.faults.fault(f"{API}TimeSyncService/TimeSyncUpdate", fault), pytest.raises(LostError):
        step.connection.synchronise(timeout_s=SLOW_S)
    assert step.connection._ahead_s == before


STATE = f"{API}RobotStateService/GetRobotState"
MOTORS = statuses(robot_state_pb2.PowerState.MotorPowerState.DESCRIPTOR)
ESTOPS = statuses(robot_state_pb2.EStopState.State.DESCRIPTOR)


@pytest.mark.parametrize(("number", "name"), MOTORS, ids=[name for _, name in MOTORS])
def test_the_motors_have_power_only_when_the_robot_says_on(step, number, name):
    path = "robot_state.power_state.motor_power_state"
    with step.server.faults.fault(STATE, Fault(fields={path: number})):
        step.advance(0.05)
    assert step.robot.powered is name.endswith("STATE_ON")
    assert bool(step.robot.stopped_because()) is not step.robot.powered


@pytest.mark.parametrize(("number", "name"), ESTOPS, ids=[name for _, name in ESTOPS])
def test_an_estop_is_released_only_when_the_robot_says_so(step, number, name):
    with step.server.faults.fault(STATE, Fault(fields={"robot_state.estop_states.state": number})):
        step.advance(0.05)
    assert ("the E-stop is pressed" in step.robot.faults()) is (name != "STATE_NOT_ESTOPPED")


def test_a_cut_connection_ends_what_runs_and_nothing_moves_on(step, credentials):
    proxy = Proxy(step.server.port)
    step.robot.return_lease(step.lease)
    step.connection.give_back()
    connection = Connection(Address("127.0.0.1", proxy.port, credentials.certificate), USER, PASSWORD)
    connection.synchronise(timeout_s=SLOW_S)
    ours, step.robot = step.robot, ApiRobot("Alice", connection, step, spot_capabilities())
    try:
        step.lease = step.robot.take_lease("test")
        running, begun_s = sent(step, "drive"), step.now()
        proxy.cut()
        assert ended(step, running).cause is CommandCause.NO_ANSWER
        assert ended(step, sent(step, "drive")).cause is CommandCause.NO_ANSWER
        step.advance(begun_s + WITHIN_S - step.now())
        assert not moves(step)
    finally:
        step.robot = ours
