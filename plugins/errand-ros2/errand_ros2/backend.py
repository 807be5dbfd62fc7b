"""Backend of a robot of ROS 2: `errand run --robot ros2://NAMESPACE`."""

from __future__ import annotations

import logging
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from threading import Event
from typing import Final

from errand_ros2.adapter.clocks import RobotClock, SimulatedClock
from errand_ros2.adapter.description import load_description
from errand_ros2.adapter.robot import Ros2Robot
from errand_ros2.wire.node import Place
from errand_ros2.wire.session import open_session
from errand_ros2.wire.types import topic_name
from skills.inputs.errors import InputError
from skills.robot import ConnectedRobot, RobotStoppedError

_LOG: Final = logging.getLogger(__name__)
_NAME: Final = "errand_driver"
_PATIENCE_S, _TICK_S = 10.0, 0.05


@dataclass(frozen=True)
class Ros2:
    """A robot of ROS 2 below a namespace; implements `skills.stack.RobotBackend`.

    `file` is its description, by default that of a robot of `kind` that `errand serve-ros2` serves. `network` is the
    domain and the wire, as for `--ros2`.
    """

    file: Path | None = None
    kind: str = "spot"
    network: str = ""

    @contextmanager
    def connect(self, address: str, name: str) -> Iterator[ConnectedRobot]:
        """Subscribes to the robot's topics and waits for the first readings. Raises InputError."""
        space, place = topic_name(address.strip("/")), Place.parse(self.network)
        description = load_description(self.file, self.kind)
        with open_session(place) as session:
            clock = SimulatedClock() if description.file.sim_time else RobotClock()
            node = session.node(_NAME, space)
            if isinstance(clock, SimulatedClock):
                node.subscribe("/clock", "rosgraph_msgs/msg/Clock", clock.hear_clock)
            robot, ready, until_s = Ros2Robot(name, node, clock, description), Event(), time.monotonic() + _PATIENCE_S
            while (missing := robot.missing() if clock.is_heard else "/clock") and time.monotonic() < until_s:
                Event().wait(_TICK_S)
            if missing:
                what = f"ros2:/{space}: nothing is heard on {missing} ({session.told})"
                raise InputError(what, hint="is the robot on, in this domain, with this middleware?")
            _LOG.warning("ROS 2: %s, %s", space, session.told)

            def look() -> None:
                robot.poll()
                if ready.is_set() and (why := robot.stopped_because()):
                    raise RobotStoppedError(why)

            clock.after = look
            try:
                yield ConnectedRobot(robot, clock, ready.set, robot.notes(f"ros2:/{space}", session.told))
            finally:
                robot.return_lease(robot.take_lease(_NAME))
