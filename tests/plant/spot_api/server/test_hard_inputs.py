"""Hard inputs: the answer is the API's own error, the server goes on, and nothing is logged as an error.

malformed messages over all calls   an error of the API, never an internal one
a message of 100 MB                 refused
many idle clients                   a new client is served
a time or a number too large        too distant, invalid request
"""

import logging
import time

import pytest

pytest.importorskip("bosdyn.client", reason="not installed: pip install 'spot-errand[spot]'")

from bosdyn.api import geometry_pb2, robot_command_pb2

from plant.spot_api.adapter.connection import Address, Connection
from tests.benchmarks.spot_fuzz import Errors, fuzz, idle_clients, large_request, revive, standing
from tests.benchmarks.spot_kills import PASSWORD, USER

Status = robot_command_pb2.RobotCommandResponse


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
    assert (inside, errors) == ([], [])
    assert "Traceback" not in capfd.readouterr().err


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
    made = robot_command_pb2.RobotCommand()
    made.synchronized_command.arm_command.arm_joint_move_command.SetInParent()
    trajectory = made.synchronized_command.arm_command.arm_joint_move_command.trajectory
    for _ in range(count):
        trajectory.points.add().time_since_reference.seconds = point_s
    return made


def hand_move(point_s, count):
    made = robot_command_pb2.RobotCommand()
    hand = made.synchronized_command.arm_command.arm_cartesian_command
    hand.root_frame_name = "body"
    for _ in range(count):
        point = hand.pose_trajectory_in_task.points.add(pose=geometry_pb2.SE3Pose(position={"x": 0.7, "z": 0.3}))
        point.time_since_reference.seconds = point_s
    return made


@pytest.mark.parametrize("move", [joint_move, hand_move])
@pytest.mark.parametrize(
    ("point_s", "count", "status", "said"),
    [
        (2**31, 2, Status.STATUS_TOO_DISTANT, "at most 600 s"),
        (1, 251, Status.STATUS_INVALID_REQUEST, "251 points; 1 to 250"),
        (1, 0, Status.STATUS_INVALID_REQUEST, "no points"),
    ],
)
def test_a_trajectory_that_is_too_long_is_refused(served, move, point_s, count, status, said):
    server, connection, _ = served
    revive(server.computer, connection)
    request = robot_command_pb2.RobotCommandRequest(lease=connection.lease, command=move(point_s, count))
    answer = connection.call("robot-command", "RobotCommand", request, checked=False)
    assert (answer.status, said in answer.message) == (status, True), answer
