"""Logged messages over Foxglove's WebSocket, as its clients get them."""

import base64
import json
import os
import socket
import struct
import time
from contextlib import closing, contextmanager

import numpy as np
import pytest
from websockets.sync.client import connect

from executive.record.event_log import EventLog
from executive.record.history import read_events
from executive.view.foxglove import LiveServer
from skills.inputs.errors import InputError

ANY_PORT = "127.0.0.1:0"
PROTOCOL = "foxglove.sdk.v1"
POSE = {"timestamp": {"sec": 1, "nsec": 0}, "frame_id": "world", "robot": "alice"}
POSE |= {"pose": {"position": {"x": 1.0, "y": 2.0, "z": 0.0}, "orientation": {"x": 0, "y": 0, "z": 0, "w": 1}}}


@pytest.fixture
def server():
    with closing(LiveServer(ANY_PORT)) as running:
        yield running


@pytest.fixture
def log(server, tmp_path, clock):
    with closing(EventLog(tmp_path / "log.mcap", clock)) as opened:
        server.follow(opened)
        yield opened


class Client:
    """Client of the protocol that subscribes to all channels."""

    def __init__(self, socket):
        self.socket, self.channels, self.times_ns = socket, {}, []

    def messages(self, count, *, subscribe=True, times=0):
        """Returns the next messages, as topic, time (ns) and JSON values, once `times` times have come as well."""
        found = []
        while len(found) < count or len(self.times_ns) < times:
            frame = self.socket.recv(timeout=10)
            if isinstance(frame, str):
                told = json.loads(frame)
                for each in told.get("channels", ()):
                    self.channels[each["id"]] = each
                    wanted = [{"id": each["id"], "channelId": each["id"]}]
                    if subscribe:
                        self.socket.send(json.dumps({"op": "subscribe", "subscriptions": wanted}))
            elif frame[0] == 1:
                number, stamp_ns = struct.unpack_from("<IQ", frame, 1)
                found.append((self.channels[number]["topic"], stamp_ns, json.loads(frame[13:])))
            else:
                self.times_ns.append(struct.unpack_from("<Q", frame, 1)[0])
        return found


@contextmanager
def client_of(server):
    with connect(server.url, subprotocols=[PROTOCOL], max_size=None) as socket:
        yield Client(socket)


def test_client_gets_the_messages_of_the_log_as_they_stand_in_it(server, log, clock):
    with client_of(server) as client:
        clock.advance(1.5)
        log("pose", POSE)
        log("camera", {"image": np.zeros((4, 6, 3), np.uint8), "frame_id": "hand"})
        got = client.messages(3)
    log.close()
    assert {topic: (stamp_ns, values) for topic, stamp_ns, values in got} == {
        event.topic: (1_500_000_000, dict(event.data)) for event in read_events(log.path)
    }
    schemas = {each["topic"]: each["schemaName"] for each in client.channels.values()}
    assert schemas == {
        "pose": "foxglove.PoseInFrame",
        "transform": "foxglove.FrameTransform",
        "camera": "foxglove.CompressedImage",
    }
    assert {each["encoding"] for each in client.channels.values()} == {"json"}


def test_late_client_gets_the_newest_message_of_each_robot_and_node(server, log, clock):
    log("tree", {"robot": "alice", "root": {"name": "old"}})
    log("tree", {"robot": "alice", "root": {"name": "new"}})
    for node, state in (("a", "RUNNING"), ("b", "RUNNING"), ("a", "SUCCESS")):
        clock.advance(1.0)
        log("transitions", {"robot": "alice", "node": node, "to": state})
    with client_of(server) as client:
        got = client.messages(3)
    assert [values["root"]["name"] for topic, _, values in got if topic == "tree"] == ["new"]
    states = [(values["node"], values["to"]) for topic, _, values in got if topic == "transitions"]
    assert states == [("b", "RUNNING"), ("a", "SUCCESS")]


def test_time_of_the_client_is_the_robots(server, log, clock):
    log("pose", POSE)
    with client_of(server) as client:
        client.messages(2)
        clock.advance(2.0)
        log("pose", POSE)
        client.messages(2, times=1)
    assert client.times_ns == [2_000_000_000]


def test_next_log_goes_to_the_same_clients_without_old_messages(server, log, clock, tmp_path):
    log("tree", {"robot": "alice", "root": {"name": "first"}})
    with closing(EventLog(tmp_path / "second.mcap", clock)) as second, client_of(server) as early:
        early.messages(1)
        server.follow(second)
        with client_of(server) as late:
            second("tree", {"robot": "bob", "root": {"name": "second"}})
            for client in (early, late):
                assert client.messages(1)[0][2]["root"] == {"name": "second"}


def test_channels_of_several_robots_have_their_names(server, tmp_path, clock):
    with closing(EventLog(tmp_path / "log.mcap", clock, apart=True)) as log, client_of(server) as client:
        server.follow(log)
        log("pose", POSE)
        assert {topic for topic, _, _ in client.messages(2)} == {"alice/pose", "alice/transform"}


def test_client_that_reads_nothing_delays_neither_the_run_nor_its_end_and_holds_few_bytes(server, log, monkeypatch):
    monkeypatch.setattr("executive.view.serving.CLOSE_S", 0.2)
    monkeypatch.setattr("executive.view.foxglove.MOST_BYTES", 1_000_000)
    log("mine", {"text": ""})
    with socket.create_connection(server.url.removeprefix("ws://").split(":")) as deaf:
        deaf.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        key = base64.b64encode(os.urandom(16)).decode()
        lines = (
            "GET / HTTP/1.1",
            "Host: 127.0.0.1",
            "Upgrade: websocket",
            "Connection: Upgrade",
            "Sec-WebSocket-Version: 13",
        )
        more = (f"Sec-WebSocket-Key: {key}", f"Sec-WebSocket-Protocol: {PROTOCOL}", "", "")
        deaf.sendall("\r\n".join((*lines, *more)).encode())
        assert b"101" in deaf.recv(64)
        asked = json.dumps({"op": "subscribe", "subscriptions": [{"id": 1, "channelId": 1}]}).encode()
        deaf.sendall(bytes([0x81, 0x80 | len(asked)]) + bytes(4) + asked)
        begun_s = time.perf_counter()
        for _ in range(600):
            log("mine", {"text": "z" * 20_000})  # 12 MB, far more than the socket holds
        (client,) = server._clients
        assert 100_000 < sum(map(len, client.data)) <= 1_000_000
        deaf.sendall((bytes([0x81, 0x80 | len(asked)]) + bytes(4) + asked) * 100)
        assert sum(map(len, client.data)) == client.waiting_bytes <= 1_000_000
        server.close()
        assert time.perf_counter() - begun_s < 10.0


def test_other_pages_and_other_hosts_are_refused(server):
    address = server.url.removeprefix("ws://")
    for origin, host, allowed in (
        (None, None, True),
        ("https://app.foxglove.dev", None, True),
        ("file://", None, True),
        (None, "localhost:8765", True),
        (None, "192.168.1.5:8765", True),
        ("http://evil.example", None, False),
        ("null", None, False),
        ("https://app.foxglove.dev.evil.example", None, False),
        (None, "evil.example:8765", False),
        ("http://evil.example:8765", "evil.example:8765", False),
        (None, "[", False),
    ):
        headers = [f"Host: {host or address}", "Upgrade: websocket", "Connection: Upgrade", "Sec-WebSocket-Version: 13"]
        headers += ["Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==", *([f"Origin: {origin}"] if origin else [])]
        with socket.create_connection(address.split(":")) as client:
            client.sendall("\r\n".join(["GET / HTTP/1.1", *headers, "", ""]).encode())
            assert client.recv(64).split()[1] == (b"101" if allowed else b"403"), (origin, host)


def test_a_message_that_makes_no_sense_is_ignored(server, log):
    with client_of(server) as client:
        for said in (
            "{",
            "[]",
            "{}",
            b"\x01",
            {"op": "subscribe"},
            {"op": "subscribe", "subscriptions": [{"id": -1, "channelId": 1}]},
            {"op": "subscribe", "subscriptions": [{"id": "x", "channelId": [1]}]},
            {"op": "subscribe", "subscriptions": [{"id": 3, "channelId": 99}]},
            {"op": "unsubscribe", "subscriptionIds": [[]]},
            {"op": "unsubscribe", "subscriptionIds": 7},
        ):
            client.socket.send(json.dumps(said) if isinstance(said, dict) else said)
            log("pose", POSE)
            assert len(client.messages(2)) == 2, said


def test_a_client_that_unsubscribes_gets_no_more(server, log, clock):
    log("mine", {"text": "a"})
    with client_of(server) as client:
        client.messages(1)
        client.socket.send(json.dumps({"op": "unsubscribe", "subscriptionIds": [1]}))
        client.socket.send(json.dumps({"op": "subscribe", "subscriptions": [{"id": 9, "channelId": 1}]}))
        frame = b""
        while not frame.startswith(b"\x01"):
            frame = client.socket.recv(timeout=10)
        assert struct.unpack_from("<I", frame, 1) == (9,)


def test_port_in_use_is_one_error(server):
    address = server.url.removeprefix("ws://")
    with pytest.raises(InputError, match=rf"cannot serve Foxglove at {address} \(Address already in use\); name"):
        LiveServer(address)


@pytest.mark.parametrize("address", ["localhost", "localhost:", "localhost:x", "a b:1", "localhost:70000", ":1", ""])
def test_address_without_a_port_is_refused(address):
    with pytest.raises(InputError, match="no address with a port; write HOST:PORT"):
        LiveServer(address)
