"""Writes the event log: one MCAP file of JSON messages, stamped by the robot's clock, readable after a kill.

Two runs of one seed give equal logs: wall times stand in a topic of their own, and nowhere else.
"""

from __future__ import annotations

import dataclasses
import enum
import json
import math
from collections.abc import Callable, Mapping
from contextlib import nullcontext, suppress
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from mcap.writer import Writer

from executive.record.drawable import drawable
from executive.record.schemas import TOPIC, WALL, Schema, schema_of
from executive.run.outcome import RunResult
from executive.run.visitor import Progress, RunSettings, RunVisitor
from executive.words.slug import slug
from skills.api import Worker
from skills.robot import Clock

FLUSH_EVERY_S = 1.0
TICKS_EVERY_S = 1.0

Listener = Callable[[str, float, Mapping[str, Any]], None]


class EventLog(RunVisitor):
    """An open event log: logs all messages of a run that it visits, and once a second how long its ticks took.

    Call it to log a message (`skills.api.Publish`); `close` it at the end.

    Whatever is older than a second of the robot's clock has reached the file, so that a killed process leaves a log
    that can be read. When the disk is full, nothing more is written, and what was written can be read. `bytes` counts
    those of all messages but the wall's times, which differ from run to run.

    With `apart` each robot's messages go to channels of its own, such as `bob/pose`, so that log viewers do not mix
    several robots up; the channel's metadata names the topic.
    """

    def __init__(self, path: Path, clock: Clock, *, apart: bool = False) -> None:
        path.parent.mkdir(parents=True, exist_ok=True)
        self.path = path
        self._clock, self._apart = clock, apart
        self._file: BinaryIO = path.open("wb")
        self._writer: Any = Writer(self._file)
        self._writer.start(profile="", library="errand")
        self._channels: dict[tuple[str, str, str], int] = {}
        self._schemas: dict[str, int] = {}
        self._flushed_s = -math.inf
        self._sequence = 0
        self.bytes = 0
        self._closed = False
        self._failure: OSError | None = None
        self._listeners: list[Listener] = []
        self._tick_limit_s = 0.0
        self._ticks_s: list[float] = []
        self._ticks_logged_s = -math.inf

    def begin(self, settings: RunSettings, worker: Worker) -> None:
        """A tick that takes longer than the tick period overruns."""
        self._tick_limit_s = settings.tick_period_s

    def message(self, topic: str, message: Mapping[str, Any]) -> Mapping[str, Any]:
        """Log it."""
        self(topic, message)
        return message

    def tick(self, progress: Progress) -> None:
        """Gather how long the tick took on the wall's clock."""
        self._ticks_s.append(progress.tick_wall_s)
        if progress.now_s - self._ticks_logged_s >= TICKS_EVERY_S:
            self._ticks_logged_s = progress.now_s
            self._log_ticks({"overruns": progress.overruns})

    def end(self, result: RunResult) -> None:
        """Log the ticks that are left, and how long the whole run took."""
        if self._failure is None:
            self._log_ticks({"overruns": result.overruns, "wall_time_s": result.wall_time_s})

    def _log_ticks(self, more: Mapping[str, float]) -> None:
        ticks, self._ticks_s = [round(tick_s, 6) for tick_s in self._ticks_s], []
        self(WALL, {"tick_s": ticks, "limit_s": self._tick_limit_s, **more})

    def listen(self, listener: Listener) -> None:
        """Tell `listener` of every message from now on: topic, the robot's clock (s), and the plain values."""
        self._listeners.append(listener)

    def __call__(self, topic: str, message: Mapping[str, Any]) -> None:
        """Log a message under a topic. Raises ValueError on a closed log, OSError: it cannot be written."""
        if self._closed:
            raise ValueError("the event log is closed")
        if self._failure is not None:
            raise self._failure
        try:
            self._log(topic, message)
        except OSError as error:
            self._failure = error
            raise

    def _log(self, topic: str, message: Mapping[str, Any]) -> None:
        now_s = self._clock.now()
        robot = str(message.get("robot") or message.get("robot_name") or "") if self._apart else ""
        for shown_under, shown in drawable(topic, message, now_s):
            self._write(shown_under, plain_values(shown), now_s, robot)
        if now_s - self._flushed_s >= FLUSH_EVERY_S:
            self.flush()

    def _write(self, topic: str, plain: dict[str, Any], now_s: float, robot: str) -> None:
        stamp_ns, self._sequence = round(now_s * 1e9), self._sequence + 1
        data = json.dumps(plain, allow_nan=False, separators=(",", ":")).encode()
        self.bytes += len(data) if topic != WALL else 0
        channel = self._channel(topic, schema_of(topic, plain), robot)
        self._writer.add_message(channel, stamp_ns, data, stamp_ns, self._sequence)
        for listener in self._listeners:
            listener(topic, now_s, plain)

    def flush(self) -> None:
        """Write everything to the file."""
        self._flushed_s = self._clock.now()
        self._writer.flush()

    def close(self) -> None:
        """Finish the file; idempotent. Raises OSError when it cannot be written, but not twice for one reason."""
        if self._closed:
            return
        self._closed, broken = True, self._failure is not None
        with suppress(OSError) if broken else nullcontext(), self._file:
            if not broken:
                self._writer.finish()

    def _channel(self, topic: str, schema: Schema, robot: str) -> int:
        key = (topic, schema.name, robot)
        if key not in self._channels:
            if schema.name not in self._schemas:
                data = json.dumps(schema.json()).encode()
                self._schemas[schema.name] = self._writer.register_schema(schema.name, "jsonschema", data)
            name, metadata = (f"{slug(robot)}/{topic}", {TOPIC: topic}) if robot else (topic, {})
            self._channels[key] = self._writer.register_channel(name, "json", self._schemas[schema.name], metadata)
        return self._channels[key]


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
