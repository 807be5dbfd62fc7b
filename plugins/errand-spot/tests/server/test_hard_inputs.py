"""Hard inputs: the answer is the API's own error, the server goes on, and nothing is logged as an error."""

import logging
import time

import pytest

pytest.importorskip("bosdyn.client", reason="not installed: pip install errand-spot")

from bosdyn.api import robot_command_pb2

from errand_spot.adapter.connection import Address, Connection
from tests.benchmarks.spot_fuzz import Errors, fuzz, idle_clients, large_request, revive, standing
from tests.benchmarks.spot_kills import PASSWORD, USER
from tests.tables import table

Status = robot_command_pb2.RobotCommandResponse.Status


@pytest.fixture(scope="module")
def served():
    with standing() as made:
        yield made


@pytest.fixture
def errors():
    logging.getLogger().addHandler(handler := Errors())
    yield handler.texts
    logging.getLogger().removeHandler(handler)


def test_malformed_messages_get_the_errors_of_the_api(served, errors, capfd):
    server, connection, channel = served
    codes, inside = fuzz(server.computer, connection, channel, 800, seed=1)
    assert set(codes) <= {"INVALID_ARGUMENT", "CODE_OK", "CODE_INVALID_REQUEST"}
    assert (inside, errors) == ([], []) and "Traceback" not in capfd.readouterr().err


def test_a_message_of_100_mb_is_refused(served):
    _, connection, channel = served
    assert large_request(channel) == "RESOURCE_EXHAUSTED"
    assert connection.state().robot_state.kinematic_state.joint_states


def test_a_new_client_is_served_beside_many_that_are_idle(served):
    server, _, _ = served
    idle = idle_clients(server.port, server.certificate, 100)
    begun_s = time.monotonic()
    assert Connection(Address("127.0.0.1", server.port, server.certificate), USER, PASSWORD).state()
    assert time.monotonic() - begun_s < 2.0
    for each in idle:
        each.close()


def joint_move(point_s, count):
    points = [{"time_since_reference": {"seconds": point_s}}] * count
    return {"arm_joint_move_command": {"trajectory": {"points": points}}}


def hand_move(point_s, count):
    point = {"pose": {"position": {"x": 0.7, "z": 0.3}}, "time_since_reference": {"seconds": point_s}}
    return {
        "arm_cartesian_command": {"root_frame_name": "body", "pose_trajectory_in_task": {"points": [point] * count}}
    }


@pytest.mark.parametrize("move", [joint_move, hand_move])
@pytest.mark.parametrize(*table(__file__, "too_long"))
def test_a_trajectory_that_is_too_long_is_refused(served, move, point_s, count, status, said):
    server, connection, _ = served
    revive(server.computer, connection)
    command = {"synchronized_command": {"arm_command": move(point_s, count)}}
    request = robot_command_pb2.RobotCommandRequest(lease=connection.lease, command=command)
    answer = connection.call("robot-command", "RobotCommand", request, checked=False)
    assert (Status.Name(answer.status), said in answer.message) == (status, True), answer
