"""The E-stop."""

import pytest
from bosdyn.api import estop_pb2

from errand_spot.messages import duration
from errand_spot.server import estop
from errand_spot.server.calls import Call
from errand_spot.server.estop import EstopService, Tablet

CALL = Call("user", "me", 0.0)
CUT, SETTLE, NONE = estop_pb2.ESTOP_LEVEL_CUT, estop_pb2.ESTOP_LEVEL_SETTLE_THEN_CUT, estop_pb2.ESTOP_LEVEL_NONE
MASK = (1 << 64) - 1


@pytest.fixture
def now(monkeypatch):
    time = [100.0]
    monkeypatch.setattr(estop.time, "monotonic", lambda: time[0])
    return time


@pytest.fixture
def service(now):
    return EstopService(Tablet.NONE)


def config_of(service):
    return service.GetEstopConfig(estop_pb2.GetEstopConfigRequest(), CALL).active_config.unique_id


def registered(service):
    """Registers one endpoint with a time limit of 2 s; returns it."""
    endpoint = estop_pb2.EstopEndpoint(role="PDB_rooted", name="mine", timeout=duration(2.0))
    config = estop_pb2.EstopConfig(endpoints=[endpoint])
    request = estop_pb2.SetEstopConfigRequest(config=config, target_config_id=config_of(service))
    number = service.SetEstopConfig(request, CALL).active_config.unique_id
    request = estop_pb2.RegisterEstopEndpointRequest(target_config_id=number, new_endpoint=endpoint)
    request.target_endpoint.role = "PDB_rooted"
    answer = service.RegisterEstopEndpoint(request, CALL)
    assert answer.status == estop_pb2.RegisterEstopEndpointResponse.STATUS_SUCCESS
    return answer.new_endpoint


def check_in(service, endpoint, level, challenge=0):
    answer = {"challenge": challenge, "response": ~challenge & MASK}
    return service.EstopCheckIn(estop_pb2.EstopCheckInRequest(endpoint=endpoint, stop_level=level, **answer), CALL)


def released(service):
    """Registers an endpoint, learns its challenge and releases it."""
    endpoint = registered(service)
    answer = check_in(service, endpoint, NONE, check_in(service, endpoint, CUT).challenge)
    assert answer.status == estop_pb2.EstopCheckInResponse.STATUS_OK
    return endpoint, answer.challenge


@pytest.mark.parametrize(("tablet", "level"), [(Tablet.TABLET, NONE), (Tablet.NONE, CUT)])
def test_only_the_tablet_releases_a_robot_without_other_endpoints_until_it_is_replaced(now, tablet, level):
    service = EstopService(tablet)
    assert service.level() == level
    registered(service)
    assert service.level() == CUT


def test_an_endpoint_is_released_by_the_answer_to_its_challenge(service):
    released(service)
    assert service.level() == NONE


def test_a_stop_counts_at_once(service):
    endpoint, challenge = released(service)
    check_in(service, endpoint, SETTLE, challenge)
    assert service.level() == SETTLE


def test_a_wrong_answer_does_not_release(service):
    answer = check_in(service, registered(service), NONE, challenge=1)
    assert answer.status == estop_pb2.EstopCheckInResponse.STATUS_INCORRECT_CHALLENGE_RESPONSE
    assert service.level() == CUT


def test_silence_settles_the_robot_and_then_cuts_the_power(now, service):
    released(service)
    levels = []
    for silent_s in (1.9, 2.1, 4.9, 5.1):
        now[0] = 100.0 + silent_s
        levels.append(service.level())
    assert levels == [NONE, SETTLE, SETTLE, CUT]


@pytest.mark.parametrize(
    ("motors_on", "target", "status"),
    [
        (True, "", estop_pb2.SetEstopConfigResponse.STATUS_MOTORS_ON),
        (False, "old", estop_pb2.SetEstopConfigResponse.STATUS_INVALID_ID),
    ],
)
def test_the_configuration_is_replaced_neither_while_motors_are_on_nor_by_an_old_name(now, motors_on, target, status):
    service = EstopService(Tablet.TABLET)
    service.motors_on = motors_on
    answer = service.SetEstopConfig(estop_pb2.SetEstopConfigRequest(target_config_id=target), CALL)
    assert (answer.status, service.level()) == (status, NONE)


def test_a_deregistered_endpoint_stops_the_robot(service):
    target = {"target_endpoint": released(service)[0], "target_config_id": config_of(service)}
    answer = service.DeregisterEstopEndpoint(estop_pb2.DeregisterEstopEndpointRequest(**target), CALL)
    assert (answer.status, service.level()) == (estop_pb2.DeregisterEstopEndpointResponse.STATUS_SUCCESS, CUT)
