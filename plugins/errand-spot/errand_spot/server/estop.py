"""E-stop: endpoints of clients; an endpoint's silence or command stops the motors."""

from __future__ import annotations

import secrets
import time
from dataclasses import dataclass
from enum import Enum
from threading import Lock
from typing import Any, Final

from bosdyn.api import estop_pb2

from errand_spot.messages import duration, seconds
from errand_spot.server.calls import Call, Service
from errand_spot.server.identity import DOMAIN

_MASK: Final = (1 << 64) - 1
_SETTLE_S: Final = 3.0


class Tablet(Enum):
    """Presence of an operator's tablet that holds a released E-stop from the start."""

    TABLET = "tablet"
    NONE = "none"


@dataclass
class _Held:
    """A registered endpoint: its last level, challenge and valid answer (s)."""

    endpoint: Any
    level: Any = estop_pb2.ESTOP_LEVEL_CUT
    challenge: int = 0
    answered_s: float = float("-inf")
    own: bool = False

    def effective_level(self, now_s: float) -> Any:
        """The level that counts: a silent endpoint first settles the robot, then cuts the power."""
        silent_s = now_s - self.answered_s
        timeout_s = seconds(self.endpoint.timeout)
        if self.own or silent_s <= timeout_s:
            return self.level
        cut_s = seconds(self.endpoint.cut_power_timeout) or timeout_s + _SETTLE_S
        settles = silent_s <= cut_s
        return min(self.level, estop_pb2.ESTOP_LEVEL_SETTLE_THEN_CUT if settles else estop_pb2.ESTOP_LEVEL_CUT)


class EstopService(Service):
    """Keeps the active configuration of endpoints. `motors_on` says whether the motors have power."""

    name, type, authority = "estop", "bosdyn.api.EstopService", f"estop.{DOMAIN}"

    def __init__(self, tablet: Tablet) -> None:
        self._lock, self.motors_on = Lock(), False
        self._config = estop_pb2.EstopConfig(unique_id=secrets.token_hex(8))
        self._held: dict[str, _Held] = {}
        if tablet is Tablet.TABLET:
            endpoint = self._config.endpoints.add(role="PDB_rooted", name="tablet", unique_id="tablet")
            endpoint.timeout.CopyFrom(duration(5.0))
            self._held["tablet"] = _Held(endpoint, estop_pb2.ESTOP_LEVEL_NONE, own=True)

    def level(self) -> int:
        """The robot's level, the strictest of all endpoints; cut if one or all are missing."""
        now_s = time.monotonic()
        with self._lock:
            if not self._config.endpoints or len(self._held) < len(self._config.endpoints):
                return int(estop_pb2.ESTOP_LEVEL_CUT)
            return int(min(held.effective_level(now_s) for held in self._held.values()))

    # -- the API's calls --------------------------------------------------------------------------------------------

    def GetEstopConfig(self, request: Any, _call: Call) -> Any:
        """Returns the active configuration."""
        with self._lock:
            return estop_pb2.GetEstopConfigResponse(active_config=self._config, request=request)

    def SetEstopConfig(self, request: Any, _call: Call) -> Any:
        """Replaces the configuration; all endpoints must register again."""
        Response = estop_pb2.SetEstopConfigResponse
        with self._lock:
            if request.target_config_id and request.target_config_id != self._config.unique_id:
                return Response(status=Response.STATUS_INVALID_ID, active_config=self._config, request=request)
            if self.motors_on:
                return Response(status=Response.STATUS_MOTORS_ON, active_config=self._config, request=request)
            self._config = estop_pb2.EstopConfig(endpoints=request.config.endpoints, unique_id=secrets.token_hex(8))
            for number, endpoint in enumerate(self._config.endpoints):
                endpoint.unique_id = endpoint.unique_id or str(number)
            self._held = {}
            return Response(status=Response.STATUS_SUCCESS, active_config=self._config, request=request)

    def RegisterEstopEndpoint(self, request: Any, _call: Call) -> Any:
        """Registers an endpoint in place of one of the configuration."""
        Response = estop_pb2.RegisterEstopEndpointResponse
        with self._lock:
            if request.target_config_id != self._config.unique_id:
                return Response(status=Response.STATUS_CONFIG_MISMATCH, request=request)
            place = self._place_of(request.target_endpoint)
            if place is None:
                return Response(status=Response.STATUS_ENDPOINT_MISMATCH, request=request)
            if seconds(request.new_endpoint.timeout) <= 0.0:
                return Response(status=Response.STATUS_INVALID_ENDPOINT, request=request)
            self._held.pop(place.unique_id, None)
            place.CopyFrom(request.new_endpoint)
            place.unique_id = secrets.token_hex(8)
            self._held[place.unique_id] = _Held(place, challenge=secrets.randbits(64))
            return Response(status=Response.STATUS_SUCCESS, new_endpoint=place, request=request)

    def DeregisterEstopEndpoint(self, request: Any, _call: Call) -> Any:
        """Removes a registered endpoint; the robot is then stopped."""
        Response = estop_pb2.DeregisterEstopEndpointResponse
        with self._lock:
            if request.target_config_id != self._config.unique_id:
                return Response(status=Response.STATUS_CONFIG_MISMATCH, request=request)
            if self.motors_on:
                return Response(status=Response.STATUS_MOTORS_ON, request=request)
            removed = self._held.pop(request.target_endpoint.unique_id, None)
            status = Response.STATUS_ENDPOINT_MISMATCH if removed is None else Response.STATUS_SUCCESS
            return Response(status=status, request=request)

    def EstopCheckIn(self, request: Any, _call: Call) -> Any:
        """Takes the word of an endpoint. The answer to the last challenge is its complement."""
        Response = estop_pb2.EstopCheckInResponse
        with self._lock:
            held = self._held.get(request.endpoint.unique_id)
            if held is None or held.own:
                return Response(status=Response.STATUS_ENDPOINT_UNKNOWN, request=request)
            right = request.challenge == held.challenge and request.response == ~held.challenge & _MASK
            held.challenge = secrets.randbits(64)
            if not right:
                status = Response.STATUS_INCORRECT_CHALLENGE_RESPONSE
                return Response(status=status, challenge=held.challenge, request=request)
            held.level, held.answered_s = request.stop_level, time.monotonic()
            return Response(status=Response.STATUS_OK, challenge=held.challenge, request=request)

    def GetEstopSystemStatus(self, _request: Any, _call: Call) -> Any:
        """Returns the level of each endpoint, and the robot's level."""
        made, level, now_s = estop_pb2.GetEstopSystemStatusResponse(), self.level(), time.monotonic()
        with self._lock:
            for held in self._held.values():
                one = made.status.endpoints.add(endpoint=held.endpoint, stop_level=held.effective_level(now_s))
                one.time_since_valid_response.CopyFrom(duration(0.0 if held.own else min(1e6, now_s - held.answered_s)))
        made.status.stop_level = level
        made.status.stop_level_details = "" if level == estop_pb2.ESTOP_LEVEL_NONE else "an endpoint stops the robot"
        return made

    def _place_of(self, target: Any) -> Any:
        """Returns the endpoint of the configuration that a request names by its id, else by role and name."""
        for endpoint in self._config.endpoints:
            if target.unique_id and endpoint.unique_id == target.unique_id:
                return endpoint
            if not target.unique_id and endpoint.role == target.role:
                return endpoint
        return None
