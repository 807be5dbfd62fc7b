"""Opens sessions over the wire that a place names."""

from __future__ import annotations

from contextlib import AbstractContextManager, closing

from errand_ros2.wire.node import Place, Session
from skills.inputs.errors import InputError


def open_session(place: Place) -> AbstractContextManager[Session]:
    """Opens a session. Raises InputError."""
    if not place.by_rclpy:
        from errand_ros2.wire.zenoh_node import open_zenoh

        return open_zenoh(place)
    try:
        from errand_ros2.wire.rclpy_node import RclpySession
    except ImportError as error:  # such as that of a ROS 2 for another Python
        what = f"this Python cannot load rclpy ({str(error).partition(chr(10))[0][:120]})"
        raise InputError(what, hint="run Errand with the Python of that ROS 2, or write zenoh:") from error
    return closing(RclpySession(place))
