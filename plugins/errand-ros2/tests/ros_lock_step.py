"""A served robot whose clock a client steps, in a thread of its own, and an adapter's robot in lock-step with it."""

import gc
import threading
from contextlib import ExitStack, contextmanager
from copy import deepcopy

from ros_client import soon

from errand_ros2.adapter.clocks import RobotClock
from errand_ros2.adapter.description import described, served_file
from errand_ros2.adapter.robot import Ros2Robot
from errand_ros2.server import PERIOD_S, RobotServer
from errand_ros2.wire.node import Publisher
from errand_ros2.wire.session import open_session
from errand_ros2.wire.zenoh_node import ZenohClient
from plant.robots.spot.kind import spot_capabilities
from skills.testing.blocks import Block
from skills.testing.clock import VirtualClock
from skills.testing.robot import ScriptedRobot

IDLE_S, CONNECTING_S, PATIENCE_S = 0.005, 0.2, 20.0
"""Pauses of the server; longest wait for a message until both sides have found each other, and afterwards."""


STATE = (
    *("pose", "odometry_pose", "velocity", "height_m", "pitch_rad", "q_rad", "opening", "in_gripper_rad"),
    *("clamp_force_n", "held", "carries", "charge"),
)


def state_of(robot):
    """Returns the state of a scripted robot, to `restore` it for another test."""
    return {name: deepcopy(getattr(robot, name)) for name in STATE}


def restore(robot, state):
    for name, value in deepcopy(state).items():
        setattr(robot, name, value)


def scripted(**options):
    """Builds a scripted Spot two metres before a wall."""
    clock = VirtualClock()
    given = {"capabilities": spot_capabilities(), "blocks": [Block(3.0, -1.5, 3.2, 1.5)], **options}
    return ScriptedRobot(clock, **given), clock


class LockStep(RobotClock):
    """Server, clock and robot. `build` makes robot and clock in the server's thread, to which a renderer belongs."""

    def __init__(self, build, place, *, kind="spot", name="Alice", file=None):
        self._build, self._place, self._ending = build, place, ExitStack()
        self._ready, self._stopping, self._failure = threading.Event(), threading.Event(), None
        super().__init__()
        self._now_s, self._is_cut, self._patience_s = 0.0, False, CONNECTING_S
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self._thread.start()
        self._ready.wait()
        if self._failure is not None:
            raise self._failure
        session = self._ending.enter_context(open_session(place))
        self.node = session.node("driver", f"/{name.lower()}")
        self.robot = Ros2Robot(name, self.node, self, described(file or served_file(kind)))
        topics = self.server.topics
        assert soon(lambda: self.robot._velocity.is_heard and topics._odom.is_heard and topics._joints.is_heard)
        assert self.until(lambda: not self.robot.missing()), self.robot.missing()
        self._patience_s = PATIENCE_S

    def _serve(self):
        try:
            robot, clock = self._build()
        except Exception as error:
            self._failure = error
            self._ready.set()
            return
        with open_session(self._place) as session:
            self.server = RobotServer(session, robot, clock, life=self.now)
            self.server.topics.image_period_s = 0.0
            self.served, self.clock = robot, clock
            self._now_s, self._begun = clock.now(), state_of(robot) if isinstance(robot, ScriptedRobot) else None
            self._ready.set()
            while not self._stopping.is_set():
                self.server.work.work_for(IDLE_S)
                self.server.topics.publish_pictures(clock.now())
        renders = not isinstance(robot, ScriptedRobot)
        del robot, clock, self.served, self.clock, self._build, self.server
        if renders:
            gc.collect()  # a renderer ends in the thread in which it began

    def now(self):
        return self._now_s

    def advance(self, dt_s):
        """Steps the server once what was sent has arrived; then waits until what it published has."""
        server, robot = self.server, self.robot
        self._soon(lambda: server.node.handled >= self.node.sent)
        for _ in range(max(1, round(dt_s / PERIOD_S))):
            self._now_s = round(self._now_s + PERIOD_S, 9)
            server.work.submit(server.step).result()
            self._soon(self._has_arrived)
        robot.poll()

    def _has_arrived(self):
        """Whether the robot has heard all that the server published."""
        topics, seen = self.server.topics, self.robot
        at_s = topics.stamps_s
        heard = [(at_s["odom"], seen.odometry()), (at_s["odom"], seen.joints())]
        heard += [(at_s["scan"], seen.scan())] if "scan" in at_s else []
        all_heard = all(each is not None and each.stamp_s >= at_s - 1e-6 for at_s, each in heard)
        return all_heard and self.server.parts.ended <= sum(each.ended for each in self.robot.actions.values())

    def _soon(self, true):
        soon(lambda: self._is_cut or true(), self._patience_s)

    @contextmanager
    def cut(self):
        """Loses every message of both sides while the block lasts; the clocks go on."""
        ways = (Publisher, "put"), (ZenohClient, "call"), (ZenohClient, "ask")
        kept = {way: getattr(*way) for way in ways}
        for kind, name in ways:
            setattr(kind, name, lambda *_, **__: None)
        self._is_cut = True
        try:
            yield
        finally:
            self._is_cut = False
            self.server.topics.stamps_s.pop("scan", None)  # the last scan was lost, and is published again
            for (kind, name), method in kept.items():
                setattr(kind, name, method)

    def until(self, true, most_s=10.0, *, every_s=0.05):
        """Advances until a condition holds; returns whether it did in time."""
        until_s = self.now() + most_s
        while not true() and self.now() < until_s:
            self.advance(every_s)
        return true()

    def ends(self, command):
        """Advances until a command has ended; returns its status."""
        assert self.until(lambda: self.robot.command_status(command).state.value != "running", 60.0)
        return self.robot.command_status(command)

    def begin_anew(self):
        """Takes the lease, stops the scripted robot, and puts it where it began."""
        self.lease = self.robot.take_lease("test")
        self.server.work.submit(lambda: self.served.stop(lease=self.server._lease)).result()
        assert self.until(lambda: not self.served.moving_parts)
        self.server.work.submit(restore, self.served, self._begun).result()
        self.advance(0.2)

    def close(self):
        self._ending.close()
        self._stopping.set()
        self._thread.join()
