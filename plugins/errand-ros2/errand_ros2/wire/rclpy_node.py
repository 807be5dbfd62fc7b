"""Nodes of an installed ROS 2, by rclpy with whatever middleware it has. One thread calls all handlers of a session."""

from __future__ import annotations

import array
import logging
import math
import os
import threading
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import partial
from importlib import import_module
from queue import Empty, SimpleQueue
from typing import Any, Final

import numpy as np
import rclpy
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.context import Context
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future
from rclpy.utilities import get_rmw_implementation_identifier

from errand_ros2.packages import PACKAGES
from errand_ros2.wire.node import Client, Delays, Node, Place, Publisher, Request, Session, taken_by_others
from errand_ros2.wire.types import USUAL, Qos, ros_types
from skills.inputs.errors import InputError

_LOG: Final = logging.getLogger(__name__)
_DISCOVERY_S, _COMPARE_S = 1.0, 2.0  # after which publishers of other nodes are known; period of looking at them
_ALL_KNOWN_S, _LOOK_S = 4.0, 0.1  # the same after a session began on a busy machine; period of a claim's looks


def interface(name: str) -> Any:
    """Returns the class of a message, service or part of an action by its name. Raises ImportError."""
    package, kind, base = name.split("/")
    base, _, part = base.partition("_")
    try:
        found = getattr(import_module(f"{package}.{kind}"), base)
        return getattr(found.Impl, part if part == "FeedbackMessage" else f"{part}Service") if part else found
    except (ImportError, AttributeError) as error:
        raise ImportError(name=package) from error


def filled(kind: Any, given: Any) -> Any:
    """Returns a message of a class of rclpy from another or from fields, without those that only one of the two has."""
    made = kind()
    for name, described in kind.get_fields_and_field_types().items():
        value = given.get(name) if isinstance(given, Mapping) else getattr(given, name, None)
        if value is not None:
            setattr(made, name, _filled(getattr(made, name), described, value))
    return made


def _filled(usual: Any, described: str, value: Any) -> Any:
    """Value of a field, whose usual value and description tell its type."""
    if hasattr(usual, "get_fields_and_field_types"):
        return filled(type(usual), value)
    if isinstance(usual, np.ndarray):
        return np.asarray(value, usual.dtype)
    if isinstance(usual, array.array):
        return array.array(usual.typecode, np.asarray(value, f"{usual.typecode}").tobytes())
    if isinstance(usual, list):
        of = described.removeprefix("sequence<").partition("[")[0].partition(",")[0].removesuffix(">")
        package, slash, base = of.partition("/")
        return [filled(interface(f"{package}/msg/{base}"), each) for each in value] if slash else list(value)
    return type(usual)(value)


class RclpySession(Session):
    """Context of rclpy, with the thread that calls its handlers."""

    def __init__(self, place: Place) -> None:
        """Joins the place's domain. Raises InputError when rclpy has no middleware."""
        self.context, self.missing, self.opened_s = Context(), set[str](), time.monotonic()
        try:
            rclpy.init(context=self.context, domain_id=place.domain, signal_handler_options=SignalHandlerOptions.NO)
        except Exception as error:  # rclpy raises what its middleware raises
            what = f"rclpy does not start ({str(error).partition(chr(10))[0][:120]})"
            raise InputError(what, hint="source ROS 2 in this terminal, or write zenoh:") from error
        super().__init__(place, f"domain {place.domain}, rclpy with {get_rmw_implementation_identifier()}")
        self.executor = SingleThreadedExecutor(context=self.context)
        self.nodes: list[rclpy.node.Node] = []
        self._beside: RclpySession | None = None
        self._thread = threading.Thread(target=self._spin, name="errand-rclpy", daemon=True)
        self._thread.start()

    def node(self, name: str, namespace: str = "/") -> _RclpyNode:
        """Makes a node. Raises InputError for a namespace that ROS 2 does not allow."""
        node = _RclpyNode(self, name, namespace)
        node.inner.create_timer(_COMPARE_S, node.compare_all)
        return node

    def beside(self) -> RclpySession:
        """Returns a second session, since no participant of DDS has two types of one topic."""
        self._beside = self._beside or RclpySession(self.place)
        return self._beside

    def interface(self, name: str, what: str) -> Any:
        """Returns the class of a type; None, said once, where its package is not installed, which `what` needs."""
        try:
            return interface(name)
        except ImportError as error:
            if (package := str(error.name)) not in self.missing:
                how = f"`errand ros2 interfaces DIR --package {package}` writes it for colcon"
                how = how if package in PACKAGES else "pip install 'errand-ros2[rclpy]' brings it"
                if (distribution := os.environ.get("ROS_DISTRO")) and package != "errand_msgs":
                    how = f"apt install ros-{distribution}-{package.replace('_', '-')}"
                _LOG.warning("errand: %s is not installed; what needs it is left out, as %s: %s", package, what, how)
            self.missing.add(package)
            return None

    def close(self) -> None:
        """Ends the thread and the nodes."""
        if self._beside is not None:
            self._beside.close()
        self.executor.shutdown(timeout_sec=0.0)
        self.context.try_shutdown()
        self._thread.join()
        for node in self.nodes:
            node.destroy_node()

    def _spin(self) -> None:
        while self.context.ok():
            with suppress(ExternalShutdownException):
                try:
                    self.executor.spin()
                except Exception as error:  # of rclpy itself, as for a message that cannot be taken
                    _LOG.warning("errand: rclpy (%s: %s)", type(error).__name__, error)


class _RclpyClient(Client):
    """Client of a service."""

    def __init__(self, node: _RclpyNode, name: str, service: Any) -> None:
        self._request = service.Request
        self._client = node.inner.create_client(service, name, callback_group=node.group)

    def call(self, request: Any, *, limit_s: float) -> Any:
        answers, until_s = SimpleQueue[Any](), time.monotonic() + limit_s
        if self._client.wait_for_service(limit_s):
            self._ask(request, answers.put)
            with suppress(Empty):
                return answers.get(timeout=max(0.0, until_s - time.monotonic()))
        return None

    def ask(self, request: Any, take: Callable[[Any], None], *, limit_s: float) -> None:
        """Calls `take` with the service's response when it comes; waits until the service is there."""
        if self._client.wait_for_service(min(limit_s, _DISCOVERY_S)):
            self._ask(request, take)

    def _ask(self, request: Any, take: Callable[[Any], Any]) -> None:
        asked = self._client.call_async(filled(self._request, request))
        asked.add_done_callback(lambda future: None if future.result() is None else take(future.result()))


class _RclpyNode(Node):
    """Node of rclpy."""

    padding = 3  # DDS fills messages up to whole words of four bytes

    def __init__(self, session: RclpySession, name: str, namespace: str) -> None:
        super().__init__(namespace)
        self.session, self._name = session, name
        self.inner = rclpy.create_node(name, namespace=self.namespace, context=session.context, enable_rosout=False)
        self.group = ReentrantCallbackGroup()  # else a request that is answered later would hold up all others
        session.nodes.append(self.inner)
        session.executor.add_node(self.inner)

    def claim(self, *topics: str) -> None:
        until_s = max(self.session.opened_s + _ALL_KNOWN_S, time.monotonic() + _DISCOVERY_S)
        while (left_s := until_s - time.monotonic()) > 0.0:
            for name in map(self.absolute, topics):
                if self.inner.get_publishers_info_by_topic(name):
                    raise taken_by_others(name, self.session.place.domain)
            threading.Event().wait(min(left_s, _LOOK_S))

    def compare_all(self) -> None:
        """Compares the types in which the topics are published that are subscribed to."""
        for name in list(self.types):
            for info in self.inner.get_publishers_info_by_topic(name):
                self.compare(name, info.topic_type)

    def publisher(self, topic: str, type_name: str, qos: Qos = USUAL) -> Publisher:
        name = self.absolute(topic)
        if (kind := self.session.interface(type_name, name)) is None:
            return Publisher(self, lambda message: None, lambda: False)
        made = self.inner.create_publisher(kind, name, _profile(qos))
        heard = lambda: qos.transient_local or made.get_subscription_count() > 0  # noqa: E731
        return Publisher(self, lambda message: made.publish(filled(kind, message)), heard)

    def subscribe(
        self, topic: str, type_name: str, handle: Callable[[Any], Any], qos: Qos = USUAL, late_s: float = math.inf
    ) -> Callable[[], None]:
        name, delays = self.absolute(topic), Delays()
        self.types[name].append(type_name)
        if self.types[name][0] != type_name:
            other = _RclpyNode(self.session.beside(), self._name, self.namespace)
            return other.subscribe(name, type_name, handle, qos, late_s)
        if (kind := self.session.interface(type_name, name)) is None:
            return lambda: None
        message_type = ros_types().message(type_name)

        def received(data: bytes, info: Mapping[str, int]) -> None:
            if delays.of(b"", 1e-9 * (time.time_ns() - info["source_timestamp"])) <= late_s:
                self.take(message_type, data, handle, name)

        made = self.inner.create_subscription(kind, name, received, _profile(qos), callback_group=self.group, raw=True)
        end, executor = partial(self.inner.destroy_subscription, made), self.session.executor
        return lambda: executor.create_task(end) and None  # in its thread, which may be reading the subscription

    def serve(self, name: str, type_name: str, handle: Callable[[Request], None]) -> None:
        name, executor = self.absolute(name), self.session.executor
        if (service := self.session.interface(type_name, name)) is None:
            return

        async def asked(request: Any, _: Any) -> Any:
            answered = Future[Any](executor=executor)

            def reply(response: Any) -> None:
                answered.set_result(filled(service.Response, response))
                executor.wake()

            self.guarded(lambda: handle(Request(request, reply)), name)
            return await answered

        self.inner.create_service(service, name, asked, callback_group=self.group)

    def client(self, name: str, type_name: str) -> Client:
        name = self.absolute(name)
        service = self.session.interface(type_name, name)
        return Client() if service is None else _RclpyClient(self, name, service)


def _profile(qos: Qos) -> QoSProfile:
    return QoSProfile(
        depth=qos.depth,
        reliability=ReliabilityPolicy.RELIABLE if qos.reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if qos.transient_local else DurabilityPolicy.VOLATILE,
    )
