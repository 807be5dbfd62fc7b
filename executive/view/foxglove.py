"""Sends logged messages live over Foxglove's WebSocket (`--foxglove`): its protocol, version 1, in JSON.

A server sends its name and its channels, and then, for each subscription, frames of bytes: an operation, numbers in
little-endian order, and the message as it is logged.
"""

from __future__ import annotations

import asyncio
import itertools
import json
import re
import struct
import threading
import time
from collections import deque
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from ipaddress import ip_address
from operator import itemgetter
from typing import TYPE_CHECKING, Any, Final
from urllib.parse import urlsplit

from executive.record.event_log import EventLog, LoggedMessage
from executive.words.schemas import LIBRARY
from skills.inputs.errors import InputError
from skills.inputs.outside import json_object

if TYPE_CHECKING:
    from starlette.websockets import WebSocket

PROTOCOLS: Final = ("foxglove.sdk.v1", "foxglove.websocket.v1")
ORIGINS: Final = ("https://app.foxglove.dev", "file://")
"""Origins of Foxglove in a browser and of its program; those of other pages are refused."""
MOST_WAITING: Final = 1024
"""Messages that wait for a slow client; older ones are dropped."""
MOST_BYTES: Final = 64_000_000
"""Bytes that wait for all clients together; each has the same share, or one message."""
USUAL_ADDRESS: Final = "127.0.0.1:8765"
_ADDRESS: Final = re.compile(r"(?P<host>[\w.%-]+|\[[\w.:%-]+\]):(?P<port>\d{1,5})")
_TIME_EVERY_S: Final = 0.1
_MOST_PORT: Final = 65535
_MESSAGE, _TIME = 1, 2
_SESSIONS: Final = itertools.count(time.time_ns() // 1_000_000)


@dataclass
class _Client:
    """Client of the server: its subscriptions by channel, and what is to be sent to it, control first."""

    subscriptions: dict[int, int] = field(default_factory=dict)
    control: deque[str] = field(default_factory=deque)
    data: deque[bytes] = field(default_factory=deque)
    waiting_bytes: int = 0
    waker: asyncio.Event = field(default_factory=asyncio.Event)

    def add(self, frame: bytes, most_bytes: int) -> None:
        """Adds a frame; drops the oldest ones above `MOST_WAITING` or `most_bytes`."""
        self.data.append(frame)
        self.waiting_bytes += len(frame)
        while len(self.data) > 1 and (len(self.data) > MOST_WAITING or self.waiting_bytes > most_bytes):
            self.take()

    def take(self) -> bytes:
        """Removes and returns the oldest frame."""
        frame = self.data.popleft()
        self.waiting_bytes -= len(frame)
        return frame

    def add_message(self, channel: int, stamp_ns: int, message: bytes, most_bytes: int) -> None:
        """Adds a message if the client subscribes to its channel."""
        if (subscription := self.subscriptions.get(channel)) is not None:
            self.add(struct.pack("<BIQ", _MESSAGE, subscription, stamp_ns) + message, most_bytes)


class LiveServer:
    """Server for the channels in event logs, one log after another; `close` it at the end.

    A client that subscribes late first gets the newest message of each robot and node. A slow client misses messages,
    because no run waits for a client. Pages of other origins and requests for other hosts are refused.
    """

    def __init__(self, address: str) -> None:
        """Starts serving at HOST:PORT; port 0 takes any free port. Raises InputError if the address cannot be used."""
        found = _ADDRESS.fullmatch(address)
        if found is None or int(found["port"]) > _MOST_PORT:
            hint = "write HOST:PORT, as in 127.0.0.1:8765"
            raise InputError(f"--foxglove '{address[:60]}' is no address with a port", hint=hint)
        from starlette.routing import WebSocketRoute

        from executive.view.serving import Server, open_port

        self._lock, self._time_s = threading.Lock(), 0.0
        self._channels: dict[tuple[str, str], dict[str, Any]] = {}
        self._newest: dict[int, dict[tuple[str, str], tuple[bytes, int]]] = {}
        self._clients: list[_Client] = []
        self._session = _session()
        self._host = found["host"].strip("[]")
        try:
            opened = open_port(self._host, int(found["port"]))
        except OSError as error:
            hint = "name another, or end the program that uses it"
            raise InputError(f"cannot serve Foxglove at {address} ({error.strerror})", hint=hint) from error
        self.url = f"ws://{found['host']}:{opened.getsockname()[1]}"
        self._server = Server([WebSocketRoute("/", self._serve)], opened, ws_per_message_deflate=False)

    def follow(self, log: EventLog) -> None:
        """Sends the messages of a log from now on, and forgets the messages of the previous log."""
        with self._lock:
            self._newest.clear()
            self._session = _session()
            self._tell_all(self._session)
        self._time_s = 0.0
        log.listen(self._send)

    def close(self) -> None:
        """Stops serving; cuts off clients that do not read."""
        self._server.close()

    def _send(self, message: LoggedMessage) -> None:
        key, stamp_ns = (message.channel, message.schema.name), round(message.stamp_s * 1e9)
        about = (str(message.values.get("robot", "")), str(message.values.get("node", "")))
        is_due = message.stamp_s - self._time_s >= _TIME_EVERY_S
        self._time_s = message.stamp_s if is_due else self._time_s
        with self._lock:
            if (channel := self._channels.get(key)) is None:
                channel = self._channels[key] = _channel(len(self._channels) + 1, message)
                self._tell_all(_advertise([channel]))
            self._newest.setdefault(channel["id"], {})[about] = message.data, stamp_ns
            for client in self._clients:
                if is_due:
                    client.add(struct.pack("<BQ", _TIME, stamp_ns), self._share)
                client.add_message(channel["id"], stamp_ns, message.data, self._share)
        self._wake()

    @property
    def _share(self) -> int:
        """Bytes that may wait for one client."""
        return MOST_BYTES // max(len(self._clients), 1)

    def _tell_all(self, text: str) -> None:
        for client in self._clients:
            client.control.append(text)
        self._wake()

    def _wake(self) -> None:
        """Wakes the tasks of all clients. Any thread may call it."""
        for client in self._clients:
            self._server.call_soon(client.waker.set)

    def _allowed(self, headers: Mapping[str, str]) -> bool:
        """Returns whether origin and host are right: an address, or a name that another server cannot resolve."""
        host = headers.get("host", "")
        try:
            name = urlsplit(f"//{host}").hostname or ""
            own_host = name in {self._host, "localhost"} or bool(ip_address(name))
        except ValueError:
            return False
        return own_host and headers.get("origin") in (None, f"http://{host}", *ORIGINS)

    async def _serve(self, websocket: WebSocket) -> None:
        """Sends to one client, until it goes away."""
        from starlette.websockets import WebSocketDisconnect

        from executive.view.serving import trust

        if not self._allowed(websocket.headers):
            await websocket.close()
            return
        trust(websocket)
        offered, client = websocket.scope["subprotocols"], _Client()
        await websocket.accept(next((each for each in PROTOCOLS if each in offered), None))
        with self._lock:
            client.control.extend((self._session, _advertise(self._channels.values())))
            self._clients.append(client)
        reading = asyncio.create_task(self._read(websocket, client))
        reading.add_done_callback(lambda _: client.waker.set())
        try:
            while not reading.done():
                client.waker.clear()
                while client.control or client.data:
                    if client.control:
                        await websocket.send_text(client.control.popleft())
                    else:
                        with self._lock:
                            frame = client.take()
                        await websocket.send_bytes(frame)
                await client.waker.wait()
        except (WebSocketDisconnect, RuntimeError, OSError):
            pass  # the client has disconnected
        finally:
            reading.cancel()
            with self._lock:
                self._clients.remove(client)

    async def _read(self, websocket: WebSocket, client: _Client) -> None:
        """Reads what a client subscribes to, until it goes away."""
        while (event := await websocket.receive())["type"] == "websocket.receive":
            with suppress(InputError, LookupError, TypeError, struct.error, AttributeError), self._lock:
                self._subscribe(client, json_object(event.get("text", "").encode(), what="the message", hint=""))

    def _subscribe(self, client: _Client, asked: Mapping[str, Any]) -> None:
        """Adds or removes subscriptions; sends the newest messages of the channels that were added."""
        if asked["op"] == "unsubscribe":
            gone = set(asked["subscriptionIds"])
            client.subscriptions = {key: each for key, each in client.subscriptions.items() if each not in gone}
        for each in asked["subscriptions"] if asked["op"] == "subscribe" else ():
            channel, subscription = each["channelId"], each["id"]
            struct.pack("<I", subscription)
            if channel in (known["id"] for known in self._channels.values()):
                client.subscriptions[channel] = subscription
                for data, stamp_ns in sorted(self._newest.get(channel, {}).values(), key=itemgetter(1)):
                    client.add_message(channel, stamp_ns, data, self._share)
        client.waker.set()


def _session() -> str:
    """Returns the server's greeting, with a new identity."""
    about = {"name": LIBRARY, "capabilities": ["time"], "supportedEncodings": [], "metadata": {}}
    return json.dumps({"op": "serverInfo", **about, "sessionId": str(next(_SESSIONS))})


def _channel(number: int, message: LoggedMessage) -> dict[str, Any]:
    """Returns a channel as it is advertised."""
    about = {"id": number, "topic": message.channel, "encoding": "json", "metadata": message.metadata}
    schema, text = message.schema, json.dumps(message.schema.json())
    return {**about, "schemaName": schema.name, "schemaEncoding": "jsonschema", "schema": text}


def _advertise(channels: Iterable[Mapping[str, Any]]) -> str:
    return json.dumps({"op": "advertise", "channels": [*channels]})
