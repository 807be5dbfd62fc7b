"""Requests with and without the token, of other hosts and origins."""

from pathlib import Path

import pytest
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import PlainTextResponse
from starlette.routing import Route, WebSocketRoute
from starlette.testclient import TestClient
from starlette.websockets import WebSocket, WebSocketDisconnect

from errand_studio.guard import MOST_BODY, Guard

OWN = "http://127.0.0.1:8000"
TOKEN = "a-token"


async def _page(request: Request) -> PlainTextResponse:
    return PlainTextResponse("the page")


async def _socket(websocket: WebSocket) -> None:
    await websocket.accept()
    await websocket.send_text("hello")
    await websocket.close()


@pytest.fixture
def client() -> TestClient:
    site = Starlette(routes=[Route("/", _page, methods=["GET", "POST"]), WebSocketRoute("/ws", _socket)])
    return TestClient(Guard(site, TOKEN), base_url=OWN)


def test_the_link_gives_a_cookie_that_opens_the_page(client: TestClient) -> None:
    first = client.get("/", params={"token": TOKEN}, follow_redirects=False)
    assert first.status_code == 307
    assert "HttpOnly" in first.headers["set-cookie"]
    assert "SameSite=strict" in first.headers["set-cookie"]
    page = client.get("/")
    assert page.text == "the page"
    assert "frame-ancestors 'none'" in page.headers["content-security-policy"]
    own = {"origin": OWN, "host": "127.0.0.1:8000", "cookie": f"errand_studio_8000={TOKEN}"}
    with client.websocket_connect("/ws", headers=own) as websocket:
        assert websocket.receive_text() == "hello"


@pytest.mark.parametrize(
    ("headers", "query"),
    [
        ({}, {}),
        ({}, {"token": "other"}),
        ({"cookie": "errand_studio_8000=other"}, {}),
        ({"cookie": f"errand_studio_8000={TOKEN}", "origin": "http://evil.example"}, {}),
        ({"cookie": f"errand_studio_8000={TOKEN}", "origin": "http://127.0.0.1:9000"}, {}),
        ({"cookie": f"errand_studio_8000={TOKEN}", "origin": "null"}, {}),
        ({"cookie": f"errand_studio_8000={TOKEN}", "host": "evil.example"}, {}),
        ({"host": "evil.example:8000"}, {"token": TOKEN}),
        ({"cookie": f"errand_studio_9000={TOKEN}"}, {}),
    ],
)
def test_a_hostile_request_is_refused(client: TestClient, headers: dict[str, str], query: dict[str, str]) -> None:
    assert client.get("/", headers=headers, params=query, follow_redirects=False).status_code == 403
    whole = {"host": "127.0.0.1:8000", **headers}
    with pytest.raises(WebSocketDisconnect), client.websocket_connect("/ws", headers=whole) as websocket:
        websocket.receive_text()


def test_a_body_that_is_too_large_is_refused(client: TestClient, tmp_path: Path) -> None:
    client.get("/", params={"token": TOKEN})
    assert client.post("/", content=b"x" * (MOST_BODY + 1), headers={"origin": OWN}).status_code == 413
