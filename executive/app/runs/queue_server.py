"""Server of a queue: runs queued missions, and queues standing missions at set times, on HTTP calls and on messages.

A port is open, and a plug-in runs, only while a standing mission needs it.
"""

from __future__ import annotations

import os
import re
import secrets
import stat
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime, timedelta
from http import HTTPStatus
from pathlib import Path
from typing import Any, Final, Protocol

from executive.app.prepare.from_request import prepare_checked
from executive.app.runs.queue import ROOM_WAIT_S, MissionResult, Runner, interrupted_error, next_queued, run_in_turn
from executive.mission.parameters import parse_json_values
from executive.mission.request import Request
from executive.store.database import STORE_FILE, StoreError
from executive.store.missions import MissionState, MissionStore, StoredMission
from executive.store.standing_missions import StandingMission, StandingMissions, TooManyError
from executive.store.trigger_source import TriggerSource, trigger_source
from executive.store.triggers import OnCall, OnTopic, Trigger
from executive.store.wakeup import wake_server
from executive.view.serving import CallError, CallServer
from skills.inputs.errors import InputError, shortage
from skills.inputs.plugins import PluginDefect, run_in_thread

LIMIT_S: Final = 10.0
"""Time limit of a plug-in to start, and to stop."""
_SEE: Final = "see the documentation of that package"
_HOST: Final = re.compile(r"[A-Za-z0-9.:%_-]{1,253}")
MOST_STARTS: Final = 3
"""Starts after which an interrupted mission is set aside, because it may crash the process."""


class Waiting(Protocol):
    """Wait that another thread or process can end; `executive.store.wakeup.WakeupPipe` is an implementation."""

    def wait(self, until: datetime | None) -> None:
        """Blocks until `wake` is called, or until a time."""

    def wake(self) -> None:
        """Ends the wait. Any thread and any signal handler may call it."""


class QueueServer:
    """Server of one store, which this process has claimed.

    A stop cancels the mission under way, which `errand resume` continues. Queued missions stay queued.
    """

    def __init__(
        self,
        missions: MissionStore,
        standing: StandingMissions,
        waiting: Waiting,
        runner: Runner,
        *,
        follow: Callable[[Iterable[Trigger]], None],
        tell: Callable[[str], None],
    ) -> None:
        """`follow` makes the listeners wait for these triggers and no others; `tell` shows a line."""
        self._missions, self._standing, self._waiting, self._runner = missions, standing, waiting, runner
        self._follow, self._tell = follow, tell
        self._refused = ""
        self.stopped: str | None = None

    def stop(self, reason: str) -> None:
        """Stops serving. Any thread and signal handlers may call it."""
        self.stopped = self.stopped or reason
        self._runner.cancel(reason)
        self._waiting.wake()

    def serve(self, *, end: datetime | None = None, until_idle: bool = False) -> list[MissionResult]:
        """Serves until it is stopped, until the time `end`, or with `until_idle` until nothing is queued.

        Raises:
            InputError: a listener cannot be opened at the beginning, or the store cannot be used any more.
        """
        serving_since = self._missions.now()
        self._follow(each.trigger for each in self._standing.missions())
        interrupted = self._missions.missions(MissionState.RUNNING)
        left = next((each for each in interrupted if not each.queued), None)
        if left is not None:
            raise interrupted_error(self._missions, left)
        aside = [
            self._runner.set_aside(each, f"it was started {each.starts} times and interrupted")
            for each in interrupted
            if each.starts >= MOST_STARTS
        ]
        again = [each for each in interrupted if each.starts < MOST_STARTS]
        coming = self._next_missions(again, serving_since, end=end, until_idle=until_idle)
        return [*aside, *run_in_turn(coming, self._runner, until_cancelled=False)]

    def _next_missions(
        self, again: Sequence[StoredMission], serving_since: datetime, *, end: datetime | None, until_idle: bool
    ) -> Iterator[StoredMission]:
        """Yields the missions to resume, `again`, and then the queued missions; queues missions whose triggers fire."""
        now = self._missions.now
        for each in again:
            if self.stopped is None:
                yield each
        waiting_since = now() if again else serving_since
        while self.stopped is None:
            self._update_listeners()
            try:
                fired = self._standing.fire_due(waiting_since=waiting_since, serving_since=serving_since)
            except StoreError as error:
                if shortage(error) is None:
                    raise
                self._say_once(error)
                self._waiting.wait(now() + timedelta(seconds=ROOM_WAIT_S))
                continue
            for each in fired:
                self._tell(f"Mission {each.id} is queued: {each.request.name} ({each.why})")
            if end is not None and now() >= end:
                return
            mission = next_queued(self._missions)
            if mission is not None:
                yield mission
                waiting_since = now()
            elif until_idle:
                return
            else:
                self._waiting.wait(min(filter(None, (self._standing.due_next(), end)), default=None))

    def _update_listeners(self) -> None:
        """Passes the present triggers to the listeners; reports a listener that cannot be opened once."""
        try:
            self._follow(each.trigger for each in self._standing.missions())
        except InputError as error:
            self._say_once(error)

    def _say_once(self, error: InputError) -> None:
        if str(error) != self._refused:
            self._tell(f"errand: {error}")
        self._refused = str(error)


@dataclass(frozen=True)
class CallAddress:
    """Address at which HTTP calls are served, and the token that the user gave for them.

    Raises:
        InputError: the host is neither a name nor an address.
    """

    host: str = "127.0.0.1"
    port: int = 8950
    token: str | None = None

    def __post_init__(self) -> None:
        if not _HOST.fullmatch(self.host):
            hint = "name this machine or an address of it, as in 127.0.0.1"
            raise InputError(f"--host '{self.host[:60]}' is neither a name nor an address", hint=hint)


class Listeners:
    """Listeners of a store's standing missions: a port for calls, and plug-ins. Call `close`, or use `with`."""

    def __init__(
        self, store: Path, address: CallAddress, tell: Callable[[str], None], *, limit_s: float = LIMIT_S
    ) -> None:
        """`tell` prints a line from any thread; `limit_s` is the time for a plug-in to start, and to stop."""
        self._limit_s = limit_s
        self._stuck: dict[str, str] = {}
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
        """Listens for these triggers and no others; reports once a plug-in that is missing or does not start.

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
        """Stops listening; idempotent."""
        self._follow_calls(False)
        self._follow_topics({})

    def _follow_calls(self, wanted: bool) -> None:
        if self._server is not None and not wanted:
            self._server.close()
            self._server = None
        if self._server is None and wanted:
            self._server = self._serve_calls(call_token(self._address.token, self._store))

    def _serve_calls(self, token: CallToken) -> CallServer:
        """Opens the server of calls and shows its address. Raises InputError."""
        host, port = self._address.host, self._address.port
        try:
            server = CallServer(self._calls.called, token=token.text, host=host, port=port)
        except OSError as error:
            what = f"cannot serve calls at {host} port {port} ({error.strerror})"
            raise InputError(what, hint="name another --host or --port") from error
        self._tell(f"Calls: POST {server.url}NAME")
        if token.new:
            self._tell(f"The token, which is stored in {token.file}: {token.text}")
        elif token.file is not None:
            self._tell(f"The token is in {token.file}")
        return server

    def _follow_topics(self, wanted: Mapping[str, tuple[str, ...]]) -> None:
        for kind, (topics, source) in list(self._sources.items()):
            if wanted.get(kind) != topics:
                del self._sources[kind]
                try:
                    run_in_thread(source.stop, limit_s=self._limit_s)
                except PluginDefect as defect:
                    self._tell(f"trigger source '{kind}' does not stop ({defect})")
        self._unheard = {kind: why for kind, why in self._unheard.items() if kind in wanted}
        for kind, topics in wanted.items():
            if kind in self._sources:
                continue
            try:
                self._sources[kind] = (topics, self._start(kind, topics))
            except InputError as error:
                if self._unheard.get(kind) != str(error):
                    self._tell(f"errand: missions that wait for topics of {kind} are not heard of: {error}")
                self._unheard[kind] = str(error)
            else:
                self._unheard.pop(kind, None)

    def _start(self, kind: str, topics: Sequence[str]) -> TriggerSource:
        """Starts a plug-in. Raises InputError if it is not installed or does not start.

        A plug-in that exceeds the time limit is not started again, and messages that it sends later are dropped.
        """
        if kind in self._stuck:
            raise InputError(self._stuck[kind], hint=_SEE)
        source, given_up = trigger_source(kind), threading.Event()

        def fire(topic: str, payload: bytes) -> None:
            if not given_up.is_set():
                self._calls.heard(kind, topic, payload)

        def start() -> None:
            source.start(topics, fire)
            if given_up.is_set():
                source.stop()

        try:
            run_in_thread(start, limit_s=self._limit_s)
        except PluginDefect as defect:
            given_up.set()
            message = f"trigger source '{kind}' does not start ({defect})"
            if isinstance(defect.__cause__, TimeoutError):
                self._stuck[kind] = message
            raise InputError(message, hint=_SEE) from defect
        return source


class TriggerCalls:
    """Receiver of calls and messages; queues the standing missions that wait for them. `tell` prints a line."""

    def __init__(self, store: Path, tell: Callable[[str], None]) -> None:
        self._store, self._tell = store, tell
        self._one_at_a_time = threading.Lock()

    def called(self, name: str, body: bytes) -> Mapping[str, Any]:
        """Queues the missions that wait for an HTTP call; returns their numbers. Raises CallError."""
        return {"missions": [mission.id for mission in self._queue(OnCall(name), body)]}

    def heard(self, kind: str, topic: str, payload: bytes) -> None:
        """Queues the missions that wait for a message, or prints why it cannot. Never raises."""
        try:
            self._queue(OnTopic(kind, topic), payload)
        except CallError as refusal:
            self._tell(f"{OnTopic(kind, topic)}: {refusal.detail}")

    def _queue(self, trigger: OnCall | OnTopic, body: bytes) -> tuple[StoredMission, ...]:
        """Queues the standing missions that wait for a trigger, with the values in the body. Raises CallError."""
        try:
            with self._one_at_a_time, MissionStore(self._store, create=False) as store:
                standing = StandingMissions(store)
                chosen = [each for each in standing.missions() if each.trigger == trigger]
                if not chosen:
                    raise CallError(HTTPStatus.NOT_FOUND, f"no standing mission waits for '{trigger}'")
                fired = standing.fire([(each, _request(each, body)) for each in chosen], "")
        except TooManyError as error:
            raise CallError(HTTPStatus.TOO_MANY_REQUESTS, str(error)) from error
        except InputError as error:
            raise CallError(HTTPStatus.SERVICE_UNAVAILABLE, str(error)) from error
        except CallError:
            raise
        except Exception as defect:
            said = f"a defect of errand or of a plug-in ({type(defect).__name__}: {defect})"
            raise CallError(HTTPStatus.INTERNAL_SERVER_ERROR, said) from defect
        for mission in fired:
            self._tell(f"Mission {mission.id} is queued: {mission.request.name} ({mission.why})")
        wake_server(self._store)
        return fired


def _request(standing: StandingMission, body: bytes) -> Request:
    """Returns a standing mission's request, checked with the values from a call. Raises CallError if they are wrong."""
    try:
        values = parse_json_values(body)
        if not values:
            return standing.request
        prepared = prepare_checked(replace(standing.request, given={**standing.request.given, **values}))
    except InputError as error:
        raise CallError(HTTPStatus.BAD_REQUEST, str(error)) from error
    return prepared.request.from_anywhere()


_FORM: Final = re.compile(r"[A-Za-z0-9._~+/=-]{8,512}")


@dataclass(frozen=True)
class CallToken:
    """Token for calls, with the file that holds it (None: the user gave it); `new` is True if it was just drawn."""

    text: str
    file: Path | None = None
    new: bool = False


def call_token(given: str | None, store: Path) -> CallToken:
    """Returns the user's token, or the one stored beside the store; draws it the first time.

    Raises:
        InputError: the token is too short or has other characters, or other users can read its file.
    """
    if given is not None:
        return CallToken(_checked(given, None))
    file = store.with_name(f"{store.name}-token")
    with STORE_FILE.failures(store):
        try:
            opened = os.open(file, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
        except FileExistsError:
            if stat.S_IMODE(file.stat().st_mode) & (stat.S_IRWXG | stat.S_IRWXO):
                hint = f"chmod 600 {file}, or remove it for a new one"
                raise InputError("other users can read the token", hint=hint, file=file) from None
            return CallToken(_checked(file.read_text(encoding="utf-8", errors="replace").strip(), file), file)
        text = secrets.token_urlsafe(32)
        with os.fdopen(opened, "w", encoding="ascii") as writer:
            writer.write(f"{text}\n")
    return CallToken(text, file, new=True)


def _checked(text: str, file: Path | None) -> str:
    if not _FORM.fullmatch(text):
        hint = "give at least 8 letters, digits or any of ._~+/=-"
        raise InputError("the token for calls cannot be used", hint=hint, file=file)
    return text
