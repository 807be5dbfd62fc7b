"""Nodes over a router on this machine: topics, late subscribers, services, malformed input, and another client."""

import subprocess
import sys
import threading
from contextlib import ExitStack
from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("zenoh", reason="not installed: pip install eclipse-zenoh")

import zenoh
from ros_client import EMPTY, connected, free_port, soon
from zenoh_ros2_sdk import ROS2ServiceClient, ROS2Subscriber

from errand_ros2.wire.node import Client, Node, Place, open_session
from errand_ros2.wire.types import LATCHED, ros_types
from skills.inputs.errors import InputError

STRING, TRIGGER = "std_msgs/msg/String", "std_srvs/srv/Trigger"


def text(value):
    return {"data": value}


@pytest.fixture
def router():
    """A session that is the router, with a node."""
    with open_session(Place(port=free_port())) as session:
        assert session.is_router
        yield SimpleNamespace(session=session, node=Node(session, "errand", "/alice"), place=session.place)


@pytest.fixture
def other(router):
    """A node of a second session, which is a client of the first."""
    with open_session(router.place) as session:
        assert not session.is_router
        yield Node(session, "other")


def test_a_message_arrives_at_a_subscription(router, other):
    heard = []
    other.subscribe("/alice/chatter", STRING, lambda message: heard.append(message.data))
    chatter = router.node.publisher("chatter", STRING)
    assert soon(lambda: chatter.is_heard)
    chatter.put(text("hello"))
    assert soon(lambda: heard == ["hello"])


def test_a_publisher_knows_that_nobody_listens(router):
    assert not router.node.publisher("chatter", STRING).is_heard


def test_a_late_subscription_gets_the_last_message_of_a_latched_topic(router, other):
    latched, heard = router.node.publisher("/map", STRING, LATCHED), []
    for word in ("old", "new"):
        latched.put(text(word))
    other.subscribe("/map", STRING, lambda message: heard.append(message.data), LATCHED)
    assert soon(lambda: heard)
    assert heard == ["new"]


def test_a_service_answers(router, other):
    router.node.answer("reset", TRIGGER, lambda request: {"success": True, "message": "done"})
    assert Client(other, "/alice/reset", ros_types().service(TRIGGER)).call({}, limit_s=5.0).message == "done"


def test_a_service_that_nobody_offers_gives_no_answer(other):
    assert Client(other, "/none", ros_types().service(TRIGGER)).call({}, limit_s=0.2) is None


def test_domains_do_not_hear_each_other(router):
    chatter = router.node.publisher("chatter", STRING)
    with open_session(Place(domain=7, port=router.place.port)) as session:
        other = Node(session, "other")
        other.subscribe("/alice/chatter", STRING, lambda message: None)
        other.claim("/none")  # the router's answer comes after it has taken the subscription
        assert not chatter.is_heard


def test_a_client_joins_its_router_again_after_a_restart():
    place, heard = Place(port=free_port()), []
    with ExitStack() as first, ExitStack() as client:
        first.enter_context(open_session(place))
        node = Node(client.enter_context(open_session(place)), "other")
        chatter, latched = node.publisher("/chatter", STRING), node.publisher("/map", STRING, LATCHED)
        latched.put(text("the map"))
        first.close()
        with open_session(place) as again:
            assert again.is_router
            late = Node(again, "errand")
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


def test_malformed_requests_get_no_answer_and_do_no_harm(router, other):
    calls = []
    router.node.answer("reset", TRIGGER, calls.append)
    key = other.key.data_key("/alice/reset", ros_types().service(TRIGGER).key)
    target = zenoh.QueryTarget.ALL_COMPLETE
    for payload, attachment in ((b"", b""), (b"\0\1", bytes(33)), (b"\0\1\0\0\0", b"x"), (None, None)):
        replies = other.session.inner.get(key, target=target, timeout=1.0, payload=payload, attachment=attachment)
        assert [reply for reply in replies if reply.ok] == []
    assert calls == []


def test_a_defect_of_a_handler_is_one_line(router, other, caplog):
    router.node.subscribe("chatter", STRING, lambda message: 1 / 0)
    chatter = other.publisher("/alice/chatter", STRING)
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
    assert Place.parse("") == Place(0, "127.0.0.1", 7447)
    assert Place.parse("42@192.168.1.5:7448") == Place(42, "192.168.1.5", 7448)
    assert Place.parse("@:7448") == Place(0, "127.0.0.1", 7448)


def test_a_router_elsewhere_that_does_not_answer_is_refused():
    with pytest.raises(InputError, match="no Zenoh router"), open_session(Place(host="192.0.2.1")):
        pass


def test_a_topic_that_another_node_publishes_cannot_be_claimed(router, other):
    router.node.claim("odom", "/clock")
    router.node.publisher("/clock", "rosgraph_msgs/msg/Clock")
    other.claim("odom")
    with pytest.raises(InputError, match="is published in domain 0 already, by another robot, simulator or run"):
        other.claim("odom", "/clock")


def test_the_usual_domain_is_that_of_the_environment(monkeypatch):
    monkeypatch.setenv("ROS_DOMAIN_ID", "42")
    assert [Place.parse(text).domain for text in ("", "@somewhere", "7")] == [42, 42, 7]
    monkeypatch.setenv("ROS_DOMAIN_ID", "many")
    with pytest.raises(InputError, match="'many' is no ROS domain"):
        Place.parse("")
