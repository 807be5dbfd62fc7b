"""HTTP servers in separate threads, and the server for calls that start missions."""

from __future__ import annotations

import asyncio
import errno
import json
import logging
import secrets
import socket
import threading
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from http import HTTPStatus
from typing import Any, Final, Self

import uvicorn
from starlette.applications import Starlette
from starlette.exceptions import HTTPException
from starlette.requests import ClientDisconnect, HTTPConnection, Request
from starlette.responses import JSONResponse, Response
from starlette.routing import BaseRoute, Route
from uvicorn.protocols.http.h11_impl import H11Protocol

START_LIMIT_S: Final = 10.0
MAX_BODY: Final = 20_000
MOST_CONNECTIONS: Final = 256
BACKLOG: Final = 64
"""Connections that wait to be accepted; so many more than `MOST_CONNECTIONS` may be open for a moment."""
STRANGER_S: Final = 10.0
BODY_S: Final = 10.0
CLOSE_S: Final = 2.0
MOST_ERRORS: Final = 20
_ALL: Final = ("0.0.0.0", "::")
"""Hosts that mean all addresses of this machine."""
_LOG: Final = logging.getLogger("uvicorn.error")


class _Connection(H11Protocol):
    """Connection to a server with a bounded number of connections, and with time limits for strangers.

    A stranger is a connection that has sent no allowed request. It is closed after `STRANGER_S`, or when there are too
    many connections and it is the oldest stranger. `every` has all connections, with the timers of strangers.
    """

    def __init__(self, every: dict[_Connection, asyncio.TimerHandle | None], **settings: Any) -> None:
        super().__init__(**settings | {"app_state": {"connection": self}})
        self._every = every

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        super().connection_made(transport)
        self._every[self] = self.loop.call_later(STRANGER_S, transport.abort)
        if len(self._every) > MOST_CONNECTIONS:
            self._forget_closed()
        if len(self._every) > MOST_CONNECTIONS:
            next(each for each, timer in self._every.items() if timer is not None).transport.abort()
            self._forget_closed()

    def trust(self) -> None:
        if (timer := self._every.get(self)) is not None:
            timer.cancel()
            self._every[self] = None

    def send_400_response(self, msg: str) -> None:
        body = json.dumps({"error": msg}).encode()
        head = f"HTTP/1.1 400 Bad Request\r\ncontent-type: application/json\r\ncontent-length: {len(body)}\r\n"
        self.transport.write(f"{head}connection: close\r\n\r\n".encode() + body)
        self.transport.close()

    def _forget_closed(self) -> None:
        for each in [each for each in self._every if each.transport.is_closing()]:
            if (timer := self._every.pop(each)) is not None:
                timer.cancel()


def trust(connection: HTTPConnection) -> None:
    """Keeps the connection of an allowed request open as long as its client wants."""
    connection.scope["state"]["connection"].trust()


def open_port(host: str, port: int) -> socket.socket:
    """Opens a port of an address of this machine.

    Raises OSError if there is no such address, the port is taken, or a host such as "" means all addresses unsaid.
    """
    try:
        opened = socket.create_server((host, port), family=socket.AF_INET6 if ":" in host else socket.AF_INET)
    except (OSError, TypeError, ValueError) as error:
        why = getattr(error, "strerror", None) or "no host has this name"
        raise OSError(getattr(error, "errno", None), why.partition(" (while")[0]) from error
    if opened.getsockname()[0] in _ALL and host not in _ALL:
        opened.close()
        raise OSError(errno.EADDRNOTAVAIL, f"'{host}' would open all addresses; write {_ALL[0]} for that")
    return opened


def url_of(host: str, port: int) -> str:
    """Returns the start of the URLs at an address."""
    return f"http://[{host}]:{port}/" if ":" in host else f"http://{host}:{port}/"


async def _say_error(request: Request, error: Exception) -> Response:
    """Answers a request that no handler took, or whose handler failed, with a JSON object like all refusals."""
    status, headers = HTTPStatus(getattr(error, "status_code", 500)), dict(getattr(error, "headers", None) or {})
    allowed = f"; use {headers['Allow']}" if "Allow" in headers else ""
    said = f"{request.method} {request.url.path}: {status.phrase.lower()}{allowed}"
    return JSONResponse({"error": error.detail if isinstance(error, CallError) else said}, status, headers)


class Server:
    """Running server of routes in a thread of its own. Use it as a context manager, or call `close`.

    The number of connections is bounded; a handler must `trust` a connection that is to stay.
    """

    def __init__(self, routes: Sequence[BaseRoute], opened: socket.socket, **settings: Any) -> None:
        """Starts serving on an open socket; `settings` are settings of uvicorn."""
        self._loop: asyncio.AbstractEventLoop | None = None
        self._ready = threading.Event()
        app = Starlette(routes=routes, exception_handlers={HTTPException: _say_error, Exception: _say_error})
        self._connections: dict[_Connection, asyncio.TimerHandle | None] = {}
        self._errors: set[str] = set()
        protocol: Any = partial(_Connection, self._connections)
        limits = {"http": protocol, "backlog": BACKLOG, "ws_max_size": MAX_BODY, "ws": "websockets-sansio"}
        config = uvicorn.Config(app, log_level="error", access_log=False, lifespan="off", **limits, **settings)
        self._socket, self._server = opened, uvicorn.Server(config)
        serve = self._serve_in_loop
        self._thread = threading.Thread(target=lambda: asyncio.run(serve()), name="errand-server", daemon=True)
        self._thread.start()
        self._ready.wait(START_LIMIT_S)

    def call_soon(self, callback: Callable[[], object]) -> None:
        """Schedules `callback` in the serving thread. Any thread may call it; after the end it does nothing."""
        if self._loop is not None and not self._loop.is_closed():
            self._loop.call_soon_threadsafe(callback)

    def close(self) -> None:
        """Answers the open requests and stops serving; cuts off clients that take longer; idempotent."""
        self._server.should_exit = True
        self.call_soon(lambda: asyncio.get_running_loop().call_later(CLOSE_S, self._cut_off))
        self._thread.join(START_LIMIT_S)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _cut_off(self) -> None:
        for each in self._connections:
            each.transport.abort()

    def _log_error(self, _: asyncio.AbstractEventLoop, context: Mapping[str, Any]) -> None:
        """Logs an error of the serving thread once, such as too many open files."""
        said, error = f"{context['message']}: {context.get('exception')}", context.get("exception")
        if said not in self._errors and len(self._errors) < MOST_ERRORS:
            self._errors.add(said)
            _LOG.error(said, exc_info=None if isinstance(error, OSError) else error)

    async def _serve_in_loop(self) -> None:
        self._loop = asyncio.get_running_loop()
        self._loop.set_exception_handler(self._log_error)
        self._ready.set()
        await self._server.serve(sockets=[self._socket])


BODY_LIMITS: Final = f"at most {MAX_BODY} bytes within {BODY_S:g} s"


async def body_of(request: Request) -> bytes | None:
    """Reads the body of a request; returns None if it exceeds `BODY_LIMITS`, or the client disconnects."""
    body = b""
    try:
        async with asyncio.timeout(BODY_S):
            async for part in request.stream():
                body += part
                if len(body) > MAX_BODY:
                    return None
    except (ClientDisconnect, TimeoutError):
        return None
    return body


class CallError(HTTPException):
    """Raised to refuse a call, with an HTTP status and a reason."""


CallHandler = Callable[[str, bytes], Mapping[str, Any]]
"""Handles the call of a name with its body, in a thread of its own; returns a JSON object. Raises CallError."""


class CallServer(Server):
    """Running server of calls: `POST /missions/NAME` with `Authorization: Bearer TOKEN` starts a mission.

    The server checks the token first; from a request, only the values in the JSON body are stored.
    """

    def __init__(self, handler: CallHandler, *, token: str, host: str, port: int) -> None:
        """Starts serving; `port` 0 takes any free port. Raises OSError if this machine cannot use the address."""
        self._handler, self._token = handler, token
        opened = open_port(host, port)
        self.host, self.port = host, int(opened.getsockname()[1])
        super().__init__([Route("/missions/{name}", self._call, methods=["POST"])], opened)

    @property
    def url(self) -> str:
        """Address for calls, without the name of the mission at the end."""
        return f"{url_of(self.host, self.port)}missions/"

    async def _call(self, request: Request) -> Response:
        scheme, _, given = request.headers.get("authorization", "").partition(" ")
        right = secrets.compare_digest(given.strip().encode(), self._token.encode())
        if scheme.lower() != "bearer" or not right:
            said = "the token is missing or wrong: send 'Authorization: Bearer TOKEN'"
            raise CallError(HTTPStatus.UNAUTHORIZED, said, {"WWW-Authenticate": "Bearer"})
        trust(request)
        if request.url.query:
            said = "values belong into the body, as JSON: leave out all from '?' on, and send them there"
            raise CallError(HTTPStatus.BAD_REQUEST, said, {"Connection": "close"})
        body = await body_of(request)
        if body is None:
            said = f"the body is too large or comes too slowly: send {BODY_LIMITS}"
            raise CallError(HTTPStatus.REQUEST_ENTITY_TOO_LARGE, said, {"Connection": "close"})
        answer = await asyncio.to_thread(self._handler, request.path_params["name"], body)
        return JSONResponse(dict(answer), HTTPStatus.ACCEPTED)
