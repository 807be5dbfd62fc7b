"""HTTP servers in separate threads, and the server for calls that start missions."""

from __future__ import annotations

import asyncio
import secrets
import socket
import threading
from collections.abc import Callable, Mapping, Sequence
from http import HTTPStatus
from typing import Any, Final, Self

import uvicorn
from starlette.applications import Starlette
from starlette.requests import ClientDisconnect, Request
from starlette.responses import JSONResponse, Response
from starlette.routing import BaseRoute, Route

START_LIMIT_S: Final = 10.0
MAX_BODY: Final = 20_000


class Server:
    """Running server of routes in a thread of its own. Use it as a context manager, or call `close`."""

    def __init__(self, routes: Sequence[BaseRoute], opened: socket.socket, **settings: Any) -> None:
        """Starts serving on an open socket; `settings` are settings of uvicorn."""
        self._loop: asyncio.AbstractEventLoop | None = None
        self._ready = threading.Event()
        app = Starlette(routes=routes)
        config = uvicorn.Config(app, log_level="error", access_log=False, lifespan="off", **settings)
        self._socket, self._server = opened, uvicorn.Server(config)
        serve = self._serve_in_loop
        self._thread = threading.Thread(target=lambda: asyncio.run(serve()), name="errand-server", daemon=True)
        self._thread.start()
        self._ready.wait(START_LIMIT_S)

    def call_soon(self, callback: Callable[[], None]) -> None:
        """Schedules `callback` in the serving thread. Any thread may call it; after the end it does nothing."""
        if self._loop is not None and not self._loop.is_closed():
            self._loop.call_soon_threadsafe(callback)

    def close(self) -> None:
        """Answers the open requests and stops serving; idempotent."""
        self._server.should_exit = True
        self._thread.join(START_LIMIT_S)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    async def _serve_in_loop(self) -> None:
        self._loop = asyncio.get_running_loop()
        self._ready.set()
        await self._server.serve(sockets=[self._socket])


async def body_of(request: Request) -> bytes | None:
    """Reads the body of a request; returns None if the body is larger than MAX_BODY, or the client disconnects."""
    body = b""
    try:
        async for part in request.stream():
            body += part
            if len(body) > MAX_BODY:
                return None
    except ClientDisconnect:
        return None
    return body


class CallError(Exception):
    """Raised to refuse a call, with a reason and an HTTP status."""

    def __init__(self, status: HTTPStatus, reason: str) -> None:
        super().__init__(reason)
        self.status = status


CallHandler = Callable[[str, bytes], Mapping[str, Any]]
"""Handles the call of a name with its body, in a thread of its own; returns a JSON object. Raises CallError."""


class CallServer(Server):
    """Running server of calls: `POST /missions/NAME` with `Authorization: Bearer TOKEN` starts a mission.

    The server checks the token first; from a request, only the values in the JSON body are stored.
    """

    def __init__(self, handler: CallHandler, *, token: str, host: str, port: int) -> None:
        """Starts serving; `port` 0 takes any free port. Raises OSError if this machine cannot use the address."""
        self._handler, self._token = handler, token
        family = socket.AF_INET6 if ":" in host else socket.AF_INET
        opened = socket.create_server((host, port), family=family)
        self.host, self.port = host, int(opened.getsockname()[1])
        super().__init__([Route("/missions/{name}", self._call, methods=["POST"])], opened)

    @property
    def url(self) -> str:
        """Address for calls, without the name of the mission at the end."""
        host = f"[{self.host}]" if ":" in self.host else self.host
        return f"http://{host}:{self.port}/missions/"

    async def _call(self, request: Request) -> Response:
        scheme, _, given = request.headers.get("authorization", "").partition(" ")
        right = secrets.compare_digest(given.strip().encode(), self._token.encode())
        if scheme.lower() != "bearer" or not right:
            said = {"error": "the token is missing or wrong: send 'Authorization: Bearer TOKEN'"}
            return JSONResponse(said, HTTPStatus.UNAUTHORIZED, {"WWW-Authenticate": "Bearer"})
        body = await body_of(request)
        if body is None:
            said = {"error": f"the body is larger than {MAX_BODY} bytes"}
            return JSONResponse(said, HTTPStatus.REQUEST_ENTITY_TOO_LARGE, {"Connection": "close"})
        try:
            answer = await asyncio.to_thread(self._handler, request.path_params["name"], body)
        except CallError as refusal:
            return JSONResponse({"error": str(refusal)}, refusal.status)
        return JSONResponse(dict(answer), HTTPStatus.ACCEPTED)
