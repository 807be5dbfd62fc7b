"""HTTP server of the page, in a thread of its own; on 127.0.0.1 unless the user names another address.

Each server draws a new token, which every request for data, actions, the scene or the websocket must contain. The
server refuses requests from another origin or for another host, so that no other web page can control the robot.
"""

from __future__ import annotations

import asyncio
import json
import math
import os
import re
import secrets
import socket
import time
from collections.abc import Awaitable, Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import partial
from html import unescape
from http import HTTPStatus
from ipaddress import ip_address
from pathlib import Path
from typing import Any, Final, Protocol
from urllib.parse import unquote

from starlette.requests import HTTPConnection, Request
from starlette.responses import FileResponse, JSONResponse, Response
from starlette.routing import BaseRoute, Mount, Route, WebSocketRoute
from starlette.staticfiles import StaticFiles
from starlette.websockets import WebSocket, WebSocketDisconnect

from executive.view.feed import Feed
from executive.view.html import PAGE_FOLDER
from executive.view.page_control import Action, RefusedError
from executive.view.serving import BODY_LIMITS, Server, body_of, open_port, trust, url_of
from skills.inputs.errors import InputError
from skills.inputs.outside import json_object

HOST: Final = "127.0.0.1"
_LINK: Final = re.compile(r'<a href="([^":/.][^":/]*)">')
"""Link of a report to a file beside it."""
TOKEN_HEADER: Final = "x-errand-token"
_GOING_AWAY: Final = 1001
_NOT_ALLOWED: Final = 4403


_FRAMES: Final = f"frame-ancestors {os.environ.get('ERRAND_VIEW_FRAMES', '')}"
"""Policy that lets only the origins that the environment names, separated by blanks, show the page in a frame."""
_SCENE: Final = f"sandbox allow-scripts; default-src 'unsafe-inline' data: blob:; {_FRAMES} http://"
"""Policy of the scene, without the host: it has an origin, and in Chromium a process, of its own, and no server."""
_TUNNEL: Final = "ssh -L {port}:127.0.0.1:{port} USER@HOST"
_OPEN: Final = f"\nThe link is all that protects the robot. The other way is --view-host {HOST} and a tunnel: {_TUNNEL}"
Address = tuple[str, int]
"""Host and port at which a page is served; port 0 takes any free port."""


class Scene(Protocol):
    """Live 3D scene of the world, for the page."""

    def page(self) -> bytes:
        """Builds the HTML page of the scene, compressed by gzip; callable from any thread. Raises RuntimeError."""

    def send(self, tell: Callable[[Mapping[str, Any]], None], wanted: Callable[[], bool]) -> None:
        """Sends the poses of the bodies by `tell` at each refresh, while they are `wanted`."""

    def publish(self) -> None:
        """Refreshes the scene now."""


@dataclass(frozen=True)
class PageContent:
    """Content of the page: feed, actions for the buttons, the 3D scene or its recording, and the report."""

    feed: Feed
    actions: Mapping[str, Action] = field(default_factory=dict)
    scene: Scene | None = None
    recording: Path | None = None
    report: Path | None = None


class PageServer(Server):
    """Running server for the page."""

    def __init__(self, content: PageContent, address: Address = (HOST, 0)) -> None:
        """Starts serving. Raises OSError if this machine has no such address, or the port is taken."""
        self._content = content
        self._token = secrets.token_urlsafe(24)
        opened = open_port(*address)
        self.host, self.port = (*opened.getsockname(),)[:2]
        names = "|".join(map(re.escape, filter(None, ("localhost", socket.gethostname(), address[0]))))
        self._own = re.compile(rf"({names}|[\d.]+|\[[\da-f:.]+\])(:\d+)?", re.ASCII | re.IGNORECASE)
        self._scene_page, self._building = b"", asyncio.Lock()
        if content.scene is not None:
            content.scene.send(partial(content.feed.tell, "scene"), lambda: bool(self._wakers))
        self._closing = False
        self._wakers: set[asyncio.Event] = set()
        super().__init__(self._routes(), opened)
        content.feed.listen(self._wake)

    def offer(self, recording: Path | None, report: Path | None) -> None:
        """Adds the recording of the scene, which follows the page's slider, and the report of the run."""
        self._content = replace(self._content, recording=recording, report=report)
        if recording is not None:
            self._content.feed.tell("recording", {"address": recording.name})

    @property
    def url(self) -> str:
        """Address of the page with its token, which other machines can use if the server listens for them."""
        host = _outer_host(self.host) if ip_address(self.host).is_unspecified else self.host
        return f"{url_of(host, self.port)}?token={self._token}"

    @property
    def lines(self) -> str:
        """Address of the page for the user and, if other machines can use it, what protects the robot."""
        return f"The page: {self.url}{'' if ip_address(self.host).is_loopback else _OPEN.format(port=self.port)}"

    def close(self) -> None:
        """Stops serving; idempotent."""
        self._closing = True
        self._wake()
        super().close()

    def _wake(self) -> None:
        """Wakes all websockets. Any thread may call it."""

        def wake_all() -> None:
            for waker in self._wakers:
                waker.set()

        self.call_soon(wake_all)

    def _routes(self) -> Sequence[BaseRoute]:
        guarded = self._guarded
        return [
            Route("/", guarded(self._page)),
            Route("/scene", guarded(self._scene)),
            Route("/picture/{number:int}", guarded(self._picture)),
            Route("/file/{token}/{name}", guarded(self._file)),
            Route("/action/{name}", guarded(self._act), methods=["POST"]),
            WebSocketRoute("/feed", self._send),
            Mount("/page", StaticFiles(directory=PAGE_FOLDER)),
        ]

    def _allowed(self, connection: HTTPConnection) -> bool:
        """Trusts a connection if host (an address or a name of this machine, any port), origin and token are right."""
        headers, here = connection.headers, connection.headers.get("host", "")
        given = headers.get(TOKEN_HEADER) or connection.query_params.get("token")
        given = given or connection.path_params.get("token", "")
        own = self._own.fullmatch(here) is not None and headers.get("origin") in (None, f"http://{here}")
        allowed = own and secrets.compare_digest(given.encode(), self._token.encode())
        if allowed:
            trust(connection)
        return allowed

    def _guarded(self, handler: Callable[[Request], Awaitable[Response]]) -> Callable[[Request], Awaitable[Response]]:
        async def endpoint(request: Request) -> Response:
            if not self._allowed(request):
                said = "Open the page by the address that errand has printed: its token is missing or old."
                return JSONResponse({"error": said}, HTTPStatus.FORBIDDEN)
            response = await handler(request)
            response.headers.update({"Referrer-Policy": "no-referrer", "Cache-Control": "no-store"})
            return response

        return endpoint

    async def _page(self, request: Request) -> Response:
        policy = (
            f"default-src 'self'; img-src 'self' data: blob:; connect-src 'self' ws://{request.headers['host']}; "
            f"frame-src 'self'; {_FRAMES}; base-uri 'none'; form-action 'none'"
        )
        return FileResponse(PAGE_FOLDER / "index.html", headers={"Content-Security-Policy": policy})

    async def _scene(self, request: Request) -> Response:
        """Sends the page of the scene, which is built for the first browser that asks for it."""
        if (scene := self._content.scene) is None:
            return JSONResponse({"error": "there is no scene here"}, HTTPStatus.NOT_FOUND)
        async with self._building:
            self._scene_page = self._scene_page or await asyncio.to_thread(scene.page)
        headers = {"Content-Encoding": "gzip", "Content-Security-Policy": f"{_SCENE}{request.headers['host']}"}
        return Response(self._scene_page, media_type="text/html", headers=headers)

    async def _picture(self, request: Request) -> Response:
        try:
            form, data = self._content.feed.picture(request.path_params["number"])
        except LookupError as error:
            return JSONResponse({"error": str(error)}, HTTPStatus.NOT_FOUND)
        return Response(data, media_type=f"image/{form}")

    async def _file(self, request: Request) -> Response:
        """Sends the recording, the report, or a file beside them to which the report links."""
        name, report = request.path_params["name"], self._content.report
        files = (each for each in (self._content.recording, report, *_linked_files(report)) if each is not None)
        found = next((each for each in files if each.name == name and each.is_file()), None)
        if found is None:
            return JSONResponse({"error": f"there is no file '{name}' here"}, HTTPStatus.NOT_FOUND)
        return FileResponse(found)

    async def _act(self, request: Request) -> Response:
        name = request.path_params["name"]
        action = self._content.actions.get(name)
        if action is None:
            return JSONResponse({"error": f"there is no action '{name}' here"}, HTTPStatus.NOT_FOUND)
        try:
            values = _values(await body_of(request))
            said = await asyncio.to_thread(action, values)
        except RefusedError as refusal:
            return JSONResponse({"error": str(refusal)}, HTTPStatus.CONFLICT)
        return JSONResponse({"said": said})

    async def _send(self, websocket: WebSocket) -> None:
        """Sends all messages, and then each new message."""
        if not self._allowed(websocket):
            await websocket.close(_NOT_ALLOWED)
            return
        await websocket.accept()
        waker = asyncio.Event()
        self._wakers.add(waker)
        self._content.feed.add_reader()
        try:
            await websocket.send_text(json.dumps([{"live": "hello", "data": self._hello()}]))
            await self._stream(websocket, waker)
        except (WebSocketDisconnect, RuntimeError, OSError):
            pass  # the page has disconnected
        finally:
            self._wakers.discard(waker)
            self._content.feed.remove_reader()

    async def _stream(self, websocket: WebSocket, waker: asyncio.Event) -> None:
        feed = self._content.feed
        cursor = (0, 0)
        while not self._closing:
            waker.clear()
            cursor, texts = feed.since(cursor)
            if texts:
                await websocket.send_text(f"[{','.join(texts)}]")
                feed.mark_sent(cursor)
            else:
                await waker.wait()
        await websocket.close(_GOING_AWAY)

    def _hello(self) -> dict[str, Any]:
        recording = self._content.recording
        return {
            "actions": sorted(self._content.actions),
            "scene": self._content.scene is not None,
            "recording": recording.name if recording is not None and recording.is_file() else None,
        }


def _linked_files(report: Path | None) -> Sequence[Path]:
    """Returns the files beside a report to which it links."""
    if report is None or not report.is_file():
        return ()
    return [report.with_name(unquote(unescape(name))) for name in _LINK.findall(report.read_text(encoding="utf-8"))]


def _values(body: bytes | None) -> Mapping[str, Any]:
    """Reads the values for an action. Raises RefusedError unless the body is a JSON object."""
    if body is None:
        raise RefusedError(f"the action's values are too large or come too slowly: send {BODY_LIMITS}")
    try:
        return json_object(body, what="the action's values", hint="send an object")
    except InputError as error:
        raise RefusedError(str(error)) from error


def serve(content: PageContent, address: Address) -> PageServer:
    """Starts a server for the content. Raises InputError if this machine has no such address, or the port is taken."""
    try:
        return PageServer(content, address)
    except OSError as error:
        what = f"cannot serve the page at {address[0][:60]} port {address[1]} ({error.strerror})"
        raise InputError(what, hint="name another --view-host or --view-port") from error


def _outer_host(every: str) -> str:
    """Address of this machine for other machines, given the address for all of them; its name if it has no route."""
    family, far = (socket.AF_INET6, "2001:db8::1") if ":" in every else (socket.AF_INET, "192.0.2.1")
    with suppress(OSError), socket.socket(family, socket.SOCK_DGRAM) as probe:
        probe.connect((far, 9))  # sends nothing
        return str(probe.getsockname()[0])
    return socket.gethostname()


def wait(limit_s: float | None) -> None:
    """Waits until Ctrl-C or the limit (s, wall time)."""
    end_s = time.monotonic() + (math.inf if limit_s is None else limit_s)
    try:
        while (left_s := end_s - time.monotonic()) > 0.0:
            time.sleep(min(1.0, left_s))
    except KeyboardInterrupt:
        return
