"""Nodes of ROS 2 in sessions of Zenoh, by the protocol of rmw_zenoh. Zenoh calls handlers in threads of its own."""

from __future__ import annotations

import json
import math
import socket
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from itertools import count
from typing import Any, Final

import zenoh
from zenoh import ext

from errand_ros2.wire import types
from errand_ros2.wire.node import Client, Delays, Node, Place, Publisher, Request, Session, taken_by_others
from errand_ros2.wire.types import USUAL, Attachment, NodeKey, Qos, ServiceType, ros_types
from skills.inputs.errors import InputError

_CDR: Final = "application/cdr"
_CLAIM_S, _SETTLED_S = 2.0, 1.0  # wait for publishers, and until a topic's subscriptions of all types are made


class ZenohSession(Session):
    """Open session; nodes and their publishers, subscriptions and services get their numbers here."""

    def __init__(self, inner: zenoh.Session, place: Place, is_router: bool) -> None:
        router = "the router is here" if is_router else "by its router"
        super().__init__(place, f"domain {place.domain}, Zenoh at tcp/{place.host}:{place.port} ({router})")
        self.inner, self.is_router = inner, is_router
        self.numbers, self.liveliness = count(), inner.liveliness()

    def node(self, name: str, namespace: str = "/") -> ZenohNode:
        """Declares a node, with its one parameter. Raises InputError for a namespace that ROS 2 does not allow."""
        node = ZenohNode(self, name, namespace)
        known = {"use_sim_time": {"type": 1, "bool_value": False}}
        get, every = (f"rcl_interfaces/srv/{each}Parameters" for each in ("Get", "List"))
        node.answer(f"{name}/get_parameters", get, lambda asked: {"values": [known.get(each) for each in asked.names]})
        node.answer(f"{name}/list_parameters", every, lambda _: {"result": {"names": [*known]}})
        return node


@contextmanager
def open_zenoh(place: Place) -> Iterator[ZenohSession]:
    """Opens a session, which becomes the router if none answers on this machine. Raises InputError.

    A session that is a client waits for its router again when the router restarts.
    """
    client, endpoints = False, {"endpoints": [f"tcp/{place.host}:{place.port}"]}
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
        yield ZenohSession(inner, place, is_router=not client)


class ZenohClient(Client):
    """Client of a service."""

    def __init__(self, node: ZenohNode, name: str, kind: ServiceType) -> None:
        self._node, self._kind, self._key = node, kind, node.key.data_key(name, kind.key)
        self._gid, self._numbers = node.declare(types.CLIENT, name, kind.key, USUAL), count(1)
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
        return None if reply.ok is None else self._node.decoded(self._kind.response, reply.ok.payload.to_bytes())


class ZenohNode(Node):
    """Node in the graph of ROS 2, which liveliness tokens declare."""

    def __init__(self, session: ZenohSession, name: str, namespace: str) -> None:
        super().__init__(namespace)
        self.session = session
        zid, number = str(session.inner.zid()), next(session.numbers)
        self.key = NodeKey(session.place.domain, zid, number, self.namespace, name)
        self._declared: list[Any] = [session.liveliness.declare_token(self.key.token())]

    def claim(self, *topics: str) -> None:
        """Raises InputError when another node publishes one of the topics, which only one may publish."""
        domain, liveliness = self.key.domain, self.session.liveliness
        for name in map(self.absolute, topics):
            key = f"{types.ADMIN}/{domain}/*/*/*/{types.PUBLISHER}/*/*/*/{name.replace('/', '%')}/**"
            if any(reply.ok is not None for reply in liveliness.get(key, timeout=_CLAIM_S)):
                raise taken_by_others(name, domain)

    def declare(self, kind: str, name: str, type_key: str, qos: Qos) -> bytes:
        """Declares an entity of the node; returns its identity."""
        token = self.key.token(name, type_key, qos.text(), kind=kind, number=next(self.session.numbers))
        self._declared.append(self.session.liveliness.declare_token(token))
        return types.gid_of(token)

    def publisher(self, topic: str, type_name: str, qos: Qos = USUAL) -> Publisher:
        """Returns a publisher of a topic, with a cache for late subscribers if its quality of service says so."""
        name, kind, numbers, inner = self.absolute(topic), ros_types().message(type_name), count(1), self.session.inner
        gid = self.declare(types.PUBLISHER, name, kind.key, qos)
        priority = zenoh.Priority.DATA if qos.reliable else zenoh.Priority.DATA_LOW  # pictures wait apart, and get lost
        how: dict[str, Any] = {"encoding": _CDR, "reliability": zenoh.Reliability.RELIABLE, "priority": priority}
        if qos.transient_local:
            cached: dict[str, Any] = {"cache": ext.CacheConfig(max_samples=qos.depth), "publisher_detection": True}
            made: Any = ext.declare_advanced_publisher(inner, self.key.data_key(name, kind.key), **how, **cached)
        else:
            made = inner.declare_publisher(self.key.data_key(name, kind.key), **how)
        self._declared.append(made)  # Zenoh ends what nobody refers to

        def send(message: Any) -> None:
            made.put(kind.encode(message), attachment=Attachment(next(numbers), time.time_ns(), gid).encoded())

        return Publisher(self, send, lambda: qos.transient_local or bool(made.matching_status.matching))

    def subscribe(
        self, topic: str, type_name: str, handle: Callable[[Any], Any], qos: Qos = USUAL, late_s: float = math.inf
    ) -> Callable[[], None]:
        """Calls `handle` with each message that is not `late_s` late; returns a function that ends the subscription."""
        name, kind = self.absolute(topic), ros_types().message(type_name)
        self.declare(types.SUBSCRIPTION, name, kind.key, qos)
        token, delays = self._declared[-1], Delays()
        if name not in self.types:
            self._watch(name)
        self.types[name] += [type_name, kind.key]

        def received(sample: zenoh.Sample) -> None:
            with suppress(ValueError):  # one that does not tell when it was sent is not late
                head = Attachment.decoded(sample.attachment.to_bytes() if sample.attachment else b"")
                if delays.of(head.gid, 1e-9 * (time.time_ns() - head.stamp_ns)) > late_s:
                    return
            self.take(kind, sample.payload.to_bytes(), handle, name)

        key, session = self.key.data_key(name, kind.key), self.session.inner
        history = ext.HistoryConfig(detect_late_publishers=True, max_samples=qos.depth) if qos.transient_local else None
        subscriber = ext.declare_advanced_subscriber(session, key, received, history=history)
        self._declared.append(subscriber)

        def end() -> None:
            for each in (subscriber, token):
                self._declared.remove(each)
                each.undeclare()

        return end

    def _watch(self, name: str) -> None:
        """Compares the types in which a topic is published."""

        lock = threading.Lock()  # since each timer is a thread

        def compare(key: str) -> None:
            with lock:
                if key not in (known := self.types[name]):
                    self.compare(name, key if (theirs := types.ros_name(key)) in known else theirs)
                    known.append(key)

        def found(token: zenoh.Sample) -> None:
            timer = threading.Timer(_SETTLED_S, compare, ("/".join(str(token.key_expr).split("/")[-3:-1]),))
            timer.daemon = True
            timer.start()

        key = f"{types.ADMIN}/{self.key.domain}/*/*/*/{types.PUBLISHER}/*/*/*/{name.replace('/', '%')}/**"
        self._declared.append(self.session.liveliness.declare_subscriber(key, found, history=True))

    def serve(self, name: str, type_name: str, handle: Callable[[Request], None]) -> None:
        """Calls `handle` with each request for a service, in any of its forms; it may answer later."""
        for kind in types.service_forms(type_name):
            self._serve(self.absolute(name), kind, handle)

    def _serve(self, name: str, kind: ServiceType, handle: Callable[[Request], None]) -> None:
        key = self.key.data_key(name, kind.key)
        self.declare(types.SERVICE, name, kind.key, USUAL)

        def asked(query: zenoh.Query) -> None:
            try:
                head = Attachment.decoded(query.attachment.to_bytes() if query.attachment else b"")
                message = self.decoded(kind.request, query.payload.to_bytes() if query.payload else b"")
            except ValueError:
                self.dropped, message = self.dropped + 1, None
            if message is None:
                with query:  # which ends the query without an answer
                    return

            def reply(response: Any) -> None:
                with query:
                    attachment = Attachment(head.number, time.time_ns(), head.gid).encoded()
                    query.reply(key, kind.response.encode(response), encoding=_CDR, attachment=attachment)

            self.guarded(lambda: handle(Request(message, reply)), name)

        self._declared.append(self.session.inner.declare_queryable(key, asked, complete=True))

    def client(self, name: str, type_name: str) -> ZenohClient:
        """Returns a client of a service."""
        return ZenohClient(self, self.absolute(name), ros_types().service(type_name))
