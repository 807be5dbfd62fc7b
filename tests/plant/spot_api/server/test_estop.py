"""The E-stop.

endpoints                 level
none                      cut
tablet                    none (released)
registered, not answered  cut
released                  none; silent beyond its time: settle, later cut
"""

import pytest
from bosdyn.api import estop_pb2

from plant.spot_api.messages import duration
from plant.spot_api.server import estop
from plant.spot_api.server.calls import Call
from plant.spot_api.server.estop import EstopService, Tablet

CALL = Call("user", "me", 0.0)
CUT, SETTLE, NONE = estop_pb2.ESTOP_LEVEL_CUT, estop_pb2.ESTOP_LEVEL_SETTLE_THEN_CUT, estop_pb2.ESTOP_LEVEL_NONE
MASK = (1 << 64) - 1


@pytest.fixture
def now(monkeypatch):
    time = [100.0]
    monkeypatch.setattr(estop.time, "monotonic", lambda: time[0])
    return time


def registered(service):
    """Registers one endpoint with a time limit of 2 s; returns it."""
    endpoint = estop_pb2.EstopEndpoint(role="PDB_rooted", name="mine", timeout=duration(2.0))
    config = service.GetEstopConfig(estop_pb2.GetEstopConfigRequest(), CALL).active_config
    request = estop_pb2.SetEstopConfigRequest(
        config=estop_pb2.EstopConfig(endpoints=[endpoint]), target_config_id=config.unique_id
    )
    config = service.SetEstopConfig(request, CALL).active_config
    request = estop_pb2.RegisterEstopEndpointRequest(target_config_id=config.unique_id, new_endpoint=endpoint)
    request.target_endpoint.role = "PDB_rooted"
    answer = service.RegisterEstopEndpoint(request, CALL)
    assert answer.status == estop_pb2.RegisterEstopEndpointResponse.STATUS_SUCCESS
    return answer.new_endpoint


def check_in(service, endpoint, level, challenge=0):
    return service.EstopCheckIn(
        estop_pb2.EstopCheckInRequest(
            endpoint=endpoint, challenge=challenge, response=~challenge & MASK, stop_level=level
        ),
        CALL,
    )


def released(service):
    """Registers an endpoint, learns its challenge and releases it."""
    endpoint = registered(service)
    challenge = check_in(service, endpoint, CUT).challenge
    answer = check_in(service, endpoint, NONE, challenge)
    assert answer.status == estop_pb2.EstopCheckInResponse.STATUS_OK
    return endpoint, answer.challenge


@pytest.mark.parametrize(("tablet", "level"), [(Tablet.TABLET, NONE), (Tablet.NONE, CUT)])
def test_only_the_tablet_releases_a_robot_without_other_endpoints(tablet, level):
    assert EstopService(tablet).level() == level


def test_a_new_configuration_replaces_the_tablet(now):
    service = EstopService(Tablet.TABLET)
    registered(service)
    assert service.level() == CUT


def test_an_endpoint_is_released_by_the_answer_to_its_challenge(now):
    service = EstopService(Tablet.NONE)
    released(service)
    assert service.level() == NONE


def test_a_wrong_answer_does_not_release(now):
    service = EstopService(Tablet.NONE)
    endpoint = registered(service)
    answer = check_in(service, endpoint, NONE, challenge=1)
    assert answer.status == estop_pb2.EstopCheckInResponse.STATUS_INCORRECT_CHALLENGE_RESPONSE
    assert service.level() == CUT


def test_silence_settles_the_robot_and_then_cuts_the_power(now):
    service = EstopService(Tablet.NONE)
    released(service)
    levels = []
    for silent_s in (1.9, 2.1, 4.9, 5.1):
        now[0] = 100.0 + silent_s
        levels.append(service.level())
    assert levels == [NONE, SETTLE, SETTLE, CUT]


def test_a_stop_counts_at_once(now):
    service = EstopService(Tablet.NONE)
    endpoint, challenge = released(service)
    check_in(service, endpoint, SETTLE, challenge)
    assert service.level() == SETTLE


def test_the_configuration_cannot_be_replaced_while_motors_are_on(now):
    service = EstopService(Tablet.TABLET)
    service.motors_on = True
    answer = service.SetEstopConfig(estop_pb2.SetEstopConfigRequest(), CALL)
    assert answer.status == estop_pb2.SetEstopConfigResponse.STATUS_MOTORS_ON
    assert service.level() == NONE


def test_an_old_configuration_is_named(now):
    service = EstopService(Tablet.TABLET)
    answer = service.SetEstopConfig(estop_pb2.SetEstopConfigRequest(target_config_id="old"), CALL)
    assert answer.status == estop_pb2.SetEstopConfigResponse.STATUS_INVALID_ID


def test_a_deregistered_endpoint_stops_the_robot(now):
    service = EstopService(Tablet.NONE)
    endpoint, _ = released(service)
    config = service.GetEstopConfig(estop_pb2.GetEstopConfigRequest(), CALL).active_config
    request = estop_pb2.DeregisterEstopEndpointRequest(target_endpoint=endpoint, target_config_id=config.unique_id)
    answer = service.DeregisterEstopEndpoint(request, CALL)
    assert answer.status == estop_pb2.DeregisterEstopEndpointResponse.STATUS_SUCCESS
    assert service.level() == CUT
