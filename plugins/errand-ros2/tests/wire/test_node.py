"""Nodes over both wires: topics, late subscribers, services, malformed input; over Zenoh also another client."""

import os
import subprocess
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import replace
from importlib.util import find_spec
from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("zenoh", reason="not installed: pip install eclipse-zenoh")

import zenoh
from ros_client import EMPTY, connected, free_port, soon
from zenoh_ros2_sdk import ROS2ServiceClient, ROS2Subscriber

from errand_ros2.wire.actions import ActionClient, ActionServer, GoalStatus
from errand_ros2.wire.node import Place
from errand_ros2.wire.session import open_session
from errand_ros2.wire.types import LATCHED, SENSOR, MalformedError, ros_types
from skills.inputs.errors import InputError

STRING, TRIGGER = "std_msgs/msg/String", "std_srvs/srv/Trigger"


RCLPY = pytest.mark.skipif(not (find_spec("rclpy") and find_spec("nav2_msgs")), reason="not installed: make ros")


def text(value):
    return {"data": value}


def opened(place):
    """A session, with a node."""
    with open_session(place) as session:
        yield SimpleNamespace(session=session, node=session.node("errand", "/alice"), place=session.place)


@pytest.fixture
def router():
    """A session that is the router of Zenoh, with a node."""
    yield from opened(Place(port=free_port()))


@pytest.fixture(params=["zenoh", pytest.param("rclpy", marks=RCLPY)])
def one(request):
    """A session over each wire, with a node."""
    by_rclpy = request.param == "rclpy"
    yield from opened(Place(os.getpid() % 200 if by_rclpy else 0, port=free_port(), by_rclpy=by_rclpy))


def second(session):
    with open_session(session.place) as opened:
        yield opened.node("other")


@pytest.fixture
def other(router):
    """A node of a second session, which is a client of the router."""
    yield from second(router)


@pytest.fixture
def two(one):
    """A node of a second session over the same wire."""
    yield from second(one)


def test_the_first_session_is_the_router(router, other):
    assert router.session.is_router and not other.session.is_router


def test_a_message_arrives_at_a_subscription(one, two):
    heard = []
    two.subscribe("/alice/chatter", STRING, lambda message: heard.append(message.data))
    chatter = one.node.publisher("chatter", STRING)
    assert soon(lambda: chatter.is_heard)
    chatter.put(text("hello"))
    assert soon(lambda: heard == ["hello"])


def test_messages_and_arrays_of_all_depths_arrive_as_they_were_sent(one, two):
    heard, cloud = [], "sensor_msgs/msg/PointCloud2"
    two.subscribe("/alice/points", cloud, heard.append, SENSOR)
    points = one.node.publisher("points", cloud, SENSOR)
    assert soon(lambda: points.is_heard)
    field = {"name": "x", "offset": 4, "datatype": 7, "count": 1}
    head = {"stamp": {"sec": 3, "nanosec": 5}, "frame_id": "lidar"}
    cloud = {"header": head, "fields": [field], "data": np.arange(200, dtype=np.uint8), "is_dense": True}
    assert soon(lambda: points.put(cloud) or heard)  # the first may be lost
    assert (heard[0].header.stamp.nanosec, heard[0].header.frame_id, heard[0].fields[0].offset) == (5, "lidar", 4)
    assert heard[0].data.tolist() == [*range(200)] and heard[0].is_dense


def test_a_topic_is_heard_in_two_types(one, two):
    heard, kinds = [], ("geometry_msgs/msg/Twist", "geometry_msgs/msg/TwistStamped")
    for kind in kinds:
        one.node.subscribe("cmd_vel", kind, lambda message, kind=kind: heard.append(kind))
    for kind in kinds:
        for sender in second(one):
            command = sender.publisher("/alice/cmd_vel", kind)
            assert soon(lambda command=command: command.is_heard)
            command.put({})
            assert soon(lambda kind=kind: kind in heard)


def test_a_publisher_knows_that_nobody_listens(one):
    assert not one.node.publisher("chatter", STRING).is_heard


def test_a_late_subscription_gets_the_last_message_of_a_latched_topic(one, two):
    latched, heard = one.node.publisher("/map", STRING, LATCHED), []
    for word in ("old", "new"):
        latched.put(text(word))
    two.subscribe("/map", STRING, lambda message: heard.append(message.data), LATCHED)
    assert soon(lambda: heard)
    assert heard == ["new"]


def test_a_service_answers(one, two):
    one.node.answer("reset", TRIGGER, lambda request: {"success": True, "message": "done"})
    assert two.client("/alice/reset", TRIGGER).call({}, limit_s=5.0).message == "done"


def test_a_service_that_nobody_offers_gives_no_answer(two):
    assert two.client("/none", TRIGGER).call({}, limit_s=0.2) is None


def test_a_node_tells_its_parameters(one, two):
    asked = "rcl_interfaces/srv/GetParameters"
    told = two.client("/alice/errand/get_parameters", asked).call({"names": ["use_sim_time"]}, limit_s=5.0)
    assert [(each.type, each.bool_value) for each in told.values] == [(1, False)]
    every = "rcl_interfaces/srv/ListParameters"
    assert "use_sim_time" in two.client("/alice/errand/list_parameters", every).call({}, limit_s=5.0).result.names


def test_a_goal_is_accepted_told_of_ended_and_cancelled(one, two):
    kind, told = "nav2_msgs/action/NavigateToPose", []
    with ThreadPoolExecutor(1) as pool:
        server = ActionServer(one.node, "go", kind, pool, lambda goal: told.append(goal) or len(told) < 3, told.append)
        client = ActionClient(two, "/alice/go", kind)
        sent = client.send({"pose": {"header": {"frame_id": "map"}}}, limit_s=10.0)
        assert told[0].message.pose.header.frame_id == "map"
        server.end(told[0], GoalStatus.ABORTED, error_msg="no path")
        assert sent.ended.wait(10.0) and (sent.status, sent.result.error_msg) == (GoalStatus.ABORTED, "no path")
        sent = client.send({}, limit_s=10.0)
        time.sleep(0.2)  # the request for the result has come, and is open
        client.cancel(sent)
        assert soon(lambda: told[-1].status is GoalStatus.CANCELING)
        server.end(told[1], GoalStatus.CANCELED)
        assert sent.ended.wait(10.0) and sent.status is GoalStatus.CANCELED
        assert client.send({}, limit_s=10.0) is None


def test_a_topic_that_is_published_as_another_type_is_said_in_one_line(one, two, caplog):
    one.node.subscribe("odom", "nav_msgs/msg/Odometry", lambda message: None)
    for _ in range(2):
        two.publisher("/alice/odom", "geometry_msgs/msg/PoseStamped")
    assert soon(lambda: "/alice/odom is published as geometry_msgs/msg/PoseStamped" in caplog.text)
    assert "since it takes nav_msgs/msg/Odometry" in caplog.text
    assert caplog.text.count("\n") == 1


def test_domains_do_not_hear_each_other(one):
    chatter = one.node.publisher("chatter", STRING)
    with open_session(replace(one.place, domain=one.place.domain + 1)) as session:
        other = session.node("other")
        other.subscribe("/alice/chatter", STRING, lambda message: None)
        other.claim("/none")  # the router's answer comes after it has taken the subscription
        assert not chatter.is_heard


def test_a_client_joins_its_router_again_after_a_restart():
    place, heard = Place(port=free_port()), []
    with ExitStack() as first, ExitStack() as client:
        first.enter_context(open_session(place))
        node = client.enter_context(open_session(place)).node("other")
        chatter, latched = node.publisher("/chatter", STRING), node.publisher("/map", STRING, LATCHED)
        latched.put(text("the map"))
        first.close()
        with open_session(place) as again:
            assert again.is_router
            late = again.node("errand")
            late.subscribe("/chatter", STRING, lambda message: heard.append(message.data))
            late.subscribe("/map", STRING, lambda message: heard.append(message.data), LATCHED)
            assert soon(lambda: chatter.is_heard, 20.0)
            chatter.put(text("hello"))
            assert soon(lambda: sorted(heard) == ["hello", "the map"])


def test_malformed_messages_are_dropped_and_counted(router, other, capfd):
    heard = []
    router.node.subscribe("chatter", STRING, lambda message: heard.append(message.data))
    key = other.key.data_key("/alice/chatter", ros_types().message(STRING).key)
    chance = np.random.default_rng(1)
    for _ in range(200):
        other.session.inner.put(key, chance.bytes(int(chance.integers(0, 8))))
    other.session.inner.put(key, ros_types().message(STRING).encode(text("good")), encoding="application/cdr")
    assert soon(lambda: "good" in heard)
    assert router.node.dropped > 100
    assert "Traceback" not in capfd.readouterr().err


@RCLPY
def test_random_bytes_from_rclpy_are_dropped_and_counted(capfd):
    place, chance, heard = Place(os.getpid() % 200, by_rclpy=True), np.random.default_rng(1), []
    kind = "sensor_msgs/msg/JointState"
    with open_session(place) as session, open_session(place) as others:
        node, other = session.node("errand", "/alice"), others.node("other")
        node.subscribe("joint_states", kind, heard.append)
        sender = other.publisher("/alice/joint_states", kind)
        raw = other.inner.create_publisher(others.interface(kind, "this test"), "/alice/joint_states", 10)
        assert soon(lambda: sender.is_heard and raw.get_subscription_count())
        for _ in range(400):
            raw.publish(b"\0\1\0\0" + chance.bytes(int(chance.integers(1, 1000))))
            time.sleep(0.001)
        sender.put({"name": ["good"]})
        assert soon(lambda: heard and heard[-1].name == ["good"])
        assert node.dropped > 100
    assert "Traceback" not in capfd.readouterr().err


# A header alone, with the padding that it tells: Fast CDR would read memory behind it; a velocity, shorter or longer.
@pytest.mark.parametrize("data", [*(bytes([0, 1, 0, padding]) for padding in range(4)), b"", bytes(51), bytes(56)])
def test_bytes_of_another_length_are_no_velocity(data):
    twist = ros_types().message("geometry_msgs/msg/Twist")
    for padding in (0, 3):
        assert twist.decode(bytes(52)) == twist.decode(bytes(52 + padding), padding)
        with pytest.raises(MalformedError):
            twist.decode(data, padding)


def test_only_a_wire_that_fills_messages_up_allows_bytes_behind_them():
    flag = ros_types().message("std_msgs/msg/Bool")
    assert flag.decode(bytes(5)) == flag.decode(bytes(8), 3)
    for length in (6, 8):
        with pytest.raises(MalformedError, match=f"{length} bytes are no std_msgs/msg/Bool"):
            flag.decode(bytes(length))


def test_malformed_requests_get_no_answer_and_do_no_harm(router, other):
    calls = []
    router.node.answer("reset", TRIGGER, calls.append)
    key = other.key.data_key("/alice/reset", ros_types().service(TRIGGER).key)
    target = zenoh.QueryTarget.ALL_COMPLETE
    for payload, attachment in ((b"", b""), (b"\0\1", bytes(33)), (b"\0\1\0\0\0", b"x"), (None, None)):
        replies = other.session.inner.get(key, target=target, timeout=1.0, payload=payload, attachment=attachment)
        assert [reply for reply in replies if reply.ok] == []
    assert calls == []


def test_a_defect_of_a_handler_is_one_line(one, two, caplog):
    one.node.subscribe("chatter", STRING, lambda message: 1 / 0)
    chatter = two.publisher("/alice/chatter", STRING)
    assert soon(lambda: chatter.is_heard)
    chatter.put(text("hello"))
    assert soon(lambda: "division by zero" in caplog.text)
    assert caplog.text.count("\n") == 1


def test_the_independent_client_lists_topics_with_types(router):
    router.node.publisher("chatter", STRING)
    command = ["-m", "zenoh_ros2_sdk.cli", "--no-daemon", "--router", f"127.0.0.1:{router.place.port}", "topic"]
    listed = subprocess.run([sys.executable, *command, "list", "-t"], capture_output=True, text=True, check=True)
    assert listed.stdout == f"/alice/chatter [{STRING}]\n"
    told = subprocess.run([sys.executable, *command, "info", "-v", "/alice/chatter"], capture_output=True, text=True)
    for line in ("Node name: errand", "Node namespace: /alice", "QoS: ::,10:,:,:,,"):
        assert line in told.stdout
    assert ros_types().message(STRING).key.rpartition("/")[2] in told.stdout


def test_the_independent_client_hears_and_calls(router, message_files):
    router.node.answer("reset", TRIGGER, lambda request: {"success": True, "message": "done"})
    chatter, latched = router.node.publisher("chatter", STRING), router.node.publisher("/map", STRING, LATCHED)
    latched.put(text("the map"))
    heard, arrived = [], threading.Event()

    def hear(message):
        heard.append(message.data)
        arrived.set()

    with connected(router.place.port, message_files):
        ROS2Subscriber("/alice/chatter", STRING, hear, router_port=router.place.port)
        assert soon(lambda: chatter.is_heard)
        chatter.put(text("hello"))
        assert arrived.wait(5.0)
        ROS2Subscriber("/map", STRING, hear, router_port=router.place.port, qos=LATCHED.text())
        assert soon(lambda: heard == ["hello", "the map"])
        definitions = {"request_definition": EMPTY, "response_definition": "bool success\nstring message"}
        client = ROS2ServiceClient("/alice/reset", TRIGGER, **definitions, router_port=router.place.port)
        assert client.type_hash == ros_types().service(TRIGGER).key.rpartition("/")[2]
        assert client.call().message == "done"


@pytest.mark.parametrize("words", ["x", "0@:0", "0@:70000", "233", "-1", "0@a b", "1 2"])
def test_a_place_that_is_none_is_refused(words):
    with pytest.raises(InputError):
        Place.parse(words)


def test_a_place_has_its_usual_values():
    assert Place.parse("zenoh:") == Place(0, "127.0.0.1", 7447)
    assert Place.parse("").by_rclpy == bool(find_spec("rclpy"))
    assert Place.parse("42@192.168.1.5:7448") == Place(42, "192.168.1.5", 7448)
    assert Place.parse("@:7448") == Place(0, "127.0.0.1", 7448)


def test_a_router_elsewhere_that_does_not_answer_is_refused():
    with pytest.raises(InputError, match="no Zenoh router"), open_session(Place(host="192.0.2.1")):
        pass


def test_a_topic_that_another_node_publishes_cannot_be_claimed(one, two):
    one.node.claim("odom", "/clock")
    one.node.publisher("/clock", "rosgraph_msgs/msg/Clock")
    two.claim("odom")
    with pytest.raises(InputError, match=r"is published in domain \d+ already, by another robot, simulator or run"):
        two.claim("odom", "/clock")


def test_the_usual_domain_is_that_of_the_environment(monkeypatch):
    monkeypatch.setenv("ROS_DOMAIN_ID", "42")
    assert [Place.parse(text).domain for text in ("", "@somewhere", "7")] == [42, 42, 7]
    monkeypatch.setenv("ROS_DOMAIN_ID", "many")
    with pytest.raises(InputError, match="'many' is no ROS domain"):
        Place.parse("")
