"""What the page is told: every logged message in order, and the newest word on what is not logged."""

from __future__ import annotations

import base64
import json
import threading
import time
from bisect import bisect_right
from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass
from operator import attrgetter
from typing import Any, Final

from executive.record.schemas import BOXES

_UNSEEN: Final = frozenset({BOXES})  # the page draws boxes from the detections themselves
_PICTURES: Final = frozenset({"jpeg", "png"})
MOST_MESSAGES: Final = 20_000
MOST_PICTURES: Final = 500


@dataclass(frozen=True)
class _Message:
    """A message by its number from 1, with the topic, robot and node that it is about, and its picture's number."""

    number: int
    about: Hashable
    text: str
    picture: int | None


class Feed:
    """An ordered list of messages as JSON text, written by the run's thread and read by the server's.

    Pictures are kept aside, so that a page that opens late gets the list at once and fetches the pictures it shows.
    Of a long run, and for a slow page, the older half is dropped at times, but for the newest message of each topic,
    robot and node.
    """

    def __init__(self, *, most: int | None = MOST_MESSAGES, most_pictures: int = MOST_PICTURES) -> None:
        """About `most` messages and `most_pictures` are kept; all of them where `most` is None."""
        self._lock = threading.Condition()
        self._most, self._most_pictures = most, most_pictures
        self._full, self._full_pictures = most or 0, most_pictures
        self._messages: list[_Message] = []
        self._added = self._shown = 0
        self._pictures: dict[int, tuple[str, bytes]] = {}
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
            text = _encoded({"topic": topic, "t": round(t, 4), "sent_ms": sent_ms, "data": shown})
            about = (topic, *(str(message.get(key)) for key in ("robot", "node")))
            self._added += 1
            self._messages.append(_Message(self._added, about, text, shown.get("picture")))
            self._drop_old()
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
            added, told = cursor
            words = [text for number, text in sorted(self._news.values()) if number > told]
            new = self._messages[bisect_right(self._messages, added, key=attrgetter("number")) :]
            return (self._added, self._told), [*(each.text for each in new), *words]

    @property
    def pictures(self) -> int:
        """How many pictures there have been."""
        with self._lock:
            return self._shown

    def picture(self, number: int) -> tuple[str, bytes]:
        """A picture's format ("jpeg" or "png") and bytes. Raises LookupError when there is none of that number."""
        with self._lock:
            found = self._pictures.get(number)
        if found is None:
            raise LookupError(f"there is no picture {number}")
        return found

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
            return self._lock.wait_for(lambda: self._readers == 0 or self._read >= self._added, timeout_s)

    def _without_picture(self, message: Mapping[str, Any]) -> Mapping[str, Any]:
        if message.get("format") not in _PICTURES or "data" not in message:
            return message
        number, self._shown = self._shown, self._shown + 1
        self._pictures[number] = message["format"], base64.b64decode(message["data"])
        rest = {key: value for key, value in message.items() if key != "data"}
        return {**rest, "picture": number}

    def _drop_old(self) -> None:
        """Keep the newer half of messages, or of pictures, where there are too many."""
        if self._most is None or (len(self._messages) < self._full and len(self._pictures) < self._full_pictures):
            return
        newest = {each.about: each for each in self._messages}
        if len(self._messages) >= self._full:
            cut = len(self._messages) - self._most // 2
            older = (each for each in self._messages[:cut] if newest[each.about] is each)
            self._messages = [*older, *self._messages[cut:]]
            self._full = max(self._most, len(self._messages) + self._most // 2)
        needed, half = {each.picture for each in newest.values()}, self._most_pictures // 2
        kept = {*needed, *range(self._shown - half, self._shown)}
        self._pictures = {number: picture for number, picture in self._pictures.items() if number in kept}
        self._full_pictures = len(self._pictures) + half

    def _call_listeners(self) -> None:
        for listener in self._listeners:
            listener()


def _encoded(value: Mapping[str, Any]) -> str:
    return json.dumps(value, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
