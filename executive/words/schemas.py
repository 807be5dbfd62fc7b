"""Maps the topics of the event log to their JSON schemas (`schemas.yaml`); images and poses have Foxglove's schemas."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Final

from skills.inputs.yaml_source import read_yaml

if TYPE_CHECKING:
    from pydrake.math import RigidTransform

TREE: Final = "tree"
TRANSITIONS: Final = "transitions"
ACTIVITY: Final = "activity"
POSE: Final = "pose"
TRUTH: Final = "truth"
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
DOORS: Final = "doors"
MAP: Final = "map"
DETECTIONS: Final = "detections"
SPEECH: Final = "speech"
TRACKS: Final = "tracks"
TASK: Final = "taskChannel"
TO_DETECT: Final = "object_to_detect"
DESTINATION: Final = "object_destination"
LIBRARY: Final = "errand"
"""Name of the program in the head of its logs."""
TOPIC: Final = "topic"
"""Key of the topic in the metadata of one robot's channel."""
BOXES: Final = "detections/boxes"
SCAN: Final = "scan"
JOINTS: Final = "joints"
TRANSFORM: Final = "transform"
GRID: Final = "map/grid"
"""Topic of the map as a grid."""
ZONES: Final = "map/zones"
DERIVED: Final = frozenset({BOXES, TRANSFORM, GRID, ZONES})
"""Topics whose messages repeat others in a form that viewers draw."""
_PICTURE: Final = "picture"
_OTHERS: Final = "any"


@dataclass(frozen=True)
class Schema:
    """Named JSON schema."""

    name: str
    properties: Mapping[str, Any]

    def json(self) -> dict[str, Any]:
        """Returns the schema as JSON values."""
        return {"type": "object", "title": self.name, "properties": dict(self.properties)}


@cache
def schemas() -> Mapping[str, Schema]:
    """Returns the schemas by the topic that they belong to."""
    data = dict(read_yaml(Path(__file__).with_name("schemas.yaml")).data)
    types = data.pop("types")
    found = dict[str, Schema]()
    for topic, entry in data.items():  # an entry has the names of its fields by type
        names = {kind: fields.split() for kind, fields in entry.items() if kind != "schema"}
        properties = {name: types[kind] for kind, fields in names.items() for name in fields}
        found[topic] = Schema(entry["schema"], properties)
    return MappingProxyType(found)


def schema_of(topic: str, message: Mapping[str, Any]) -> Schema:
    """Returns a topic's schema: the picture schema for any topic with pictures, an open schema for an unknown topic."""
    known = schemas()
    return known[_PICTURE] if message.get("format") == "jpeg" else known.get(topic, known[_OTHERS])


def stamp(time_s: float) -> dict[str, int]:
    """Converts seconds to a time in the message formats: seconds and nanoseconds."""
    nanoseconds = round(time_s * 1e9)
    return {"sec": nanoseconds // 10**9, "nsec": nanoseconds % 10**9}


def pose_values(X_AB: RigidTransform) -> dict[str, Any]:
    """Converts a pose to position and orientation in the message formats."""
    p, q = X_AB.translation(), X_AB.rotation().ToQuaternion()
    turn = {"x": q.x(), "y": q.y(), "z": q.z(), "w": q.w()}
    return {"position": {"x": p[0], "y": p[1], "z": p[2]}, "orientation": turn}
