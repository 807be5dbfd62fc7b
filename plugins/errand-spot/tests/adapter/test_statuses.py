"""Statuses of the API: each that the SDK defines and the adapter reads has a cause and a fix."""

import grpc
import pytest
from bosdyn.api import header_pb2, lease_pb2, robot_command_pb2
from google.protobuf import descriptor_pool
from lock_step import FailedCall

from errand_spot.adapter.commands import Sent, SentCommands, status_of
from errand_spot.adapter.statuses import CODES, GOOD, MEANINGS, call_trouble, response_trouble, trouble
from skills.robot import CommandCause, CommandState
from tests.tables import table

READ = [descriptor_pool.Default().FindEnumTypeByName(f"bosdyn.api.{name}") for (name,) in table(__file__, "read")[1]]
STATUSES = [(statuses, value.name, value.number) for statuses in READ for value in statuses.values]
BAD = [each for each in STATUSES if each[1] not in GOOD]


def test_every_status_is_known():
    assert {name for _, name, _ in STATUSES} == {*GOOD, *MEANINGS}


@pytest.mark.parametrize(("statuses", "name", "number"), BAD, ids=[f"{each[0].name}-{each[1]}" for each in BAD])
def test_a_status_that_is_no_success_has_a_cause_and_names_itself_and_the_fix(statuses, name, number):
    found = trouble(statuses, number, "as the robot says")
    assert found.cause is not CommandCause.NONE and f"({name}: as the robot says)" in found.text
    assert len(found.text.partition(" (")[0]) > 20


@pytest.mark.parametrize("name", sorted(GOOD))
def test_a_status_of_success_is_no_trouble(name):
    statuses, _, number = next(each for each in STATUSES if each[1] == name)
    assert trouble(statuses, number) is None


def test_a_status_that_only_a_newer_robot_knows_is_a_refusal():
    found = trouble(robot_command_pb2.RobotCommandResponse.Status.DESCRIPTOR, 999)
    assert (found.cause, "status 999" in found.text) == (CommandCause.REFUSED, True)


@pytest.mark.parametrize("code", [code for code in grpc.StatusCode if code is not grpc.StatusCode.OK])
def test_every_grpc_code_has_a_cause(code):
    assert code in CODES
    found = call_trouble(FailedCall(code, "details"))
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


PARTS = {
    "base": "mobility_command_feedback.se2_velocity_feedback",
    "posture": "mobility_command_feedback.stand_feedback",
    "arm": "arm_command_feedback.arm_joint_move_feedback",
    "gripper": "gripper_command_feedback.claw_gripper_feedback",
}


def feedback(part, whole_status, **own):
    """Feedback with a status of the command, and what its part says."""
    whole, _, field = PARTS[part].partition(".")
    made = robot_command_pb2.RobotCommandFeedback(synchronized_feedback={whole: {"status": whole_status, field: own}})
    return made.synchronized_feedback


@pytest.mark.parametrize("part", PARTS)
@pytest.mark.parametrize(*table(__file__, "ended"))
def test_a_command_that_the_robot_has_ended_is_stopped_with_the_cause(part, status, cause):
    found = status_of(feedback(part, status), part)
    assert (found.state, found.cause) == (CommandState.STOPPED, CommandCause[cause])


@pytest.mark.parametrize(("part", "state"), [("base", CommandState.DONE), ("arm", CommandState.STOPPED)])
def test_a_command_that_has_timed_out_is_done_only_for_a_drive(part, state):
    assert status_of(feedback(part, "STATUS_COMMAND_TIMED_OUT"), part).state is state


@pytest.mark.parametrize(*table(__file__, "parts"))
def test_the_status_of_a_part_is_that_of_its_feedback(part, own, state, cause):
    status = status_of(feedback(part, "STATUS_PROCESSING", status=own), part)
    assert (status.state, status.cause) == (CommandState[state], CommandCause[cause])


def test_a_path_that_the_robot_cannot_follow_is_blocked():
    planner = {"status": "STATUS_IN_PROGRESS", "planner_status": "PLANNER_STATUS_FAILED"}
    assert status_of(feedback("arm", "STATUS_PROCESSING", **planner), "arm").cause is CommandCause.BLOCKED


def test_a_command_that_runs_is_remembered_whatever_comes_later():
    commands = SentCommands()
    arm, first = commands.add(Sent(1, "arm")), commands.add(Sent(2, "base"))
    for number in range(2000):
        commands.add(Sent(number, "base"))
    assert commands.get(arm).status.state is CommandState.RUNNING
    assert (commands.get(first).status.state, len(commands.running())) == (CommandState.STOPPED, 2)
    with pytest.raises(KeyError):
        commands.get(first + 5000)
