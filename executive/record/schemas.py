"""The topics of the event log and their JSON schemas; images and poses use the schemas that Foxglove draws."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Final

from executive.record.messages import DESTINATION_TOPIC, DETECT_TOPIC, TASK_TOPIC

TREE: Final = "tree"
TRANSITIONS: Final = "transitions"
ACTIVITY: Final = "activity"
POSE: Final = "pose"
OUTCOME: Final = "outcome"
RUN: Final = "run"
WALL: Final = "wall"
CONTROL: Final = "control"
WORK: Final = "work"
ERRORS: Final = "errors"
PATH: Final = "path"
MAP: Final = "map"
DETECTIONS: Final = "detections"
BOXES: Final = "detections/boxes"


@dataclass(frozen=True)
class Schema:
    """A named JSON schema."""

    name: str
    properties: Mapping[str, Any]

    def json(self) -> dict[str, Any]:
        """The schema itself."""
        return {"type": "object", "title": self.name, "properties": dict(self.properties)}


def _fields(kind: str, *names: str) -> dict[str, Any]:
    return {name: {"type": kind} for name in names}


_STAMP: Final = {"type": "object", "properties": _fields("integer", "sec", "nsec")}
_VECTOR: Final = {"type": "object", "properties": _fields("number", "x", "y", "z")}
_POINT: Final = {"type": "object", "properties": _fields("number", "x", "y")}
_TURN: Final = {"type": "object", "properties": _fields("number", "x", "y", "z", "w")}
_NUMBERS: Final = {"type": "array", "items": {"type": "integer"}}
_POSE: Final = {"type": "object", "properties": {"position": _VECTOR, "orientation": _TURN}}
_OBJECTS: Final = {"type": "array", "items": {"type": "object"}}
_SOME_NUMBERS: Final = {"type": "array", "items": {"type": "number"}}
_NODE: Final = _fields("string", "robot", "node")

IMAGE_SCHEMA: Final = Schema(
    "foxglove.CompressedImage",
    {
        "detections": _OBJECTS,
        "timestamp": _STAMP,
        **_fields("string", "frame_id", "format"),
        "data": {"type": "string", "contentEncoding": "base64"},
    },
)
ANY_SCHEMA: Final = Schema("errand.Message", {})

SCHEMAS: Final[Mapping[str, Schema]] = MappingProxyType(
    {
        RUN: Schema(
            "errand.Run",
            {
                **_fields("string", "world"),
                **_fields("integer", "seed"),
                "commands": {"type": "array", "items": {"type": "string"}},
                "versions": {"type": "object"},
            },
        ),
        TREE: Schema("errand.Tree", {**_fields("string", "robot"), "root": {"type": "object"}}),
        TRANSITIONS: Schema(
            "errand.Transition",
            {**_NODE, **_fields("string", "from", "to", "cause", "message"), **_fields("number", "t")},
        ),
        ACTIVITY: Schema("errand.Activity", {**_NODE, **_fields("string", "message"), **_fields("number", "t")}),
        POSE: Schema(
            "foxglove.PoseInFrame",
            {
                "timestamp": _STAMP,
                **_fields("string", "frame_id", "robot"),
                "pose": _POSE,
            },
        ),
        OUTCOME: Schema(
            "errand.Outcome",
            {**_fields("string", "robot", "outcome", "cause", "message"), **_fields("integer", "ticks")},
        ),
        PATH: Schema(
            "foxglove.PosesInFrame",
            {
                "timestamp": _STAMP,
                **_fields("string", "frame_id", "robot"),
                "poses": {"type": "array", "items": _POSE},
            },
        ),
        BOXES: Schema("foxglove.ImageAnnotations", dict.fromkeys(("circles", "points", "texts"), _OBJECTS)),
        MAP: Schema(
            "errand.Map",
            {
                **_fields("string", "world", "frame_id", "format"),
                **_fields("number", "resolution_m"),
                "origin_m": _POINT,
                "size_m": _POINT,
                "data": {"type": "string", "contentEncoding": "base64"},
                "places": _OBJECTS,
            },
        ),
        ERRORS: Schema("errand.Error", _fields("string", "node", "what", "traceback")),
        CONTROL: Schema("errand.Control", {**_fields("string", "what", "message"), **_fields("number", "t")}),
        WALL: Schema(
            "errand.Wall",
            {
                **_fields("number", "wall_time_s", "limit_s"),
                **_fields("integer", "overruns"),
                "tick_s": _SOME_NUMBERS,
            },
        ),
        TASK_TOPIC: Schema(
            "errand.TaskMessage",
            {
                **_fields("number", "stamp", "goal_x", "goal_y"),
                **_fields("integer", "sequence", "mission_count", "task_count", "cmd_type"),
                **_fields("string", "robot_name"),
                **dict.fromkeys(("item_type", "item_count", "obj_type", "obj_count"), _NUMBERS),
            },
        ),
        DETECT_TOPIC: Schema(
            "errand.ObjectToDetect",
            {
                **_fields("number", "stamp"),
                **_fields("string", "robot_name"),
                "class_id": _NUMBERS,
                "class_name": {"type": "array", "items": {"type": "string"}},
            },
        ),
        DESTINATION_TOPIC: Schema(
            "errand.ObjectDestination",
            {
                **_fields("integer", "sequence", "class_id"),
                **_fields("string", "message_id", "class_name"),
                **_fields("number", "stamp", "goal_x", "goal_y", "goal_z"),
                **_fields("number", "distance_from_robot_x", "distance_from_robot_y", "distance_from_robot_z"),
            },
        ),
    }
)


def schema_of(topic: str, message: Mapping[str, Any]) -> Schema:
    """The schema of a topic; pictures have theirs wherever they come, other topics an open one."""
    return IMAGE_SCHEMA if message.get("format") == "jpeg" else SCHEMAS.get(topic, ANY_SCHEMA)
