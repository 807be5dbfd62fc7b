"""The page's server: nothing without the token, nothing from elsewhere, actions reach the control."""

import gzip
import http.client
import json
import socket
import threading
from contextlib import suppress
from itertools import product
from urllib.parse import parse_qs, urlsplit

import pytest
from py_trees.common import Status
from websockets.exceptions import InvalidStatus, WebSocketException
from websockets.sync.client import connect

from executive.run.control import Control
from executive.run.control_state import Mode
from executive.run.visitor import Progress
from executive.tree.node import NodeState
from executive.view.feed import Feed
from executive.view.page_control import (
    ControlWatch,
    RefusedError,
    control_actions,
    control_json,
    progress_json,
    text_of,
)
from executive.view.server import PageContent, PageServer, serve
from skills.api import Question
from skills.inputs.errors import InputError
from tests.hostile_values import DATA


@pytest.fixture
def control() -> Control:
    control = Control(attended=True)
    control.begin({})
    return control


@pytest.fixture
def feed() -> Feed:
    return Feed()


class Scene:
    """A scene that counts how often its page is built."""

    built = 0
    tell = wanted = None

    def page(self):
        self.built += 1
        return gzip.compress(b"<p>scene</p>")

    def send(self, tell, wanted):
        self.tell, self.wanted = tell, wanted

    def publish(self):
        self.tell({"poses": {}})


@pytest.fixture
def scene() -> Scene:
    return Scene()


@pytest.fixture
def server(feed, control, scene, tmp_path):
    recording = tmp_path / "recording.html"
    recording.write_text("<p>recorded</p>")
    actions = {**control_actions(control), "say": lambda values: f"first: {text_of(values, 'text')}"}
    with PageServer(PageContent(feed, actions, scene, recording, tmp_path / "report.html")) as running:
        yield running


def token_of(server: PageServer) -> str:
    return parse_qs(urlsplit(server.url).query)["token"][0]


def ask(server: PageServer, method: str, path: str, body: bytes | None = None, **headers: str) -> tuple[int, bytes]:
    connection = http.client.HTTPConnection("127.0.0.1", server.port, timeout=10)
    connection.request(method, path, body, {name.replace("_", "-"): value for name, value in headers.items()})
    answer = connection.getresponse()
    return answer.status, answer.read()


def act(server: PageServer, name: str, values: object = None, **headers: str) -> tuple[int, dict]:
    own = {"X_Errand_Token": token_of(server), "Origin": f"http://127.0.0.1:{server.port}"}
    status, body = ask(server, "POST", f"/action/{name}", json.dumps(values or {}).encode(), **{**own, **headers})
    return status, json.loads(body)


def test_it_listens_on_this_machine_only(server):
    assert server._socket.getsockname()[0] == "127.0.0.1"


def test_each_server_has_a_token_of_its_own(feed, server):
    with PageServer(PageContent(feed)) as other:
        assert token_of(other) != token_of(server)
        assert len(token_of(other)) >= 32


def test_nothing_of_the_run_is_shown_without_the_token(server, feed):
    feed("detections", 0.0, {"format": "png", "data": "AAAA"})
    for path in ("/", "/picture/0", "/scene"):
        assert ask(server, "GET", path)[0] == 403, path
        assert ask(server, "GET", f"{path}?token=wrong")[0] == 403, path
        assert ask(server, "GET", f"{path}?token={token_of(server)}")[0] == 200, path


def test_the_files_to_which_the_report_links_are_sent_and_no_others(server, tmp_path):
    # nothing links to a store or a page beside the report, and what lies above the folder is no file of the run
    links = '<a href="tree.svg">tree</a><a href="log%202%26.mcap">log</a><a href="..">up</a>'
    (tmp_path / "report.html").write_text(links)
    for name in ("tree.svg", "log 2&.mcap", "missions.sqlite", "other.html", "other.mcap"):
        (tmp_path / name).write_text(name)
    token = token_of(server)
    assert ask(server, "GET", f"/file/{token}/recording.html") == (200, b"<p>recorded</p>")
    assert ask(server, "GET", f"/file/{token}/report.html") == (200, links.encode())
    assert ask(server, "GET", f"/file/{token}/tree.svg") == (200, b"tree.svg")
    assert ask(server, "GET", f"/file/{token}/log%202%26.mcap") == (200, b"log 2&.mcap")
    assert ask(server, "GET", "/file/wrong/report.html")[0] == 403
    for name in ("missions.sqlite", "other.html", "other.mcap", "none.html", "..%2Freport.html", "%2E%2E"):
        assert ask(server, "GET", f"/file/{token}/{name}")[0] == 404


def test_every_action_is_refused_without_the_token_or_from_elsewhere(server, control):
    before = control.state
    strange = (
        {"X_Errand_Token": ""},
        {"X_Errand_Token": "wrong"},
        {"X_Errand_Token": "ünï".encode().decode("latin-1")},
        {"Origin": "http://evil.example"},
        {"Origin": "null"},
        {"Origin": "http://127.0.0.1:1"},
        {"Host": "evil.example"},
    )
    names = ("pause", "resume", "step", "cancel", "stop", "release", "break", "unbreak", "answer", "say")
    for headers, name in product(strange, names):
        assert act(server, name, {"text": "x", "node": "x", "id": "x"}, **headers)[0] == 403, (headers, name)
    assert control.state == before


def test_the_websocket_is_refused_without_the_token_or_from_elsewhere(server):
    here, right = f"http://127.0.0.1:{server.port}", f"?token={token_of(server)}"
    for query, origin, extra in (
        ("", here, {}),
        ("?token=wrong", here, {}),
        (right, "http://evil.example", {}),
        (right, "null", {}),
        (right, here, {"Host": "evil.example"}),
    ):
        with (
            pytest.raises((InvalidStatus, WebSocketException, TimeoutError)),
            connect(
                f"ws://127.0.0.1:{server.port}/feed{query}", origin=origin, additional_headers=extra, proxy=None
            ) as socket,
        ):
            socket.recv(timeout=2)


def test_the_websocket_sends_all_messages_and_then_each_new_one(server, feed):
    feed("pose", 0.5, {"x": 1})
    address = f"ws://127.0.0.1:{server.port}/feed?token={token_of(server)}"
    with connect(address, origin=f"http://127.0.0.1:{server.port}", proxy=None) as socket:
        (hello,) = json.loads(socket.recv(timeout=5))
        assert hello["data"]["scene"] is True
        assert "pause" in hello["data"]["actions"]
        assert json.loads(socket.recv(timeout=5))[0]["data"] == {"x": 1}
        feed("pose", 0.6, {"x": 2})
        assert json.loads(socket.recv(timeout=5))[0]["data"] == {"x": 2}


def test_two_pages_get_the_same_messages(server, feed):
    address = f"ws://127.0.0.1:{server.port}/feed?token={token_of(server)}"
    with connect(address, proxy=None) as one, connect(address, proxy=None) as two:
        for socket in (one, two):
            socket.recv(timeout=5)
        feed("pose", 0.1, {"x": 7})
        assert [json.loads(socket.recv(timeout=5))[0]["data"]["x"] for socket in (one, two)] == [7, 7]


def test_actions_reach_the_control(server, control):
    assert act(server, "pause") == (200, {"said": "pausing"})
    assert control.state.mode is Mode.PAUSED
    assert act(server, "resume")[0] == 200
    assert control.state.mode is Mode.RUNNING
    act(server, "stop")
    assert control.state.mode is Mode.STOPPED
    act(server, "release")
    act(server, "cancel")
    assert control.poll().cancel == "cancelled from the page"


def test_a_panels_buttons_are_for_its_robot_alone(feed, clock, compiled, make):
    control = Control(attended=True)
    control.begin({name: compiled(*make.FETCH) for name in ("Alice", "Bob")})
    with PageServer(PageContent(feed, control_actions(control))) as server:
        act(server, "cancel", {"robot": "Bob"})
        assert act(server, "pause", {"robot": "Bob"}) == (200, {"said": "Bob: pausing"})
        act(server, "stop", {"robot": "Alice"})
        assert act(server, "pause", {"robot": "Carl"})[0] == 409
        modes = {name: each.mode for name, each in control.state.robots.items()}
        assert modes == {"Alice": Mode.STOPPED, "Bob": Mode.PAUSED}
        assert (control.poll().cancel, control.state.mode) == (None, Mode.RUNNING)
        act(server, "release", {"robot": "Alice"})
        act(server, "resume", {"robot": "Bob"})
    assert {each.mode for each in control.state.robots.values()} == {Mode.RUNNING}


def test_the_page_gets_the_mode_and_the_questions_of_each_robot(clock, compiled, make):
    control = Control(attended=True)
    control.begin({name: compiled(*make.FETCH) for name in ("Alice", "Bob")})
    control.pause("let me look", robot="Bob")
    control.ask(Question("q", "Is it open?", ("yes", "no"), "no", 60.0), clock, "Alice")
    told = control_json(control.state)
    assert told["robots"] == {
        "Alice": {"mode": "running", "reason": ""},
        "Bob": {"mode": "paused", "reason": "let me look"},
    }
    assert [each["robot"] for each in told["questions"]] == ["Alice"]


def test_the_page_gets_the_progress_of_each_robot():
    running = {"a/go": NodeState(Status.RUNNING, None, "half way", progress=0.5), "a": NodeState(Status.SUCCESS)}
    word = progress_json(Progress(2.0, 40, 0, {"Alice": running, "Bob": {"b": NodeState()}}))
    assert word["robots"] == {
        "Alice": {"node": "a/go", "message": "half way", "progress": 0.5},
        "Bob": {"node": None, "message": "", "progress": None},
    }


def test_an_impossible_action_is_refused_with_a_reason(server):
    for name, values, status, words in (
        ("break", {"node": "alice/nowhere"}, 409, "no node 'alice/nowhere'"),
        ("break", {}, 409, "needs a text under 'node'"),
        ("answer", {"id": "q", "text": "yes"}, 409, "not open"),
        ("say", {"text": "  "}, 409, "needs a text"),
        ("say", [1], 409, "no JSON object"),
        ("dance", {}, 404, "no action 'dance'"),
    ):
        given, answer = act(server, name, values)
        assert (given, words in answer["error"]) == (status, True), (name, values)


def test_garbage_as_values_is_refused(server):
    status, body = ask(server, "POST", "/action/pause", b"{nonsense", X_Errand_Token=token_of(server))
    assert (status, b"no JSON object" in body) == (409, True)


def test_values_that_no_text_can_hold_are_refused_in_one_line(server):
    own = {"X_Errand_Token": token_of(server), "Origin": f"http://127.0.0.1:{server.port}"}
    lone = (b'{"text": "\\ud800"}', b'{"robot": "\\udfff"}')
    for body in (b"[" * 15_000, b'{"text": ' * 15_000, *lone, b"9" * 5000, b"x" * 30_000):
        status, answer = ask(server, "POST", "/action/say", body, **own)
        assert (status, "the action's values are" in json.loads(answer)["error"]) == (409, True), body[:20]


def test_any_value_of_any_action_is_done_or_refused(control):
    for action in control_actions(control).values():
        for value in DATA:
            with suppress(RefusedError):
                action({"text": value, "id": value, "node": value, "name": value, "robot": value})


@pytest.mark.parametrize("text", ["a" * 301, "\ud800", "\x1b[31m"])
def test_an_answer_that_cannot_be_said_again_is_refused_and_the_question_stays(control, clock, text):
    control.ask(Question("alice/q", "Which?", (), "", 60.0), clock)
    with pytest.raises(RefusedError):
        control_actions(control)["answer"]({"id": "alice/q", "text": text})
    assert [each.id for each in control.state.questions] == ["alice/q"]


def test_the_page_gets_every_state_of_the_control(feed, control):
    watch = ControlWatch(control, feed)
    told = threading.Event()
    feed.listen(told.set)
    control.pause("for a test")
    assert told.wait(5)
    control.end()
    watch.close()
    words = [json.loads(text)["data"] for text in feed.since((0, 0))[1]]
    assert words[-1]["mode"] == "ended"


def test_a_closed_server_frees_its_port_and_hangs_up(feed):
    server = PageServer(PageContent(feed))
    with connect(f"ws://127.0.0.1:{server.port}/feed?token={token_of(server)}", proxy=None) as socket:
        socket.recv(timeout=5)
        server.close()
        with pytest.raises(WebSocketException):
            socket.recv(timeout=5)
    server.close()
    with PageServer(PageContent(feed), ("127.0.0.1", server.port)):
        pass


def test_a_taken_port_is_an_error(feed, server):
    with pytest.raises(OSError, match="in use"):
        PageServer(PageContent(feed), ("127.0.0.1", server.port))


def test_the_page_needs_nothing_from_elsewhere(server):
    status, page = ask(server, "GET", f"/?token={token_of(server)}")
    assert status == 200
    for address in (
        part.split(b'"')[0] for part in page.split(b'src="')[1:] + page.split(b'rel="stylesheet" href="')[1:]
    ):
        assert address.startswith(b"page/")
        assert ask(server, "GET", f"/{address.decode()}")[0] == 200
    assert b"http:" not in page
    assert b"https:" not in page


def test_refusals_are_exceptions_with_a_plain_sentence():
    with pytest.raises(RefusedError, match="needs a text under 'text'"):
        text_of({"text": 3}, "text")


def policy(server: PageServer, path: str, **headers: str) -> str:
    connection = http.client.HTTPConnection("127.0.0.1", server.port, timeout=10)
    connection.request("GET", f"{path}?token={token_of(server)}", headers=headers)
    answer = connection.getresponse()
    answer.read()
    return answer.headers["Content-Security-Policy"]


def test_the_scene_is_built_once_for_all_browsers(server, scene):
    address = f"/scene?token={token_of(server)}"
    for _ in range(2):
        assert gzip.decompress(ask(server, "GET", address)[1]) == b"<p>scene</p>"
    assert scene.built == 1


def test_a_page_without_a_scene_has_none_to_show(feed):
    with PageServer(PageContent(feed)) as bare:
        assert ask(bare, "GET", f"/scene?token={token_of(bare)}")[0] == 404


def test_a_scene_that_cannot_be_built_is_an_error_of_that_request_only(server, scene, monkeypatch):
    def fail():
        raise RuntimeError("no memory")

    monkeypatch.setattr(scene, "page", fail)
    assert ask(server, "GET", f"/scene?token={token_of(server)}")[0] == 500
    assert ask(server, "GET", f"/?token={token_of(server)}")[0] == 200


def test_the_scene_is_wanted_while_a_page_is_open(server, scene):
    assert not scene.wanted()
    with connect(f"ws://127.0.0.1:{server.port}/feed?token={token_of(server)}", proxy=None) as socket:
        socket.recv(timeout=5)
        assert scene.wanted()
        scene.publish()
        assert json.loads(socket.recv(timeout=5))[-1] == {"live": "scene", "data": {"poses": {}}}


def test_only_the_page_may_frame_the_scene_which_reaches_no_server(server):
    scene, here = policy(server, "/scene"), f"127.0.0.1:{server.port}"
    assert scene.endswith(f"frame-ancestors  http://{here}")
    assert scene.startswith("sandbox allow-scripts; ")
    assert "'self'" not in scene
    assert "allow-same-origin" not in scene
    page = policy(server, "/")
    assert "frame-ancestors ;" in page  # an empty list: no page at all
    assert f"connect-src 'self' ws://{here};" in page


def test_a_tunnel_may_end_at_another_port(server, control):
    there = "localhost:8080"
    assert act(server, "pause", Host=there, Origin=f"http://{there}")[0] == 200
    assert "ws://localhost:8080;" in policy(server, "/", Host=there)
    assert act(server, "pause", Host=there)[0] == 403  # from the page of another port


def test_a_request_names_this_machine_by_an_address_or_its_own_name(server):
    # else a name of another site that leads here would have the page's origin
    for host, status in (
        ("192.168.1.5", 200),
        ("192.168.1.5:8080", 200),
        ("[fe80::1]:8080", 200),
        (socket.gethostname(), 200),
        ("evil.example", 403),
        ("127.0.0.1.evil.example", 403),
        ("127.0.0.1:80; script-src *", 403),
        ("127.0.0.1:80:80", 403),
        ("", 403),
    ):
        assert ask(server, "GET", f"/?token={token_of(server)}", Host=host)[0] == status, host


def test_a_page_for_other_machines_says_what_protects_the_robot(feed):
    with PageServer(PageContent(feed), ("0.0.0.0", 0)) as server:
        link, *rest = server.lines.splitlines()
        host = urlsplit(link.removeprefix("The page: ")).hostname
        assert host not in ("0.0.0.0", "127.0.0.1", "localhost")
        (line,) = rest
        assert "is all that protects the robot" in line
        assert f"ssh -L {server.port}:127.0.0.1:{server.port} USER@HOST" in line
        asked = http.client.HTTPConnection(host, server.port, timeout=10)
        asked.request("GET", f"/?token={token_of(server)}")
        assert asked.getresponse().status == 200
        asked.close()
        asked.request("GET", "/")
        assert asked.getresponse().status == 403


def test_a_page_for_this_machine_has_its_address_alone(server):
    assert server.lines == f"The page: {server.url}"


@pytest.mark.parametrize("host", ["192.0.2.1", "nowhere.invalid", "a" * 70, "é" * 300, "::2"])
def test_an_address_of_no_machine_here_is_refused_in_one_line(feed, host):
    with pytest.raises(
        InputError, match=r"cannot serve the page at .* port 0 \(.+\); name another --view-host"
    ) as refusal:
        serve(PageContent(feed), (host, 0))
    assert "\n" not in str(refusal.value)
