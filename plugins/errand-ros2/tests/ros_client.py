"""An independent client of ROS 2 over Zenoh (zenoh-ros2-sdk), which takes message files from a folder."""

import socket
import time
from contextlib import contextmanager

import pytest

pytest.importorskip("zenoh_ros2_sdk", reason="not installed: pip install zenoh-ros2-sdk")

from rosbags.typesys import Stores, get_typestore
from zenoh_ros2_sdk import message_registry
from zenoh_ros2_sdk.message_registry import MessageRegistry
from zenoh_ros2_sdk.session import ZenohSession

from errand_ros2.wire.types import INTERFACES

EMPTY = "uint8 structure_needs_at_least_one_member"
"""The definition of an empty request, which the client does not take as an empty text."""


def free_port():
    """A port that nobody uses."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        return server.getsockname()[1]


def soon(condition, limit_s=20.0):
    """Waits for what needs no robot's time, such as a message on its way; returns whether the condition holds."""
    until_s = time.monotonic() + limit_s
    while not condition() and time.monotonic() < until_s:
        time.sleep(0.0005)
    return condition()


def write_messages(folder):
    """Writes the message files of a distribution, and those that the plug-in ships, so that the client fetches none."""
    store = get_typestore(Stores.ROS2_JAZZY)
    for name in store.types:
        text, _ = store.generate_msgdef(name, ros_version=2)
        _write(folder / f"{name}.msg", text.partition("=" * 80)[0])
    for file in INTERFACES.glob("*/*/*.*"):
        package, kind, parts = file.parts[-3], file.parts[-2], file.read_text().split("---\n")
        if kind == "action":
            _write_action(folder / package, package, file.stem, *parts)
        elif kind == "srv":
            _write_service(folder / package, file.stem, *parts)
        else:
            _write(folder / package / kind / file.name, *parts)


def _write(file, text):
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(text)


def _write_service(folder, name, request, response):
    """Writes a service, and its two messages, for which the client looks first."""
    for end, text in (("_Request.msg", request), ("_Response.msg", response), (".srv", f"{request}\n---\n{response}")):
        _write(folder / "srv" / f"{name}{end}", text)


def _write_action(folder, package, name, goal, result, feedback):
    """Writes an action as the services and messages of which it consists; the client knows no actions."""
    own, identity = f"{package}/action/{name}", "unique_identifier_msgs/UUID goal_id"
    message = f"{identity}\n{own}_Feedback feedback\n"
    for part, text in zip(
        ("Goal", "Result", "Feedback", "FeedbackMessage"), (goal, result, feedback, message), strict=True
    ):
        _write(folder / "action" / f"{name}_{part}.msg", text)
    accepted, ended = "bool accepted\nbuiltin_interfaces/Time stamp", f"int8 status\n{own}_Result result"
    _write_service(folder, f"{name}_SendGoal", f"{identity}\n{own}_Goal goal", accepted)
    _write_service(folder, f"{name}_GetResult", identity, ended)


@contextmanager
def connected(port, folder):
    """Connects the client to a router; its one session of this process is open meanwhile."""
    before = message_registry._registry
    message_registry._registry = MessageRegistry(str(folder))
    session = ZenohSession.get_instance("127.0.0.1", port)
    try:
        yield session
    finally:
        session.close()
        message_registry._registry = before
