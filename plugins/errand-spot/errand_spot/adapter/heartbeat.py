"""Heartbeat of a run: lease, keepalive policy and our own E-stop; the robot stops without them.

The run's heartbeat sends all messages, without a separate thread: a run that hangs falls silent, and the robot stops.
"""

from __future__ import annotations

import math
import time
from typing import Any, Final

from bosdyn.api import estop_pb2
from bosdyn.api.keepalive import keepalive_pb2

from errand_spot.adapter.connection import CLIENT, Connection, LostError
from errand_spot.adapter.statuses import response_trouble
from errand_spot.messages import duration
from skills.robot import CommandCause

ESTOP_S: Final = 3.0
CUT_S: Final = 6.0
LEASE_STALE_S, MOTORS_OFF_S = 3.0, 15.0
_BEAT_S: Final = 1.0
_MASK: Final = (1 << 64) - 1
_ROLE: Final = "PDB_rooted"


class Heartbeat:
    """Says what the robot must hear, each second of wall time."""

    def __init__(self, connection: Connection) -> None:
        self._connection, self._beat_s = connection, -math.inf
        self._endpoint: Any = None
        self._config_id, self._challenge = "", 0
        self._policy: int | None = None
        self._wanted, self._guarded = False, None  # shall there be a policy, and the lease that it names

    def beat(self) -> None:
        """Retains the lease, and checks in. Raises LostError; with cause ESTOPPED when our E-stop is gone."""
        now_s = time.monotonic()
        if now_s - self._beat_s < _BEAT_S:
            return
        self._beat_s = now_s
        if self._endpoint is not None:
            self._release()
        if self._wanted and self._connection.lease != self._guarded:
            self._guard()
        if self._policy is not None:
            self._check_in()
        if self._connection.lease is not None:
            self._connection.retain()

    # -- E-stop ------------------------------------------------------------------------------------------------------

    def hold_estop(self) -> None:
        """Replaces all E-stops by our own, released one. Raises LostError, also while the motors are on."""
        endpoint = estop_pb2.EstopEndpoint(role=_ROLE, name=CLIENT)
        endpoint.timeout.CopyFrom(duration(ESTOP_S))
        endpoint.cut_power_timeout.CopyFrom(duration(CUT_S))
        known = self._connection.call("estop", "GetEstopConfig", estop_pb2.GetEstopConfigRequest()).active_config
        request = estop_pb2.SetEstopConfigRequest(target_config_id=known.unique_id)
        request.config.endpoints.append(endpoint)
        config = self._connection.call("estop", "SetEstopConfig", request).active_config
        self._config_id = config.unique_id
        register = estop_pb2.RegisterEstopEndpointRequest(target_config_id=self._config_id, new_endpoint=endpoint)
        register.target_endpoint.CopyFrom(config.endpoints[0])
        self._endpoint = self._connection.call("estop", "RegisterEstopEndpoint", register).new_endpoint
        self._release()

    def drop_estop(self) -> None:
        """Removes our E-stop, which then stops the robot. Raises LostError."""
        endpoint, self._endpoint = self._endpoint, None
        if endpoint is not None:
            request = estop_pb2.DeregisterEstopEndpointRequest(target_config_id=self._config_id)
            request.target_endpoint.CopyFrom(endpoint)
            self._connection.call("estop", "DeregisterEstopEndpoint", request)

    def _release(self) -> None:
        """Releases the E-stop. The first answer only returns the challenge."""
        Response, wrong = estop_pb2.EstopCheckInResponse, None
        for _ in range(2):
            request = estop_pb2.EstopCheckInRequest(endpoint=self._endpoint, stop_level=estop_pb2.ESTOP_LEVEL_NONE)
            request.challenge, request.response = self._challenge, ~self._challenge & _MASK
            answer = self._connection.call("estop", "EstopCheckIn", request, checked=False)
            self._challenge, wrong = answer.challenge, response_trouble(answer)
            if answer.status != Response.STATUS_INCORRECT_CHALLENGE_RESPONSE:
                break
        if wrong is not None:
            raise LostError(f"our E-stop: {wrong.text}", wrong.cause)

    # -- keepalive ---------------------------------------------------------------------------------------------------

    def add_policy(self) -> None:
        """Adds the policy for our silence: the robot frees the lease and switches its motors off.

        The policy is absent while another client has the lease, and a robot without the service has none. Raises
        LostError.
        """
        self._wanted = self._connection.has("keepalive")
        if self._wanted:
            self._guard()

    def _guard(self) -> None:
        self._drop()
        self._guarded = self._connection.lease
        if self._guarded is None:
            return
        request = keepalive_pb2.ModifyPolicyRequest()
        request.to_add.name = CLIENT
        stale = request.to_add.actions.add(after=duration(LEASE_STALE_S))
        stale.lease_stale.leases.append(self._connection.lease)
        request.to_add.actions.add(after=duration(MOTORS_OFF_S)).controlled_motors_off.SetInParent()
        self._policy = self._connection.call("keepalive", "ModifyPolicy", request).added_policy.policy_id

    def remove_policy(self) -> None:
        """Removes the policy. Raises LostError."""
        self._wanted = False
        self._drop()

    def _drop(self) -> None:
        policy, self._policy, self._guarded = self._policy, None, None
        if policy is not None:
            request = keepalive_pb2.ModifyPolicyRequest(policy_ids_to_remove=[policy])
            self._connection.call("keepalive", "ModifyPolicy", request)

    def _check_in(self) -> None:
        """Checks in; adds the policy again if another program has removed it."""
        try:
            self._connection.call("keepalive", "CheckIn", keepalive_pb2.CheckInRequest(policy_id=self._policy))
        except LostError as error:
            if error.cause is not CommandCause.REFUSED:
                raise
            self._policy = None
            self._guard()
