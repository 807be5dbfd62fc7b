"""What the page is told: every logged message in order, and the newest word on what is not logged."""

from __future__ import annotations

import base64
import json
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final

from executive.record.schemas import BOXES

_UNSEEN: Final = frozenset({BOXES})  # the page draws boxes from the detections themselves
_PICTURES: Final = frozenset({"jpeg", "png"})


class Feed:
    """An ordered list of messages as JSON text, written by the run's thread and read by the server's.

    Pictures are kept aside, so that a page that opens late gets the list at once and fetches the pictures it shows.
    """

    def __init__(self) -> None:
        self._lock = threading.Condition()
        self._messages: list[str] = []
        self._pictures: list[tuple[str, bytes]] = []
        self._news: dict[str, tuple[int, str]] = {}
        self._told = 0
        self._listeners: tuple[Callable[[], None], ...] = ()
        self._read = self._readers = 0

    def __call__(self, topic: str, t: float, message: Mapping[str, Any]) -> None:
        """Add a logged message (`executive.record.event_log.Listener`): topic, time (s), plain values."""
        if topic in _UNSEEN:
            return
        with self._lock:
            shown = self._without_picture(message)
            sent_ms = round(time.time() * 1e3, 1)  # lets the page say how far it is behind
            self._messages.append(_encoded({"topic": topic, "t": round(t, 4), "sent_ms": sent_ms, "data": shown}))
        self._call_listeners()

    def tell(self, about: str, word: Mapping[str, Any]) -> None:
        """The newest word on something that is not logged, such as progress; it takes the place of the last one."""
        with self._lock:
            self._told += 1
            self._news[about] = (self._told, _encoded({"live": about, "data": word}))
        self._call_listeners()

    def listen(self, listener: Callable[[], None]) -> None:
        """Call `listener` whenever there is something new; from the thread that wrote it."""
        with self._lock:
            self._listeners = (*self._listeners, listener)

    def since(self, cursor: tuple[int, int]) -> tuple[tuple[int, int], Sequence[str]]:
        """What is new since a cursor, (0, 0) at first, and the next cursor."""
        with self._lock:
            messages, told = cursor
            words = [text for number, text in sorted(self._news.values()) if number > told]
            return (len(self._messages), self._told), [*self._messages[messages:], *words]

    @property
    def pictures(self) -> int:
        """How many pictures there are."""
        with self._lock:
            return len(self._pictures)

    def picture(self, number: int) -> tuple[str, bytes]:
        """A picture's format ("jpeg" or "png") and bytes. Raises LookupError when there is none of that number."""
        with self._lock:
            if not 0 <= number < len(self._pictures):
                raise LookupError(f"there is no picture {number}")
            return self._pictures[number]

    def joined(self) -> None:
        """A page begins to read."""
        with self._lock:
            self._readers += 1

    def left(self) -> None:
        """A page reads no more."""
        with self._lock:
            self._readers -= 1
            self._lock.notify_all()

    def sent(self, cursor: tuple[int, int]) -> None:
        """A page has been sent all up to a cursor."""
        with self._lock:
            self._read = max(self._read, cursor[0])
            self._lock.notify_all()

    def wait_sent(self, timeout_s: float) -> bool:
        """Block (on the wall's clock) until a page has been sent all messages, or time is over; True when sent.

        The run calls it after each tick, so that a busy run does not keep the server's thread from its turn. Nobody
        waits where no page reads.
        """
        with self._lock:
            return self._lock.wait_for(lambda: self._readers == 0 or self._read >= len(self._messages), timeout_s)

    def _without_picture(self, message: Mapping[str, Any]) -> Mapping[str, Any]:
        if message.get("format") not in _PICTURES or "data" not in message:
            return message
        self._pictures.append((message["format"], base64.b64decode(message["data"])))
        rest = {key: value for key, value in message.items() if key != "data"}
        return {**rest, "picture": len(self._pictures) - 1}

    def _call_listeners(self) -> None:
        for listener in self._listeners:
            listener()


def _encoded(value: Mapping[str, Any]) -> str:
    return json.dumps(value, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
