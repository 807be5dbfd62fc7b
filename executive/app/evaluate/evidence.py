"""What a log shows of a run: how long each skill ran, its timeline, and small pictures."""

from __future__ import annotations

import base64
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from typing import Any, Final

import cv2
import numpy as np
from numpy.typing import NDArray

from executive.app.evaluate.outcome import Evidence
from executive.record.reader import Event
from executive.record.schemas import TRANSITIONS, TREE
from executive.record.timeline import timeline
from executive.view.map_picture import map_picture
from skills.files.errors import InputError

__all__ = ["evidence_of", "steps_of"]

MOST_ENTRIES: Final = 60
MOST_PICTURES: Final = 3
_WIDEST_PX: Final = 360
_JPEG_QUALITY: Final = 60


def steps_of(events: Sequence[Event]) -> dict[str, float]:
    """How long each skill ran, by its name (s, on the robot's clock); what runs at once counts for each."""
    skills, since, spent = dict[str, str](), dict[str, float](), defaultdict[str, float](float)
    for event in events:
        if event.topic == TREE:
            skills |= dict(_skills(event.data["root"]))
        elif event.topic == TRANSITIONS and (name := skills.get(event.data["node"])) is not None:
            node, t_s = str(event.data["node"]), float(event.data.get("t", event.stamp_s))
            if node in since:
                spent[name] += t_s - since.pop(node)
            if event.data["to"] == "RUNNING":
                since[node] = t_s
    end_s = max((event.stamp_s for event in events), default=0.0)
    for node, begun_s in since.items():
        spent[skills[node]] += max(0.0, end_s - begun_s)
    return {name: round(seconds, 3) for name, seconds in sorted(spent.items())}


def _skills(node: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """The path id and the name of each skill in a logged tree."""
    if node["type"] == "skill":
        yield node["id"], node["name"]
    for child in node["children"]:
        yield from _skills(child)


def evidence_of(events: Sequence[Event], files: Mapping[str, bytes]) -> Evidence:
    """The last of what happened, the map with the robot's way, and the last pictures that were taken."""
    entries = [(entry.t, entry.about, entry.text) for entry in timeline(events, leaves_only=True) if entry.text]
    return Evidence(tuple(entries[-MOST_ENTRIES:]), tuple(_pictures(events)), dict(files))


def _pictures(events: Sequence[Event]) -> Iterator[tuple[str, bytes]]:
    with suppress(InputError):
        yield "the map, with the way of the robot", _jpeg(map_picture(events))
    taken = [event for event in events if event.data.get("format") == "jpeg" and event.data.get("data")]
    for event in taken[-MOST_PICTURES:]:
        data = np.frombuffer(base64.b64decode(event.data["data"]), np.uint8)
        picture = cv2.imdecode(data, cv2.IMREAD_COLOR)
        if picture is not None:
            yield f"{event.topic} at {event.stamp_s:.1f} s", _jpeg(np.asarray(picture, np.uint8))


def _jpeg(picture: NDArray[np.uint8]) -> bytes:
    """A picture (height, width, 3; blue, green, red), made small, as a JPEG file."""
    height, width = picture.shape[:2]
    scale = min(1.0, _WIDEST_PX / width)
    size = (round(width * scale), max(1, round(height * scale)))
    small = cv2.resize(picture, size, interpolation=cv2.INTER_AREA) if scale < 1.0 else picture
    return cv2.imencode(".jpg", small, [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY])[1].tobytes()
