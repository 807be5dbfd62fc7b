"""An independent client of ROS 2 over Zenoh (zenoh-ros2-sdk), which takes message files from a folder."""

import socket
from contextlib import contextmanager

import pytest

pytest.importorskip("zenoh_ros2_sdk", reason="not installed: pip install zenoh-ros2-sdk")

from rosbags.typesys import Stores, get_typestore
from zenoh_ros2_sdk import message_registry
from zenoh_ros2_sdk.message_registry import MessageRegistry
from zenoh_ros2_sdk.session import ZenohSession

EMPTY = "uint8 structure_needs_at_least_one_member"
"""The definition of an empty request, which the client does not take as an empty text."""


def free_port():
    """A port that nobody uses."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        return server.getsockname()[1]


def write_messages(folder):
    """Writes the message files of a distribution, so that the client fetches none."""
    store = get_typestore(Stores.ROS2_JAZZY)
    for name in store.types:
        text, _ = store.generate_msgdef(name, ros_version=2)
        package, kind, short = name.split("/")
        (file := folder / package / kind / f"{short}.msg").parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text.partition("=" * 80)[0])


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
