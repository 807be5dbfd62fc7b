"""Feed for the page: logged messages in order, and the latest progress and control state."""

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

from executive.words.schemas import DERIVED, JOINTS, SCAN

_UNSEEN: Final = DERIVED | {JOINTS, SCAN}  # the page draws boxes from the detections themselves
_PICTURES: Final = frozenset({"jpeg", "png"})
MOST_MESSAGES: Final = 20_000
MOST_PICTURES: Final = 500


@dataclass(frozen=True)
class _Message:
    """Message with its number (from 1), topic, robot and node, and the number of its picture."""

    number: int
    about: Hashable
    text: str
    picture: int | None


class Feed:
    """Ordered list of messages as JSON text. The run's thread writes the feed, and the server's thread reads it.

    Pictures are stored separately, so that a page fetches only the pictures that it shows. A full feed drops its older
    half, except the newest message of each topic, robot and node.
    """

    def __init__(self, *, most: int | None = MOST_MESSAGES, most_pictures: int = MOST_PICTURES) -> None:
        """Stores about `most` messages and `most_pictures` pictures at most, or all of them if `most` is None."""
        self._lock = threading.Condition()
        self._most, self._most_pictures = most, most_pictures
        self._full, self._full_pictures = most or 0, most_pictures
        self._messages: list[_Message] = []
        self._added = self._shown = 0
        self._pictures: dict[int, tuple[str, bytes]] = {}
        self._news: dict[str, tuple[int, str]] = {}
        self._states = 0
        self._listeners: tuple[Callable[[], None], ...] = ()
        self._read = self._readers = 0

    def __call__(self, topic: str, t: float, message: Mapping[str, Any]) -> None:
        """Adds a logged message: topic, the robot's clock (s), JSON values."""
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
        """Sets the latest state of a subject that is not logged, such as progress."""
        with self._lock:
            self._states += 1
            self._news[about] = (self._states, _encoded({"live": about, "data": word}))
        self._call_listeners()

    def listen(self, listener: Callable[[], None]) -> None:
        """Calls `listener` after each change, in the thread that made the change."""
        with self._lock:
            self._listeners = (*self._listeners, listener)

    def since(self, cursor: tuple[int, int]) -> tuple[tuple[int, int], Sequence[str]]:
        """Returns the next cursor, and the messages since a cursor; the first cursor is (0, 0)."""
        with self._lock:
            added, states = cursor
            words = [text for number, text in sorted(self._news.values()) if number > states]
            new = self._messages[bisect_right(self._messages, added, key=attrgetter("number")) :]
            return (self._added, self._states), [*(each.text for each in new), *words]

    @property
    def pictures(self) -> int:
        """Number of pictures so far."""
        with self._lock:
            return self._shown

    def picture(self, number: int) -> tuple[str, bytes]:
        """Returns format ("jpeg" or "png") and bytes of a picture. Raises LookupError for an unknown number."""
        with self._lock:
            found = self._pictures.get(number)
        if found is None:
            raise LookupError(f"there is no picture {number}")
        return found

    def add_reader(self) -> None:
        """Adds a page that reads the feed."""
        with self._lock:
            self._readers += 1

    def remove_reader(self) -> None:
        """Removes a page that has read the feed."""
        with self._lock:
            self._readers -= 1
            self._lock.notify_all()

    def mark_sent(self, cursor: tuple[int, int]) -> None:
        """Marks all messages up to a cursor as sent to a page."""
        with self._lock:
            self._read = max(self._read, cursor[0])
            self._lock.notify_all()

    def wait_sent(self, timeout_s: float) -> bool:
        """Waits until a page has received all messages, at most `timeout_s` (wall time); returns whether it has.

        The run calls it after each tick, so that a busy run lets the server's thread work. Returns at once if no page
        reads the feed.
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
        """Drops the older half of the messages or pictures when there are too many."""
        if self._most is None or (len(self._messages) < self._full and len(self._pictures) < self._full_pictures):
            return
        newest = {each.about: each for each in self._messages}
        if len(self._messages) >= self._full:
            cut = len(self._messages) - self._most // 2
            older = (each for each in self._messages[:cut] if newest[each.about] is each)
            self._messages = [*older, *self._messages[cut:]]
            self._full = max(self._most, len(self._messages) + self._most // 2)
        needed, half = {each.picture for each in newest.values()}, self._most_pictures // 2
        stored = {*needed, *range(self._shown - half, self._shown)}
        self._pictures = {number: picture for number, picture in self._pictures.items() if number in stored}
        self._full_pictures = len(self._pictures) + half

    def _call_listeners(self) -> None:
        for listener in self._listeners:
            listener()


def _encoded(value: Mapping[str, Any]) -> str:
    return json.dumps(value, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
