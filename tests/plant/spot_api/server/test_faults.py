"""Faults that a test sets for calls of the server.

request lost, answer lost   the deadline passes; only with the answer lost the robot has done it
late                        the answer comes, later
gRPC code, field            as set; not handled: the robot does nothing
"""

import math
import time

import bosdyn.client
import grpc
import pytest
from bosdyn.api import lease_pb2
from bosdyn.client.exceptions import InternalServerError, TimedOutError, UnableToConnectToRobotError

from plant.spot_api.server.faults import Fault

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
    assert is_claimed(served) is done
    assert leases.take(timeout=1.0)


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


def test_a_status_and_an_error_of_the_header_are_as_set(served, leases):
    status = lease_pb2.TakeLeaseResponse.STATUS_INVALID_RESOURCE
    with (
        served.server.faults.fault(TAKE, Fault(fields={"status": status})),
        pytest.raises(bosdyn.client.lease.InvalidResourceError),
    ):
        leases.take()
    with (
        served.server.faults.fault(TAKE, Fault(fields={"header.error.code": 2}, handled=False)),
        pytest.raises(InternalServerError),
    ):
        leases.take()


def test_a_field_in_a_list_is_set_in_each_element(served):
    images = served.login().ensure_client("image")
    fault = Fault(fields={"image_responses.status": 4})
    with (
        served.server.faults.fault("bosdyn.api.ImageService/GetImage", fault),
        pytest.raises(bosdyn.client.image.ImageDataError),
    ):
        images.get_image_from_sources(["frontleft_fisheye_image", "hand_color_image"])


def test_other_calls_are_answered(served, leases):
    with served.server.faults.fault(STATE, Fault(code=grpc.StatusCode.UNAVAILABLE)):
        assert leases.take()
