"""HTTP calls: nothing without the token, small bodies only, and each refusal has its status."""

import errno
import http.client
import json
import socket
import time
from contextlib import ExitStack, suppress
from http import HTTPStatus
from itertools import product
from pathlib import Path

import pytest

from executive.view import serving
from executive.view.serving import BACKLOG, MAX_BODY, CallError, CallServer, open_port

TOKEN = "a-token-of-the-test"


@pytest.fixture
def calls():
    return []


@pytest.fixture
def few(monkeypatch):
    """A small bound of the connections, a quarter of those that may wait to be accepted."""
    monkeypatch.setattr(serving, "MOST_CONNECTIONS", BACKLOG // 4)
    return BACKLOG // 4


@pytest.fixture
def server(calls):
    def called(name, body):
        if name == "broken":
            raise RuntimeError("a defect")
        if name == "full":
            raise CallError(HTTPStatus.TOO_MANY_REQUESTS, "100 wait already")
        calls.append((name, body))
        return {"missions": [7]}

    with CallServer(called, token=TOKEN, host="127.0.0.1", port=0) as running:
        yield running


def ask(server, method="POST", name="patrol", body=b"", **headers):
    connection = http.client.HTTPConnection("127.0.0.1", server.port, timeout=10)
    connection.request(method, f"/missions/{name}", body, {"Authorization": f"Bearer {TOKEN}", **headers})
    answer = connection.getresponse()
    return answer.status, answer.read()


def test_a_call_with_the_token_is_carried_out(server, calls):
    status, answer = ask(server, body=b'{"room": "office"}')
    assert (status, json.loads(answer)) == (202, {"missions": [7]})
    assert calls == [("patrol", b'{"room": "office"}')]
    assert server.url == f"http://127.0.0.1:{server.port}/missions/"


def test_values_in_the_query_are_refused_and_carry_out_nothing(server, calls):
    status, answer = ask(server, name="patrol?room=office", body=b"{}")
    assert (status, calls) == (400, []) and "values belong into the body, as JSON" in json.loads(answer)["error"]


def test_every_call_without_the_token_is_refused_in_the_same_way(server, calls):
    headers = ("", "Bearer", "Bearer ", "Bearer wrong", f"Bearer {TOKEN}x", f"Basic {TOKEN}", TOKEN, "Bearer \u00fc")
    for given, name in product(headers, ("patrol", "unknown", "full")):
        status, answer = ask(server, name=name, Authorization=given.encode("latin-1"))
        assert (status, "the token is missing or wrong" in json.loads(answer)["error"]) == (401, True), (given, name)
    assert calls == []


def test_the_scheme_may_be_written_in_small_letters(server):
    assert ask(server, Authorization=f"bearer {TOKEN}")[0] == 202


def test_a_refusal_has_its_status_and_its_reason(server):
    status, answer = ask(server, name="full")
    assert (status, json.loads(answer)) == (429, {"error": "100 wait already"})


def test_a_large_body_is_refused_whatever_length_it_claims(server, calls):
    assert ask(server, body=b"x" * MAX_BODY)[0] == 202
    calls.clear()
    assert ask(server, body=b"x" * (MAX_BODY + 1))[0] == 413
    assert ask(server, body=iter([b"x" * MAX_BODY, b"x"]))[0] == 413
    assert calls == []


def test_a_client_that_goes_away_in_the_middle_does_no_harm(server, calls, capfd):
    with socket.create_connection(("127.0.0.1", server.port)) as client:
        head = f"POST /missions/patrol HTTP/1.1\r\nHost: x\r\nAuthorization: Bearer {TOKEN}\r\nContent-Length: 9"
        client.sendall(f"{head}\r\n\r\n{{".encode())
    assert ask(server)[0] == 202
    server.close()
    assert (len(calls), capfd.readouterr().err) == (1, "")


def test_nothing_else_is_served(server, calls):
    for method, name in (("GET", "patrol"), ("PUT", "patrol"), ("POST", "a/b"), ("POST", "")):
        assert ask(server, method, name)[0] in (404, 405), (method, name)
    assert calls == []


@pytest.mark.parametrize(
    ("method", "name", "status", "said"),
    [
        ("GET", "patrol", 405, "GET /missions/patrol: method not allowed; use POST"),
        ("POST", "a/b", 404, "POST /missions/a/b: not found"),
        ("POST", "broken", 500, "POST /missions/broken: internal server error"),
    ],
)
def test_the_server_says_every_error_as_json(server, method, name, status, said):
    found, answer = ask(server, method, name)
    assert (found, json.loads(answer)) == (status, {"error": said})


def test_the_server_says_as_json_that_a_request_is_no_http(server):
    with socket.create_connection(("127.0.0.1", server.port), timeout=10) as client:
        client.sendall(b"hello\r\n\r\n")
        head, _, body = client.makefile("rb").read().partition(b"\r\n\r\n")
    assert b"400 Bad Request" in head and b"application/json" in head
    assert set(json.loads(body)) == {"error"}


def test_the_server_listens_only_at_its_own_address(server):
    assert server._socket.getsockname()[0] == "127.0.0.1"


def test_an_address_that_is_taken_is_an_error():
    with socket.create_server(("127.0.0.1", 0)) as taken, pytest.raises(OSError, match="in use"):
        CallServer(lambda name, body: {}, token=TOKEN, host="127.0.0.1", port=taken.getsockname()[1])


@pytest.fixture
def strangers(server):
    """Opens connections that send the given bytes; returns them."""
    with ExitStack() as stack:

        def connect(count, sent=b""):
            opened = [stack.enter_context(socket.create_connection(("127.0.0.1", server.port))) for _ in range(count)]
            for each in opened:
                each.sendall(sent)
            return opened

        yield connect


def is_closed(connection, within_s=5.0):
    connection.settimeout(within_s)
    with suppress(ConnectionResetError):
        return connection.recv(1) == b""
    return True


def open_files():
    return len([*Path("/proc/self/fd").iterdir()])


def test_connections_without_the_token_are_bounded_and_calls_are_still_answered(few, server, strangers, capfd):
    for sent in (b"", b"POST /missions/patrol HTTP/1.1\r\nAuthorization: Bea"):
        before = open_files()
        opened = strangers(4 * few, sent)
        assert ask(server)[0] == 202
        assert is_closed(opened[0])
        assert open_files() - before <= len(opened) + 2 * few
        assert ask(server)[0] == 202
    assert capfd.readouterr().err == ""


def test_a_caller_keeps_its_connection_while_others_connect(few, server, strangers):
    caller = http.client.HTTPConnection("127.0.0.1", server.port, timeout=10)
    sockets = set()
    for _ in range(3):
        caller.request("POST", "/missions/patrol", b"", {"Authorization": f"Bearer {TOKEN}"})
        assert caller.getresponse().read() == b'{"missions":[7]}'
        sockets.add(caller.sock)
        strangers(few)
    assert len(sockets) == 1


@pytest.mark.parametrize("sent", [b"", b"POST /missions/patrol HTTP/1.1\r\nx: "])
def test_a_slow_header_ends_the_connection(calls, monkeypatch, sent):
    monkeypatch.setattr("executive.view.serving.STRANGER_S", 0.3)
    with (
        CallServer(lambda name, body: {}, token=TOKEN, host="127.0.0.1", port=0) as server,
        socket.create_connection(("127.0.0.1", server.port)) as client,
    ):
        client.sendall(sent)
        assert is_closed(client)


def test_a_slow_body_is_refused(server, calls, monkeypatch):
    monkeypatch.setattr("executive.view.serving.BODY_S", 0.3)
    with socket.create_connection(("127.0.0.1", server.port)) as client:
        head = f"POST /missions/patrol HTTP/1.1\r\nHost: x\r\nAuthorization: Bearer {TOKEN}\r\nContent-Length: 9"
        client.sendall(f"{head}\r\n\r\n{{".encode())
        client.settimeout(5.0)
        assert client.recv(64).startswith(b"HTTP/1.1 413")
    assert calls == []


def test_an_error_of_the_serving_thread_is_logged_once(server, caplog):
    error = OSError(errno.EMFILE, "Too many open files")
    for number in range(1000):
        context = {"message": "no connection" if number % 2 else f"error {number}", "exception": error}
        server.call_soon(lambda context=context: server._loop.call_exception_handler(context))
    assert ask(server)[0] == 202
    assert len(caplog.records) == serving.MOST_ERRORS
    assert [each.getMessage() for each in caplog.records].count(f"no connection: {error}") == 1
    assert not any(each.exc_info for each in caplog.records)


def test_a_client_that_reads_nothing_does_not_delay_the_end(server, strangers):
    strangers(3, b"POST /missions/patrol HTTP/1.1\r\nx: ")
    begun_s = time.monotonic()
    server.close()
    assert time.monotonic() - begun_s < 5.0


def test_a_closed_server_answers_no_call(server):
    server.close()
    server.close()
    with pytest.raises(OSError):
        ask(server)


@pytest.mark.parametrize("host", ["", "0", "0x0", "::0"])
def test_a_host_that_means_all_addresses_unsaid_is_refused(host):
    with pytest.raises(OSError, match=r"would open all addresses; write 0.0.0.0 for that"):
        open_port(host, 0)


def test_all_addresses_are_opened_when_they_are_named():
    with open_port("0.0.0.0", 0) as opened:
        assert opened.getsockname()[0] == "0.0.0.0"
