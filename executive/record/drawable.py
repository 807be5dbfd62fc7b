"""Messages in the forms that log viewers draw by themselves: pictures, boxes in them, poses, paths."""

from __future__ import annotations

import base64
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import Any, Final

import cv2
import numpy as np

from executive.record.schemas import BOXES, DETECTIONS, PATH, stamp

JPEG_QUALITY: Final = 80
_LINE_LOOP: Final = 2
_BOX_COLOUR: Final = MappingProxyType({"r": 0.84, "g": 0.37, "b": 0.0, "a": 1.0})
_CLEAR: Final = MappingProxyType({"r": 0.0, "g": 0.0, "b": 0.0, "a": 0.0})
_BACK: Final = MappingProxyType({"r": 1.0, "g": 1.0, "b": 1.0, "a": 0.8})

Message = Mapping[str, Any]


def drawable(topic: str, message: Message, now_s: float) -> Iterator[tuple[str, Message]]:
    """The message as it is logged, and messages beside it that only viewers need."""
    yield topic, with_picture(_FORMS.get(topic, _as_it_is)(message, now_s), now_s)
    if topic == DETECTIONS and isinstance(message.get("image"), np.ndarray):
        yield BOXES, boxes(message.get("detections", ()), now_s)


def with_picture(message: Message, now_s: float) -> Message:
    """A message with a numpy picture (RGB or grey, uint8) under "image" becomes a compressed picture."""
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


def boxes(detections: Sequence[Message], now_s: float) -> Message:
    """Boxes (u0, v0, u1, v1) with the name and score beside each, as annotations of the picture."""
    when = stamp(now_s)
    return {
        "circles": [],
        "points": [_box(each["box"], when) for each in detections],
        "texts": [_caption(each, when) for each in detections],
    }


def _box(box: Sequence[float], when: Message) -> Message:
    u0, v0, u1, v1 = map(float, box)
    corners = [{"x": u, "y": v} for u, v in ((u0, v0), (u1, v0), (u1, v1), (u0, v1))]
    colours = {"outline_color": _BOX_COLOUR, "outline_colors": [], "fill_color": _CLEAR}
    return {"timestamp": when, "type": _LINE_LOOP, "points": corners, "thickness": 2.0, **colours}


def _caption(detection: Message, when: Message) -> Message:
    u0, v0 = map(float, detection["box"][:2])
    text = f"{detection['class_name']} {detection['score']:.2f}"
    colours = {"text_color": _BOX_COLOUR, "background_color": _BACK}
    return {"timestamp": when, "position": {"x": u0, "y": v0}, "text": text, "font_size": 14.0, **colours}


def planar_pose(x_m: float, y_m: float, yaw_rad: float) -> Message:
    """A pose on the floor as position and orientation."""
    turn = {"x": 0.0, "y": 0.0, "z": math.sin(yaw_rad / 2), "w": math.cos(yaw_rad / 2)}
    return {"position": {"x": x_m, "y": y_m, "z": 0.0}, "orientation": turn}


def _path(message: Message, now_s: float) -> Message:
    rest = {key: value for key, value in message.items() if key != "frame"}
    poses = [planar_pose(*map(float, pose)) for pose in message["poses"]]
    return {**rest, "timestamp": stamp(now_s), "frame_id": message.get("frame", "world"), "poses": poses}


def _as_it_is(message: Message, now_s: float) -> Message:
    return message


_FORMS: Final[Mapping[str, Callable[[Message, float], Message]]] = {PATH: _path}
