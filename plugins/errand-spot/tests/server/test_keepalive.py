"""Keepalive policies."""

import time

import pytest
from bosdyn.api import lease_pb2
from bosdyn.api.keepalive import keepalive_pb2

from errand_spot.messages import InvalidRequestError, duration
from errand_spot.server import keepalive
from errand_spot.server.calls import Call
from errand_spot.server.keepalive import KeepaliveService

CALL = Call("user", "me", 0.0)
Action = keepalive_pb2.ActionAfter


class FakeComputer:
    """Notes what it is told to do."""

    def __init__(self):
        self.done, self.watchers, self.leases = [], [], self

    def now_s(self):
        return 0.0

    def make_stale(self, resources):
        self.done.append(("stale", *resources))

    def settle(self):
        self.done.append("settle")

    def switch_off(self):
        self.done.append("off")

    def stop_parts(self, parts):
        self.done.append("halt")


@pytest.fixture
def now(monkeypatch):
    time = [100.0]
    monkeypatch.setattr(keepalive.time, "monotonic", lambda: time[0])
    return time


@pytest.fixture
def computer():
    return FakeComputer()


@pytest.fixture
def service(computer, now):
    return KeepaliveService(computer)


def added(service):
    """Adds the usual policy; returns its number."""
    stale = Action.LeaseStale(leases=[lease_pb2.Lease(resource="body")])
    off = Action(controlled_motors_off=Action.ControlledMotorsOff(), after=duration(15.0))
    policy = keepalive_pb2.Policy(name="mine", actions=[Action(lease_stale=stale, after=duration(3.0)), off])
    answer = service.ModifyPolicy(keepalive_pb2.ModifyPolicyRequest(to_add=policy), CALL)
    assert answer.status == keepalive_pb2.ModifyPolicyResponse.STATUS_OK
    return answer.added_policy.policy_id


def check_in(service, number):
    return service.CheckIn(keepalive_pb2.CheckInRequest(policy_id=number), CALL).status


def passed(service, now, seconds):
    now[0] += seconds
    service.watch()


def test_each_action_is_done_once_when_its_time_has_come(service, computer, now):
    added(service)
    for seconds in (2.9, 0.2, 5.0, 7.0, 5.0):
        passed(service, now, seconds)
    assert computer.done == [("stale", "body"), "settle"]


def test_a_check_in_starts_the_times_again(service, computer, now):
    number = added(service)
    for _ in range(5):
        passed(service, now, 2.0)
        assert check_in(service, number) == keepalive_pb2.CheckInResponse.STATUS_OK
    assert computer.done == []


def test_a_removed_policy_does_nothing(service, computer, now):
    number = added(service)
    service.ModifyPolicy(keepalive_pb2.ModifyPolicyRequest(policy_ids_to_remove=[number]), CALL)
    passed(service, now, 60.0)
    assert (computer.done, check_in(service, number)) == ([], keepalive_pb2.CheckInResponse.STATUS_INVALID_POLICY_ID)


def test_the_status_names_what_is_being_done(service, now):
    added(service)
    passed(service, now, 16.0)
    status = service.GetStatus(keepalive_pb2.GetStatusRequest(), CALL)
    assert [live.policy.name for live in status.status] == ["mine"]
    assert status.active_control_actions == [keepalive_pb2.GetStatusResponse.POLICY_CONTROL_ACTION_MOTORS_OFF]


def test_an_action_that_is_not_simulated_is_refused(service):
    policy = keepalive_pb2.Policy(actions=[Action(auto_return=Action.AutoReturn(), after=duration(1.0))])
    with pytest.raises(InvalidRequestError, match="auto_return"):
        service.ModifyPolicy(keepalive_pb2.ModifyPolicyRequest(to_add=policy), CALL)


def test_a_silent_client_of_the_sdk_loses_its_motors(spot):
    off = Action(controlled_motors_off=Action.ControlledMotorsOff(), after=duration(0.3))
    spot.robot.ensure_client("keepalive").modify_policy(to_add=keepalive_pb2.Policy(name="short", actions=[off]))
    while spot.robot.is_powered_on():
        time.sleep(0.02)
    assert spot.served.scripted.height_m < 0.3
