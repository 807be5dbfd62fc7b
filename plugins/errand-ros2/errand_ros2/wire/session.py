"""Session of Zenoh: the router of this machine, or a client of a router that runs already."""

from __future__ import annotations

import json
import re
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import count
from typing import Final

import zenoh

from errand_ros2.wire.keys import MOST_DOMAIN, NodeKey
from skills.inputs.errors import InputError

HOST: Final = "127.0.0.1"
PORT: Final = 7447
"""Port of rmw_zenoh's router."""
_PLACE: Final = re.compile(r"(?P<domain>\d{1,9})?(@(?P<host>[\w.-]+|\[[\w:.%]+\])?(:(?P<port>\d{1,5}))?)?")
_LOOK_S: Final = 0.5
_MOST_PORT: Final = 65535


@dataclass(frozen=True)
class Place:
    """ROS domain, and the address of the Zenoh router."""

    domain: int = 0
    host: str = HOST
    port: int = PORT

    @classmethod
    def parse(cls, text: str) -> Place:
        """Reads `[DOMAIN][@HOST[:PORT]]`; what is left out has its usual value. Raises InputError."""
        found = _PLACE.fullmatch(text)
        hint = "write [DOMAIN][@HOST[:PORT]], as in 0 or 42@192.168.1.5:7447"
        if found is None:
            raise InputError(f"'{text[:60]}' is no ROS domain", hint=hint)
        place = cls(int(found["domain"] or 0), found["host"] or HOST, int(found["port"] or PORT))
        if place.domain > MOST_DOMAIN or not 0 < place.port <= _MOST_PORT:
            raise InputError(f"'{text[:60]}': domains go to {MOST_DOMAIN}, ports from 1 to {_MOST_PORT}", hint=hint)
        return place

    @property
    def endpoint(self) -> str:
        """Address as Zenoh writes it."""
        return f"tcp/{self.host}:{self.port}"


class Session:
    """Open session; nodes and their publishers, subscriptions and services get their numbers here."""

    def __init__(self, inner: zenoh.Session, place: Place, is_router: bool) -> None:
        self.inner, self.place, self.is_router = inner, place, is_router
        self.numbers = count()
        self.liveliness = inner.liveliness()

    def node_key(self, name: str, namespace: str) -> NodeKey:
        """Returns the key of a new node."""
        return NodeKey(self.place.domain, str(self.inner.zid()), next(self.numbers), namespace, name)


@contextmanager
def open_session(place: Place) -> Iterator[Session]:
    """Opens a session, which becomes the router if none answers on this machine. Raises InputError.

    A session that is a client waits for its router again when the router restarts.
    """
    client = _answers(place)
    if not client and not _is_here(place.host):
        raise InputError(f"no Zenoh router answers at {place.host}:{place.port}", hint="start it, or leave @HOST out")
    try:
        opened = zenoh.open(zenoh.Config.from_json5(json.dumps(_configuration(place, client=client))))
    except zenoh.ZError as error:
        what = f"cannot open a Zenoh session at {place.host}:{place.port} ({str(error).partition(chr(10))[0][:80]})"
        raise InputError(what, hint="name another port, or end the program that uses it") from error
    with opened as inner:
        yield Session(inner, place, is_router=not client)


def _answers(place: Place) -> bool:
    try:
        socket.create_connection((place.host.strip("[]"), place.port), _LOOK_S).close()
    except (OSError, UnicodeError):
        return False
    return True


def _is_here(host: str) -> bool:
    """Returns whether an address is one of this machine, on which a router may listen."""
    try:
        with socket.create_server((host.strip("[]"), 0), family=socket.AF_INET6 if ":" in host else socket.AF_INET):
            return True
    except (OSError, UnicodeError):
        return False


def _configuration(place: Place, *, client: bool) -> dict[str, object]:
    """Returns Zenoh's configuration: no multicast, and time stamps, which caches need."""
    endpoints = {"endpoints": [place.endpoint]}
    return {
        "mode": "client" if client else "router",
        **({"connect": endpoints} if client else {"listen": endpoints}),
        "scouting": {"multicast": {"enabled": False}},
        "timestamping": {"enabled": True, "drop_future_timestamp": False},
    }
