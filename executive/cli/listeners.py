"""What a server of the queue listens to besides the clock: HTTP calls, and the messages that plug-ins hear.

A port is open, and a plug-in started, only while a standing mission waits for it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from executive.cli.call_token import CallToken, call_token
from executive.cli.trigger_calls import TriggerCalls
from executive.store.trigger_source import TriggerSource, trigger_source
from executive.store.triggers import OnCall, OnTopic, Trigger
from executive.view.calls import CallServer
from skills.files.errors import InputError

__all__ = ["CallAddress", "Listeners"]


@dataclass(frozen=True)
class CallAddress:
    """Where HTTP calls are served, and the token that was given for them."""

    host: str = "127.0.0.1"
    port: int = 8950
    token: str | None = None


class Listeners:
    """The port and the plug-ins of a store's standing missions. Use it as a context manager, or call `close`."""

    def __init__(self, store: Path, address: CallAddress, tell: Callable[[str], None]) -> None:
        """`tell` prints a line, from any thread."""
        self._store, self._address, self._tell = store, address, tell
        self._calls = TriggerCalls(store, tell)
        self._server: CallServer | None = None
        self._sources: dict[str, tuple[tuple[str, ...], TriggerSource]] = {}
        self._unheard: dict[str, str] = {}

    def __enter__(self) -> Listeners:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def follow(self, triggers: Iterable[Trigger]) -> None:
        """Listen to what these wait for, and to nothing else; a plug-in that is missing or does not start is told once.

        Raises:
            InputError: the address cannot be served.
        """
        waited_for = tuple(triggers)
        wanted: dict[str, tuple[str, ...]] = {}
        for each in waited_for:
            if isinstance(each, OnTopic) and each.topic not in wanted.get(each.kind, ()):
                wanted[each.kind] = (*wanted.get(each.kind, ()), each.topic)
        self._follow_calls(any(isinstance(each, OnCall) for each in waited_for))
        self._follow_topics(wanted)

    def close(self) -> None:
        """Listen no more; idempotent."""
        self._follow_calls(False)
        self._follow_topics({})

    def _follow_calls(self, wanted: bool) -> None:
        if self._server is not None and not wanted:
            self._server.close()
            self._server = None
        if self._server is None and wanted:
            self._server = self._served(call_token(self._address.token, self._store))

    def _served(self, token: CallToken) -> CallServer:
        host, port = self._address.host, self._address.port
        try:
            server = CallServer(self._calls.called, token=token.text, host=host, port=port)
        except OSError as error:
            what = f"cannot serve calls at {host} port {port} ({error.strerror or error})"
            raise InputError(what, hint="name another --host or --port") from error
        self._tell(f"Calls: POST {server.url}NAME")
        if token.new:
            self._tell(f"The token, which is kept in {token.file}: {token.text}")
        elif token.file is not None:
            self._tell(f"The token is in {token.file}")
        return server

    def _follow_topics(self, wanted: Mapping[str, tuple[str, ...]]) -> None:
        for kind, (topics, source) in list(self._sources.items()):
            if wanted.get(kind) != topics:
                del self._sources[kind]
                self._stop(kind, source)
        self._unheard = {kind: why for kind, why in self._unheard.items() if kind in wanted}
        for kind, topics in wanted.items():
            if kind in self._sources:
                continue
            try:
                self._sources[kind] = (topics, self._started(kind, topics))
            except InputError as error:
                if self._unheard.get(kind) != str(error):
                    self._tell(f"errand: missions that wait for topics of {kind} are not heard of: {error}")
                self._unheard[kind] = str(error)
            else:
                self._unheard.pop(kind, None)

    def _started(self, kind: str, topics: Sequence[str]) -> TriggerSource:
        """A plug-in that listens. Raises InputError: there is none, or it does not start."""
        source = trigger_source(kind)
        try:
            source.start(topics, partial(self._calls.heard, kind))
        except Exception as defect:
            message = f"trigger source '{kind}' does not start ({type(defect).__name__}: {defect})"
            raise InputError(message, hint="see the documentation of that package") from defect
        return source

    def _stop(self, kind: str, source: TriggerSource) -> None:
        """Stop a plug-in; that it raises is told, and harms nothing else."""
        try:
            source.stop()
        except Exception as defect:
            self._tell(f"trigger source '{kind}' does not stop ({type(defect).__name__}: {defect})")
