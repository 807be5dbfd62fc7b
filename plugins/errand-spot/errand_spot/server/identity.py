"""Identity of the robot and its clients: certificate, users and tokens, directory, licence and clock."""

from __future__ import annotations

import datetime
import secrets
import time
from collections import deque
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from threading import Lock
from typing import Any, Final

import jwt
from bosdyn.api import auth_pb2, directory_pb2, directory_registration_pb2, license_pb2, robot_id_pb2, time_sync_pb2
from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import NameOID

from errand_spot.messages import duration, seconds, timestamp
from errand_spot.server.calls import Call, Service

DOMAIN: Final = "spot.robot"
SERIAL: Final = "errand-simulated"
_VALID_DAYS: Final = 3650
_TOKEN_S: Final = 12 * 3600.0
_MOST_FAILURES, _LOCKED_S = 6, 60.0
_ALGORITHM: Final = "HS256"
API_VERSION: Final = (5, 2, 0)
"""Version of the API that is served."""


@dataclass(frozen=True)
class Credentials:
    """Files of the server: its certificate, which clients trust, its private key, and the key of its tokens."""

    certificate: Path
    private_key: Path
    token_key: Path


def credentials(folder: Path) -> Credentials:
    """Returns the credentials in a folder; makes them first if there are none. Raises OSError."""
    found = Credentials(folder / "robot.pem", folder / "robot.key", folder / "tokens.key")
    if not all(path.is_file() for path in (found.certificate, found.private_key, found.token_key)):
        folder.mkdir(parents=True, exist_ok=True)
        certificate, key = _self_signed()
        _write_secret(found.private_key, key)
        _write_secret(found.token_key, secrets.token_hex(32).encode())
        found.certificate.write_bytes(certificate)
    return found


def _write_secret(path: Path, data: bytes) -> None:
    """Writes a file that only its owner can read."""
    path.touch(mode=0o600)
    path.chmod(0o600)
    path.write_bytes(data)


def _self_signed() -> tuple[bytes, bytes]:
    """Returns a certificate for all of the robot's authorities, and its private key, as PEM."""
    key = ec.generate_private_key(ec.SECP256R1())
    name = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, DOMAIN)])
    today = datetime.datetime.now(datetime.UTC)
    made = (
        x509.CertificateBuilder(name, name, key.public_key(), x509.random_serial_number())
        .not_valid_before(today - datetime.timedelta(days=1))
        .not_valid_after(today + datetime.timedelta(days=_VALID_DAYS))
        .add_extension(x509.SubjectAlternativeName([x509.DNSName(DOMAIN), x509.DNSName(f"*.{DOMAIN}")]), False)
        .add_extension(x509.BasicConstraints(ca=True, path_length=0), True)
        .sign(key, hashes.SHA256())
    )
    private = key.private_bytes(
        serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, serialization.NoEncryption()
    )
    return made.public_bytes(serialization.Encoding.PEM), private


@dataclass
class _Failures:
    """Wrong passwords of one user in a row, and when the last one came (s)."""

    count: int = 0
    last_s: float = 0.0


class AuthService(Service):
    """Gives tokens for passwords; a token outlives the server. Six wrong passwords lock a user out for a minute."""

    name, type, authority, needs_token = "auth", "bosdyn.api.AuthService", f"auth.{DOMAIN}", False

    def __init__(self, passwords: Mapping[str, str], key: bytes) -> None:
        """Stores the users' passwords by name, and the key that signs tokens."""
        self._passwords, self._key = dict(passwords), key
        self._failures: dict[str, _Failures] = {}
        self._lock = Lock()

    def GetAuthToken(self, request: auth_pb2.GetAuthTokenRequest, _call: Call) -> auth_pb2.GetAuthTokenResponse:
        """Answers a login, or renews a token."""
        Response = auth_pb2.GetAuthTokenResponse
        if request.token:
            user = self.user_of(request.token)
            return Response(status=Response.STATUS_INVALID_TOKEN) if user is None else self._token(user)
        with self._lock:
            failures = self._failures.setdefault(request.username, _Failures())
            if failures.count >= _MOST_FAILURES and time.monotonic() - failures.last_s < _LOCKED_S:
                return Response(status=Response.STATUS_TEMPORARILY_LOCKED_OUT)
            known = self._passwords.get(request.username)
            if known is None or not secrets.compare_digest(known.encode(), request.password.encode()):
                failures.count, failures.last_s = failures.count + 1, time.monotonic()
                return Response(status=Response.STATUS_INVALID_LOGIN)
            del self._failures[request.username]
        return self._token(request.username)

    def _token(self, user: str) -> auth_pb2.GetAuthTokenResponse:
        claims = {"sub": user, "iss": SERIAL, "aud": SERIAL, "exp": time.time() + _TOKEN_S}
        Response = auth_pb2.GetAuthTokenResponse
        return Response(status=Response.STATUS_OK, token=jwt.encode(claims, self._key, algorithm=_ALGORITHM))

    def user_of(self, token: str) -> str | None:
        """Returns the user of a token; None if another robot issued it, or it has expired."""
        try:
            claims = jwt.decode(token, self._key, algorithms=[_ALGORITHM], audience=SERIAL)
        except jwt.InvalidTokenError:
            return None
        user = str(claims["sub"])
        return user if user in self._passwords else None


class RobotIdService(Service):
    """Tells who the robot is."""

    name, type, authority, needs_token = "robot-id", "bosdyn.api.RobotIdService", f"id.{DOMAIN}", False

    def __init__(self, nickname: str) -> None:
        self._nickname = nickname

    def GetRobotId(self, _request: robot_id_pb2.RobotIdRequest, _call: Call) -> robot_id_pb2.RobotIdResponse:
        """Returns the robot's identity."""
        major, minor, patch = API_VERSION
        made = robot_id_pb2.RobotIdResponse()
        made.robot_id.serial_number = made.robot_id.computer_serial_number = SERIAL
        made.robot_id.species, made.robot_id.version, made.robot_id.nickname = "spot", "V3", self._nickname
        release = made.robot_id.software_release
        release.version.major_version, release.version.minor_version, release.version.patch_level = API_VERSION
        release.name, release.type = f"{major}.{minor}.{patch}", "simulated"
        return made


class DirectoryService(Service):
    """Lists the services of the robot, and those registered by clients."""

    name, type, authority = "directory", "bosdyn.api.DirectoryService", f"api.{DOMAIN}"

    def __init__(self, entries: Iterable[tuple[str, str, str]], now: Callable[[], float]) -> None:
        """Takes name, type and authority of each service."""
        self._lock, self._own = Lock(), frozenset(name for name, _, _ in entries)
        self._entries = {
            name: directory_pb2.ServiceEntry(name=name, type=type_name, authority=authority)
            for name, type_name, authority in entries
        }
        self._heard_s: dict[str, float] = {}
        for entry in self._entries.values():
            entry.last_update.CopyFrom(timestamp(now()))

    def ListServiceEntries(self, _request: Any, _call: Call) -> Any:
        """Lists all services."""
        with self._lock:
            return directory_pb2.ListServiceEntriesResponse(service_entries=self._entries.values())

    def GetServiceEntry(self, request: Any, _call: Call) -> Any:
        """Returns the entry of one service."""
        Response = directory_pb2.GetServiceEntryResponse
        with self._lock:
            entry = self._entries.get(request.service_name)
        if entry is None:
            return Response(status=Response.STATUS_NONEXISTENT_SERVICE)
        return Response(status=Response.STATUS_OK, service_entry=entry)

    def put(self, entry: Any, *, new: bool) -> bool:
        """Stores the entry of a client's service; returns False if it exists, or with `new` False if it does not.

        Clients say that a service is alive by registering it again.
        """
        with self._lock:
            known = entry.name in self._entries
            if entry.name in self._own or not (known or new):
                return False
            self._heard_s[entry.name] = time.monotonic()
            if not (known and new):
                self._entries[entry.name] = entry
        return not (known and new)

    def silent(self) -> list[str]:
        """Names of the clients' services that have not updated their entries in time."""
        with self._lock:
            heard = [(self._entries[name], at_s) for name, at_s in self._heard_s.items() if name in self._entries]
            now_s = time.monotonic()
            return [each.name for each, at_s in heard if 0.0 < each.liveness_timeout_secs < now_s - at_s]

    def remove(self, name: str) -> bool:
        """Removes the entry of a client's service; returns False if there is none."""
        with self._lock:
            return name not in self._own and self._entries.pop(name, None) is not None


class DirectoryRegistrationService(Service):
    """Registers services of clients in the directory."""

    name, type, authority = "directory-registration", "bosdyn.api.DirectoryRegistrationService", f"api.{DOMAIN}"

    def __init__(self, directory: DirectoryService) -> None:
        self._directory = directory

    def RegisterService(self, request: Any, _call: Call) -> Any:
        """Registers a service."""
        Response = directory_registration_pb2.RegisterServiceResponse
        stored = self._directory.put(request.service_entry, new=True)
        return Response(status=Response.STATUS_OK if stored else Response.STATUS_ALREADY_EXISTS)

    def UpdateService(self, request: Any, _call: Call) -> Any:
        """Replaces the entry of a registered service."""
        Response = directory_registration_pb2.UpdateServiceResponse
        stored = self._directory.put(request.service_entry, new=False)
        return Response(status=Response.STATUS_OK if stored else Response.STATUS_NONEXISTENT_SERVICE)

    def UnregisterService(self, request: Any, _call: Call) -> Any:
        """Removes the entry of a registered service."""
        Response = directory_registration_pb2.UnregisterServiceResponse
        removed = self._directory.remove(request.service_name)
        return Response(status=Response.STATUS_OK if removed else Response.STATUS_NONEXISTENT_SERVICE)


class LicenseService(Service):
    """Answers that every feature is licensed."""

    name, type, authority = "license", "bosdyn.api.LicenseService", f"api.{DOMAIN}"

    def GetLicenseInfo(self, _request: Any, _call: Call) -> Any:
        """Returns a licence that is valid."""
        made = license_pb2.GetLicenseInfoResponse()
        made.license.status, made.license.id = license_pb2.LicenseInfo.STATUS_VALID, "simulated"
        made.license.robot_serial = SERIAL
        return made

    def GetFeatureEnabled(self, request: Any, _call: Call) -> Any:
        """Returns that each feature is enabled."""
        return license_pb2.GetFeatureEnabledResponse(feature_enabled=dict.fromkeys(request.feature_codes, True))


_Trips = deque[tuple[float, float]]
"""The last round trips of a client: their time and the skew that they showed (s)."""


class TimeSyncService(Service):
    """Estimates how far the robot's clock is ahead of each client's, after the round trips that clients report."""

    name, type, authority, needs_token = "time-sync", "bosdyn.api.TimeSyncService", f"api.{DOMAIN}", False
    _ENOUGH: Final = 2
    _REMEMBERED: Final = 10

    def __init__(self) -> None:
        self._lock, self._clocks = Lock(), dict[str, _Trips]()

    def knows(self, identifier: str) -> bool:
        """Returns whether a client with this clock identifier has synchronised its clock."""
        with self._lock:
            return len(self._clocks.get(identifier, ())) >= self._ENOUGH

    def TimeSyncUpdate(self, request: Any, _call: Call) -> Any:
        """Takes the times of the last round trip, and returns the best estimate."""
        made = time_sync_pb2.TimeSyncUpdateResponse()
        with self._lock:
            identifier = request.clock_identifier if request.clock_identifier in self._clocks else secrets.token_hex(8)
            trips = self._clocks.setdefault(identifier, deque(maxlen=self._REMEMBERED))
            if request.HasField("previous_round_trip"):
                trips.append(_round_trip(request.previous_round_trip))
                made.previous_estimate.CopyFrom(_estimate(trips))
        state, State = made.state, time_sync_pb2.TimeSyncState
        state.status = State.STATUS_OK if len(trips) >= self._ENOUGH else State.STATUS_MORE_SAMPLES_NEEDED
        if trips:
            state.best_estimate.CopyFrom(_estimate(trips))
        made.clock_identifier = identifier
        return made


def _round_trip(trip: Any) -> tuple[float, float]:
    """Time of a round trip, and how far the robot's clock is ahead of the client's (s)."""
    sent_s, received_s = seconds(trip.client_tx), seconds(trip.server_rx)
    answered_s, back_s = seconds(trip.server_tx), seconds(trip.client_rx)
    return (back_s - sent_s) - (answered_s - received_s), 0.5 * ((received_s - sent_s) + (answered_s - back_s))


def _estimate(trips: _Trips) -> Any:
    """The estimate with the shortest and thus surest round trip; earlier ones are dropped, because clocks drift."""
    round_trip_s, skew_s = min(trips)
    return time_sync_pb2.TimeSyncEstimate(round_trip_time=duration(round_trip_s), clock_skew=duration(skew_s))
