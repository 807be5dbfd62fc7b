"""Writes the event log: one MCAP file of JSON messages, stamped by the robot's clock, readable after a kill.

Two runs of one seed give equal logs: wall times stand in a topic of their own, and nowhere else.
"""

from __future__ import annotations

import base64
import dataclasses
import enum
import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any, BinaryIO

import cv2
import numpy as np
from mcap.writer import Writer

from executive.record.schemas import Schema, schema_of
from skills.robot import Clock

FLUSH_EVERY_S = 1.0


class EventLog:
    """An open event log. Call it to log a message (`skills.api.Publish`); `close` it at the end.

    Whatever is older than a second of the robot's clock has reached the file, so that a killed process leaves a log
    that can be read.
    """

    def __init__(self, path: Path, clock: Clock) -> None:
        path.parent.mkdir(parents=True, exist_ok=True)
        self.path = path
        self._clock = clock
        self._file: BinaryIO = path.open("wb")
        self._writer: Any = Writer(self._file)
        self._writer.start(profile="", library="errand")
        self._channels: dict[tuple[str, str], int] = {}
        self._schemas: dict[str, int] = {}
        self._flushed_s = -math.inf
        self._sequence = 0
        self._closed = False

    def __call__(self, topic: str, message: Mapping[str, Any]) -> None:
        """Log a message under a topic. Raises ValueError on a closed log."""
        if self._closed:
            raise ValueError("the event log is closed")
        now_s = self._clock.now()
        plain = plain_values(with_picture(message, now_s))
        schema = schema_of(topic, plain)
        stamp_ns, self._sequence = round(now_s * 1e9), self._sequence + 1
        data = json.dumps(plain, allow_nan=False, separators=(",", ":")).encode()
        channel = self._channel(topic, schema)
        self._writer.add_message(channel, stamp_ns, data, stamp_ns, self._sequence)
        if now_s - self._flushed_s >= FLUSH_EVERY_S:
            self.flush()

    def flush(self) -> None:
        """Bring everything to the file."""
        self._flushed_s = self._clock.now()
        self._writer.flush()

    def close(self) -> None:
        """Finish the file; idempotent."""
        if not self._closed:
            self._closed = True
            self._writer.finish()
            self._file.close()

    def _channel(self, topic: str, schema: Schema) -> int:
        key = (topic, schema.name)
        if key not in self._channels:
            if schema.name not in self._schemas:
                data = json.dumps(schema.json()).encode()
                self._schemas[schema.name] = self._writer.register_schema(schema.name, "jsonschema", data)
            self._channels[key] = self._writer.register_channel(topic, "json", self._schemas[schema.name])
        return self._channels[key]


def with_picture(message: Mapping[str, Any], now_s: float) -> Mapping[str, Any]:
    """A message with a numpy picture (RGB or grey, uint8) under "image" becomes a compressed picture."""
    picture = message.get("image")
    if not isinstance(picture, np.ndarray):
        return message
    colour_order = cv2.cvtColor(picture, cv2.COLOR_RGB2BGR) if picture.ndim == 3 else picture
    data = cv2.imencode(".jpg", colour_order, [cv2.IMWRITE_JPEG_QUALITY, 85])[1].tobytes()
    rest = {key: value for key, value in message.items() if key != "image"}
    frame = str(message.get("frame_id", message.get("source", "camera")))
    encoded = base64.b64encode(data).decode()
    return {**rest, "timestamp": stamp(now_s), "frame_id": frame, "format": "jpeg", "data": encoded}


def stamp(time_s: float) -> dict[str, int]:
    """Seconds as the message formats have them."""
    nanoseconds = round(time_s * 1e9)
    return {"sec": nanoseconds // 10**9, "nsec": nanoseconds % 10**9}


def plain_values(value: Any) -> Any:
    """A value as JSON has it: dataclasses become objects, arrays lists, enums their values, NaN and infinity null."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {field.name: plain_values(getattr(value, field.name)) for field in dataclasses.fields(value)}
    if isinstance(value, Mapping):
        return {str(key): plain_values(item) for key, item in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        return plain_values(value.tolist())
    if isinstance(value, list | tuple | set | frozenset):
        return [plain_values(item) for item in value]
    if isinstance(value, enum.Enum):
        return plain_values(value.value)
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value if value is None or isinstance(value, bool | int | str) else str(value)
