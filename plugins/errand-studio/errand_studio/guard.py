"""Guard of the studio's server: only browsers that have the token, on pages of the studio itself, reach it."""

from __future__ import annotations

import re
import secrets
from http import HTTPStatus
from typing import Final

from starlette.requests import HTTPConnection
from starlette.responses import PlainTextResponse, RedirectResponse
from starlette.types import ASGIApp, Receive, Scope, Send

COOKIE: Final = "errand_studio"
_HOST: Final = re.compile(r"(127\.0\.0\.1|localhost)(:\d+)?", re.ASCII | re.IGNORECASE)
MOST_BODY: Final = 2_000_000
_MISSING: Final = "Open the page by the address that errand has printed: its token is missing or old."
_POLICY: Final = (
    "default-src 'self'; script-src 'self' 'unsafe-inline' 'unsafe-eval'; style-src 'self' 'unsafe-inline'; "
    "img-src 'self' data: blob:; font-src 'self' data:; connect-src 'self' ws://{host}; "
    "frame-src 'self' http://127.0.0.1:* http://localhost:*; frame-ancestors 'none'; base-uri 'none'; "
    "form-action 'none'; object-src 'none'"
)


class Guard:
    """ASGI application that lets requests with the token through to another one.

    The first request has the token in its address; its answer moves the token to a cookie. A request with another host
    than this machine's loopback, or from another origin, is refused, and so is a body of unknown length or
    of over `MOST_BODY` bytes.
    """

    def __init__(self, app: ASGIApp, token: str) -> None:
        self._app, self._token = app, token

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Handles a request or a websocket."""
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        connection = HTTPConnection(scope)
        if not self._is_own(connection):
            await self._refuse(scope, receive, send, HTTPStatus.FORBIDDEN, _MISSING)
        elif (
            "transfer-encoding" in connection.headers or int(connection.headers.get("content-length") or 0) > MOST_BODY
        ):
            await self._refuse(scope, receive, send, HTTPStatus.REQUEST_ENTITY_TOO_LARGE, "The body is too large.")
        elif self._has(connection.query_params.get("token")) and scope["type"] == "http":
            answer = RedirectResponse(scope["path"])
            answer.set_cookie(self._cookie(connection), self._token, httponly=True, samesite="strict")
            answer.headers["Referrer-Policy"] = "no-referrer"
            await answer(scope, receive, send)
        elif self._has(connection.cookies.get(self._cookie(connection))):
            await self._app(scope, receive, self._hardened(send, connection.headers["host"]))
        else:
            await self._refuse(scope, receive, send, HTTPStatus.FORBIDDEN, _MISSING)

    def _cookie(self, connection: HTTPConnection) -> str:
        """Name of the cookie. Browsers share cookies between ports of a host, and several studios may run."""
        return f"{COOKIE}_{connection.headers.get('host', '').rpartition(':')[2]}"

    def _is_own(self, connection: HTTPConnection) -> bool:
        host, origin = connection.headers.get("host", ""), connection.headers.get("origin")
        return _HOST.fullmatch(host) is not None and origin in (None, f"http://{host}")

    def _has(self, token: str | None) -> bool:
        return token is not None and secrets.compare_digest(token.encode(), self._token.encode())

    @staticmethod
    def _hardened(send: Send, host: str) -> Send:
        """Adds the policy of the page to the headers of an answer."""
        headers = {"content-security-policy": _POLICY.format(host=host), "referrer-policy": "no-referrer"}
        added = [(name.encode(), value.encode()) for name, value in headers.items()]

        async def sent(message: dict[str, object]) -> None:
            if message["type"] == "http.response.start":
                message = {**message, "headers": [*message.get("headers", ()), *added]}  # type: ignore[misc]
            await send(message)

        return sent  # type: ignore[return-value]

    @staticmethod
    async def _refuse(scope: Scope, receive: Receive, send: Send, status: HTTPStatus, said: str) -> None:
        if scope["type"] == "websocket":
            await receive()
            await send({"type": "websocket.close", "code": 4403})
            return
        await PlainTextResponse(said, status)(scope, receive, send)
