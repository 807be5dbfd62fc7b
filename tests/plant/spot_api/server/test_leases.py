"""Leases by the table of the API.

given               used for    result
newest of the part  the part    ok
sub-lease           the part    ok, and then the super-lease too
older               the part    older
returned            the part    revoked
of another epoch    the part    wrong epoch
of another part     the part    invalid
"""

import pytest
from bosdyn.api import lease_pb2

from plant.spot_api.server import leases
from plant.spot_api.server.calls import Call
from plant.spot_api.server.leases import ARM, GRIPPER, MOBILITY, LeaseService, leaves

Result = lease_pb2.LeaseUseResult
ME, YOU = Call("user", "me", 0.0), Call("user", "you", 0.0)


@pytest.fixture
def service():
    lost = []
    made = LeaseService(lambda: 0.0, lost.append)
    made.lost = lost
    return made


def acquired(service, resource="body", call=ME):
    return service.AcquireLease(lease_pb2.AcquireLeaseRequest(resource=resource), call)


def status(service, lease, *parts):
    return service.use(lease, parts).status


def test_the_body_has_three_smallest_parts():
    assert set(leaves("body")) == {MOBILITY, ARM, GRIPPER}


def test_a_free_resource_is_acquired_and_used(service):
    answer = acquired(service)
    assert answer.status == lease_pb2.AcquireLeaseResponse.STATUS_OK
    assert status(service, answer.lease, MOBILITY) == Result.STATUS_OK


@pytest.mark.parametrize("resource", ["body", "arm", "gripper", "mobility"])
def test_a_claimed_resource_is_not_acquired(service, resource):
    acquired(service)
    answer = acquired(service, resource, YOU)
    assert answer.status == lease_pb2.AcquireLeaseResponse.STATUS_RESOURCE_ALREADY_CLAIMED
    assert answer.lease_owner.client_name == "me"


def test_parts_are_acquired_by_two_clients_and_an_unknown_resource_by_none(service):
    assert acquired(service, "arm").status == lease_pb2.AcquireLeaseResponse.STATUS_OK
    assert acquired(service, "mobility", YOU).status == lease_pb2.AcquireLeaseResponse.STATUS_OK
    assert acquired(service, "tail").status == lease_pb2.AcquireLeaseResponse.STATUS_INVALID_RESOURCE


def test_a_taken_lease_makes_the_earlier_one_older_and_tells_the_parts(service):
    mine = acquired(service).lease
    yours = service.TakeLease(lease_pb2.TakeLeaseRequest(resource="body"), YOU).lease
    assert status(service, mine, ARM) == Result.STATUS_OLDER
    assert status(service, yours, ARM) == Result.STATUS_OK
    assert [set(parts) for parts in service.lost] == [set(), {MOBILITY, ARM, GRIPPER}]


def test_taking_the_arm_leaves_the_base_to_its_owner(service):
    mine = acquired(service).lease
    service.TakeLease(lease_pb2.TakeLeaseRequest(resource="arm"), YOU)
    assert status(service, mine, MOBILITY) == Result.STATUS_OK
    assert status(service, mine, ARM) == Result.STATUS_OLDER


def test_a_returned_lease_is_revoked_and_frees_its_parts(service):
    mine = acquired(service).lease
    returned = service.ReturnLease(lease_pb2.ReturnLeaseRequest(lease=mine), ME)
    assert returned.status == lease_pb2.ReturnLeaseResponse.STATUS_OK
    assert status(service, mine, ARM) == Result.STATUS_REVOKED
    assert acquired(service, call=YOU).status == lease_pb2.AcquireLeaseResponse.STATUS_OK


def test_a_lease_that_no_longer_counts_is_not_returned(service):
    mine = acquired(service).lease
    service.TakeLease(lease_pb2.TakeLeaseRequest(resource="body"), YOU)
    returned = service.ReturnLease(lease_pb2.ReturnLeaseRequest(lease=mine), ME)
    assert returned.status == lease_pb2.ReturnLeaseResponse.STATUS_NOT_ACTIVE_LEASE


@pytest.mark.parametrize("change", [{"sequence": []}, {"epoch": "before"}])
def test_a_lease_that_was_never_given_is_not_returned(service, change):
    mine = acquired(service).lease
    facts = {"resource": mine.resource, "epoch": mine.epoch, "sequence": list(mine.sequence), **change}
    returned = service.ReturnLease(lease_pb2.ReturnLeaseRequest(lease=lease_pb2.Lease(**facts)), ME)
    assert returned.status == lease_pb2.ReturnLeaseResponse.STATUS_NOT_ACTIVE_LEASE


def test_a_sub_lease_counts_and_so_does_the_lease_above_it(service):
    mine = acquired(service).lease
    child = lease_pb2.Lease(resource="body", epoch=mine.epoch, sequence=[*mine.sequence, 7])
    earlier = lease_pb2.Lease(resource="body", epoch=mine.epoch, sequence=[*mine.sequence, 6])
    assert status(service, child, ARM) == Result.STATUS_OK
    assert status(service, earlier, ARM) == Result.STATUS_OLDER
    assert status(service, mine, ARM) == Result.STATUS_OK


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        ({"epoch": "before"}, Result.STATUS_WRONG_EPOCH),
        ({"resource": "tail"}, Result.STATUS_INVALID_LEASE),
        ({"resource": ""}, Result.STATUS_INVALID_LEASE),
        ({"resource": "gripper"}, Result.STATUS_INVALID_LEASE),
        ({"sequence": []}, Result.STATUS_INVALID_LEASE),
        ({"sequence": [99]}, Result.STATUS_INVALID_LEASE),
    ],
)
def test_a_lease_that_was_never_given_is_refused(service, change, expected):
    mine = acquired(service).lease
    facts = {"resource": mine.resource, "epoch": mine.epoch, "sequence": list(mine.sequence), **change}
    assert status(service, lease_pb2.Lease(**facts), ARM) == expected


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
    assert owners["arm"] == "me"
    assert owners["mobility"] == ""
    assert answer.resource_tree.resource == "all-leases"
