"""Calls that are malformed, unknown, or fail inside."""

import itertools
import logging

import bosdyn.client
import grpc
import pytest
from bosdyn.api.graph_nav import graph_nav_pb2
from bosdyn.client.exceptions import InternalServerError

from errand_spot.server import calls
from errand_spot.server.server import Options, SpotServer
from errand_spot.server.state import RobotStateService


@pytest.fixture
def channel(served):
    return served.login().ensure_secure_channel("state.spot.robot")


def as_is(raw):
    return raw


def refusal(call, *data):
    """The gRPC error of a call."""
    with pytest.raises(grpc.RpcError) as refused:
        call(*data, timeout=5.0)
    return refused.value


def test_a_malformed_message_is_an_invalid_argument_without_a_traceback(channel, caplog, capfd):
    call = channel.unary_unary("/bosdyn.api.RobotStateService/GetRobotState", as_is, as_is)
    for data in (b"\xff\xff\xff", b"\x0a\xff", bytes(range(256))):
        assert refusal(call, data).code() is grpc.StatusCode.INVALID_ARGUMENT
    assert "Traceback" not in caplog.text + capfd.readouterr().err


@pytest.mark.parametrize(
    "path",
    ["/bosdyn.api.mission.MissionService/LoadMission", "/bosdyn.api.PowerService/ResetSafetyStop", "/no.Such/Call"],
)
def test_a_call_that_is_not_served_is_named(channel, path):
    refused = refusal(channel.unary_unary(path, as_is, as_is), b"")
    assert (refused.code(), path.strip("/") in refused.details()) == (grpc.StatusCode.UNIMPLEMENTED, True)


def test_a_failure_inside_is_an_internal_error_and_the_server_goes_on(served, monkeypatch, caplog):
    client = served.login().ensure_client("robot-state")
    monkeypatch.setattr(RobotStateService, "_power", lambda *_: 1 / 0)
    with caplog.at_level(logging.CRITICAL), pytest.raises(InternalServerError):
        client.get_robot_state()
    monkeypatch.undo()
    assert client.get_robot_state().power_state.robot_power_state


def test_a_port_in_use_is_one_error(served, credentials):
    port = served.server.port
    with pytest.raises(OSError, match=f"port {port} of 127.0.0.1 cannot be opened"):
        SpotServer(served.scripted, served.server.computer.clock, None, credentials, Options({}, port))


UPLOAD = "/bosdyn.api.graph_nav.GraphNavService/UploadWaypointSnapshot"


@pytest.mark.parametrize("requests", [[], [b"\xff\xff"], [b"", b"\x0a\xff"]], ids=["empty", "malformed", "later"])
def test_a_stream_that_cannot_be_read_is_an_invalid_argument(channel, requests):
    refused = refusal(channel.stream_unary(UPLOAD, as_is, as_is), iter(requests))
    assert refused.code() is grpc.StatusCode.INVALID_ARGUMENT


def test_a_stream_without_end_is_cut(channel, monkeypatch):
    monkeypatch.setattr(calls, "MOST_STREAMED_BYTES", 10_000)
    request = graph_nav_pb2.UploadWaypointSnapshotRequest(chunk={"data": bytes(1000)}).SerializeToString()
    refused = refusal(channel.stream_unary(UPLOAD, as_is, as_is), itertools.repeat(request))
    assert refused.code() is grpc.StatusCode.RESOURCE_EXHAUSTED


@pytest.mark.parametrize("call", [UPLOAD, "/bosdyn.api.graph_nav.GraphNavService/DownloadGraphStreaming"])
def test_streams_need_a_token(served, call):
    sdk = bosdyn.client.create_standard_sdk("test", cert_resource_glob=str(served.server.certificate))
    robot = sdk.create_robot("127.0.0.1")
    robot.update_secure_channel_port(served.server.port)
    stub = robot.ensure_secure_channel("api.spot.robot").stream_stream(call, as_is, as_is)
    refused = refusal(lambda data, timeout: list(stub(data, timeout=timeout)), iter([b""]))
    assert refused.code() is grpc.StatusCode.UNAUTHENTICATED
