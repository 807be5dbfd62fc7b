"""Objects that the robots saw during a run, from its event log."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from executive.record.reader import Event
from executive.record.schemas import TO_DETECT, TRACKS
from skills.api import ObjectObservation, Thing
from skills.detect.words import told_apart
from skills.perception.class_forms import THING


def seen_objects(events: Iterable[Event]) -> tuple[ObjectObservation, ...]:
    """The confirmed objects of a run, each once, in the order of the searches.

    An object is confirmed as in `detect`: seen from two viewpoints, and still believed to be of its class at the end of
    the search. Objects without a class are left out. Two objects of one class from different searches are the same if
    they are within `SAME_WITHIN_M`. The log has no sizes, so they are 0 here; the score is the belief.
    """
    searches: list[list[ObjectObservation]] = []
    open_searches: dict[str, int] = {}
    for event in events:
        robot = str(event.data.get("robot_name", ""))
        if event.topic == TO_DETECT:
            open_searches[robot] = len(searches)
            searches.append([])
        elif event.topic == TRACKS and robot in open_searches:
            sure = [track for track in event.data["tracks"] if track.get("confirmed") and track["class_name"] != THING]
            searches[open_searches[robot]] = [_observation(track) for track in sorted(sure, key=_number)]
    return told_apart(searches)


def _number(track: Mapping[str, Any]) -> int:
    return int(track["number"])


def _observation(track: Mapping[str, Any]) -> ObjectObservation:
    x_m, y_m, z_m = track["position_W"]
    return ObjectObservation(
        stamp_s=float(track["last_seen_s"]),
        thing=Thing(track["class_name"]),
        position_W=(x_m, y_m, z_m),
        size_m=(0.0, 0.0, 0.0),
        yaw_rad=0.0,
        score=float(track["belief"]),
        surface=track["surface"] or None,
    )
