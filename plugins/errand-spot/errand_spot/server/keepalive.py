"""Keepalive: policies with the robot's actions after a client's silence."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from itertools import count
from threading import Lock
from typing import Any, ClassVar, Final

from bosdyn.api.keepalive import keepalive_pb2

from errand_spot.messages import InvalidRequestError, seconds, timestamp
from errand_spot.server.calls import Call, Service
from errand_spot.server.computer import Computer
from errand_spot.server.identity import DOMAIN
from errand_spot.server.leases import ARM, GRIPPER, MOBILITY

_STATUS: Final = keepalive_pb2.GetStatusResponse


@dataclass
class _Live:
    """A policy, its client's last check-in (s), and the numbers of the actions done since."""

    policy: Any
    checked_s: float
    client_name: str
    done: set[int] = field(default_factory=set)


class KeepaliveService(Service):
    """Keeps policies. `watch` does what is due, between two steps of the robot."""

    name, type, authority = "keepalive", "bosdyn.api.keepalive.KeepaliveService", f"keepalive.{DOMAIN}"
    UNSERVED: ClassVar = ("auto_return", "immediate_robot_off")

    def __init__(self, computer: Computer) -> None:
        self._computer, self._lock, self._ids = computer, Lock(), count(1)
        self._live: dict[int, _Live] = {}
        computer.watchers.append(self.watch)

    def ModifyPolicy(self, request: Any, call: Call) -> Any:
        """Adds a policy, or removes some. An action that the simulated robot cannot do is an invalid request."""
        made, Response = keepalive_pb2.ModifyPolicyResponse(), keepalive_pb2.ModifyPolicyResponse
        for action in request.to_add.actions:
            if (which := action.WhichOneof("action")) is None or which in self.UNSERVED:
                raise InvalidRequestError(f"to_add.actions: {which or 'no action'} is not simulated")
        with self._lock:
            if any(number not in self._live for number in request.policy_ids_to_remove):
                return Response(status=Response.STATUS_INVALID_POLICY_ID)
            for number in dict.fromkeys(request.policy_ids_to_remove):
                made.removed_policies.append(self._described(number, self._live.pop(number)))
            if request.HasField("to_add"):
                number = next(self._ids)
                self._live[number] = _Live(request.to_add, time.monotonic(), call.client_name)
                made.added_policy.CopyFrom(self._described(number, self._live[number]))
        made.status = Response.STATUS_OK
        return made

    def CheckIn(self, request: Any, _call: Call) -> Any:
        """Starts the times of a policy's actions again."""
        Response = keepalive_pb2.CheckInResponse
        with self._lock:
            live = self._live.get(request.policy_id)
            if live is None:
                return Response(status=Response.STATUS_INVALID_POLICY_ID)
            live.checked_s = time.monotonic()
            live.done.clear()
        return Response(status=Response.STATUS_OK, last_checkin=timestamp(self._computer.now_s()))

    def GetStatus(self, _request: Any, _call: Call) -> Any:
        """Lists the policies, and the actions that the robot does now."""
        made = keepalive_pb2.GetStatusResponse()
        names = {
            "controlled_motors_off": _STATUS.POLICY_CONTROL_ACTION_MOTORS_OFF,
            "immediate_motors_off": _STATUS.POLICY_CONTROL_ACTION_IMMEDIATE_MOTORS_OFF,
            "halt_robot": _STATUS.POLICY_CONTROL_ACTION_HALT,
        }
        with self._lock:
            for number, live in self._live.items():
                made.status.append(self._described(number, live))
                done = (live.policy.actions[which].WhichOneof("action") for which in sorted(live.done))
                made.active_control_actions.extend(names[which] for which in done if which in names)
        return made

    def watch(self) -> None:
        """Does the actions whose clients have been silent too long, each once."""
        now_s, due = time.monotonic(), []
        with self._lock:
            for live in self._live.values():
                for which, action in enumerate(live.policy.actions):
                    if which not in live.done and now_s - live.checked_s > seconds(action.after):
                        live.done.add(which)
                        due.append(action)
        for action in due:
            self._do(action)

    def _do(self, action: Any) -> None:
        computer = self._computer
        done: Mapping[str, Callable[[], None]] = {
            "record_event": lambda: None,
            "lease_stale": lambda: computer.leases.make_stale([lease.resource for lease in action.lease_stale.leases]),
            "controlled_motors_off": computer.settle,
            "immediate_motors_off": computer.switch_off,
            "halt_robot": lambda: computer.stop_parts((MOBILITY, ARM, GRIPPER)),
        }
        done[action.WhichOneof("action")]()

    def _described(self, number: int, live: _Live) -> Any:
        made = keepalive_pb2.LivePolicy(policy_id=number, policy=live.policy, client_name=live.client_name)
        ago_s = time.monotonic() - live.checked_s
        made.last_checkin.CopyFrom(timestamp(self._computer.now_s() - ago_s))
        return made
