"""Calls that are malformed, unknown, or fail inside."""

import itertools
import logging

import bosdyn.client
import grpc
import pytest
from bosdyn.api.graph_nav import graph_nav_pb2

from plant.spot_api.server import calls
from plant.spot_api.server.state import RobotStateService


@pytest.fixture
def channel(served):
    robot = served.login()
    return robot.ensure_secure_channel("state.spot.robot")


def call(channel, path, data=b""):
    return channel.unary_unary(path, lambda raw: raw, lambda raw: raw)(data, timeout=5.0)


def test_a_malformed_message_is_an_invalid_argument_without_a_traceback(channel, caplog, capfd):
    for data in (b"\xff\xff\xff", b"\x0a\xff", bytes(range(256))):
        with pytest.raises(grpc.RpcError) as refused:
            call(channel, "/bosdyn.api.RobotStateService/GetRobotState", data)
        assert refused.value.code() is grpc.StatusCode.INVALID_ARGUMENT
    assert "Traceback" not in caplog.text + capfd.readouterr().err


@pytest.mark.parametrize(
    "path",
    ["/bosdyn.api.mission.MissionService/PlayMission", "/bosdyn.api.PowerService/ResetSafetyStop", "/no.Such/Call"],
)
def test_a_call_that_is_not_served_is_named(channel, path):
    with pytest.raises(grpc.RpcError) as refused:
        call(channel, path)
    assert refused.value.code() is grpc.StatusCode.UNIMPLEMENTED
    assert path.strip("/") in refused.value.details()


def test_a_failure_inside_is_an_internal_error_and_the_server_goes_on(served, monkeypatch, caplog):
    robot = served.login()
    client = robot.ensure_client("robot-state")
    monkeypatch.setattr(RobotStateService, "_power", lambda *_: 1 / 0)
    from bosdyn.client.exceptions import InternalServerError

    with caplog.at_level(logging.CRITICAL), pytest.raises(InternalServerError):
        client.get_robot_state()
    monkeypatch.undo()
    assert client.get_robot_state().power_state.robot_power_state


def test_a_port_in_use_is_one_error(served, credentials):
    from plant.spot_api.server.server import Options, SpotServer

    port = served.server.port
    with pytest.raises(OSError, match=f"port {port} of 127.0.0.1 cannot be opened"):
        SpotServer(served.scripted, served.server.computer.clock, None, credentials, Options({}, port))


UPLOAD = "/bosdyn.api.graph_nav.GraphNavService/UploadWaypointSnapshot"


@pytest.mark.parametrize("requests", [[], [b"\xff\xff"], [b"", b"\x0a\xff"]], ids=["empty", "malformed", "later"])
def test_a_stream_that_cannot_be_read_is_an_invalid_argument(channel, requests):
    with pytest.raises(grpc.RpcError) as refused:
        channel.stream_unary(UPLOAD, lambda raw: raw, lambda raw: raw)(iter(requests), timeout=5.0)
    assert refused.value.code() is grpc.StatusCode.INVALID_ARGUMENT


def test_a_stream_without_end_is_cut(channel, monkeypatch):
    monkeypatch.setattr(calls, "MOST_STREAMED_BYTES", 10_000)
    request = graph_nav_pb2.UploadWaypointSnapshotRequest(chunk={"data": bytes(1000)}).SerializeToString()
    with pytest.raises(grpc.RpcError) as refused:
        channel.stream_unary(UPLOAD, lambda raw: raw, lambda raw: raw)(itertools.repeat(request), timeout=5.0)
    assert refused.value.code() is grpc.StatusCode.RESOURCE_EXHAUSTED


def test_streams_need_a_token(served):
    sdk = bosdyn.client.create_standard_sdk("test", cert_resource_glob=str(served.server.certificate))
    robot = sdk.create_robot("127.0.0.1")
    robot.update_secure_channel_port(served.server.port)
    for call in (UPLOAD, "/bosdyn.api.graph_nav.GraphNavService/DownloadGraphStreaming"):
        stub = robot.ensure_secure_channel("api.spot.robot").stream_stream(call, lambda raw: raw, lambda raw: raw)
        with pytest.raises(grpc.RpcError) as refused:
            list(stub(iter([b""]), timeout=5.0))
        assert refused.value.code() is grpc.StatusCode.UNAUTHENTICATED
