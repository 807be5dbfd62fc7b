"""A scripted robot served in ROS 2: every topic decoded by others, driving, the watchdog, and hostile input."""

import threading
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("zenoh", reason="not installed: pip install eclipse-zenoh")

from mcap_ros2._dynamic import generate_dynamic
from ros_client import connected, free_port, soon
from ros_run import STORED, TOPICS
from rosbags.typesys import Stores, get_typestore
from slow_link import SlowLink
from zenoh import ext
from zenoh_ros2_sdk import ROS2Subscriber

from errand_ros2 import messages
from errand_ros2.part_actions import TRAJECTORY
from errand_ros2.server import RobotServer
from errand_ros2.wire import actions
from errand_ros2.wire.node import Place
from errand_ros2.wire.session import open_session
from errand_ros2.wire.types import LATCHED, ros_types
from plant.robots.spot.kind import spot_capabilities
from skills.grid_map import GridMap
from skills.testing.blocks import ROOM
from skills.testing.clock import VirtualClock
from skills.testing.robot import ScriptedRobot

TWIST = "geometry_msgs/msg/Twist"
IMAGE = "sensor_msgs/msg/Image"


class Served:
    """A server of the scripted robot, and a node of another session, which steps it."""

    def __init__(self, session, other, place):
        self.clock, self.place, self.node = VirtualClock(), place, other.node("other")
        self.robot = ScriptedRobot(self.clock, capabilities=spot_capabilities(), blocks=ROOM)
        self.session = session

    def serve(self, **life):
        grid, truth = GridMap(np.zeros((30, 30), bool), 0.1, (-1.0, -1.0)), lambda: self.robot.pose.transform()
        self.server = RobotServer(self.session, self.robot, self.clock, grid=grid, truth=truth, **life)
        return closing(self.server)

    def step(self):
        self.server.work.work_for(0.0)
        self.server.step()

    def soon(self, condition, limit_s=10.0):
        """Steps the robot until a condition holds; returns the time that it took (robot's clock)."""
        begun_s = self.clock.now()
        while not condition() and self.clock.now() < begun_s + limit_s:
            self.step()
        assert condition(), "it did not come about"
        return self.clock.now() - begun_s

    def hears_all(self, heard, topics):
        """Steps the robot, once every picture is subscribed to, until each topic was heard."""
        streams = self.server.topics._streams
        assert soon(lambda: all(out.is_heard for each in streams for out, _ in each.out))
        self.soon(lambda: heard.keys() == {*topics})

    def driver(self, kind=TWIST):
        """Returns a function that sends a velocity and steps the robot with it."""
        command = self.node.publisher("/alice/cmd_vel", kind)
        assert soon(lambda: command.is_heard)

        def drive(message):
            wanted = self.server.node.handled + 1
            command.put(message)
            assert soon(lambda: self.server.node.handled >= wanted)
            self.step()

        return drive

    def still(self):
        return not np.any(np.abs(self.robot.velocity) > 0.01)


@pytest.fixture
def unserved():
    place = Place(port=free_port())
    with open_session(place) as session, open_session(place) as other:
        yield Served(session, other, place)


@pytest.fixture
def served(unserved):
    with unserved.serve(life=unserved.clock.now):
        yield unserved


def twist(x, wz=0.0):
    message = ros_types().make(TWIST)
    message.linear.x, message.angular.z = x, wz
    return message


def test_the_independent_client_hears_every_topic(served, message_files):
    heard, port = {}, served.place.port
    # of the stored messages it asks only for those whose topics lie in no namespace
    late = {topic: kind for topic, kind in STORED.items() if topic.count("/") == 1}
    with connected(port, message_files):
        for topic, kind in {**TOPICS, **late}.items():
            hear = partial(heard.__setitem__, topic)
            ROS2Subscriber(topic, kind, hear, router_port=port, qos=LATCHED.text() if topic in late else None)
        served.hears_all(heard, {*TOPICS, *late})
    assert heard["/alice/odom"].child_frame_id == "alice/body"
    assert heard["/map"].info.width == 30
    assert heard["/alice/frontleft/image"].encoding == "rgb8"


def test_another_decoder_reads_the_bytes_of_every_topic(served):
    store, raw, session = get_typestore(Stores.ROS2_JAZZY), {}, served.node.session.inner
    kept, history = [], ext.HistoryConfig(max_samples=1)
    for topic, kind in (TOPICS | STORED).items():
        key = served.node.key.data_key(topic, ros_types().message(kind).key)

        def keep(sample, topic=topic):
            raw[topic] = sample.payload.to_bytes()

        late = topic in STORED
        kept.append(
            ext.declare_advanced_subscriber(session, key, keep, history=history)
            if late
            else session.declare_subscriber(key, keep)
        )
    served.hears_all(raw, TOPICS | STORED)
    for topic, kind in (TOPICS | STORED).items():
        definition, _ = store.generate_msgdef(kind, ros_version=2)
        decoded = generate_dynamic(kind, definition)[kind](raw[topic])
        assert decoded.__slots__, topic


def test_the_robot_drives_as_it_hears_and_stands_when_it_hears_nothing(served):
    drive = served.driver()
    for _ in range(12):
        drive(twist(0.5, 0.2))
    assert served.robot.velocity[0] == pytest.approx(0.5, abs=0.05)
    assert served.soon(served.still) < 0.6


# Seconds by which the stamp is older than the robot's clock, None for no stamp; whether the robot drives.
@pytest.mark.parametrize(("older_s", "drives"), [(None, True), (0.0, True), (1.0, False)])
def test_a_velocity_with_a_stamp_drives_unless_it_is_stale(served, older_s, drives):
    drive, clock = served.driver("geometry_msgs/msg/TwistStamped"), served.clock
    served.soon(lambda: clock.now() > 2.0)
    for _ in range(6):
        stamp_s = 0.0 if older_s is None else clock.now() - older_s
        drive({"header": messages.header(stamp_s), "twist": twist(0.5)})
    assert bool(np.any(served.robot.velocity)) == drives


@pytest.mark.parametrize("x", [float("nan"), float("inf")])
def test_a_velocity_that_is_not_finite_moves_nothing(served, x):
    drive = served.driver()
    for _ in range(4):
        drive(twist(x))
    assert not np.any(served.robot.velocity)


def test_a_velocity_beyond_the_limits_is_reduced_to_them(served):
    drive, most = served.driver(), served.robot.capabilities()
    for _ in range(24):
        drive(twist(100.0, 100.0))
    assert 0.0 < served.robot.velocity[0] <= most.max_speed_m_s + 1e-6
    assert 0.0 < served.robot.velocity[2] <= most.max_turn_rate_rad_s + 1e-6


def test_random_bytes_move_nothing(served, capfd):
    key, left = served.node.key.data_key("/alice/cmd_vel", ros_types().message(TWIST).key), 200_000
    chance = np.random.default_rng(1)
    while left > 0:
        data = b"\0\1\0\0"[: int(chance.integers(0, 5))] + chance.bytes(int(chance.integers(0, 600)))
        left -= len(data)
        if not 52 <= len(data) < 56:  # random bytes of a velocity's length are a velocity
            served.node.session.inner.put(key, data)
    served.driver()(twist(0.0))  # all else has come
    assert not np.any(served.robot.velocity)
    assert "Traceback" not in capfd.readouterr().err


@pytest.fixture
def remote(unserved):
    """A sender of velocities at 50 Hz behind a slow link; `speed` is that which it sends, None for nothing.

    A thread steps the robot in real time.
    """
    robot, stopping = unserved.robot, threading.Event()
    with (
        unserved.serve(),
        ThreadPoolExecutor(2) as pool,
        closing(SlowLink(unserved.place.port)) as link,
        open_session(Place(port=link.port)) as session,
    ):
        command = session.node("remote").publisher("/alice/cmd_vel", TWIST)
        made = SimpleNamespace(link=link, speed=0.5, robot=robot, still=unserved.still)

        def send():
            while not stopping.wait(0.02):
                if made.speed is not None:
                    command.put(twist(made.speed))

        working = [pool.submit(unserved.server.run, stopping), pool.submit(send)]
        try:
            assert soon(lambda: robot.velocity[0] > 0.45)
            yield made
        finally:
            stopping.set()
        for each in working:
            each.result()


def test_the_robot_drives_over_a_link_with_delays_and_stands_while_it_stalls_and_when_its_sender_is_silent(remote):
    begun_m = remote.robot.pose.x_m
    with remote.link.stall():
        begun_s = time.monotonic()
        assert soon(remote.still)
        assert time.monotonic() - begun_s < 0.6
        assert not soon(lambda: not remote.still(), 0.6)
    assert soon(lambda: remote.robot.velocity[0] > 0.45)
    assert soon(lambda: remote.robot.pose.x_m - begun_m > 0.5)
    assert 0.0 <= remote.robot.velocity[0] <= 0.5 + 1e-6
    remote.speed, silent_s = None, time.monotonic()
    assert soon(remote.still)
    assert time.monotonic() - silent_s < 0.6 + 0.15  # the link's delay


def test_velocities_that_a_stalled_link_held_do_not_drive_after_their_sender_has_died(remote):
    with remote.link.stall():
        assert soon(remote.still)
        time.sleep(0.4)
        remote.speed = None
        time.sleep(0.4)
        stood_at_m = remote.robot.pose.x_m
    assert not soon(lambda: remote.robot.pose.x_m != stood_at_m, 0.8)


def test_a_goal_of_the_arm_that_is_refused_is_told_with_its_reason(served, caplog):
    client = actions.ActionClient(served.node, "/alice/arm_controller/follow_joint_trajectory", TRAJECTORY)
    with ThreadPoolExecutor(1) as pool:
        sent = pool.submit(client.send, {"trajectory": {"joint_names": ["elbow"]}}, limit_s=20.0)
        served.soon(sent.done, 1000.0)
    assert sent.result() is None
    assert "is refused: the trajectory moves elbow, not arm_sh0" in caplog.text


def test_pictures_are_taken_only_while_somebody_looks(served):
    for _ in range(10):
        served.step()
    assert "image" not in served.robot.calls
    served.node.subscribe("/alice/hand/image", IMAGE, lambda message: None)
    served.soon(lambda: "image" in served.robot.calls)
