"""Figures of the ROS 2 plug-in: `python plugins/errand-ros2/tests/ros2_benchmarks.py bridge|cancel|kill [COUNT]`.

bridge: a run in the flat with one subscription to scan, tf and a picture for COUNT seconds: rates, pace, latency, CPU.
cancel: COUNT goals of navigate_to_pose, each cancelled under way: time until the base stands.
kill: a process that sends cmd_vel is killed COUNT times: time until the base of the served robot stands.
"""

import json
import math
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
import uuid
from functools import partial
from pathlib import Path

import numpy as np

from errand_ros2.bridge import Bridge
from errand_ros2.server import RobotServer
from errand_ros2.wire.node import Client, Node, Place, open_session
from errand_ros2.wire.types import ActionType, Attachment, ros_types
from executive.app.prepare.from_request import prepare
from executive.app.prepare.placed_robots import only_robot
from executive.app.prepare.worlds import open_world
from executive.app.runs.one_run import run_request
from executive.app.runs.simulated import simulate
from executive.mission.request import Request
from executive.run.control import Control

HEARD = {"/alice/scan": "sensor_msgs/msg/LaserScan", "/tf": "tf2_msgs/msg/TFMessage"}
HEARD |= {"/alice/frontleft/image": "sensor_msgs/msg/Image", "/clock": "rosgraph_msgs/msg/Clock"}
ODOM, TWIST = "nav_msgs/msg/Odometry", "geometry_msgs/msg/Twist"
GOALS = ((6.0, 4.5, math.pi), (3.0, 4.5, 0.0))


def free_place():
    with socket.create_server(("127.0.0.1", 0)) as server:
        return Place(port=server.getsockname()[1])


class TimedBridge(Bridge):
    """A bridge that measures its own CPU time, in the run's thread."""

    cpu_s, run = 0.0, staticmethod(lambda work: work())

    def tick(self, progress):
        begun_s = time.thread_time()
        super().tick(progress)
        self.cpu_s += time.thread_time() - begun_s


def in_flat(client, pace=TimedBridge):
    """Runs a mission that waits in the flat, while `client(place, bridge)` runs in a thread; then cancels it."""
    with tempfile.TemporaryDirectory() as folder:
        mission = Path(folder) / "wait.yaml"
        mission.write_text("name: wait\nsteps:\n  - wait: {seconds: 3000}\n")
        prepared = prepare(Request(file=mission, world="flat", out=Path(folder) / "out", seed=1, record=False))
        place, control = free_place(), Control(pace=None)
        bridge = pace(prepared, control, place)

        def talk():
            try:
                client(place, bridge)
            finally:
                control.cancel("measured")

        threading.Thread(target=talk).start()
        bridge.run(lambda: run_request(prepared, visitors=[bridge], control=control))


def listen(port, limit_s):
    """Listens for a while, in a process of its own; prints counts, the way of the clock, and latencies as JSON."""
    delays, clock, counts = [], [], dict.fromkeys(HEARD, 0)
    with open_session(Place(port=port)) as session:
        node, kept = Node(session, "listener"), []

        def hear(topic, kind, sample):
            counts[topic] += 1
            delays.append(time.time_ns() - Attachment.decoded(sample.attachment.to_bytes()).stamp_ns)
            message = kind.decode(sample.payload.to_bytes())
            if topic == "/clock":
                clock.append((time.monotonic(), message.clock.sec + 1e-9 * message.clock.nanosec))

        for topic, name in HEARD.items():
            kind = ros_types().message(name)
            kept.append(
                session.inner.declare_subscriber(node.key.data_key(topic, kind.key), partial(hear, topic, kind))
            )
        time.sleep(limit_s)
    (wall0, sim0), (wall1, sim1) = clock[0], clock[-1]
    latency_ms = np.percentile(np.array(delays) * 1e-6, [50, 99, 100]).round(2).tolist()
    rates = {topic: round(count / limit_s, 2) for topic, count in counts.items()}
    sys.stdout.write(json.dumps({"pace": round((sim1 - sim0) / (wall1 - wall0), 4), "ms": latency_ms, "hz": rates}))


def bridge(limit_s):
    def client(place, bridge):
        while bridge._begun is None:
            time.sleep(0.1)
        time.sleep(3.0)
        before_s, begun_s = bridge.cpu_s, time.monotonic()
        told = subprocess.run([sys.executable, __file__, "listen", str(place.port), str(limit_s)], capture_output=True)
        took_s = time.monotonic() - begun_s
        share = (bridge.cpu_s - before_s) / took_s
        sys.stdout.write(f"{told.stdout.decode()} bridge's CPU {100 * share:.1f} % of a core, {took_s:.0f} s\n")

    in_flat(client)


class Watch:
    """The speed of the base as another program sees it."""

    def __init__(self, session):
        self.node, self.seen = Node(session, "watch"), []
        self.node.subscribe("/alice/odom", ODOM, self._hear)

    def _hear(self, message):
        twist = message.twist.twist
        stamp_s = message.header.stamp.sec + 1e-9 * message.header.stamp.nanosec
        speed = math.hypot(twist.linear.x, twist.linear.y)
        self.seen.append((time.monotonic(), stamp_s, speed, abs(twist.angular.z)))

    def wait_for(self, speed, limit_s=30.0):
        until_s = time.monotonic() + limit_s
        while time.monotonic() < until_s and not (self.seen and self.seen[-1][2] > speed):
            time.sleep(0.005)

    def still_after(self, wall_s, stamp_s):
        """Times (wall, robot's clock) from an instant until the last reading in which the base moved.

        Odometry tells the speed of a base that stands with a deviation of 0.02 m/s: 0.1 m/s is beyond its noise.
        """
        moving = [each for each in self.seen if each[0] > wall_s and (each[2] > 0.1 or each[3] > 0.1)]
        return (moving[-1][0] - wall_s, moving[-1][1] - stamp_s) if moving else (0.0, 0.0)


def tell(rows, limit_s):
    for name, column in zip(("wall", "robot's clock"), zip(*rows, strict=True), strict=True):
        within = sum(each <= limit_s + 1e-6 for each in column)
        middle, most = np.median(column), max(column)
        sys.stdout.write(
            f"{name}: median {middle:.3f} s, most {most:.3f} s, {within} of {len(column)} <= {limit_s} s\n"
        )


def cancel(count):
    types, action = ros_types(), ActionType(ros_types(), "nav2_msgs/action/NavigateToPose")

    def client(place, bridge):
        with open_session(place) as session:
            watch, base, rows, reached = Watch(session), "/alice/navigate_to_pose/_action", [], 0
            names = {"send_goal": action.send_goal, "get_result": action.get_result, "cancel_goal": action.cancel_goal}
            send, result, stop = (Client(watch.node, f"{base}/{name}", kind) for name, kind in names.items())
            watch.wait_for(-1.0, 120.0)
            for number in range(2 * count):
                x, y, yaw = GOALS[number // 2 % 2]
                goal = types.make("nav2_msgs/action/NavigateToPose_Goal")
                goal.pose.header.frame_id, at = "map", goal.pose.pose
                at.position.x, at.position.y = x, y
                at.orientation.w, at.orientation.z = math.cos(yaw / 2), math.sin(yaw / 2)
                identity = {"uuid": np.frombuffer(uuid.uuid4().bytes, np.uint8)}
                assert send.call({"goal_id": identity, "goal": goal}, limit_s=20.0).accepted
                if number % 2 == 0:
                    watch.wait_for(0.25)
                    time.sleep(0.5)
                    now = time.monotonic(), watch.seen[-1][1]
                    stop.call({"goal_info": {"goal_id": identity}}, limit_s=5.0)
                    time.sleep(1.0)
                    rows.append(watch.still_after(*now))
                else:
                    ended = result.call({"goal_id": identity}, limit_s=120.0)
                    reached += ended is not None and ended.status == 4
            sys.stdout.write(f"{reached} of {count} goals reached\n")
            tell(rows, 0.2)

    in_flat(client)


SENDER = """
import sys, time
from errand_ros2.wire.node import Node
from errand_ros2.wire.node import Place, open_session
from errand_ros2.wire.types import ActionType, ros_types

with open_session(Place(port=int(sys.argv[1]))) as session:
    kind = "geometry_msgs/msg/Twist"
    publisher, twist = Node(session, "sender").publisher("/alice/cmd_vel", kind), ros_types().make(kind)
    twist.linear.x, twist.angular.z = 0.4 * int(sys.argv[2]), 0.5
    while True:
        publisher.put(twist)
        time.sleep(0.02)
"""
"""Program that sends velocities until it is killed."""


def kill(count):
    world, place, ended, rows = open_world("flat"), free_place(), threading.Event(), []
    simulation = simulate(world, {"Alice": only_robot("Alice", world, seed=1)}, seed=1, record=False)

    def client():
        with open_session(place) as session:
            watch = Watch(session)
            for number in range(count):
                words = [sys.executable, "-c", SENDER, str(place.port), str((-1) ** number)]
                sender = subprocess.Popen(words)
                watch.wait_for(0.3)
                time.sleep(0.3)
                now = time.monotonic(), watch.seen[-1][1]
                sender.send_signal(signal.SIGKILL)
                sender.wait()
                time.sleep(1.2)
                rows.append(watch.still_after(*now))
        ended.set()

    with open_session(place) as session:
        server = RobotServer(session, simulation.robots["Alice"], simulation.clock)
        threading.Thread(target=client).start()
        server.run(ended)
    tell(rows, 0.6)


if __name__ == "__main__":
    what, *numbers = sys.argv[1:]
    {"bridge": bridge, "cancel": cancel, "kill": kill, "listen": listen}[what](*map(int, numbers or [60]))
