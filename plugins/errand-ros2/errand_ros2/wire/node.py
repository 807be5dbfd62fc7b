"""Sessions of Zenoh, and nodes of ROS 2 in them. Zenoh calls handlers in threads of its own."""

from __future__ import annotations

import json
import logging
import math
import os
import re
import socket
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Executor
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from itertools import count
from typing import Any, Final

import zenoh
from zenoh import ext

from errand_ros2.wire.types import (
    ADMIN,
    CLIENT,
    PUBLISHER,
    SERVICE,
    SUBSCRIPTION,
    USUAL,
    Attachment,
    MalformedError,
    MessageType,
    NodeKey,
    Qos,
    ServiceType,
    gid_of,
    ros_types,
    topic_name,
)
from skills.inputs.errors import InputError

_LOG: Final = logging.getLogger(__name__)
_CDR: Final = "application/cdr"
MOST_BYTES: Final = 1 << 26  # longer messages are dropped
_CLAIM_S, _DRIFT_S, _MOST_SENDERS = 2.0, 0.001, 1000  # wait for publishers; growth of the quickest; senders noted
_PLACE: Final = re.compile(r"(?P<domain>\d{1,9})?(@(?P<host>[\w.-]+|\[[\w:.%]+\])?(:(?P<port>\d{1,5}))?)?")
PORT, _MOST_DOMAIN, _MOST_PORT = 7447, 232, 65535  # port of rmw_zenoh's router; limits


@dataclass(frozen=True)
class Place:
    """ROS domain, and the address of the Zenoh router."""

    domain: int = 0
    host: str = "127.0.0.1"
    port: int = PORT

    @classmethod
    def parse(cls, text: str) -> Place:
        """Reads `[DOMAIN][@HOST[:PORT]]`; the usual domain is ROS_DOMAIN_ID, or 0. Raises InputError."""
        text = text if text[:1].isdecimal() else f"{os.environ.get('ROS_DOMAIN_ID', '')}{text}"
        if (found := _PLACE.fullmatch(text)) is not None:
            place = cls(int(found["domain"] or 0), found["host"] or cls.host, int(found["port"] or cls.port))
            if place.domain <= _MOST_DOMAIN and 0 < place.port <= _MOST_PORT:
                return place
        what = f"'{text[:60]}' is no ROS domain: domains go to {_MOST_DOMAIN}, ports from 1 to {_MOST_PORT}"
        raise InputError(what, hint="write [DOMAIN][@HOST[:PORT]], as in 0 or 42@192.168.1.5:7447")

    @property
    def endpoint(self) -> str:
        """Address as Zenoh writes it."""
        return f"tcp/{self.host}:{self.port}"


class Session:
    """Open session; nodes and their publishers, subscriptions and services get their numbers here."""

    def __init__(self, inner: zenoh.Session, place: Place, is_router: bool) -> None:
        self.inner, self.place, self.is_router = inner, place, is_router
        self.numbers, self.liveliness = count(), inner.liveliness()


@contextmanager
def open_session(place: Place) -> Iterator[Session]:
    """Opens a session, which becomes the router if none answers on this machine. Raises InputError.

    A session that is a client waits for its router again when the router restarts.
    """
    client, endpoints = False, {"endpoints": [place.endpoint]}
    with suppress(OSError, UnicodeError):
        socket.create_connection((place.host.strip("[]"), place.port), timeout=0.5).close()
        client = True
    how = {"mode": "client", "connect": endpoints} if client else {"mode": "router", "listen": endpoints}
    how |= {"scouting": {"multicast": {"enabled": False}, "delay": 0}}  # there is nothing to wait for
    how |= {"timestamping": {"enabled": True, "drop_future_timestamp": False}}  # which caches need
    try:
        opened = zenoh.open(zenoh.Config.from_json5(json.dumps(how)))
    except zenoh.ZError as error:
        why = str(error).partition("\n")[0][:80]
        what = f"no Zenoh router answers at {place.host}:{place.port}, and none can listen there ({why})"
        raise InputError(what, hint="start it, name another port, or leave @HOST out") from error
    with opened as inner:
        yield Session(inner, place, is_router=not client)


class Publisher:
    """Publisher of one topic. Late subscribers get the last messages if its quality of service says so."""

    def __init__(self, node: Node, topic: str, kind: MessageType, qos: Qos) -> None:
        self._node, self._kind, self._numbers = node, kind, count(1)
        key, self._gid = node.key.data_key(topic, kind.key), node.declare(PUBLISHER, topic, kind.key, qos)
        how: dict[str, Any] = {"encoding": _CDR, "reliability": zenoh.Reliability.RELIABLE}
        self._publisher: Any
        session = node.session.inner
        if qos.transient_local:
            cache = ext.CacheConfig(max_samples=qos.depth)
            self._publisher = ext.declare_advanced_publisher(session, key, cache=cache, publisher_detection=True, **how)
        else:
            self._publisher = session.declare_publisher(key, **how)

    @property
    def is_heard(self) -> bool:
        """Returns whether a subscription exists now, or one may come for the cached messages."""
        status = getattr(self._publisher, "matching_status", True)  # one with a cache has none
        return bool(getattr(status, "matching", status))

    def put(self, message: Any) -> None:
        """Publishes a message, or a mapping of its fields."""
        self._node.sent += 1
        attachment = Attachment(next(self._numbers), time.time_ns(), self._gid).encoded()
        self._publisher.put(self._kind.encode(message), attachment=attachment)


@dataclass(frozen=True)
class Request:
    """Request of a client, which is answered once, at once or later."""

    message: Any
    query: zenoh.Query
    key: str
    head: Attachment
    kind: MessageType

    def reply(self, response: Any) -> None:
        """Sends the response, or a mapping of its fields."""
        attachment = Attachment(self.head.number, time.time_ns(), self.head.gid).encoded()
        with self.query:
            self.query.reply(self.key, self.kind.encode(response), encoding=_CDR, attachment=attachment)


class Client:
    """Client of a service."""

    def __init__(self, node: Node, name: str, kind: ServiceType) -> None:
        self._kind, self._key = kind, node.key.data_key(name, kind.key)
        self._gid, self._numbers = node.declare(CLIENT, name, kind.key, USUAL), count(1)
        self._session = node.session.inner

    def call(self, request: Any, *, limit_s: float) -> Any:
        """Returns the service's response; None when no service answers within the limit (s)."""
        responses = map(self._response, self._session.get(self._key, **self._options(request, limit_s)))
        return next((each for each in responses if each is not None), None)

    def ask(self, request: Any, take: Callable[[Any], None], *, limit_s: float) -> None:
        """Calls `take` with the service's response when it comes, in a thread of Zenoh."""

        def taken(reply: zenoh.Reply) -> None:
            if (response := self._response(reply)) is not None:
                take(response)

        self._session.get(self._key, taken, **self._options(request, limit_s))

    def _options(self, request: Any, limit_s: float) -> dict[str, Any]:
        attachment = Attachment(next(self._numbers), time.time_ns(), self._gid).encoded()
        payload = self._kind.request.encode(request)
        how = {"target": zenoh.QueryTarget.ALL_COMPLETE, "timeout": limit_s, "encoding": _CDR}
        return {**how, "payload": payload, "attachment": attachment}

    def _response(self, reply: zenoh.Reply) -> Any:
        """Returns the response in a reply; None for an error, and for one that cannot be decoded."""
        try:
            return None if reply.ok is None else self._kind.response.decode(reply.ok.payload.to_bytes())
        except MalformedError:
            return None


class Node:
    """Node in the graph of ROS 2. Names that begin with `/` are absolute, others stand below its namespace."""

    def __init__(self, session: Session, name: str, namespace: str = "/") -> None:
        """Declares the node. Raises InputError for a namespace that ROS 2 does not allow."""
        self.session, self.namespace = session, "/" if namespace == "/" else topic_name(namespace)
        zid, number = str(session.inner.zid()), next(session.numbers)
        self.key = NodeKey(session.place.domain, zid, number, self.namespace, name)
        self.sent, self.handled, self.dropped = 0, 0, 0
        """Numbers of the messages that were published, handled, and could not be decoded."""
        self._declared: list[Any] = [session.liveliness.declare_token(self.key.token())]

    def absolute(self, name: str) -> str:
        """Returns the absolute name of a topic or service. Raises InputError."""
        return topic_name(name if name.startswith("/") else f"{self.namespace.rstrip('/')}/{name}")

    def claim(self, *topics: str) -> None:
        """Raises InputError when another node publishes one of the topics, which only one may publish."""
        domain, liveliness = self.key.domain, self.session.liveliness
        for name in map(self.absolute, topics):
            key = f"{ADMIN}/{domain}/*/*/*/{PUBLISHER}/*/*/*/{name.replace('/', '%')}/**"
            if any(reply.ok is not None for reply in liveliness.get(key, timeout=_CLAIM_S)):
                what = f"{name} is published in domain {domain} already, by another robot, simulator or run"
                raise InputError(what, hint="end it, or name another domain")

    def declare(self, kind: str, name: str, type_key: str, qos: Qos) -> bytes:
        """Declares an entity of the node; returns its identity."""
        token = self.key.entity_token(kind, next(self.session.numbers), name, type_key, qos)
        self._declared.append(self.session.liveliness.declare_token(token))
        return gid_of(token)

    def publisher(self, topic: str, type_name: str, qos: Qos = USUAL) -> Publisher:
        """Returns a publisher of a topic."""
        made = Publisher(self, self.absolute(topic), ros_types().message(type_name), qos)
        self._declared.append(made)  # Zenoh ends what nobody refers to
        return made

    def subscribe(
        self, topic: str, type_name: str, handle: Callable[[Any], Any], qos: Qos = USUAL, late_s: float = math.inf
    ) -> Callable[[], None]:
        """Calls `handle` with each message that is not `late_s` late; returns a function that ends the subscription."""
        name, kind = self.absolute(topic), ros_types().message(type_name)
        self.declare(SUBSCRIPTION, name, kind.key, qos)
        token = self._declared[-1]

        quickest_s = dict[bytes, float]()

        def received(sample: zenoh.Sample) -> None:
            if late_s < math.inf and _delay_s(sample, quickest_s) > late_s:
                return
            if (message := self._decoded(kind, sample.payload)) is not None:
                self.guarded(lambda: handle(message), name)
                self.handled += 1

        key, session = self.key.data_key(name, kind.key), self.session.inner
        history = ext.HistoryConfig(detect_late_publishers=True, max_samples=qos.depth) if qos.transient_local else None
        subscriber = ext.declare_advanced_subscriber(session, key, received, history=history)
        self._declared.append(subscriber)

        def end() -> None:
            for each in (subscriber, token):
                self._declared.remove(each)
                each.undeclare()

        return end

    def serve(self, name: str, kind: ServiceType, handle: Callable[[Request], None]) -> None:
        """Calls `handle` with each request for a service; it may answer later."""
        name = self.absolute(name)
        key = self.key.data_key(name, kind.key)
        self.declare(SERVICE, name, kind.key, USUAL)

        def asked(query: zenoh.Query) -> None:
            try:
                head = Attachment.decoded(query.attachment.to_bytes() if query.attachment else b"")
                message = self._decoded(kind.request, query.payload)
            except ValueError:
                self.dropped, message = self.dropped + 1, None
            if message is None:
                with query:  # which ends the query without an answer
                    return
            self.guarded(lambda: handle(Request(message, query, key, head, kind.response)), name)

        self._declared.append(self.session.inner.declare_queryable(key, asked, complete=True))

    def answer(self, name: str, type_name: str, answer: Callable[[Any], Any]) -> None:
        """Serves a service by a function from a request to its response, or to a mapping of its fields."""
        self.serve(name, ros_types().service(type_name), lambda request: request.reply(answer(request.message)))

    def _decoded(self, kind: MessageType, payload: zenoh.ZBytes | None) -> Any:
        """Decodes a message; counts it and returns None if it is malformed."""
        try:
            if payload is None or len(payload) > MOST_BYTES:
                raise MalformedError("no message, or one that is too long")
            return kind.decode(payload.to_bytes())
        except MalformedError:
            self.dropped += 1
            return None

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


def _delay_s(sample: zenoh.Sample, quickest_s: dict[bytes, float]) -> float:
    """How much longer a message took than its sender's quickest, which grows by a millisecond with each message."""
    with suppress(ValueError):
        head = Attachment.decoded(sample.attachment.to_bytes() if sample.attachment else b"")
        took_s = 1e-9 * (time.time_ns() - head.stamp_ns)
        if len(quickest_s) > _MOST_SENDERS:
            quickest_s.clear()
        quickest_s[head.gid] = min(took_s, quickest_s.get(head.gid, took_s) + _DRIFT_S)
        return took_s - quickest_s[head.gid]
    return 0.0
