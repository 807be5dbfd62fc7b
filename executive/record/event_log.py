"""Writer of the event log: one MCAP file of JSON messages, stamped by the robot's clock, readable after a kill.

Two runs with the same seed give equal logs, except for the one topic that has wall times.
"""

from __future__ import annotations

import base64
import json
import math
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import nullcontext, suppress
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any, BinaryIO, Final

import cv2
import numpy as np
from mcap.writer import Writer
from pydantic_core import to_jsonable_python

from executive.record.other_tools import grid_of, joints_message, scan_message, scene_of, transform_of
from executive.run.outcome import RunResult
from executive.run.visitor import Progress, RunSettings, RunVisitor
from executive.words.schemas import (
    BOXES,
    DETECTIONS,
    GRID,
    JOINTS,
    LIBRARY,
    MAP,
    PATH,
    POSE,
    SCAN,
    TOPIC,
    TRANSFORM,
    TREE,
    WALL,
    ZONES,
    Schema,
    pose_values,
    schema_of,
    stamp,
)
from executive.words.slug import slug
from skills.api import Worker
from skills.robot import Clock, Joints, Pose2D, Scan

FLUSH_EVERY_S: Final = 1.0
TICKS_EVERY_S: Final = 1.0
JPEG_QUALITY: Final = 80
_LINE_LOOP: Final = 2
_BOX_COLOUR: Final = MappingProxyType({"r": 0.84, "g": 0.37, "b": 0.0, "a": 1.0})
_CLEAR: Final = MappingProxyType({"r": 0.0, "g": 0.0, "b": 0.0, "a": 0.0})
_BACK: Final = MappingProxyType({"r": 1.0, "g": 1.0, "b": 1.0, "a": 0.8})

Message = Mapping[str, Any]


@dataclass(frozen=True)
class LoggedMessage:
    """Message as it is logged: channel, topic, schema, robot's clock (s), and the JSON values, also as text.

    Among several robots, the channel consists of the robot's name and the topic.
    """

    channel: str
    topic: str
    schema: Schema
    stamp_s: float
    values: Message
    data: bytes

    @property
    def metadata(self) -> dict[str, str]:
        """Metadata of the channel."""
        return {} if self.channel == self.topic else {TOPIC: self.topic}


Listener = Callable[[LoggedMessage], None]


class EventLog(RunVisitor):
    """Event log: a visitor that logs all messages of a run, and once a second the durations of the ticks.

    Call it to log a message (`skills.api.Publish`); `close` it at the end.

    Messages are written to the file within a second of the robot's clock, so that a killed process leaves a readable
    log. When the disk is full, nothing more is written, and the log stays readable. `bytes` counts all messages except
    those with wall times, which differ from run to run.

    With `apart` each robot's messages go to channels of its own, such as `bob/pose`, so that log viewers keep several
    robots apart; the channel's metadata names the topic.
    """

    def __init__(self, path: Path, clock: Clock, *, apart: bool = False) -> None:
        path.parent.mkdir(parents=True, exist_ok=True)
        self.path = path
        self._clock, self._apart = clock, apart
        self._file: BinaryIO = path.open("wb")
        self._writer: Any = Writer(self._file)
        self._writer.start(profile="", library=LIBRARY)
        self._channels: dict[tuple[str, str], int] = {}
        self._schemas: dict[str, int] = {}
        self._flushed_s = -math.inf
        self._sequence = 0
        self.bytes = 0
        self._closed = False
        self._failure: OSError | None = None
        self._listeners: list[Listener] = []
        self._tick_limit_s, self._start_s = 0.0, 0.0
        self._ticks_s: list[float] = []
        self._ticks_logged_s = -math.inf
        self._has_zones = False

    def begin(self, settings: RunSettings, worker: Worker) -> None:
        """Stores the wall time and the tick period; a tick that takes longer than the period is an overrun."""
        self._tick_limit_s = settings.tick_period_s
        self._start_s = round(time.time() - self._clock.now(), 3)

    def message(self, topic: str, message: Mapping[str, Any]) -> Mapping[str, Any]:
        """Logs the message."""
        self(topic, message)
        return message

    def tick(self, progress: Progress) -> None:
        """Collects the tick's duration on the wall clock, and logs the durations once a second."""
        self._ticks_s.append(progress.tick_wall_s)
        if progress.now_s - self._ticks_logged_s >= TICKS_EVERY_S:
            self._ticks_logged_s = progress.now_s
            self._log_ticks({"overruns": progress.overruns})

    def end(self, result: RunResult) -> None:
        """Logs the remaining durations of ticks, and the duration of the whole run."""
        if self._failure is None:
            self._log_ticks({"overruns": result.overruns, "wall_time_s": result.wall_time_s})

    def _log_ticks(self, more: Mapping[str, float]) -> None:
        ticks, self._ticks_s = [round(tick_s, 6) for tick_s in self._ticks_s], []
        lasted_s = round(time.time() - self._start_s, 3)
        self(
            WALL,
            {"start_s": self._start_s, "lasted_s": lasted_s, "tick_s": ticks, "limit_s": self._tick_limit_s, **more},
        )

    def listen(self, listener: Listener) -> None:
        """Passes every later message to `listener`."""
        self._listeners.append(listener)

    def __call__(self, topic: str, message: Mapping[str, Any]) -> None:
        """Logs a message under a topic. Raises ValueError on a closed log, OSError when the file cannot be written."""
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
        if topic == TREE and self._has_zones:
            message = {"zones": [], **message}  # viewers remove those of the mission before
        self._has_zones = self._has_zones or (topic == TREE and "zones" in message)
        for shown_under, shown in viewer_messages(topic, message, now_s):
            self._write(shown_under, plain_values(shown), now_s, robot)
        if now_s - self._flushed_s >= FLUSH_EVERY_S:
            self.flush()

    def _write(self, topic: str, plain: dict[str, Any], now_s: float, robot: str) -> None:
        stamp_ns, self._sequence = round(now_s * 1e9), self._sequence + 1
        data = json.dumps(plain, allow_nan=False, separators=(",", ":")).encode()
        self.bytes += len(data) if topic != WALL else 0
        channel = f"{slug(robot)}/{topic}" if robot else topic
        message = LoggedMessage(channel, topic, schema_of(topic, plain), now_s, plain, data)
        self._writer.add_message(self._channel(message), stamp_ns, data, stamp_ns, self._sequence)
        for listener in self._listeners:
            listener(message)

    def flush(self) -> None:
        """Writes all buffered messages to the file."""
        self._flushed_s = self._clock.now()
        self._writer.flush()

    def close(self) -> None:
        """Completes the file; idempotent. Raises OSError when it cannot be written, but only once for each cause."""
        if self._closed:
            return
        self._closed, broken = True, self._failure is not None
        with suppress(OSError) if broken else nullcontext(), self._file:
            if not broken:
                self._writer.finish()

    def _channel(self, message: LoggedMessage) -> int:
        schema, key = message.schema, (message.channel, message.schema.name)
        if key not in self._channels:
            if schema.name not in self._schemas:
                data = json.dumps(schema.json()).encode()
                self._schemas[schema.name] = self._writer.register_schema(schema.name, "jsonschema", data)
            number = self._schemas[schema.name]
            self._channels[key] = self._writer.register_channel(message.channel, "json", number, message.metadata)
        return self._channels[key]


def plain_values(value: Any) -> Any:
    """Converts a value to JSON: dataclasses become objects, arrays lists, enums their values, NaN and infinity null."""
    return to_jsonable_python(value, inf_nan_mode="null", fallback=_plain)


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    return dict(value) if isinstance(value, Mapping) else str(value)


def viewer_messages(topic: str, message: Message, now_s: float) -> Iterator[tuple[str, Message]]:
    """Yields the message as it is logged, and copies of it in the form that viewers need, each with its topic."""
    yield topic, compress_picture(_foxglove_form(topic, message, now_s), now_s)
    if topic == DETECTIONS and isinstance(message.get("image"), np.ndarray):
        yield BOXES, box_annotations(message.get("detections", ()), now_s)
    elif topic == POSE and "pose" in message:
        yield TRANSFORM, transform_of(message)
    elif topic == MAP and "data" in message:
        yield GRID, grid_of(message, now_s)
    elif topic == TREE and "zones" in message:
        yield ZONES, scene_of(message["zones"], now_s)


def _foxglove_form(topic: str, message: Message, now_s: float) -> Message:
    """Converts paths, scans and joint states to the form that their Foxglove schema demands."""
    robot, scan, joints = str(message.get("robot", "")), message.get("scan"), message.get("joints")
    if topic == PATH:
        return _path(message, now_s)
    if topic == SCAN and isinstance(scan, Scan):
        return scan_message(scan, robot)
    if topic == JOINTS and isinstance(joints, Joints):
        return joints_message(joints, robot)
    return message


def compress_picture(message: Message, now_s: float) -> Message:
    """Compresses the numpy picture (RGB or grey, uint8) under the key "image" of a message, if there is a picture."""
    picture = message.get("image")
    if not isinstance(picture, np.ndarray):
        return message
    colour_order = cv2.cvtColor(picture, cv2.COLOR_RGB2BGR) if picture.ndim == 3 else picture
    data = cv2.imencode(".jpg", colour_order, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])[1].tobytes()
    rest = {key: value for key, value in message.items() if key != "image"}
    frame = str(message.get("frame_id", message.get("source", "camera")))
    size = {"width": picture.shape[1], "height": picture.shape[0]}
    encoded = base64.b64encode(data).decode()
    return {**rest, **size, "timestamp": stamp(now_s), "frame_id": frame, "format": "jpeg", "data": encoded}


def box_annotations(detections: Sequence[Message], now_s: float) -> Message:
    """Converts detections to annotations for a picture: boxes (u0, v0, u1, v1) with class and score."""
    when, points, texts = stamp(now_s), [], []
    outline = {"outline_color": _BOX_COLOUR, "outline_colors": [], "fill_color": _CLEAR}
    colours = {"text_color": _BOX_COLOUR, "background_color": _BACK}
    for each in detections:
        u0, v0, u1, v1 = map(float, each["box"])
        corners = [{"x": u, "y": v} for u, v in ((u0, v0), (u1, v0), (u1, v1), (u0, v1))]
        points.append({"timestamp": when, "type": _LINE_LOOP, "points": corners, "thickness": 2.0, **outline})
        text, position = f"{each['class_name']} {each['score']:.2f}", {"x": u0, "y": v0}
        texts.append({"timestamp": when, "position": position, "text": text, "font_size": 14.0, **colours})
    return {"circles": [], "points": points, "texts": texts}


def _path(message: Message, now_s: float) -> Message:
    rest = {key: value for key, value in message.items() if key != "frame"}
    poses = [pose_values(Pose2D(*map(float, pose)).transform()) for pose in message["poses"]]
    return {**rest, "timestamp": stamp(now_s), "frame_id": message.get("frame", "world"), "poses": poses}
