"""HTTP server of the page on 127.0.0.1, in a thread of its own.

Each server draws a new token, which every request for data, actions or the websocket must contain. The server refuses
requests from another origin or for another host, so that no other web page can control the robot.
"""

from __future__ import annotations

import asyncio
import json
import math
import secrets
import socket
import time
from collections.abc import Awaitable, Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from http import HTTPStatus
from pathlib import Path
from typing import Any, Final

from starlette.requests import HTTPConnection, Request
from starlette.responses import FileResponse, JSONResponse, Response
from starlette.routing import BaseRoute, Mount, Route, WebSocketRoute
from starlette.staticfiles import StaticFiles
from starlette.websockets import WebSocket, WebSocketDisconnect

from executive.view.feed import Feed
from executive.view.html import PAGE_FOLDER
from executive.view.page_control import Action, RefusedError
from executive.view.serving import BODY_LIMITS, Server, body_of, trust
from skills.inputs.errors import InputError
from skills.inputs.outside import json_object

HOST: Final = "127.0.0.1"
_FILES: Final = frozenset({".html", ".mcap"})
"""Endings of the files of a run that the page links to, and that link to each other."""
TOKEN_HEADER: Final = "x-errand-token"
_GOING_AWAY: Final = 1001
_NOT_ALLOWED: Final = 4403


@dataclass(frozen=True)
class PageContent:
    """Content of the page: feed, actions for the buttons, the address or recording of the 3D scene, and the report."""

    feed: Feed
    actions: Mapping[str, Action] = field(default_factory=dict)
    scene_url: str | None = None
    recording: Path | None = None
    report: Path | None = None


class PageServer(Server):
    """Running server for the page."""

    def __init__(self, content: PageContent, *, port: int = 0) -> None:
        """Starts serving; `port` 0 takes any free port. Raises OSError if the port is taken."""
        self._content = content
        self._token = secrets.token_urlsafe(24)
        opened = socket.create_server((HOST, port))
        self.port: int = opened.getsockname()[1]
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
        """Address of the page with its token."""
        return f"http://{HOST}:{self.port}/?token={self._token}"

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
            Route("/picture/{number:int}", guarded(self._picture)),
            Route("/file/{token}/{name}", guarded(self._file)),
            Route("/action/{name}", guarded(self._act), methods=["POST"]),
            WebSocketRoute("/feed", self._send),
            Mount("/page", StaticFiles(directory=PAGE_FOLDER)),
        ]

    def _allowed(self, connection: HTTPConnection) -> bool:
        """Trusts a connection if host, origin and token are right; browsers always send an origin with an action."""
        here = {f"{HOST}:{self.port}", f"localhost:{self.port}"}
        headers = connection.headers
        origin = headers.get("origin")
        given = headers.get(TOKEN_HEADER) or connection.query_params.get("token")
        given = given or connection.path_params.get("token", "")
        own_origin = origin is None or origin in {f"http://{host}" for host in here}
        own_host = headers.get("host", "") in here
        allowed = own_host and own_origin and secrets.compare_digest(given.encode(), self._token.encode())
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
        response = FileResponse(PAGE_FOLDER / "index.html")
        response.headers["Content-Security-Policy"] = (
            f"default-src 'self'; img-src 'self' data: blob:; connect-src 'self' ws://{HOST}:{self.port} "
            f"ws://localhost:{self.port}; frame-src 'self' http://{HOST}:* http://localhost:*; "
            "frame-ancestors 'none'; base-uri 'none'; form-action 'none'"
        )
        return response

    async def _picture(self, request: Request) -> Response:
        try:
            form, data = self._content.feed.picture(request.path_params["number"])
        except LookupError as error:
            return JSONResponse({"error": str(error)}, HTTPStatus.NOT_FOUND)
        return Response(data, media_type=f"image/{form}")

    async def _file(self, request: Request) -> Response:
        """Sends the recording, the report, or a file beside them to which the report links."""
        name = request.path_params["name"]
        offered = (each for each in (self._content.recording, self._content.report) if each is not None)
        beside = (each.with_name(name) for each in offered if Path(name).suffix in _FILES)
        found = next((each for each in beside if each.is_file()), None)
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
            "scene": self._content.scene_url,
            "recording": recording.name if recording is not None and recording.is_file() else None,
        }


def _values(body: bytes | None) -> Mapping[str, Any]:
    """Reads the values for an action. Raises RefusedError unless the body is a JSON object."""
    if body is None:
        raise RefusedError(f"the action's values are too large or come too slowly: send {BODY_LIMITS}")
    try:
        return json_object(body, what="the action's values", hint="send an object")
    except InputError as error:
        raise RefusedError(str(error)) from error


def serve(content: PageContent, port: int) -> PageServer:
    """Starts a server for the content. Raises InputError if the port is taken."""
    try:
        return PageServer(content, port=port)
    except OSError as error:
        raise InputError(f"cannot serve at port {port} ({error.strerror})", hint="name another --port") from error


def wait(limit_s: float | None, refresh: Callable[[], None] = lambda: None) -> None:
    """Waits until Ctrl-C or the limit (s, wall time); calls `refresh` each second."""
    end_s = time.monotonic() + (math.inf if limit_s is None else limit_s)
    try:
        while (left_s := end_s - time.monotonic()) > 0.0:
            refresh()
            time.sleep(min(1.0, left_s))
    except KeyboardInterrupt:
        return
