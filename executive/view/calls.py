"""HTTP server for calls: `POST /missions/NAME` with `Authorization: Bearer TOKEN` starts a mission.

The server checks the token before anything else, and stores nothing of a request but the values in its JSON body.
"""

from __future__ import annotations

import asyncio
import secrets
import socket
from collections.abc import Awaitable, Callable, Mapping
from http import HTTPStatus
from typing import Any, Protocol

from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.routing import Route

from executive.view.serving import MAX_BODY, ServingThread, body_of

__all__ = ["CallError", "CallServer", "Called"]


class CallError(Exception):
    """A call is refused, with a reason and an HTTP status."""

    def __init__(self, status: HTTPStatus, reason: str) -> None:
        super().__init__(reason)
        self.status = status


class Called(Protocol):
    """Carries out a call."""

    def __call__(self, name: str, body: bytes) -> Mapping[str, Any]:
        """Returns the answer's JSON object, in a thread of its own. Raises CallError."""


class CallServer:
    """A running server for calls. Use it as a context manager, or call `close`."""

    def __init__(self, called: Called, *, token: str, host: str, port: int) -> None:
        """Starts serving; `port` 0 takes a free one. Raises OSError if the address is taken, or not of this machine."""
        self._called, self._token = called, token
        family = socket.AF_INET6 if ":" in host else socket.AF_INET
        opened = socket.create_server((host, port), family=family)
        self.host, self.port = host, int(opened.getsockname()[1])
        app = Starlette(routes=[Route("/missions/{name}", self._guarded(self._call), methods=["POST"])])
        self._serving = ServingThread(app, opened)

    def __enter__(self) -> CallServer:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def url(self) -> str:
        """The address of calls, up to the name."""
        host = f"[{self.host}]" if ":" in self.host else self.host
        return f"http://{host}:{self.port}/missions/"

    def close(self) -> None:
        """Answers the open calls and stops serving; idempotent."""
        self._serving.end()
        self._serving.join()

    def _guarded(self, handler: Callable[[Request], Awaitable[Response]]) -> Callable[[Request], Awaitable[Response]]:
        async def endpoint(request: Request) -> Response:
            scheme, _, given = request.headers.get("authorization", "").partition(" ")
            right = secrets.compare_digest(given.strip().encode(), self._token.encode())
            if scheme.lower() != "bearer" or not right:
                said = {"error": "the token is missing or wrong: send 'Authorization: Bearer TOKEN'"}
                return JSONResponse(said, HTTPStatus.UNAUTHORIZED, {"WWW-Authenticate": "Bearer"})
            return await handler(request)

        return endpoint

    async def _call(self, request: Request) -> Response:
        body = await body_of(request)
        if body is None:
            said = {"error": f"the body is larger than {MAX_BODY} bytes"}
            return JSONResponse(said, HTTPStatus.REQUEST_ENTITY_TOO_LARGE, {"Connection": "close"})
        try:
            answer = await asyncio.to_thread(self._called, request.path_params["name"], body)
        except CallError as refusal:
            return JSONResponse({"error": str(refusal)}, refusal.status)
        return JSONResponse(dict(answer), HTTPStatus.ACCEPTED)
