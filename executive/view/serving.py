"""Serves a web application from a thread of its own."""

from __future__ import annotations

import asyncio
import socket
import threading
from collections.abc import Callable
from typing import Any, Final

import uvicorn
from starlette.applications import Starlette
from starlette.requests import ClientDisconnect, Request

START_LIMIT_S: Final = 10.0
MAX_BODY: Final = 20_000


class ServingThread:
    """A thread that serves an application until `end`."""

    def __init__(self, app: Starlette, opened: socket.socket, **settings: Any) -> None:
        """Starts serving on an open socket; `settings` are uvicorn's."""
        self._loop: asyncio.AbstractEventLoop | None = None
        self._ready = threading.Event()
        config = uvicorn.Config(app, log_level="error", access_log=False, lifespan="off", **settings)
        self._socket, self._server = opened, uvicorn.Server(config)
        self._thread = threading.Thread(target=self._serve, name="errand-server", daemon=True)
        self._thread.start()
        self._ready.wait(START_LIMIT_S)

    def call_soon(self, callback: Callable[[], None]) -> None:
        """Calls `callback` in the serving thread; from any thread. Does nothing after the end."""
        if self._loop is not None and not self._loop.is_closed():
            self._loop.call_soon_threadsafe(callback)

    def end(self) -> None:
        """Ends the thread once it has answered the open requests."""
        self._server.should_exit = True

    def join(self) -> None:
        """Waits until the thread has ended."""
        self._thread.join(START_LIMIT_S)

    def _serve(self) -> None:
        asyncio.run(self._serve_in_loop())

    async def _serve_in_loop(self) -> None:
        self._loop = asyncio.get_running_loop()
        self._ready.set()
        await self._server.serve(sockets=[self._socket])


async def body_of(request: Request) -> bytes | None:
    """Body of a request; None if it is larger than MAX_BODY (the rest is not read), or the client disconnects."""
    body = b""
    try:
        async for part in request.stream():
            body += part
            if len(body) > MAX_BODY:
                return None
    except ClientDisconnect:
        return None
    return body
