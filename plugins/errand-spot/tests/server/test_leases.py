"""Leases by the table of the API."""

import pytest
from bosdyn.api import lease_pb2

from errand_spot.server import leases
from errand_spot.server.calls import Call
from errand_spot.server.leases import ARM, GRIPPER, MOBILITY, LeaseService, leaves
from tests.tables import table

Result, Acquired, Returned = lease_pb2.LeaseUseResult, lease_pb2.AcquireLeaseResponse, lease_pb2.ReturnLeaseResponse
ME, YOU = Call("user", "me", 0.0), Call("user", "you", 0.0)


@pytest.fixture
def service():
    lost = []
    made = LeaseService(lambda: 0.0, lost.append)
    made.lost = lost
    return made


def acquired(service, resource="body", call=ME):
    return service.AcquireLease(lease_pb2.AcquireLeaseRequest(resource=resource), call)


def taken(service, resource="body"):
    return service.TakeLease(lease_pb2.TakeLeaseRequest(resource=resource), YOU).lease


def returned(service, lease):
    return service.ReturnLease(lease_pb2.ReturnLeaseRequest(lease=lease), ME).status


def changed(lease, **change):
    facts = {"resource": lease.resource, "epoch": lease.epoch, "sequence": list(lease.sequence)}
    return lease_pb2.Lease(**{**facts, **change})


def status(service, lease, *parts):
    return service.use(lease, parts).status


def test_the_body_has_three_smallest_parts():
    assert set(leaves("body")) == {MOBILITY, ARM, GRIPPER}


def test_a_free_resource_is_acquired_and_used(service):
    answer = acquired(service)
    assert (answer.status, status(service, answer.lease, MOBILITY)) == (Acquired.STATUS_OK, Result.STATUS_OK)


@pytest.mark.parametrize("resource", ["body", "arm", "gripper", "mobility"])
def test_a_claimed_resource_is_not_acquired(service, resource):
    acquired(service)
    answer = acquired(service, resource, YOU)
    assert (answer.status, answer.lease_owner.client_name) == (Acquired.STATUS_RESOURCE_ALREADY_CLAIMED, "me")


def test_parts_are_acquired_by_two_clients(service):
    assert acquired(service, "arm", ME).status == Acquired.STATUS_OK
    assert acquired(service, "mobility", YOU).status == Acquired.STATUS_OK


def test_an_unknown_resource_is_refused(service):
    assert acquired(service, "tail").status == Acquired.STATUS_INVALID_RESOURCE


def test_a_taken_lease_makes_the_earlier_one_older_and_tells_the_parts(service):
    mine, yours = acquired(service).lease, taken(service)
    assert [status(service, each, ARM) for each in (mine, yours)] == [Result.STATUS_OLDER, Result.STATUS_OK]
    assert [set(parts) for parts in service.lost] == [set(), {MOBILITY, ARM, GRIPPER}]
    assert returned(service, mine) == Returned.STATUS_NOT_ACTIVE_LEASE


def test_taking_the_arm_leaves_the_base_to_its_owner(service):
    mine = acquired(service).lease
    taken(service, "arm")
    assert [status(service, mine, part) for part in (MOBILITY, ARM)] == [Result.STATUS_OK, Result.STATUS_OLDER]


def test_a_returned_lease_is_revoked_and_frees_its_parts(service):
    mine = acquired(service).lease
    assert (returned(service, mine), status(service, mine, ARM)) == (Returned.STATUS_OK, Result.STATUS_REVOKED)
    assert acquired(service, call=YOU).status == Acquired.STATUS_OK


def test_a_sub_lease_counts_and_so_does_the_lease_above_it(service):
    mine = acquired(service).lease
    child, earlier = (changed(mine, sequence=[*mine.sequence, number]) for number in (7, 6))
    found = [status(service, each, ARM) for each in (child, earlier, mine)]
    assert found == [Result.STATUS_OK, Result.STATUS_OLDER, Result.STATUS_OK]


@pytest.mark.parametrize(*table(__file__, "never_given"))
def test_a_lease_that_was_never_given_is_neither_used_nor_returned(service, change, used, returns):
    lease = changed(acquired(service).lease, **change)
    found = Result.Status.Name(status(service, lease, ARM)), Returned.Status.Name(returned(service, lease))
    assert found == (used, returns)


def test_a_lease_that_is_not_used_becomes_stale_and_can_be_acquired(service, monkeypatch):
    now = [100.0]
    monkeypatch.setattr(leases.time, "monotonic", lambda: now[0])
    mine = acquired(service).lease
    now[0] += 4.0
    assert service.RetainLease(lease_pb2.RetainLeaseRequest(lease=mine), ME).lease_use_result.status == Result.STATUS_OK
    now[0] += 4.0
    assert not service.stale_parts()
    now[0] += 1.5
    assert set(service.stale_parts()) == {MOBILITY, ARM, GRIPPER}
    assert acquired(service, call=YOU).status == lease_pb2.AcquireLeaseResponse.STATUS_OK


def test_the_list_names_owners(service):
    acquired(service, "arm")
    answer = service.ListLeases(lease_pb2.ListLeasesRequest(include_full_lease_info=True), ME)
    owners = {each.resource: each.lease_owner.client_name for each in answer.resources}
    assert (owners["arm"], owners["mobility"], answer.resource_tree.resource) == ("me", "", "all-leases")
