"""Leases: the right to command parts of the robot. They form a tree; a lease may be split into sub-leases."""

from __future__ import annotations

import secrets
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from threading import Lock
from typing import Any, Final

from bosdyn.api import lease_pb2

from errand_spot.messages import timestamp
from errand_spot.server.calls import Call, Service
from errand_spot.server.identity import DOMAIN

ROOT, BODY, MOBILITY, FULL_ARM, ARM, GRIPPER = "all-leases", "body", "mobility", "full-arm", "arm", "gripper"
PARTS: Final[Mapping[str, Sequence[str]]] = {ROOT: (BODY,), BODY: (MOBILITY, FULL_ARM), FULL_ARM: (ARM, GRIPPER)}
"""Resources and their parts."""
STALE_S: Final = 5.0
Result = lease_pb2.LeaseUseResult


def leaves(resource: str) -> Iterator[str]:
    """Yields the smallest parts of a resource."""
    parts = PARTS.get(resource, ())
    if not parts:
        yield resource
    for part in parts:
        yield from leaves(part)


def _tree(resource: str) -> Any:
    return lease_pb2.ResourceTree(resource=resource, sub_resources=[_tree(part) for part in PARTS.get(resource, ())])


@dataclass
class _Claim:
    """Claim on one of the smallest parts: the newest used lease, its owner, and the time of its last use (s)."""

    lease: Any
    owner: Any
    used_s: float

    @property
    def stale(self) -> bool:
        return time.monotonic() - self.used_s > STALE_S


class LeaseService(Service):
    """Issues leases, and validates those of commands.

    Each smallest part has at most one claim. A lease is valid if it is not older than the newest used lease of each of
    its parts: sequences of numbers are compared from the front, and a sub-lease has a longer one.
    """

    name, type, authority = "lease", "bosdyn.api.LeaseService", f"lease.{DOMAIN}"

    def __init__(self, now: Callable[[], float], lost: Callable[[Sequence[str]], None]) -> None:
        """`lost` is called with the smallest parts whose owner has changed."""
        self._now, self._lost = now, lost
        self.epoch = secrets.token_hex(6)
        self._lock, self._number = Lock(), 0
        self._claims: dict[str, _Claim] = {}
        self._freed: dict[str, Any] = {}

    # -- the API's calls --------------------------------------------------------------------------------------------

    def AcquireLease(self, request: Any, call: Call) -> Any:
        """Issues a lease on a resource without claims, or with stale ones."""
        return self._issue(request.resource, call, lease_pb2.AcquireLeaseResponse, take=False)

    def TakeLease(self, request: Any, call: Call) -> Any:
        """Gives a lease on a resource, also while another client claims it."""
        return self._issue(request.resource, call, lease_pb2.TakeLeaseResponse, take=True)

    def _issue(self, resource: str, call: Call, Response: Any, *, take: bool) -> Any:
        if not _exists(resource):
            return Response(status=Response.STATUS_INVALID_RESOURCE)
        with self._lock:
            claims = [self._claims[leaf] for leaf in leaves(resource) if leaf in self._claims]
            if not take and (held := [claim for claim in claims if not claim.stale]):
                return Response(status=Response.STATUS_RESOURCE_ALREADY_CLAIMED, lease_owner=held[0].owner)
            lease, owner, changed = self._claim(resource, call)
        self._lost(changed)
        return Response(status=Response.STATUS_OK, lease=lease, lease_owner=owner)

    def ReturnLease(self, request: Any, _call: Call) -> Any:
        """Frees the parts of a lease that its claim still covers."""
        Response, lease = lease_pb2.ReturnLeaseResponse, request.lease
        if not _exists(lease.resource):
            return Response(status=Response.STATUS_INVALID_RESOURCE)
        with self._lock:
            mine = [leaf for leaf in leaves(lease.resource) if self._status(leaf, lease) == Result.STATUS_OK]
            for leaf in mine:
                self._freed[leaf] = self._claims.pop(leaf).lease
        if not mine:
            return Response(status=Response.STATUS_NOT_ACTIVE_LEASE)
        self._lost(mine)
        return Response(status=Response.STATUS_OK)

    def RetainLease(self, request: Any, _call: Call) -> Any:
        """Keeps a lease from becoming stale."""
        return lease_pb2.RetainLeaseResponse(lease_use_result=self.use(request.lease, ()))

    def ListLeases(self, request: Any, _call: Call) -> Any:
        """Lists the resources with their claims."""
        made = lease_pb2.ListLeasesResponse(resource_tree=_tree(ROOT))
        with self._lock:
            for resource in (ROOT, *(part for parts in PARTS.values() for part in parts)):
                self._describe(made.resources.add(resource=resource), resource, request.include_full_lease_info)
        return made

    # -- for commands ------------------------------------------------------------------------------------------------

    def use(self, lease: Any, parts: Sequence[str]) -> Any:
        """Uses a lease for smallest parts (all of its own if empty), and returns the result of the API."""
        made = Result(attempted_lease=lease)
        if not lease.resource or not lease.sequence or not _exists(lease.resource):
            made.status = Result.STATUS_INVALID_LEASE
            return made
        if lease.epoch != self.epoch:
            made.status = Result.STATUS_WRONG_EPOCH
            return made
        covered = set(leaves(lease.resource))
        wanted = list(parts) or sorted(covered)
        if not covered.issuperset(wanted):
            made.status = Result.STATUS_INVALID_LEASE
            return made
        with self._lock:
            made.status = max((self._status(leaf, lease) for leaf in wanted), default=Result.STATUS_OK)
            newest = self._claims.get(wanted[0])
            if newest is not None:
                made.owner.CopyFrom(newest.owner)
                made.latest_known_lease.CopyFrom(newest.lease)
                made.previous_lease.CopyFrom(newest.lease)
            if made.status == Result.STATUS_OK:
                for leaf in wanted:
                    claim = self._claims[leaf]
                    claim.lease.sequence[:], claim.used_s = lease.sequence, time.monotonic()
                    claim.lease.resource = lease.resource
                made.latest_known_lease.CopyFrom(lease)
        return made

    def holds(self, lease: Any, part: str) -> bool:
        """Returns whether the claim that a lease belongs to still counts for a smallest part."""
        with self._lock:
            claim = self._claims.get(part)
            return claim is not None and not claim.stale and claim.lease.sequence[:1] == lease.sequence[:1]

    def make_stale(self, resources: Sequence[str]) -> None:
        """Makes the claims on resources stale at once."""
        with self._lock:
            for leaf in (leaf for resource in resources for leaf in leaves(resource)):
                if leaf in self._claims:
                    self._claims[leaf].used_s = -STALE_S

    def stale_parts(self) -> Sequence[str]:
        """Smallest parts whose claims are stale."""
        with self._lock:
            return [leaf for leaf, claim in self._claims.items() if claim.stale]

    # -- inside ------------------------------------------------------------------------------------------------------

    def _claim(self, resource: str, call: Call) -> tuple[Any, Any, list[str]]:
        """Claims a resource; returns the new lease, its owner, and the parts with an earlier claim."""
        self._number += 1
        lease = lease_pb2.Lease(resource=resource, epoch=self.epoch, sequence=[self._number])
        lease.client_names.append(call.client_name)
        owner = lease_pb2.LeaseOwner(client_name=call.client_name, user_name=call.user)
        changed = [leaf for leaf in leaves(resource) if leaf in self._claims]
        for leaf in leaves(resource):
            own = lease_pb2.Lease()
            own.CopyFrom(lease)
            self._claims[leaf] = _Claim(own, owner, time.monotonic())
            self._freed.pop(leaf, None)
        return lease, owner, changed

    def _status(self, leaf: str, lease: Any) -> int:
        """Judges a lease for one smallest part."""
        claim = self._claims.get(leaf)
        if claim is None:
            return int(Result.STATUS_REVOKED if leaf in self._freed else Result.STATUS_INVALID_LEASE)
        newest, given = list(claim.lease.sequence), list(lease.sequence)
        if not given or lease.epoch != self.epoch or given[0] > newest[0]:
            return int(Result.STATUS_INVALID_LEASE)
        shorter = min(len(newest), len(given))
        return int(Result.STATUS_OK if given[:shorter] >= newest[:shorter] else Result.STATUS_OLDER)

    def _describe(self, made: Any, resource: str, with_lease: bool) -> None:
        claims = [self._claims[leaf] for leaf in leaves(resource) if leaf in self._claims]
        if not claims:
            return
        newest = max(claims, key=lambda claim: claim.used_s)
        made.lease_owner.CopyFrom(newest.owner)
        made.is_stale = newest.stale
        made.stale_time.CopyFrom(timestamp(self._now() + STALE_S - (time.monotonic() - newest.used_s)))
        if with_lease:
            made.lease.CopyFrom(newest.lease)
            made.lease.resource = resource


def _exists(resource: str) -> bool:
    return resource in PARTS or any(resource in parts for parts in PARTS.values())
