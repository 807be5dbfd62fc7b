"""Reads event logs, even those that a killed process left behind."""

from __future__ import annotations

import json
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mcap.exceptions import McapError
from mcap.reader import NonSeekingReader
from zstandard import ZstdError

from executive.record.schemas import TOPIC
from skills.files.errors import InputError
from skills.files.outside import plain_file

MOST_BYTES = 100_000_000_000
_DAMAGE = (McapError, struct.error, ZstdError, ValueError)


@dataclass(frozen=True)
class Event:
    """One message: topic, the robot's clock in seconds, and its values."""

    topic: str
    stamp_s: float
    data: dict[str, Any]


def read_events(path: Path) -> tuple[Event, ...]:
    """All events in the order in which they were written; of a log that was cut off, those before the cut.

    Raises InputError if there is no such file, or it is no event log.
    """
    plain_file(path, most_bytes=MOST_BYTES, hint="name a log that exists")
    try:
        with path.open("rb") as file:
            return tuple(_events(NonSeekingReader(file)))
    except OSError as error:
        raise InputError(f"cannot read it ({error.strerror})", hint="name a log that exists", file=path) from error
    except _DAMAGE as error:
        raise InputError("it is no event log", hint="name a log.mcap that a run has written", file=path) from error


def _events(reader: NonSeekingReader) -> Iterator[Event]:
    count = 0
    try:
        for _, channel, message in reader.iter_messages(log_time_order=False):
            count += 1
            topic = channel.metadata.get(TOPIC, channel.topic)
            yield Event(topic, message.log_time / 1e9, json.loads(message.data))
    except _DAMAGE:
        if count == 0:
            raise
