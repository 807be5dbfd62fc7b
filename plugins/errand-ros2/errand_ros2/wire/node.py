"""Nodes of ROS 2, over one of two wires: `rclpy` of an installed ROS 2, or Zenoh, which needs none."""

from __future__ import annotations

import logging
import math
import os
import re
from abc import ABC, abstractmethod
from collections import defaultdict
from collections.abc import Callable
from concurrent.futures import Executor
from contextlib import suppress
from dataclasses import dataclass
from importlib.util import find_spec
from typing import Any, Final, cast

from errand_ros2.wire.types import USUAL, MalformedError, MessageType, Qos, topic_name
from skills.inputs.errors import InputError

_LOG: Final = logging.getLogger(__name__)
_DRIFT_S, _MOST_SENDERS = 0.001, 1000  # growth of the quickest; senders noted
_WIRE: Final = re.compile(r"(?:(rclpy|zenoh):)?(.*)", re.DOTALL)
_PLACE: Final = re.compile(r"(?P<domain>\d{1,9})?(@(?P<host>[\w.-]+|\[[\w:.%]+\])?(:(?P<port>\d{1,5}))?)?")
MOST_BYTES: Final = 1 << 26  # longer messages are dropped
PORT, _MOST_DOMAIN, _MOST_PORT = 7447, 232, 65535  # port of rmw_zenoh's router; limits


@dataclass(frozen=True)
class Place:
    """ROS domain, and the wire: `rclpy`, or Zenoh with the address of its router."""

    domain: int = 0
    host: str = "127.0.0.1"
    port: int = PORT
    by_rclpy: bool = False

    @classmethod
    def parse(cls, text: str) -> Place:
        """Reads `[DOMAIN]`, or `zenoh:[DOMAIN][@HOST[:PORT]]`; the usual domain is ROS_DOMAIN_ID, or 0.

        Without a wire it is `rclpy` where that is installed and no router is named. Raises InputError.
        """
        wire, text = cast(re.Match[str], _WIRE.fullmatch(text)).groups()  # which any text matches
        has_rclpy = find_spec("rclpy") is not None
        text = text if text[:1].isdecimal() else f"{os.environ.get('ROS_DOMAIN_ID', '')}{text}"
        if wire == "rclpy" and not has_rclpy:
            what = "rclpy is not installed for this Python"
            raise InputError(what, hint="source ROS 2, or pip install 'errand-ros2[rclpy]', or write zenoh:")
        if (found := _PLACE.fullmatch(text)) is not None:
            router = found["host"] or found["port"]
            by_rclpy = wire == "rclpy" or (wire is None and has_rclpy and not router)
            place = cls(int(found["domain"] or 0), found["host"] or cls.host, int(found["port"] or cls.port), by_rclpy)
            if place.domain <= _MOST_DOMAIN and 0 < place.port <= _MOST_PORT and not (by_rclpy and router):
                return place
        what = f"'{text[:60]}' is no ROS domain: domains go to {_MOST_DOMAIN}, ports from 1 to {_MOST_PORT}"
        raise InputError(what, hint="write [DOMAIN] or zenoh:[DOMAIN][@HOST[:PORT]], as in 0 or zenoh:42@192.168.1.5")


class Session(ABC):
    """Open connection to the network of a place; `told` says in words over which wire."""

    def __init__(self, place: Place, told: str) -> None:
        self.place, self.told = place, told

    @abstractmethod
    def node(self, name: str, namespace: str = "/") -> Node:
        """Returns a new node. Raises InputError for a namespace that ROS 2 does not allow."""


class Publisher:
    """Publisher of one topic. Late subscribers get the last messages if its quality of service says so."""

    def __init__(self, node: Node, send: Callable[[Any], Any], has_subscriptions: Callable[[], bool]) -> None:
        self._node, self._send, self._has_subscriptions = node, send, has_subscriptions

    @property
    def is_heard(self) -> bool:
        """Returns whether a subscription exists now, or one may come for the messages that are kept."""
        return self._has_subscriptions()

    def put(self, message: Any) -> None:
        """Publishes a message, or a mapping of its fields."""
        self._node.sent += 1
        self._send(message)


class Client:
    """Client of a service; as it stands, of one whose interface is not installed."""

    def call(self, request: Any, *, limit_s: float) -> Any:
        """Returns the service's response; None when no service answers within the limit (s)."""

    def ask(self, request: Any, take: Callable[[Any], None], *, limit_s: float) -> None:
        """Calls `take` with the service's response when it comes, in a thread of the wire."""


@dataclass(frozen=True)
class Request:
    """Request of a client. `reply` sends the response, or a mapping of its fields, once, at once or later."""

    message: Any
    reply: Callable[[Any], None]


class Node(ABC):
    """Node of ROS 2, whose handlers threads of the wire call. Names without a `/` before stand below its namespace."""

    padding = 0  # bytes that the wire may add to a message

    def __init__(self, namespace: str) -> None:
        self.namespace = "/" if namespace == "/" else topic_name(namespace)
        self.types = defaultdict[str, list[str]](list)  # of the topics that are subscribed to
        self.sent, self.handled, self.dropped = 0, 0, 0  # messages published, handled, and not decoded

    @abstractmethod
    def claim(self, *topics: str) -> None:
        """Raises InputError when another node publishes one of the topics, which only one may publish."""

    @abstractmethod
    def publisher(self, topic: str, type_name: str, qos: Qos = USUAL) -> Publisher:
        """Returns a publisher of a topic."""

    @abstractmethod
    def subscribe(
        self, topic: str, type_name: str, handle: Callable[[Any], Any], qos: Qos = USUAL, late_s: float = math.inf
    ) -> Callable[[], None]:
        """Calls `handle` with each message that is not `late_s` late; returns a function that ends the subscription."""

    @abstractmethod
    def serve(self, name: str, type_name: str, handle: Callable[[Request], None]) -> None:
        """Calls `handle` with each request for a service; it may answer later."""

    @abstractmethod
    def client(self, name: str, type_name: str) -> Client:
        """Returns a client of a service."""

    def take(self, kind: MessageType, data: bytes, handle: Callable[[Any], Any], name: str) -> None:
        """Handles a message of a topic, and counts it."""
        if (message := self.decoded(kind, data)) is not None:
            self.guarded(lambda: handle(message), name)
            self.handled += 1

    def decoded(self, kind: MessageType, data: bytes) -> Any:
        """Decodes a message of just this length; counts it and returns None if it is malformed."""
        with suppress(MalformedError):
            if len(data) <= MOST_BYTES:
                return kind.decode(data, self.padding)
        self.dropped += 1
        return None

    def compare(self, topic: str, theirs: str) -> None:
        """Says once that a topic is published as a type which is not subscribed to."""
        if theirs not in (ours := self.types[topic]):
            _LOG.warning("errand: %s is published as %s and not heard, since it takes %s", topic, theirs, ours[0])
            ours.append(theirs)

    def absolute(self, name: str) -> str:
        """Returns the absolute name of a topic or service. Raises InputError."""
        return topic_name(name if name.startswith("/") else f"{self.namespace.rstrip('/')}/{name}")

    def answer(self, name: str, type_name: str, answer: Callable[[Any], Any]) -> None:
        """Serves a service by a function from a request to its response, or to a mapping of its fields."""
        self.serve(name, type_name, lambda request: request.reply(answer(request.message)))

    def later(self, pool: Executor, handle: Callable[[Any], Any]) -> Callable[[Any], None]:
        """Returns a handler that lets a pool handle what comes, because it may take long, until the pool is closed."""

        def hear(message: Any) -> None:
            with suppress(RuntimeError):
                pool.submit(self.guarded, lambda: handle(message), "a message")

        return hear

    def guarded(self, handle: Callable[[], None], name: str) -> None:
        """Calls a handler; a defect of it becomes one line in the log."""
        try:
            handle()
        except Exception as error:
            _LOG.warning("errand: %s could not be handled (%s: %s)", name, type(error).__name__, error)


def taken_by_others(name: str, domain: int) -> InputError:
    """Returns the error of a topic that another node publishes."""
    what = f"{name} is published in domain {domain} already, by another robot, simulator or run"
    return InputError(what, hint="end it, or name another domain")


class Delays:
    """Delays of messages: how much longer one took than its sender's quickest, which grows a little with each."""

    def __init__(self) -> None:
        self._quickest_s = dict[bytes, float]()

    def of(self, sender: bytes, took_s: float) -> float:
        """Returns the delay (s) of a message that took a time (s) by the two clocks."""
        if len(self._quickest_s) > _MOST_SENDERS:
            self._quickest_s.clear()
        self._quickest_s[sender] = min(took_s, self._quickest_s.get(sender, took_s) + _DRIFT_S)
        return took_s - self._quickest_s[sender]
