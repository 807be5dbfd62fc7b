"""Opens sessions over the wire that a place names."""

from __future__ import annotations

from contextlib import AbstractContextManager

from errand_ros2.wire.node import Place, Session


def open_session(place: Place) -> AbstractContextManager[Session]:
    """Opens a session. Raises InputError."""
    if place.by_rclpy:
        from errand_ros2.wire.rclpy_node import open_rclpy

        return open_rclpy(place)
    from errand_ros2.wire.zenoh_node import open_zenoh

    return open_zenoh(place)
