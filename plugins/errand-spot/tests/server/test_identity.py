"""Login, tokens, directory, clock."""

import time

import bosdyn.client
import jwt
import pytest
from bosdyn.api import auth_pb2, time_sync_pb2
from bosdyn.client.auth import InvalidLoginError, TemporarilyLockedOutError
from bosdyn.client.directory_registration import DirectoryRegistrationClient, ServiceAlreadyExistsError
from bosdyn.client.exceptions import UnauthenticatedError
from bosdyn.client.robot_state import RobotStateClient
from bosdyn.client.sdk import _DEFAULT_SERVICE_CLIENTS

from errand_spot.messages import duration, seconds, timestamp
from errand_spot.server import identity
from errand_spot.server.calls import Call
from errand_spot.server.identity import SERIAL, AuthService, TimeSyncService
from errand_spot.server.server import LISTED
from tests.tables import table


def test_six_wrong_passwords_are_refused_and_lock_the_user_out(served):
    for _ in range(6):
        with pytest.raises(InvalidLoginError):
            served.login("wrong")
    with pytest.raises(TemporarilyLockedOutError):
        served.login()


def test_a_right_password_forgets_earlier_mistakes(served):
    for mistakes in (3, 5):
        for _ in range(mistakes):
            with pytest.raises(InvalidLoginError):
                served.login("wrong")
        assert served.login().user_token


def test_a_token_outlives_the_server(credentials):
    key = credentials.token_key.read_bytes()
    request = auth_pb2.GetAuthTokenRequest(username="user", password="right")
    token = AuthService({"user": "right"}, key).GetAuthToken(request, Call("", "", 0.0)).token
    assert AuthService({"user": "right"}, key).user_of(token) == "user"


@pytest.mark.parametrize(*table(__file__, "foreign_tokens"))
def test_a_foreign_or_expired_token_is_refused(served, credentials, subject, audience, in_s, own_key):
    robot, claims = served.login(), {"sub": subject, "aud": audience or SERIAL, "exp": time.time() + in_s}
    key = credentials.token_key.read_bytes() if own_key else "another key, which is long enough for the method"
    robot.update_user_token(jwt.encode(claims, key, algorithm="HS256"))
    with pytest.raises(UnauthenticatedError):
        robot.ensure_client(RobotStateClient.default_service_name).get_robot_state()


def test_the_directory_has_the_names_and_types_of_the_sdk(served):
    listed = {entry.name: entry.type for entry in served.login().list_services()}
    known = {client.default_service_name: client.service_type for client in _DEFAULT_SERVICE_CLIENTS}
    known["velodyne-point-cloud"] = "bosdyn.api.PointCloudService"
    assert {name: known.get(name, service_type) for name, service_type in listed.items()} == listed
    wanted = {"robot-command", "robot-state", "lease", "estop", "image", "velodyne-point-cloud", *LISTED}
    assert wanted <= set(listed)


def test_the_robot_says_who_it_is(served):
    identity = served.login().get_id()
    assert (identity.serial_number, identity.species, identity.nickname) == (SERIAL, "spot", "Alice")


def test_a_client_registers_a_service_once(served):
    robot = served.login()
    client = robot.ensure_client(DirectoryRegistrationClient.default_service_name)
    client.register("mine", "my.Service", "mine.spot.robot", "127.0.0.1", 5000)
    assert "mine" in {entry.name for entry in robot.list_services()}
    with pytest.raises(ServiceAlreadyExistsError):
        client.register("mine", "my.Service", "mine.spot.robot", "127.0.0.1", 5000)
    client.unregister("mine")
    assert "mine" not in {entry.name for entry in robot.list_services()}


def test_every_feature_is_licensed(served):
    client = served.login().ensure_client("license")
    assert client.get_feature_enabled(["autonomy", "choreography"]) == {"autonomy": True, "choreography": True}


@pytest.mark.parametrize("ahead_s", [0.0, 10.0, -3600.0])
def test_the_clock_of_a_client_is_estimated_by_its_shortest_round_trip(ahead_s):
    """The client's clock is behind the robot's by `ahead_s`; one slow answer does not disturb the estimate."""
    service, call = TimeSyncService(), Call("", "", 0.0)
    identifier = service.TimeSyncUpdate(time_sync_pb2.TimeSyncUpdateRequest(), call).clock_identifier
    for there_s, back_s in ((0.01, 0.01), (0.01, 0.5), (0.02, 0.02)):
        trip = time_sync_pb2.TimeSyncRoundTrip(
            client_tx=timestamp(100.0),
            server_rx=timestamp(100.0 + there_s + ahead_s + 4000.0),
            server_tx=timestamp(100.0 + there_s + 0.001 + ahead_s + 4000.0),
            client_rx=timestamp(100.0 + there_s + 0.001 + back_s),
        )
        request = time_sync_pb2.TimeSyncUpdateRequest(clock_identifier=identifier, previous_round_trip=trip)
        answer = service.TimeSyncUpdate(request, call)
    assert seconds(answer.state.best_estimate.clock_skew) == pytest.approx(4000.0 + ahead_s, abs=1e-6)
    assert seconds(answer.state.best_estimate.round_trip_time) == pytest.approx(0.02, abs=1e-6)
    assert service.knows(identifier) and not service.knows("never heard of")


def test_the_sdk_synchronises_its_clock(served):
    robot = served.login()
    robot.time_sync.wait_for_sync(timeout_sec=5.0)
    assert abs(robot.time_sync.get_robot_clock_skew().seconds) < 1
    robot.time_sync.stop()


def test_a_negative_duration_survives_its_message():
    assert seconds(duration(-1.25)) == -1.25


def test_a_certificate_of_another_server_is_not_trusted(served, tmp_path):
    other = identity.credentials(tmp_path)
    sdk = bosdyn.client.create_standard_sdk("test", cert_resource_glob=str(other.certificate))
    robot = sdk.create_robot("127.0.0.1")
    robot.update_secure_channel_port(served.server.port)
    with pytest.raises(bosdyn.client.RpcError):
        robot.authenticate("user", "right", timeout=5.0)
