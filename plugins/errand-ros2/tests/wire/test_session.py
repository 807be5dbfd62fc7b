"""The wire that a place names."""

import sys

import pytest

from errand_ros2.wire.node import Place
from errand_ros2.wire.session import open_session
from skills.inputs.errors import InputError


def test_an_rclpy_for_another_python_is_an_error_that_says_what_to_do(monkeypatch):
    monkeypatch.setitem(sys.modules, "errand_ros2.wire.rclpy_node", None)
    with pytest.raises(InputError, match="this Python cannot load rclpy") as raised:
        open_session(Place(by_rclpy=True))
    assert raised.value.hint == "run Errand with the Python of that ROS 2, or write zenoh:"
