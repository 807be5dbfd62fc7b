"""Sends logged messages live over Foxglove's WebSocket (`--foxglove`); needs the extra `foxglove`."""

from __future__ import annotations

import re
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, Final

from executive.record.event_log import EventLog, LoggedMessage
from executive.record.schemas import LIBRARY
from skills.inputs.errors import InputError

_ADDRESS: Final = re.compile(r"(?P<host>[\w.%-]+|\[[\w.:%-]+\]):(?P<port>\d{1,5})")
_TIME_EVERY_S: Final = 0.1
_CLOSE_S: Final = 1.0
_MOST_PORT: Final = 65535


class LiveServer:
    """Server for the channels in event logs, one log after another; `close` it at the end.

    A client that subscribes late first gets the newest message of each robot and node. A slow client misses messages,
    because no run waits for a client.
    """

    def __init__(self, address: str) -> None:
        """Starts serving at HOST:PORT; port 0 takes any free port. Raises InputError if the address cannot be used."""
        found = _ADDRESS.fullmatch(address)
        if found is None or int(found["port"]) > _MOST_PORT:
            hint = "write HOST:PORT, as in 127.0.0.1:8765"
            raise InputError(f"--foxglove '{address[:60]}' is no address with a port", hint=hint)
        try:
            import foxglove
            from foxglove.websocket import Capability
        except ImportError as error:
            hint = "pip install 'spot-errand[foxglove]'"
            raise InputError("--foxglove needs the extra `foxglove`, which is not installed", hint=hint) from error
        self._lock, self._time_s = threading.Lock(), 0.0
        self._channels: dict[tuple[str, str], Any] = {}
        self._newest: dict[int, dict[tuple[str, str], tuple[bytes, int]]] = {}
        self._context: Any = foxglove.Context()
        self._new_channel: Callable[..., Any] = foxglove.Channel
        settings = {"name": LIBRARY, "capabilities": [Capability.Time], "context": self._context}
        host, port = found["host"].strip("[]"), int(found["port"])
        try:
            self._server: Any = foxglove.start_server(host=host, port=port, server_listener=self, **settings)
        except RuntimeError as error:
            why = str(error).rpartition("port: ")[2].partition(" (")[0]
            hint = "name another, or end the program that uses it"
            raise InputError(f"cannot serve Foxglove at {address} ({why})", hint=hint) from error
        self.url = f"ws://{found['host']}:{self._server.port}"

    def follow(self, log: EventLog) -> None:
        """Sends the messages of a log from now on, and forgets the messages of the previous log."""
        with self._lock:
            self._newest.clear()
        self._time_s = 0.0
        self._server.clear_session()
        log.listen(self._send)

    def close(self) -> None:
        """Stops serving; cuts off clients that do not read."""
        stopping = threading.Thread(target=self._server.stop, daemon=True)
        stopping.start()
        stopping.join(_CLOSE_S)

    def _send(self, message: LoggedMessage) -> None:
        key, stamp_ns = (message.channel, message.schema.name), round(message.stamp_s * 1e9)
        if (channel := self._channels.get(key)) is None:
            schema, metadata = message.schema.json(), message.metadata
            channel = self._new_channel(message.channel, schema=schema, metadata=metadata, context=self._context)
            self._channels[key] = channel
        about = (str(message.values.get("robot", "")), str(message.values.get("node", "")))
        with self._lock:
            self._newest.setdefault(channel.id(), {})[about] = message.data, stamp_ns
        if message.stamp_s - self._time_s >= _TIME_EVERY_S:
            self._time_s = message.stamp_s
            self._server.broadcast_time(stamp_ns)
        channel.log(message.data, log_time=stamp_ns)

    def on_subscribe(self, client: Any, channel: Any) -> None:
        """Sends the newest messages of a channel to a client; called in the server's thread."""
        with self._lock:
            newest = sorted(self._newest.get(channel.id, {}).values(), key=lambda each: each[1])
        own = next(each for each in tuple(self._channels.values()) if each.id() == channel.id)
        for data, stamp_ns in newest:
            own.log(data, log_time=stamp_ns, sink_id=client.id)

    def on_unsubscribe(self, client: Any, channel: Any) -> None:
        """Does nothing; the server calls it."""


@contextmanager
def serve_live(address: str | None, tell: Callable[[str], None]) -> Iterator[LiveServer | None]:
    """Serves while the block runs, and shows the address; serves nothing without an address. Raises InputError."""
    if address is None:
        yield None
        return
    server = LiveServer(address)
    tell(f"Foxglove: {server.url}")
    try:
        yield server
    finally:
        server.close()
