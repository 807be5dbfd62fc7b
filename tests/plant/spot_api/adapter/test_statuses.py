"""Statuses of the API: each that the SDK defines and the adapter reads has a cause and a fix."""

import grpc
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
    time_sync_pb2,
)
from bosdyn.api.docking import docking_pb2
from bosdyn.api.keepalive import keepalive_pb2
from bosdyn.api.spot import door_pb2

from plant.spot_api.adapter.commands import Sent, SentCommands, status_of
from plant.spot_api.adapter.statuses import CODES, GOOD, MEANINGS, call_trouble, response_trouble, trouble
from skills.robot import CommandCause, CommandState

READ = (
    header_pb2.CommonError.Code,
    docking_pb2.DockingCommandResponse.Status,
    docking_pb2.DockingCommandFeedbackResponse.Status,
    door_pb2.OpenDoorCommandResponse.Status,
    door_pb2.DoorCommand.Feedback.Status,
    lease_pb2.LeaseUseResult.Status,
    lease_pb2.AcquireLeaseResponse.Status,
    lease_pb2.TakeLeaseResponse.Status,
    lease_pb2.ReturnLeaseResponse.Status,
    robot_command_pb2.RobotCommandResponse.Status,
    basic_command_pb2.RobotCommandFeedbackStatus.Status,
    basic_command_pb2.StandCommand.Feedback.Status,
    basic_command_pb2.SitCommand.Feedback.Status,
    arm_command_pb2.ArmJointMoveCommand.Feedback.Status,
    arm_command_pb2.ArmJointMoveCommand.Feedback.PlannerStatus,
    gripper_command_pb2.ClawGripperCommand.Feedback.Status,
    power_pb2.PowerCommandStatus,
    estop_pb2.EstopStopLevel,
    estop_pb2.SetEstopConfigResponse.Status,
    estop_pb2.RegisterEstopEndpointResponse.Status,
    estop_pb2.DeregisterEstopEndpointResponse.Status,
    estop_pb2.EstopCheckInResponse.Status,
    keepalive_pb2.ModifyPolicyResponse.Status,
    keepalive_pb2.CheckInResponse.Status,
    time_sync_pb2.TimeSyncState.Status,
    image_pb2.ImageResponse.Status,
    point_cloud_pb2.PointCloudResponse.Status,
)
STATUSES = [(statuses, value.name, value.number) for statuses in READ for value in statuses.DESCRIPTOR.values]
BAD = [each for each in STATUSES if each[1] not in GOOD]


def test_every_status_is_known():
    assert {name for _, name, _ in STATUSES} == {*GOOD, *MEANINGS}


@pytest.mark.parametrize(
    ("statuses", "name", "number"), BAD, ids=[f"{each[0].DESCRIPTOR.name}-{each[1]}" for each in BAD]
)
def test_a_status_that_is_no_success_has_a_cause_and_names_itself_and_the_fix(statuses, name, number):
    found = trouble(statuses.DESCRIPTOR, number, "as the robot says")
    assert found.cause is not CommandCause.NONE
    assert f"({name}: as the robot says)" in found.text
    assert len(found.text.partition(" (")[0]) > 20


@pytest.mark.parametrize("name", sorted(GOOD))
def test_a_status_of_success_is_no_trouble(name):
    statuses, _, number = next(each for each in STATUSES if each[1] == name)
    assert trouble(statuses.DESCRIPTOR, number) is None


def test_a_status_that_only_a_newer_robot_knows_is_a_refusal():
    found = trouble(robot_command_pb2.RobotCommandResponse.Status.DESCRIPTOR, 999)
    assert (found.cause, "status 999" in found.text) == (CommandCause.REFUSED, True)


class Failed(grpc.RpcError):
    def __init__(self, code):
        self._code = code

    def code(self):
        return self._code

    def details(self):
        return "details"


@pytest.mark.parametrize("code", [code for code in grpc.StatusCode if code is not grpc.StatusCode.OK])
def test_every_grpc_code_has_a_cause(code):
    assert code in CODES
    found = call_trouble(Failed(code))
    assert found.cause is CODES[code][0] is not CommandCause.NONE
    assert f"({code.name}: details)" in found.text


def test_a_lease_trouble_names_the_holder():
    answer = robot_command_pb2.RobotCommandResponse()
    answer.lease_use_result.status = lease_pb2.LeaseUseResult.STATUS_OLDER
    answer.lease_use_result.owner.client_name = "tablet"
    found = response_trouble(answer)
    assert (found.cause, found.holder) == (CommandCause.NO_LEASE, "tablet")
    assert found.text.startswith("the lease is held by tablet")


def test_the_header_counts_first():
    answer = robot_command_pb2.RobotCommandResponse(status=robot_command_pb2.RobotCommandResponse.STATUS_DOCKED)
    answer.header.error.code, answer.header.error.message = header_pb2.CommonError.CODE_INVALID_REQUEST, "a field"
    assert "CODE_INVALID_REQUEST: a field" in response_trouble(answer).text


MOVE = arm_command_pb2.ArmJointMoveCommand.Feedback
CLAW = gripper_command_pb2.ClawGripperCommand.Feedback
FEEDBACK = basic_command_pb2.RobotCommandFeedbackStatus
PARTS = {
    "base": "mobility_command_feedback.se2_velocity_feedback",
    "posture": "mobility_command_feedback.stand_feedback",
    "arm": "arm_command_feedback.arm_joint_move_feedback",
    "gripper": "gripper_command_feedback.claw_gripper_feedback",
}


def feedback(part, number, own=None):
    """Feedback with a status of the command, and one of its part."""
    made = robot_command_pb2.RobotCommandFeedback().synchronized_feedback
    whole, _, field = PARTS[part].partition(".")
    getattr(made, whole).status = number
    getattr(getattr(made, whole), field).SetInParent()
    if own is not None:
        getattr(getattr(made, whole), field).status = own
    return made


@pytest.mark.parametrize("part", PARTS)
@pytest.mark.parametrize(
    ("number", "cause"),
    [
        (FEEDBACK.STATUS_UNKNOWN, CommandCause.REFUSED),
        (FEEDBACK.STATUS_COMMAND_OVERRIDDEN, CommandCause.STOPPED),
        (FEEDBACK.STATUS_ROBOT_FROZEN, CommandCause.STOPPED),
        (FEEDBACK.STATUS_INCOMPATIBLE_HARDWARE, CommandCause.UNSUPPORTED),
        (999, CommandCause.REFUSED),
    ],
)
def test_a_command_that_the_robot_has_ended_is_stopped_with_the_cause(part, number, cause):
    status = status_of(feedback(part, number), part)
    assert (status.state, status.cause) == (CommandState.STOPPED, cause)


@pytest.mark.parametrize(("part", "state"), [("base", CommandState.DONE), ("arm", CommandState.STOPPED)])
def test_a_command_that_has_timed_out_is_done_only_for_a_drive(part, state):
    assert status_of(feedback(part, FEEDBACK.STATUS_COMMAND_TIMED_OUT), part).state is state


@pytest.mark.parametrize(
    ("part", "own", "state", "cause"),
    [
        ("arm", MOVE.STATUS_UNKNOWN, CommandState.STOPPED, CommandCause.REFUSED),
        ("arm", MOVE.STATUS_IN_PROGRESS, CommandState.RUNNING, CommandCause.NONE),
        ("arm", MOVE.STATUS_COMPLETE, CommandState.DONE, CommandCause.NONE),
        ("arm", MOVE.STATUS_STALLED, CommandState.STOPPED, CommandCause.BLOCKED),
        ("gripper", CLAW.STATUS_UNKNOWN, CommandState.STOPPED, CommandCause.REFUSED),
        ("gripper", CLAW.STATUS_IN_PROGRESS, CommandState.RUNNING, CommandCause.NONE),
        ("gripper", CLAW.STATUS_AT_GOAL, CommandState.DONE, CommandCause.NONE),
        ("gripper", CLAW.STATUS_APPLYING_FORCE, CommandState.DONE, CommandCause.NONE),
        ("posture", 0, CommandState.STOPPED, CommandCause.REFUSED),
        ("posture", 1, CommandState.DONE, CommandCause.NONE),
        ("posture", 2, CommandState.RUNNING, CommandCause.NONE),
    ],
)
def test_the_status_of_a_part_is_that_of_its_feedback(part, own, state, cause):
    status = status_of(feedback(part, FEEDBACK.STATUS_PROCESSING, own), part)
    assert (status.state, status.cause) == (state, cause)


def test_a_path_that_the_robot_cannot_follow_is_blocked():
    given = feedback("arm", FEEDBACK.STATUS_PROCESSING, MOVE.STATUS_IN_PROGRESS)
    given.arm_command_feedback.arm_joint_move_feedback.planner_status = MOVE.PLANNER_STATUS_FAILED
    assert status_of(given, "arm").cause is CommandCause.BLOCKED


def test_a_command_that_runs_is_remembered_whatever_comes_later():
    commands = SentCommands()
    arm, first = commands.add(Sent(1, "arm")), commands.add(Sent(2, "base"))
    for number in range(2000):
        commands.add(Sent(number, "base"))
    assert commands.get(arm).status.state is CommandState.RUNNING
    assert (commands.get(first).status.state, len(commands.running())) == (CommandState.STOPPED, 2)
    with pytest.raises(KeyError):
        commands.get(first + 5000)
