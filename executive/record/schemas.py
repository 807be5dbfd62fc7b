"""The topics of the event log and their JSON schemas (`schemas.yaml`); images and poses are as Foxglove draws them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

from skills.files.yaml_source import read_yaml

TREE: Final = "tree"
TRANSITIONS: Final = "transitions"
ACTIVITY: Final = "activity"
POSE: Final = "pose"
STATE: Final = "state"
OUTCOME: Final = "outcome"
RUN: Final = "run"
WALL: Final = "wall"
CONTROL: Final = "control"
WORK: Final = "work"
ERRORS: Final = "errors"
PATH: Final = "path"
RESERVED_PATH: Final = "reserved_path"
MISSIONS: Final = "missions"
NAVIGATION: Final = "navigation"
MAP: Final = "map"
DETECTIONS: Final = "detections"
SPEECH: Final = "speech"
TRACKS: Final = "tracks"
TASK: Final = "taskChannel"
TO_DETECT: Final = "object_to_detect"
DESTINATION: Final = "object_destination"
TOPIC: Final = "topic"
"""Names the topic in the metadata of a channel that is one robot's."""
BOXES: Final = "detections/boxes"
_PICTURE: Final = "picture"
_OTHERS: Final = "any"


@dataclass(frozen=True)
class Schema:
    """A named JSON schema."""

    name: str
    properties: Mapping[str, Any]

    def json(self) -> dict[str, Any]:
        """The schema itself."""
        return {"type": "object", "title": self.name, "properties": dict(self.properties)}


@cache
def schemas() -> Mapping[str, Schema]:
    """The schemas by topic."""
    data = dict(read_yaml(Path(__file__).with_name("schemas.yaml")).data)
    types = data.pop("types")
    return MappingProxyType({topic: _schema(types, **entry) for topic, entry in data.items()})


def schema_of(topic: str, message: Mapping[str, Any]) -> Schema:
    """The schema of a topic; pictures have theirs wherever they come, other topics an open one."""
    known = schemas()
    return known[_PICTURE] if message.get("format") == "jpeg" else known.get(topic, known[_OTHERS])


def _schema(types: Mapping[str, Any], schema: str, **fields: str) -> Schema:
    """A schema from the names of its fields by type, as they stand in the file."""
    return Schema(schema, {name: types[kind] for kind, names in fields.items() for name in names.split()})


def stamp(time_s: float) -> dict[str, int]:
    """Seconds as the message formats have them."""
    nanoseconds = round(time_s * 1e9)
    return {"sec": nanoseconds // 10**9, "nsec": nanoseconds % 10**9}
