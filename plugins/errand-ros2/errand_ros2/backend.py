"""Backend of a robot of ROS 2: `errand run --robot ros2://NAMESPACE`."""

from __future__ import annotations

import re
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from threading import Event
from typing import Final

from errand_ros2.adapter.description import load_description
from errand_ros2.adapter.robot import Ros2Robot
from errand_ros2.wire.node import Node
from errand_ros2.wire.session import Place, open_session
from skills.inputs.errors import InputError
from skills.robot import ConnectedRobot, RobotStoppedError

_NAME: Final = "errand_driver"
_NAMESPACE: Final = re.compile(r"[A-Za-z_][A-Za-z0-9_]*(/[A-Za-z_][A-Za-z0-9_]*)*")
_PATIENCE_S: Final = 10.0
_TICK_S: Final = 0.05


class WallClock:
    """Clock of a robot: wall time since the connection; `advance` waits, and `after` is called after each wait."""

    def __init__(self) -> None:
        self._began_s, self._due_s = time.monotonic(), 0.0
        self.after: list[Callable[[], None]] = []

    def now(self) -> float:
        """Seconds since the connection was made."""
        return time.monotonic() - self._began_s

    def advance(self, dt_s: float) -> None:
        """Waits until dt_s have passed since the last advance; a late program goes on at once."""
        self._due_s = max(self._due_s + dt_s, self.now() - dt_s)
        Event().wait(max(0.0, self._due_s - self.now()))
        for each in self.after:
            each()


@dataclass(frozen=True)
class Ros2:
    """A robot of ROS 2 below a namespace; implements `skills.stack.RobotBackend`.

    `file` is its description, by default that of a robot of `kind` that `errand serve-ros2` serves. `network` is the
    domain and the router, as for `--ros2`: `[DOMAIN][@HOST[:PORT]]`.
    """

    file: Path | None = None
    kind: str = "spot"
    network: str = ""

    @contextmanager
    def connect(self, address: str, name: str) -> Iterator[ConnectedRobot]:
        """Subscribes to the robot's topics and waits for the first readings. Raises InputError."""
        space = address.strip("/")
        if not _NAMESPACE.fullmatch(space):
            raise InputError(f"ros2://{address[:60]}: is no namespace of ROS 2", hint="write ros2://alice")
        place, description = Place.parse(self.network), load_description(self.file, self.kind)
        with open_session(place) as session:
            clock = WallClock()
            robot, watch = Ros2Robot(name, Node(session, _NAME, f"/{space}"), clock, description), Event()
            until_s = clock.now() + _PATIENCE_S
            while (missing := robot.sensors.missing()) and clock.now() < until_s:
                clock.advance(_TICK_S)
            if missing:
                hint = "is the robot on, with RMW_IMPLEMENTATION=rmw_zenoh_cpp, in this domain and at this router?"
                raise InputError(f"ros2://{space}: nothing is heard on {missing}", hint=hint)

            def look() -> None:
                robot.poll()
                if watch.is_set() and (why := robot.stopped_because()):
                    raise RobotStoppedError(why)

            clock.after.append(look)
            try:
                yield ConnectedRobot(robot, clock, watch.set, robot.notes(f"ros2://{space}", session.place.endpoint))
            finally:
                robot.return_lease(robot.take_lease(_NAME))
