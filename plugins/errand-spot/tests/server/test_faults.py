"""Faults that a test sets for calls of the server."""

import math
import time

import bosdyn.client
import grpc
import pytest
from bosdyn.api import lease_pb2
from bosdyn.client.exceptions import InternalServerError, TimedOutError, UnableToConnectToRobotError
from call_faults import Fault

INVALID = lease_pb2.TakeLeaseResponse.STATUS_INVALID_RESOURCE
TAKE, STATE = "bosdyn.api.LeaseService/TakeLease", "bosdyn.api.RobotStateService/GetRobotState"


@pytest.fixture
def leases(served):
    return served.login().ensure_client("lease")


def is_claimed(served):
    return bool(served.server.computer.leases._claims)


@pytest.mark.parametrize(("lost", "done"), [("request_s", False), ("answer_s", True)])
def test_a_lost_call_is_not_answered_before_the_deadline(served, leases, lost, done):
    with served.server.faults.fault(TAKE, Fault(**{lost: math.inf})), pytest.raises(TimedOutError):
        leases.take(timeout=0.2)
    assert is_claimed(served) is done and leases.take(timeout=1.0)


def test_a_late_answer_comes_late(served):
    client, begun_s = served.login().ensure_client("robot-state"), time.monotonic()
    with served.server.faults.fault("*", Fault(answer_s=0.3)):
        client.get_robot_state()
    assert time.monotonic() - begun_s >= 0.3


@pytest.mark.parametrize("handled", [True, False])
def test_a_call_that_is_not_handled_changes_nothing(served, leases, handled):
    fault = Fault(code=grpc.StatusCode.UNAVAILABLE, handled=handled)
    with served.server.faults.fault(TAKE, fault), pytest.raises(UnableToConnectToRobotError):
        leases.take()
    assert is_claimed(served) is handled


@pytest.mark.parametrize(
    ("fault", "error"),
    [
        (Fault(fields={"status": INVALID}), bosdyn.client.lease.InvalidResourceError),
        (Fault(fields={"header.error.code": 2}, handled=False), InternalServerError),
    ],
)
def test_a_status_and_an_error_of_the_header_are_as_set(served, leases, fault, error):
    with served.server.faults.fault(TAKE, fault), pytest.raises(error):
        leases.take()


def test_a_field_in_a_list_is_set_in_each_element(served):
    images, failed = served.login().ensure_client("image"), bosdyn.client.image.ImageDataError
    fault = served.server.faults.fault("bosdyn.api.ImageService/GetImage", Fault(fields={"image_responses.status": 4}))
    with fault, pytest.raises(failed):
        images.get_image_from_sources(["frontleft_fisheye_image", "hand_color_image"])


def test_other_calls_are_answered(served, leases):
    with served.server.faults.fault(STATE, Fault(code=grpc.StatusCode.UNAVAILABLE)):
        assert leases.take()
