"""A program of ROS 2 that talks to Errand by rclpy alone, and Errand in a process of its own."""

import re
import signal
import subprocess
import sys
import threading
import time
from contextlib import closing, contextmanager, suppress
from importlib import import_module

import pytest

pytest.importorskip("rclpy", reason="not installed: make ros")
pytest.importorskip("nav2_msgs", reason="not built: make ros")

import rclpy
from rclpy.action import ActionClient
from rclpy.context import Context
from rclpy.executors import MultiThreadedExecutor
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from ros_client import soon

KEPT = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL, reliability=ReliabilityPolicy.RELIABLE)
LOSSY = QoSProfile(depth=5, reliability=ReliabilityPolicy.BEST_EFFORT)
LATCHED = {"/map", "/tf_static", "/alice/robot_description", "/alice/tree/snapshots"}
LATCHED |= {f"/alice/{name}" for name in ("task_channel", "object_to_detect", "object_destination")}
SENSORS = re.compile(r"/alice/(imu|scan|points|.*/image|.*/camera_info|.*/image/compressed|.*/compressedDepth)")
PATIENCE_S = 20.0


def profile(topic):
    """The quality of service that the manual's topic has."""
    return KEPT if topic in LATCHED else LOSSY if SENSORS.fullmatch(topic) else QoSProfile(depth=10)


def interface(name):
    package, kind, base = name.split("/")
    return getattr(import_module(f"{package}.{kind}"), base)


class RclpyClient:
    """A node of rclpy whose handlers run in threads."""

    def __init__(self, domain):
        self.context = Context()
        rclpy.init(context=self.context, domain_id=domain)
        self.node = rclpy.create_node("client", context=self.context, enable_rosout=False)
        self.executor, self.heard = MultiThreadedExecutor(4, context=self.context), {}
        self.executor.add_node(self.node)
        self._thread = threading.Thread(target=self._spin, daemon=True)
        self._thread.start()

    def _spin(self):
        while self.context.ok():
            with suppress(Exception):  # when it is closed
                self.executor.spin_once(0.1)

    def hear(self, topic, kind, handle=None):
        heard = self.heard[topic] = []
        self.node.create_subscription(interface(kind), topic, handle or heard.append, profile(topic))
        return heard

    def result_of(self, future, limit_s=PATIENCE_S):
        assert soon(future.done, limit_s), "no answer"
        return future.result()

    def call(self, name, kind, limit_s=PATIENCE_S, **request):
        service = interface(kind)
        client = self.node.create_client(service, name)
        assert client.wait_for_service(limit_s), name
        return self.result_of(client.call_async(service.Request(**request)), limit_s)

    def action(self, name, kind):
        client = ActionClient(self.node, interface(kind), name)
        assert client.wait_for_server(PATIENCE_S), name
        return client

    def send(self, client, goal, feedback=None):
        return self.result_of(client.send_goal_async(goal, feedback_callback=feedback))

    def close(self):
        self.executor.shutdown(1.0)
        self.context.try_shutdown()
        self._thread.join()


@contextmanager
def errand(*words, ready, limit_s=120.0):
    """Runs Errand in a process of its own, from the line on which it is `ready` until Ctrl-C; yields what it says."""
    process = subprocess.Popen(
        [sys.executable, "-m", "executive.cli", *map(str, words)],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    said = []
    reader = threading.Thread(target=lambda: said.extend(process.stdout), daemon=True)
    reader.start()
    try:
        assert soon(lambda: any(ready in line for line in said) or process.poll() is not None, limit_s), said
        assert process.poll() is None, said
        yield said
    finally:
        process.send_signal(signal.SIGINT)
        try:
            process.wait(20.0)
        except subprocess.TimeoutExpired:
            process.kill()
        reader.join(5.0)


@contextmanager
def client_of(domain):
    with closing(RclpyClient(domain)) as client:
        yield client


def stamped(x, y, frame="map"):
    made = interface("geometry_msgs/msg/PoseStamped")()
    made.header.frame_id = frame
    made.pose.position.x, made.pose.position.y, made.pose.orientation.w = x, y, 1.0
    return made


def publish_for(publisher, make, span_s, period_s=0.04):
    """Publishes messages at a rate for a while."""
    until_s = time.monotonic() + span_s
    while time.monotonic() < until_s:
        publisher.publish(make())
        time.sleep(period_s)
